// Two movements compared, on a person made of exact joints: what is said about known differences, what must not matter,
// and the hard cases.
#include "compare/live_judge.h"
#include "tests/support/compared.h"

#include <stdio.h>

static double worst_posture(const struct comparison *c)
{
    double worst = 0;
    for (int k = 0; k < c->finding_count; k++)
        if (c->findings[k].kind == FINDING_POSTURE)
            worst = fmax(worst, fabs(c->findings[k].amount));
    return worst;
}

static void test_place_facing_size_and_rate_do_not_matter(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.size = 1.3;
    b.yaw_rad = 2.4;
    b.x_m = -1.2;
    b.z_m = 5;
    struct comparison c = compare(&a, &b);
    EXPECT_NEAR(c.score, 100, 0.01);
    EXPECT_INT(c.finding_count, 0);
    comparison_free(&c);
    // What B differs by is judged alike, wherever either stands.
    struct exercise wrong = a, wrong_elsewhere = b;
    wrong.right_elbow_rad = wrong_elsewhere.right_elbow_rad = 0.5;
    wrong.wrong_from_s = wrong_elsewhere.wrong_from_s = 0.5;
    wrong.wrong_to_s = wrong_elsewhere.wrong_to_s = 2;
    struct comparison here = compare(&a, &wrong), there = compare(&a, &wrong_elsewhere);
    EXPECT_AT_MOST(here.score, 99);
    EXPECT_NEAR(there.score, here.score, 0.5); // rounding decides between frames that are equally alike
    comparison_free(&here);
    comparison_free(&there);
    b.rate_hz = 50;
    c = compare(&a, &b);
    EXPECT_AT_LEAST(c.score, 99);
    comparison_free(&c);
}

static void test_a_bent_elbow_is_named_first(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.right_elbow_rad = 0.42; // 24 degrees
    b.wrong_from_s = 0.8;
    b.wrong_to_s = 2.4;
    struct comparison c = compare(&a, &b);
    if (c.finding_count != 1)
        print_findings(&c);
    EXPECT_AT_LEAST(c.finding_count, 1);
    EXPECT_INT(c.findings[0].kind, FINDING_POSTURE);
    EXPECT_INT(strcmp(c.findings[0].part, "right_forearm"), 0);
    EXPECT_NEAR(c.findings[0].amount, 24, 3);
    EXPECT_NEAR(c.findings[0].from_s, 0.8, 0.15);
    EXPECT_NEAR(c.findings[0].to_s, 2.4, 0.15);
    EXPECT_TRUE(strstr(c.findings[0].sentence, "Right elbow 2") && strstr(c.findings[0].sentence, "more bent"));
    comparison_free(&c);
}

// The arms, which the trunk carries, are not blamed; of the mirror image the side is its own.
static void test_a_turned_trunk_is_named_first(void **state)
{
    (void)state;
    struct exercise a = once();
    a.noise_m = 0.005;
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        struct exercise b = a;
        b.mirrored = mirrored;
        b.turn_rad = 0.44; // 25 degrees
        b.wrong_from_s = 0.6;
        b.wrong_to_s = 2.4;
        struct comparison c = compare(&a, &b);
        const struct finding *f = c.findings + (mirrored ? 1 : 0); // the mirror image itself is the first
        if (c.finding_count != 1 + mirrored)
            print_findings(&c);
        EXPECT_INT(c.finding_count, 1 + mirrored);
        EXPECT_INT(f->kind, FINDING_POSTURE);
        EXPECT_INT(strcmp(f->part, "upper_torso"), 0);
        EXPECT_NEAR(fabs(f->amount), 25, 3);
        EXPECT_TRUE(strstr(f->sentence, "Trunk turns 2") != NULL);
        EXPECT_TRUE(strstr(f->sentence, mirrored ? "further to the right" : "further to the left") != NULL);
        comparison_free(&c);
    }
}

// How often a larger error has a lower score, of all pairs: Spearman's rank correlation of error and score, negated.
static double rank_agreement(const double *score, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) {
        double rank = 0;
        for (int k = 0; k < count; k++)
            rank += score[k] > score[i] ? 1 : score[k] == score[i] ? 0.5 : 0;
        rank -= 0.5; // its own
        sum += (rank - i) * (rank - i);
    }
    return 1 - 6 * sum / ((double)count * (count * count - 1));
}

