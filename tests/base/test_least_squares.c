// The least squares driver on problems whose answers are known, and on ones that have none.
#include "tests/support/test.h"

#include "base/least_squares.h"
#include "base/linear_algebra.h"

enum { MOST = 4 };

// A problem in x: residuals of up to MOST unknowns, in two states.
struct curve {
    double x[2][MOST];
    int unknowns, moves, sums;
    bool (*add)(struct curve *curve, const double *x, struct least_squares_sums *sums);
    double scale;  // of a robust kernel that reweighs; 0: none
    int reweighed; // how often
};

static bool move_curve(void *user, const double *step)
{
    struct curve *c = user;
    for (int i = 0; i < c->unknowns; i++)
        c->x[STATE_TRIED][i] = c->x[STATE_KEPT][i] + step[i];
    c->moves++;
    return fabs(c->x[STATE_TRIED][0]) < 1e3;
}

static bool sum_curve(void *user, enum least_squares_state state, struct least_squares_sums *sums)
{
    struct curve *c = user;
    c->sums++;
    return c->add(c, c->x[state], sums);
}

static void keep_curve(void *user)
{
    struct curve *c = user;
    memcpy(c->x[STATE_KEPT], c->x[STATE_TRIED], sizeof c->x[0]);
}

static void add_square(struct least_squares_sums *sums, double residual, const double *by)
{
    least_squares_add(sums, residual, by, 1);
    sums->cost += residual * residual;
}

static enum least_squares_end solve(struct curve *c, int max_steps, struct least_squares_sums *sums)
{
    static double work[LEAST_SQUARES_WORK(MOST)];
    const struct least_squares_problem problem = {c->unknowns, c, move_curve, sum_curve, keep_curve, NULL};
    const struct least_squares_options options = {max_steps, 1e-3, 1e-12, 0};
    return least_squares_solve(&problem, &options, work, sums);
}

// Rosenbrock's banana valley (1960): 100 (y - x^2)^2 + (1 - x)^2, least at (1, 1).
static bool add_rosenbrock(struct curve *c, const double *x, struct least_squares_sums *sums)
{
    (void)c;
    add_square(sums, 10 * (x[1] - x[0] * x[0]), (const double[2]){-20 * x[0], 10});
    add_square(sums, 1 - x[0], (const double[2]){-1, 0});
    return true;
}

static void test_rosenbrock(void **state)
{
    (void)state;
    static const double start[][2] = {{-1.2, 1}, {2, -3}, {-10, 40}};
    for (size_t i = 0; i < sizeof start / sizeof *start; i++) {
        struct curve c = {.x = {{start[i][0], start[i][1]}}, .unknowns = 2, .add = add_rosenbrock};
        struct least_squares_sums sums;
        EXPECT_INT(solve(&c, 200, &sums), LEAST_SQUARES_CONVERGED);
        EXPECT_NEAR(c.x[STATE_KEPT][0], 1, 1e-9);
        EXPECT_NEAR(c.x[STATE_KEPT][1], 1, 1e-9);
        EXPECT_NEAR(sums.cost, 0, 1e-18);
        EXPECT_NEAR(sums.a[0], 401, 1e-6); // at (1, 1): (20 x)^2 + 1; the sums are those of the answer
        EXPECT_NEAR(sums.a[3], 100, 1e-9);
        EXPECT_AT_MOST(c.moves, 150);    // measured 112 from the farthest
        EXPECT_INT(c.sums, c.moves + 1); // one pass over the residuals a step
    }
}

// Too few steps: the best so far is kept, and it is said.
static void test_steps_run_out(void **state)
{
    (void)state;
    struct curve c = {.x = {{-1.2, 1}}, .unknowns = 2, .add = add_rosenbrock};
    struct least_squares_sums sums, start;
    double storage[6];
    start = least_squares_zero(2, storage);
    (void)add_rosenbrock(&c, c.x[STATE_KEPT], &start);
    EXPECT_INT(solve(&c, 3, &sums), LEAST_SQUARES_STEPS);
    EXPECT_INT(c.moves, 3);
    EXPECT_AT_MOST(sums.cost, 0.9 * start.cost);
    EXPECT_INT(solve(&c, 0, &sums), LEAST_SQUARES_STEPS); // no step: the sums alone
    EXPECT_INT(c.moves, 3);
}

