// The two programs from the outside: exit codes, and one sentence for
// each kind of bad input.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "recording/recording.h"
#include "tests/support/answer.h"
#include "tests/support/scratch.h"
#include "tests/support/tag_picture.h"

#include <stdio.h>
#include <string.h>

#define CAPTURE PROGRAM_DIR "/reenact-capture"
#define REENACT PROGRAM_DIR "/reenact"

enum { WIDTH = 64, HEIGHT = 48, FRAMES = 5 };

static struct scratch scratch;

static const char *const calibration_text =
    "{\"color\": {\"width\": 64, \"height\": 48, \"fx\": 52.5, \"fy\": 52.5, \"cx\": 31.5, \"cy\": 23.5,"
    " \"distortion\": [0, 0, 0, 0, 0]},"
    " \"depth\": {\"width\": 64, \"height\": 48, \"fx\": 52.5, \"fy\": 52.5, \"cx\": 31.5, \"cy\": 23.5,"
    " \"distortion\": [0, 0, 0, 0, 0], \"unit_m\": 0.001}, \"registered\": true}";

// A folder with a wall two metres away and no person.
static void make_folder(const char *name, int width, int height)
{
    uint8_t *color = calloc(3, (size_t)width * (size_t)height);
    uint16_t *depth = calloc(sizeof *depth, (size_t)width * (size_t)height);
    char rgb_list[1024] = "", depth_list[1024] = "", path[600];
    for (int i = 0; i < width * height; i++) {
        depth[i] = 2000;
        memset(color + 3 * i, 40 + i % 100, 3);
    }
    snprintf(path, sizeof path, "%s/rgb", name);
    EXPECT_STATUS(folder_make(scratch_file(&scratch, path)), OK);
    snprintf(path, sizeof path, "%s/depth", name);
    EXPECT_STATUS(folder_make(scratch_file(&scratch, path)), OK);
    for (int i = 0; i < FRAMES; i++) {
        snprintf(path, sizeof path, "%s/rgb/%d.png", name, i);
        EXPECT_STATUS(png_write(scratch_file(&scratch, path), PNG_RGB8, color, width, height), OK);
        snprintf(path, sizeof path, "%s/depth/%d.png", name, i);
        EXPECT_STATUS(png_write(scratch_file(&scratch, path), PNG_GRAY16, depth, width, height), OK);
        sprintf(rgb_list + strlen(rgb_list), "%d.%d rgb/%d.png\n", 100 + i / 10, i % 10, i);
        sprintf(depth_list + strlen(depth_list), "%d.%d depth/%d.png\n", 100 + i / 10, i % 10, i);
    }
    snprintf(path, sizeof path, "%s/rgb.txt", name);
    scratch_text(&scratch, path, rgb_list);
    snprintf(path, sizeof path, "%s/depth.txt", name);
    scratch_text(&scratch, path, depth_list);
    snprintf(path, sizeof path, "%s/calibration.json", name);
    scratch_text(&scratch, path, calibration_text);
    free(color);
    free(depth);
}

static const char *uri(const char *name)
{
    static char ring[4][600];
    static int next;
    char *text = ring[next++ % 4];
    snprintf(text, sizeof ring[0], "folder:%s", scratch_file(&scratch, name));
    return text;
}

static void record_into(const char *file)
{
    struct process_result said = PROCESS(CAPTURE, "record", "--sensor", uri("good"), "--out", file, "--take", "one");
    if (said.exit_code)
        print_error("%s", said.err);
    EXPECT_INT(said.exit_code, 0);
}

// And no file left behind.
#define EXPECT_NOTHING_BUT(said, word)                                                                                 \
    do {                                                                                                               \
        EXPECT_SENTENCE(said, word);                                                                                   \
        EXPECT_TRUE(!file_exists(scratch_file(&scratch, "never.reenact")));                                            \
    } while (0)

