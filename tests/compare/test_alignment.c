// The time alignment against brute force: an independent dynamic programme in doubles over random movements, alike and
// unlike, with pauses, cuts and noise.
#include "tests/support/test.h"

#include "compare/alignment.h"

#include <stdio.h>

static const uint64_t SEED = 2024;

static int16_t limited(double x) { return (int16_t)fmax(-FEATURE_UNIT, fmin(FEATURE_UNIT, floor(x + 0.5))); }

// Numbers that swing on their own, sampled at `time`, with noise.
static struct feature_frame frame_at(double time, double phase, double noise, struct rng *rng)
{
    struct feature_frame f = {{0}};
    for (int k = 0; k < 33; k++) {
        const double wave = 0.6 * sin(0.9 * time * (1 + k % 5 * 0.37) + k + phase) + 0.2 * sin(2.7 * time + 2 * k);
        f.number[k] = limited(FEATURE_UNIT * (wave + noise * rng_normal(rng)));
    }
    return f;
}

struct pair_of_movements {
    struct feature_frame a[320], b[320];
    struct features fa, fb;
};

// B is A at a changing pace, paused and cut now and then, begun late, with noise.
static void make(struct pair_of_movements *p, int n, int m, double noise, double phase, struct rng *rng)
{
    double time = rng_between(rng, 0, 1);
    for (int i = 0; i < n; i++)
        p->a[i] = frame_at(i / 30.0, 0, 0.01, rng);
    for (int j = 0; j < m; j++) {
        p->b[j] = frame_at(time, phase, noise, rng);
        const double dice = rng_uniform(rng);
        time += dice < 0.02 ? 0.5 : dice < 0.2 ? 0 : rng_between(rng, 0.01, 0.07);
    }
    p->fa = (struct features){p->a, n};
    p->fb = (struct features){p->b, m};
}

static double cost(const struct feature_frame *a, const struct feature_frame *b)
{
    double sum = 0;
    for (int k = 0; k < FEATURE_NUMBERS; k++)
        sum += ((double)a->number[k] - b->number[k]) * ((double)a->number[k] - b->number[k]);
    return sum;
}

// The price of the best path, from the definition in the header.
static double brute_force(const struct features *a, const struct features *b, const struct alignment_prices *p)
{
    static double price[320][320];
    double best = INFINITY;
    for (int i = 0; i < a->count; i++)
        for (int j = 0; j < b->count; j++) {
            const double c = cost(&a->frames[i], &b->frames[j]);
            double least = (double)p->skip_a * i + (double)p->skip_b * j + 2 * c;
            if (i && j)
                least = fmin(least, price[i - 1][j - 1] + 2 * c);
            if (i)
                least = fmin(least, price[i - 1][j] + c + p->step);
            if (j)
                least = fmin(least, price[i][j - 1] + c + p->step);
            price[i][j] = least;
            best = fmin(best, least + (double)p->skip_a * (a->count - 1 - i) + (double)p->skip_b * (b->count - 1 - j));
        }
    return best;
}

// What the pairs cost by the definition.
static double price_of(const struct alignment *x, const struct features *a, const struct features *b,
                       const struct alignment_prices *p)
{
    const struct alignment_pair first = x->pairs[0], last = x->pairs[x->count - 1];
    double sum = (double)p->skip_a * (first.a + a->count - 1 - last.a) +
                 (double)p->skip_b * (first.b + b->count - 1 - last.b) +
                 2 * cost(&a->frames[first.a], &b->frames[first.b]);
    for (int k = 1; k < x->count; k++) {
        const int da = x->pairs[k].a - x->pairs[k - 1].a, db = x->pairs[k].b - x->pairs[k - 1].b;
        const double c = cost(&a->frames[x->pairs[k].a], &b->frames[x->pairs[k].b]);
        EXPECT_TRUE((da == 0 || da == 1) && (db == 0 || db == 1) && da + db > 0);
        sum += da && db ? 2 * c : c + p->step;
    }
    return sum;
}

static struct alignment_prices prices_of(double skip_a, double skip_b, double step)
{
    const double unit = 11.0 * FEATURE_UNIT * FEATURE_UNIT;
    return (struct alignment_prices){(int32_t)(skip_a * unit), (int32_t)(skip_b * unit), (int32_t)(step * unit)};
}

