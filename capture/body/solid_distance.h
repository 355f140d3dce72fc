// Distances of points from the body model's solids as the camera sees them. Pure.
//
// The camera is at the origin. A point in front of a solid's middle is measured to the nearest surface; a point behind
// the middle is measured along its ray to the surface in front, which is the one that the camera sees.
#pragma once
#include "capture/body/body_model.h"

// What all points share of one solid.
struct solid_line {
    struct vec3 axis;
    double per_length2, length; // per_length2: 1 / length^2
    double lean;                // shift of the nearest axis point towards the thick end, by the distance from the axis
    bool flat;                  // has a width
};

// The solid nearest to a point.
struct solid_hit {
    int solid;
    double distance;  // signed, negative inside
    double t, side_m; // t in [0, 1] along the axis, side_m along `side`: where on the trapezium
    struct vec3 on;   // that point of the trapezium
};

// A sphere around each solid, which spares most of the distances. Structure of arrays, for vectorisation.
struct solid_bounds {
    float x[SOLID_COUNT], y[SOLID_COUNT], z[SOLID_COUNT], radius[SOLID_COUNT];
    struct solid_line line[SOLID_COUNT];
};

void find_solid_bounds(const struct body_build *build, struct solid_bounds *bounds);

// `guess`: a solid to try first, -1 none.
struct solid_hit find_nearest_solid(const struct body_build *build, const struct solid_bounds *bounds, struct vec3 p,
                                    struct vec3 view, int guess);

// The unit normal out of the visible surface.
struct vec3 surface_normal(const struct body_solid *solid, const struct solid_hit *hit, struct vec3 p,
                           struct vec3 view);

// Signed distance of `p` from one solid's visible surface; its unit normal in *normal unless that is NULL.
double solid_distance(const struct body_solid *solid, struct vec3 p, struct vec3 *normal);