// x + y = 3 and nothing else: any of the answers will do. The third unknown is in no residual and stays.
static bool add_deficient(struct curve *c, const double *x, struct least_squares_sums *sums)
{
    (void)c;
    add_square(sums, x[0] + x[1] - 3, (const double[3]){1, 1, 0});
    add_square(sums, 2 * (x[0] + x[1] - 3), (const double[3]){2, 2, 0});
    return true;
}

static void test_rank_deficient(void **state)
{
    (void)state;
    struct curve c = {.x = {{-4, 1, 7}}, .unknowns = 3, .add = add_deficient};
    struct least_squares_sums sums;
    double a[9];
    EXPECT_INT(solve(&c, 100, &sums), LEAST_SQUARES_CONVERGED);
    EXPECT_NEAR(c.x[STATE_KEPT][0] + c.x[STATE_KEPT][1], 3, 1e-6);
    EXPECT_NEAR(c.x[STATE_KEPT][0] - c.x[STATE_KEPT][1], -5, 1e-6); // along the valley it is not moved
    EXPECT_NEAR(c.x[STATE_KEPT][2], 7, 0);
    memcpy(a, sums.a, sizeof a);
    EXPECT_TRUE(!cholesky_factor(a, 3)); // the sums are those of the problem, undamped
}

// y = a + b x through points of which a third are wrong: Geman and McClure's kernel leaves these out.
static bool add_line(struct curve *c, const double *line, struct least_squares_sums *sums)
{
    for (int i = 0; i < 30; i++) {
        const double x = i / 10.0, y = i % 3 ? 2 - 0.5 * x : 9 + i, r = line[0] + line[1] * x - y;
        const double s2 = c->scale * c->scale, share = s2 / (s2 + r * r);
        least_squares_add(sums, r, (const double[2]){1, x}, share * share);
        sums->cost += share * r * r;
    }
    return true;
}

static bool narrow(void *user)
{
    struct curve *c = user;
    c->reweighed++;
    if (c->scale < 0.05)
        return false;
    c->scale *= 0.7;
    return true;
}

static void test_outliers_with_new_weights(void **state)
{
    (void)state;
    struct curve c = {.x = {{0, 0}}, .unknowns = 2, .add = add_line, .scale = 20};
    double work[LEAST_SQUARES_WORK(2)];
    struct least_squares_sums sums;
    const struct least_squares_problem problem = {2, &c, move_curve, sum_curve, keep_curve, narrow};
    const struct least_squares_options options = {60, 1e-3, 0, 0};
    (void)least_squares_solve(&problem, &options, work, &sums);
    EXPECT_NEAR(c.x[STATE_KEPT][0], 2, 1e-4);
    EXPECT_NEAR(c.x[STATE_KEPT][1], -0.5, 1e-4);
    EXPECT_INT(c.reweighed, c.moves);                                                // before each step
    c = (struct curve){.x = {{0, 0}}, .unknowns = 2, .add = add_line, .scale = 1e6}; // in effect without a kernel
    EXPECT_INT(solve(&c, 60, &sums), LEAST_SQUARES_CONVERGED);
    EXPECT_AT_LEAST(fabs(c.x[STATE_KEPT][0] - 2), 1);
}

// sqrt(x) = 0 from the right: past 0 there is no residual, so that steps there must be refused.
static bool add_root(struct curve *c, const double *x, struct least_squares_sums *sums)
{
    (void)c;
    add_square(sums, sqrt(x[0]), (const double[1]){0.5 / sqrt(x[0])});
    return true;
}

