// A short movement found in a long one, against trying every start.
#include "compare/movement_index.h"
#include "tests/support/test.h"

#include <stdio.h>

enum { LONG = 4000, QUERY = 30 };
static const uint64_t SEED = 99;
static struct feature_frame frames[LONG], query_frames[QUERY];

static void fill(struct rng *rng)
{
    double phase[33], speed[33];
    for (int k = 0; k < 33; k++) {
        phase[k] = rng_between(rng, 0, 6);
        speed[k] = rng_between(rng, 0.3, 3);
    }
    for (int i = 0; i < LONG; i++)
        for (int k = 0; k < 33; k++)
            frames[i].number[k] = (int16_t)(FEATURE_UNIT * 0.8 * sin(speed[k] * i / 30.0 + phase[k]));
}

static double cost(const struct feature_frame *a, const struct feature_frame *b)
{
    double sum = 0;
    for (int k = 0; k < FEATURE_NUMBERS; k++)
        sum += ((double)a->number[k] - b->number[k]) * ((double)a->number[k] - b->number[k]);
    return sum;
}

// The price of the best path from exactly this start, at most twice as long as the query.
static double from_start(int start, double step)
{
    static double price[QUERY][2 * QUERY];
    const int width = LONG - start < 2 * QUERY ? LONG - start : 2 * QUERY;
    double best = INFINITY;
    for (int i = 0; i < QUERY; i++)
        for (int j = 0; j < width; j++) {
            const double c = cost(&query_frames[i], &frames[start + j]);
            double least = !i && !j ? 2 * c : INFINITY;
            if (i && j)
                least = fmin(least, price[i - 1][j - 1] + 2 * c);
            if (i)
                least = fmin(least, price[i - 1][j] + c + step);
            if (j)
                least = fmin(least, price[i][j - 1] + c + step);
            price[i][j] = least;
            if (i == QUERY - 1)
                best = fmin(best, least);
        }
    return best;
}

static void test_equals_trying_every_start(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    struct movement_index *index;
    const struct features all = {frames, LONG}, query = {query_frames, QUERY};
    const int32_t step = 500000;
    printf("seed %llu\n", (unsigned long long)SEED);
    fill(&rng);
    EXPECT_STATUS(movement_index_open(&index, &all), OK);
    for (int trial = 0; trial < 5; trial++) {
        const int at = (int)(rng_uniform(&rng) * (LONG - 3 * QUERY));
        for (int i = 0; i < QUERY; i++) {
            query_frames[i] = frames[at + i * (trial % 2 ? 3 : 2) / 2];
            for (int k = 0; k < 33; k++)
                query_frames[i].number[k] = (int16_t)(query_frames[i].number[k] * 0.95 + 40 * rng_normal(&rng));
        }
        double wanted = INFINITY;
        for (int start = 0; start < LONG; start++)
            wanted = fmin(wanted, from_start(start, step));
        struct movement_match found;
        EXPECT_STATUS(movement_index_find(index, &query, step, &found), OK);
        EXPECT_NEAR((double)found.price, wanted, 0);
        EXPECT_NEAR(found.first, at, 4);
        EXPECT_AT_MOST(found.tried, LONG / 8);
    }
    movement_index_close(&index);
    movement_index_close(&index);
}

static void test_refuses_no_frames(void **state)
{
    (void)state;
    struct movement_index *index;
    const struct features none = {frames, 0}, one = {frames, 1};
    struct movement_match found;
    EXPECT_STATUS(movement_index_open(&index, &none), ERR_INPUT);
    EXPECT_STATUS(movement_index_open(&index, &one), OK);
    EXPECT_STATUS(movement_index_find(index, &none, 0, &found), ERR_INPUT);
    EXPECT_STATUS(movement_index_find(index, &one, 0, &found), OK);
    EXPECT_INT(found.price, 0);
    movement_index_close(&index);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equals_trying_every_start),
        cmocka_unit_test(test_refuses_no_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
