// A folder of pictures as a source: what comes out is what went in, colour and
// depth find each other by time, and whatever is wrong is said in one sentence
// that names the file. All pictures are made here.
#include "tests/support/test.h"

#include "platform/file.h"
#include "platform/jpeg.h"
#include "platform/png.h"
#include "platform/source.h"
#include "platform/source_internal.h"
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

static void put_depth(struct folder_case *room, const char *name, int seed)
{
    struct rng rng = {(uint64_t)seed};
    for (int i = 0; i < W * H; i++)
        room->mm[i] = i % 7 ? (uint16_t)(rng_uniform(&rng) * 65536) : 0;
    const char *path = scratch_file(&room->scratch, name);
    assert_int_equal(png_write(path, PNG_GRAY16, room->mm, W, H), OK);
}

static void put_color(struct folder_case *room, const char *name, int seed)
{
    struct rng rng = {(uint64_t)seed + 1000};
    for (int i = 0; i < W * H * 3; i++)
        room->rgb[i] = (uint8_t)(rng_uniform(&rng) * 256);
    const char *path = scratch_file(&room->scratch, name);
    if (strstr(name, ".png")) {
        assert_int_equal(png_write(path, PNG_RGB8, room->rgb, W, H), OK);
        return;
    }
    uint8_t *bytes;
    size_t count;
    assert_int_equal(jpeg_encode(room->rgb, W, H, 90, &bytes, &count), OK);
    assert_int_equal(file_write(path, bytes, count), OK);
    free(bytes);
}

static int make_case(void **state)
{
    struct folder_case *room = calloc(1, sizeof *room);
    room->scratch = scratch_make();
    snprintf(room->uri, sizeof room->uri, "folder:%s", room->scratch.path);
    const char *const below[] = {"rgb", "depth"};
    for (size_t i = 0; i < COUNT_OF(below); i++) {
        const char *path = scratch_file(&room->scratch, below[i]);
        if (folder_make(path) != OK)
            return -1;
    }
    scratch_text(&room->scratch, "calibration.json", calibration);
    *state = room;
    return 0;
}

static int clear_case(void **state)
{
    struct folder_case *room = *state;
    scratch_remove(&room->scratch);
    free(room);
    return 0;
}

static struct source *open_as(const struct folder_case *room, enum source_wanted wanted)
{
    struct source *s;
    EXPECT_STATUS(source_open(&s, room->uri, wanted), OK);
    return s;
}

static void refused(const struct folder_case *room, enum source_wanted wanted, enum status status, const char *part)
{
    struct source *s = (struct source *)8;
    EXPECT_STATUS(source_open(&s, room->uri, wanted), status);
    assert_null(s);
    EXPECT_SAYS(part);
}

// ------------------------------------------------------------- what comes out

static void test_round_trip(void **state)
{
    struct folder_case *room = *state;
    scratch_text(&room->scratch, "rgb.txt",
                 "# color images\r\n# timestamp filename\n\n 1305031102.175304 rgb/first one.png \n"
                 "1305031102.2086379999\trgb/0001.jpg\n");
    scratch_text(&room->scratch, "depth.txt", "1305031102.175304 depth/7.png\n1305031102.2086375001 ./depth/8.b.png");
    put_color(room, "rgb/first one.png", 1);
    put_color(room, "rgb/0001.jpg", 2);
    put_depth(room, "depth/7.png", 3);
    put_depth(room, "depth/8.b.png", 4);
    struct source *s = open_as(room, SOURCE_SENSOR);
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
    put_color(room, "again.png", 1);
    assert_memory_equal(f.color, room->rgb, sizeof room->rgb);
    assert_null(f.jpeg);
    put_depth(room, "again.png", 3);
    assert_memory_equal(f.depth, room->mm, sizeof room->mm);
    EXPECT_INT(source_remaining(s), 1);
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, 1305031102208637500); // to the nanosecond, though a double holds only 238 ns
    assert_string_equal(f.name, "8.b");
    uint8_t *bytes, decoded[W * H * 3];
    size_t count;
    const char *path = scratch_file(&room->scratch, "rgb/0001.jpg");
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
    struct folder_case *room = *state;
    scratch_text(&room->scratch, "rgb.txt", "-0.5 rgb/0007.png\n0 rgb/0008.png\n");
    put_color(room, "rgb/0007.png", 7);
    put_color(room, "rgb/0008.png", 8);
    struct source *s = open_as(room, SOURCE_CAMERA);
    EXPECT_INT(source_calibration(s)->depth.width, 0);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, -500000000);
    assert_string_equal(f.name, "0007");
    assert_null(f.depth);
    EXPECT_STATUS(source_next(s, &f), OK);
    EXPECT_INT(f.time_ns, 0);
    source_close(&s);
    refused(room, SOURCE_SENSOR, ERR_INPUT, "depth.txt");
}

