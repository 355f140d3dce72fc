// The angles of a movement whose angles are known: ranges, courses and what is not known, in each form.
#include "tests/support/test.h"

#include "compare/angle_report.h"
#include "platform/files/json.h"

#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 121 }; // four seconds
#define PI 3.14159265358979323846

// y down, x to the right of a camera that sees the person from the front: the own left is at +x.
static struct vec3 along(struct vec3 from, double x, double y, double z, double length_m)
{
    return v3_add(from, v3_scale(v3_unit(v3(x, y, z)), length_m));
}

// Standing upright, the left elbow bent by `elbow`, the right knee by `knee`, the trunk leaning forwards by `lean`.
static struct skeleton standing(double elbow, double knee, double lean)
{
    struct skeleton s = {0};
    struct vec3 *j = s.joint;
    const struct vec3 up = v3(0, -cos(lean), -sin(lean)); // towards the camera
    j[JOINT_WAIST] = v3(0, 0, 3);
    j[JOINT_TORSO] = v3_add(j[JOINT_WAIST], v3_scale(up, 0.25));
    j[JOINT_NECK] = v3_add(j[JOINT_WAIST], v3_scale(up, 0.5));
    j[JOINT_HEAD] = v3_add(j[JOINT_WAIST], v3_scale(up, 0.7));
    for (int side = 0; side < 2; side++) {
        const double x = side ? -1 : 1;
        const int arm = side ? JOINT_RIGHT_SHOULDER : JOINT_LEFT_SHOULDER,
                  leg = side ? JOINT_RIGHT_HIP : JOINT_LEFT_HIP;
        j[arm] = v3_add(j[JOINT_NECK], v3(0.2 * x, 0, 0));
        j[arm + 1] = along(j[arm], 0, 1, 0, 0.3);
        j[arm + 2] = side ? along(j[arm + 1], 0, 1, 0, 0.3) : along(j[arm + 1], 0, cos(elbow), -sin(elbow), 0.3);
        j[leg] = v3_add(j[JOINT_WAIST], v3(0.1 * x, 0, 0));
        j[leg + 1] = along(j[leg], 0, 1, 0, 0.4);
        j[leg + 2] = side ? along(j[leg + 1], 0, cos(knee), sin(knee), 0.4) : along(j[leg + 1], 0, 1, 0, 0.4);
    }
    for (int k = 0; k < JOINT_COUNT; k++)
        s.confidence[k] = 1;
    return s;
}

// The elbow goes slowly from 20 to 110 degrees and back, the knee stays at 30; the head is never known, and the left
// hand not in the last second.
static struct movement film(void)
{
    struct joint_samples samples = {0};
    struct movement movement;
    for (int i = 0; i < SAMPLES; i++) {
        const double elbow = (65 - 45 * cos(2 * PI * i / (SAMPLES - 1.0))) * PI / 180;
        struct joint_sample sample = {.time_ns = i * INT64_C(33333333), .skeleton = standing(elbow, PI / 6, 0.2)};
        sample.skeleton.confidence[JOINT_HEAD] = 0;
        if (i > SAMPLES - 30)
            sample.skeleton.confidence[JOINT_LEFT_HAND] = 0;
        for (int j = 0; j < JOINT_COUNT; j++)
            sample.sigma_m[j] = 0.02f;
        EXPECT_STATUS(joint_samples_add(&samples, &sample), OK);
    }
    EXPECT_STATUS(movement_from_samples(&samples, &movement), OK);
    joint_samples_free(&samples);
    return movement;
}

static void test_ranges_are_the_true_ones(void **state)
{
    (void)state;
    struct movement movement = film();
    struct angle_summary summary;
    EXPECT_STATUS(angle_summary_of(&movement, &summary), OK);
    const struct angle_range elbow = summary.range[ANGLE_LEFT_ELBOW], knee = summary.range[ANGLE_RIGHT_KNEE],
                             lean = summary.range[ANGLE_LEAN];
    print_message("elbow %.1f to %.1f degrees, knee %.1f to %.1f, lean %.1f\n", (double)elbow.low * 180 / PI,
                  (double)elbow.high * 180 / PI, (double)knee.low * 180 / PI, (double)knee.high * 180 / PI,
                  (double)lean.low * 180 / PI);
    EXPECT_NEAR((double)elbow.low * 180 / PI, 20, 1.5);
    EXPECT_NEAR((double)elbow.high * 180 / PI, 110, 1.5);
    EXPECT_NEAR((double)knee.low * 180 / PI, 30, 0.5);
    EXPECT_NEAR((double)knee.high * 180 / PI, 30, 0.5);
    EXPECT_NEAR((double)lean.low, 0.2, 0.01);
    EXPECT_TRUE(isnan(summary.range[ANGLE_HEAD].low));
    EXPECT_NEAR(summary.known[ANGLE_HEAD], 0, 0);
    EXPECT_NEAR(summary.known[ANGLE_RIGHT_KNEE], 1, 1e-9);
    EXPECT_NEAR(summary.known[ANGLE_LEFT_ELBOW], 0.78, 0.03); // 0.76 and the frames beside it
    movement_free(&movement);
}

