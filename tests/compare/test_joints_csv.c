// joints-csv files: what is read, what is left out, and one sentence for each kind that is refused.
#include "compare/joint_samples.h"
#include "compare/comparison.h"
#include "compare/movement.h"
#include "tests/support/exercise.h"
#include "tests/support/scratch.h"
#include "tests/support/test.h"

#include <stdio.h>
#include <stdlib.h>

#define HEADER_LINE "timestamp,joint,x_m,y_m,z_m,confidence"
#define HEADER      HEADER_LINE "\n"

static struct scratch scratch;

static enum status read(const char *text, struct joint_samples *s)
{
    scratch_text(&scratch, "joints.csv", text);
    return joint_samples_read_csv(scratch_file(&scratch, "joints.csv"), s);
}

static void test_reads_rows(void **state)
{
    (void)state;
    struct joint_samples s;
    EXPECT_STATUS(read(HEADER "5.0,head,0.1,-0.2,3,1\r\n5.0,neck,0.1,0,3,0.5\r\n5.1,head,0.1,-0.2,3,1\n", &s), OK);
    EXPECT_INT(s.count, 2);
    EXPECT_INT(s.at[0].time_ns, 0);
    EXPECT_NEAR((double)s.at[1].time_ns, 1e8, 10);
    EXPECT_NEAR(s.at[0].skeleton.confidence[JOINT_NECK], 0.5, 1e-6);
    EXPECT_NEAR(s.at[1].skeleton.confidence[JOINT_NECK], 0, 0);
    EXPECT_NEAR(s.at[0].sigma_m[JOINT_HEAD], default_sigma_m(1), 0);
    EXPECT_TRUE(!s.sigma_given);
    joint_samples_free(&s);
    EXPECT_STATUS(read("timestamp,joint,x_m,y_m,z_m,confidence,sigma_m\n1,head,0,0,3,1,0.007\n", &s), OK);
    EXPECT_NEAR(s.at[0].sigma_m[JOINT_HEAD], 0.007, 1e-6);
    EXPECT_TRUE(s.sigma_given);
    joint_samples_free(&s);
}

static void test_numbers_that_are_none_are_left_out(void **state)
{
    (void)state;
    struct joint_samples s;
    EXPECT_STATUS(read(HEADER "1,head,nan,0,3,1\n1,neck,0,0,3,1\n1,torso,inf,0,3,1\n1,tail,0,0,3,1\nnan,head,0,0,3,1\n"
                              "1,waist,1e300,0,3,1\n",
                       &s),
                  OK);
    EXPECT_INT(s.count, 1);
    EXPECT_INT(s.dropped, 5);
    EXPECT_NEAR(s.at[0].skeleton.confidence[JOINT_NECK], 1, 0);
    EXPECT_NEAR(s.at[0].skeleton.confidence[JOINT_HEAD], 0, 0);
    joint_samples_free(&s);
}

// As spreadsheets save them; what is named .csv is never taken for a recording.
static void test_other_programs_files(void **state)
{
    (void)state;
    struct movement m;
    struct movement_source source;
    const char *path = scratch_file(&scratch, "joints.csv");
    struct joint_samples s;
    EXPECT_STATUS(read("\xef\xbb\xbf" HEADER "1,head,0,0,3,1\r\n1.1,head,0,0,3,1\r\n", &s), OK);
    EXPECT_INT(s.count, 2);
    joint_samples_free(&s);
    scratch_text(&scratch, "marked", "\xef\xbb\xbf" HEADER "1,head,0,0,3,1\n");
    EXPECT_TRUE(is_joints_csv(scratch_file(&scratch, "marked")));
    EXPECT_TRUE(is_joints_csv(path));
    scratch_text(&scratch, "joints.csv", "timestamp;joint;x_m;y_m;z_m;confidence\n1;head;0;0;3;1\n");
    EXPECT_STATUS(movement_read(path, NULL, &m, &source), ERR_INPUT);
    EXPECT_SAYS(HEADER_LINE);
    scratch_text(&scratch, "joints.csv", "SQLite format 3 and more");
    EXPECT_TRUE(!is_joints_csv(path));
}