static void test_help_and_usage(void **state)
{
    (void)state;
    const char *const capture[] = {"devices", "map",    "record",    "info", "verify",  "repair", "export", "library",
                                   "tags",    "studio", "calibrate", "take", "objects", "models", "angles"};
    for (size_t i = 0; i < COUNT_OF(capture); i++) {
        struct process_result said = PROCESS(CAPTURE, capture[i], "--help");
        if (said.exit_code || !strstr(said.out, "Usage"))
            print_error("reenact-capture %s --help: exit code %d: %s\n", capture[i], said.exit_code, said.err);
        EXPECT_INT(said.exit_code, 0);
        EXPECT_TRUE(strstr(said.out, "Usage"));
        EXPECT_INT(PROCESS(CAPTURE, capture[i], "--no-such-option").exit_code, 2);
    }
    const char *const reenact[] = {"render", "locate", "compare", "surround", "drive"};
    for (size_t i = 0; i < COUNT_OF(reenact); i++) {
        EXPECT_INT(PROCESS(REENACT, reenact[i], "--help").exit_code, 0);
        EXPECT_INT(PROCESS(REENACT, reenact[i]).exit_code, 2);
    }
    EXPECT_INT(PROCESS(CAPTURE).exit_code, 2);
    EXPECT_INT(PROCESS(CAPTURE, "nonsense").exit_code, 2);
    EXPECT_TRUE(strstr(PROCESS(CAPTURE, "objects", "list").err, "reenact-capture objects list: FILE is needed"));
    EXPECT_INT(PROCESS(REENACT, "--help").exit_code, 0);
    EXPECT_INT(PROCESS(CAPTURE, "record", "--take", "x").exit_code, 2);
    EXPECT_INT(PROCESS(CAPTURE, "map", "--sensor", "openni", "--out", "a", "--into", "b").exit_code, 2);
    EXPECT_INT(PROCESS(CAPTURE, "map", "--out", "a").exit_code, 2);
    EXPECT_INT(PROCESS(CAPTURE, "map", "--sensor", "openni", "--camera", "libcamera", "--out", "a").exit_code, 2);
    const char *const sizes[] = {"640",      "640x",     "640x480px",       "640x480x3",
                                 "319x480",  "640x8193", "99999999999x480", "-640x480",
                                 "+640x480", " 640x480", "640x+480",        "640x 480"};
    for (size_t i = 0; i < COUNT_OF(sizes); i++)
        EXPECT_INT(PROCESS(REENACT, "film.reenact", "--size", sizes[i]).exit_code, 2);
    // Decimal numbers only, whole ones, and none that is far from every room.
    static const char *const none[] = {"", "0x10", " 3", "+3", "3 ", "nan", "inf", "1e", "1,5", "1.5.2", "--3"};
    for (size_t i = 0; i < COUNT_OF(none); i++) {
        char at[32];
        snprintf(at, sizeof at, "1,%s,0", none[i]);
        EXPECT_INT(
            PROCESS(REENACT, "render", "a", "--take", "b", "--camera", "c", "--out", "d", "--start", none[i]).exit_code,
            2);
        EXPECT_INT(PROCESS(CAPTURE, "objects", "note", "a", "--thing", "b", "--text", "c", "--at", at).exit_code, 2);
    }
    static const char *const places[] = {"1e308,0,0", "0,-100001,0", "1,2", "1,2,3,4", "1,2,", ",,"};
    for (size_t i = 0; i < COUNT_OF(places); i++)
        EXPECT_INT(PROCESS(CAPTURE, "objects", "note", "a", "--thing", "b", "--text", "c", "--at", places[i]).exit_code,
                   2);
    const char *const boards[] = {"9", "9x", "9x6px", "9x6.5", "3x9", "9x-6", "200x200"};
    for (size_t i = 0; i < COUNT_OF(boards); i++)
        EXPECT_INT(PROCESS(CAPTURE, "calibrate", "--lens", uri("good"), "--chequers", boards[i]).exit_code, 2);
}

static void test_empty_room_is_recorded(void **state)
{
    (void)state;
    const char *file = scratch_file(&scratch, "empty.reenact");
    struct process_result said = PROCESS(CAPTURE, "record", "--sensor", uri("good"), "--out", file, "--take", "one");
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.err, "no person"));
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
    said = PROCESS(CAPTURE, "info", "--json", file);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "\"one\""));
    const char *bytes = strstr(said.out, "\"bytes\":\t{");
    double color = 0, depth = 0;
    EXPECT_TRUE(bytes && sscanf(bytes, "\"bytes\": { \"color\": %lf, \"depth\": %lf", &color, &depth) == 2);
    EXPECT_AT_LEAST(color, 1000);
    EXPECT_AT_LEAST(depth, 100);
    EXPECT_INT(PROCESS(CAPTURE, "export", file, "--take", "one", "--as", "joints-csv", "--out",
                       scratch_file(&scratch, "empty.csv"))
                   .exit_code,
               0);
}

