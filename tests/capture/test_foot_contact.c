// Feet that stand in a smoothed take stand still: while the true foot does not move, the smoothed one moves by less
// than a centimetre; where feet move, they are not held.
#include "tests/support/test.h"

#include "tests/support/smoothed_film.h"
#include "tests/support/tracked_film.h"

#include <string.h>

enum { FRAMES = SANITIZED ? 45 : 75 };
#define STILL_M 0.006 // the true foot stands while it stays within this of where it began

struct film_case {
    const char *figure, *motion;
    double from_s;
};

static double median_of(double *values, int count)
{
    for (int i = 1; i < count; i++)
        for (int k = i; k > 0 && values[k] < values[k - 1]; k--) {
            const double other = values[k];
            values[k] = values[k - 1];
            values[k - 1] = other;
        }
    return count ? values[count / 2] : 0;
}

static void test_feet_stand(void **state)
{
    (void)state;
    enum { MOST = 400 };
    static const struct film_case cases[] = {{"woman", "kata", 1},
                                             {"man", "walk", 0.5},
                                             {"tall", "exercise", 0},
                                             {"child", "kata", 2.5},
                                             {"man", "bend", 1}};
    double slide[2][MOST], worst[2] = {0}, error_m[2] = {0};
    int stands = 0, feet = 0;
    for (size_t c = 0; c < COUNT_OF(cases); c++) {
        struct tracked_film f;
        static struct skeleton truth[FRAMES];
        struct smoothed_film film = {0};
        tracked_film_open(&f, cases[c].figure, cases[c].motion);
        film.calibration = f.calibration;
        const struct pose from = world_sensor_pose(f.world);
        for (int k = 0; k < FRAMES; k++) {
            const double t = cases[c].from_s + k / 30.0;
            tracked_film_shoot(&f, from, t, (uint64_t)k);
            truth[k] = world_joints_in_camera(f.world, t, from);
            EXPECT_STATUS(smoothed_film_add(&film, nanoseconds(t), f.depth), OK);
        }
        EXPECT_STATUS(smoothed_film_track(&film), OK);
        for (int side = 0; side < 2; side++) {
            const enum joint j = side ? JOINT_RIGHT_FOOT : JOINT_LEFT_FOOT;
            for (int first = 0, end; first < FRAMES; first = end) {
                double moved[2] = {0};
                for (end = first + 1; end < FRAMES && v3_distance(truth[end].joint[j], truth[first].joint[j]) < STILL_M;
                     end++)
                    ;
                if (end - first < 12)
                    continue;
                for (int k = first + 3; k < end - 3; k++) { // how far from where it is in the middle of its stand
                    const int middle = (first + end) / 2;
                    moved[0] = fmax(moved[0], v3_distance(film.online[k].joint[j], film.online[middle].joint[j]));
                    moved[1] = fmax(moved[1], v3_distance(film.smoothed[k].joint[j], film.smoothed[middle].joint[j]));
                }
                for (int i = 0; i < 2 && stands < MOST; i++) {
                    slide[i][stands] = moved[i];
                    worst[i] = fmax(worst[i], moved[i]);
                }
                stands++;
            }
            for (int k = 0; k < FRAMES; k++, feet++) {
                error_m[0] += v3_distance(film.online[k].joint[j], truth[k].joint[j]);
                error_m[1] += v3_distance(film.smoothed[k].joint[j], truth[k].joint[j]);
            }
        }
        smoothed_film_free(&film);
        tracked_film_close(&f);
    }
    const double median[2] = {median_of(slide[0], stands), median_of(slide[1], stands)};
    print_message(
        "%d stands: a foot slides by %.1f mm in the median, at most %.1f mm; online %.1f, %.1f; off by %.1f mm, "
        "online %.1f\n",
        stands, 1e3 * median[1], 1e3 * worst[1], 1e3 * median[0], 1e3 * worst[0], 1e3 * error_m[1] / feet,
        1e3 * error_m[0] / feet);
    EXPECT_AT_LEAST(stands, 6);
    EXPECT_AT_MOST(median[1], 0.003);
    EXPECT_AT_MOST(worst[1], 0.04); // 26 mm, where the smoothed leg errs
    EXPECT_AT_MOST(error_m[1], error_m[0] + 0.002 * feet);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_feet_stand)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
