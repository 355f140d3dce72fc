// A camera's pose made finer by natural points: where tags are few or all in
// one corner of the picture, the points around hold the pose still.
#pragma once
#include "capture/recording/place.h"
#include "locate/pose_solver.h"
#include "platform/image_features.h"

enum {
    FEATURES_MAX = 1000,
    LANDMARK_NARROW_PX = 4, // a search no wider than this finds few wrong features, so they may look less alike
};

// The features of one picture, sorted so that those near a pixel are found fast.
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
    int32_t point, feature;
};

// Which feature shows which point, looked for within radius_px of where the pose
// puts the point. motion, here and below: of a rolling shutter, or NULL. only_facing: of points that the camera sees
// from about the side from which the sweep saw them. Each point and each feature at most once. Returns how many.
int landmarks_match(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                    const struct lens *lens, const struct shutter_motion *motion, const struct pose *camera_from_world,
                    double radius_px, bool only_facing, struct landmark_match *out, int capacity);

// From a pose that is roughly right (tags gave it) to one that fits points and
// tags. depth[i]: metres at feature i, 0 = none; or NULL. On true `pose` (and the speed of
// `motion`) is the better one and matches[0 .. *match_count) are the points that agree; on false (too few do)
// nothing changed.
bool landmarks_refine_pose(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                           const double *depth, const struct lens *lens, const struct pnp_tag *tags, int tag_count,
                           struct shutter_motion *motion, struct pose *camera_from_world,
                           struct landmark_match *matches, int capacity, int *match_count);

// What matches say, for a fit: out has room for `count`, which is returned. camera_from_world: about.
int landmark_correspondences(const struct place_point *points, const struct feature_index *index, const double *depth,
                             const struct lens *lens, const struct pose *camera_from_world,
                             const struct landmark_match *matches, int count, struct pnp_point *out);

// The mean depth around a pixel where the surface is smooth, metres; 0 elsewhere.
// depth: millimetres, of the same pixels as `lens`.
double feature_depth(const struct lens *lens, const uint16_t *depth, struct pixel at);

// The covariance of a feature's place, pixels^2: xx, xy, yy. Across an edge it is known well, along it badly.
void feature_covariance(const struct feature *f, double out[3]);

// The same of one that should show a point: the less alike they look, the less exactly it does.
void match_covariance(const struct place_point *point, const struct feature *f, double out[3]);

// The same of where it is from where the place has its point: the feature errs, so did those of the sweep, and the
// point may lie elsewhere along their lines of sight.
void landmark_covariance(const struct place_point *point, const struct feature *f, const struct lens *lens,
                         const struct pose *camera_from_world, double out[3]);

// The variance of the point's distance along z, m^2; 0: not known.
double landmark_depth_variance(const struct place_point *point, const struct pose *camera_from_world);

// About the same whichever way, for a pose that is only roughly right: standard deviation, pixels.
static inline double feature_sigma(const struct feature *f) { return 0.6 * f->scale; }
