#include "base/least_squares.h"

#include "base/linear_algebra.h"

#include <math.h>
#include <string.h>

static const double DAMPING_FACTOR = 10; // Marquardt's nu
static const double DAMPING_AGAIN = 1e-2, DAMPING_MAX = 1e8;
static const double ROUNDING = 1e-9; // of a cost that is a sum over many residuals

struct least_squares_sums least_squares_zero(int n, double *storage)
{
    memset(storage, 0, (size_t)(n * n + n) * sizeof *storage);
    return (struct least_squares_sums){.n = n, .a = storage, .g = storage + n * n};
}

void least_squares_mirror(struct least_squares_sums *sums)
{
    for (int i = 0; i < sums->n; i++)
        for (int j = 0; j < i; j++)
            sums->a[j * sums->n + i] = sums->a[i * sums->n + j];
}

static bool form_sums(const struct least_squares_problem *problem, enum least_squares_state state,
                      struct least_squares_sums *sums)
{
    *sums = least_squares_zero(problem->unknowns, sums->a);
    return problem->sum(problem->user, state, sums) && isfinite(sums->cost);
}

// scratch: n x n doubles.
static bool solve_damped(const struct least_squares_sums *sums, double damping, double *scratch, double *step)
{
    const int n = sums->n;
    memcpy(scratch, sums->a, (size_t)(n * n) * sizeof *scratch);
    memcpy(step, sums->g, (size_t)n * sizeof *step);
    for (int i = 0; i < n; i++)
        scratch[i * n + i] = scratch[i * n + i] == 0 ? 1 : scratch[i * n + i] * (1 + damping);
    if (!cholesky_factor(scratch, n))
        return false;
    cholesky_solve(scratch, n, step);
    return true;
}

enum least_squares_end least_squares_solve(const struct least_squares_problem *problem,
                                           const struct least_squares_options *options, double *work,
                                           struct least_squares_sums *sums)
{
    const int n = problem->unknowns;
    struct least_squares_sums now = least_squares_zero(n, work), then = least_squares_zero(n, work + n * n + n);
    double *scratch = work + 2 * (n * n + n), *step = scratch + n * n, damping = options->damping;
    enum least_squares_end end = form_sums(problem, STATE_KEPT, &now) ? LEAST_SQUARES_STEPS : LEAST_SQUARES_NO_START;
    for (int i = 0; i < options->max_steps && end == LEAST_SQUARES_STEPS; i++) {
        if (problem->reweigh && problem->reweigh(problem->user) && !form_sums(problem, STATE_KEPT, &now)) {
            end = LEAST_SQUARES_NO_START;
            break;
        }
        const bool tried = solve_damped(&now, damping, scratch, step) && problem->move(problem->user, step) &&
                           form_sums(problem, STATE_TRIED, &then);
        const double gain = tried ? now.cost - then.cost : -INFINITY;
        if (gain > 0) {
            const struct least_squares_sums before = now;
            problem->keep(problem->user);
            now = then;
            then = before;
            damping /= DAMPING_FACTOR;
            if (gain < options->tolerance * (now.cost + options->cost_floor))
                end = LEAST_SQUARES_CONVERGED;
        } else {
            damping = fmax(damping * DAMPING_FACTOR, DAMPING_AGAIN);
            if (-gain <= ROUNDING * now.cost)
                end = LEAST_SQUARES_CONVERGED;
            else if (damping > DAMPING_MAX)
                end = LEAST_SQUARES_STUCK;
        }
    }
    *sums = now;
    return end;
}
