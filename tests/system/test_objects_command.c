// reenact-capture objects and its serve, as a user runs them, on a made-up desk.
#include "tests/support/test.h"

#include "capture/calibration/stereo_rig.h"
#include "objects/thing_knowledge.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "recording/recorded_things.h"
#include "tests/support/desk.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <stdio.h>

enum { SEED = 33, PIXELS = 640 * 480 };

static const char program[] = PROGRAM_DIR "/reenact-capture";
static struct desk desk;
static struct scratch scratch;
static char pairs[256], rig[256], objects[256], out[256], recording[256], folder[256];

static void path(char to[256], const char *name) { snprintf(to, 256, "%s", scratch_file(&scratch, name)); }

static void write_desk(void)
{
    static uint8_t rgb[PIXELS * 3];
    const struct pose world_from_left = {{0, 0, 0, 1}, {0.05, 0, -0.15}};
    char text[4096] = "{\"objects\": [", one[512], name[64];
    assert_true(desk_make(&desk, SEED));
    for (int side = 0; side < 2; side++) {
        const struct pose p = side ? pose_multiply(world_from_left, desk.rig.left_from_right) : world_from_left;
        desk_film(&desk, side ? &desk.rig.right : &desk.rig.left, &p, 2, SEED + 1 + (uint64_t)side, rgb);
        EXPECT_STATUS(png_write(scratch_file(&scratch, side ? "right.png" : "left.png"), PNG_RGB8, rgb, 640, 480), OK);
    }
    scratch_text(&scratch, "pairs.txt", "# one pair\n7.5 0.05 0 -0.15 0 0 0 1 left.png right.png\n");
    for (int i = 0; i < 4; i++) {
        const struct thing *t = &desk.storage[i];
        snprintf(name, sizeof name, "%.20s.png", t->name);
        EXPECT_STATUS(
            png_write(scratch_file(&scratch, name), PNG_RGB8, t->picture.rgb, t->picture.width, t->picture.height), OK);
        snprintf(one, sizeof one,
                 "%s{\"name\": \"%s\", \"picture\": \"%s\", \"width_m\": %g, \"height_m\": %g, \"url\": \"things/%s\"}",
                 i ? ", " : "", t->name, name, t->width_m, t->height_m, t->name);
        strcat(text, one);
    }
    strcat(text, "]}");
    scratch_text(&scratch, "objects.json", text);
    char *printed = stereo_rig_print(&desk.rig);
    scratch_text(&scratch, "rig.json", printed);
    free(printed);
}

static void test_found_and_written(void **state)
{
    (void)state;
    struct json *root;
    double x;
    struct process_result r =
        PROCESS(program, "objects", "--stereo", pairs, "--rig", rig, "--objects", objects, "--out", out);
    if (r.exit_code)
        print_error("%s\n", r.err);
    EXPECT_INT(r.exit_code, 0);
    EXPECT_STATUS(json_read(out, &root), OK);
    const struct json *things = json_member(json_at(json_member(root, "pairs"), 0), "things");
    EXPECT_INT(json_count(things), 4);
    EXPECT_INT(json_count(json_member(root, "map")), 4);
    for (int i = 0; i < json_count(things); i++) {
        EXPECT_TRUE(json_get_number(json_member(json_at(things, i), "x_m"), &x));
        EXPECT_NEAR(x, desk.world_from_thing[i].translation.x - 0.05, 0.003);
    }
    json_free(&root);
    r = PROCESS(program, "objects", "--stereo", pairs, "--rig", rig, "--objects", objects, "--out", out);
    EXPECT_INT(r.exit_code, 1); // exists
    r = PROCESS(program, "objects", "--stereo", pairs, "--rig", rig);
    EXPECT_INT(r.exit_code, 2);
}

