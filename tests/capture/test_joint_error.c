// How wrong a joint is thought to be: no feature makes it surer, what is bad is not called seen, and covariances stay
// positive definite.
#include "tests/support/test.h"

#include "capture/tracking/joint_error.h"
#include "tests/support/random.h"

#include <stdio.h>

enum { SEED = 20261125, SAMPLES = 200 };

// Where features of good frames lie, and beyond what they reach.
static const double MOST = 3;

static struct joint_features random_features(struct rng *rng)
{
    struct joint_features f;
    for (int i = 0; i < FEATURE_COUNT; i++)
        f.value[i] = rng_uniform(rng) < 0.5 ? 0 : MOST * rng_uniform(rng);
    return f;
}

static struct smoothed_features random_smoothed(struct rng *rng)
{
    struct smoothed_features f;
    for (int i = 0; i < SMOOTHED_COUNT; i++)
        f.value[i] = rng_uniform(rng) < 0.5 ? 0 : MOST * rng_uniform(rng);
    return f;
}

static void expect_no_surer(const struct joint_error *than, const struct joint_error *e)
{
    EXPECT_TRUE(isfinite(e->log_scale) && isfinite(e->wrong_log_odds));
    EXPECT_AT_LEAST((double)e->log_scale, (double)than->log_scale);
    EXPECT_AT_LEAST((double)e->log_widening, (double)than->log_widening);
    EXPECT_AT_LEAST((double)e->wrong_log_odds, (double)than->wrong_log_odds);
    EXPECT_TRUE(than->is_seen || !e->is_seen);
}

static void test_no_feature_makes_a_joint_surer(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    for (int n = 0; n < SAMPLES; n++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct joint_features f = random_features(&rng);
            const struct joint_error e = joint_error_online((enum joint)j, true, &f);
            for (int i = 0; i < FEATURE_COUNT; i++) {
                struct joint_features worse = f;
                worse.value[i] += rng_uniform(&rng);
                const struct joint_error then = joint_error_online((enum joint)j, true, &worse);
                expect_no_surer(&e, &then);
            }
            const struct smoothed_features s = random_smoothed(&rng);
            const struct joint_error both = joint_error_smoothed((enum joint)j, true, &s);
            for (int i = 0; i < SMOOTHED_COUNT; i++) {
                struct smoothed_features worse = s;
                worse.value[i] += rng_uniform(&rng);
                const struct joint_error then = joint_error_smoothed((enum joint)j, true, &worse);
                expect_no_surer(&both, &then);
            }
        }
}

// A frame with nothing against it shows its joints; one with everything does not, nor what is not shown.
static void test_good_frames_are_seen(void **state)
{
    (void)state;
    const struct joint_features good = {{0}};
    const struct smoothed_features agreed = {{0}};
    struct joint_features bad;
    struct smoothed_features apart;
    for (int i = 0; i < FEATURE_COUNT; i++)
        bad.value[i] = MOST;
    for (int i = 0; i < SMOOTHED_COUNT; i++)
        apart.value[i] = 4 * MOST;
    for (int j = 0; j < JOINT_COUNT; j++) {
        EXPECT_TRUE(joint_error_online((enum joint)j, true, &good).is_seen);
        EXPECT_TRUE(joint_error_smoothed((enum joint)j, true, &agreed).is_seen);
        EXPECT_TRUE(!joint_error_online((enum joint)j, false, &good).is_seen);
        EXPECT_TRUE(!joint_error_smoothed((enum joint)j, false, &agreed).is_seen);
        EXPECT_TRUE(!joint_error_online((enum joint)j, true, &bad).is_seen);
        EXPECT_TRUE(!joint_error_smoothed((enum joint)j, true, &apart).is_seen);
    }
}

// Two explanations that are as good as each other, and passes that disagree, are held against a limb.
static void test_ambiguity_counts(void **state)
{
    (void)state;
    static const enum joint limbs[] = {JOINT_LEFT_ELBOW, JOINT_RIGHT_HAND, JOINT_LEFT_KNEE, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(limbs); i++) {
        struct joint_features f = {{0}};
        const float alone = joint_error_online(limbs[i], true, &f).wrong_log_odds;
        f.value[FEATURE_ELSEWHERE] = f.value[FEATURE_FLIP] = 1;
        const float ambiguous = joint_error_online(limbs[i], true, &f).wrong_log_odds;
        struct smoothed_features s = {.value = {[SMOOTHED_ODDS] = 6}};
        const float agreed = joint_error_smoothed(limbs[i], true, &s).wrong_log_odds;
        s.value[SMOOTHED_APART] = s.value[SMOOTHED_BODY_APART] = 2;
        const float apart = joint_error_smoothed(limbs[i], true, &s).wrong_log_odds;
        print_message("%s: log-odds of being wrong %.2f, with an equal alternative %.2f; smoothed %.2f, apart %.2f\n",
                      joint_name(limbs[i]), (double)alone, (double)ambiguous, (double)agreed, (double)apart);
        EXPECT_AT_LEAST((double)ambiguous, (double)alone + 0.1);
        EXPECT_AT_LEAST((double)apart, (double)agreed + 0.1);
    }
}

int main(void)
{
    printf("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_feature_makes_a_joint_surer),
        cmocka_unit_test(test_good_frames_are_seen),
        cmocka_unit_test(test_ambiguity_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
