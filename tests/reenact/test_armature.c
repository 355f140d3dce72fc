// The armature's BVH, read back from its text by forward kinematics of this file's own, in matrices.
#include "tests/support/test.h"

#include "reenact/export/armature.h"
#include "tests/world/world.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES = 60, MAX_BONES = 40, MAX_CHANNELS = 6 };

// ---------------------------------------------------------------- a reader of BVH

struct read_bone {
    char name[40];
    int parent, channels;
    double offset[3];
    char channel[MAX_CHANNELS][16];
};

struct read_file {
    struct read_bone bone[MAX_BONES];
    int count, frames, ends;
    double frame_s;
    char *text, *next;
};

static const char *word(struct read_file *file)
{
    while (isspace((unsigned char)*file->next))
        file->next++;
    char *at = file->next;
    while (*file->next && !isspace((unsigned char)*file->next))
        file->next++;
    if (*file->next)
        *file->next++ = 0;
    return at;
}

static void expect(struct read_file *file, const char *wanted) { assert_string_equal(word(file), wanted); }
static double number(struct read_file *file) { return strtod(word(file), NULL); }

// What stands between a bone's name and its closing brace.
static void read_bone(struct read_file *file, int parent)
{
    const int at = file->count++;
    struct read_bone *bone = &file->bone[at];
    EXPECT_TRUE(at < MAX_BONES);
    snprintf(bone->name, sizeof bone->name, "%s", word(file));
    bone->parent = parent;
    expect(file, "{");
    expect(file, "OFFSET");
    for (int k = 0; k < 3; k++)
        bone->offset[k] = number(file);
    expect(file, "CHANNELS");
    bone->channels = (int)number(file);
    for (int k = 0; k < bone->channels; k++)
        snprintf(bone->channel[k], sizeof bone->channel[k], "%s", word(file));
    for (;;) {
        const char *next = word(file);
        if (!strcmp(next, "}"))
            return;
        if (!strcmp(next, "JOINT")) {
            read_bone(file, at);
            continue;
        }
        assert_string_equal(next, "End");
        expect(file, "Site");
        expect(file, "{");
        expect(file, "OFFSET");
        double length = 0;
        for (int k = 0; k < 3; k++)
            length += fabs(number(file));
        EXPECT_TRUE(length > 0); // a bone without length has no direction in Blender
        expect(file, "}");
        file->ends++;
    }
}

static struct read_file read_hierarchy(char *text)
{
    struct read_file file = {.text = text, .next = text};
    expect(&file, "HIERARCHY");
    expect(&file, "ROOT");
    read_bone(&file, -1);
    expect(&file, "MOTION");
    expect(&file, "Frames:");
    file.frames = (int)number(&file);
    expect(&file, "Frame");
    expect(&file, "Time:");
    file.frame_s = number(&file);
    return file;
}