// The larger the error the lower the score, of each of five joints, with noise.
static void test_score_falls_with_the_error(void **state)
{
    (void)state;
    enum { JOINTS = 5, SIZES = 8, DRAWS = 4 }; // of the noise, for each size
    struct exercise a = once();
    a.noise_m = 0.008;
    for (int joint = 0; joint < JOINTS; joint++) {
        double score[SIZES];
        for (int k = 0; k < SIZES; k++) {
            struct exercise b = a;
            double *const wrong[JOINTS] = {&b.right_elbow_rad, &b.left_elbow_rad, &b.left_arm_rad, &b.right_knee_rad,
                                           &b.lean_rad};
            *wrong[joint] = (k + 1) * 0.0873; // 5 to 40 degrees
            b.wrong_from_s = 0.5;
            b.wrong_to_s = 2.5;
            score[k] = 0;
            for (int draw = 0; draw < DRAWS; draw++) {
                struct comparison c = compare(&a, &b);
                score[k] += c.score / DRAWS;
                comparison_free(&c);
            }
        }
        print_message("joint %d: score", joint);
        for (int k = 0; k < SIZES; k++)
            print_message(" %.1f", score[k]);
        print_message(" at 5, 10 .. 40 degrees\n");
        EXPECT_AT_LEAST(rank_agreement(score, SIZES), 0.95);
    }
}

static void test_tempo_is_no_posture(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.tempo = 0.7;
    b.seconds = 3 / 0.7;
    struct comparison c = compare(&a, &b);
    EXPECT_AT_MOST(worst_posture(&c), 10);
    const struct finding *f = find(&c, FINDING_TIMING);
    if (!f)
        print_findings(&c);
    EXPECT_TRUE(f && strstr(f->sentence, "times as long"));
    EXPECT_AT_LEAST(c.score, 90);
    comparison_free(&c);
}

static void test_pauses_of_either(void **state)
{
    (void)state;
    struct exercise a = once(), b = once();
    b.pause_at_s = 1;
    b.pause_s = 0.8;
    b.seconds = 3.8;
    struct comparison c = compare(&a, &b);
    const struct finding *f = find(&c, FINDING_TIMING);
    if (!f || !strstr(f->sentence, "paused"))
        print_findings(&c);
    EXPECT_TRUE(f && strstr(f->sentence, "paused"));
    EXPECT_AT_MOST(worst_posture(&c), 10);
    EXPECT_TRUE(!find(&c, FINDING_EXTRA) && !find(&c, FINDING_MISSING));
    comparison_free(&c);
    c = compare(&b, &a); // a reference with a pause
    EXPECT_AT_MOST(worst_posture(&c), 10);
    EXPECT_TRUE(!find(&c, FINDING_EXTRA) && !find(&c, FINDING_MISSING));
    EXPECT_AT_LEAST(c.score, 85);
    comparison_free(&c);
}

static void test_a_late_arm_is_no_posture(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.right_arm_late_s = 0.3;
    struct comparison c = compare(&a, &b);
    const struct finding *f = find(&c, FINDING_TIMING);
    if (!f || worst_posture(&c) > 10 || !strstr(f->sentence, "Right arm"))
        print_findings(&c);
    EXPECT_TRUE(f && strstr(f->sentence, "Right arm") && strstr(f->sentence, "late"));
    EXPECT_AT_MOST(worst_posture(&c), 10);
    comparison_free(&c);
}

static void test_mirrored_is_named(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.mirrored = true;
    struct comparison c = compare(&a, &b);
    EXPECT_TRUE(c.mirrored);
    EXPECT_AT_LEAST(c.finding_count, 1);
    EXPECT_INT(c.findings[0].kind, FINDING_MIRRORED);
    comparison_free(&c);
}

static void test_range(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.range = 0.6;
    struct comparison c = compare(&a, &b);
    const struct finding *f = find(&c, FINDING_RANGE);
    if (!f)
        print_findings(&c);
    EXPECT_TRUE(f && f->amount < 0);
    comparison_free(&c);
}

static void test_repetitions_are_counted_and_judged(void **state)
{
    (void)state;
    struct exercise a = exercise_default(), b = exercise_default();
    a.seconds = 15;
    b.seconds = 12;
    b.right_elbow_rad = 0.6;
    b.wrong_from_s = 6.5;
    b.wrong_to_s = 8.5;
    struct comparison c = compare(&a, &b);
    EXPECT_INT(c.repetitions.reference_count, 5);
    EXPECT_INT(c.repetitions.count, 4);
    EXPECT_TRUE(find(&c, FINDING_MISSING) != NULL);
    for (int k = 0; k < c.repetitions.count; k++)
        if (k != 2)
            EXPECT_AT_LEAST(c.repetitions.at[k].score, c.repetitions.at[2].score + 5);
    comparison_free(&c);
    // The reference done once, the attempt four times.
    a.seconds = 3;
    c = compare(&a, &b);
    EXPECT_INT(c.repetitions.reference_count, 1);
    EXPECT_INT(c.repetitions.count, 4);
    comparison_free(&c);
}

