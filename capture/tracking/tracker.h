// Follows one person's 16 joints through depth pictures, by depth alone.
//
// A jointed body of rounded shapes is laid into every picture; it goes on
// moving as it moved, learns the person's proportions over the first seconds
// and keeps them. Works from the first frame on, with the person standing or
// moving, facing the sensor at the start unless the picture says otherwise.
//
// The output of a frame depends on this and earlier frames only. The same
// frames give the same skeletons. The sensor must stand still; a moved sensor
// is noticed by its background and costs some frames. One handle, one thread.
#pragma once
#include "capture/recording/skeleton.h"
#include "base/lens.h"

struct tracker;

struct tracker_options {
    int points;        // of the person, a frame. More is steadier and slower. 100..1600, default 600
    int iterations;    // a frame, 1..30. Default 5
    double learn_s;    // how long proportions are learned, from the first frame. Default 10
    double patience_s; // how long a person out of sight is expected back where they were. Default 0.7
};
struct tracker_options tracker_default_options(void);

// Copies what it needs. options NULL: the defaults. ERR_INPUT: no or a senseless
// depth lens, options out of range. ERR_MEMORY. On error *out is NULL.
MUST_CHECK enum status tracker_open(struct tracker **out, const struct calibration *calibration,
                                    const struct tracker_options *options);
void tracker_close(struct tracker **t); // NULL is fine; sets *t = NULL

// What is known of the empty room, from where the sensor stands: depth, one
// value a depth pixel, 0 = unknown; copied. NULL takes it back.
void tracker_set_background(struct tracker *t, const uint16_t *depth);
// The floor in depth camera axes: a point p is up.p + height_m over it. Found by itself where not given.
void tracker_set_floor(struct tracker *t, struct vec3 up, double height_m);

// Forgets the person and what was learned of the room; keeps what was set.
void tracker_reset(struct tracker *t);

// One frame. time_ns: rising; a clock that jumps back starts the motion anew.
// depth: of the calibration's depth lens. mask: one byte a depth pixel, 255 = the person; may be NULL.
// OK       *out (colour camera's axes, metres) and mask are filled
// NOTHING  no person in sight; *out is all confidence 0, mask all 0
// ERR_MEMORY
MUST_CHECK enum status tracker_next(struct tracker *t, int64_t time_ns, const uint16_t *depth, struct skeleton *out,
                                    uint8_t *mask);

// What the last tracker_next spent its time on, processor time of its thread, ns.
struct tracker_times {
    int64_t segment, evidence, fit, search; // search: for limbs, the way round, a new person
};
struct tracker_times tracker_last_times(const struct tracker *t);
