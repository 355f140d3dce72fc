// Axes of joints-csv files: as their first line says, or found out by the body. The truth is the exercise's.
#include "tests/support/test.h"

#include "compare/comparison.h"
#include "tests/support/exercise.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HEADER "timestamp,joint,x_m,y_m,z_m,confidence\n"

static struct scratch scratch;

// Camera axes to a file's.
struct axes {
    struct vec3 row[3];
};
static const struct axes same = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

static struct vec3 turned(const struct axes *a, struct vec3 p)
{
    return v3(v3_dot(a->row[0], p), v3_dot(a->row[1], p), v3_dot(a->row[2], p));
}

typedef struct skeleton body_at(double time_s);

static struct skeleton exercising(double time_s)
{
    struct exercise e = exercise_default();
    e.yaw_rad = 0.4;
    return exercise_at(&e, time_s, NULL);
}

static enum joint other_side(enum joint j)
{
    static const int to_right = JOINT_RIGHT_SHOULDER - JOINT_LEFT_SHOULDER,
                     to_right_leg = JOINT_RIGHT_HIP - JOINT_LEFT_HIP;
    if (j >= JOINT_LEFT_SHOULDER && j <= JOINT_RIGHT_HAND)
        return (enum joint)(j < JOINT_RIGHT_SHOULDER ? (int)j + to_right : (int)j - to_right);
    if (j >= JOINT_LEFT_HIP)
        return (enum joint)(j < JOINT_RIGHT_HIP ? (int)j + to_right_leg : (int)j - to_right_leg);
    return j;
}

enum { FRAMES = 120 };

static const char *write_file(const char *line, body_at *body, const struct axes *axes, bool exchanged)
{
    static char text[FRAMES * JOINT_COUNT * 80 + 1000];
    char *to = text + sprintf(text, "%s" HEADER, line);
    for (int i = 0; i < FRAMES; i++) {
        const struct skeleton s = body(i / 30.0);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = turned(axes, s.joint[j]);
            to += sprintf(to, "%.4f,%s,%.6f,%.6f,%.6f,1\n", i / 30.0,
                          joint_name(exchanged ? other_side((enum joint)j) : (enum joint)j), p.x, p.y, p.z);
        }
    }
    scratch_text(&scratch, "joints.csv", text);
    return scratch_file(&scratch, "joints.csv");
}

// Every joint from the waist in the person's own upright frame: level to the left by the hips, ahead, up.
static void in_own_frame(const struct skeleton *s, struct vec3 out[JOINT_COUNT])
{
    struct vec3 left = v3_sub(s->joint[JOINT_LEFT_HIP], s->joint[JOINT_RIGHT_HIP]);
    left.y = 0;
    left = v3_unit(left);
    const struct vec3 up = v3(0, -1, 0), ahead = v3_cross(left, up);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 d = v3_sub(s->joint[j], s->joint[JOINT_WAIST]);
        out[j] = v3(v3_dot(d, left), v3_dot(d, ahead), v3_dot(d, up));
    }
}

static double worst_against_truth(const struct joint_samples *s, body_at *body)
{
    double worst = 0;
    for (int64_t i = 0; i < s->count; i++) {
        const struct skeleton truth = body((double)s->at[i].time_ns * 1e-9);
        struct vec3 got[JOINT_COUNT], wanted[JOINT_COUNT];
        in_own_frame(&s->at[i].skeleton, got);
        in_own_frame(&truth, wanted);
        for (int j = 0; j < JOINT_COUNT; j++)
            worst = fmax(worst, v3_distance(got[j], wanted[j]));
    }
    return worst;
}

static double determinant(const struct axes *a) { return v3_dot(a->row[0], v3_cross(a->row[1], a->row[2])); }

// One of the 48 ways to name and point three axes.
static struct axes permuted(int k)
{
    static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    struct axes a = {{{0}}};
    for (int r = 0; r < 3; r++)
        a.row[r] = v3_scale(same.row[order[k / 8][r]], k >> r & 1 ? -1 : 1);
    return a;
}

