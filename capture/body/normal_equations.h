// The normal equations of a fit, and how a point on a body moves with the pose.
//
// A stiff segment moves by a twist: how far its points at the body's root go,
// and how it turns. What pulls at a segment is summed up in those six numbers,
// and only the sums are spread over the joints above it.
#pragma once
#include "capture/body/body_fit.h"

enum { TWIST_COUNT = 6 }; // along x, y, z; about x, y, z

struct segment_sum {                    // of w j j' and w j residual, by the segment's own twist
    double h[TWIST_COUNT][TWIST_COUNT]; // lower triangle
    double g[TWIST_COUNT];
    double shape[SHAPE_COUNT][TWIST_COUNT];
};

struct normal_equations {
    struct segment_sum sum[SEG_COUNT];
    double h[FIT_COUNT][FIT_COUNT]; // lower triangle of sum w j j'
    double g[FIT_COUNT];            // sum w j residual
    int count;                      // unknowns in use
};

// Empties it. with_shape: the shape is among the unknowns.
void normal_equations_reset(struct normal_equations *s, bool with_shape);
// Moves `point` (camera axes) on `segment` along `n` by `residual`, with this
// weight (1/m^2). s may be NULL. shape: how far each factor moves it along n, or NULL.
void normal_equations_add(struct normal_equations *s, const struct body_build *build, enum segment segment,
                          struct vec3 point, struct vec3 n, double residual, double weight,
                          const double shape[SHAPE_COUNT]);
// Adds what was pulled at the segments to h and g. Once, after all pulls.
void normal_equations_assemble(struct normal_equations *s, const struct body_build *build);
// (H + damping diag H) x = g; false when H is not positive.
bool normal_equations_solve(const struct normal_equations *s, double damping, double x[FIT_COUNT]);
// What is left of H for the shape when the pose is free: its Schur complement.
void normal_equations_shape_information(const struct normal_equations *s, double information[SHAPE_COUNT][SHAPE_COUNT]);

// ---- contacts (body_contact.c); each returns its energy, s may be NULL
// Feet stay over the floor, and the lower one mostly stands on it.
double body_floor_energy(const struct fit_task *task, const struct body_build *build, struct normal_equations *s);
// Arms do not enter the trunk, nor one leg the other. limb_energy gets the arms' share.
double body_collision_energy(const struct body_build *build, double limb_energy[SEG_COUNT], struct normal_equations *s);
