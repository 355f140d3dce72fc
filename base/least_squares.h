// Small dense nonlinear least squares by the Levenberg-Marquardt method: which step is tried, whether it is kept, and
// when to stop. The caller forms the sums, so that residuals may be weighted robustly (iteratively reweighted least
// squares: the weight of a residual r with loss rho(r^2) is rho'(r^2), the cost the sum of rho) and unknowns may be
// anything that a step can move, such as a rotation.
//
// A step d solves (A + l diag A) d = g, where A = J' W J and g = -J' W r at the kept state: Marquardt's scaling, which
// does not depend on units (Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963;
// Madsen, Nielsen & Tingleff, "Methods for non-linear least squares problems", 2004, section 3.2). A step that lowers
// the cost is kept and l becomes a tenth, else l becomes ten times as much, at least 1e-2: below that a step would
// hardly differ from the one that failed, and where steps are few it would be lost. An unknown that no residual depends
// on stays where it is.
//
// Pure: no memory is allocated, any thread may call; the order of the floating-point operations is fixed.
#pragma once
#include "base/status.h"

// Of n unknowns, at one state.
struct least_squares_sums {
    int n;
    double *a;   // J' W J, row-major; of n x n the lower triangle
    double *g;   // -J' W r
    double cost; // no unit that matters; only compared
};

enum least_squares_state { STATE_KEPT, STATE_TRIED };

struct least_squares_problem {
    int unknowns;
    void *user; // given to the functions
    // Makes the tried state: the kept one moved by step. False: there is none there.
    bool (*move)(void *user, const double *step);
    // Adds to *sums, which are 0, what the state's residuals give. False: the state is impossible, or too little is
    // seen from there. A cost that is not finite is taken as false, too.
    bool (*sum)(void *user, enum least_squares_state state, struct least_squares_sums *sums);
    void (*keep)(void *user); // the tried state becomes the kept one
    // Before each step. True: weights changed, and the sums of the kept state are computed again. NULL: they never do.
    bool (*reweigh)(void *user);
};

struct least_squares_options {
    int max_steps;    // tried, kept or not
    double damping;   // l of the first step: small where the start is good
    double tolerance; // converged when a step lowers the cost by less than so much of (cost + cost_floor)
    double cost_floor;
};

enum least_squares_end {
    LEAST_SQUARES_CONVERGED, // by the tolerance, or nothing but rounding is left to gain
    LEAST_SQUARES_STEPS,     // max_steps were tried
    LEAST_SQUARES_STUCK,     // no step is better, however short
    LEAST_SQUARES_NO_START,  // no cost at the first state, or none with new weights
};

// Doubles that n unknowns need.
#define LEAST_SQUARES_WORK(n) (3 * (n) * (n) + 3 * (n))

// Leaves the best state that was found as the kept one, and in *sums its sums, which lie in `work` and hold after
// LEAST_SQUARES_NO_START nothing of use. work: LEAST_SQUARES_WORK(unknowns) doubles.
enum least_squares_end least_squares_solve(const struct least_squares_problem *problem,
                                           const struct least_squares_options *options, double *work,
                                           struct least_squares_sums *sums);

// Sums of n unknowns, all 0. storage: n * n + n doubles.
struct least_squares_sums least_squares_zero(int n, double *storage);

// Adds a residual with its derivatives (n of them) to a and g; the cost is the caller's.
static inline void least_squares_add(struct least_squares_sums *sums, double residual, const double *by, double weight)
{
    for (int i = 0; i < sums->n; i++) {
        const double scaled = weight * by[i];
        sums->g[i] -= scaled * residual;
        for (int j = 0; j <= i; j++)
            sums->a[i * sums->n + j] += scaled * by[j];
    }
}

// Copies a's lower triangle into the upper one.
void least_squares_mirror(struct least_squares_sums *sums);