static void test_equals_brute_force(void **state)
{
    (void)state;
    static struct pair_of_movements p;
    struct rng rng = {SEED};
    printf("seed %llu\n", (unsigned long long)SEED);
    for (int trial = 0; trial < 60; trial++) {
        const int n = 1 + (int)(rng_uniform(&rng) * 318), m = 1 + (int)(rng_uniform(&rng) * 318);
        const double noise = rng_between(&rng, 0, 0.3), phase = trial % 3 ? 0 : rng_between(&rng, 0, 2);
        make(&p, n, m, noise, phase, &rng);
        const struct alignment_prices prices =
            trial % 4 ? prices_of(0.12, 0.06, 0.01) : prices_of(rng_uniform(&rng), rng_uniform(&rng), 0);
        struct alignment plain, pruned;
        const double wanted = brute_force(&p.fa, &p.fb, &prices);
        EXPECT_STATUS(align_plain(&p.fa, &p.fb, &prices, &plain), OK);
        EXPECT_STATUS(align(&p.fa, &p.fb, &prices, &pruned), OK);
        EXPECT_NEAR((double)plain.price, wanted, 0);
        EXPECT_NEAR((double)pruned.price, wanted, 0);
        EXPECT_NEAR(price_of(&plain, &p.fa, &p.fb, &prices), wanted, 0);
        EXPECT_NEAR(price_of(&pruned, &p.fa, &p.fb, &prices), wanted, 0);
        EXPECT_TRUE(pruned.exact);
        alignment_free(&plain);
        alignment_free(&pruned);
    }
}

// Costs are looked at in far fewer cells than there are; tests/bench measures the time.
static void test_leaves_most_cells_out(void **state)
{
    (void)state;
    static struct pair_of_movements p;
    struct rng rng = {SEED};
    make(&p, 300, 300, 0.05, 0, &rng);
    const struct alignment_prices prices = prices_of(0.12, 0.06, 0.01);
    struct alignment x;
    EXPECT_STATUS(align(&p.fa, &p.fb, &prices, &x), OK);
    EXPECT_AT_MOST((double)x.cells, 300 * 300 / 4);
    alignment_free(&x);
}

// Long ones, in which blocks are left out on several levels: the price is that of all cells, and of similar movements
// few cells are looked at.
static void test_long_ones_equal_all_cells(void **state)
{
    (void)state;
    enum { MOST = 1400 };
    static struct feature_frame a[MOST], b[MOST];
    struct rng rng = {SEED + 2};
    const struct alignment_prices prices = prices_of(0.3, 0.3, 0.02);
    for (int trial = 0; trial < 6; trial++) {
        const int n = 900 + (int)(rng_uniform(&rng) * (MOST - 900)), m = trial == 5 ? 40 : n - 100 * (trial % 3);
        const double noise = trial % 2 ? 0.25 : 0.02, phase = trial == 4 ? 1.5 : 0;
        double time = 0.2;
        for (int i = 0; i < n; i++)
            a[i] = frame_at(i / 30.0, 0, 0.01, &rng);
        for (int j = 0; j < m; j++) {
            b[j] = frame_at(time, phase, noise, &rng);
            time += trial && rng_uniform(&rng) < 0.005 ? 1.5 : rng_between(&rng, 0.02, 0.0466);
        }
        const struct features fa = {a, n}, fb = {b, m};
        struct alignment plain, pruned;
        EXPECT_STATUS(align_plain(&fa, &fb, &prices, &plain), OK);
        EXPECT_STATUS(align(&fa, &fb, &prices, &pruned), OK);
        print_message("%d x %d frames, noise %.2f: price %lld, %.1f cells a frame\n", n, m, noise,
                      (long long)pruned.price, (double)pruned.cells / n);
        EXPECT_INT(pruned.price, plain.price);
        EXPECT_NEAR(price_of(&pruned, &fa, &fb, &prices), (double)plain.price, 0);
        if (trial == 0)
            EXPECT_AT_MOST((double)pruned.cells / n, 100);
        alignment_free(&plain);
        alignment_free(&pruned);
    }
}

static void test_no_frames_are_refused(void **state)
{
    (void)state;
    struct feature_frame one = {{0}};
    const struct features none = {&one, 0}, single = {&one, 1};
    const struct alignment_prices prices = prices_of(0.12, 0.06, 0.01);
    struct alignment x;
    EXPECT_STATUS(align(&none, &single, &prices, &x), ERR_INPUT);
    EXPECT_STATUS(align(&single, &single, &prices, &x), OK);
    EXPECT_INT(x.count, 1);
    EXPECT_INT(x.price, 0);
    alignment_free(&x);
}

// Beyond what is searched exactly: a long attempt in a corridor costs little more than the optimum would.
static void test_corridor_is_near_the_optimum(void **state)
{
    (void)state;
    static struct pair_of_movements p;
    struct rng rng = {SEED + 1};
    const struct alignment_prices prices = prices_of(0.12, 0.06, 0.01);
    for (int trial = 0; trial < 5; trial++) {
        make(&p, 310, 300, 0.1, 0, &rng);
        struct alignment best, near;
        EXPECT_STATUS(align(&p.fa, &p.fb, &prices, &best), OK);
        EXPECT_STATUS(align_corridor(&p.fa, &p.fb, &prices, 10, &near), OK);
        EXPECT_AT_LEAST((double)near.price, (double)best.price);
        EXPECT_AT_MOST((double)near.price, 1.5 * (double)best.price);
        alignment_free(&best);
        alignment_free(&near);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equals_brute_force),           cmocka_unit_test(test_leaves_most_cells_out),
        cmocka_unit_test(test_long_ones_equal_all_cells),    cmocka_unit_test(test_no_frames_are_refused),
        cmocka_unit_test(test_corridor_is_near_the_optimum),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
