// The body model that the tracker fits to depth images: 18 rigid segments and 19 rounded solids, 21 with a skirt or a
// coat.
//
// Body axes of every segment in the bind pose (standing, arms hanging): x to the person's left, y up, z ahead. A pose
// is the pelvis in the camera and one rotation for each further segment against its parent; a build is what follows
// from pose and shape by forward kinematics. Camera axes and metres; pure functions, safe from any thread.
//
// The initial proportions are fractions of body height: Drillis and Contini (Body Segment Parameters, 1966; after
// Winter, Biomechanics and Motor Control of Human Movement, fig. 4.1); breadths and depths of the trunk after Pheasant
// and Haslegrave (Bodyspace, table 10.1: chest 250 mm deep, abdomen 260). Changed against those after measurements on
// people of many sizes (docs/notes/skeleton.md): the spine's joints lie behind the middle of the trunk, the hip joints
// 3 cm ahead of the spine, and the knees 1 cm lower. The shape scales all of it to the person.
#pragma once
#include "recording/skeleton.h"

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

// In what one body differs from another: natural logarithms of factors, 0 is average.
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
    double hem_m;        // a skirt's or coat's length, from the waist joint down to the hem; 0: there is none
    double hem_radius_m; // half its width at the hem
};

#define BODY_AVERAGE_HEIGHT_M 1.72
#define BODY_SKIRT_SWING      0.67 // each half of the hem takes this share of its thigh's rotation; chosen by hand

struct body_pose {
    struct vec3 root;                // the waist joint
    struct quat rotation[SEG_COUNT]; // parent_from_segment; the pelvis's is camera_from_segment
};

// All points at most `radius` from a flat trapezium: its axis runs from a to b, it reaches half_width to both sides
// along `side`, and all change linearly. With no width it is a round cone.
struct body_solid {
    enum segment segment;
    struct vec3 a, b, side; // side: unit, perpendicular to b - a
    double width_a, width_b, radius_a, radius_b;
    bool open; // a tube: nothing of it is beyond b
};

// The solids in order: pelvis, abdomen, chest, neck, skull; of each arm the clavicle, upper arm, forearm, hand; of each
// leg the thigh, shin, foot; of each side half a skirt, which hangs about the leg and hides it.
enum {
    SOLID_PELVIS = 0,
    SOLID_CHEST = 2,
    SOLID_SKULL = 4,
    SOLID_LEFT_ARM = 5,
    SOLID_RIGHT_ARM = 9,
    SOLID_LEFT_LEG = 13,
    SOLID_RIGHT_LEG = 16,
    SOLID_SKIRT = 19,
    SOLID_COUNT = 21
};

static inline double solid_radius(const struct body_solid *solid, double t) // at t in [0, 1] along the axis
{
    return solid->radius_a + (solid->radius_b - solid->radius_a) * t;
}

static inline double solid_width(const struct body_solid *solid, double t)
{
    return solid->width_a + (solid->width_b - solid->width_a) * t;
}

struct body_build {
    struct vec3 origin[SEG_COUNT];       // the joint that a segment rotates about
    double axes[SEG_COUNT][3][3];        // camera_from_segment, rotation matrix
    double parent_axes[SEG_COUNT][3][3]; // camera_from_parent; identity for the pelvis
    struct body_solid solid[SOLID_COUNT];
    int solids; // number in use: two less without a skirt
    struct vec3 joint[JOINT_COUNT];
};

// The limbs: left arm, right arm, left leg, right leg.
enum { FIRST_LEG = 2, LIMB_COUNT = 4, LIMB_SOLIDS = 3 };

struct body_limb {
    enum segment upper, lower, end;
    enum joint root, bend, tip;
    int first_solid; // of its LIMB_SOLIDS solids
};
extern const struct body_limb body_limbs[LIMB_COUNT];

// A segment's axis k (0: left, 1: up, 2: ahead) in the camera.
static inline struct vec3 body_axis(const struct body_build *build, enum segment segment, int k)
{
    return v3(build->axes[segment][0][k], build->axes[segment][1][k], build->axes[segment][2][k]);
}

int body_parent(enum segment segment); // -1 for the pelvis

void body_forward_kinematics(const struct body_shape *shape, const struct body_pose *pose, struct body_build *out);

// Standing upright at `root`, rotated by `yaw` about `up`: 0 faces the camera, positive turns the person to their own
// left.
struct body_pose body_standing_pose(struct vec3 root, struct vec3 up, double yaw);

// The pose with the trunk in the same place that faces the opposite way: each limb becomes its counterpart of the other
// side.
struct body_pose body_pose_flip_facing(const struct body_shape *shape, const struct body_pose *pose);

// The right counterpart of a left segment and vice versa; a segment of the trunk or head is its own.
enum segment body_mirror(enum segment s);