// A reference whose legs a tracker loses, otherwise each time, against the same exercise: the left forearm's weight
// over the left shin's.
static double lost_legs_ratio(double *score)
{
    struct exercise e = exercise_default();
    struct joint_samples s;
    e.seconds = 15;
    e.noise_m = 0.01;
    struct movement reference, attempt = make(&e);
    exercise_samples(&e, &rng, &s);
    struct vec3 away[4] = {0};
    for (int64_t i = 0; i < s.count; i++) {
        static const enum joint legs[4] = {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
        for (int k = 0; k < 4; k++) {
            if (i % 23 == 0)
                away[k] = rng_normal3(&rng, 0.3);
            s.at[i].skeleton.joint[legs[k]] = v3_add(s.at[i].skeleton.joint[legs[k]], away[k]);
        }
    }
    movement_of(&s, &reference);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&reference, &attempt, NULL, &c), OK);
    EXPECT_INT(c.repetitions.count, 5);
    const double ratio = c.terms.part[PART_LEFT_FOREARM].weight / c.terms.part[PART_LEFT_SHIN].weight;
    *score = c.score;
    comparison_free(&c);
    return ratio;
}

static int smaller_first(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Such legs have little say in what the exercise is: by the median of several draws, because five repetitions may be
// wrong alike by chance.
static void test_what_repetitions_do_not_share_does_not_count(void **state)
{
    (void)state;
    enum { DRAWS = 31, SEED = 11 };
    double ratio[DRAWS], score[DRAWS];
    rng = (struct rng){SEED}; // of its own, whatever the tests before it drew
    for (int k = 0; k < DRAWS; k++)
        ratio[k] = lost_legs_ratio(&score[k]);
    qsort(ratio, DRAWS, sizeof *ratio, smaller_first);
    qsort(score, DRAWS, sizeof *score, smaller_first);
    print_message("seed %d: ratio %.1f, from %.1f to %.1f; score %.0f, from %.0f to %.0f\n", SEED, ratio[DRAWS / 2],
                  ratio[0], ratio[DRAWS - 1], score[DRAWS / 2], score[0], score[DRAWS - 1]);
    EXPECT_AT_LEAST(ratio[DRAWS / 2], 4);
    EXPECT_AT_LEAST(ratio[0], 1);
    EXPECT_AT_LEAST(score[DRAWS / 2], 75);
    EXPECT_AT_LEAST(score[0], 60);
}

// ------------------------------------------------------------- hard cases

static void test_standing_still(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.still = true;
    struct comparison c = compare(&a, &b);
    EXPECT_INT(c.relation, RELATION_STILL);
    EXPECT_INT(c.finding_count, 0);
    EXPECT_TRUE(strstr(c.relation_sentence, "held still") != NULL);
    comparison_free(&c);
    c = compare(&b, &a);
    EXPECT_INT(c.relation, RELATION_MOVED);
    comparison_free(&c);
    c = compare(&b, &b); // both still: the same
    EXPECT_INT(c.relation, RELATION_SAME);
    EXPECT_NEAR(c.score, 100, 0.01);
    comparison_free(&c);
}

static void test_one_frame(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.seconds = 1 / b.rate_hz;
    struct comparison c = compare(&a, &b);
    EXPECT_INT(c.b.count, 1);
    EXPECT_AT_MOST(c.score, 60);
    comparison_free(&c);
    c = compare(&b, &a);
    comparison_free(&c);
}

static void test_an_hour(void **state)
{
    (void)state;
    struct exercise a = once(), b = once();
    b.seconds = 3600;
    b.rate_hz = 15;
    struct comparison c = compare(&a, &b);
    EXPECT_NEAR(c.repetitions.count, 1200, 2);
    comparison_free(&c);
}

static void test_unknown_joints(void **state)
{
    (void)state;
    const struct exercise e = once();
    struct joint_samples s;
    struct movement a = make(&e), b;
    exercise_samples(&e, &rng, &s);
    for (int64_t i = 0; i < s.count; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            s.at[i].skeleton.confidence[j] = 0;
    EXPECT_STATUS(movement_from_samples(&s, &b), ERR_INPUT);
    joint_samples_free(&s);
    // A limb that is never seen: unknown, and not counted as different.
    exercise_samples(&e, &rng, &s);
    for (int64_t i = 0; i < s.count; i++)
        s.at[i].skeleton.confidence[JOINT_RIGHT_HAND] = 0;
    movement_of(&s, &b);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&a, &b, NULL, &c), OK);
    EXPECT_NEAR(c.score, 100, 0.01);
    struct part_difference parts[PART_COUNT];
    part_differences(&c.a, &c.b, &c.timeline, 40, parts);
    EXPECT_INT(parts[PART_RIGHT_FOREARM].verdict, VERDICT_UNKNOWN);
    EXPECT_INT(parts[PART_LEFT_FOREARM].verdict, VERDICT_SAME);
    comparison_free(&c);
}

