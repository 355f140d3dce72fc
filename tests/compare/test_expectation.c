// What the teacher says counts: words for parts, tolerances and stretches, and what they do to score and findings.
#include "compare/live_judge.h"
#include "compare/reference_spread.h"
#include "compare/report.h"
#include "tests/support/compared.h"

#include <string.h>

static const double DEGREE = 3.14159265358979323846 / 180;

static uint16_t bits(int first, int second) { return (uint16_t)(1u << first | 1u << second); }

// ---------------------------------------------------------------- words

static void test_parts_are_named_as_people_do(void **state)
{
    (void)state;
    static const struct {
        const char *word;
        int first, second;
    } cases[] = {
        {"head", PART_HEAD, PART_HEAD},
        {"HEAD", PART_HEAD, PART_HEAD},
        {"trunk", PART_UPPER_TORSO, PART_LOWER_TORSO},
        {"upper_torso", PART_UPPER_TORSO, PART_UPPER_TORSO},
        {"left knee", PART_LEFT_SHIN, PART_LEFT_SHIN},
        {"left_knee", PART_LEFT_SHIN, PART_LEFT_SHIN},
        {"Left-Knee", PART_LEFT_SHIN, PART_LEFT_SHIN},
        {"left shins", PART_LEFT_SHIN, PART_LEFT_SHIN},
        {"knees", PART_LEFT_SHIN, PART_RIGHT_SHIN},
        {"knee", PART_LEFT_SHIN, PART_RIGHT_SHIN},
        {"both knees", PART_LEFT_SHIN, PART_RIGHT_SHIN},
        {"right hip", PART_RIGHT_THIGH, PART_RIGHT_THIGH},
        {"elbows", PART_LEFT_FOREARM, PART_RIGHT_FOREARM},
        {"right shoulder", PART_RIGHT_UPPER_ARM, PART_RIGHT_UPPER_ARM},
        {"right_upper_arm", PART_RIGHT_UPPER_ARM, PART_RIGHT_UPPER_ARM},
        {"left arm", PART_LEFT_UPPER_ARM, PART_LEFT_FOREARM},
        {" right  leg ", PART_RIGHT_THIGH, PART_RIGHT_SHIN},
    };
    uint16_t parts;
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        EXPECT_STATUS(expectation_parts_named(cases[i].word, &parts), OK);
        if (parts != bits(cases[i].first, cases[i].second))
            print_message("'%s'\n", cases[i].word);
        EXPECT_INT(parts, bits(cases[i].first, cases[i].second));
    }
    for (int p = 0; p < PART_COUNT; p++) {
        EXPECT_STATUS(expectation_parts_named(part_name((enum part)p), &parts), OK);
        EXPECT_INT(parts, 1 << p);
    }
    EXPECT_STATUS(expectation_parts_named("all", &parts), OK);
    EXPECT_INT(parts, (1 << PART_COUNT) - 1);
    static const char *const wrong[] = {"",
                                        "nose",
                                        "left",
                                        "left head",
                                        "kne",
                                        "left left knee",
                                        "a name that is longer than any part of any body ever was"};
    for (size_t i = 0; i < COUNT_OF(wrong); i++) {
        EXPECT_STATUS(expectation_parts_named(wrong[i], &parts), ERR_INPUT);
        EXPECT_TRUE(strstr(status_message(), "knees"));
    }
}

