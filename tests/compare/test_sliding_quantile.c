// A sliding weighed quantile against sorting every window anew.
#include "tests/support/test.h"

#include "compare/movement.h"
#include "tests/support/random.h"

#include <stdlib.h>

enum { COUNT = 2000 };

struct item {
    float value, weight;
    int32_t frame;
};

static int by_value_and_frame(const void *a, const void *b)
{
    const struct item *x = a, *y = b;
    const int order = (x->value > y->value) - (x->value < y->value);
    return order ? order : x->frame - y->frame;
}

static float sorted_quantile(const struct item *series, int32_t first, int32_t end, double share, double *sum)
{
    struct item window[SLIDING_MAX];
    double before = 0;
    *sum = 0;
    for (int32_t k = first; k < end; k++) {
        window[k - first] = series[k];
        *sum += series[k].weight;
    }
    qsort(window, (size_t)(end - first), sizeof *window, by_value_and_frame);
    for (int32_t k = 0; k < end - first; k++) {
        before += window[k].weight;
        if (before >= share * *sum)
            return window[k].value;
    }
    return NAN;
}

static void test_equals_sorting(void **state)
{
    (void)state;
    static struct item series[COUNT];
    struct rng rng = {7};
    for (int32_t k = 0; k < COUNT; k++) {
        const double value = rng_uniform(&rng);
        // Many equal values: ties are decided by the frames' order.
        series[k] = (struct item){(float)(floor(value * 9) / 9 - 0.5), (float)rng_between(&rng, 0.01, 1), k};
    }
    static const double shares[] = {0.25, 0.5, 0.67};
    for (int half = 0; 2 * half + 1 <= SLIDING_MAX; half += 5) {
        struct sliding_quantile s = {.count = 0};
        for (int32_t k = 0; k < half; k++)
            sliding_add(&s, k, series[k].value, series[k].weight);
        for (int32_t f = 0; f < COUNT; f++) {
            const int32_t first = f > half ? f - half : 0, end = f + half + 1 < COUNT ? f + half + 1 : COUNT;
            sliding_remove(&s, f - half - 1);
            if (f + half < COUNT)
                sliding_add(&s, f + half, series[f + half].value, series[f + half].weight);
            for (size_t i = 0; i < COUNT_OF(shares); i++) {
                double sum;
                const float wanted = sorted_quantile(series, first, end, shares[i], &sum);
                EXPECT_NEAR(sliding_quantile_of(&s, sum, shares[i]), (double)wanted, 0);
            }
        }
    }
}

static void test_an_empty_window_has_none(void **state)
{
    (void)state;
    const struct sliding_quantile s = {.count = 0};
    EXPECT_TRUE(isnan(sliding_quantile_of(&s, 0, 0.5)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equals_sorting),
        cmocka_unit_test(test_an_empty_window_has_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
