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
static struct anchor_look look_at(double noise, double drift, double same, double off_m)
{
    struct anchor_look look = {.off = {0, 0, 0, off_m, 0, 0}};
    put_diagonal(look.drift, drift);
    put_diagonal(look.noise, noise);
    put_diagonal(look.map_covariance, MAP);
    put_diagonal(look.map_information, same / MAP);
    return look;
}

static struct anchor started(double noise)
{
    double map[36], own[36];
    struct anchor a;
    put_diagonal(map, MAP);
    put_diagonal(own, noise);
    anchor_start(&a, map, own);
    return a;
}

static void check_sure(const struct anchor *a)
{
    double covariance[36];
    anchor_covariance(a, covariance);
    EXPECT_TRUE(cholesky(covariance, 6));
}

// The map is 10 mm off by what comes into sight. Seen on and on that is one error of the map's, as likely as not; but
// seen by something else each time it is the camera's.
static void what_is_seen_again_says_nothing_new(void **state)
{
    (void)state;
    static const struct {
        double same, least_m, most_m; // of 10 mm, what is made good in the end
    } cases[] = {{1, 0.004, 0.006}, {0, 0.009, 0.01}};
    for (size_t c = 0; c < COUNT_OF(cases); c++) {
        struct anchor a = started(NOISE);
        double moved_m = 0, largest_m = 0;
        for (int i = 0; i < 40; i++) {
            struct anchor_look look = look_at(NOISE, DRIFT, i ? cases[c].same : 0, 0.01 - moved_m);
            double by[6];
            EXPECT_TRUE(anchor_move(&a, &look, by));
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
static void looks_that_do_not_quite_match(void **state)
{
    (void)state;
    static const double more[] = {0, 1e-4, 2.4e-4, 4e-4, 1e-3, 0.1}, noises[] = {1e-6, 1e-9, 1e-12};
    for (size_t n = 0; n < COUNT_OF(noises); n++)
        for (size_t m = 0; m < COUNT_OF(more); m++) {
            struct anchor a = started(noises[n]);
            for (int i = 0; i < 20; i++) {
                struct anchor_look look = look_at(noises[n], noises[n] / 10, 1 + more[m], 0);
                double by[6];
                const bool goes_on = anchor_move(&a, &look, by);
                if (!goes_on)
                    print_error("noise %g, %g more: given up at picture %d\n", noises[n], more[m], i);
                EXPECT_TRUE(goes_on);
                EXPECT_NEAR(by[3], 0, 1e-9);
                check_sure(&a);
            }
        }
}

static void what_is_no_number_changes_nothing(void **state)
{
    (void)state;
    struct anchor a = started(NOISE), before = a;
    struct anchor_look look = look_at((double)NAN, DRIFT, 1, 0.01);
    double by[6] = {0};
    EXPECT_TRUE(!anchor_move(&a, &look, by));
    EXPECT_TRUE(!memcmp(&a, &before, sizeof a));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_seen_again_says_nothing_new),
                                       cmocka_unit_test(looks_that_do_not_quite_match),
                                       cmocka_unit_test(what_is_no_number_changes_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