static void test_what_cannot_be_is_refused(void **state)
{
    (void)state;
    struct expectation e = {.ignored = 0};
    static const char *const wrong[] = {"knees=0", "knees=-5", "knees=400", "knees=91",  "knees=", "=20",
                                        "knees",   "20",       "knees=nan", "knees=20x", "nose=20"};
    for (size_t i = 0; i < COUNT_OF(wrong); i++) {
        EXPECT_STATUS(expectation_set_tolerance(&e, wrong[i]), ERR_INPUT);
        EXPECT_TRUE(expectation_is_empty(&e));
    }
    EXPECT_STATUS(expectation_ignore(&e, "all"), ERR_INPUT);
    EXPECT_TRUE(expectation_is_empty(&e));
    static const double stretches[][2] = {{3, 2}, {2, 2}, {7, -1}, {1, 7}, {1, 1.2}, {NAN, 3}};
    for (size_t i = 0; i < COUNT_OF(stretches); i++) {
        EXPECT_STATUS(expectation_set_stretch(&e, stretches[i][0], stretches[i][1], 6), ERR_INPUT);
        EXPECT_TRUE(expectation_is_empty(&e));
    }
    static const char *const most[] = {"arms", "legs", "trunk"};
    for (size_t i = 0; i < COUNT_OF(most); i++)
        EXPECT_STATUS(expectation_ignore(&e, most[i]), OK);
    EXPECT_STATUS(expectation_ignore(&e, "head"), ERR_INPUT);
    EXPECT_TRUE(!(e.ignored >> PART_HEAD & 1));
}

static void expect_text(const struct expectation *e, const char *text)
{
    char said[EXPECTATION_TEXT_BYTES];
    if (strcmp(expectation_text(e, said), text) != 0)
        print_message("'%s', wanted '%s'\n", said, text);
    EXPECT_TRUE(!strcmp(said, text));
}

static void test_it_is_said_in_a_line(void **state)
{
    (void)state;
    struct expectation e = {.ignored = 0};
    expect_text(&e, "");
    expect_text(NULL, "");
    EXPECT_STATUS(expectation_ignore(&e, "head"), OK);
    expect_text(&e, "the head does not matter");
    EXPECT_STATUS(expectation_set_tolerance(&e, "knees=20"), OK);
    EXPECT_STATUS(expectation_set_tolerance(&e, "left shoulder=7.5"), OK);
    EXPECT_STATUS(expectation_set_stretch(&e, 1, 4.5, 6), OK);
    expect_text(&e,
                "the head does not matter; the left shoulder within 7.5°, the knees within 20°; only 1.0 s to 4.5 s");
    EXPECT_STATUS(expectation_ignore(&e, "left arm"), OK);
    EXPECT_STATUS(expectation_ignore(&e, "trunk"), OK);
    e.to_s = 0;
    expect_text(&e, "the head, the trunk, the left arm do not matter; the knees within 20°");
    EXPECT_STATUS(expectation_set_tolerance(&e, "all=15"), OK);
    expect_text(&e, "the head, the trunk, the left arm do not matter; the rest within 15°");
    e.ignored = 0;
    e.spread_references = 2;
    expect_text(&e, "everything within 15°; what 2 further references differ by is right");
    const struct expectation mirror = expectation_mirror(&(struct expectation){.ignored = 1 << PART_LEFT_SHIN});
    EXPECT_INT(mirror.ignored, 1 << PART_RIGHT_SHIN);
}

static void test_a_take_keeps_it_in_its_own_clock(void **state)
{
    (void)state;
    const int64_t first_ns = 1700000000000000000;
    struct expectation e = {.ignored = 1, .from_s = 1, .to_s = 4.5}, back;
    struct take_expectation kept = {.reference_count = 1, .reference = {2}};
    e.tolerance_rad[PART_LEFT_SHIN] = 0.3;
    expectation_to_take(&e, first_ns, 6, &kept);
    EXPECT_INT(kept.reference_count, 1);
    EXPECT_TRUE(expectation_from_take(&kept, first_ns, 6, &back));
    EXPECT_NEAR(back.from_s, 1, 1e-6);
    EXPECT_NEAR(back.to_s, 4.5, 1e-6);
    EXPECT_NEAR(back.tolerance_rad[PART_LEFT_SHIN], 0.3, 0);
    // Two seconds of its beginning are trimmed, and half of the rest.
    EXPECT_TRUE(expectation_from_take(&kept, first_ns + 2000000000, 2, &back));
    EXPECT_NEAR(back.from_s, 0, 1e-6);
    EXPECT_NEAR(back.to_s, 2, 1e-6);
    EXPECT_TRUE(!expectation_from_take(&kept, first_ns + 5000000000, 1, &back));
    EXPECT_NEAR(back.to_s, 0, 0);
    EXPECT_INT(back.ignored, 1);
    e.from_s = 0;
    e.to_s = 6;
    expectation_to_take(&e, first_ns, 6, &kept); // all of it
    EXPECT_TRUE(kept.from_ns == kept.to_ns);
}

