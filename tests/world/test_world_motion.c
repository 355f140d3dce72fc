// Motion files on the small world's figure: what is read, and what is refused.
#include "tests/support/test.h"

#include "formats/bvh_reader.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char tiny[] =
    "HIERARCHY\nROOT hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    " JOINT knee\n {\n  OFFSET 0 -2 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 -1 0\n "
    " }\n"
    " }\n}\nMOTION\nFrames: 2\nFrame Time: 0.5\n1 2 3 0 0 0 0 0 0\n1 2 3 90 0 0 0 0 0\n";

static enum status parse(const char *text, size_t count, struct bvh **out)
{
    // Into memory that ends where the text does, so that a read beyond it is seen.
    uint8_t *copy = malloc(count + !count);
    memcpy(copy, text, count);
    enum status status = bvh_parse(out, "tiny.bvh", copy, count);
    free(copy);
    return status;
}

static void test_bvh_gives_positions(void **state)
{
    (void)state;
    struct bvh *b;
    EXPECT_STATUS(parse(tiny, strlen(tiny), &b), OK);
    EXPECT_INT(bvh_joint_count(b), 2);
    EXPECT_INT(bvh_frame_count(b), 2);
    EXPECT_NEAR(bvh_frame_s(b), 0.5, 0);
    EXPECT_INT(bvh_find(b, "KNEE"), 1);
    EXPECT_INT(bvh_find(b, "elbow"), -1);
    struct vec3 p[2];
    bvh_positions(b, 0, p);
    EXPECT_NEAR(v3_distance(p[1], v3(1, 0, 3)), 0, 1e-12);
    bvh_positions(b, 1, p); // a quarter turn about z maps -y to +x
    EXPECT_NEAR(v3_distance(p[1], v3(3, 2, 3)), 0, 1e-12);
    bvh_free(&b);
}

static void test_bvh_refuses_what_is_broken(void **state)
{
    (void)state;
    struct bvh *b;
    // Cut anywhere: an error with a sentence (but for the last number's digits and the final newline).
    for (size_t cut = 0; cut + 3 < sizeof tiny; cut++) {
        EXPECT_STATUS(parse(tiny, cut, &b), ERR_INPUT);
        EXPECT_TRUE(b == NULL);
        EXPECT_SAYS("tiny.bvh");
    }
    static const char *const bad[][2] = {
        {"1 2 3 90", "1 2 nan 90"},
        {"1 2 3 90", "1 2 inf 90"},
        {"1 2 3 90", "1 2 x 90"},
        {"1 2 3 90", "1 2 90"},
        {"Frames: 2", "Frames: 999999"},
        {"Frames: 2", "Frames: -1"},
        {"Frames: 2", "Frames: 1e9"},
        {"Time: 0.5", "Time: 0"},
        {"CHANNELS 6", "CHANNELS 7"},
        {"CHANNELS 6", "CHANNELS 5"},
        {"CHANNELS 3 Z", "CHANNELS 3 Q"},
        {"OFFSET 0 -2 0", "OFFSET 0 -2"},
        {" JOINT knee\n {", " JOINT knee\n"},
        {"ROOT hips", "JOINT hips"},
        {"End Site", "End of"},
        {"HIERARCHY", "HIERARCHIE"},
    };
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        char text[1024];
        const char *at = strstr(tiny, bad[i][0]);
        EXPECT_TRUE(at != NULL);
        int n = snprintf(text, sizeof text, "%.*s%s%s", (int)(at - tiny), tiny, bad[i][1], at + strlen(bad[i][0]));
        if (parse(text, (size_t)n, &b) != ERR_INPUT)
            print_error("'%s' was let through\n", bad[i][1]);
        EXPECT_STATUS(parse(text, (size_t)n, &b), ERR_INPUT);
        EXPECT_AT_LEAST(strlen(status_message()), 20);
    }
    // Braces without end, joints without end.
    size_t room = 200000, n = 0;
    char *deep = malloc(room);
    n += (size_t)snprintf(deep, room, "HIERARCHY ROOT a {");
    while (n + 40 < room)
        n += (size_t)snprintf(deep + n, room - n, " JOINT b {");
    EXPECT_STATUS(parse(deep, n, &b), ERR_INPUT);
    free(deep);
}

