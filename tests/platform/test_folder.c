// A folder of images as a source: the round trip, pairing of colour and depth by
// time, and an error sentence that names the file for each kind of fault. All
// images are made here.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"
#include "platform/sensors/source_internal.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { W = 32, H = 24 };

struct folder_case { // a folder for one test
    struct scratch scratch;
    char uri[256];
    uint8_t rgb[W * H * 3];
    uint16_t mm[W * H];
};

static const char calibration[] =
    "{ \"color\": {\"width\": 32, \"height\": 24, \"fx\": 26.5, \"fy\": 26.25, \"cx\": 15.5, \"cy\": 11.5,"
    " \"distortion\": [-0.05, 0.015, 0.0005, -0.0004, 0.001], \"readout_ms\": 16.5, \"maker\": \"x\"},"
    " \"depth\": {\"width\": 32, \"height\": 24, \"fx\": 28, \"fy\": 28, \"cx\": 16, \"cy\": 12, \"unit_m\": 0.001},"
    " \"registered\": true, \"pixel_origin\": \"centre\" }";

static void put_depth(struct folder_case *test, const char *name, int seed)
{
    struct rng rng = {(uint64_t)seed};
    for (int i = 0; i < W * H; i++)
        test->mm[i] = i % 7 ? (uint16_t)(rng_uniform(&rng) * 65535) : 0;
    const char *path = scratch_file(&test->scratch, name);
    assert_int_equal(png_write(path, PNG_GRAY16, test->mm, W, H), OK);
}

static void put_color(struct folder_case *test, const char *name, int seed)
{
    struct rng rng = {(uint64_t)seed + 1000};
    for (int i = 0; i < W * H * 3; i++)
        test->rgb[i] = (uint8_t)(rng_uniform(&rng) * 256);
    const char *path = scratch_file(&test->scratch, name);
    if (strstr(name, ".png")) {
        assert_int_equal(png_write(path, PNG_RGB8, test->rgb, W, H), OK);
        return;
    }
    uint8_t *bytes;
    size_t count;
    assert_int_equal(jpeg_encode(test->rgb, W, H, 90, &bytes, &count), OK);
    assert_int_equal(file_write(path, bytes, count), OK);
    free(bytes);
}

static int make_case(void **state)
{
    struct folder_case *test = calloc(1, sizeof *test);
    test->scratch = scratch_make();
    snprintf(test->uri, sizeof test->uri, "folder:%s", test->scratch.path);
    const char *const below[] = {"rgb", "depth"};
    for (size_t i = 0; i < COUNT_OF(below); i++) {
        const char *path = scratch_file(&test->scratch, below[i]);
        if (folder_make(path) != OK)
            return -1;
    }
    scratch_text(&test->scratch, "calibration.json", calibration);
    *state = test;
    return 0;
}

static int clear_case(void **state)
{
    struct folder_case *test = *state;
    scratch_remove(&test->scratch);
    free(test);
    return 0;
}

static struct source *open_as(const struct folder_case *test, enum source_wanted wanted)
{
    struct source *s;
    EXPECT_STATUS(source_open(&s, test->uri, wanted), OK);
    return s;
}

static void expect_refused(const struct folder_case *test, enum source_wanted wanted, enum status status,
                           const char *part)
{
    struct source *s = (struct source *)8;
    EXPECT_STATUS(source_open(&s, test->uri, wanted), status);
    assert_null(s);
    EXPECT_SAYS(part);
}

// ------------------------------------------------------------- reading