// ---------------------------------------------------------------- comparisons

static struct comparison compare_expecting(const struct exercise *a, const struct exercise *b,
                                           const struct expectation *e)
{
    struct movement ma = make(a), mb = make(b);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&ma, &mb, e, &c), OK);
    print_findings(&c);
    return c;
}

static bool finds_part(const struct comparison *c, int part)
{
    for (int k = 0; k < c->finding_count; k++)
        if (c->findings[k].parts >> part & 1)
            return true;
    return false;
}

// Nothing expected is what there was before, to the bit.
static void test_nothing_expected_changes_nothing(void **state)
{
    (void)state;
    struct exercise a = once(), b = a;
    b.right_elbow_rad = 0.6;
    b.wrong_to_s = 3;
    const struct expectation none = {.ignored = 0};
    struct comparison plain = compare_expecting(&a, &b, NULL), empty = compare_expecting(&a, &b, &none);
    char *said = report_json(&(struct report_attempt){.c = &plain, .name = "plain"}),
         *again = report_json(&(struct report_attempt){.c = &empty, .name = "empty"});
    EXPECT_TRUE(said && again && !strcmp(said, again));
    EXPECT_TRUE(!strstr(said, "expected"));
    free(said);
    free(again);
    comparison_free(&plain);
    comparison_free(&empty);
}

static void test_a_part_that_does_not_matter(void **state)
{
    (void)state;
    struct exercise a = once(), b = a;
    b.right_elbow_rad = 0.8;
    b.wrong_to_s = 3;
    struct expectation e = {.ignored = 0};
    struct comparison before = compare_expecting(&a, &b, NULL);
    EXPECT_STATUS(expectation_ignore(&e, "right elbow"), OK);
    struct comparison after = compare_expecting(&a, &b, &e);
    EXPECT_TRUE(finds_part(&before, PART_RIGHT_FOREARM));
    EXPECT_INT(after.finding_count, 0);
    EXPECT_AT_LEAST(after.score, 99);
    EXPECT_AT_MOST(before.score, 97);
    EXPECT_NEAR(after.terms.part[PART_RIGHT_FOREARM].weight, 0, 0);
    char not_judged[NOT_JUDGED_BYTES];
    EXPECT_TRUE(!*not_judged_text(&after, not_judged));
    struct part_difference parts[PART_COUNT];
    comparison_differences(&after, &after.b, 45, parts);
    EXPECT_INT(parts[PART_RIGHT_FOREARM].verdict, VERDICT_UNKNOWN);
    EXPECT_INT(parts[PART_RIGHT_UPPER_ARM].verdict, VERDICT_SAME);
    char *json = report_json(&(struct report_attempt){.c = &after}), *text = report_text(&after, false),
         *html = report_html(&(struct report_attempt){.c = &after, .name = "b"}, 1, "a");
    EXPECT_TRUE(strstr(json, "\"expected\": {\"sentence\": \"the right elbow does not matter\", \"ignored\": "
                             "[\"right_forearm\"]"));
    EXPECT_TRUE(strstr(text, "expected: the right elbow does not matter\n"));
    EXPECT_TRUE(strstr(html, "Expected here: the right elbow does not matter.") && strstr(html, ">does not matter<"));
    free(json);
    free(text);
    free(html);
    comparison_free(&before);
    comparison_free(&after);
}