static void test_residual_that_is_no_number(void **state)
{
    (void)state;
    struct curve c = {.x = {{4}}, .unknowns = 1, .add = add_root};
    struct least_squares_sums sums;
    (void)solve(&c, 60, &sums);
    EXPECT_TRUE(c.x[STATE_KEPT][0] >= 0 && c.x[STATE_KEPT][0] < 0.1); // a Gauss-Newton step leads to -4
    EXPECT_AT_MOST(sums.cost, 0.1);
    c.x[STATE_KEPT][0] = -1;
    EXPECT_INT(solve(&c, 60, &sums), LEAST_SQUARES_NO_START);
    EXPECT_NEAR(c.x[STATE_KEPT][0], -1, 0);
}

// A derivative of the wrong sign: each step is worse, and the start is left as it is.
static bool add_uphill(struct curve *c, const double *x, struct least_squares_sums *sums)
{
    (void)c;
    add_square(sums, x[0], (const double[1]){-1});
    return true;
}

// No finite derivative: no step at all.
static bool add_steep(struct curve *c, const double *x, struct least_squares_sums *sums)
{
    (void)c;
    add_square(sums, x[0], (const double[1]){NAN});
    return true;
}

static bool add_nothing(struct curve *c, const double *x, struct least_squares_sums *sums)
{
    (void)c;
    (void)x;
    (void)sums;
    return false;
}

static void test_no_better_step(void **state)
{
    (void)state;
    struct least_squares_sums sums;
    struct curve c = {.x = {{5}}, .unknowns = 1, .add = add_uphill};
    const enum least_squares_end end = solve(&c, 100, &sums);
    EXPECT_TRUE(end == LEAST_SQUARES_STUCK || end == LEAST_SQUARES_CONVERGED); // in the end a step is rounded away
    EXPECT_NEAR(c.x[STATE_KEPT][0], 5, 0);
    EXPECT_AT_MOST(c.moves, 20);
    c.add = add_steep;
    EXPECT_INT(solve(&c, 100, &sums), LEAST_SQUARES_STUCK);
    EXPECT_NEAR(c.x[STATE_KEPT][0], 5, 0);
    c.add = add_nothing;
    EXPECT_INT(solve(&c, 100, &sums), LEAST_SQUARES_NO_START);
    EXPECT_NEAR(c.x[STATE_KEPT][0], 5, 0);
}

// At the answer already: one step is tried, and nothing moves.
static void test_start_at_the_answer(void **state)
{
    (void)state;
    struct curve c = {.x = {{1, 1}}, .unknowns = 2, .add = add_rosenbrock};
    struct least_squares_sums sums;
    EXPECT_INT(solve(&c, 100, &sums), LEAST_SQUARES_CONVERGED);
    EXPECT_INT(c.moves, 1);
    EXPECT_NEAR(c.x[STATE_KEPT][0], 1, 0);
    EXPECT_NEAR(c.x[STATE_KEPT][1], 1, 0);
}

// By hand: residuals 3 and 1 with weights 2 and 5.
static void test_sums_by_hand(void **state)
{
    (void)state;
    double storage[6] = {9, 9, 9, 9, 9, 9};
    struct least_squares_sums sums = least_squares_zero(2, storage);
    least_squares_add(&sums, 3, (const double[2]){1, 4}, 2);
    least_squares_add(&sums, 1, (const double[2]){-2, 1}, 5);
    least_squares_mirror(&sums);
    static const double wanted[4] = {2 * 1 + 5 * 4, 2 * 4 - 5 * 2, 2 * 4 - 5 * 2, 2 * 16 + 5 * 1};
    for (int i = 0; i < 4; i++)
        EXPECT_NEAR(sums.a[i], wanted[i], 0);
    EXPECT_NEAR(sums.g[0], -(2 * 1 * 3 - 5 * 2 * 1), 0);
    EXPECT_NEAR(sums.g[1], -(2 * 4 * 3 + 5 * 1 * 1), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rosenbrock),
        cmocka_unit_test(test_steps_run_out),
        cmocka_unit_test(test_rank_deficient),
        cmocka_unit_test(test_outliers_with_new_weights),
        cmocka_unit_test(test_residual_that_is_no_number),
        cmocka_unit_test(test_no_better_step),
        cmocka_unit_test(test_start_at_the_answer),
        cmocka_unit_test(test_sums_by_hand),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
