// The surface of a person as a chart: each of 13 parts (the eleven body parts and the feet) is a tube about its bone,
// divided into cells by height along the bone and by angle about it. Angle 0 is the person's front, rising towards the
// person's own left. A cell means the same side of the body in every pose. Pure.
//
// Axes: the colour camera's, metres. The axial rotation of a limb, which joints do not show, is the trunk's carried
// over by the shortest rotation.
#pragma once
#include "recording/skeleton.h"

enum { SURFACE_LEFT_FOOT = PART_COUNT, SURFACE_RIGHT_FOOT, SURFACE_PARTS };
enum { SURFACE_HEIGHTS = 6, SURFACE_ANGLES = 16 };

const char *surface_part_name(int part); // "left forearm"

// Where a part is at an instant. z along the bone, y its front, x to the person's left.
struct surface_frame {
    bool known;
    struct vec3 origin, x, y, z; // unit axes
    double length;               // of the bone
    double from, to;             // the part's surface along z, metres; beyond the bone for head, hands and feet
};

struct surface_pose {
    struct surface_frame part[SURFACE_PARTS];
    bool known;              // of the trunk; without it no part is
    struct vec3 front, left; // of the trunk, unit
    struct vec3 up;          // of the trunk
    double scale;            // the trunk's length over an average adult's
};

// False: the trunk is unknown.
bool surface_pose_of(const struct skeleton *skeleton, struct surface_pose *out);

// A point on the surface of a part.
struct surface_hit {
    int part, height, angle; // of its cell
    double radius_m;         // distance from the bone's axis
    struct vec3 outward;     // unit, away from the bone
};
// The part whose tube is nearest to the point. False: it is far from all, as a thing in the hand is.
bool surface_hit_of(const struct surface_pose *pose, struct vec3 p, struct surface_hit *out);

// The outward direction of a cell in an upright, straight body: x to the person's left, y to the front, z up.
struct vec3 surface_rest_direction(int part, int height, int angle);

// The middle of an angle's sector, radians.
double surface_angle(int angle);

double surface_default_radius(int part); // of an average adult, metres
