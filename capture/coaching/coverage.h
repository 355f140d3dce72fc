// How well each side of each part of a person has been seen, over the frames of a take: the coverage that the dial
// shows. Of every cell of the body's surface the best view is kept. Pure; no allocation;
// deterministic.
//
// A view's quality is the cosine of its obliquity, times how finely it is sampled against what the picture shows, times
// its sharpness: 1 is frontal, near and sharp. A cell is seen from a cosine of COVERAGE_COSINE on.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

// ---------------------------------------------------------------- body surface

// The surface of a person as a chart: each of 13 parts (the eleven body parts and the feet) is a tube about its bone,
// divided into cells by height along the bone and by angle about it. Angle 0 is the person's front, rising towards the
// person's own left. A cell means the same side of the body in every pose. Pure.
//
// Axes: the colour camera's, metres. The axial rotation of a limb, which joints do not show, is the trunk's carried
// over by the shortest rotation.

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

// The outward direction of a cell in an upright, straight body: x to the person's left, y to the front, z up.
struct vec3 surface_rest_direction(int part, int height, int angle);

// The middle of an angle's sector, radians.
double surface_angle(int angle);

double surface_default_radius(int part); // of an average adult, metres

// ---------------------------------------------------------------- coverage

#define COVERAGE_COSINE 0.3 // beyond 72 degrees a surface's texture is stretched threefold; chosen by hand

struct coverage_cell {
    float quality;  // of the best view; 0: never seen
    float radius_m; // sum over samples
    uint32_t samples, views;
};

struct coverage {
    struct coverage_cell cell[SURFACE_PARTS][SURFACE_HEIGHTS][SURFACE_ANGLES];
    double length_m[SURFACE_PARTS]; // sums over the frames in which the part was known
    uint32_t lengths[SURFACE_PARTS];
    uint32_t facing[SURFACE_ANGLES]; // frames in which the camera was at this angle of the body, from its front
    uint32_t frames;                 // with a person
    uint32_t looks;                  // of them, with depth and a known trunk
    uint32_t guessed[JOINT_COUNT];   // of them, with the joint unknown or inferred to no better than 15 cm
};

struct coverage_view {
    const struct calibration *calibration;
    const uint16_t *depth;           // millimetres, of the calibration's depth lens; NULL: only the joints count
    const uint8_t *mask;             // not 0: the actor; NULL as depth is
    const struct skeleton *skeleton; // colour camera's axes
    double blur_px;                  // of the colour image, in pixels; 0: sharp
};

void coverage_reset(struct coverage *coverage);
// One frame with a person. Up to 3000 depth samples are read, evenly over the image. False: its trunk is unknown, as of
// one in a push-up towards the sensor; no side of the body is seen in it.
bool coverage_add(struct coverage *coverage, const struct coverage_view *view);

// Share of the surface that was seen, 0..1, weighted by area; cells inside another part do not count.
double coverage_share(const struct coverage *coverage);

// The same of one part; side: a quarter of the angles, or COVERAGE_ALL_SIDES.
enum coverage_side { COVERAGE_FRONT, COVERAGE_LEFT, COVERAGE_BACK, COVERAGE_RIGHT, COVERAGE_ALL_SIDES };
double coverage_part_share(const struct coverage *coverage, int part, enum coverage_side side);

// Area of a cell, square metres; 0: it lies inside another part.
double coverage_cell_area(const struct coverage *coverage, int part, int height, int angle);
bool coverage_cell_seen(const struct coverage *coverage, int part, int height, int angle);

// The camera's direction as an angle of the body, radians from its front towards its left.
double coverage_facing(const struct surface_pose *pose);