// A film that is shorter than its take is no surprise.
static void test_a_film_says_what_it_lacks(void **state)
{
    (void)state;
    const char *file = scratch_file(&scratch, "part.reenact");
    make_folder("part", WIDTH, HEIGHT);
    scratch_text(&scratch, "part/rgb.txt", "100.0 rgb/0.png\n100.1 rgb/1.png\n");
    EXPECT_INT(PROCESS(CAPTURE, "record", "--sensor", uri("part"), "--out", file, "--take", "one").exit_code, 0);
    record_into(scratch_file(&scratch, "whole.reenact"));
    for (int whole = 0; whole < 2; whole++) {
        file = scratch_file(&scratch, whole ? "whole.reenact" : "part.reenact");
        const struct process_result said = PROCESS(CAPTURE, "export", file, "--take", "one", "--as", "mp4", "--out",
                                                   scratch_file(&scratch, whole ? "whole.mp4" : "part.mp4"));
        EXPECT_INT(said.exit_code, 0);
        EXPECT_TRUE((strstr(said.err, "3 of 5 frames have no colour image") == NULL) == whole);
    }
}

// Said before anybody films.
static void test_what_the_studio_films_into(void **state)
{
    (void)state;
    scratch_text(&scratch, "text.reenact", "no recording");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "studio", scratch_file(&scratch, "nowhere/x.reenact")), "nowhere");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "studio", scratch_file(&scratch, "text.reenact")), "not a recording");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "studio", scratch.path), "folder");
}

static void test_bad_sensors(void **state)
{
    (void)state;
    char out[512];
    snprintf(out, sizeof out, "%s", scratch_file(&scratch, "never.reenact"));
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", "nonsense:1", "--out", out, "--take", "x"), "nonsense");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("nowhere"), "--out", out, "--take", "x"), "nowhere");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", "oni:/no/such.oni", "--out", out, "--take", "x"),
                       "such.oni");

    make_folder("uncalibrated", WIDTH, HEIGHT);
    remove(scratch_file(&scratch, "uncalibrated/calibration.json"));
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("uncalibrated"), "--out", out, "--take", "x"),
                       "calibration.json");

    make_folder("no_cx", WIDTH, HEIGHT);
    scratch_text(&scratch, "no_cx/calibration.json",
                 "{\"depth\": {\"width\": 64, \"height\": 48, \"fx\": 52.5, \"fy\": 52.5, \"cy\": 23.5}}");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("no_cx"), "--out", out, "--take", "x"), "cx");

    make_folder("backwards", WIDTH, HEIGHT);
    scratch_text(&scratch, "backwards/calibration.json",
                 "{\"color\": {\"width\": 64, \"height\": 48, \"fx\": 52.5, \"fy\": 52.5, \"cx\": 31.5, \"cy\": 23.5, "
                 "\"readout_ms\": -20}}");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "map", "--sensor", uri("backwards"), "--out", out), "readout_ms");

    make_folder("wrong_size", WIDTH / 2, HEIGHT);
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("wrong_size"), "--out", out, "--take", "x"), "32");

    make_folder("colorless", WIDTH, HEIGHT);
    remove(scratch_file(&scratch, "colorless/rgb.txt"));
    scratch_text(&scratch, "tags.json", "{\"family\": \"tag36h11\", \"side_m\": {\"0\": 0.2}}");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "map", "--sensor", uri("colorless"), "--tags",
                               scratch_file(&scratch, "tags.json"), "--out", out),
                       "colo");

    make_folder("depthless", WIDTH, HEIGHT);
    remove(scratch_file(&scratch, "depthless/depth.txt"));
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("depthless"), "--out", out, "--take", "x"), "depth");
}

// The folder "wall": two tags on a wall, 0.4 m between their centres, filmed by a camera without depth.
static void make_wall(void)
{
    enum { ACROSS = 320, DOWN = 240, PICTURES = 4 };
    static uint8_t rgb[ACROSS * DOWN * 3];
    const struct place_tag tags[] = {
        {.id = 3, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {-0.2, 0, 0}}},
        {.id = 8, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.2, 0, 0}}},
    };
    char list[256] = "", path[600];
    EXPECT_STATUS(folder_make(scratch_file(&scratch, "wall/rgb")), OK);
    for (int i = 0; i < PICTURES; i++) {
        struct tag_picture p = {.lens = tag_picture_lens(ACROSS, DOWN, 300),
                                .tags = tags,
                                .tag_count = 2,
                                .world_from_camera = tag_picture_view(1.2, 0.3 * i - 0.45, 0.1 * i, 0),
                                .noise = 2,
                                .seed = (uint64_t)i,
                                .rgb = rgb};
        EXPECT_TRUE(tag_picture_draw(&p));
        snprintf(path, sizeof path, "wall/rgb/%d.png", i);
        EXPECT_STATUS(png_write(scratch_file(&scratch, path), PNG_RGB8, rgb, ACROSS, DOWN), OK);
        sprintf(list + strlen(list), "100.%d rgb/%d.png\n", i, i);
    }
    scratch_text(&scratch, "wall/rgb.txt", list);
    scratch_text(&scratch, "wall/calibration.json",
                 "{\"color\": {\"width\": 320, \"height\": 240, \"fx\": 300, \"fy\": 300, "
                 "\"cx\": 159.5, \"cy\": 119.5}}");
    scratch_text(&scratch, "pair.json", "{\"family\": \"tag36h11\", \"side_m\": {\"3\": 0.2, \"8\": 0.2}}");
}

