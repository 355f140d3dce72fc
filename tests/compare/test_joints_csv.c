// joints-csv files: what is read, what is left out, and one sentence for each kind that is refused.
#include "tests/support/test.h"

#include "compare/comparison.h"
#include "compare/findings.h"
#include "compare/joint_samples.h"
#include "compare/movement.h"
#include "compare/report.h"
#include "tests/support/exercise.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static void test_an_empty_sigma_is_the_usual_one(void **state)
{
    (void)state;
    struct joint_samples s;
    EXPECT_STATUS(read("# axes: camera\n" HEADER_LINE ",sigma_m\n1,head,0,0,3,1,\n1,neck,0,0,3,0.5,0.02\n", &s), OK);
    EXPECT_NEAR(s.at[0].sigma_m[JOINT_HEAD], default_sigma_m(1), 0);
    EXPECT_NEAR(s.at[0].sigma_m[JOINT_NECK], 0.02, 1e-6);
    EXPECT_INT(s.dropped, 0);
    joint_samples_free(&s);
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
        {HEADER "1,head,0x10,0,3,1\n", "'0x10' is no number"},
        {HEADER "0x1,head,0,0,3,1\n", "'0x1' is no time"},
        {HEADER "1,LeftWrist,0,0,3,1\n", "'LeftWrist' is no joint's name; known are head, neck, left_shoulder"},
        {HEADER "1,head,0,0,0,1\n1,neck,0,0,0,1\n", "no joint"},
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

// How a file is spoilt before it is read again.
struct dialect {
    double metres, seconds; // the file's units
    double step_s;          // between its frames; 0: as the exercise has them
    bool numbered;          // frames' numbers for times
    unsigned without;       // joints, as bits
    int zero_every;         // of so many joints one is written as 0, 0, 0
    bool without_waist;     // places are relative to the waist
    enum { IN_TIME, BY_JOINT, BACKWARDS } order;
    const char *(*name)(enum joint j);
};

static void write_row(char **to, const struct dialect *d, int i, enum joint j)
{
    if (d->without >> j & 1)
        return;
    const struct exercise e = exercise_default();
    const double time_s = i * (d->step_s > 0 ? d->step_s : 1 / e.rate_hz);
    const struct skeleton s = exercise_at(&e, time_s, NULL);
    const struct vec3 p =
        v3_scale(d->without_waist ? v3_sub(s.joint[j], s.joint[JOINT_WAIST]) : s.joint[j], 1 / d->metres);
    const bool zero = d->zero_every && (i * JOINT_COUNT + (int)j) % d->zero_every == 0;
    *to += sprintf(*to, "%.12g,%s,%.6f,%.6f,%.6f,1\n", d->numbered ? i : time_s / d->seconds,
                   d->name ? d->name(j) : joint_name(j), zero ? 0 : p.x, zero ? 0 : p.y, zero ? 0 : p.z);
}

static const char *write_dialect(const char *name, const struct dialect *d)
{
    enum { FRAMES = 120 };
    static char text[FRAMES * JOINT_COUNT * 100 + sizeof HEADER];
    char *to = text + sprintf(text, HEADER);
    const int frames = d->step_s > 0 ? (int)(4 / d->step_s) : FRAMES;
    for (int n = 0; n < frames * JOINT_COUNT; n++) {
        const int k = d->order == BACKWARDS ? frames * JOINT_COUNT - 1 - n : n;
        if (d->order == BY_JOINT)
            write_row(&to, d, k % frames, (enum joint)(k / frames));
        else
            write_row(&to, d, k / JOINT_COUNT, (enum joint)(k % JOINT_COUNT));
    }
    scratch_text(&scratch, name, text);
    return scratch_file(&scratch, name);
}

static double score_against_plain(const char *path)
{
    struct movement a, b;
    struct movement_source source;
    struct comparison c;
    static const struct dialect plain = {.metres = 1, .seconds = 1};
    EXPECT_STATUS(movement_read(write_dialect("plain.csv", &plain), NULL, &a, &source), OK);
    EXPECT_STATUS(movement_read(path, NULL, &b, &source), OK);
    EXPECT_STATUS(comparison_make(&a, &b, NULL, &c), OK);
    const double score = c.score;
    EXPECT_INT(c.finding_count, 0);
    comparison_free(&c);
    return score;
}

static const char *spoken_name(enum joint j)
{
    static char name[32];
    snprintf(name, sizeof name, "%s", joint_name(j));
    for (char *at = name; *at; at++)
        *at = *at == '_' ? ' ' : at == name || at[-1] == ' ' ? (char)(*at - 'a' + 'A') : *at;
    return name;
}

// Everything that can be found out is read as what it is, with a word where it had to be found out.
static void test_dialects(void **state)
{
    (void)state;
    const struct {
        struct dialect dialect;
        const char *word; // of the note; NULL: there is none
    } good[] = {
        {{.metres = 0.001, .seconds = 1}, "millimetres"},
        {{.metres = 0.01, .seconds = 1}, "centimetres"},
        {{.metres = 0.0254, .seconds = 1}, "inches"},
        {{.metres = 0.3048, .seconds = 1}, "feet"},
        {{.metres = 37, .seconds = 1}, "no usual unit"},
        {{.metres = 2, .seconds = 1}, NULL}, // a child's size
        {{.metres = 1, .seconds = 1e-3}, "milliseconds"},
        {{.metres = 1, .seconds = 1e-6}, "microseconds"},
        {{.metres = 1, .seconds = 1e-9}, "nanoseconds"},
        {{.metres = 0.001, .seconds = 1e-3}, "millimetres"},
        {{.metres = 1, .seconds = 1, .zero_every = 37}, "0, 0, 0"},
        {{.metres = 1, .seconds = 1, .without_waist = true}, NULL},
        {{.metres = 1, .seconds = 1, .order = BY_JOINT}, "sorted"},
        {{.metres = 1, .seconds = 1, .order = BACKWARDS}, "sorted"},
        {{.metres = 1, .seconds = 1, .name = spoken_name}, NULL},
    };
    for (size_t i = 0; i < COUNT_OF(good); i++) {
        const char *path = write_dialect("dialect.csv", &good[i].dialect);
        struct joint_samples s;
        EXPECT_STATUS(joint_samples_read_csv(path, &s), OK);
        bool said = !good[i].word;
        for (int k = 0; k < s.notes.count; k++)
            said = said || (good[i].word && strstr(s.notes.line[k], good[i].word));
        if (!said)
            print_error("dialect %zu: '%s' without '%s'\n", i, s.notes.line[0], good[i].word);
        EXPECT_TRUE(said);
        EXPECT_TRUE(good[i].word || !s.notes.count);
        joint_samples_free(&s);
        EXPECT_AT_LEAST(score_against_plain(path), 99);
    }
}

// Joints that lack are said; a score of 100 says nothing of them.
static void test_what_is_not_judged_is_said(void **state)
{
    (void)state;
    enum { KNEES = 1 << JOINT_LEFT_KNEE | 1 << JOINT_RIGHT_KNEE, HAND = 1 << JOINT_LEFT_HAND, HEAD = 1 << JOINT_HEAD };
    const struct {
        unsigned reference, attempt;
        const char *words;
    } cases[] = {
        {0, 0, ""},
        {0, KNEES, "could not be judged: the knees are not in the attempt"},
        {HAND, 0, "could not be judged: the left hand is not in the reference"},
        {HEAD | HAND, HEAD | KNEES,
         "could not be judged: the head is in neither movement; the knees are not in the attempt; the left hand is not "
         "in the reference"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        const struct dialect a = {.metres = 1, .seconds = 1, .without = cases[i].reference},
                             b = {.metres = 1, .seconds = 1, .without = cases[i].attempt};
        struct movement x, y;
        struct movement_source source;
        struct comparison c;
        char said[NOT_JUDGED_BYTES];
        EXPECT_STATUS(movement_read(write_dialect("a.csv", &a), NULL, &x, &source), OK);
        EXPECT_STATUS(movement_read(write_dialect("b.csv", &b), NULL, &y, &source), OK);
        EXPECT_STATUS(comparison_make(&x, &y, NULL, &c), OK);
        EXPECT_AT_LEAST(c.score, 99);
        assert_string_equal(not_judged_text(&c, said), cases[i].words);
        char *const reports[] = {report_text(&c, true), report_json(&(struct report_attempt){.c = &c})};
        for (size_t k = 0; k < COUNT_OF(reports); k++) {
            EXPECT_TRUE(strstr(reports[k], cases[i].words));
            EXPECT_TRUE(*cases[i].words || !strstr(reports[k], "could not be judged"));
            free(reports[k]);
        }
        comparison_free(&c);
    }
}

static void test_times_that_cannot_be_compared(void **state)
{
    (void)state;
    const struct {
        struct dialect dialect;
        const char *word;
    } bad[] = {
        {{.metres = 1, .seconds = 1, .numbered = true}, "number the frames"},
        {{.metres = 1, .seconds = 1, .step_s = 1}, "at least 4 a second"},
        {{.metres = 1, .seconds = 1, .step_s = 0.3}, "at least 4 a second"},
        {{.metres = 1, .seconds = 3600}, "no seconds"},
        {{.metres = 1, .seconds = 86400}, "no seconds"},
    };
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        struct joint_samples s;
        EXPECT_STATUS(joint_samples_read_csv(write_dialect("dialect.csv", &bad[i].dialect), &s), ERR_INPUT);
        EXPECT_SAYS(bad[i].word);
    }
}

// Two films, one after the other, with clocks of their own: none is sorted into the other.
static void test_a_second_clock_is_no_disorder(void **state)
{
    (void)state;
    struct joint_samples s;
    char text[4000], *to = text + sprintf(text, HEADER);
    for (int film = 0; film < 2; film++)
        for (int i = 0; i < 20; i++)
            to += sprintf(to, "%.3f,head,%.2f,0,3,1\n", 100 - 50 * film + i / 30.0, 0.1 * i);
    EXPECT_STATUS(read(text, &s), OK);
    EXPECT_INT(s.count, 40);
    EXPECT_INT(s.jumps, 1);
    for (int64_t i = 0; i < s.count; i++)
        EXPECT_NEAR(s.at[i].skeleton.joint[JOINT_HEAD].x, 0.1 * (double)(i % 20), 1e-9);
    joint_samples_free(&s);
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
    EXPECT_STATUS(comparison_make(&a, &b, NULL, &c), OK);
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
        cmocka_unit_test(test_an_empty_sigma_is_the_usual_one),
        cmocka_unit_test(test_dialects),
        cmocka_unit_test(test_what_is_not_judged_is_said),
        cmocka_unit_test(test_times_that_cannot_be_compared),
        cmocka_unit_test(test_a_second_clock_is_no_disorder),
        cmocka_unit_test(test_a_take_name_is_refused),
        cmocka_unit_test(test_a_file_with_nan_is_compared),
    };
    scratch = scratch_make();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    scratch_remove(&scratch);
    return failed;
}
