// Relocalisation: a camera's pose from landmarks alone, without a previous pose. Descriptors are matched against the
// whole place (ratio test, mutual best); RANSAC over three matches at a time (P3P by Grunert's equation as in Haralick
// et al. 1994) finds the pose with the most inliers. Matches with few differing bits are drawn first (as in PROSAC,
// Chum & Matas 2005). Pure, deterministic: a fixed seed.
#pragma once
#include "locate/landmark_matching.h"

// The feature that shows each landmark, over the whole image; only where it is clearly the best and each is the other's
// best. Best first. Returns how many.
int relocalize_match(const struct match_query *query, struct landmark_match *out, int capacity);

// The pose with the most inliers among `matches`, to about a pixel; a start for landmarks_refine_pose.
// motion: with a rolling shutter, in: prior, out: estimate; or NULL. *inliers: how many. False, nothing written: too
// few for it not to be chance.
bool relocalize(const struct match_query *query, const struct landmark_match *matches, int count,
                struct shutter_motion *motion, struct pose *camera_from_world, int *inliers);
