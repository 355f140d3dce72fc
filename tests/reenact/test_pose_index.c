// The pose index against exhaustive search in hard cases: ties, duplicates, all points
// equal, one point, none, excluded points, positions that are unknown, far away or NaN,
// fixed costs, and counts about the block and group sizes.
#include "tests/support/test.h"

#include "reenact/retrieval/pose_index.h"

#include <string.h>

enum { SEED = 47, MOST = 34000 };

struct point_set {
    int positions, count, evaluated;
    bool excluded[MOST];
    struct pose_index_point points[MOST];
    struct pose_index_point target;
    double scale;
};

// `scale` times the sum, and more for every third, so that it differs from the bound.
static double cost_of(const void *context, int64_t number)
{
    struct point_set *c = (struct point_set *)(uintptr_t)context;
    const struct pose_index_point *p = &c->points[number];
    c->evaluated++;
    if (c->excluded[number])
        return -1;
    double sum = p->fixed_cost_m;
    for (int i = 0; i < c->positions; i++)
        if ((p->known & c->target.known) >> i & 1)
            sum += v3_distance(p->position[i], c->target.position[i]);
    return c->scale * sum + (number % 3 ? 0 : 0.05);
}

// Returns the number of points evaluated.
static int compare(struct point_set *c)
{
    int64_t expected = -1;
    double least = 0;
    for (int i = 0; i < c->count; i++) {
        double here = cost_of(c, i);
        if (here >= 0 && (expected < 0 || here < least)) {
            expected = i;
            least = here;
        }
    }
    c->evaluated = 0;
    struct pose_index *index;
    EXPECT_STATUS(pose_index_open(&index, c->positions, 1.0 / 2048, c->count), OK);
    for (int i = 0; i < c->count; i++)
        pose_index_add(index, &c->points[i]);
    struct pose_index_query query = {.point = c->target, .scale = c->scale, .cost = cost_of, .context = c};
    pose_index_find(index, &query);
    EXPECT_INT(query.number, expected);
    if (expected >= 0)
        EXPECT_TRUE(query.cost_m == least);
    pose_index_close(&index);
    return c->evaluated;
}

static struct pose_index_point near_to(const struct pose_index_point *p, int positions, double step_m, struct rng *rng)
{
    struct pose_index_point next = *p;
    for (int i = 0; i < positions; i++)
        next.position[i] = v3_add(p->position[i], rng_normal3(rng, step_m));
    return next;
}

// A random walk, as a take's poses are; the target is near one of its points.
static struct point_set *walk(int positions, int count, double step_m, struct rng *rng)
{
    static struct point_set c;
    memset(c.excluded, 0, (size_t)count * sizeof *c.excluded);
    c.positions = positions;
    c.count = count;
    c.scale = 1;
    c.evaluated = 0;
    struct pose_index_point at = {.known = (1u << positions) - 1};
    for (int i = 0; i < count; i++)
        c.points[i] = at = near_to(&at, positions, step_m, rng);
    c.target = near_to(&c.points[count ? (int)(rng_uniform(rng) * count) : 0], positions, 0.05, rng);
    c.target.known = at.known;
    return &c;
}

static void test_every_count_up_to_three_groups(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    int evaluated = 0, all = 0;
    for (int count = 0; count < 700; count += count < 40 || count % 256 > 250 || count % 256 < 5 ? 1 : 7) {
        evaluated += compare(walk(1 + count % POSE_INDEX_MAX_POSITIONS, count, 0.05, &rng));
        all += count;
    }
    print_message("%d of %d points evaluated\n", evaluated, all);
    EXPECT_AT_MOST(evaluated, 0.006 * all); // 0.0043 measured
}

static void test_ties_go_to_lowest(void **state)
{
    (void)state;
    struct rng rng = {SEED + 1};
    for (int round = 0; round < 60; round++) {
        struct point_set *c = walk(1 + round % 16, 100 + 9 * round, 0.1, &rng);
        if (round % 3 == 0) // all equal
            for (int i = 0; i < c->count; i++)
                c->points[i] = c->points[0];
        else // some copies
            for (int k = 0; k < c->count / 2; k++) {
                int from = (int)(rng_uniform(&rng) * c->count), to = (int)(rng_uniform(&rng) * c->count);
                c->points[to] = c->points[from];
            }
        c->target = c->points[c->count / 2];
        compare(c);
    }
}

static void test_excluded_points_are_skipped(void **state)
{
    (void)state;
    struct rng rng = {SEED + 2};
    for (int round = 0; round < 60; round++) {
        struct point_set *c = walk(4, 300, 0.05, &rng);
        for (int i = 0; i < c->count; i++)
            c->excluded[i] = rng_uniform(&rng) < round / 50.0; // in the last rounds none is left
        compare(c);
    }
}

