// Reports of a comparison: JSON, CSV, text and the page, and the moments that the page shows.
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
    char *json = report_json(&c), *csv = report_csv(&c), *text = report_text(&c);
    struct report_moment moments[REPORT_MOMENTS];
    const int count = report_moments(&c, moments);
    const struct report_attempt attempts[2] = {{&c, "B", moments, count}, {&c, "again \"B\"", NULL, 0}};
    char *html = report_html(attempts, 1, "A <b>"), *both = report_html(attempts, 2, "A"),
         *both_json = report_json_attempts(attempts, 2);
    EXPECT_AT_LEAST(count, 1);
    EXPECT_INT(moments[0].part, PART_RIGHT_FOREARM);
    EXPECT_TRUE(!strstr(html, "Progress") && strstr(html, "Worst moments"));
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mirrored_moments),
        cmocka_unit_test(test_reports_hold_what_was_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
