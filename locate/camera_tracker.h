// Tracks a camera in a place from image to image: each image is searched where the earlier ones predict tags and
// landmarks, which is much cheaper than localisation from scratch, and the measured pose updates a constant-velocity
// Kalman filter (locate/pose_fusion.h). Where tracking fails, the camera is localised from scratch (locate/locator.h).
//
//     struct camera_tracker *tracker;
//     struct camera_motion motion;
//     if (camera_tracker_open(&tracker, &place, &lens, NULL) == OK)
//         for each image:
//             if (camera_tracker_process(tracker, color, NULL, time_ns, &at, &motion) == OK)
//                 draw from at.world_from_camera
//
// Axes, 6-vectors and memory: locate/locator.h. Deterministic. One handle belongs to one thread.
#pragma once
#include "locate/locator.h"

// How a camera moves.
struct camera_motion {
    int64_t time_ns; // of the image
    struct pose world_from_camera;
    struct vec3 linear_velocity, angular_velocity; // in the camera's own axes: m/s, rad/s
};

struct camera_tracker;

// As locator_open.
MUST_CHECK enum status camera_tracker_open(struct camera_tracker **out, const struct place *place,
                                           const struct lens *lens, const struct locator_options *options);
void camera_tracker_close(struct camera_tracker **tracker); // NULL is fine; sets *tracker = NULL

// The next image. color, depth: as locator_localize. time_ns: when it was taken, later than the last.
// OK         *out and *motion filled; the covariance includes the earlier images
// AMBIGUOUS  the same, but a mirrored pose fits nearly as well; both are tracked until one wins
// NOTHING    the camera is lost; *out and *motion untouched. The next image is localised from scratch
// ERR_ORDER  time_ns is not later; nothing changed
// Other errors as locator_localize; the next image may be tried.
MUST_CHECK enum status camera_tracker_process(struct camera_tracker *tracker, const uint8_t *color,
                                              const uint16_t *depth, int64_t time_ns, struct location *out,
                                              struct camera_motion *motion);

// The two halves of camera_tracker_process, for a caller that cannot wait for localisation from scratch.
// camera_tracker_track: as camera_tracker_process, but NOTHING where the image has to be localised from scratch.
// camera_tracker_localize does that, with the very image for which camera_tracker_track returned NOTHING; it takes some
// fifteen times as long.
MUST_CHECK enum status camera_tracker_track(struct camera_tracker *tracker, const uint8_t *color, const uint16_t *depth,
                                            int64_t time_ns, struct location *out, struct camera_motion *motion);
MUST_CHECK enum status camera_tracker_localize(struct camera_tracker *tracker, const uint8_t *color,
                                               const uint16_t *depth, struct location *out,
                                               struct camera_motion *motion);

// The camera's clock has been restarted: pose, motion and time are forgotten, what was estimated of the place's
// landmarks, tags and the lens is kept.
void camera_tracker_reset(struct camera_tracker *tracker);

// As locator_lens, locator_focal_is_wrong and locator_moved_tags.
const struct lens *camera_tracker_lens(const struct camera_tracker *tracker);
bool camera_tracker_focal_is_wrong(const struct camera_tracker *tracker, double *scale);
int32_t camera_tracker_moved_tags(const struct camera_tracker *tracker, int32_t *first);