// Until a point that is not excluded is found, no bound prunes anything.
static void test_nothing_can_be_pruned(void **state)
{
    (void)state;
    struct rng rng = {SEED + 8};
    for (int round = 0; round < 4; round++) {
        struct point_set *c = walk(1 + round, MOST, 0.002, &rng);
        for (int i = 0; i < c->count; i++)
            c->excluded[i] = true;
        if (round > 0)
            c->excluded[(int)(rng_uniform(&rng) * c->count)] = false;
        int evaluated = compare(c);
        EXPECT_TRUE(round > 0 || evaluated >= c->count);
    }
}

static void test_unknown_points_cost_nothing(void **state)
{
    (void)state;
    struct rng rng = {SEED + 3};
    for (int round = 0; round < 100; round++) {
        struct point_set *c = walk(15, 400, 0.05, &rng);
        double unknown = round % 5 * 0.25;
        for (int i = 0; i < c->count; i++)
            for (int p = 0; p < c->positions; p++)
                if (rng_uniform(&rng) < unknown) {
                    c->points[i].known &= ~(1u << p);
                    c->points[i].position[p] = v3(NAN, INFINITY, 1e300);
                }
        for (int p = 0; p < c->positions; p++)
            if (rng_uniform(&rng) < 0.2) {
                c->target.known &= ~(1u << p);
                c->target.position[p] = v3(NAN, NAN, NAN);
            }
        c->scale = 1 + round % 7 * 0.3;
        compare(c);
    }
}

static void test_fixed_cost_counts(void **state)
{
    (void)state;
    struct rng rng = {SEED + 4};
    for (int round = 0; round < 60; round++) {
        struct point_set *c = walk(4, 500, 0.05, &rng);
        for (int i = 0; i < c->count; i++)
            c->points[i].fixed_cost_m = pow(10, 6 * rng_uniform(&rng) - 5);
        c->scale = 1 + round % 7 * 0.3;
        compare(c);
    }
}

static void test_far_and_nan_points(void **state)
{
    (void)state;
    struct rng rng = {SEED + 5};
    static const double far[] = {3.9, 4.1, 1e3, 1e9, 1e300};
    for (int round = 0; round < 100; round++) {
        struct point_set *c = walk(6, 200, 0.05, &rng);
        double size = far[round % 5];
        for (int i = 0; i < c->count; i++)
            if (round % 2 || i % 10 == 0)
                for (int p = 0; p < c->positions; p++)
                    c->points[i].position[p] = v3_scale(c->points[i].position[p], size);
        if (round % 3 == 0)
            c->target.position[2] = v3(size, -size, 0);
        if (round % 10 == 9) // its cost is NaN, which excludes it
            c->points[7].position[0] = v3(NAN, 0, 0);
        compare(c);
    }
}

// Six positions and a fixed cost are clamped to 4681 each: their sum fills 16 bits.
static void test_all_distances_clamped(void **state)
{
    (void)state;
    struct rng rng = {SEED + 7};
    for (int round = 0; round < 20; round++) {
        struct point_set *c = walk(6, 200, 0.05, &rng);
        for (int i = 0; i < c->count; i++) {
            c->points[i].fixed_cost_m = 1e3;
            for (int p = 0; p < c->positions; p++)
                c->points[i].position[p] = v3_add(c->target.position[p], v3(20 + rng_uniform(&rng), 20, 20));
        }
        for (int p = 0; p < c->positions; p++)
            c->target.position[p] = v3_scale(c->target.position[p], -1);
        compare(c);
    }
}

// Along this direction a position's bound equals its distance, so rounding alone could make it too high.
static void test_bounds_are_admissible_where_tight(void **state)
{
    (void)state;
    struct rng rng = {SEED + 6};
    for (int round = 0; round < 2000; round++) {
        struct point_set *c = walk(1 + round % 4, 100, 0.05, &rng);
        for (int i = 0; i < c->count; i++)
            for (int p = 0; p < c->positions; p++)
                c->points[i].position[p] =
                    v3_add(c->target.position[p], v3_scale(v3(0.86, 0.36, 0.36), 0.2 + 1e-3 * rng_uniform(&rng)));
        compare(c);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_count_up_to_three_groups),
        cmocka_unit_test(test_ties_go_to_lowest),
        cmocka_unit_test(test_excluded_points_are_skipped),
        cmocka_unit_test(test_nothing_can_be_pruned),
        cmocka_unit_test(test_unknown_points_cost_nothing),
        cmocka_unit_test(test_fixed_cost_counts),
        cmocka_unit_test(test_far_and_nan_points),
        cmocka_unit_test(test_all_distances_clamped),
        cmocka_unit_test(test_bounds_are_admissible_where_tight),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