static void test_round_trip(void **state)
{
    struct folder_case *test = *state;
    scratch_text(&test->scratch, "rgb.txt",
                 "# color images\r\n# timestamp filename\n\n 1305031102.175304 rgb/first one.png \n"
                 "1305031102.2086379999\trgb/0001.jpg\n");
    scratch_text(&test->scratch, "depth.txt", "1305031102.175304 depth/7.png\n1305031102.2086375001 ./depth/8.b.png");
    put_color(test, "rgb/first one.png", 1);
    put_color(test, "rgb/0001.jpg", 2);
    put_depth(test, "depth/7.png", 3);
    put_depth(test, "depth/8.b.png", 4);
    struct source *s = open_as(test, SOURCE_SENSOR);
    assert_false(source_is_live(s));
    EXPECT_INT(source_remaining(s), 2);
    EXPECT_INT(source_dropped(s), 0);
    const struct calibration *c = source_calibration(s);
    EXPECT_INT(c->color.width, W);
    EXPECT_NEAR(c->color.fy, 26.25, 0);
    EXPECT_NEAR(c->color.k1, -0.05, 0);
    EXPECT_NEAR(c->color.p2, -0.0004, 0);
    EXPECT_NEAR(c->color.k3, 0.001, 0);
    EXPECT_NEAR(c->depth.cx, 16, 0);
    EXPECT_NEAR(c->color.readout_s, 0.0165, 1e-15);
    EXPECT_NEAR(c->depth.readout_s, 0, 0);
    EXPECT_NEAR(c->depth.k1, 0, 0);
    assert_true(c->registered);
    EXPECT_NEAR(c->color_from_depth.rotation.w, 1, 0);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, 1305031102175304000);
    assert_string_equal(f.name, "7");
    put_color(test, "again.png", 1);
    assert_memory_equal(f.color, test->rgb, sizeof test->rgb);
    assert_null(f.jpeg);
    put_depth(test, "again.png", 3);
    assert_memory_equal(f.depth, test->mm, sizeof test->mm);
    EXPECT_INT(source_remaining(s), 1);
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, 1305031102208637500); // exact to the nanosecond; a double would resolve 238 ns
    assert_string_equal(f.name, "8.b");
    uint8_t *bytes, decoded[W * H * 3];
    size_t count;
    const char *path = scratch_file(&test->scratch, "rgb/0001.jpg");
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    EXPECT_INT(f.jpeg_bytes, count);
    assert_memory_equal(f.jpeg, bytes, count);
    EXPECT_STATUS(jpeg_decode(bytes, count, decoded, W, H), OK);
    assert_memory_equal(f.color, decoded, sizeof decoded);
    free(bytes);
    EXPECT_STATUS(source_next(s, &f), NOTHING);
    assert_null(f.color);
    EXPECT_STATUS(source_next(s, &f), NOTHING);
    EXPECT_INT(source_remaining(s), 0);
    source_close(&s);
    assert_null(s);
    source_close(&s);
}

static void test_camera_needs_no_depth(void **state)
{
    struct folder_case *test = *state;
    scratch_text(&test->scratch, "rgb.txt", "-0.5 rgb/0007.png\n0 rgb/0008.png\n");
    put_color(test, "rgb/0007.png", 7);
    put_color(test, "rgb/0008.png", 8);
    struct source *s = open_as(test, SOURCE_CAMERA);
    EXPECT_INT(source_calibration(s)->depth.width, 0);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, -500000000);
    assert_string_equal(f.name, "0007");
    assert_null(f.depth);
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, 0);
    source_close(&s);
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "depth.txt");
}

static void test_sensor_needs_no_color(void **state)
{
    struct folder_case *test = *state;
    scratch_text(&test->scratch, "depth.txt",
                 "5 depth/a-name-that-is-longer-than-a-frame-can-hold.png\n5.1 depth/b.png\n");
    put_depth(test, "depth/a-name-that-is-longer-than-a-frame-can-hold.png", 1);
    put_depth(test, "depth/b.png", 2);
    struct source *s = open_as(test, SOURCE_SENSOR);
    EXPECT_INT(source_calibration(s)->color.width, 0);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_null(f.color);
    assert_non_null(f.depth);
    assert_string_equal(f.name, "0000");
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_string_equal(f.name, "0001"); // one name is too long, so all frames are numbered
    source_close(&s);
    expect_refused(test, SOURCE_CAMERA, ERR_MISSING, "rgb.txt");
}