static void test_bad_files_are_refused_in_a_sentence(void **state)
{
    (void)state;
    const struct {
        const char *text, *word;
    } bad[] = {
        {"", "no joint"}, // an empty file
        {"a,b,c\n1,2,3\n", "neither"},
        {HEADER, "no joint"},
        {HEADER "1,head,0,0,3,0\n", "no joint"},
        {HEADER "1,head,0,0\n", "line 2"},
        {HEADER "1,head,0,0,3,1,7,8,9,10\n", "line 2"},
        {HEADER "soon,head,0,0,3,1\n", "no time"},
        {HEADER "1,head,left,0,3,1\n", "no number"},
    };
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        struct joint_samples s;
        EXPECT_STATUS(read(bad[i].text, &s), ERR_INPUT);
        EXPECT_SAYS(bad[i].word);
        EXPECT_INT(s.count, 0);
    }
    struct joint_samples s;
    EXPECT_STATUS(joint_samples_read_csv(scratch_file(&scratch, "none.csv"), &s), ERR_MISSING);
}

static void test_a_take_name_is_refused(void **state)
{
    (void)state;
    struct movement m;
    struct movement_source source;
    scratch_text(&scratch, "joints.csv", HEADER "1,head,0,0,3,1\n");
    EXPECT_STATUS(movement_read(scratch_file(&scratch, "joints.csv"), "one", &m, &source), ERR_INPUT);
    EXPECT_SAYS("no takes");
    EXPECT_STATUS(movement_read(scratch_file(&scratch, "joints.csv"), NULL, &m, &source), ERR_INPUT);
    EXPECT_SAYS("hips");
}

// A movement as a file, with a hand that is no number in every fifth frame and for a third of a second.
static void write_exercise(const char *name, bool holes)
{
    const struct exercise e = exercise_default();
    struct rng rng = {3};
    const int frames = (int)(e.seconds * e.rate_hz);
    char *text = malloc((size_t)frames * JOINT_COUNT * 80 + sizeof HEADER), *to = text;
    to += sprintf(to, HEADER);
    for (int i = 0; i < frames; i++) {
        const struct skeleton s = exercise_at(&e, i / e.rate_hz, &rng);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const bool hole = holes && j == JOINT_RIGHT_HAND && (i % 5 == 0 || (i > 60 && i < 70));
            const struct vec3 p = s.joint[j];
            to += hole ? sprintf(to, "%.4f,%s,nan,%.5f,-inf,1\n", i / e.rate_hz, joint_name((enum joint)j), p.y)
                       : sprintf(to, "%.4f,%s,%.5f,%.5f,%.5f,1\n", i / e.rate_hz, joint_name((enum joint)j), p.x, p.y,
                                 p.z);
        }
    }
    scratch_text(&scratch, name, text);
    free(text);
}

static void test_a_file_with_nan_is_compared(void **state)
{
    (void)state;
    struct movement a, b;
    struct movement_source source;
    struct comparison c;
    write_exercise("whole.csv", false);
    write_exercise("holes.csv", true);
    EXPECT_STATUS(movement_read(scratch_file(&scratch, "whole.csv"), NULL, &a, &source), OK);
    EXPECT_STATUS(movement_read(scratch_file(&scratch, "holes.csv"), NULL, &b, &source), OK);
    EXPECT_STATUS(comparison_make(&a, &b, &c), OK);
    EXPECT_TRUE(isfinite(c.score));
    EXPECT_AT_LEAST(c.score, 98);
    for (int32_t f = 0; f < c.finding_count; f++)
        EXPECT_TRUE(c.findings[f].kind != FINDING_POSTURE);
    comparison_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reads_rows),
        cmocka_unit_test(test_numbers_that_are_none_are_left_out),
        cmocka_unit_test(test_other_programs_files),
        cmocka_unit_test(test_bad_files_are_refused_in_a_sentence),
        cmocka_unit_test(test_a_take_name_is_refused),
        cmocka_unit_test(test_a_file_with_nan_is_compared),
    };
    scratch = scratch_make();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    scratch_remove(&scratch);
    return failed;
}