static void test_sensor_needs_no_color(void **state)
{
    struct folder_case *room = *state;
    scratch_text(&room->scratch, "depth.txt",
                 "5 depth/a-name-that-is-longer-than-a-frame-can-hold.png\n5.1 depth/b.png\n");
    put_depth(room, "depth/a-name-that-is-longer-than-a-frame-can-hold.png", 1);
    put_depth(room, "depth/b.png", 2);
    struct source *s = open_as(room, SOURCE_SENSOR);
    EXPECT_INT(source_calibration(s)->color.width, 0);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_null(f.color);
    assert_non_null(f.depth);
    assert_string_equal(f.name, "0000");
    EXPECT_STATUS(source_next(s, &f), OK);
    assert_string_equal(f.name, "0001"); // one counts, so all count
    source_close(&s);
    refused(room, SOURCE_CAMERA, ERR_MISSING, "rgb.txt");
}

static void test_another_unit_becomes_millimetres(void **state)
{
    struct folder_case *room = *state;
    char text[256];
    // TUM's own unit: 5000 to the metre.
    snprintf(text, sizeof text,
             "{\"depth\": {\"width\": 32, \"height\": 24, \"fx\": 28, \"fy\": 28, \"cx\": 16, "
             "\"cy\": 12, \"unit_m\": 0.0002}}");
    scratch_text(&room->scratch, "calibration.json", text);
    scratch_text(&room->scratch, "depth.txt", "1 depth/a.png\n");
    put_depth(room, "depth/a.png", 5);
    struct source *s = open_as(room, SOURCE_SENSOR);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    int zeros = 0;
    for (int i = 0; i < W * H; i++) {
        EXPECT_INT(f.depth[i], (room->mm[i] + 2) / 5);
        zeros += !room->mm[i];
    }
    EXPECT_AT_LEAST(zeros, W * H / 7);
    source_close(&s);
    // What does not fit into 16 bits of millimetres is no reading.
    snprintf(text, sizeof text,
             "{\"depth\": {\"width\": 32, \"height\": 24, \"fx\": 28, \"fy\": 28, \"cx\": 16, "
             "\"cy\": 12, \"unit_m\": 0.01}}");
    scratch_text(&room->scratch, "calibration.json", text);
    s = open_as(room, SOURCE_SENSOR);
    EXPECT_STATUS(source_next(s, &f), OK);
    for (int i = 0; i < W * H; i++)
        EXPECT_INT(f.depth[i], room->mm[i] <= 6553 ? room->mm[i] * 10 : 0);
    source_close(&s);
}

// ------------------------------------------------------------- pairs

