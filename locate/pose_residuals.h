// Residuals of the pose solver: what one tag, one depth sample or one landmark adds to the normal equations
// JᵀJ d = -Jᵀr of a small motion of the camera. Axes, order of the numbers, kernel and costs: locate/pose_solver.h.
#pragma once
#include "locate/pose_solver.h"

// What is estimated: the motion of the camera, and with a rolling shutter its velocity.
enum { POSE_DOF = 6, POSE_VELOCITY_DOF = 12 };

#define CAUCHY_SCALE 3.0 // c of the Cauchy kernel, standard deviations

// Normal equations; of `a` the lower triangle is filled.
struct pnp_equations {
    int size; // POSE_DOF or POSE_VELOCITY_DOF
    double a[POSE_VELOCITY_DOF * POSE_VELOCITY_DOF], g[POSE_VELOCITY_DOF], cost;
};

// How the camera projects: pixels per unit of x / z and y / z, and how it moves while it reads its rows.
struct pnp_projection {
    double fx, fy;
    const struct shutter_motion *motion; // NULL: no rolling shutter
};

// The inverse covariance of a tag's eight corner coordinates, 1 / pixels^2: image noise, map error and extra_px.
struct corner_information {
    double a[64];
};
void pnp_corner_information(const struct pnp_tag *tag, double extra_px, const struct pose *camera_from_world,
                            const struct pnp_projection *projection, struct corner_information *out);

// Each adds one tag or point to *n and returns its robust cost. What is not visible adds a large constant cost.
double pnp_add_tag(struct pnp_equations *n, const struct pnp_tag *tag, const struct corner_information *information,
                   const struct pnp_projection *projection, const struct pose *camera_from_world, bool with_depth);
double pnp_add_point(struct pnp_equations *n, const struct pnp_point *point, double extra_px,
                     const struct pnp_projection *projection, const struct pose *camera_from_world);