static void test_a_tolerance_in_both_directions(void **state)
{
    (void)state;
    struct exercise a = once(), b = a;
    b.right_knee_rad = 15 * DEGREE;
    b.wrong_to_s = 3;
    double score[3];
    bool found[3];
    static const char *const given[3] = {"knees=5", NULL, "right knee=30"};
    for (int k = 0; k < 3; k++) {
        struct expectation e = {.ignored = 0};
        if (given[k])
            EXPECT_STATUS(expectation_set_tolerance(&e, given[k]), OK);
        struct comparison c = compare_expecting(&a, &b, &e);
        score[k] = c.score;
        found[k] = finds_part(&c, PART_RIGHT_SHIN);
        comparison_free(&c);
    }
    EXPECT_TRUE(score[0] < score[1] && score[1] < score[2]);
    EXPECT_TRUE(found[0] && found[1] && !found[2]);
    // This is nobody's business, unless somebody asks for it.
    b.right_knee_rad = 12 * DEGREE;
    for (int k = 0; k < 2; k++) {
        struct expectation e = {.ignored = 0};
        if (!k)
            EXPECT_STATUS(expectation_set_tolerance(&e, "knees=4"), OK);
        struct comparison c = compare_expecting(&a, &b, &e);
        EXPECT_TRUE(finds_part(&c, PART_RIGHT_SHIN) == !k);
        comparison_free(&c);
    }
}

// What is wrong outside of the stretch is not said, whether the attempt holds the whole movement or the stretch alone.
static void test_a_stretch_that_counts(void **state)
{
    (void)state;
    struct exercise a = once(), b = a;
    b.left_arm_rad = 0.6;
    b.wrong_from_s = 0.2;
    b.wrong_to_s = 1.2;
    struct expectation e = {.from_s = 1.5, .to_s = 2.6}, early = {.from_s = 0.2, .to_s = 1.2};
    struct comparison whole = compare_expecting(&a, &b, NULL), late = compare_expecting(&a, &b, &e),
                      hit = compare_expecting(&a, &b, &early);
    EXPECT_TRUE(whole.finding_count > 0);
    EXPECT_INT(late.finding_count, 0);
    EXPECT_AT_LEAST(late.score, 98);
    EXPECT_TRUE(finds_part(&hit, PART_LEFT_UPPER_ARM));
    EXPECT_TRUE(hit.score < whole.score);
    int32_t aligned = 0;
    for (int32_t f = 0; f < late.timeline.count; f++) {
        const float reference = late.timeline.reference[f];
        aligned += !isnan(reference);
        EXPECT_TRUE(isnan(reference) ||
                    (reference >= 1.5 * MOVEMENT_RATE_HZ - 1 && reference <= 2.6 * MOVEMENT_RATE_HZ));
        EXPECT_TRUE(isnan(reference) || fabs((double)reference - f) < 6); // the reference's own clock
    }
    EXPECT_INT(late.timeline.count, late.b.count);
    EXPECT_AT_LEAST(aligned, 28);
    comparison_free(&whole);
    comparison_free(&late);
    comparison_free(&hit);
    b = a;
    b.begin_s = 1.5;
    b.seconds = 1.1;
    struct comparison alone = compare_expecting(&a, &b, &e);
    EXPECT_INT(alone.relation, RELATION_SAME);
    EXPECT_AT_LEAST(alone.score, 95);
    comparison_free(&alone);
    struct movement ma = make(&a), mb = make(&b);
    struct comparison c;
    e = (struct expectation){.from_s = 8, .to_s = 9};
    EXPECT_STATUS(comparison_make(&ma, &mb, &e, &c), ERR_INPUT);
}

// A stretch of one of several repetitions, against as many.
static void test_a_stretch_among_repetitions(void **state)
{
    (void)state;
    struct exercise a = exercise_default(), b = a;
    a.seconds = b.seconds = 9;
    b.right_elbow_rad = 0.8;
    b.wrong_from_s = 3.5;
    b.wrong_to_s = 5.5;
    const struct expectation second = {.from_s = 3, .to_s = 6}, third = {.from_s = 6, .to_s = 9};
    struct comparison hit = compare_expecting(&a, &b, &second), sound = compare_expecting(&a, &b, &third);
    EXPECT_INT(hit.relation, RELATION_SAME);
    EXPECT_TRUE(finds_part(&hit, PART_RIGHT_FOREARM));
    EXPECT_INT(sound.finding_count, 0);
    for (int k = 0; k < hit.finding_count; k++)
        EXPECT_TRUE(hit.findings[k].from_s >= 2.5 && hit.findings[k].to_s <= 6.5);
    comparison_free(&hit);
    comparison_free(&sound);
}