// Reads all frames; writes "name+" for one with colour, "name-" for one without.
static void pairs(const struct folder_case *room, const char *wanted)
{
    char got[256] = "";
    struct source *s = open_as(room, SOURCE_SENSOR);
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
    struct folder_case *room = *state;
    const char *const names[] = {"a", "b", "c", "d", "e"};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        char name[32];
        snprintf(name, sizeof name, "depth/%s.png", names[i]);
        put_depth(room, name, (int)i);
    }
    put_color(room, "rgb/x.png", 1);
    scratch_text(&room->scratch, "depth.txt",
                 "1.0 depth/a.png\n1.1 depth/b.png\n1.2 depth/c.png\n1.3 depth/d.png\n1.4 depth/e.png\n");
    // Exactly half a frame apart is a pair, a microsecond more is none.
    scratch_text(&room->scratch, "rgb.txt", "1.05 rgb/x.png\n1.149999 rgb/x.png\n1.350001 rgb/x.png\n");
    pairs(room, "a+ b+ c- d- e+ ");
    // A late colour picture serves the nearer of two, and only once.
    scratch_text(&room->scratch, "rgb.txt", "1.04 rgb/x.png\n1.24 rgb/x.png\n1.26 rgb/x.png\n");
    pairs(room, "a+ b- c+ d+ e- ");
    // Colour at twice the rate: the nearest is taken.
    scratch_text(&room->scratch, "rgb.txt", "0.96 rgb/y.png\n1.01 rgb/x.png\n1.06 rgb/y.png\n1.11 rgb/x.png\n");
    pairs(room, "a+ b+ c- d- e- ");
    // Colour from another day.
    scratch_text(&room->scratch, "rgb.txt", "100 rgb/y.png\n101 rgb/y.png\n");
    pairs(room, "a- b- c- d- e- ");
    // A gap in the depth does not widen what counts as half a frame.
    scratch_text(&room->scratch, "depth.txt", "1.0 depth/a.png\n1.1 depth/b.png\n1.2 depth/c.png\n9 depth/d.png\n");
    scratch_text(&room->scratch, "rgb.txt", "1.0 rgb/x.png\n1.1 rgb/x.png\n1.2 rgb/x.png\n8.9 rgb/x.png\n");
    pairs(room, "a+ b+ c+ d- ");
}

// ------------------------------------------------------------- what is wrong

static void two_frames(struct folder_case *room)
{
    scratch_text(&room->scratch, "rgb.txt", "1 rgb/1.jpg\n1.1 rgb/2.jpg\n1.2 rgb/3.jpg\n");
    scratch_text(&room->scratch, "depth.txt", "1 depth/1.png\n1.1 depth/2.png\n1.2 depth/3.png\n");
    for (int i = 1; i <= 3; i++) {
        char name[32];
        snprintf(name, sizeof name, "rgb/%d.jpg", i);
        put_color(room, name, i);
        snprintf(name, sizeof name, "depth/%d.png", i);
        put_depth(room, name, i);
    }
}

static void remove_file(const struct folder_case *room, const char *name)
{
    const char *path = scratch_file(&room->scratch, name);
    assert_int_equal(unlink(path), 0);
}

static void test_no_such_thing(void **state)
{
    struct folder_case *room = *state;
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
    refused(room, SOURCE_SENSOR, ERR_MISSING, "neither rgb.txt nor depth.txt");
    two_frames(room);
    remove_file(room, "calibration.json");
    refused(room, SOURCE_SENSOR, ERR_MISSING, "calibration.json");
}

static void test_bad_calibration(void **state)
{
    struct folder_case *room = *state;
    two_frames(room);
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
        scratch_text(&room->scratch, "calibration.json", text);
        refused(room, SOURCE_SENSOR, ERR_INPUT, "calibration.json");
        EXPECT_SAYS(cases[i].says);
    }
}

