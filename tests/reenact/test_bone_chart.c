// Bone charts: a stored field is read back; lookup clamps at the ends and wraps around; smoothing wraps around.
#include "tests/support/test.h"

#include "reenact/skeleton/body_cylinders.h"
#include "tests/support/random.h"

#include <string.h>

// Along x, with axes rotated against the world's.
static const struct bone_frame bone = {{1, 2, 3}, {0, 0, 1}, {0, -1, 0}, {1, 0, 0}, 0.4};

static struct vec3 beside(double along_m, double angle_rad, double away_m)
{
    const struct vec3 out = v3_add(v3_scale(bone.x, sin(angle_rad)), v3_scale(bone.y, cos(angle_rad)));
    return v3_add(v3_add(bone.origin, v3_scale(bone.z, along_m)), v3_scale(out, away_m));
}

static double value_at(const struct bone_chart *chart, struct vec3 point)
{
    const struct chart_sample sample = chart_sample_at(&bone, point);
    return (double)bone_chart_at(chart, &sample);
}

// A field linear in height and periodic in the angle, averaged from samples, is read back.
static void test_stored_value_is_read_back(void **state)
{
    (void)state;
    static struct bone_chart sum, count;
    struct rng rng = {11};
    print_message("seed 11\n");
    for (int i = 0; i < 200000; i++) {
        const double along = -0.3 + rng_uniform(&rng), angle = 7 * rng_uniform(&rng) - 3.5;
        const struct chart_sample sample = chart_sample_at(&bone, beside(along, angle, 0.05));
        bone_chart_add(&sum, &sample, (float)(along + 0.1 * sin(angle)));
        bone_chart_add(&count, &sample, 1);
    }
    EXPECT_NEAR(bone_chart_sum(&count), 200000, 1);
    for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
        sum.at[i] /= count.at[i];
    double worst = 0;
    for (int k = 0; k < 100; k++) {
        const double along = -0.1 + 0.006 * k, angle = 0.13 * k;
        worst = fmax(worst, fabs(value_at(&sum, beside(along, angle, 0.08)) - along - 0.1 * sin(angle)));
    }
    print_message("largest error %.4f\n", worst);
    EXPECT_AT_MOST(worst, 0.008); // 0.0072 measured
}

static void test_lookup_clamps_at_border(void **state)
{
    (void)state;
    struct bone_chart chart;
    for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
        chart.at[i] = (float)(i / CHART_ANGLES);
    EXPECT_NEAR(value_at(&chart, beside(-5, 1, 0.1)), 0, 1e-6);
    EXPECT_NEAR(value_at(&chart, beside(5, 1, 0.1)), CHART_HEIGHTS - 1, 1e-5);
    EXPECT_NEAR(value_at(&chart, beside(0.2, 3.14159265, 0.1)), value_at(&chart, beside(0.2, -3.14159265, 0.1)), 1e-5);
    EXPECT_NEAR(value_at(&chart, beside(0.2, 0, 0)), (CHART_HEIGHTS - 1) / 2.0, 1e-5); // on the bone itself
}

static void test_smoothing_wraps_around(void **state)
{
    (void)state;
    struct bone_chart chart;
    memset(&chart, 0, sizeof chart);
    chart.at[3 * CHART_ANGLES] = 16;
    bone_chart_smooth(&chart);
    EXPECT_NEAR((double)chart.at[3 * CHART_ANGLES], 4, 1e-6);
    EXPECT_NEAR((double)chart.at[3 * CHART_ANGLES + CHART_ANGLES - 1], 2, 1e-6);
    EXPECT_NEAR((double)chart.at[4 * CHART_ANGLES + 1], 1, 1e-6);
    EXPECT_NEAR(bone_chart_sum(&chart), 16, 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stored_value_is_read_back),
        cmocka_unit_test(test_lookup_clamps_at_border),
        cmocka_unit_test(test_smoothing_wraps_around),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
