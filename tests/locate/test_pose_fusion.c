// How a camera that is followed is drawn to where the map has it: by what is new of what the map says, over several
// pictures; and that it goes on where the numbers are strained.
#include "tests/support/test.h"

#include "locate/pose_fusion.h"
#include "base/linear_algebra.h"

#include <math.h>
#include <string.h>

static const double MAP = 1e-4, NOISE = 1e-6, DRIFT = 1e-7; // variances

static void put_diagonal(double out[36], double value)
{
    for (int i = 0; i < 36; i++)
        out[i] = i % 7 == 0 ? value : 0;
}

// same: what share of the map's information was in sight before.
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

static void check_sure(const struct pose_fusion *a)
{
    double covariance[36];
    pose_fusion_covariance(a, covariance);
    EXPECT_TRUE(cholesky_factor(covariance, 6));
}

// The map is 10 mm off by what comes into sight. Seen on and on that is one error of the map's, as likely as not; but
// seen by something else each time it is the camera's.
static void test_repeated_measurement_adds_no_information(void **state)
{
    (void)state;
    static const struct {
        double same, least_m, most_m; // of 10 mm, what is made good in the end
    } cases[] = {{1, 0.004, 0.006}, {0, 0.009, 0.01}};
    for (size_t c = 0; c < COUNT_OF(cases); c++) {
        struct pose_fusion a = started(NOISE);
        double moved_m = 0, largest_m = 0;
        for (int i = 0; i < 40; i++) {
            struct pose_measurement measurement = measurement_of(NOISE, DRIFT, i ? cases[c].same : 0, 0.01 - moved_m);
            double by[6];
            EXPECT_TRUE(pose_fusion_update(&a, &measurement, by));
            moved_m += by[3];
            largest_m = fmax(largest_m, fabs(by[3]));
            check_sure(&a);
        }
        print_message("%s: moved by %.2f of 10 mm, at most %.2f at a time\n",
                      cases[c].same > 0 ? "the same again" : "always others", 1e3 * moved_m, 1e3 * largest_m);
        EXPECT_AT_LEAST(moved_m, cases[c].least_m);
        EXPECT_AT_MOST(moved_m, cases[c].most_m);
        EXPECT_AT_MOST(largest_m, 0.003); // nobody sees it jump
    }
}

// From picture to picture the two looks do not quite match: the second has a little more of the first's information
// than there is. That much is far more than what a sharp picture errs by.
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
                const bool goes_on = pose_fusion_update(&a, &measurement, by);
                if (!goes_on)
                    print_error("noise %g, %g more: given up at picture %d\n", noises[n], more[m], i);
                EXPECT_TRUE(goes_on);
                EXPECT_NEAR(by[3], 0, 1e-9);
                check_sure(&a);
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