static void test_two_cameras_apart(void **state)
{
    struct folder_case *room = *state;
    two_frames(room);
    char text[sizeof calibration + 200];
    const char *at = strstr(calibration, "true");
    snprintf(
        text, sizeof text,
        "%.*sfalse, \"color_from_depth\": {\"translation_m\": [0.025, 0, -0.001], \"rotation\": [0, 0.6, 0, 0.8]}}",
        (int)(at - calibration), calibration);
    scratch_text(&room->scratch, "calibration.json", text);
    struct source *s = open_as(room, SOURCE_SENSOR);
    const struct calibration *c = source_calibration(s);
    assert_false(c->registered);
    EXPECT_NEAR(c->color_from_depth.translation.x, 0.025, 0);
    EXPECT_NEAR(c->color_from_depth.translation.z, -0.001, 0);
    EXPECT_NEAR(c->color_from_depth.rotation.y, 0.6, 1e-15);
    source_close(&s);
    *strstr(text, "0.6") = '3';
    scratch_text(&room->scratch, "calibration.json", text);
    refused(room, SOURCE_SENSOR, ERR_INPUT, "rotation");
}

static void test_bad_lists(void **state)
{
    struct folder_case *room = *state;
    two_frames(room);
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
        {". depth/1.png\n", "line 1"},
        {"100 depth/1.png\n100.1 depth/2.png\n5 depth/3.png\n", "line 3: the clock jumps back by 95.100 s"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        scratch_text(&room->scratch, "depth.txt", cases[i].text);
        refused(room, SOURCE_SENSOR, ERR_INPUT, "depth.txt");
        EXPECT_SAYS(cases[i].says);
    }
    const char *path = scratch_file(&room->scratch, "depth.txt");
    EXPECT_STATUS(file_write(path, "1 a\0b\n", 6), OK);
    refused(room, SOURCE_SENSOR, ERR_INPUT, "depth.txt is not a text file");
}