static void test_another_unit_becomes_millimetres(void **state)
{
    struct folder_case *test = *state;
    char text[256];
    // TUM's own unit: 5000 to the metre.
    snprintf(text, sizeof text,
             "{\"depth\": {\"width\": 32, \"height\": 24, \"fx\": 28, \"fy\": 28, \"cx\": 16, "
             "\"cy\": 12, \"unit_m\": 0.0002}}");
    scratch_text(&test->scratch, "calibration.json", text);
    scratch_text(&test->scratch, "depth.txt", "1 depth/a.png\n");
    put_depth(test, "depth/a.png", 5);
    struct source *s = open_as(test, SOURCE_SENSOR);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    int zeros = 0;
    for (int i = 0; i < W * H; i++) {
        EXPECT_INT(f.depth[i], (test->mm[i] + 2) / 5);
        zeros += !test->mm[i];
    }
    EXPECT_AT_LEAST(zeros, W * H / 7);
    source_close(&s);
    // What does not fit into 16 bits of millimetres becomes 0.
    snprintf(text, sizeof text,
             "{\"depth\": {\"width\": 32, \"height\": 24, \"fx\": 28, \"fy\": 28, \"cx\": 16, "
             "\"cy\": 12, \"unit_m\": 0.01}}");
    scratch_text(&test->scratch, "calibration.json", text);
    s = open_as(test, SOURCE_SENSOR);
    EXPECT_STATUS(source_next(s, &f), OK);
    for (int i = 0; i < W * H; i++)
        EXPECT_INT(f.depth[i], test->mm[i] <= 6553 ? test->mm[i] * 10 : 0);
    source_close(&s);
}

// As OpenCV's users write what a Kinect could not measure.
static void test_saturated_depth_is_no_reading(void **state)
{
    struct folder_case *test = *state;
    scratch_text(&test->scratch, "depth.txt", "1 depth/a.png\n");
    for (int i = 0; i < W * H; i++)
        test->mm[i] = i % 3 ? 65535 : 65534;
    EXPECT_STATUS(png_write(scratch_file(&test->scratch, "depth/a.png"), PNG_GRAY16, test->mm, W, H), OK);
    struct source *s = open_as(test, SOURCE_SENSOR);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    for (int i = 0; i < W * H; i++)
        EXPECT_INT(f.depth[i], i % 3 ? 0 : 65534);
    source_close(&s);
}

// ------------------------------------------------------------- pairs

// Reads all frames; writes "name+" for one with colour, "name-" for one without.
static void expect_pairs(const struct folder_case *test, const char *wanted)
{
    char got[256] = "";
    struct source *s = open_as(test, SOURCE_SENSOR);
    struct frame f;
    while (source_next(s, &f) == OK) {
        size_t n = strlen(got);
        snprintf(got + n, sizeof got - n, "%s%c ", f.name, f.color ? '+' : '-');
    }
    source_close(&s);
    assert_string_equal(got, wanted);
}

static void test_pairs_by_time(void **state)
{
    struct folder_case *test = *state;
    const char *const names[] = {"a", "b", "c", "d", "e"};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        char name[32];
        snprintf(name, sizeof name, "depth/%s.png", names[i]);
        put_depth(test, name, (int)i);
    }
    put_color(test, "rgb/x.png", 1);
    scratch_text(&test->scratch, "depth.txt",
                 "1.0 depth/a.png\n1.1 depth/b.png\n1.2 depth/c.png\n1.3 depth/d.png\n1.4 depth/e.png\n");
    // Exactly half a frame apart is a pair, a microsecond more is not.
    scratch_text(&test->scratch, "rgb.txt", "1.05 rgb/x.png\n1.149999 rgb/x.png\n1.350001 rgb/x.png\n");
    expect_pairs(test, "a+ b+ c- d- e+ ");
    // A late colour image is paired with the nearer of two depth images, and only once.
    scratch_text(&test->scratch, "rgb.txt", "1.04 rgb/x.png\n1.24 rgb/x.png\n1.26 rgb/x.png\n");
    expect_pairs(test, "a+ b- c+ d+ e- ");
    // Colour at twice the rate: the nearest is taken.
    scratch_text(&test->scratch, "rgb.txt", "0.96 rgb/y.png\n1.01 rgb/x.png\n1.06 rgb/y.png\n1.11 rgb/x.png\n");
    expect_pairs(test, "a+ b+ c- d- e- ");
    // Between the depth images, out of step.
    scratch_text(&test->scratch, "rgb.txt", "0.94 rgb/y.png\n1.46 rgb/y.png\n");
    expect_pairs(test, "a- b- c- d- e- ");
    // Colour from another day.
    scratch_text(&test->scratch, "rgb.txt", "100 rgb/y.png\n101 rgb/y.png\n");
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "colour begins 99.000 s after depth");
    // A gap in the depth does not widen what counts as half a frame.
    scratch_text(&test->scratch, "depth.txt", "1.0 depth/a.png\n1.1 depth/b.png\n1.2 depth/c.png\n9 depth/d.png\n");
    scratch_text(&test->scratch, "rgb.txt", "1.0 rgb/x.png\n1.1 rgb/x.png\n1.2 rgb/x.png\n8.9 rgb/x.png\n");
    expect_pairs(test, "a+ b+ c+ d- ");
}