static int cells_of(char *line, char **cell, int max, const char *between)
{
    int count = 0;
    for (char *next = line; next && count < max;)
        cell[count++] = strsep(&next, between);
    return count;
}

// The courses, as another program reads them.
static void test_courses_are_the_true_ones(void **state)
{
    (void)state;
    enum { CSV_CELLS = 1 + 2 * BODY_ANGLES, MOT_CELLS = 1 + BODY_ANGLES, MOT_HEADER = 7 };
    struct movement movement = film();
    struct angle_summary summary;
    EXPECT_STATUS(angle_summary_of(&movement, &summary), OK);
    const struct angle_report report = {&movement, &summary, "a \"b\" <c>"};
    char *csv = angle_report_csv(&report), *mot = angle_report_mot(&report), *next = csv, *cell[CSV_CELLS + 2], *line;
    int row = 0;
    assert_non_null(csv);
    assert_non_null(mot);
    for (; (line = strsep(&next, "\n")) && *line; row++) {
        EXPECT_INT(cells_of(line, cell, CSV_CELLS + 2, ","), CSV_CELLS);
        EXPECT_TRUE(row || !strcmp(cell[1 + 2 * ANGLE_LEFT_ELBOW], "left_elbow_deg"));
        if (row < 8 || row > SAMPLES - 40)
            continue; // smoothing at the ends
        EXPECT_NEAR(strtod(cell[1 + 2 * ANGLE_LEFT_ELBOW], NULL), 65 - 45 * cos(2 * PI * (row - 1) / (SAMPLES - 1.0)),
                    0.6);
        EXPECT_TRUE(!*cell[1 + 2 * ANGLE_HEAD] && !*cell[2 + 2 * ANGLE_HEAD]);
    }
    EXPECT_INT(row, 1 + movement.count);
    next = mot;
    for (row = 0; (line = strsep(&next, "\n")) && *line; row++) {
        EXPECT_TRUE(row != 2 || strtol(line + strlen("nRows="), NULL, 10) == movement.count);
        EXPECT_TRUE(row != 3 || strtol(line + strlen("nColumns="), NULL, 10) == MOT_CELLS);
        if (row < MOT_HEADER)
            continue;
        EXPECT_INT(cells_of(line, cell, CSV_CELLS + 2, "\t"), MOT_CELLS);
        EXPECT_TRUE(!strcmp(cell[1 + ANGLE_HEAD], "NaN"));
        EXPECT_NEAR(strtod(cell[1 + ANGLE_RIGHT_KNEE], NULL), 30, 0.5);
    }
    EXPECT_INT(row, MOT_HEADER + movement.count);
    free(csv);
    free(mot);
    movement_free(&movement);
}

static void test_page_and_json_are_whole(void **state)
{
    (void)state;
    struct movement movement = film();
    struct angle_summary summary;
    EXPECT_STATUS(angle_summary_of(&movement, &summary), OK);
    const struct angle_report report = {&movement, &summary, "a \"b\" <c>"};
    char *json = angle_report_json(&report), *page = angle_report_html(&report), *text = angle_report_text(&report);
    assert_non_null(json);
    assert_non_null(page);
    assert_non_null(text);
    struct json *root;
    EXPECT_STATUS(json_parse(json, strlen(json), "angles", &root), OK);
    const struct json *angles = json_member(root, "angles");
    double low = 0;
    EXPECT_STATUS(json_need_number(json_member(angles, "right_knee"), "low_deg", "angles", &low), OK);
    EXPECT_NEAR(low, 30, 0.5);
    json_free(&root);
    EXPECT_TRUE(strstr(page, "a &quot;b&quot; &lt;c&gt;") && !strstr(page, "<c>") && !strstr(page, "nan"));
    EXPECT_TRUE(strstr(text, "right knee") && !strstr(text, "nan"));
    free(json);
    free(page);
    free(text);
    movement_free(&movement);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ranges_are_the_true_ones),
        cmocka_unit_test(test_courses_are_the_true_ones),
        cmocka_unit_test(test_page_and_json_are_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