static void test_a_clock_that_jumps(void **state)
{
    (void)state;
    const struct exercise e = once();
    const int64_t jumps[] = {-1000000000000, 7200000000000};
    for (int k = 0; k < 2; k++) {
        struct joint_samples s, t = {0};
        struct movement a = make(&e), b;
        exercise_samples(&e, &rng, &s);
        for (int64_t i = 0; i < s.count; i++) {
            s.at[i].time_ns += i > 40 ? jumps[k] : 0;
            EXPECT_STATUS(joint_samples_add(&t, &s.at[i]), OK);
        }
        EXPECT_INT(t.jumps, 1);
        joint_samples_free(&s);
        movement_of(&t, &b);
        struct comparison c;
        EXPECT_STATUS(comparison_make(&a, &b, NULL, &c), OK);
        EXPECT_AT_LEAST(c.score, 99);
        comparison_free(&c);
    }
}

static void exchange(struct skeleton *s, enum joint l, enum joint r)
{
    const struct vec3 swap = s->joint[l];
    s->joint[l] = s->joint[r];
    s->joint[r] = swap;
}

static void test_left_and_right_confused_for_some_frames(void **state)
{
    (void)state;
    const struct exercise e = once();
    struct joint_samples s;
    struct movement a = make(&e), b;
    exercise_samples(&e, &rng, &s);
    for (int64_t i = 30; i < 45; i++) {
        struct skeleton *k = &s.at[i].skeleton;
        exchange(k, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER);
        exchange(k, JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW);
        exchange(k, JOINT_LEFT_HAND, JOINT_RIGHT_HAND);
        exchange(k, JOINT_LEFT_HIP, JOINT_RIGHT_HIP);
        exchange(k, JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE);
        exchange(k, JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT);
    }
    movement_of(&s, &b);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&a, &b, NULL, &c), OK);
    EXPECT_NEAR(c.score, 100, 0.01);
    comparison_free(&c);
}

static void test_walking_half_a_cycle_late(void **state)
{
    (void)state;
    struct exercise a = exercise_default();
    a.walking = true;
    a.seconds = 5;
    struct exercise b = a;
    b.begin_s = 0.5;
    struct comparison c = compare(&a, &b);
    if (c.score < 90)
        print_findings(&c);
    EXPECT_AT_LEAST(c.score, 90);
    EXPECT_TRUE(!find(&c, FINDING_MISSING));
    EXPECT_AT_MOST(worst_posture(&c), 10);
    comparison_free(&c);
}

static void test_noise_is_not_found(void **state)
{
    (void)state;
    struct exercise a = once();
    a.noise_m = 0.01;
    struct comparison c = compare(&a, &a);
    if (worst_posture(&c) > 0)
        print_findings(&c);
    EXPECT_AT_MOST(worst_posture(&c), 0);
    EXPECT_AT_LEAST(c.score, 90);
    comparison_free(&c);
}

// A person whose right arm a tracker has 0.25 m elsewhere from 1 s on, for `lost_s`.
static struct movement make_lost(const struct exercise *e, double lost_s)
{
    struct joint_samples s;
    struct movement m;
    exercise_samples(e, &rng, &s);
    for (int64_t i = 0; i < s.count; i++) {
        const double time_s = (double)(s.at[i].time_ns - s.at[0].time_ns) * 1e-9;
        if (time_s < 1 || time_s >= 1 + lost_s)
            continue;
        struct vec3 *joint = s.at[i].skeleton.joint;
        joint[JOINT_RIGHT_ELBOW] = v3_add(joint[JOINT_RIGHT_ELBOW], v3(0, 0, -0.25));
        joint[JOINT_RIGHT_HAND] = v3_add(joint[JOINT_RIGHT_HAND], v3(0, 0, -0.25));
    }
    movement_of(&s, &m);
    return m;
}