// A list of twenty images at 10 Hz by a clock that is ahead and counts faster.
static void list_images(const struct folder_case *test, const char *list, const char *path, double ahead_s, double rate)
{
    char text[1024] = "";
    for (int i = 0; i < 20; i++) {
        const size_t n = strlen(text);
        snprintf(text + n, sizeof text - n, "%.6f %s\n", rate * (5 + 0.1 * i) + ahead_s, path);
    }
    scratch_text(&test->scratch, list, text);
}

static void test_two_clocks_are_named(void **state)
{
    struct folder_case *test = *state;
    char said[STREAM_CLOCKS_TEXT_BYTES];
    put_color(test, "rgb/x.png", 1);
    put_depth(test, "depth/a.png", 1);
    list_images(test, "depth.txt", "depth/a.png", 0, 1);
    list_images(test, "rgb.txt", "rgb/x.png", 3.2, 1);
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "colour's clock is 3.200 s ahead of depth's");
    list_images(test, "rgb.txt", "rgb/x.png", 0, 1000);
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "rgb.txt are in a unit 1000 times as small");
    // Some meet by chance: they are paired, and it is said.
    list_images(test, "rgb.txt", "rgb/x.png", -1, 1);
    struct source *s = open_as(test, SOURCE_SENSOR);
    printf("%s\n", source_clocks(s, said));
    EXPECT_TRUE(strstr(said, "colour's clock is 1.000 s behind depth's") != NULL);
    source_close(&s);
    list_images(test, "rgb.txt", "rgb/x.png", 0.04, 1);
    s = open_as(test, SOURCE_SENSOR);
    EXPECT_TRUE(!*source_clocks(s, said));
    source_close(&s);
}

// ------------------------------------------------------------- errors

static void put_three_frames(struct folder_case *test)
{
    scratch_text(&test->scratch, "rgb.txt", "1 rgb/1.jpg\n1.1 rgb/2.jpg\n1.2 rgb/3.jpg\n");
    scratch_text(&test->scratch, "depth.txt", "1 depth/1.png\n1.1 depth/2.png\n1.2 depth/3.png\n");
    for (int i = 1; i <= 3; i++) {
        char name[32];
        snprintf(name, sizeof name, "rgb/%d.jpg", i);
        put_color(test, name, i);
        snprintf(name, sizeof name, "depth/%d.png", i);
        put_depth(test, name, i);
    }
}

static void remove_file(const struct folder_case *test, const char *name)
{
    const char *path = scratch_file(&test->scratch, name);
    assert_int_equal(unlink(path), 0);
}

