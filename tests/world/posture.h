// Postures of people on the floor, on chairs and on their feet, drawn at random within what joints allow, and motions
// from one to another of the same kind. Internal to tests/world. Pure.
#pragma once
#include "tests/support/random.h"
#include "tests/world/body.h"

enum posture {
    POSTURE_STANDING,
    POSTURE_ONE_LEG,
    POSTURE_BENT,
    POSTURE_CROUCHING,
    POSTURE_SITTING, // on a chair
    POSTURE_WHEELCHAIR,
    POSTURE_SITTING_ON_FLOOR,
    POSTURE_KNEELING,
    POSTURE_ON_HEELS, // kneeling, sat back
    POSTURE_HALF_KNEELING,
    POSTURE_ALL_FOURS,
    POSTURE_PUSH_UP,
    POSTURE_LYING_ON_BACK,
    POSTURE_BRIDGE,
    POSTURE_LYING_ON_SIDE,
    POSTURE_LYING_ON_FRONT,
    POSTURES
};

// "standing", "one-leg", …
const char *posture_name(enum posture posture);
bool posture_named(const char *name, enum posture *out); // false: no such name

// Angles of the joints, radians, and directions of the arms. All doubles, so that two are mixed number by number.
struct posture_pose {
    double second;                             // which leg is the second, where they differ: LEFT or RIGHT
    double pitch, roll;                        // of the pelvis: leant forwards; to its right
    double chest_pitch, chest_yaw, chest_roll; // against the pelvis
    double head_pitch, head_yaw;               // against the chest
    struct posture_leg {
        double flexed, apart, turned; // the hip
        double knee, toes;            // toes: the foot stretched
    } leg[2];
    struct posture_arm {
        struct vec3 upper, fore; // x outwards, y backwards, z up; unit length
    } arm[2];
};

// swapped: left and right exchanged, where the two do different things.
struct posture_pose posture_draw(enum posture posture, bool swapped, struct rng *rng);
struct posture_pose posture_mix(const struct posture_pose *a, const struct posture_pose *b, double share);

// At rest on the floor, at the origin, heading 0: feet, knees or pelvis stay where they are from one pose to another.
// What lies or props itself up falls until it is supported on both sides of its centre.
struct stance posture_stance(enum posture posture, const struct posture_pose *pose, const struct physique *physique);

// What it rests on, beside the floor, as boxes in the same axes: the seat and back of a chair, a wheelchair's wheels.
enum { POSTURE_BOXES = 4 };
struct posture_box {
    struct vec3 low, high;
};
int posture_furniture(enum posture posture, const struct stance *stance, const struct physique *physique,
                      struct posture_box out[POSTURE_BOXES]);

// ---------------------------------------------------------------- motion

enum { POSTURE_KEYS = 5 };
// Four seconds among five poses of one kind, each near the next.
struct posture_motion {
    enum posture posture;
    struct posture_pose key[POSTURE_KEYS];
};
struct posture_motion posture_motion_draw(enum posture posture, uint64_t seed);
double posture_motion_seconds(void);
struct stance posture_motion_at(const struct posture_motion *motion, const struct physique *physique, double time_s);