// Of an attempt that holds more repetitions than the reference each shows the stretch, also where it holds nothing
// else.
static void test_a_stretch_done_several_times(void **state)
{
    (void)state;
    struct exercise a = once(), b = exercise_default();
    b.seconds = 9;
    b.right_elbow_rad = 0.8; // in the second, in what counts; and in the third, beside it
    b.wrong_from_s = 4.4;
    b.wrong_to_s = 6.9;
    const struct expectation e = {.from_s = 1.2, .to_s = 2.8};
    struct comparison c = compare_expecting(&a, &b, &e);
    EXPECT_INT(c.relation, RELATION_SAME);
    EXPECT_INT(c.repetitions.count, 3);
    for (int32_t k = 0; k < c.repetitions.count; k++) {
        const struct performance *p = &c.repetitions.at[k];
        print_message("%d: %.2f to %.2f s, %.1f\n", k, p->attempt.first / MOVEMENT_RATE_HZ,
                      p->attempt.end / MOVEMENT_RATE_HZ, p->score);
        EXPECT_NEAR(p->reference.first, 1.2 * MOVEMENT_RATE_HZ, 1);
        EXPECT_NEAR(p->reference.end, 2.8 * MOVEMENT_RATE_HZ, 1);
        EXPECT_NEAR(p->attempt.first / MOVEMENT_RATE_HZ, 3 * k + 1.2, 0.3);
        EXPECT_NEAR(p->attempt.end / MOVEMENT_RATE_HZ, 3 * k + 2.8, 0.3);
    }
    EXPECT_TRUE(c.repetitions.at[1].score < 90);
    EXPECT_AT_LEAST(c.repetitions.at[0].score, 97);
    EXPECT_AT_LEAST(c.repetitions.at[2].score, 97);
    EXPECT_TRUE(finds_part(&c, PART_RIGHT_FOREARM));
    for (int k = 0; k < c.finding_count; k++)
        EXPECT_TRUE(c.findings[k].kind == FINDING_POSTURE && c.findings[k].from_s > 3.8 && c.findings[k].to_s < 6.3);
    EXPECT_TRUE(c.pace.missing == 0 && c.pace.extra == 0);
    comparison_free(&c);

    b = exercise_default(); // the stretch itself is done three times
    a = exercise_default();
    a.seconds = 6;
    b.seconds = 9;
    const struct expectation first = {.from_s = 0, .to_s = 3};
    c = compare_expecting(&a, &b, &first);
    EXPECT_INT(c.relation, RELATION_SAME);
    EXPECT_INT(c.repetitions.count, 3);
    EXPECT_INT(c.repetitions.reference_count, 1);
    EXPECT_AT_LEAST(c.score, 97);
    EXPECT_INT(c.finding_count, 0);
    comparison_free(&c);
}

