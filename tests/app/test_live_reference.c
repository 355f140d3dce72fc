// What an attempt is judged by: the actor as recorded, or mirrored.
#include "tests/support/test.h"

#include "app/live/live_attempt.h"
#include "app/viewer/live_expectation.h"
#include "base/clock.h"
#include "compare/live_judge.h"
#include "tests/support/exercise.h"

static const double RAD = 180 / 3.14159265358979323846; // degrees in a radian

static struct rng rng = {5};

static struct exercise exercise_of(bool mirrored)
{
    struct exercise e = exercise_default();
    e.seconds = 3;
    e.mirrored = mirrored;
    return e;
}

static struct joint_samples samples_of(bool mirrored)
{
    const struct exercise e = exercise_of(mirrored);
    struct joint_samples s;
    exercise_samples(&e, &rng, &s);
    return s;
}

// The actor's movement, in which the right arm does more than the left, and its mirror image.
struct reference {
    struct movement plain, mirrored;
};

static struct reference open_reference(void)
{
    struct reference r;
    struct joint_samples s = samples_of(false);
    EXPECT_STATUS(movement_from_samples(&s, &r.plain), OK);
    EXPECT_STATUS(movement_mirror(&r.plain, &r.mirrored), OK);
    joint_samples_free(&s);
    return r;
}

static void close_reference(struct reference *r)
{
    movement_free(&r->plain);
    movement_free(&r->mirrored);
}

static int frames_different(struct live_judge *j, const struct movement *person)
{
    int different = 0;
    for (int32_t f = 0; f < person->count; f++) {
        struct part_difference parts[PART_COUNT];
        int32_t at;
        live_judge_frame(j, &person->frames[f], &at, parts);
        different += parts[PART_RIGHT_UPPER_ARM].verdict == VERDICT_DIFFERENT;
    }
    return different;
}

static void test_frames_are_judged_by_the_mirrored_actor(void **state)
{
    (void)state;
    struct reference r = open_reference();
    struct joint_samples s = samples_of(true);
    struct movement person;
    struct live_judge *j;
    EXPECT_STATUS(movement_from_samples(&s, &person), OK);
    EXPECT_STATUS(live_judge_open(&j, &r.plain), OK);
    const int by_plain = frames_different(j, &person);
    live_judge_set_reference(j, &r.mirrored);
    const int by_mirrored = frames_different(j, &person);
    live_judge_set_reference(j, &r.plain);
    const int again = frames_different(j, &person);
    print_message("the right arm differs in %d of %d frames, in %d by the mirrored actor\n", by_plain, person.count,
                  by_mirrored);
    EXPECT_AT_LEAST(by_plain, person.count / 4);
    EXPECT_INT(by_mirrored, 0);
    EXPECT_INT(again, by_plain);
    live_judge_close(&j);
    movement_free(&person);
    joint_samples_free(&s);
    close_reference(&r);
}

static struct live_attempt judge_expecting(const struct movement *reference, bool mirrored, bool person_mirrored,
                                           const struct expectation *expected)
{
    struct joint_samples s = samples_of(person_mirrored);
    struct attempt_judge *j;
    struct live_attempt a;
    const struct attempt_task task = {.reference = reference,
                                      .mirrored = mirrored,
                                      .expected = expected,
                                      .first = expected ? 10 : 0,
                                      .end = reference->count,
                                      .number = 1};
    EXPECT_STATUS(attempt_judge_start(&j, &task, &s), OK);
    while (!attempt_judge_finished(j, &a))
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    attempt_judge_close(&j);
    EXPECT_INT(a.mirrored, mirrored);
    return a;
}

static struct live_attempt judge(const struct movement *reference, bool mirrored, bool person_mirrored)
{
    struct live_attempt a = judge_expecting(reference, mirrored, person_mirrored, NULL);
    EXPECT_TRUE(a.compared);
    return a;
}

// The times of what counts are the whole reference's, of which only a part may have been done.
static void test_attempts_are_judged_by_what_is_expected(void **state)
{
    (void)state;
    struct reference r = open_reference();
    const struct expectation middle = {.ignored = 1 << PART_HEAD, .from_s = 1, .to_s = 2}, before = {.to_s = 0.3};
    struct live_attempt a = judge_expecting(&r.plain, false, false, &middle);
    EXPECT_TRUE(a.compared);
    EXPECT_INT(a.comparison.by.ignored, 1 << PART_HEAD);
    EXPECT_NEAR(a.comparison.expected.from_s, 1 - 10 / MOVEMENT_RATE_HZ, 1e-9);
    EXPECT_INT(a.comparison.counted_a.first, 20);
    EXPECT_INT(a.comparison.counted_a.end, 50);
    EXPECT_AT_LEAST(a.comparison.score, 95);
    bool any = false, head = false;
    for (int cell = 0; cell < ATTEMPT_CELLS; cell++) {
        any = any || a.strip[cell][PART_RIGHT_UPPER_ARM] == VERDICT_SAME;
        head = head || a.strip[cell][PART_HEAD] == VERDICT_SAME || a.strip[cell][PART_HEAD] == VERDICT_DIFFERENT;
    }
    EXPECT_TRUE(any && !head);
    live_attempt_free(&a);
    a = judge_expecting(&r.plain, false, false, &before);
    EXPECT_TRUE(!a.compared);
    EXPECT_TRUE(strstr(a.why, "counts"));
    live_attempt_free(&a);
    close_reference(&r);
}

