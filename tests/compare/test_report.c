// Reports of a comparison: JSON, CSV, text and the page, and the moments that the page shows.
#include "compare/good_parts.h"
#include "compare/report.h"
#include "tests/support/compared.h"

#include <stdio.h>
#include <string.h>

// Of a mirrored attempt a moment is shown where its own part differs most from the reference's other one.
static void test_mirrored_moments(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.mirrored = true;
    b.right_elbow_rad = 0.4;
    b.wrong_from_s = 0;
    b.wrong_to_s = 1.4;
    struct comparison c = compare(&a, &b);
    struct report_moment moments[REPORT_MOMENTS];
    const int count = report_moments(&c, moments);
    const struct report_moment *m = NULL;
    for (int k = 0; k < count; k++)
        if (!m && moments[k].part == PART_LEFT_FOREARM)
            m = &moments[k];
    if (!m)
        print_findings(&c);
    EXPECT_TRUE(c.mirrored);
    EXPECT_TRUE(m != NULL);
    const struct finding *f = &c.findings[m->finding];
    const int32_t shown = (int32_t)(m->attempt_s * MOVEMENT_RATE_HZ + 0.5),
                  first = (int32_t)(f->from_s * MOVEMENT_RATE_HZ + 0.5), end = (int32_t)(f->to_s * MOVEMENT_RATE_HZ);
    float most = 0, there = 0;
    for (int32_t k = first; k < end; k++) {
        struct part_difference parts[PART_COUNT];
        part_differences(&c.a, &c.judged, &c.timeline, k, parts);
        most = fmaxf(most, parts[PART_RIGHT_FOREARM].angle_rad);
        there = k == shown ? parts[PART_RIGHT_FOREARM].angle_rad : there;
    }
    print_message("at %.2f s %.3f rad, at most %.3f\n", m->attempt_s, (double)there, (double)most);
    EXPECT_AT_LEAST(there, most);
    EXPECT_NEAR(m->reference_azimuth_rad, -m->attempt_azimuth_rad, 0);
    report_moments_free(moments, count);
    comparison_free(&c);
}

static void test_reports_hold_what_was_found(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.right_elbow_rad = 0.5;
    b.wrong_to_s = 3;
    struct comparison c = compare(&a, &b);
    char *json = report_json(&(struct report_attempt){.c = &c}), *csv = report_csv(&c), *text = report_text(&c, false);
    struct report_moment moments[REPORT_MOMENTS];
    const int count = report_moments(&c, moments);
    const struct report_attempt attempts[2] = {{.c = &c, .name = "B", .moments = moments, .moment_count = count},
                                               {.c = &c, .name = "again \"B\""}};
    char *html = report_html(attempts, 1, "A <b>"), *both = report_html(attempts, 2, "A"),
         *both_json = report_json_attempts(attempts, 2);
    EXPECT_AT_LEAST(count, 1);
    EXPECT_INT(moments[0].part, PART_RIGHT_FOREARM);
    EXPECT_TRUE(!strstr(html, "Progress") && strstr(html, "The worst moment"));
    EXPECT_TRUE(strstr(both, "Progress") && strstr(both, "again &quot;B&quot;"));
    EXPECT_TRUE(strstr(both_json, "\"again \\\"B\\\"\""));
    EXPECT_TRUE(json && strstr(json, "\"score\"") && strstr(json, "\"right_forearm\"") &&
                strstr(json, "\"repetitions\""));
    EXPECT_TRUE(csv && strstr(csv, "right_elbow_deg"));
    EXPECT_TRUE(html && strstr(html, "Right elbow") && strstr(html, "A &lt;b&gt;") && strstr(html, "<svg"));
    EXPECT_TRUE(text && strstr(text, "Right elbow"));
    free(json);
    free(csv);
    free(html);
    free(both);
    free(both_json);
    report_moments_free(moments, count);
    free(text);
    comparison_free(&c);
}

static int32_t count_of(const char *text, const char *word)
{
    int32_t count = 0;
    for (const char *at = text; at && (at = strstr(at, word)); at++)
        count++;
    return count;
}

// What is said to be good has no finding, and deviates by no more than people do who do it right.
static void test_good_parts_have_no_finding(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.right_elbow_rad = 0.7;
    b.wrong_to_s = 3;
    struct comparison c = compare(&a, &b), same = compare(&a, &a);
    char text[GOOD_TEXT_BYTES];
    print_findings(&c);
    print_message("good: %s\n", good_text(&c, text));
    EXPECT_TRUE(strstr(text, "the left arm") && strstr(text, "the legs"));
    EXPECT_INT(good_parts(&c) >> PART_RIGHT_FOREARM & 1, 0);
    assert_string_equal(good_text(&same, text), "the whole body");
    comparison_free(&c);
    comparison_free(&same);
}

