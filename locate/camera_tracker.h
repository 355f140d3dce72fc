// A camera followed from picture to picture in a place: each picture is searched
// where the last ones say that tags and points must be, which is much cheaper than
// finding the camera anew, and what it shows is weighed against how the camera moved.
// Where that fails, the camera is found anew.
//
//     struct camera_tracker *track;
//     struct camera_motion motion;
//     if (camera_tracker_open(&track, &place, &lens, NULL) == OK)
//         for each picture:
//             if (camera_tracker_process(track, color, NULL, time_ns, &at, &motion) == OK)
//                 draw with camera_motion_at(&motion, when it will be on the screen)
//
// Deterministic. One handle belongs to one thread; a `struct camera_motion` is a plain value that
// may be copied to another, and camera_motion_at is pure.
#pragma once
#include "locate/locator.h"

// How a camera moves: as far as a tenth of a second ahead, as if it kept on.
struct camera_motion {
    int64_t time_ns; // of the picture
    struct pose world_from_camera;
    struct vec3 shift, turn; // each second, in the camera's own axes: m/s, rad/s
};

// Where the camera is at `time_ns`, before or after motion->time_ns. Further than
// CAMERA_MAX_EXTRAPOLATION_NS off it is as it is there.
enum { CAMERA_MAX_EXTRAPOLATION_NS = 100000000 };
struct pose camera_motion_at(const struct camera_motion *motion, int64_t time_ns);

struct camera_tracker;

// As locator_open.
MUST_CHECK enum status camera_tracker_open(struct camera_tracker **out, const struct place *place,
                                           const struct lens *lens, const struct locator_options *options);
void camera_tracker_close(struct camera_tracker **t); // NULL is fine; sets *t = NULL

// The next picture. color, depth: as locator_localize. time_ns: when it was taken, later than the last.
// OK         *out and *motion filled; the covariance knows of the pictures before
// AMBIGUOUS  the same, but a mirrored pose fits nearly as well; both are followed until one wins
// NOTHING    the camera is lost; *out and *motion untouched. It is found anew as soon as it can be
// ERR_ORDER: time_ns is not later.
MUST_CHECK enum status camera_tracker_process(struct camera_tracker *t, const uint8_t *color, const uint16_t *depth,
                                              int64_t time_ns, struct location *out, struct camera_motion *motion);

// The two halves of camera_tracker_process, for whoever has no time to find a camera anew. camera_tracker_track: as
// camera_tracker_process, but NOTHING where the camera has to be found anew. camera_tracker_localize does that, with
// the very picture for which camera_tracker_track said so; it takes some fifteen times as long.
MUST_CHECK enum status camera_tracker_track(struct camera_tracker *t, const uint8_t *color, const uint16_t *depth,
                                            int64_t time_ns, struct location *out, struct camera_motion *motion);
MUST_CHECK enum status camera_tracker_localize(struct camera_tracker *t, const uint8_t *color, const uint16_t *depth,
                                               struct location *out, struct camera_motion *motion);

// The camera's clock begins anew: its place and motion are void, what was learnt of the place's points is not.
void camera_tracker_reset(struct camera_tracker *t);

// As locator_lens, locator_focal_is_wrong and locator_moved_tags.
const struct lens *camera_tracker_lens(const struct camera_tracker *t);
bool camera_tracker_focal_is_wrong(const struct camera_tracker *t, double *scale);
int32_t camera_tracker_moved_tags(const struct camera_tracker *t, int32_t *first);
