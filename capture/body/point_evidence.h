// Evidence about a body from points that were found in a colour image: each is a ray from the colour camera past which
// a known point of the body model should lie.
//
// The points come from outside and may be wrong: left and right exchanged, or invented where nothing is visible. Each
// therefore has the robust kernel of Geman and McClure (1985), 0.5 w e^2 c^2 / (c^2 + e^2), e its distance from the ray
// in standard deviations: a wrong point saturates. Energies are log-odds as in body_fit.h; all points of an image
// together are at most POINTS_ENERGY_MAX, so that they cannot outweigh depth.
//
// Depth camera's axes, metres, but for body_points: colour image. Pure; safe from any thread.
#pragma once
#include "base/lens.h"
#include "capture/body/body_model.h"

enum body_point_name {
    BODY_POINT_NOSE,
    BODY_POINT_LEFT_EYE,
    BODY_POINT_RIGHT_EYE,
    BODY_POINT_LEFT_EAR,
    BODY_POINT_RIGHT_EAR,
    BODY_POINT_LEFT_SHOULDER,
    BODY_POINT_RIGHT_SHOULDER,
    BODY_POINT_LEFT_ELBOW,
    BODY_POINT_RIGHT_ELBOW,
    BODY_POINT_LEFT_WRIST,
    BODY_POINT_RIGHT_WRIST,
    BODY_POINT_LEFT_HIP,
    BODY_POINT_RIGHT_HIP,
    BODY_POINT_LEFT_KNEE,
    BODY_POINT_RIGHT_KNEE,
    BODY_POINT_LEFT_ANKLE,
    BODY_POINT_RIGHT_ANKLE,
    BODY_POINT_LEFT_HEEL,
    BODY_POINT_RIGHT_HEEL,
    BODY_POINT_LEFT_TOE,
    BODY_POINT_RIGHT_TOE,
    BODY_POINT_COUNT
};

struct body_point {
    float x_px, y_px; // the centre of the top-left pixel is (0, 0); may lie outside the image
    float visibility; // 0..1
};

// What one colour image showed. person false: it was looked at and no person was found; `at` is then unused.
struct body_points {
    bool person;
    struct body_point at[BODY_POINT_COUNT];
};

struct point_ray {
    enum body_point_name name;
    struct vec3 along, across[2]; // unit, perpendicular to each other
    double sigma;                 // standard deviation of the angle's tangent
    double weight;                // 0..1: how many independent points it counts for
};

struct point_evidence {
    struct vec3 eye; // the colour camera
    struct point_ray ray[BODY_POINT_COUNT];
    int count;
    int8_t index[BODY_POINT_COUNT]; // of a point's ray; -1: it was not visible enough, or outside the image
};

// At most this many points of an image count as independent, and none has an energy beyond POINT_ENERGY_MAX. A network
// that errs errs in many neighbouring points together. If left and right are exchanged all over a person who faces the
// camera, most points are off by many standard deviations: about 18 log-odds in one image. That is enough to outweigh
// what depth has for a body that faces the wrong way, which is little, and too little to move what depth shows: a
// forearm that leaves its surface costs 20 and more.
#define POINTS_INDEPENDENT 5.0
#define POINT_KERNEL       3.0 // standard deviations: the kernel's c
#define POINT_ENERGY_MAX   (0.5 * POINT_KERNEL * POINT_KERNEL)
#define POINTS_ENERGY_MAX  (POINTS_INDEPENDENT * POINT_ENERGY_MAX)

// The rays of the points that are visible. distance_m: of the person from the camera, about; standard deviations in
// the image follow from it.
void point_evidence_read(struct point_evidence *out, const struct body_points *points,
                         const struct calibration *calibration, double distance_m);

// Where a body has a point.
struct vec3 body_point_on(const struct body_build *build, enum body_point_name name);

struct normal_equations;

// The points' energy; adds them to the normal equations. system NULL: the energy alone. e NULL: 0.
double point_evidence_energy(const struct point_evidence *evidence, const struct body_build *build,
                             struct normal_equations *system);

// The energy of the points that are on `count` solids from `first` on, as a share, 0..1, of what these points have
// against a body that is nowhere near them; without points 0.
double point_evidence_dispute(const struct point_evidence *evidence, const struct body_build *build, int first,
                              int count);