static void test_missing_sources(void **state)
{
    struct folder_case *test = *state;
    struct source *s;
    EXPECT_STATUS(source_open(&s, "folder:/nowhere/at/all", SOURCE_SENSOR), ERR_MISSING);
    EXPECT_SAYS("/nowhere/at/all");
    const char *const bad[] = {"folder", "folder:", "folders:x", "", ":", "Folder:x", "kinect", "oni", "oni:"};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        EXPECT_STATUS(source_open(&s, bad[i], SOURCE_SENSOR), ERR_INPUT);
        assert_null(s);
    }
    EXPECT_STATUS(source_open(&s, "openni", SOURCE_CAMERA), ERR_INPUT);
    EXPECT_SAYS("libcamera");
    EXPECT_STATUS(source_open(&s, "libcamera:0", SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("openni");
    expect_refused(test, SOURCE_SENSOR, ERR_MISSING, "neither rgb.txt nor depth.txt");
    put_three_frames(test);
    remove_file(test, "calibration.json");
    expect_refused(test, SOURCE_SENSOR, ERR_MISSING, "calibration.json");
}

static void test_bad_calibration(void **state)
{
    struct folder_case *test = *state;
    put_three_frames(test);
    static const struct {
        const char *from, *to, *says;
    } cases[] = {
        {"\"fy\": 26.25", "\"fz\": 1", "'color.fy' is missing"},
        {"\"cx\": 16", "\"cx\": \"16\"", "'depth.cx' is not a number"},
        {"\"width\": 32", "\"width\": 32.5", "'color.width'"},
        {"\"height\": 24", "\"height\": 0", "'color.height'"},
        {"\"fx\": 28", "\"fx\": -28", "depth"},
        {"-0.05, 0.015, 0.0005,", "", "'color.distortion'"},
        {"-0.05", "null", "'color.distortion'"},
        {"0.001}", "0}", "unit_m"},
        {"true", "1", "'registered'"},
        {"\"registered\": true", "\"registered\": false", "color_from_depth"},
        {"true,", "true", "calibration.json"},
        {"16.5", "-1", "readout_ms must be from 0 (no rolling shutter) to 200, not -1"},
        {"16.5", "1e9", "readout_ms must be from 0 (no rolling shutter) to 200, not 1e+09"},
        {"16.5", "1e999", "'color.readout_ms' must be a number"},
        {"16.5", "\"16\"", "'color.readout_ms' must be a number"},
        {"16.5", "NaN", "calibration.json"},
        {"\"depth\"", "\"death\"", "'depth' is missing"},
        {"\"color\"", "\"colour\"", "'color' is missing"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        char text[sizeof calibration + 64];
        const char *at = strstr(calibration, cases[i].from);
        assert_non_null(at);
        snprintf(text, sizeof text, "%.*s%s%s", (int)(at - calibration), calibration, cases[i].to,
                 at + strlen(cases[i].from));
        scratch_text(&test->scratch, "calibration.json", text);
        expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "calibration.json");
        EXPECT_SAYS(cases[i].says);
    }
}

static void test_two_cameras_apart(void **state)
{
    struct folder_case *test = *state;
    put_three_frames(test);
    char text[sizeof calibration + 200];
    const char *at = strstr(calibration, "true");
    snprintf(
        text, sizeof text,
        "%.*sfalse, \"color_from_depth\": {\"translation_m\": [0.025, 0, -0.001], \"rotation\": [0, 0.6, 0, 0.8]}}",
        (int)(at - calibration), calibration);
    scratch_text(&test->scratch, "calibration.json", text);
    struct source *s = open_as(test, SOURCE_SENSOR);
    const struct calibration *c = source_calibration(s);
    assert_false(c->registered);
    EXPECT_NEAR(c->color_from_depth.translation.x, 0.025, 0);
    EXPECT_NEAR(c->color_from_depth.translation.z, -0.001, 0);
    EXPECT_NEAR(c->color_from_depth.rotation.y, 0.6, 1e-15);
    source_close(&s);
    *strstr(text, "0.6") = '3';
    scratch_text(&test->scratch, "calibration.json", text);
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "rotation");
}