static void test_all_axes_are_found(void **state)
{
    (void)state;
    int left_handed = 0;
    for (int k = 0; k < 48; k++) {
        const struct axes a = permuted(k);
        struct joint_samples s;
        EXPECT_STATUS(joint_samples_read_csv(write_file("", exercising, &a, false), &s), OK);
        EXPECT_INT(s.count, FRAMES);
        const double worst = worst_against_truth(&s, exercising);
        if (worst > 1e-4)
            print_error("axes %d, determinant %.0f: %s\n", k, determinant(&a), s.notes.count ? s.notes.line[0] : "");
        EXPECT_AT_MOST(worst, 1e-4);
        // A camera's axes, however turned about the vertical, need no word; all others do.
        const bool usual = v3_dot(a.row[1], v3(0, 1, 0)) > 0.5 && determinant(&a) > 0;
        EXPECT_INT(s.notes.count, usual ? 0 : 1);
        left_handed += determinant(&a) < 0;
        joint_samples_free(&s);
    }
    EXPECT_INT(left_handed, 24);
}

static void test_the_line_is_believed(void **state)
{
    (void)state;
    static const struct axes room = {{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};
    const struct {
        const char *line;
        const struct axes *axes;
    } good[] = {{"# axes: camera\n", &same},
                {"#axes:Camera\r\n", &same},
                {"# Axes: room\n", &room},
                {"# written by hand\n\n# axes: room, in metres\n", &room}};
    for (size_t i = 0; i < COUNT_OF(good); i++) {
        struct joint_samples s;
        const char *path = write_file(good[i].line, exercising, good[i].axes, false);
        if (!strncmp(good[i].line, "# axes", 6))
            EXPECT_TRUE(is_joints_csv(path));
        EXPECT_STATUS(joint_samples_read_csv(path, &s), OK);
        EXPECT_INT(s.notes.count, 0);
        EXPECT_AT_MOST(worst_against_truth(&s, exercising), 1e-4);
        joint_samples_free(&s);
    }
    struct joint_samples s;
    EXPECT_STATUS(joint_samples_read_csv(write_file("# axes: yup\n", exercising, &same, false), &s), ERR_INPUT);
    EXPECT_SAYS("'yup'");
    EXPECT_SAYS("camera");
}

// Where the body speaks against it there is a word.
static void test_a_line_that_cannot_be_true(void **state)
{
    (void)state;
    static const struct axes y_up = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
                             left_handed = {{{1, 0, 0}, {0, -1, 0}, {0, 0, 1}}},
                             z_up = {{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};
    const struct {
        const struct axes *axes;
        const char *word;
        double worst;
    } bad[] = {{&y_up, "upside down", 10}, {&z_up, "lies", 10}, {&left_handed, "left-handed", 1e-4}};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        struct joint_samples s;
        EXPECT_STATUS(joint_samples_read_csv(write_file("# axes: camera\n", exercising, bad[i].axes, false), &s), OK);
        EXPECT_INT(s.notes.count, 1);
        if (!strstr(s.notes.line[0], bad[i].word))
            print_error("'%s' without '%s'\n", s.notes.line[0], bad[i].word);
        EXPECT_TRUE(strstr(s.notes.line[0], bad[i].word));
        EXPECT_AT_MOST(worst_against_truth(&s, exercising), bad[i].worst);
        joint_samples_free(&s);
    }
}

static struct movement read_movement(const char *path)
{
    struct movement m;
    struct movement_source source;
    EXPECT_STATUS(movement_read(path, NULL, &m, &source), OK);
    return m;
}

static struct comparison compared(const struct axes *axes, bool exchanged)
{
    struct comparison c;
    struct movement a = read_movement(write_file("# axes: camera\n", exercising, &same, false)),
                    b = read_movement(write_file("", exercising, axes, exchanged));
    EXPECT_STATUS(comparison_make(&a, &b, NULL, &c), OK);
    return c;
}

// Exchanged names make a mirror image, in whatever axes; mirrored axes and exchanged names make another.
static void test_exchanged_sides(void **state)
{
    (void)state;
    for (int k = 0; k < 48; k += 5) {
        const struct axes a = permuted(k);
        struct comparison c = compared(&a, true);
        EXPECT_TRUE(c.mirrored);
        EXPECT_AT_LEAST(c.score, 99);
        comparison_free(&c);
    }
}

// The same body on other legs: knees so far ahead of the hips and below them, feet likewise, metres.
static struct skeleton on_legs(double time_s, const double knee[2], const double foot[2])
{
    static const enum joint leg[2][3] = {{JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
                                         {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}};
    struct skeleton s = exercising(time_s);
    const struct vec3 left = v3_unit(v3_sub(s.joint[JOINT_LEFT_HIP], s.joint[JOINT_RIGHT_HIP])),
                      ahead = v3_cross(left, v3(0, -1, 0));
    for (int side = 0; side < 2; side++) {
        const struct vec3 hip = s.joint[leg[side][0]];
        s.joint[leg[side][1]] = v3_add(hip, v3_add(v3_scale(ahead, knee[0]), v3(0, knee[1], 0)));
        s.joint[leg[side][2]] = v3_add(hip, v3_add(v3_scale(ahead, foot[0]), v3(0, foot[1], 0)));
    }
    return s;
}

// A person who never stands straight is balanced above the feet; all along in a squat here.
static struct skeleton squatting(double time_s)
{
    return on_legs(time_s, (const double[]){0.24, 0.34}, (const double[]){0.05, 0.7});
}

// A person who stands, as sensors see one: straight knees are bent backwards, by 33 degrees here.
static struct skeleton standing_stiffly(double time_s)
{
    return on_legs(time_s, (const double[]){-0.12, 0.4}, (const double[]){0, 0.8});
}

static void test_stiff_knees_mirror_nothing(void **state)
{
    (void)state;
    struct joint_samples s;
    EXPECT_STATUS(joint_samples_read_csv(write_file("", standing_stiffly, &same, false), &s), OK);
    EXPECT_AT_MOST(worst_against_truth(&s, standing_stiffly), 0.02); // but for a tilt that standing says
    joint_samples_free(&s);
}

static struct axes rotated(double rad)
{
    return (struct axes){{{1, 0, 0}, {0, cos(rad), -sin(rad)}, {0, sin(rad), cos(rad)}}};
}

static void test_rotations_between_axes(void **state)
{
    (void)state;
    static body_at *const bodies[] = {exercising, squatting};
    for (size_t b = 0; b < COUNT_OF(bodies); b++)
        for (double degrees = -170; degrees < 180; degrees += 35) {
            const struct axes a = rotated(degrees / 57.29578);
            struct joint_samples s;
            EXPECT_STATUS(joint_samples_read_csv(write_file("", bodies[b], &a, false), &s), OK);
            const double worst = worst_against_truth(&s, bodies[b]);
            if (worst > 0.15)
                print_error("%.0f degrees: %s\n", degrees, s.notes.count ? s.notes.line[0] : "no note");
            EXPECT_AT_MOST(worst, 0.15); // some 8 degrees of a body's half
            joint_samples_free(&s);
        }
}

static void turn_legs(struct skeleton *s, double left_rad, double right_rad)
{
    static const enum joint leg[2][3] = {{JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
                                         {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}};
    for (int side = 0; side < 2; side++) {
        const double rad = side ? right_rad : left_rad;
        for (int k = 1; k < 3; k++)
            s->joint[leg[side][k]] = v3_add(s->joint[leg[side][0]], v3(0, 0.42 * k * cos(rad), -0.42 * k * sin(rad)));
    }
}

static struct skeleton still(double time_s)
{
    struct exercise e = exercise_default();
    e.still = true;
    (void)time_s;
    return exercise_at(&e, 0, NULL);
}

// On the back, the head to the right of the picture, one leg after the other raised.
static struct skeleton lying(double time_s)
{
    struct skeleton s = still(time_s);
    const double phase = time_s * 3.14159265 / 2;
    turn_legs(&s, 1.2 * fmax(0, sin(phase)), 1.2 * fmax(0, -sin(phase)));
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = v3(-s.joint[j].y, s.joint[j].x, s.joint[j].z);
    return s;
}

// The hips lifted from the floor, the knees bent all along.
static struct skeleton bridging(double time_s)
{
    struct skeleton s = still(time_s);
    const double lifted = 0.15 + 0.15 * sin(time_s * 2);
    for (int side = 0; side < 2; side++) {
        const struct vec3 hip = s.joint[side ? JOINT_RIGHT_HIP : JOINT_LEFT_HIP];
        s.joint[side ? JOINT_RIGHT_KNEE : JOINT_LEFT_KNEE] = v3_add(hip, v3(0, 0.25, -0.3));
        s.joint[side ? JOINT_RIGHT_FOOT : JOINT_LEFT_FOOT] = v3_add(hip, v3(0, 0.45 - 0.1 * lifted, 0.05));
    }
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = v3(-s.joint[j].y, s.joint[j].z - lifted, -s.joint[j].x);
    return s;
}

// By the hands, which rest on a bar.
static struct skeleton hanging(double time_s)
{
    struct skeleton s = still(time_s);
    turn_legs(&s, 0.4 * sin(3 * time_s), 0.4 * sin(3 * time_s));
    const double pulled = 0.1 * sin(2 * time_s);
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j].y -= pulled;
    for (int side = 0; side < 2; side++) {
        s.joint[side ? JOINT_RIGHT_HAND : JOINT_LEFT_HAND] = v3(side ? -0.2 : 0.2, -1.2, 3);
        s.joint[side ? JOINT_RIGHT_ELBOW : JOINT_LEFT_ELBOW] = v3(side ? -0.25 : 0.25, -0.9 - pulled / 2, 3);
    }
    return s;
}

static struct skeleton tumbling(double time_s)
{
    struct skeleton s = exercising(time_s);
    const bool over = (int)(time_s * 2) % 2;
    for (int j = 0; j < JOINT_COUNT && over; j++)
        s.joint[j] = v3(-s.joint[j].x, -s.joint[j].y, s.joint[j].z);
    return s;
}

static void test_what_cannot_be_told_is_refused(void **state)
{
    (void)state;
    static const struct axes y_up = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
    const struct {
        body_at *body;
        const struct axes *axes;
        const char *word;
    } bad[] = {{lying, &same, "lying"},
               {bridging, &same, "neither stands"},
               {hanging, &y_up, "hang"},
               {tumbling, &same, "by turns"}};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        struct joint_samples s;
        EXPECT_STATUS(joint_samples_read_csv(write_file("", bad[i].body, bad[i].axes, false), &s), ERR_INPUT);
        EXPECT_SAYS(bad[i].word);
        EXPECT_SAYS("# axes: camera");
        // With its line it is read.
        EXPECT_STATUS(joint_samples_read_csv(write_file("# axes: camera\n", bad[i].body, &same, false), &s), OK);
        EXPECT_AT_MOST(worst_against_truth(&s, bad[i].body), 0.1); // a camera's tilt is judged by straight legs
        joint_samples_free(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_axes_are_found),
        cmocka_unit_test(test_the_line_is_believed),
        cmocka_unit_test(test_a_line_that_cannot_be_true),
        cmocka_unit_test(test_exchanged_sides),
        cmocka_unit_test(test_stiff_knees_mirror_nothing),
        cmocka_unit_test(test_rotations_between_axes),
        cmocka_unit_test(test_what_cannot_be_told_is_refused),
    };
    scratch = scratch_make();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    scratch_remove(&scratch);
    return failed;
}