// A tracker's mistake is short; a posture is held. That the attempt pauses just where the reference is mistaken does
// not make more of it.
static void test_a_short_mistake_is_no_posture(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise pausing = a;
    pausing.pause_at_s = 1.15;
    pausing.pause_s = 0.8;
    pausing.seconds = 3.8;
    const struct exercise attempts[2] = {a, pausing};
    for (int k = 0; k < 2; k++) {
        struct movement lost = make_lost(&a, 0.25), sound = make(&attempts[k]);
        struct comparison c;
        EXPECT_STATUS(comparison_make(&lost, &sound, NULL, &c), OK);
        if (worst_posture(&c) > 0)
            print_findings(&c);
        EXPECT_AT_MOST(worst_posture(&c), 0);
        comparison_free(&c);
    }
    struct movement wrong = make_lost(&a, 1), sound = make(&a);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&sound, &wrong, NULL, &c), OK);
    EXPECT_AT_LEAST(worst_posture(&c), 20);
    comparison_free(&c);
}

// Who stands still goes through as much as a reference that stands still, too, but for a tracker's mistake.
static void test_a_short_mistake_is_no_range(void **state)
{
    (void)state;
    struct exercise e = once();
    e.still = true;
    struct movement lost = make_lost(&e, 0.25), sound = make(&e);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&lost, &sound, NULL, &c), OK);
    if (find(&c, FINDING_RANGE))
        print_findings(&c);
    EXPECT_AT_LEAST(c.range_a[ANGLE_RIGHT_SHOULDER].high - c.range_a[ANGLE_RIGHT_SHOULDER].low, 0.5);
    EXPECT_TRUE(!find(&c, FINDING_RANGE));
    comparison_free(&c);
}

// Frame by frame, without looking ahead: the time is found, and the bent elbow while it is bent.
static void test_live(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.right_elbow_rad = 0.5;
    b.wrong_from_s = 1;
    b.wrong_to_s = 2;
    struct movement ma = make(&a), mb = make(&b);
    struct live_judge *judge;
    EXPECT_STATUS(live_judge_open(&judge, &ma), OK);
    for (int32_t f = 0; f < mb.count; f++) {
        int32_t reference;
        struct part_difference parts[PART_COUNT];
        live_judge_frame(judge, &mb.frames[f], &reference, parts);
        if (f > 20 && f < 75)
            EXPECT_NEAR(reference, f, 5);
        if (f > 35 && f < 55)
            EXPECT_INT(parts[PART_RIGHT_FOREARM].verdict, VERDICT_DIFFERENT);
        if (f > 20 && f < 75)
            EXPECT_TRUE(parts[PART_LEFT_FOREARM].verdict != VERDICT_DIFFERENT);
    }
    live_judge_close(&judge);
    movement_free(&ma);
    movement_free(&mb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_place_facing_size_and_rate_do_not_matter),
        cmocka_unit_test(test_a_bent_elbow_is_named_first),
        cmocka_unit_test(test_a_turned_trunk_is_named_first),
        cmocka_unit_test(test_score_falls_with_the_error),
        cmocka_unit_test(test_tempo_is_no_posture),
        cmocka_unit_test(test_pauses_of_either),
        cmocka_unit_test(test_a_late_arm_is_no_posture),
        cmocka_unit_test(test_mirrored_is_named),
        cmocka_unit_test(test_range),
        cmocka_unit_test(test_repetitions_are_counted_and_judged),
        cmocka_unit_test(test_what_repetitions_do_not_share_does_not_count),
        cmocka_unit_test(test_standing_still),
        cmocka_unit_test(test_one_frame),
        cmocka_unit_test(test_an_hour),
        cmocka_unit_test(test_unknown_joints),
        cmocka_unit_test(test_a_clock_that_jumps),
        cmocka_unit_test(test_left_and_right_confused_for_some_frames),
        cmocka_unit_test(test_walking_half_a_cycle_late),
        cmocka_unit_test(test_noise_is_not_found),
        cmocka_unit_test(test_a_short_mistake_is_no_posture),
        cmocka_unit_test(test_a_short_mistake_is_no_range),
        cmocka_unit_test(test_live),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
