// The normal equations of an articulated body: J^T W J x = J^T W r of a Gauss-Newton step.
//
// A rigid segment moves by a twist about the body's root. Residuals on a segment are summed as a 6x6 matrix and a
// 6-vector of its twist first; only those sums are propagated to the joints above it, as composite rigid-body inertias
// are (Featherstone, Rigid Body Dynamics Algorithms, section 6.2). Order of a twist: translation along the camera's x,
// y, z (metres), rotation about them (radians). Pure.
#pragma once
#include "capture/body/body_fit.h"

enum { TWIST_COUNT = 6 };

struct segment_sum {                        // by the segment's own twist
    double h[TWIST_COUNT][TWIST_COUNT];     // of w j j', lower triangle
    double g[TWIST_COUNT];                  // of w j residual
    double shape[SHAPE_COUNT][TWIST_COUNT]; // of w j, by the shape's factors
};

struct normal_equations {
    struct segment_sum sum[SEG_COUNT];
    double h[FIT_COUNT][FIT_COUNT]; // lower triangle of the sum of w j j'
    double g[FIT_COUNT];            // sum of w j residual
    int count;                      // unknowns in use
};

// One scalar residual: `point` (camera axes) on `segment` should move along the unit vector `normal` by `residual`.
struct point_residual {
    enum segment segment;
    struct vec3 point, normal;
    double residual, weight; // metres, 1/m^2
    const double *shape;     // SHAPE_COUNT: how far each factor moves the point along the normal; NULL: not learned
};

// Empties it. with_shape: the shape is among the unknowns.
void normal_equations_reset(struct normal_equations *equations, bool with_shape);
// Adds one residual. s may be NULL: nothing is done.
void normal_equations_add(struct normal_equations *equations, const struct body_build *build,
                          const struct point_residual *point_residual);
// Propagates the segments' sums to h and g. Once, after all residuals.
void normal_equations_assemble(struct normal_equations *equations, const struct body_build *build);
// Solves (H + damping diag H) x = g by Cholesky decomposition; false when H is not positive definite, or x not finite.
bool normal_equations_solve(const struct normal_equations *equations, double damping, double x[FIT_COUNT]);
// The information of the shape with the pose marginalised out: the Schur complement of H.
void normal_equations_shape_information(const struct normal_equations *equations,
                                        double information[SHAPE_COUNT][SHAPE_COUNT]);

// ---- contacts (body_contact.c); each returns its energy, s may be NULL
// Feet stay above the floor, and the lower one usually stands on it.
double body_floor_energy(const struct fit_task *task, const struct body_build *build, struct normal_equations *s);
// Arms do not enter the trunk, nor one leg the other. Adds each moving segment's share to limb_energy.
double body_collision_energy(const struct body_build *build, double limb_energy[SEG_COUNT],
                             struct normal_equations *equations);
// Against knees on each other's side. Without derivatives: it decides between poses and does not pull.
double body_crossed_legs_energy(const struct body_build *build);
