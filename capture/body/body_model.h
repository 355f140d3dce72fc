// A person made of 18 stiff segments and 19 rounded shapes, 21 in a skirt or a coat:
// what the tracker lays into the depth picture.
//
// Body axes of every segment at rest (standing, arms hanging): x to the
// person's left, y up, z ahead. A pose is the pelvis in the camera and one turn
// for each further segment against its parent; a build is what follows from
// pose and shape. Camera axes and metres; pure functions, safe from any thread.
//
// Proportions at the start are the fractions of body height of Drillis and
// Contini (Body Segment Parameters, 1966; after Winter, Biomechanics and Motor
// Control of Human Movement, fig. 4.1); breadths and depths of the trunk follow
// Pheasant and Haslegrave (Bodyspace, table 10.1: chest 250 mm deep, abdomen
// 260). The joints of the spine lie in it, behind the trunk's middle, the hip joints
// 3 cm ahead of it, and knees 1 cm lower than there: so they were measured on people
// of many sizes (docs/figures.md). The shape scales all of it to the person.
#pragma once
#include "capture/recording/skeleton.h"

enum segment {
    SEG_PELVIS,
    SEG_ABDOMEN,
    SEG_CHEST,
    SEG_HEAD,
    SEG_LEFT_CLAVICLE,
    SEG_LEFT_UPPER_ARM,
    SEG_LEFT_FOREARM,
    SEG_LEFT_HAND,
    SEG_RIGHT_CLAVICLE,
    SEG_RIGHT_UPPER_ARM,
    SEG_RIGHT_FOREARM,
    SEG_RIGHT_HAND,
    SEG_LEFT_THIGH,
    SEG_LEFT_SHIN,
    SEG_LEFT_FOOT,
    SEG_RIGHT_THIGH,
    SEG_RIGHT_SHIN,
    SEG_RIGHT_FOOT,
    SEG_COUNT
};

// What makes one body differ from another: natural logarithms of factors, 0 is average.
enum shape_factor {
    SHAPE_SCALE, // of everything
    SHAPE_TORSO,
    SHAPE_SHOULDERS,
    SHAPE_HIPS,
    SHAPE_UPPER_ARM,
    SHAPE_FOREARM,
    SHAPE_THIGH,
    SHAPE_SHIN,
    SHAPE_HEAD,
    SHAPE_CHEST_GIRTH,
    SHAPE_WAIST_GIRTH,
    SHAPE_HIP_GIRTH,
    SHAPE_ARM_GIRTH,
    SHAPE_LEG_GIRTH,
    SHAPE_COUNT
};

struct body_shape {
    double log[SHAPE_COUNT];
    double hem_m,
        hem_radius_m; // a skirt or a coat's tails: from the waist joint down to the hem, half as wide there; 0: none
};

#define BODY_AVERAGE_HEIGHT_M 1.72
#define BODY_SKIRT_SWING      0.67 // of a thigh's turn, so much its half of the hem goes along with

struct body_pose {
    struct vec3 root;                // the waist joint
    struct quat rotation[SEG_COUNT]; // parent_from_segment; the pelvis's is camera_from_segment
};

// All points at most `radius` from a flat trapezium: its axis runs from a to b,
// it reaches half_width to both sides along `side`, and all change linearly.
// With no width it is a round cone.
struct body_solid {
    enum segment segment;
    struct vec3 a, b, side; // side: unit, square to b - a
    double width_a, width_b, radius_a, radius_b;
    bool open; // a tube: nothing of it is beyond b
};

enum {
    SOLID_SKULL = 4,
    SOLID_SKIRT = 19,
    SOLID_COUNT = 21
}; // the tails hang about each leg, left and right, and hide them

struct body_build {
    struct vec3 origin[SEG_COUNT];       // the joint a segment turns about
    double axes[SEG_COUNT][3][3];        // camera_from_segment, rotation matrix
    double parent_axes[SEG_COUNT][3][3]; // camera_from_parent; identity for the pelvis
    struct body_solid solid[SOLID_COUNT];
    int solids; // so many are there: without tails two less
    struct vec3 joint[JOINT_COUNT];
};

int body_parent(enum segment s); // -1 for the pelvis

void body_forward_kinematics(const struct body_shape *shape, const struct body_pose *pose, struct body_build *out);

// Standing upright at `root`, turned by `yaw` about `up`: 0 faces the camera,
// positive turns the person to their own left.
struct body_pose body_standing_pose(struct vec3 root, struct vec3 up, double yaw);

// The body whose trunk is where this one's is, and that looks the other way: each limb
// becomes its twin of the other side.
struct body_pose body_pose_flip_facing(const struct body_shape *shape, const struct body_pose *pose);

// The left segment's right twin and back; those in the middle are their own.
enum segment body_mirror(enum segment s);
