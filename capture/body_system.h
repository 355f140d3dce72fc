// The normal equations of a fit, and how a point on a body moves with the pose.
#pragma once
#include "capture/body_fit.h"

struct fit_system {
    double h[FIT_COUNT][FIT_COUNT]; // lower triangle of sum w j j'
    double g[FIT_COUNT];            // sum w j residual
    int count;                      // unknowns in use
};

enum { ROW_MAX = 3 + 3 * 8 + SHAPE_COUNT };

struct fit_row { // one row of the Jacobian, without its zeros
    int index[ROW_MAX];
    double value[ROW_MAX];
    int count;
};

// How `point` (camera axes), fixed to `segment`, moves along `n`.
void fit_row_start(struct fit_row *row, const struct body_build *build, enum segment segment, struct vec3 point,
                   struct vec3 n);
void fit_system_add(struct fit_system *s, const struct fit_row *row, double residual, double weight);
// Moves `point` on `segment` along `n` by `residual`, with this weight (1/m^2). s may be NULL.
void fit_system_pull(struct fit_system *s, const struct body_build *build, enum segment segment, struct vec3 point,
                     struct vec3 n, double residual, double weight);
// (H + damping diag H) x = g; false when H is not positive.
bool fit_system_solve(const struct fit_system *s, double damping, double x[FIT_COUNT]);
// What is left of H for the shape when the pose is free: its Schur complement.
void fit_system_shape(const struct fit_system *s, double information[SHAPE_COUNT][SHAPE_COUNT]);

// ---- contacts (body_contact.c); each returns its energy, s may be NULL
// Feet stay over the floor, and the lower one mostly stands on it.
double body_floor(const struct fit_task *task, const struct body_build *build, struct fit_system *s);
// Arms do not enter the trunk, nor one leg the other. limb_energy gets the arms' share.
double body_collisions(const struct body_build *build, double limb_energy[SEG_COUNT], struct fit_system *s);