static void test_bad_lists(void **state)
{
    struct folder_case *test = *state;
    put_three_frames(test);
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"", "lists no picture"},
        {"# nothing\n\n", "lists no picture"},
        {"1 depth/1.png\nx depth/2.png\n", "line 2"},
        {"1 depth/1.png\n1.1\n", "line 2"},
        {"1e3 depth/1.png\n", "line 1"},
        {"nan depth/1.png\n", "line 1"},
        {"99999999999 depth/1.png\n", "line 1"},
        {"-8000000000 depth/1.png\n8000000000 depth/2.png\n", "line 1"}, // too far apart for nanoseconds in 64 bits
        {". depth/1.png\n", "line 1"},
        {"100 depth/1.png\n100.1 depth/2.png\n5 depth/3.png\n", "line 3: the clock jumps back by 95.100 s"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        scratch_text(&test->scratch, "depth.txt", cases[i].text);
        expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "depth.txt");
        EXPECT_SAYS(cases[i].says);
    }
    const char *path = scratch_file(&test->scratch, "depth.txt");
    EXPECT_STATUS(file_write(path, "1 a\0b\n", 6), OK);
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "depth.txt is not a text file");
}

static void test_non_increasing_times_are_dropped(void **state)
{
    struct folder_case *test = *state;
    put_three_frames(test);
    scratch_text(&test->scratch, "depth.txt", "1 depth/1.png\n1 depth/2.png\n0.9 depth/2.png\n1.2 depth/3.png\n");
    struct source *s = open_as(test, SOURCE_SENSOR);
    EXPECT_INT(source_dropped(s), 2);
    EXPECT_INT(source_remaining(s), 2);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_string_equal(f.name, "1");
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_string_equal(f.name, "3");
    EXPECT_STATUS(source_next(s, &f), NOTHING);
    source_close(&s);
}

// The second of three frames fails with a sentence that names `file`; the others are read.
static void expect_second_fails(const struct folder_case *test, const char *file, const char *why)
{
    struct source *s = open_as(test, SOURCE_SENSOR);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_STATUS(source_next(s, &f), ERR_INPUT);
    EXPECT_SAYS(file);
    EXPECT_SAYS(why);
    assert_null(f.depth);
    assert_null(f.color);
    assert_null(f.jpeg);
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_string_equal(f.name, "3");
    assert_non_null(f.color);
    EXPECT_STATUS(source_next(s, &f), NOTHING);
    source_close(&s);
}

static void cut_short(const struct folder_case *test, const char *name, size_t keep)
{
    const char *path = scratch_file(&test->scratch, name);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    EXPECT_AT_LEAST((double)count, (double)keep);
    EXPECT_STATUS(file_write(path, bytes, keep), OK);
    free(bytes);
}

static void test_damaged_images(void **state)
{
    struct folder_case *test = *state;
    put_three_frames(test);
    cut_short(test, "depth/2.png", 300);
    expect_second_fails(test, "depth/2.png", "damaged");
    scratch_text(&test->scratch, "depth/2.png", "this is no picture");
    expect_second_fails(test, "depth/2.png", "no PNG picture: it is a text file");
    scratch_text(&test->scratch, "depth/2.png", "");
    expect_second_fails(test, "depth/2.png", "no PNG picture: it is empty");
    put_color(test, "depth/2.png", 5);
    expect_second_fails(test, "depth/2.png", "8 bits a pixel");
    remove_file(test, "depth/2.png");
    expect_second_fails(test, "depth/2.png", "is missing");
    put_depth(test, "depth/2.png", 2);
    cut_short(test, "rgb/2.jpg", 500);
    expect_second_fails(test, "rgb/2.jpg", "damaged");
    cut_short(test, "rgb/2.jpg", 3);
    expect_second_fails(test, "rgb/2.jpg", "damaged");
    remove_file(test, "rgb/2.jpg");
    expect_second_fails(test, "rgb/2.jpg", "line 2 of rgb.txt");
}

