// The figure's bones: proportions for a given height and build, and forward kinematics of a stance. Bind frame:
// standing at the origin facing -y, x to its own left, z up, soles at z = 0, arms half raised sideways; metres.
// Internal to tests/world. Pure functions.
#pragma once
#include "tests/world/world.h"

enum bone {
    BONE_PELVIS,
    BONE_BELLY,
    BONE_CHEST,
    BONE_NECK,
    BONE_HEAD,
    BONE_LEFT_UPPER_ARM,
    BONE_LEFT_FOREARM,
    BONE_LEFT_HAND,
    BONE_RIGHT_UPPER_ARM,
    BONE_RIGHT_FOREARM,
    BONE_RIGHT_HAND,
    BONE_LEFT_THIGH,
    BONE_LEFT_SHIN,
    BONE_LEFT_FOOT,
    BONE_RIGHT_THIGH,
    BONE_RIGHT_SHIN,
    BONE_RIGHT_FOOT,
    BONE_COUNT
};

enum { LEFT = 0, RIGHT = 1 };

struct physique {
    struct world_figure figure;
    struct vec3 bind_joint[JOINT_COUNT]; // the joints in the bind frame
    struct vec3 wrist[2];
    struct vec3 skull; // where the head rotates on the neck
    struct vec3 arm;   // the left arm's direction in the bind pose; the right's has -x
    double thigh_m, shin_m, upper_arm_m, forearm_m;
    double girth; // thickness of trunk and limbs, 1 for a medium build
};

// What a motion prescribes. World axes; directions of unit length.
struct stance {
    struct vec3 waist;
    struct quat pelvis, chest, head;      // world from bind
    struct vec3 upper_arm[2], forearm[2]; // directions
    struct vec3 ankle[2];                 // reached when the legs are long enough
    struct quat foot[2];                  // world from bind
    struct vec3 knee[2];                  // the direction the knee points to
};

struct posed {
    struct pose world_from_bind[BONE_COUNT];
    struct skeleton joints; // world axes
};

struct physique physique_of(const struct world_figure *figure);
void physique_pose(const struct physique *p, const struct stance *stance, struct posed *out);