static void test_attempts_are_judged_by_the_mirrored_actor(void **state)
{
    (void)state;
    struct reference r = open_reference();
    struct live_attempt a = judge(&r.mirrored, true, true);
    EXPECT_NEAR(a.comparison.score, 100, 0.01);
    EXPECT_TRUE(!a.comparison.mirrored); // as asked for, so it is no finding
    EXPECT_INT(a.comparison.finding_count, 0);
    live_attempt_free(&a);
    a = judge(&r.plain, false, true); // the other side was used
    EXPECT_TRUE(a.comparison.mirrored);
    live_attempt_free(&a);
    a = judge(&r.mirrored, true, false); // and so it was here
    EXPECT_TRUE(a.comparison.mirrored);
    live_attempt_free(&a);
    close_reference(&r);
}

// Groups touched on the screen against single parts: what is not touched stays as it is, also where it is finer.
static void test_what_is_touched_is_expected(void **state)
{
    (void)state;
    const int64_t offset_ns = 200000000;
    const double seconds = 4;
    struct expectation e = {.ignored = 1 << PART_LEFT_SHIN, .from_s = 0.5, .to_s = 3};
    e.tolerance_rad[PART_RIGHT_FOREARM] = 0.2;
    const struct expectation before = e;
    struct live_counting c = live_counting_of(&e, offset_ns);
    EXPECT_TRUE(c.counts[GROUP_LEGS] && c.counts[GROUP_ARMS]);
    EXPECT_TRUE(c.tolerance_deg[GROUP_ARMS] < 0);
    EXPECT_NEAR(c.tolerance_deg[GROUP_LEGS], 0, 1e-9);
    EXPECT_INT(c.from_ns, 700000000);
    EXPECT_INT(c.to_ns, 3200000000);
    EXPECT_STATUS(live_counting_apply(&c, offset_ns, seconds, &e), OK);
    EXPECT_TRUE(!memcmp(&e, &before, sizeof e));

    c.counts[GROUP_HEAD] = false;
    c.tolerance_deg[GROUP_TRUNK] = 20;
    c.from_ns = 0; // before the first frame in which a person is
    c.to_ns = 9000000000;
    EXPECT_STATUS(live_counting_apply(&c, offset_ns, seconds, &e), OK);
    EXPECT_INT(e.ignored, 1 << PART_LEFT_SHIN | 1 << PART_HEAD);
    EXPECT_NEAR(e.tolerance_rad[PART_UPPER_TORSO] * RAD, 20, 1e-9);
    EXPECT_NEAR(e.tolerance_rad[PART_RIGHT_FOREARM], 0.2, 1e-9);
    EXPECT_NEAR(e.from_s, 0, 1e-9);
    EXPECT_NEAR(e.to_s, seconds, 1e-9);

    e.from_s = 1; // of another part too little is in the reference: this one stays
    c = live_counting_of(&e, offset_ns);
    c.counts[GROUP_TRUNK] = false;
    c.from_ns = 0;
    c.to_ns = offset_ns + 100000000;
    EXPECT_STATUS(live_counting_apply(&c, offset_ns, seconds, &e), ERR_INPUT);
    EXPECT_NEAR(e.from_s, 1, 1e-9);
    EXPECT_NEAR(e.to_s, seconds, 1e-9);
    EXPECT_TRUE(e.ignored >> PART_UPPER_TORSO & 1);

    c = live_counting_of(&e, offset_ns);
    c.tolerance_deg[GROUP_ARMS] = 0;
    c.from_ns = c.to_ns = 0;
    EXPECT_STATUS(live_counting_apply(&c, offset_ns, seconds, &e), OK);
    EXPECT_NEAR(e.tolerance_rad[PART_RIGHT_FOREARM], 0, 1e-9);
    EXPECT_NEAR(e.to_s, 0, 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_are_judged_by_the_mirrored_actor),
        cmocka_unit_test(test_attempts_are_judged_by_the_mirrored_actor),
        cmocka_unit_test(test_attempts_are_judged_by_what_is_expected),
        cmocka_unit_test(test_what_is_touched_is_expected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
