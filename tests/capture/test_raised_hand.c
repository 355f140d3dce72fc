// The raised hand on skeletons as they are tracked, not on true ones: found soon after it is up, never by accident.
//
//     test_raised_hand            some seconds of other movement
//     test_raised_hand SECONDS    so many
#include "tests/support/test.h"

#include "capture/coaching/raised_hand.h"
#include "tests/support/tracked_film.h"

#include <stdio.h>

static double wanted_s = 5;

static bool track(struct tracked_film *f, double film_s, double at_s, uint64_t seed, struct skeleton *s)
{
    tracked_film_shoot(f, world_sensor_pose(f->world), film_s, seed);
    const enum status status = tracker_next(f->tracker, nanoseconds(at_s) + 1, f->depth, s, f->mask);
    EXPECT_TRUE(status >= 0);
    return status == OK;
}

// Whether a hand is above the head and has come to rest there, by the true joints.
static bool held_up(const struct world *world, double at_s)
{
    const struct skeleton now = world_joints(world, at_s), before = world_joints(world, at_s - 1 / 30.0);
    bool any = false;
    for (int left = 0; left < 2; left++) {
        const enum joint hand = left ? JOINT_LEFT_HAND : JOINT_RIGHT_HAND;
        any |= now.joint[hand].z - now.joint[JOINT_HEAD].z > 0.12 &&
               v3_distance(now.joint[hand], before.joint[hand]) * 30 < 0.6;
    }
    return any;
}

// From the hand's being up, by the true joints, to the gesture: both hands, one after the other.
static void test_found_within_half_a_second(void **state)
{
    (void)state;
    static const char *const figures[] = {"woman", "man", "child"};
    double slowest_s = 0;
    for (size_t k = 0; k < COUNT_OF(figures); k += TRACKED_EACH) {
        struct tracked_film f;
        struct raised_hand hand = {0};
        int found = 0;
        double up_s = -1;
        tracked_film_open(&f, figures[k], "raise-hand");
        for (int i = 0; i / 30.0 < world_seconds(f.world); i++) {
            struct skeleton s;
            const double at_s = i / 30.0;
            up_s = !held_up(f.world, at_s) ? -1 : up_s < 0 ? at_s : up_s;
            const bool there = track(&f, at_s, at_s, (uint64_t)i + 1, &s);
            if (!raised_hand_next(&hand, nanoseconds(at_s) + 1, there ? &s : NULL))
                continue;
            printf("%s: hand up at %.2f s, found at %.2f s\n", figures[k], up_s, at_s);
            EXPECT_TRUE(up_s >= 0);
            slowest_s = fmax(slowest_s, at_s - up_s);
            found++;
        }
        EXPECT_INT(found, 2);
        tracked_film_close(&f);
    }
    printf("at most %.2f s after the hand was up\n", slowest_s);
    EXPECT_AT_MOST(slowest_s, 0.5);
}

static void test_never_by_accident(void **state)
{
    (void)state;
    static const struct {
        const char *figure, *motion;
    } films[] = {{"man", "kata"},     {"woman", "kata"}, {"child", "kata"},  {"woman", "pirouette"},
                 {"man", "exercise"}, {"heavy", "kata"}, {"woman", "visit"}, {"man", "bend"}};
    double seconds = 0;
    int found = 0;
    for (size_t k = 0; seconds < wanted_s; k = (k + 1) % COUNT_OF(films)) {
        struct tracked_film f;
        struct raised_hand hand = {0};
        tracked_film_open(&f, films[k].figure, films[k].motion);
        const uint64_t seed = (uint64_t)(seconds * 30) * 7 + 1;
        for (int i = 0; i / 30.0 < world_seconds(f.world) && seconds < wanted_s; i++) {
            struct skeleton s;
            const bool there = track(&f, i / 30.0, i / 30.0, seed + (uint64_t)i, &s);
            if (raised_hand_next(&hand, nanoseconds(i / 30.0) + 1, there ? &s : NULL)) {
                printf("%s %s: by accident at %.2f s\n", films[k].figure, films[k].motion, i / 30.0);
                found++;
            }
            seconds += 1 / 30.0;
        }
        tracked_film_close(&f);
    }
    printf("%.0f s of other movement, %d gestures\n", seconds, found);
    EXPECT_INT(found, 0);
}

int main(int argc, char **argv)
{
    wanted_s = argc > 1 ? atof(argv[1]) : wanted_s;
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_found_within_half_a_second),
                                       cmocka_unit_test(test_never_by_accident)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
