// Follows one person with a depth sensor, in one way for a take, for the live screens and for the studio's preview, so
// that what is shown before a take is what the take will do.
//
// Method: the sensor is located in the place (sensor_pose.h). Once it is, and again when it was moved, the place's
// depth from there (background_depth.h) and the floor go to the tracker (tracker.h), which segments and tracks the
// person with them, and with body points of the colour images where there are some. Points of an earlier image are
// moved to where they are by now (point_finder.h). Without a place or colour, everything works from depth alone.
//
// Body points come either from the follower's own thread, which looks at the newest image when it is free, so that no
// frame waits for it (point_finder.h), or from the caller, before each frame.
//
// The same frames and points give the same skeletons. Frames: world_from_camera and skeletons are the colour camera's;
// metres. One handle, one thread. Memory: the tracker's, two bytes a depth pixel, the map's for locating, and with
// finds_points the finder's.
#pragma once
#include "capture/body/point_evidence.h"
#include "capture/sensor_pose.h"
#include "capture/tracking/tracker.h"

struct follower;

struct follower_options {
    const struct place *place; // to locate the sensor in; NULL or empty: none. Must outlive the follower
    bool finds_points;         // on a thread of its own; else the points are those of follower_set_points
};
struct follower_options follower_default_options(void); // no place, no points

// Copies the calibration. options NULL: the defaults. ERR_INPUT: no usable depth lens, or a damaged place. ERR_MEMORY.
// On error *out is NULL.
MUST_CHECK enum status follower_open(struct follower **out, const struct calibration *calibration,
                                     const struct follower_options *options);
void follower_close(struct follower **follower); // NULL is fine; waits for the thread; sets *follower = NULL

// Another person comes in, or the film starts again: forgets the person, the learned background and the points; keeps
// where the sensor is.
void follower_reset(struct follower *follower);

// What was found in the colour image of that time, the next frame's or an earlier one's; used by the next frame with
// depth only. Copied.
void follower_set_points(struct follower *follower, int64_t image_ns, const struct body_points *points);

// One frame; borrowed until the call returns.
struct follower_frame {
    int64_t time_ns;       // rising
    const uint8_t *color;  // RGB; NULL: none
    const uint16_t *depth; // millimetres, 0 = no reading; NULL: none, and no person then
    uint8_t *mask;         // gets one byte a depth pixel, 255 = the person; NULL: not wanted
    bool has_odometry;     // as in struct frame (source.h)
    struct pose odometry_from_camera;
};

struct followed_frame {
    bool located;                  // the sensor is, in the place
    struct pose world_from_camera; // the place's world; where it is not located upright by odometry, else the identity
    struct sensor_sight sight;     // how well, and by which tags; without a place all 0
    int sensor_moves;              // how often the sensor was moved since the follower was opened
    bool person;
    struct skeleton skeleton; // colour camera's axes; confidence 0 throughout without a person
};

// ERR_MEMORY, ERR_SOLVER: the next frame may be tried.
MUST_CHECK enum status follower_next(struct follower *follower, const struct follower_frame *frame,
                                     struct followed_frame *out);

// The two halves of follower_next, for who holds frames back until the sensor's pose is averaged over
// SENSOR_POSE_WARM_UP of them: each frame is located once, in order, and tracked once, in order. The own thread gets no
// images of them.
MUST_CHECK enum status follower_locate(struct follower *follower, const struct follower_frame *frame);
MUST_CHECK enum status follower_track(struct follower *follower, const struct follower_frame *frame,
                                      struct followed_frame *out);

// For what else is asked of them; borrowed until follower_close. sensor_pose: NULL without a place or without colour.
struct tracker *follower_tracker(struct follower *follower);
const struct sensor_pose *follower_sensor_pose(const struct follower *follower);

// How the own thread looks for body points.
struct follower_points {
    int64_t looked;    // colour images that were looked at
    char why_not[256]; // why none are, although wanted: one sentence; "": they are, or there is no colour
};
struct follower_points follower_query_points(struct follower *follower);
