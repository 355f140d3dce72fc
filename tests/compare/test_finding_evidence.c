// What is found, and in which order, on a person of exact joints.
#include "tests/support/test.h"

#include "compare/comparison.h"
#include "compare/findings.h"
#include "tests/support/exercise.h"

#include <stdlib.h>

static struct exercise once(void)
{
    struct exercise e = exercise_default();
    e.seconds = 3;
    return e;
}

static struct movement make(struct joint_samples *s)
{
    struct movement m;
    EXPECT_STATUS(movement_from_samples(s, &m), OK);
    joint_samples_free(s);
    return m;
}

static struct comparison compare(struct joint_samples *a, struct joint_samples *b)
{
    struct movement ma = make(a), mb = make(b);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&ma, &mb, NULL, &c), OK);
    for (int k = 0; k < c.finding_count; k++)
        print_message("%s %s: %s, cost %.4f, %.1f points\n", finding_kind_name(c.findings[k].kind), c.findings[k].part,
                      c.findings[k].sentence, c.findings[k].cost, c.findings[k].loss);
    return c;
}

static void test_what_is_off_all_along_comes_second(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise elbow = a, knee = a;
    struct rng rng = {7};
    struct joint_samples sa, sb, legs;
    elbow.right_elbow_rad = 0.44; // 25 degrees
    elbow.wrong_from_s = 0.8;
    elbow.wrong_to_s = 2.2;
    knee.right_knee_rad = 0.35; // 20 degrees
    knee.wrong_to_s = 100;
    exercise_samples(&a, &rng, &sa);
    exercise_samples(&elbow, &rng, &sb);
    exercise_samples(&knee, &rng, &legs);
    for (int64_t i = 0; i < sb.count; i++)
        sb.at[i].skeleton.joint[JOINT_RIGHT_FOOT] = legs.at[i].skeleton.joint[JOINT_RIGHT_FOOT];
    joint_samples_free(&legs);
    struct comparison c = compare(&sa, &sb);
    EXPECT_AT_LEAST(c.finding_count, 2);
    EXPECT_INT(strcmp(c.findings[0].part, "right_forearm"), 0);
    EXPECT_INT(strcmp(c.findings[1].part, "right_shin"), 0);
    comparison_free(&c);
}

// Of pauses by turns, now in one movement and now in the other, only what remains is one: `skipped` frames of the
// reference are passed over after a wait of 36.
static struct comparison with_pauses(int32_t skipped)
{
    const struct exercise a = once();
    struct rng rng = {7};
    struct joint_samples sa, sb;
    exercise_samples(&a, &rng, &sa);
    exercise_samples(&a, &rng, &sb);
    struct comparison c = compare(&sa, &sb);
    EXPECT_INT(c.finding_count, 0);
    EXPECT_INT(c.pace.piece_count, 0);
    c.pace.pieces = calloc(2, sizeof *c.pace.pieces);
    c.pace.piece_count = 2;
    c.pace.pieces[0] = (struct piece){PIECE_PAUSE, 20, 23, 20, 59, 0};
    c.pace.pieces[1] = (struct piece){PIECE_PAUSE_SKIPPED, 23, 26 + skipped, 59, 62, 0};
    EXPECT_STATUS(findings_make(&c), OK);
    return c;
}

static void test_pauses_by_turns_are_none(void **state)
{
    (void)state;
    struct comparison none = with_pauses(36), one = with_pauses(6);
    EXPECT_INT(none.finding_count, 0);
    EXPECT_INT(one.finding_count, 1);
    EXPECT_NEAR(one.findings[0].amount, 1, 0.01);
    EXPECT_NEAR(one.findings[0].from_s, 20 / 30.0, 0.01);
    EXPECT_NEAR(one.findings[0].to_s, 62 / 30.0, 0.01);
    comparison_free(&none);
    comparison_free(&one);
}

// A short pause comes after a joint that was wrong for a while, a long one before it; one that is hardly noticed is not
// said.
static void test_a_short_pause_comes_last(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise elbow = a;
    elbow.right_elbow_rad = 0.44; // 25 degrees
    static const int32_t b_end[3] = {33, 66, 27};
    elbow.wrong_from_s = 1.2;
    elbow.wrong_to_s = 2.0;
    for (int k = 0; k < 3; k++) {
        struct rng rng = {7};
        struct joint_samples sa, sb;
        exercise_samples(&a, &rng, &sa);
        exercise_samples(&elbow, &rng, &sb);
        struct comparison c = compare(&sa, &sb);
        EXPECT_INT(c.finding_count, 1);
        print_message("the posture costs %.1f points\n", c.findings[0].loss);
        c.finding_count = 0;
        c.pace.pieces = calloc(1, sizeof *c.pace.pieces);
        c.pace.piece_count = 1;
        c.pace.pieces[0] = (struct piece){PIECE_PAUSE, 20, 21, 20, b_end[k], 0};
        EXPECT_STATUS(findings_make(&c), OK);
        EXPECT_INT(c.finding_count, k < 2 ? 2 : 1);
        EXPECT_INT(c.findings[0].kind, k == 1 ? FINDING_TIMING : FINDING_POSTURE);
        comparison_free(&c);
    }
}

// It is seen best where it is worst, and not in its middle.
static void test_worst_moment_of_a_posture(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise elbow = a, worse = a;
    struct rng rng = {7};
    struct joint_samples sa, sb, worst;
    elbow.right_elbow_rad = 0.44; // 25 degrees
    worse.right_elbow_rad = 0.7;
    elbow.wrong_from_s = worse.wrong_from_s = 0.8;
    elbow.wrong_to_s = worse.wrong_to_s = 2.2;
    exercise_samples(&a, &rng, &sa);
    exercise_samples(&elbow, &rng, &sb);
    exercise_samples(&worse, &rng, &worst);
    int64_t first = sb.count, last = 0;
    for (int64_t i = 0; i < sb.count; i++) {
        const double at_s = (double)(sb.at[i].time_ns - sb.at[0].time_ns) * 1e-9;
        if (at_s < 1.75 || at_s > 2)
            continue;
        sb.at[i] = worst.at[i];
        first = i < first ? i : first;
        last = i;
    }
    const double from_s = (double)(sb.at[first].time_ns - sb.at[0].time_ns) * 1e-9,
                 to_s = (double)(sb.at[last].time_ns - sb.at[0].time_ns) * 1e-9;
    joint_samples_free(&worst);
    struct comparison c = compare(&sa, &sb);
    EXPECT_AT_LEAST(c.finding_count, 1);
    const struct finding *f = &c.findings[0];
    EXPECT_INT(part_by_name(f->part), PART_RIGHT_FOREARM);
    EXPECT_TRUE(0.5 * (f->from_s + f->to_s) < 1.6);
    EXPECT_NEAR(finding_worst_s(&c, f), 0.5 * (from_s + to_s), 0.5 * (to_s - from_s) + 0.04);
    EXPECT_INT(judged_part(&c, PART_RIGHT_FOREARM), PART_RIGHT_FOREARM);
    c.mirrored = true;
    EXPECT_INT(judged_part(&c, PART_RIGHT_FOREARM), PART_LEFT_FOREARM);
    EXPECT_INT(judged_part(&c, part_by_name("body")), -1);
    c.mirrored = false;
    comparison_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_is_off_all_along_comes_second),
        cmocka_unit_test(test_worst_moment_of_a_posture),
        cmocka_unit_test(test_pauses_by_turns_are_none),
        cmocka_unit_test(test_a_short_pause_comes_last),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
