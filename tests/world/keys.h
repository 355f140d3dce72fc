// The named motions' key poses. Internal to tests/world.
#pragma once
#include "base/geometry.h"

// One pose. Lengths for a figure of 1.75 m, scaled to its height (but x and y, which are the room's). Angles in
// degrees; a positive yaw turns to the figure's own left, a positive pitch leans forward. Directions are in the chest's
// frame (x outwards on the arm's side, y backwards, z up) and need no unit length. All doubles, so that a curve may run
// through each number.
struct key {
    double t;
    double x, y, heading; // the path, world; heading 0 faces the sensor
    double sink;          // of the pelvis
    double pelvis_yaw, pelvis_pitch;
    double chest_yaw, chest_pitch, chest_roll;
    double head_yaw, head_pitch;
    double apart;     // extra distance of each foot from the middle
    struct vec3 hips; // the pelvis's offset from the path, in the figure's axes
    struct arm_key {
        struct vec3 upper, fore;
    } left_arm, right_arm;
    struct vec3 left_foot, right_foot; // offset from the foot's point on the floor, in the figure's axes
    double left_toes, right_toes;      // pitch of the foot: positive lifts the heel
};

struct named_motion {
    const char *name;
    double step_s;
    const struct key *keys;
    int count;
};

extern const struct named_motion named_motions[];
extern const size_t named_motion_count;
