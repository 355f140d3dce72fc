// What the live screens know of one frame of a depth sensor: the person's skeleton in the world, and how each part
// differs from the reference. The person is followed as in a take (capture/follow.h), with body points from a thread
// beside it where they are wanted, and judged by compare/live_judge.h.
//
// World axes: z up, metres. The place's world where the sensor is located in it; else the origin is on the floor below
// the sensor, y is ahead of it, and the floor is what segmentation found (until then the sensor counts as level, 1 m
// high).
//
// No file; one handle, one thread. Without body points there is no other thread, and the same frames give the same
// answers. Memory is constant but for the reference's alignment prices (8 bytes a frame).
#pragma once
#include "base/lens.h"
#include "capture/follow.h"
#include "compare/joint_samples.h"
#include "compare/live_judge.h"
#include "recording/place.h"

struct live_tracker;

struct live_tracker_options {
    const struct calibration *calibration; // of the sensor; copied
    const struct place *place;             // to locate it in; NULL or empty: none. Must outlive the tracker
    const struct movement *reference;      // to judge by; NULL: only tracked. Must outlive the tracker
    const struct movement *mirrored;       // its mirror image; NULL: never judged by. Must outlive the tracker
    bool finds_points;                     // body points, in colour images, on a thread of their own
};
// ERR_INPUT: no usable depth lens. ERR_MEMORY. *out is then NULL.
MUST_CHECK enum status live_tracker_open(struct live_tracker **out, const struct live_tracker_options *options);
void live_tracker_close(struct live_tracker **tracker); // NULL is fine; sets *tracker = NULL

// Which of the reference's frames is shown to the person now, and among which theirs is looked for.
struct live_shown {
    int32_t frame, first, end;
    bool mirrored;               // judged by the mirror image
    struct expectation expected; // what counts of `reference`; at first everything
};
void live_tracker_show(struct live_tracker *tracker, const struct live_shown *shown);
void live_tracker_restart_judge(struct live_tracker *tracker); // an attempt begins
// While an attempt is made its world stays the one in which it began: where the sensor is located only then, the place
// is not the world before its end.
void live_tracker_hold_world(struct live_tracker *tracker, bool hold);
// And the person, the learned background and the body points are forgotten, too.
void live_tracker_reset(struct live_tracker *tracker);

struct live_look {
    bool located;                  // the sensor is, in the place
    struct pose place_from_camera; // of the colour camera; identity where it is not located
    bool in_place;                 // the world is the place
    struct pose world_from_camera; // of the colour camera
    bool person, second_person;
    struct skeleton skeleton;   // colour camera's axes; confidence 0 throughout without a person
    struct skeleton in_world;   // the same, world axes
    struct joint_sample sample; // the same as compare/ takes it, time_ns included
    bool judged;                // the fields below are known
    int32_t reference;          // the reference's frame that the person shows
    double away_rad;            // from the reference's frame that is shown; live_judge_away
    struct part_difference parts[PART_COUNT];
    double track_ms, judge_ms; // processor time of tracking, and of judging with all that only it needs
};

// One frame. color: NULL where the sensor has none. mask: one byte a depth pixel, 255 = the person; may be NULL.
// ERR_MEMORY, ERR_SOLVER: the next frame may be tried.
MUST_CHECK enum status live_tracker_next(struct live_tracker *t, int64_t time_ns, const uint8_t *color,
                                         const uint16_t *depth, uint8_t *mask, struct live_look *out);

struct follower_points live_tracker_query_points(struct live_tracker *tracker); // how body points are looked for
