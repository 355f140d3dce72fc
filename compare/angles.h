// The angles that people speak of, of one instant: bends of elbows, knees and hips, how high the upper arms are raised,
// lean and twist of the trunk, and the head. Radians; in the upright frame of movement.h.
#pragma once
#include "compare/movement.h"

enum body_angle {
    ANGLE_LEFT_ELBOW, // bend: 0 straight
    ANGLE_RIGHT_ELBOW,
    ANGLE_LEFT_KNEE,
    ANGLE_RIGHT_KNEE,
    ANGLE_LEFT_HIP, // bend: thigh against the trunk, 0 in line
    ANGLE_RIGHT_HIP,
    ANGLE_LEFT_SHOULDER, // elevation: upper arm against the trunk, 0 hanging along it
    ANGLE_RIGHT_SHOULDER,
    ANGLE_LEAN,      // of the trunk, forwards positive
    ANGLE_SIDE_LEAN, // to the person's left positive
    ANGLE_TWIST,     // shoulders against hips about the vertical, to the person's left positive
    ANGLE_HEAD,      // bend of the head against the trunk, any direction
    BODY_ANGLES
};

const char *body_angle_name(enum body_angle a); // "left_elbow", "trunk_lean", ...

struct body_angles {
    float rad[BODY_ANGLES];   // NaN where unknown
    float sigma[BODY_ANGLES]; // standard deviation, rad
};
struct body_angles body_angles_of(const struct movement_frame *f);

// One of them alone, rad; the same bits.
float body_angle_of(const struct movement_frame *f, enum body_angle a);

// The trunk's direction from waist to neck: the mean of both torso parts, or the one that is known. False: neither, or
// they point opposite ways.
bool trunk_direction(const struct movement_frame *f, struct vec3 *direction, double *sigma);

// The range an angle goes through in a movement's frames first..end - 1: 3rd and 97th percentile, so that a single
// wrong frame does not make it. NaN where the angle is known in fewer than 5 frames. ERR_MEMORY.
struct angle_range {
    float low, high;
};
MUST_CHECK enum status body_angle_ranges(const struct movement *m, int32_t first, int32_t end,
                                         struct angle_range out[BODY_ANGLES]);