// What is no PNG or JPEG is named, on opening where it is the first.
static void test_other_kinds_of_pictures(void **state)
{
    struct folder_case *test = *state;
    static const char cmyk[] = "\xff\xd8\xff\xee\0\x0e"
                               "Adobe\0\x64\0\0\0\0\2"
                               "\xff\xc0\0\x14\x08\0\x18\0\x20\4\1\x11\0\2\x11\0\3\x11\0\4\x11\0"
                               "\xff\xda\0\x0e\4\1\0\2\0\3\0\4\0\0\x3f\0\0\0\xff\xd9";
    const struct {
        const char *bytes, *word;
        size_t count;
    } bad[] = {{"BM          ", "no PNG or JPEG picture: it is a BMP picture", 12},
               {"RIFF\1\2\3\4WEBPVP8 ", "is a WebP picture", 16},
               {"II*\0            ", "is a TIFF picture", 16},
               {"\0\0\0\x18"
                "ftypheic    ",
                "is a HEIC picture", 16},
               {cmyk, "CMYK", sizeof cmyk - 1}};
    struct source *source;
    put_color(test, "rgb/a.jpg", 1);
    put_color(test, "depth/a.jpg", 1);
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        struct frame frame;
        scratch_text(&test->scratch, "rgb.txt", "1.0 rgb/a.jpg\n1.1 rgb/b.jpg\n");
        scratch_write(&test->scratch, "rgb/b.jpg", bad[i].bytes, bad[i].count);
        EXPECT_STATUS(source_open(&source, test->uri, SOURCE_CAMERA), OK);
        EXPECT_STATUS(source_next(source, &frame), OK);
        EXPECT_STATUS(source_next(source, &frame), ERR_INPUT);
        EXPECT_SAYS(bad[i].word);
        EXPECT_SAYS("rgb/b.jpg");
        source_close(&source);
        scratch_text(&test->scratch, "rgb.txt", "1.1 rgb/b.jpg\n");
        EXPECT_STATUS(source_open(&source, test->uri, SOURCE_CAMERA), ERR_INPUT);
        EXPECT_SAYS(bad[i].word);
        EXPECT_SAYS("rgb/b.jpg");
    }
    scratch_text(&test->scratch, "rgb.txt", "1.0 rgb/a.jpg\n");
    scratch_text(&test->scratch, "depth.txt", "1.0 depth/a.jpg\n");
    EXPECT_STATUS(source_open(&source, test->uri, SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("no PNG picture: it is a JPEG picture");
}

static void test_another_size(void **state)
{
    struct folder_case *test = *state;
    put_three_frames(test);
    const char *path = scratch_file(&test->scratch, "depth/2.png");
    EXPECT_STATUS(png_write(path, PNG_GRAY16, test->mm, W / 2, H), OK);
    expect_second_fails(test, "depth/2.png", "16 x 24 pixels, but calibration.json says 32 x 24");
    path = scratch_file(&test->scratch, "depth/1.png");
    EXPECT_STATUS(png_write(path, PNG_GRAY16, test->mm, W, H / 2), OK);
    expect_refused(test, SOURCE_SENSOR, ERR_INPUT, "depth/1.png has 32 x 12 pixels, but calibration.json says 32 x 24");
    put_depth(test, "depth/1.png", 1);
    put_depth(test, "depth/2.png", 2);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(jpeg_encode(test->rgb, W, H - 8, 90, &bytes, &count), OK);
    path = scratch_file(&test->scratch, "rgb/2.jpg");
    EXPECT_STATUS(file_write(path, bytes, count), OK);
    expect_second_fails(test, "rgb/2.jpg", "32 x 16 pixels");
    path = scratch_file(&test->scratch, "rgb/1.jpg");
    EXPECT_STATUS(file_write(path, bytes, count), OK);
    expect_refused(test, SOURCE_CAMERA, ERR_INPUT, "rgb/1.jpg has 32 x 16 pixels");
    free(bytes);
}

// ------------------------------------------------------------- tablet cameras

static void test_camera_metadata(void **state)
{
    struct folder_case *test = *state;
    struct lens lens = {0};
    setenv("XDG_CONFIG_HOME", test->scratch.path, 1);
    const char *id = "/base/soc/i2c0mux/ov5647@36";
    EXPECT_STATUS(camera_lens_read(id, &lens), NOTHING);
    scratch_text(&test->scratch, "reenact/cameras/_base_soc_i2c0mux_ov5647_36.json", calibration);
    EXPECT_STATUS(camera_lens_read(id, &lens), OK);
    EXPECT_NEAR(lens.fx, 26.5, 0);
    EXPECT_STATUS(camera_lens_scale(&lens, W * 2, H * 2, id), OK);
    EXPECT_INT(lens.width, 2 * W);
    EXPECT_NEAR(lens.fx, 53, 1e-12);
    EXPECT_NEAR(lens.cx, W - 0.5, 1e-12); // the centre stays the centre
    EXPECT_STATUS(camera_lens_scale(&lens, 64, 36, id), ERR_INPUT);
    EXPECT_SAYS("64 x 36");
    scratch_text(&test->scratch, "reenact/cameras/_base_soc_i2c0mux_ov5647_36.json", "{}");
    EXPECT_STATUS(camera_lens_read(id, &lens), ERR_INPUT);
    EXPECT_SAYS("ov5647_36.json");
    const struct lens saved = {W, H, 31.25, 31.5, 15, 11, -0.1, 0.02, 0.001, 0.002, -0.003, 0.02, 0.01};
    EXPECT_STATUS(camera_lens_save("saved@7", &saved), OK);
    EXPECT_STATUS(camera_lens_read("saved@7", &lens), OK);
    EXPECT_TRUE(!memcmp(&lens, &saved, sizeof lens));
    struct lens precise = saved;
    precise.focal_sigma = 0.0001; // less than the lower bound of what is saved
    EXPECT_STATUS(camera_lens_save("saved@7", &precise), OK);
    EXPECT_STATUS(camera_lens_read("saved@7", &lens), OK);
    EXPECT_NEAR(lens.focal_sigma, 0.005, 0);
    unsetenv("XDG_CONFIG_HOME");
    lens = camera_lens_guess(1280, 720);
    EXPECT_NEAR(lens.focal_sigma, 0.15, 0);
    struct vec3 left = lens_ray(&lens, (struct pixel){-0.5, 359.5}),
                right = lens_ray(&lens, (struct pixel){1279.5, 359.5});
    EXPECT_NEAR(atan2(right.x, 1) - atan2(left.x, 1), 60 * 3.14159265358979 / 180, 1e-12);
}

static void test_no_camera(void **state)
{
    (void)state;
    struct source *s = (struct source *)8;
    enum status status = source_open(&s, "libcamera:998", SOURCE_CAMERA);
    assert_true(status == ERR_MISSING || status == ERR_DEVICE); // the second where there is no camera stack at all
    EXPECT_SAYS("camera");
    assert_null(s);
    static const char *const none[] = {"libcamera:x", "libcamera:+0", "libcamera: 0", "libcamera:-1"};
    for (size_t i = 0; i < COUNT_OF(none); i++) {
        EXPECT_STATUS(source_open(&s, none[i], SOURCE_CAMERA), ERR_INPUT);
        EXPECT_SAYS(none[i]);
    }
}

int main(void)
{
#define WITH_CASE(test) cmocka_unit_test_setup_teardown(test, make_case, clear_case)
    const struct CMUnitTest tests[] = {
        WITH_CASE(test_round_trip),
        WITH_CASE(test_camera_needs_no_depth),
        WITH_CASE(test_sensor_needs_no_color),
        WITH_CASE(test_another_unit_becomes_millimetres),
        WITH_CASE(test_saturated_depth_is_no_reading),
        WITH_CASE(test_pairs_by_time),
        WITH_CASE(test_two_clocks_are_named),
        WITH_CASE(test_missing_sources),
        WITH_CASE(test_bad_calibration),
        WITH_CASE(test_two_cameras_apart),
        WITH_CASE(test_bad_lists),
        WITH_CASE(test_non_increasing_times_are_dropped),
        WITH_CASE(test_damaged_images),
        WITH_CASE(test_another_size),
        WITH_CASE(test_other_kinds_of_pictures),
        WITH_CASE(test_camera_metadata),
        WITH_CASE(test_no_camera),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
