// Body points of an image that is some frames old, moved to where they are by now: each goes by what its joint has gone
// in the image since, as tracked, and as it goes on at constant velocity from the last tracked frame to the next. Pure.
#pragma once
#include "capture/body/point_evidence.h"
#include "recording/skeleton.h"

enum { POINT_MOTION_FRAMES = 12 };
#define POINT_MOTION_MOST_NS INT64_C(300000000) // older points are of no use

struct tracked_frame {
    int64_t time_ns;
    bool person;
    struct vec3 joint[JOINT_COUNT]; // colour camera's axes
    float confidence[JOINT_COUNT];
};

struct point_motion {
    struct tracked_frame at[POINT_MOTION_FRAMES]; // a ring
    int next, count;
};

// skeleton: colour camera's axes; NULL: no person.
void point_motion_add(struct point_motion *m, int64_t time_ns, const struct skeleton *skeleton);
void point_motion_clear(struct point_motion *m);

// Moves the points of the image at `from_ns` to now_ns, which is not before it. False: they are too old, or of no frame
// that was added, unless it is now_ns's own. Points whose joints were not known then and last stay where they are.
bool point_motion_apply(const struct point_motion *m, const struct lens *color, int64_t from_ns, int64_t now_ns,
                        struct body_points *points);