// Of a mirrored attempt the parts are its own.
static void test_good_parts_of_a_mirrored_attempt(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.mirrored = true;
    b.right_elbow_rad = 0.7;
    b.wrong_to_s = 3;
    struct comparison c = compare(&a, &b);
    char text[GOOD_TEXT_BYTES];
    const int bent = part_by_name(c.finding_count > 1 ? c.findings[1].part : "body");
    print_findings(&c);
    print_message("good: %s\n", good_text(&c, text));
    EXPECT_TRUE(c.mirrored && bent >= 0);
    EXPECT_INT(good_parts(&c) >> bent & 1, 0);
    EXPECT_INT(good_parts(&c) >> mirrored_part((enum part)bent) & 1, 1);
    comparison_free(&c);
}

// Three findings are shown at first, the rest is opened, or asked for.
static void test_three_findings_at_first(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.right_elbow_rad = 0.7;
    b.left_arm_rad = -0.6;
    b.right_knee_rad = 0.6;
    b.lean_rad = 0.4;
    b.wrong_to_s = 3;
    struct comparison c = compare(&a, &b);
    const struct report_attempt attempt = {.c = &c, .name = "B"};
    char *few = report_text(&c, false), *all = report_text(&c, true), *html = report_html(&attempt, 1, "A"), more[40];
    EXPECT_AT_LEAST(c.finding_count, SHOWN_FINDINGS + 1);
    snprintf(more, sizeof more, "and %d more (--all)", (int)c.finding_count - SHOWN_FINDINGS);
    EXPECT_TRUE(few && all && html && strstr(few, more) && !strstr(all, more));
    for (int32_t k = 0; k < c.finding_count; k++) {
        EXPECT_INT(strstr(few, c.findings[k].sentence) != NULL, k < SHOWN_FINDINGS);
        EXPECT_TRUE(strstr(all, c.findings[k].sentence) && strstr(html, c.findings[k].sentence));
    }
    snprintf(more, sizeof more, "<summary>%d more", (int)c.finding_count - SHOWN_FINDINGS);
    EXPECT_TRUE(strstr(html, more) != NULL);
    free(few);
    free(all);
    free(html);
    comparison_free(&c);
}

// A clock that counts from 1970 dates a take; from any other no date is made.
static void test_dates(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct comparison c = compare(&a, &a);
    const struct report_attempt attempt = {
        .c = &c, .name = "B", .began_ns = 1772619330LL * 1000000000, .reference_began_ns = 5LL * 1000000000};
    char *html = report_html(&attempt, 1, "A"), *json = report_json(&attempt);
    EXPECT_TRUE(html && strstr(html, "<b>B</b>, 2026-03-04, 10:15 UTC.") &&
                strstr(html, "<b>A</b>, date not recorded."));
    EXPECT_TRUE(json && strstr(json, "\"date\": \"2026-03-04T10:15:30Z\"") && strstr(json, "\"reference_date\": null"));
    free(html);
    free(json);
    comparison_free(&c);
}

// The page has both people at one moment also where no finding has one, angles with their errors, and the time
// alignment; and nothing that it would have to fetch or run.
static void test_the_page_is_whole(void **state)
{
    (void)state;
    const struct exercise a = once();
    struct exercise b = a;
    b.pause_at_s = 1.5;
    b.pause_s = 1.5;
    b.seconds = 4.5;
    struct comparison c = compare(&a, &b);
    struct report_moment moments[REPORT_MOMENTS];
    const int count = report_moments(&c, moments);
    const struct report_attempt attempt = {.c = &c, .name = "B", .moments = moments, .moment_count = count};
    char *html = report_html(&attempt, 1, "A");
    print_findings(&c);
    EXPECT_AT_LEAST(count, 1);
    EXPECT_TRUE(html && strstr(html, "Joint angles at the worst moment") && strstr(html, "±"));
    EXPECT_TRUE(strstr(html, "Time alignment") && strstr(html, "time of the attempt, s") &&
                strstr(html, "one of them pauses"));
    EXPECT_INT(count_of(html, "<script"), 0);
    EXPECT_INT(count_of(html, "http"), 0);
    free(html);
    comparison_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mirrored_moments),           cmocka_unit_test(test_reports_hold_what_was_found),
        cmocka_unit_test(test_good_parts_have_no_finding), cmocka_unit_test(test_good_parts_of_a_mirrored_attempt),
        cmocka_unit_test(test_three_findings_at_first),    cmocka_unit_test(test_dates),
        cmocka_unit_test(test_the_page_is_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
