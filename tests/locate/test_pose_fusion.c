// Pose fusion: the tracked pose is corrected by what is new in the map's pose, over several images; and it stays valid
// where the covariances nearly contradict each other.
#include "tests/support/test.h"

#include "base/linear_algebra.h"
#include "locate/pose_fusion.h"

#include <math.h>
#include <string.h>

static const double MAP = 1e-4, NOISE = 1e-6, DRIFT = 1e-7; // variances

static void put_diagonal(double out[36], double value)
{
    for (int i = 0; i < 36; i++)
        out[i] = i % 7 == 0 ? value : 0;
}

// same: the share of the map's information that was also in the last image.
static struct pose_measurement measurement_of(double noise, double drift, double same, double off_m)
{
    struct pose_measurement measurement = {.offset = {0, 0, 0, off_m, 0, 0}};
    put_diagonal(measurement.drift, drift);
    put_diagonal(measurement.noise, noise);
    put_diagonal(measurement.map_covariance, MAP);
    put_diagonal(measurement.map_information, same / MAP);
    return measurement;
}

static struct pose_fusion started(double noise)
{
    double map[36], own[36];
    struct pose_fusion a;
    put_diagonal(map, MAP);
    put_diagonal(own, noise);
    pose_fusion_start(&a, map, own);
    return a;
}

static void expect_positive_definite(const struct pose_fusion *a)
{
    double covariance[36];
    pose_fusion_covariance(a, covariance);
    EXPECT_TRUE(cholesky_factor(covariance, 6));
}

// The map's pose is 10 mm off. From the same tags again and again that is one measurement, and as likely the map's
// error as the camera's; from other tags in each image it is the camera's.
static void test_repeated_measurement_adds_no_information(void **state)
{
    (void)state;
    static const struct {
        double same, least_m, max_m; // how much of 10 mm is corrected in the end
    } cases[] = {{1, 0.0049, 0.0052}, {0, 0.0095, 0.01}};
    for (size_t c = 0; c < COUNT_OF(cases); c++) {
        struct pose_fusion a = started(NOISE);
        double moved_m = 0, largest_m = 0;
        for (int i = 0; i < 40; i++) {
            struct pose_measurement measurement = measurement_of(NOISE, DRIFT, i ? cases[c].same : 0, 0.01 - moved_m);
            double by[6];
            EXPECT_TRUE(pose_fusion_update(&a, &measurement, by));
            moved_m += by[3];
            largest_m = fmax(largest_m, fabs(by[3]));
            expect_positive_definite(&a);
        }
        print_message("%s: moved by %.2f of 10 mm, at most %.2f at a time\n",
                      cases[c].same > 0 ? "the same tags" : "other tags", 1e3 * moved_m, 1e3 * largest_m);
        EXPECT_AT_LEAST(moved_m, cases[c].least_m);
        EXPECT_AT_MOST(moved_m, cases[c].max_m);
        EXPECT_AT_MOST(largest_m, 0.002); // no visible jump
    }
}

// The two information matrices of consecutive images do not quite match: the shared one is a little larger than the
// whole. That mismatch is far larger than the noise of a sharp image.
static void test_inconsistent_measurements(void **state)
{
    (void)state;
    static const double more[] = {0, 1e-4, 2.4e-4, 4e-4, 1e-3, 0.1}, noises[] = {1e-6, 1e-9, 1e-12};
    for (size_t n = 0; n < COUNT_OF(noises); n++)
        for (size_t m = 0; m < COUNT_OF(more); m++) {
            struct pose_fusion a = started(noises[n]);
            for (int i = 0; i < 20; i++) {
                struct pose_measurement measurement = measurement_of(noises[n], noises[n] / 10, 1 + more[m], 0);
                double by[6];
                const bool updated = pose_fusion_update(&a, &measurement, by);
                if (!updated)
                    print_error("noise %g, %g more: no update at image %d\n", noises[n], more[m], i);
                EXPECT_TRUE(updated);
                EXPECT_NEAR(by[3], 0, 1e-9);
                expect_positive_definite(&a);
            }
        }
}

static void test_nan_measurement_is_ignored(void **state)
{
    (void)state;
    struct pose_fusion a = started(NOISE), before = a;
    struct pose_measurement measurement = measurement_of((double)NAN, DRIFT, 1, 0.01);
    double by[6] = {0};
    EXPECT_TRUE(!pose_fusion_update(&a, &measurement, by));
    EXPECT_TRUE(!memcmp(&a, &before, sizeof a));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_repeated_measurement_adds_no_information),
                                       cmocka_unit_test(test_inconsistent_measurements),
                                       cmocka_unit_test(test_nan_measurement_is_ignored)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