static void test_camera_maps_tags(void **state)
{
    (void)state;
    make_wall();
    char file[512];
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "wall.reenact"));
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "map", "--camera", uri("wall"), "--out", file), "tags");
    struct process_result said =
        PROCESS(CAPTURE, "map", "--camera", uri("wall"), "--tags", scratch_file(&scratch, "pair.json"), "--out", file);
    if (said.exit_code)
        print_error("%s", said.err);
    EXPECT_INT(said.exit_code, 0);
    const bool warned = strstr(said.err, "only where it sees a tag") != NULL;
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
    struct recording *r;
    struct place place;
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(recording_read_place(r, &place), OK);
    EXPECT_INT(place.tag_count, 2);
    print_message("%d points\n", (int)place.point_count);
    EXPECT_INT(warned, !place.point_count);
    const double apart =
        v3_distance(place.tags[0].world_from_tag.translation, place.tags[1].world_from_tag.translation);
    print_message("tags %.4f m apart\n", apart);
    EXPECT_NEAR(apart, 0.4, 0.002);
    place_free(&place);
    recording_free(&r);
    said = PROCESS(REENACT, "locate", file, "--camera", uri("wall"), "--force", "--out",
                   scratch_file(&scratch, "wall.txt"));
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "4 of 4"));
    // The same camera with an inaccurate focal length.
    scratch_text(&scratch, "wall/calibration.json",
                 "{\"color\": {\"width\": 320, \"height\": 240, \"fx\": 260, \"fy\": 260, "
                 "\"cx\": 159.5, \"cy\": 119.5, \"focal_sigma\": 0.15}}");
    said = PROCESS(REENACT, "locate", file, "--camera", uri("wall"), "--force", "--out",
                   scratch_file(&scratch, "wall.txt"));
    EXPECT_INT(said.exit_code, 0);
    const char *learnt = strstr(said.out, "learnt from the place: ");
    assert_non_null(learnt);
    EXPECT_NEAR(atof(strchr(learnt, ':') + 1), 300, 3);
    // Not accurate enough to map a place with.
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "map", "--camera", uri("wall"), "--tags", scratch_file(&scratch, "pair.json"),
                               "--out", scratch_file(&scratch, "bent.reenact")),
                       "focal length");
}

static void test_bad_places_and_tags(void **state)
{
    (void)state;
    char out[512];
    snprintf(out, sizeof out, "%s", scratch_file(&scratch, "never.reenact"));
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "map", "--sensor", uri("good"), "--tags", "/no/tags.json", "--out", out),
                       "tags.json");
    scratch_text(&scratch, "broken.json", "{\"family\": ");
    EXPECT_NOTHING_BUT(
        PROCESS(CAPTURE, "map", "--sensor", uri("good"), "--tags", scratch_file(&scratch, "broken.json"), "--out", out),
        "broken.json");
    scratch_text(&scratch, "tags.json", "{\"family\": \"tag36h11\", \"side_m\": {\"0\": 0.2}}");
    EXPECT_NOTHING_BUT(
        PROCESS(CAPTURE, "map", "--sensor", uri("good"), "--tags", scratch_file(&scratch, "tags.json"), "--out", out),
        "tag"); // a blank wall
}