static void test_kept_in_a_recording_without_a_server(void **state)
{
    (void)state;
    struct recording_writer *w;
    struct recording *opened;
    struct recorded_thing *things;
    int count;
    EXPECT_STATUS(recording_create(&w, recording), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    struct process_result r = PROCESS(program, "objects", "--stereo", pairs, "--rig", rig, "--objects", objects,
                                      "--into", recording, "--knowledge", "http://127.0.0.1:9/");
    EXPECT_INT(r.exit_code, 0);
    EXPECT_TRUE(strstr(r.err, "nothing new is known") != NULL);
    EXPECT_STATUS(recording_open(&opened, recording), OK);
    EXPECT_STATUS(recording_read_things(opened, &things, &count), OK);
    EXPECT_INT(count, 4);
    for (int i = 0; i < count; i++) {
        const struct vec3 at = things[i].world_from_thing.translation;
        EXPECT_AT_MOST(v3_distance(at, desk.world_from_thing[i].translation), 0.005);
        EXPECT_AT_LEAST(things[i].covariance.zz, 1e-9);
    }
    recorded_things_free(&things, count);
    recording_free(&opened);
    EXPECT_INT(PROCESS(program, "verify", recording).exit_code, 0);
    EXPECT_INT(PROCESS(program, "objects", "note", recording, "--thing", "there-1", "--text", "fragile").exit_code, 0);
    EXPECT_INT(PROCESS(program, "objects", "note", recording, "--thing", "bokken", "--text", "x").exit_code, 1);
    EXPECT_INT(PROCESS(program, "objects", "note", recording, "--thing", "bokken", "--text", "oak", "--at", "1,2,0.5")
                   .exit_code,
               0);
    r = PROCESS(program, "objects", "note", recording, "--thing", "there-1", "--text", "\x1b[2J");
    EXPECT_INT(r.exit_code, 1);
    EXPECT_TRUE(strstr(r.err, "without control characters"));
    r = PROCESS(program, "objects", "list", recording);
    EXPECT_INT(r.exit_code, 0);
    EXPECT_TRUE(strstr(r.out, "note: fragile") && strstr(r.out, "bokken at 1.000 2.000 0.500 m") &&
                strstr(r.out, "oak"));
    // another run keeps what was written by hand
    r = PROCESS(program, "objects", "--stereo", pairs, "--rig", rig, "--objects", objects, "--into", recording);
    EXPECT_INT(r.exit_code, 0);
    r = PROCESS(program, "objects", "list", recording, "--json");
    EXPECT_TRUE(strstr(r.out, "fragile") && strstr(r.out, "oak"));
}

static void test_names_that_a_terminal_would_obey(void **state)
{
    (void)state;
    static const char *const bad[] = {"{\"name\": \"a\\u009b2J\", \"picture\": \"a.png\"}",
                                      "{\"name\": \"a\", \"picture\": \"a.png\", \"url\": \"http://a/\xff\"}"};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        char text[200];
        snprintf(text, sizeof text, "{\"objects\": [%s]}", bad[i]);
        scratch_text(&scratch, "bad.json", text);
        const struct process_result r = PROCESS(program, "objects", "--stereo", pairs, "--rig", rig, "--objects",
                                                scratch_file(&scratch, "bad.json"), "--out", out, "--force");
        EXPECT_INT(r.exit_code, 1);
        print_message("%s", r.err);
        EXPECT_TRUE(strstr(r.err, "not UTF-8 or holds control characters"));
    }
}

static void test_a_knowledge_base_is_written(void **state)
{
    (void)state;
    uint8_t *text;
    size_t count;
    struct thing_knowledge k;
    char file[512];
    scratch_text(&scratch, "there-0.txt", "A box of nothing.\n");
    EXPECT_INT(PROCESS(program, "objects", "serve", folder, "--objects", objects).exit_code, 0);
    snprintf(file, sizeof file, "%s/things/there-0", folder);
    EXPECT_STATUS(file_read(file, &text, &count), OK);
    EXPECT_STATUS(thing_knowledge_parse((char *)text, count, "http://kb.example/things/there-0", &k), OK);
    assert_string_equal(k.name, "there-0");
    assert_string_equal(k.description, "A box of nothing.");
    if (http_available())
        assert_string_equal(k.image, "http://kb.example/things/there-0.png");
    free(text);
    strcat(file, ".png");
    EXPECT_TRUE(file_exists(file));
    EXPECT_INT(PROCESS(program, "objects", "serve", folder, "--objects", objects).exit_code, 1); // exists
    EXPECT_INT(PROCESS(program, "objects", "serve", folder, "--objects", objects, "--force").exit_code, 0);
    // a url that leads out of the folder
    scratch_text(&scratch, "bad.json",
                 "{\"objects\": [{\"name\": \"x\", \"picture\": \"there-0.png\", \"width_m\": 0.1, \"height_m\": 0.1, "
                 "\"url\": \"../../etc/x\"}]}");
    EXPECT_INT(PROCESS(program, "objects", "serve", folder, "--objects", scratch_file(&scratch, "bad.json")).exit_code,
               1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_found_and_written),
        cmocka_unit_test(test_kept_in_a_recording_without_a_server),
        cmocka_unit_test(test_names_that_a_terminal_would_obey),
        cmocka_unit_test(test_a_knowledge_base_is_written),
    };
    scratch = scratch_make();
    path(pairs, "pairs.txt");
    path(rig, "rig.json");
    path(objects, "objects.json");
    path(out, "found.json");
    path(recording, "gym.reenact");
    path(folder, "base");
    write_desk();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    desk_free(&desk);
    scratch_remove(&scratch);
    return failed;
}
