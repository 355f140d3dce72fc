// What is found, and in which order, where a tracker does not know how well it knows the joints; on a person of exact
// joints.
#include "compare/comparison.h"
#include "compare/findings.h"
#include "tests/support/exercise.h"
#include "tests/support/test.h"

#include <stdlib.h>

enum { HIDDEN_MM = 180 }; // the standard deviation of a joint that is inferred

static struct exercise once(void)
{
    struct exercise e = exercise_default();
    e.seconds = 3;
    return e;
}

static struct movement make(struct joint_samples *s, int sigma_mm)
{
    struct movement m;
    for (int64_t i = 0; i < s->count && sigma_mm; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            s->at[i].sigma_m[j] = (float)sigma_mm * 1e-3f;
    EXPECT_STATUS(movement_from_samples(s, &m), OK);
    joint_samples_free(s);
    return m;
}

// sigma_mm 0: as it is.
static struct comparison compare(struct joint_samples *a, struct joint_samples *b, int sigma_mm)
{
    struct movement ma = make(a, sigma_mm), mb = make(b, sigma_mm);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&ma, &mb, &c), OK);
    for (int k = 0; k < c.finding_count; k++)
        print_message("%s %s: %s\n", finding_kind_name(c.findings[k].kind), c.findings[k].part, c.findings[k].sentence);
    return c;
}

static struct comparison with_elbow(double from_s, double to_s, int sigma_mm)
{
    const struct exercise a = once();
    struct exercise b = a;
    struct rng rng = {7};
    struct joint_samples sa, sb;
    b.right_elbow_rad = 0.42; // 24 degrees
    b.wrong_from_s = from_s;
    b.wrong_to_s = to_s;
    exercise_samples(&a, &rng, &sa);
    exercise_samples(&b, &rng, &sb);
    return compare(&sa, &sb, sigma_mm);
}

// A covariance that holds gross mistakes hides no posture where the rest of the time shows that there are none.
static void test_a_quiet_joint_is_trusted(void **state)
{
    (void)state;
    struct comparison c = with_elbow(0.8, 2.2, HIDDEN_MM);
    EXPECT_AT_LEAST(c.finding_count, 1);
    EXPECT_INT(strcmp(c.findings[0].part, "right_forearm"), 0);
    EXPECT_NEAR(c.findings[0].amount, 24, 3);
    comparison_free(&c);
}

// One that is off all along may as well be a mistake: then the covariance decides.
static void test_one_that_is_never_quiet_is_not(void **state)
{
    (void)state;
    struct comparison unsure = with_elbow(0, 100, HIDDEN_MM), sure = with_elbow(0, 100, 0);
    EXPECT_INT(unsure.finding_count, 0);
    EXPECT_AT_LEAST(sure.finding_count, 1);
    comparison_free(&unsure);
    comparison_free(&sure);
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
    knee.right_knee_rad = 0.49; // 28 degrees
    knee.wrong_to_s = 100;
    exercise_samples(&a, &rng, &sa);
    exercise_samples(&elbow, &rng, &sb);
    exercise_samples(&knee, &rng, &legs);
    for (int64_t i = 0; i < sb.count; i++)
        sb.at[i].skeleton.joint[JOINT_RIGHT_FOOT] = legs.at[i].skeleton.joint[JOINT_RIGHT_FOOT];
    joint_samples_free(&legs);
    struct comparison c = compare(&sa, &sb, 0);
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
    struct comparison c = compare(&sa, &sb, 0);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_quiet_joint_is_trusted),
        cmocka_unit_test(test_one_that_is_never_quiet_is_not),
        cmocka_unit_test(test_what_is_off_all_along_comes_second),
        cmocka_unit_test(test_pauses_by_turns_are_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