static void test_bad_recordings(void **state)
{
    (void)state;
    char file[512], other[512];
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "good.reenact"));
    snprintf(other, sizeof other, "%s", scratch_file(&scratch, "bad.reenact"));
    record_into(file);
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "export", file, "--take", "two", "--as", "joints-csv", "--out", other), "two");
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "render", file, "--take", "one", "--camera", uri("good"), "--out",
                               scratch_file(&scratch, "pictures")),
                       "place");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "map", "--sensor", uri("good"), "--into", file), "place");
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "locate", file, "--camera", uri("good"), "--out", other), "place");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("good"), "--out", file, "--take", "x"),
                       "good.reenact");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "record", "--sensor", uri("good"), "--into", file, "--take", "one"), "one");
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "info", "/no/such.reenact"), "such.reenact");

    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(file, &bytes, &count), OK);
    scratch_write(&scratch, "bad.reenact", bytes, count / 2); // cut short
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "verify", other), "bad.reenact");
    bytes[60 + 3] = 99; // SQLite's user_version: the schema number
    scratch_write(&scratch, "bad.reenact", bytes, count);
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "info", other), "newer");
    memset(bytes, 0, count);
    scratch_write(&scratch, "bad.reenact", bytes, count);
    EXPECT_NOTHING_BUT(PROCESS(CAPTURE, "info", other), "bad.reenact");
    free(bytes);
    // The good file has not changed.
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    make_folder("good", WIDTH, HEIGHT);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

// A csv file of one person who stands with the left arm raised by `arm` (metres), for two seconds.
static const char *joints_file(const char *name, double arm)
{
    static const char *const row[] = {"head,0,-0.6,3",
                                      "neck,0,-0.4,3",
                                      "torso,0,-0.2,3",
                                      "waist,0,0,3",
                                      "left_shoulder,0.2,-0.4,3",
                                      "right_shoulder,-0.2,-0.4,3",
                                      "right_elbow,-0.2,-0.1,3",
                                      "right_hand,-0.2,0.2,3",
                                      "left_hip,0.1,0,3",
                                      "left_knee,0.1,0.4,3",
                                      "left_foot,0.1,0.8,3",
                                      "right_hip,-0.1,0,3",
                                      "right_knee,-0.1,0.4,3",
                                      "right_foot,-0.1,0.8,3"};
    static char text[65536];
    size_t used = (size_t)sprintf(text, "timestamp,joint,x_m,y_m,z_m,confidence\n");
    for (int i = 0; i < 60; i++) {
        for (size_t k = 0; k < COUNT_OF(row); k++)
            used += (size_t)sprintf(text + used, "%.3f,%s,1\n", i / 30.0, row[k]);
        used += (size_t)sprintf(text + used, "%.3f,left_elbow,0.45,%.3f,3,1\n%.3f,left_hand,0.7,%.3f,3,1\n", i / 30.0,
                                -0.4 - arm, i / 30.0, -0.4 - 2 * arm);
    }
    scratch_text(&scratch, name, text);
    return scratch_file(&scratch, name);
}

static void test_compare(void **state)
{
    (void)state;
    const char *low = joints_file("low.csv", 0), *high = joints_file("high.csv", 0.25);
    struct process_result said = PROCESS(REENACT, "compare", low, "--with", low);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "score 100"));
    const char *page = scratch_file(&scratch, "page.html"), *table = scratch_file(&scratch, "angles.csv");
    said = PROCESS(REENACT, "compare", low, "--with", high, "--html", page, "--csv", table);
    EXPECT_INT(said.exit_code, 0);
    if (!strstr(said.out, "Left upper arm 45° higher"))
        print_error("%s\n", said.out);
    EXPECT_TRUE(strstr(said.out, "Left upper arm 45° higher"));
    said = PROCESS(REENACT, "compare", low, "--with", high, "--json");
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "\"score\""));
    EXPECT_TRUE(file_exists(page) && file_exists(table));
    // What exists, and what is compared, is not written over.
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "compare", low, "--with", high, "--html", page), "--force");
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "compare", low, "--with", high, "--csv", low, "--force"), "another name");
    EXPECT_INT(PROCESS(REENACT, "compare", low, "--with", high, "--html", page, "--force").exit_code, 0);
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "compare", low, "--with", "nowhere.csv"), "nowhere.csv");
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "compare", low, "--with", high, "--with-take", "x"), "no takes");
    scratch_text(&scratch, "notes.txt", "hello\n");
    EXPECT_NOTHING_BUT(PROCESS(REENACT, "compare", low, "--with", scratch_file(&scratch, "notes.txt")), "notes.txt");
    EXPECT_INT(PROCESS(REENACT, "compare", low).exit_code, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_compare),
        cmocka_unit_test(test_help_and_usage),
        cmocka_unit_test(test_empty_room_is_recorded),
        cmocka_unit_test(test_bad_sensors),
        cmocka_unit_test(test_a_film_says_what_it_lacks),
        cmocka_unit_test(test_what_the_studio_films_into),
        cmocka_unit_test(test_camera_maps_tags),
        cmocka_unit_test(test_bad_places_and_tags),
        cmocka_unit_test(test_bad_recordings),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