static void test_non_increasing_times_are_dropped(void **state)
{
    struct folder_case *room = *state;
    two_frames(room);
    scratch_text(&room->scratch, "depth.txt", "1 depth/1.png\n1 depth/2.png\n0.9 depth/2.png\n1.2 depth/3.png\n");
    struct source *s = open_as(room, SOURCE_SENSOR);
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

// The second of three frames fails with a sentence that names `file`; the others come.
static void second_fails(const struct folder_case *room, const char *file, const char *why)
{
    struct source *s = open_as(room, SOURCE_SENSOR);
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

static void cut_short(const struct folder_case *room, const char *name, size_t keep)
{
    const char *path = scratch_file(&room->scratch, name);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    EXPECT_AT_LEAST((double)count, (double)keep);
    EXPECT_STATUS(file_write(path, bytes, keep), OK);
    free(bytes);
}

static void test_damaged_images(void **state)
{
    struct folder_case *room = *state;
    two_frames(room);
    cut_short(room, "depth/2.png", 300);
    second_fails(room, "depth/2.png", "damaged");
    scratch_text(&room->scratch, "depth/2.png", "this is no picture");
    second_fails(room, "depth/2.png", "damaged");
    scratch_text(&room->scratch, "depth/2.png", "");
    second_fails(room, "depth/2.png", "damaged");
    put_color(room, "depth/2.png", 5);
    second_fails(room, "depth/2.png", "8-bit");
    remove_file(room, "depth/2.png");
    second_fails(room, "depth/2.png", "is missing");
    put_depth(room, "depth/2.png", 2);
    cut_short(room, "rgb/2.jpg", 500);
    second_fails(room, "rgb/2.jpg", "damaged");
    cut_short(room, "rgb/2.jpg", 3);
    second_fails(room, "rgb/2.jpg", "damaged");
    remove_file(room, "rgb/2.jpg");
    second_fails(room, "rgb/2.jpg", "line 2 of rgb.txt");
}

static void test_another_size(void **state)
{
    struct folder_case *room = *state;
    two_frames(room);
    const char *path = scratch_file(&room->scratch, "depth/2.png");
    EXPECT_STATUS(png_write(path, PNG_GRAY16, room->mm, W / 2, H), OK);
    second_fails(room, "depth/2.png", "16 x 24 pixels, but calibration.json says 32 x 24");
    path = scratch_file(&room->scratch, "depth/1.png");
    EXPECT_STATUS(png_write(path, PNG_GRAY16, room->mm, W, H / 2), OK);
    refused(room, SOURCE_SENSOR, ERR_INPUT, "depth/1.png has 32 x 12 pixels, but calibration.json says 32 x 24");
    put_depth(room, "depth/1.png", 1);
    put_depth(room, "depth/2.png", 2);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(jpeg_encode(room->rgb, W, H - 8, 90, &bytes, &count), OK);
    path = scratch_file(&room->scratch, "rgb/2.jpg");
    EXPECT_STATUS(file_write(path, bytes, count), OK);
    second_fails(room, "rgb/2.jpg", "32 x 16 pixels");
    path = scratch_file(&room->scratch, "rgb/1.jpg");
    EXPECT_STATUS(file_write(path, bytes, count), OK);
    refused(room, SOURCE_CAMERA, ERR_INPUT, "rgb/1.jpg has 32 x 16 pixels");
    free(bytes);
}

// ------------------------------------------------------------- the tablet's cameras

static void test_camera_metadata(void **state)
{
    struct folder_case *room = *state;
    struct lens lens = {0};
    setenv("XDG_CONFIG_HOME", room->scratch.path, 1);
    const char *id = "/base/soc/i2c0mux/ov5647@36";
    EXPECT_STATUS(camera_lens_read(id, &lens), NOTHING);
    scratch_text(&room->scratch, "reenact/cameras/_base_soc_i2c0mux_ov5647_36.json", calibration);
    EXPECT_STATUS(camera_lens_read(id, &lens), OK);
    EXPECT_NEAR(lens.fx, 26.5, 0);
    EXPECT_STATUS(camera_lens_scale(&lens, W * 2, H * 2, id), OK);
    EXPECT_INT(lens.width, 2 * W);
    EXPECT_NEAR(lens.fx, 53, 1e-12);
    EXPECT_NEAR(lens.cx, W - 0.5, 1e-12); // the middle stays the middle
    EXPECT_STATUS(camera_lens_scale(&lens, 64, 36, id), ERR_INPUT);
    EXPECT_SAYS("64 x 36");
    scratch_text(&room->scratch, "reenact/cameras/_base_soc_i2c0mux_ov5647_36.json", "{}");
    EXPECT_STATUS(camera_lens_read(id, &lens), ERR_INPUT);
    EXPECT_SAYS("ov5647_36.json");
    const struct lens learnt = {W, H, 31.25, 31.5, 15, 11, -0.1, 0.02, 0.001, 0.002, -0.003, 0.02, 0.01};
    EXPECT_STATUS(camera_lens_save("learnt@7", &learnt), OK);
    EXPECT_STATUS(camera_lens_read("learnt@7", &lens), OK);
    EXPECT_TRUE(!memcmp(&lens, &learnt, sizeof lens));
    struct lens sure = learnt;
    sure.focal_sigma = 0.0001; // of the next place nobody is so sure
    EXPECT_STATUS(camera_lens_save("learnt@7", &sure), OK);
    EXPECT_STATUS(camera_lens_read("learnt@7", &lens), OK);
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
    EXPECT_STATUS(source_open(&s, "libcamera:x", SOURCE_CAMERA), ERR_INPUT);
}

int main(void)
{
#define WITH_CASE(test) cmocka_unit_test_setup_teardown(test, make_case, clear_case)
    const struct CMUnitTest tests[] = {
        WITH_CASE(test_round_trip),
        WITH_CASE(test_camera_needs_no_depth),
        WITH_CASE(test_sensor_needs_no_color),
        WITH_CASE(test_another_unit_becomes_millimetres),
        WITH_CASE(test_pairs_by_time),
        WITH_CASE(test_no_such_thing),
        WITH_CASE(test_bad_calibration),
        WITH_CASE(test_two_cameras_apart),
        WITH_CASE(test_bad_lists),
        WITH_CASE(test_non_increasing_times_are_dropped),
        WITH_CASE(test_damaged_images),
        WITH_CASE(test_another_size),
        WITH_CASE(test_camera_metadata),
        WITH_CASE(test_no_camera),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