// A made-up skeleton in centimetres and y up that stands with its arms out and, after a
// second, has turned to its left and lifted its left arm.
static void write_person(const char *path, const char *left_out, double walk_cm)
{
    struct {
        const char *name;
        int depth;
        double x, y, z;
    } joints[] = {
        {"Hips", 0, 0, 0, 0},        {"Spine", 1, 0, 12, 0},        {"Neck", 2, 0, 40, 0},
        {"Head", 3, 0, 12, 2},       {"LeftArm", 2, 18, 36, 0},     {"LeftForeArm", 3, 28, 0, 0},
        {"LeftHand", 4, 26, 0, 0},   {"RightArm", 2, -18, 36, 0},   {"RightForeArm", 3, -28, 0, 0},
        {"RightHand", 4, -26, 0, 0}, {"LeftUpLeg", 1, 9, -6, 0},    {"LeftLeg", 2, 0, -42, 1},
        {"LeftFoot", 3, 0, -42, -1}, {"LeftToeBase", 4, 0, -7, 13}, {"RightUpLeg", 1, -9, -6, 0},
        {"RightLeg", 2, 0, -42, 1},  {"RightFoot", 3, 0, -42, -1},  {"RightToeBase", 4, 0, -7, 13},
    };
    FILE *f = fopen(path, "w");
    EXPECT_TRUE(f != NULL);
    fprintf(f, "HIERARCHY\n");
    int depth = -1;
    for (size_t i = 0; i < COUNT_OF(joints); i++) {
        for (; depth >= joints[i].depth; depth--)
            fprintf(f, "}\n");
        depth = joints[i].depth;
        fprintf(f, "%s %s\n{\nOFFSET %g %g %g\nCHANNELS %s\n", i ? "JOINT" : "ROOT",
                left_out && !strcmp(left_out, joints[i].name) ? "Tail" : joints[i].name, joints[i].x, joints[i].y,
                joints[i].z,
                i ? "3 Zrotation Xrotation Yrotation"
                  : "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation");
    }
    for (; depth >= 0; depth--)
        fprintf(f, "}\n");
    fprintf(f, "MOTION\nFrames: 61\nFrame Time: 0.0166667\n");
    for (int k = 0; k <= 60; k++) {
        for (size_t i = 0; i < COUNT_OF(joints); i++) {
            if (!i)
                fprintf(f, "0 97 %g ", walk_cm * k / 60.0);
            double lift = !strcmp(joints[i].name, "LeftArm") ? 80 * k / 60.0 : 0, turn = !i ? 90 * k / 60.0 : 0;
            fprintf(f, "%g 0 %g ", lift, turn);
        }
        fprintf(f, "\n");
    }
    EXPECT_INT(fclose(f), 0);
}

static void test_bvh_moves_the_figure(void **state)
{
    (void)state;
    char path[] = "/tmp/test_world_XXXXXX.bvh";
    int fd = mkstemps(path, 4);
    EXPECT_TRUE(fd >= 0);
    close(fd);
    write_person(path, NULL, 0);
    struct world_options o = world_default_options();
    EXPECT_TRUE(world_figure_named("man", &o.figure));
    o.motion = path;
    o.plain = true;
    struct world *w;
    EXPECT_STATUS(world_open(&w, &o), OK);
    EXPECT_NEAR(world_seconds(w), 1, 1e-5);
    struct skeleton a = world_joints(w, 0), b = world_joints(w, 1);
    // First facing the sensor, arms out: left is +x. Then turned to the own left, which is +x: left is +y.
    EXPECT_AT_LEAST(a.joint[JOINT_LEFT_HAND].x - a.joint[JOINT_RIGHT_HAND].x, 1.5);
    EXPECT_NEAR(a.joint[JOINT_LEFT_HAND].z, a.joint[JOINT_LEFT_SHOULDER].z, 1e-9);
    EXPECT_AT_LEAST(b.joint[JOINT_LEFT_HIP].y - b.joint[JOINT_RIGHT_HIP].y, 0.15);
    EXPECT_AT_LEAST(b.joint[JOINT_LEFT_HAND].z - b.joint[JOINT_HEAD].z, 0.38);
    for (int side = 0; side < 2; side++) {
        enum joint foot = side ? JOINT_RIGHT_FOOT : JOINT_LEFT_FOOT;
        EXPECT_NEAR(a.joint[foot].z, 0.056 * 1.82, 0.006);
        EXPECT_NEAR(b.joint[foot].z, 0.056 * 1.82, 0.006);
    }
    EXPECT_NEAR(v3_distance(b.joint[JOINT_LEFT_HIP], b.joint[JOINT_LEFT_KNEE]),
                v3_distance(a.joint[JOINT_LEFT_HIP], a.joint[JOINT_LEFT_KNEE]), 1e-9);
    world_close(&w);

    write_person(path, "RightForeArm", 0);
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    EXPECT_TRUE(w == NULL);
    EXPECT_SAYS("right forearm");
    unlink(path);
    EXPECT_STATUS(world_open(&w, &o), ERR_MISSING);
}

// A second's walk of 6 m: by default as much of it as fits, which depends on the figure; on demand all.
static void test_bvh_is_cut_or_whole(void **state)
{
    (void)state;
    char path[] = "/tmp/test_world_XXXXXX.bvh";
    int fd = mkstemps(path, 4);
    EXPECT_TRUE(fd >= 0);
    close(fd);
    write_person(path, NULL, 600);
    struct world_options o = world_default_options();
    o.motion = path;
    double cut, whole;
    EXPECT_STATUS(world_preview_seconds(&o, &cut), OK);
    EXPECT_AT_MOST(cut, 0.7);
    o.whole = true;
    EXPECT_STATUS(world_preview_seconds(&o, &whole), OK);
    EXPECT_NEAR(whole, 1, 0.01);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bvh_gives_positions),
        cmocka_unit_test(test_bvh_refuses_what_is_broken),
        cmocka_unit_test(test_bvh_moves_the_figure),
        cmocka_unit_test(test_bvh_is_cut_or_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
