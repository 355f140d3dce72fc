// Repetitions counted in movements of a person made of exact joints, whose number is known.
#include "tests/support/test.h"

#include "compare/movement.h"
#include "compare/repetitions.h"
#include "tests/support/exercise.h"

#include <stdio.h>

static const uint64_t SEED = 11;

// What the person does at each instant: where in the exercise they are, and whether a tracker loses the legs.
struct performed_cycle {
    double seconds[12]; // of each repetition; 0: no more
    double wait_s;      // standing still, before and after
    bool legs_lost;
    bool last_is_none; // the last "repetition" is somebody who walks off: hands and knees go elsewhere
};

static double seconds_of(const struct performed_cycle *p)
{
    double sum = 2 * p->wait_s;
    for (int k = 0; p->seconds[k] > 0; k++)
        sum += p->seconds[k];
    return sum;
}

static double last_of(const struct performed_cycle *p)
{
    int k = 0;
    while (p->seconds[k + 1] > 0)
        k++;
    return p->seconds[k];
}

// Seconds of an exercise whose repetitions take 3 s each.
static double exercise_time(const struct performed_cycle *p, double time_s)
{
    double before_s = p->wait_s;
    int k = 0;
    for (; p->seconds[k] > 0 && time_s >= before_s + p->seconds[k]; k++)
        before_s += p->seconds[k];
    if (time_s < before_s)
        return 0;
    return p->seconds[k] > 0 ? 3 * (k + (time_s - before_s) / p->seconds[k]) : 3 * k;
}

static void walk_off(struct skeleton *s, double time_s)
{
    static const enum joint ends[4] = {JOINT_LEFT_HAND, JOINT_RIGHT_ELBOW, JOINT_LEFT_KNEE, JOINT_RIGHT_FOOT};
    for (int k = 0; k < 4; k++) {
        const struct vec3 by = {0.3 * sin(1.9 * time_s + k), 0, -0.35 * fabs(sin(1.3 * time_s + 2 * k))};
        s->joint[ends[k]] = v3_add(s->joint[ends[k]], by);
    }
}

static int32_t count(const struct performed_cycle *p, struct rng *rng)
{
    struct exercise e = exercise_default();
    struct joint_samples samples = {0};
    struct vec3 away[4] = {0};
    e.noise_m = 0.01;
    for (int i = 0; i < seconds_of(p) * 15; i++) {
        struct joint_sample s = {.time_ns = (int64_t)(i / 15.0 * 1e9),
                                 .skeleton = exercise_at(&e, exercise_time(p, i / 15.0), rng)};
        static const enum joint legs[4] = {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
        // Knees and feet jump to wrong places, where they stay for a second or so.
        if (rng_uniform(rng) < 0.06)
            for (int k = 0; k < 4; k++)
                away[k] = rng_normal3(rng, 0.35);
        for (int k = 0; k < 4 && p->legs_lost; k++)
            s.skeleton.joint[legs[k]] = v3_add(s.skeleton.joint[legs[k]], away[k]);
        if (p->last_is_none && i / 15.0 > seconds_of(p) - p->wait_s - last_of(p))
            walk_off(&s.skeleton, i / 15.0);
        for (int j = 0; j < JOINT_COUNT; j++)
            s.sigma_m[j] = default_sigma_m(1);
        EXPECT_STATUS(joint_samples_add(&samples, &s), OK);
    }
    struct movement m;
    struct feature_frame *frames;
    struct repetition_list list;
    EXPECT_STATUS(movement_from_samples(&samples, &m), OK);
    EXPECT_STATUS(movement_features(&m, m.ever_known, NULL, &frames), OK);
    EXPECT_STATUS(repetitions_find(&(struct features){frames, m.count}, &list), OK);
    const int32_t found = list.count;
    repetition_list_free(&list);
    free(frames);
    movement_free(&m);
    joint_samples_free(&samples);
    return found;
}

static void test_even_repetitions(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    printf("seed %llu\n", (unsigned long long)SEED);
    for (int wanted = 3; wanted <= 9; wanted++) {
        struct performed_cycle p = {.wait_s = wanted % 3};
        for (int k = 0; k < wanted; k++)
            p.seconds[k] = 3 + 0.5 * rng_normal(&rng) / 3;
        EXPECT_INT(count(&p, &rng), wanted);
    }
}

// Two slow ones and four fast ones are six, not three.
static void test_the_pace_changes(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    const struct performed_cycle p = {.seconds = {8.5, 9, 5, 4.5, 4.6, 4.4}, .wait_s = 1.5};
    EXPECT_INT(count(&p, &rng), 6);
}

static void test_legs_that_a_tracker_loses_do_not_matter(void **state)
{
    (void)state;
    struct rng rng = {SEED + 1};
    const struct performed_cycle p = {.seconds = {3.4, 3, 2.8, 3.2, 3}, .wait_s = 1, .legs_lost = true};
    EXPECT_INT(count(&p, &rng), 5);
}

// What costs a little less than standing aside, and far more than each of the others, is no repetition.
static void test_who_walks_off_does_not_repeat(void **state)
{
    (void)state;
    struct rng rng = {SEED + 3};
    const struct performed_cycle p = {.seconds = {3, 3.2, 2.9, 3.1, 7}, .last_is_none = true};
    EXPECT_INT(count(&p, &rng), 4);
}

// Nothing moves, and one performance alone: no repetition.
static void test_no_repetition(void **state)
{
    (void)state;
    struct rng rng = {SEED + 2};
    const struct performed_cycle still = {.wait_s = 5}, once = {.seconds = {4}, .wait_s = 2};
    EXPECT_INT(count(&still, &rng), 0);
    EXPECT_INT(count(&once, &rng), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_even_repetitions),
        cmocka_unit_test(test_the_pace_changes),
        cmocka_unit_test(test_legs_that_a_tracker_loses_do_not_matter),
        cmocka_unit_test(test_who_walks_off_does_not_repeat),
        cmocka_unit_test(test_no_repetition),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