static void multiply(double a[3][3], double b[3][3], double out[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            out[i][k] = a[i][0] * b[0][k] + a[i][1] * b[1][k] + a[i][2] * b[2][k];
}

// Multiplies by the rotation about an axis, from the right.
static void turn(double m[3][3], int axis, double degrees)
{
    const double angle = degrees * 3.14159265358979323846 / 180, c = cos(angle), s = sin(angle);
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    double r[3][3] = {{0}}, product[3][3];
    r[axis][axis] = 1;
    r[u][u] = r[v][v] = c;
    r[u][v] = -s;
    r[v][u] = s;
    multiply(m, r, product);
    memcpy(m, product, sizeof product);
}

// The next frame's bones, metres.
static void read_frame(struct read_file *file, struct vec3 out[MAX_BONES])
{
    double world[MAX_BONES][3][3], at[MAX_BONES][3];
    for (int b = 0; b < file->count; b++) {
        const struct read_bone *bone = &file->bone[b];
        double local[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, offset[3];
        memcpy(offset, bone->offset, sizeof offset);
        for (int k = 0; k < bone->channels; k++) {
            const double value = number(file);
            const int axis = bone->channel[k][0] - 'X';
            if (!strcmp(bone->channel[k] + 1, "position"))
                offset[axis] += value;
            else
                turn(local, axis, value);
        }
        for (int i = 0; i < 3; i++) {
            at[b][i] = bone->parent < 0 ? offset[i] : at[bone->parent][i];
            for (int k = 0; k < 3 && bone->parent >= 0; k++)
                at[b][i] += world[bone->parent][i][k] * offset[k];
        }
        if (bone->parent < 0)
            memcpy(world[b], local, sizeof local);
        else
            multiply(world[bone->parent], local, world[b]);
        out[b] = v3(0.01 * at[b][0], 0.01 * at[b][1], 0.01 * at[b][2]);
    }
}

static int find(const struct read_file *file, const char *name)
{
    for (int b = 0; b < file->count; b++)
        if (!strcmp(file->bone[b].name, name))
            return b;
    return -1;
}

// ---------------------------------------------------------------- people

// The small world's actor at 10 Hz, y up. gone: joints that are not known.
static struct markers world_markers(const struct world *world, const bool gone[JOINT_COUNT])
{
    struct markers m = {.rate_hz = 10, .count = FRAMES, .at = malloc(FRAMES * sizeof *m.at)};
    assert_non_null(m.at);
    for (int i = 0; i < FRAMES; i++) {
        const struct skeleton s = world_joints(world, i / 10.0);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = s.joint[j];
            const float at[3] = {(float)p.x, (float)p.z, (float)-p.y};
            for (int k = 0; k < 3; k++)
                m.at[i][j][k] = gone && gone[j] ? NAN : at[k];
        }
    }
    return m;
}

static struct world *world;

struct checked {
    double mean_m, max_m;
};

// The file's joints against the markers; the text is freed.
static struct checked check_file(const struct markers *markers, enum armature_naming naming, struct armature_fit *fit)
{
    char *text;
    size_t count;
    FILE *out = open_memstream(&text, &count);
    EXPECT_STATUS(armature_bvh_print(markers, naming, out, fit), OK);
    fclose(out);
    struct read_file file = read_hierarchy(text);
    EXPECT_INT(file.count, ARMATURE_BONES);
    EXPECT_INT(file.frames, markers->count);
    EXPECT_NEAR(file.frame_s, 1 / markers->rate_hz, 1e-6);
    EXPECT_INT(file.ends, 5);
    for (int b = 0; b < file.count; b++) // rotations alone but for the root
        EXPECT_INT(file.bone[b].channels, b ? 3 : 6);
    struct checked off = {0};
    int joints = 0;
    for (int i = 0; i < file.frames; i++) {
        struct vec3 at[MAX_BONES];
        read_frame(&file, at);
        for (int b = 0; b < ARMATURE_BONES; b++) {
            const enum joint j = armature_joint((enum armature_bone)b);
            if (j == JOINT_COUNT || isnan(markers->at[i][j][0]))
                continue;
            const float *p = markers->at[i][j];
            const int in_file = find(&file, armature_bone_name(naming, (enum armature_bone)b));
            EXPECT_AT_LEAST(in_file, 0);
            const double m = v3_distance(at[in_file], v3((double)p[0], (double)p[1], (double)p[2]));
            off.max_m = fmax(off.max_m, m);
            off.mean_m += m;
            joints++;
        }
    }
    off.mean_m /= joints;
    EXPECT_TRUE(!*word(&file)); // nothing after the last frame
    free(text);
    return off;
}

static void test_joints_are_the_takes(void **state)
{
    (void)state;
    struct markers markers = world_markers(world, NULL);
    for (int naming = 0; naming < ARMATURE_NAMINGS; naming++) {
        struct armature_fit fit;
        const struct checked off = check_file(&markers, (enum armature_naming)naming, &fit);
        print_message("joints of the armature: %.2f mm off on average, %.2f at most; it says %.2f and %.2f\n",
                      1e3 * off.mean_m, 1e3 * off.max_m, 1e3 * fit.mean_m, 1e3 * fit.max_m);
        EXPECT_AT_MOST(off.mean_m, 0.003); // measured: 2.2 mm; a raised arm takes its shoulder 22 mm along
        EXPECT_AT_MOST(off.max_m, 0.03);
        EXPECT_NEAR(off.mean_m, fit.mean_m, 1e-4);
        EXPECT_NEAR(off.max_m, fit.max_m, 1e-4);
    }
    markers_free(&markers);
}

// Of a person whose bones do not change, as of another armature, nothing is lost but where the clavicles begin, which
// no joint shows: measured 0.6 mm.
static void test_constant_bones_are_kept(void **state)
{
    (void)state;
    struct markers markers = world_markers(world, NULL);
    struct armature armature;
    struct armature_pose pose = {.known = false};
    struct armature_fit fit;
    EXPECT_STATUS(armature_make(&armature, &markers), OK);
    for (int i = 0; i < FRAMES; i++) {
        struct vec3 at[ARMATURE_BONES];
        const struct armature_parts parts = armature_parts_of(&armature, markers.at[i][0]);
        armature_pose_move(&pose, &armature, &parts, markers.at[i][0]);
        armature_positions(&armature, &pose, at);
        for (int b = 0; b < ARMATURE_BONES; b++)
            for (int k = 0; k < 3 && armature_joint((enum armature_bone)b) < JOINT_COUNT; k++)
                markers.at[i][armature_joint((enum armature_bone)b)][k] = (float)(&at[b].x)[k];
    }
    const struct checked off = check_file(&markers, ARMATURE_HUMANIK, &fit);
    print_message("constant bones: %.3f mm at most\n", 1e3 * off.max_m);
    EXPECT_AT_MOST(off.max_m, 0.002);
    markers_free(&markers);
}

// A T-pose: y up, facing +z, the left arm along +x, both sides alike in trunk and pelvis, the toes ahead.
static void test_rest_is_a_t_pose(void **state)
{
    (void)state;
    struct markers markers = world_markers(world, NULL);
    struct armature a;
    EXPECT_STATUS(armature_make(&a, &markers), OK);
    const struct vec3 *rest = a.rest;
    EXPECT_TRUE(rest[ARMATURE_LEFT_HAND].x > rest[ARMATURE_LEFT_FOREARM].x + 0.15);
    EXPECT_NEAR(rest[ARMATURE_LEFT_HAND].y, rest[ARMATURE_LEFT_UPPER_ARM].y, 1e-9);
    EXPECT_NEAR(rest[ARMATURE_LEFT_HAND].z, rest[ARMATURE_LEFT_UPPER_ARM].z, 1e-9);
    EXPECT_TRUE(rest[ARMATURE_LEFT_UPPER_ARM].x > 0.1);
    EXPECT_NEAR(rest[ARMATURE_LEFT_UPPER_ARM].x, -rest[ARMATURE_RIGHT_UPPER_ARM].x, 1e-9);
    EXPECT_NEAR(rest[ARMATURE_LEFT_FOOT].x, rest[ARMATURE_LEFT_THIGH].x, 1e-9);
    EXPECT_TRUE(rest[ARMATURE_LEFT_TOES].z > rest[ARMATURE_LEFT_FOOT].z + 0.05);
    EXPECT_NEAR(rest[ARMATURE_HEAD].x, 0, 1e-9);
    EXPECT_NEAR(fmin(rest[ARMATURE_LEFT_TOES].y, rest[ARMATURE_RIGHT_TOES].y), 0, 1e-9);
    EXPECT_TRUE(rest[ARMATURE_HEAD].y > 1.3 && rest[ARMATURE_HEAD].y < 1.9);
    markers_free(&markers);
}

// The axial rotation: knees and elbows bend about the axes about which a person in a T-pose bends them.
static void test_hinges_bend_about_their_axes(void **state)
{
    (void)state;
    struct markers markers = world_markers(world, NULL);
    struct armature armature;
    struct armature_pose pose = {.known = false};
    EXPECT_STATUS(armature_make(&armature, &markers), OK);
    const struct {
        enum armature_bone bone;
        struct vec3 axis; // about which a bend is positive
    } hinges[] = {{ARMATURE_LEFT_FOREARM, {0, -1, 0}},
                  {ARMATURE_RIGHT_FOREARM, {0, 1, 0}},
                  {ARMATURE_LEFT_SHIN, {1, 0, 0}},
                  {ARMATURE_RIGHT_SHIN, {1, 0, 0}}};
    int bent = 0;
    for (int i = 0; i < FRAMES; i++) {
        const struct armature_parts parts = armature_parts_of(&armature, markers.at[i][0]);
        armature_pose_move(&pose, &armature, &parts, markers.at[i][0]);
        for (size_t k = 0; k < COUNT_OF(hinges); k++) {
            const struct vec3 r = quat_to_rotation_vector(pose.rotation[hinges[k].bone]);
            if (v3_length(r) < 0.8)
                continue;
            EXPECT_AT_LEAST(v3_dot(v3_unit(r), hinges[k].axis), 0.99);
            bent++;
        }
    }
    print_message("%d hinges bent by more than 46 degrees\n", bent);
    EXPECT_AT_LEAST(bent, 10);
    markers_free(&markers);
}

// A head that is never in the picture has a usual length; a leg that is never seen is named.
static void test_joints_that_are_never_seen(void **state)
{
    (void)state;
    bool gone[JOINT_COUNT] = {[JOINT_HEAD] = true};
    struct markers markers = world_markers(world, gone);
    struct armature_fit fit;
    check_file(&markers, ARMATURE_OURS, &fit);
    markers_free(&markers);
    gone[JOINT_LEFT_FOOT] = true;
    markers = world_markers(world, gone);
    EXPECT_STATUS(armature_bvh_print(&markers, ARMATURE_OURS, NULL, &fit), ERR_INPUT);
    EXPECT_SAYS("left_foot is never seen");
    markers_free(&markers);
}

// What is lost for a while keeps its place in its parent's axes; what is lost at first has that of the first sight.
static void test_joints_that_are_lost_stay(void **state)
{
    (void)state;
    struct markers markers = world_markers(world, NULL);
    struct armature_fit fit;
    char *text;
    size_t count;
    for (int i = 0; i < FRAMES; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            if (i < 5 || (i >= 20 && i < 30))
                markers.at[i][j][0] = markers.at[i][j][1] = markers.at[i][j][2] = NAN;
    FILE *out = open_memstream(&text, &count);
    EXPECT_STATUS(armature_bvh_print(&markers, ARMATURE_OURS, out, &fit), OK);
    fclose(out);
    struct read_file file = read_hierarchy(text);
    struct vec3 at[FRAMES][MAX_BONES];
    for (int i = 0; i < FRAMES; i++)
        read_frame(&file, at[i]);
    for (int b = 0; b < file.count; b++) {
        EXPECT_AT_MOST(v3_distance(at[0][b], at[5][b]), 1e-4);
        EXPECT_AT_MOST(v3_distance(at[29][b], at[19][b]), 1e-4);
    }
    free(text);
    markers_free(&markers);
}

static int set_up(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.plain = true;
    return world_open(&world, &options) == OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    world_close(&world);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_joints_are_the_takes),       cmocka_unit_test(test_constant_bones_are_kept),
        cmocka_unit_test(test_rest_is_a_t_pose),           cmocka_unit_test(test_hinges_bend_about_their_axes),
        cmocka_unit_test(test_joints_that_are_never_seen), cmocka_unit_test(test_joints_that_are_lost_stay),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
