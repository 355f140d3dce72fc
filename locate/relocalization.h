// A camera's pose from natural points alone, without an idea of where it is:
// descriptors are matched against the whole place, and three matches at a time
// give poses until one is found that many others agree with. Pure, deterministic.
#pragma once
#include "locate/landmark_matching.h"

// The feature that shows each point, over the whole picture; only where it is clearly
// the best and each is the other's best. Best first. Returns how many.
int relocalize_match(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                     struct landmark_match *out, int capacity);

// The pose most matches agree with, to about a pixel; a first idea for landmarks_refine_pose.
// motion: of a rolling shutter, or NULL. agree: out, how many. False, nothing written: too few agree for it to be no
// chance.
bool relocalize(const struct place_point *points, const struct feature_index *index, const struct lens *lens,
                const struct landmark_match *matches, int count, struct shutter_motion *motion,
                struct pose *camera_from_world, int *agree);