static void test_several_references_say_what_is_right(void **state)
{
    (void)state;
    struct exercise a = once(), other = a, b = a;
    other.right_knee_rad = 35 * DEGREE;
    other.wrong_to_s = 3;
    b.right_knee_rad = 13 * DEGREE;
    b.wrong_to_s = 3;
    struct reference_spread spread = {.references = 0};
    struct expectation e = {.ignored = 0};
    const struct movement first = make(&a);
    for (int k = 0; k < 3; k++) {
        struct movement further = make(&other);
        EXPECT_STATUS(reference_spread_add(&spread, &first, &further, NULL, "other"), OK);
    }
    reference_spread_put(&spread, &e);
    const double knee = e.spread[PART_RIGHT_SHIN][DEVIATION_OFFSET],
                 left_knee = e.spread[PART_LEFT_SHIN][DEVIATION_OFFSET],
                 elbow = e.spread[PART_RIGHT_FOREARM][DEVIATION_OFFSET];
    print_message("knees %.2f and %.2f, elbow %.2f natural spreads\n", knee, left_knee, elbow);
    EXPECT_INT(e.spread_references, 3);
    EXPECT_AT_LEAST(knee, 1.2);
    EXPECT_AT_MOST(elbow, 1); // they agree there: it is stricter than the natural one
    EXPECT_AT_LEAST(elbow, sqrt(2.0 / 5) - 1e-9);
    struct comparison plain = compare_expecting(&a, &b, NULL), by = compare_expecting(&a, &b, &e);
    EXPECT_TRUE(by.terms.part[PART_RIGHT_SHIN].z[DEVIATION_OFFSET] <
                plain.terms.part[PART_RIGHT_SHIN].z[DEVIATION_OFFSET]);
    e.tolerance_rad[PART_RIGHT_FOREARM] = 20 * DEGREE; // what is given precedes what is measured
    EXPECT_NEAR(tolerances_of(&e).threshold[PART_RIGHT_FOREARM], 2, 1e-9);
    comparison_free(&plain);
    comparison_free(&by);
    struct exercise walk = a;
    walk.walking = true;
    walk.seconds = 5;
    struct movement wrong = make(&walk), reference = first;
    EXPECT_STATUS(reference_spread_add(&spread, &first, &wrong, NULL, "walk"), ERR_INPUT);
    EXPECT_TRUE(strstr(status_message(), "walk"));
    EXPECT_INT(spread.references, 3);
    movement_free(&reference);
}

// Live: what does not matter is not judged, nor what is outside of the stretch.
static void test_live_by_what_is_expected(void **state)
{
    (void)state;
    struct exercise a = once(), b = a;
    b.right_elbow_rad = 0.6;
    b.wrong_to_s = 3;
    struct movement ma = make(&a), mb = make(&b);
    static const char *const given[] = {NULL, "=60", "ignore"};
    int different[3] = {0}, judged[3] = {0};
    for (int k = 0; k < 3; k++) {
        struct live_judge *judge;
        struct expectation e = {.from_s = 1, .to_s = 2};
        if (k == 1)
            EXPECT_STATUS(expectation_set_tolerance(&e, "right elbow=60"), OK);
        if (k == 2)
            EXPECT_STATUS(expectation_ignore(&e, "right elbow"), OK);
        EXPECT_STATUS(live_judge_open(&judge, &ma), OK);
        live_judge_set_expectation(judge, given[k] ? &e : NULL);
        for (int32_t f = 0; f < mb.count; f++) {
            struct part_difference parts[PART_COUNT];
            int32_t at;
            live_judge_frame(judge, &mb.frames[f], &at, parts);
            different[k] += parts[PART_RIGHT_FOREARM].verdict == VERDICT_DIFFERENT;
            judged[k] += !isnan(parts[PART_LEFT_FOREARM].angle_rad);
        }
        live_judge_close(&judge);
    }
    print_message("different in %d, %d, %d frames\n", different[0], different[1], different[2]);
    EXPECT_AT_LEAST(different[0], 60);
    EXPECT_INT(different[1], 0);
    EXPECT_INT(different[2], 0);
    EXPECT_AT_LEAST(judged[0], 80);
    EXPECT_TRUE(judged[1] >= 20 && judged[1] <= 40);
    movement_free(&ma);
    movement_free(&mb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_parts_are_named_as_people_do),
        cmocka_unit_test(test_what_cannot_be_is_refused),
        cmocka_unit_test(test_it_is_said_in_a_line),
        cmocka_unit_test(test_a_take_keeps_it_in_its_own_clock),
        cmocka_unit_test(test_nothing_expected_changes_nothing),
        cmocka_unit_test(test_a_part_that_does_not_matter),
        cmocka_unit_test(test_a_tolerance_in_both_directions),
        cmocka_unit_test(test_a_stretch_that_counts),
        cmocka_unit_test(test_a_stretch_among_repetitions),
        cmocka_unit_test(test_a_stretch_done_several_times),
        cmocka_unit_test(test_several_references_say_what_is_right),
        cmocka_unit_test(test_live_by_what_is_expected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
