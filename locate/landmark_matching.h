// Guided matching of landmarks to the features of one image, and refinement of a pose by the matches. Features are ORB
// (Rublee et al. 2011): a landmark is looked for near its projection, and the feature with the smallest Hamming
// distance within a radius is taken if it is clearly the best (ratio test). Pure, deterministic; the functions that
// match or refine keep about 200 KiB on the stack.
#pragma once
#include "locate/pose_solver.h"
#include "platform/vision/image_features.h"
#include "recording/place.h"

enum {
    FEATURES_MAX = 1000,
    LANDMARK_NARROW_PX = 4, // a search no wider than this meets few wrong features, so more bits may differ
};

// The features of one image, sorted into cells so that those near a pixel are found fast.
struct feature_index {
    const struct feature *features; // borrowed
    int count;
    int across, down;
    int start[4097]; // of each cell in `order`; across * down <= 4096
    int order[FEATURES_MAX];
};
void feature_index_build(struct feature_index *index, const struct feature *features, int count,
                         const struct lens *lens);

struct landmark_match {
    int32_t point, feature; // indices into match_query.points and index->features
};

// What is matched with what. All borrowed.
struct match_query {
    const struct place_landmark *points; // the landmarks
    int32_t point_count;
    const struct feature_index *index;
    const double *depth; // metres at each feature, 0: none; or NULL
    const struct lens *lens;
    struct pnp_tag *tags; // seen in the same image, for landmarks_refine_pose; or NULL
    int tag_count;
};

// How far from its projection a landmark is looked for.
struct match_window {
    double radius_px;
    bool only_facing; // landmarks that the camera sees from about the side from which the sweep saw them
};

// Which feature shows which landmark, given the pose. motion, here and below: with a rolling shutter; or NULL. Each
// landmark and each feature at most once. Returns how many.
int landmarks_match(const struct match_query *query, struct match_window window, const struct shutter_motion *motion,
                    const struct pose *camera_from_world, struct landmark_match *out, int capacity);

// Refines a roughly known pose (and *motion) by landmarks and tags. True: matches[0 .. *match_count) are the landmarks
// that agree with it. False: too few agree; the pose, *motion and *match_count are unchanged.
bool landmarks_refine_pose(const struct match_query *query, struct shutter_motion *motion,
                           struct pose *camera_from_world, struct landmark_match *matches, int capacity,
                           int *match_count);

// The matches as measurements for the pose solver; out has space for `count`, which is returned. camera_from_world:
// roughly, for the covariances.
int landmark_correspondences(const struct match_query *query, const struct pose *camera_from_world,
                             const struct landmark_match *matches, int count, struct pnp_point *out);

// The mean depth around a pixel where the surface is smooth, metres; 0 elsewhere.
// depth: millimetres, of the same pixels as `lens`.
double feature_depth(const struct lens *lens, const uint16_t *depth, struct pixel at);

// The covariance of a feature's position, pixels^2: xx, xy, yy. Small across an edge, large along it.
void feature_covariance(const struct feature *feature, double out[3]);

// The same of a feature matched to a landmark: the more bits of the descriptors differ, the larger.
void match_covariance(const struct place_landmark *point, const struct feature *feature, double out[3]);

// The covariance of the reprojection error of a match: of the feature, of the sweep's features, and of the landmark's
// position in the map.
void landmark_covariance(const struct place_landmark *point, const struct feature *feature, const struct lens *lens,
                         const struct pose *camera_from_world, double out[3]);

// The variance of the landmark's distance along the camera's z, m^2; 0: not known.
double landmark_depth_variance(const struct place_landmark *point, const struct pose *camera_from_world);

// An isotropic standard deviation, pixels, for a pose that is only roughly known.
static inline double feature_sigma(const struct feature *feature) { return 0.6 * feature->scale; }
