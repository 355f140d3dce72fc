// Why a take shows no person: films of the small world, changed as wrong units, bytes, encodings and mounts change
// them, name their cause; right films of large and small people, an empty room, and somebody who kneels name none.
#include "capture/depth_cause.h"
#include "capture/sensor_tilt.h"
#include "tests/support/scratch.h"
#include "tests/support/test.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { FRAMES = 26 };
static const double SCALE = 0.375, RATE_HZ = 15;

// What becomes of a depth, in millimetres.
typedef uint16_t change(uint16_t d);
static uint16_t same(uint16_t d) { return d; }
static uint16_t within(double mm) { return mm < 65535 ? (uint16_t)(mm + 0.5) : 0; }
static uint16_t five_times(uint16_t d) { return within(d * 5.0); }
static uint16_t twice(uint16_t d) { return within(d * 2.0); }
static uint16_t half(uint16_t d) { return within(d * 0.5); }
static uint16_t a_tenth(uint16_t d) { return within(d * 0.1); }
static uint16_t a_thousandth(uint16_t d) { return within(d * 0.001); }
static uint16_t a_thousand_times(uint16_t d) { return within(d * 1000.0); }
static uint16_t swapped(uint16_t d) { return (uint16_t)(d >> 8 | d << 8); }
static uint16_t inverted(uint16_t d) { return (uint16_t)(65535 - d); }
static uint16_t raw_kinect(uint16_t d) { return d ? (uint16_t)(1090 - 75 * 580 * 8.0 / d) : 2047; } // 8: subpixels

struct film {
    const char *what, *figure, *motion;
    change *changed;
    struct world_stand stand;  // eye all 0: the usual one
    bool empty, tracked, lost; // tracked: its frames have the figure's joints; lost: but every fourth
    double scale;              // of those joints; 0: 1
    enum depth_cause cause;
    double factor;
    double tilt; // degrees, that must be said; 0: none
};

static const double TURN = 3.14159265358979323846;

static void open_world(const struct film *film, struct world **world)
{
    struct world_options o = world_default_options();
    o.motion = film->motion;
    o.plain = o.unshadowed = true;
    o.threads = 2;
    if (film->stand.eye.z > 0)
        o.stand = film->stand;
    EXPECT_TRUE(world_figure_named(film->figure, &o.figure));
    EXPECT_STATUS(world_open(world, &o), OK);
}

static void shoot(const struct film *film, const char *path)
{
    struct world *world;
    struct recording_writer *w;
    struct calibration c = world_calibration(SCALE);
    const size_t pixels = lens_pixels(&c.depth);
    uint16_t *depth = malloc(pixels * sizeof *depth);
    c.color.width = c.color.height = 0;
    open_world(film, &world);
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &c), OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct world_shot shot = {c.depth, world_sensor_pose(world), i / RATE_HZ, !film->empty};
        struct take_frame frame = {.time_ns = (int64_t)(i / RATE_HZ * 1e9),
                                   .world_from_camera = POSE_IDENTITY,
                                   .depth = depth,
                                   .has_skeleton = film->tracked && (!film->lost || i % 4),
                                   .skeleton = world_joints_in_camera(world, i / RATE_HZ, world_sensor_pose(world))};
        EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.depth = depth}), OK);
        EXPECT_STATUS(world_depth_noise(&c.depth, depth, (uint64_t)i + 1, depth), OK);
        for (size_t k = 0; k < pixels; k++)
            depth[k] = film->changed(depth[k]);
        for (int j = 0; j < JOINT_COUNT && film->scale > 0; j++)
            frame.skeleton.joint[j] = v3_scale(frame.skeleton.joint[j], film->scale);
        EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    }
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    world_close(&world);
    free(depth);
}

static void judge(const struct film *film)
{
    struct scratch scratch = scratch_make();
    struct recording *r;
    struct take *t;
    struct depth_finding found;
    struct take_verdict said = {.seen = true};
    shoot(film, scratch_file(&scratch, "film.reenact"));
    EXPECT_STATUS(recording_open(&r, scratch_file(&scratch, "film.reenact")), OK);
    EXPECT_STATUS(take_open(&t, r, "a"), OK);
    EXPECT_STATUS(depth_cause_find(t, &found), OK);
    depth_cause_say(&found, &said);
    printf("%-24s %-6s %-9s cause %d, factor %g, %.2f m: %s\n", film->what, film->figure, film->motion, found.cause,
           found.factor, found.stature_m, said.count ? said.line[0].text : "-");
    struct sensor_tilt tilt;
    struct take_verdict tilt_said = {.seen = true};
    EXPECT_STATUS(sensor_tilt_find(t, &tilt), OK);
    sensor_tilt_say(&tilt, &tilt_said);
    if (film->tilt > 0) {
        printf("    tilt %.1f: %s\n", tilt.degrees, tilt_said.count ? tilt_said.line[0].text : "-");
        EXPECT_NEAR(tilt.degrees, film->tilt, 2);
        EXPECT_TRUE(!verdict_is_good_for(&tilt_said, USE_COMPARE));
    } else if (film->tracked && film->cause == CAUSE_NONE) {
        EXPECT_TRUE(verdict_is_good_for(&tilt_said, USE_COMPARE));
    }
    EXPECT_INT(found.cause, film->cause);
    EXPECT_INT(said.count, film->cause != CAUSE_NONE);
    EXPECT_TRUE(!film->factor || found.factor == film->factor);
    take_close(&t);
    recording_free(&r);
    scratch_remove(&scratch);
}

static void test_wrong_depth_is_named(void **state)
{
    (void)state;
    static const struct film films[] = {
        {"five times", "woman", "kata", five_times, .cause = CAUSE_UNIT, .factor = 5},
        {"twice", "heavy", "kata", twice, .cause = CAUSE_UNIT, .factor = 2},
        {"half", "man", "walk", half, .cause = CAUSE_UNIT, .factor = 0.5},
        {"a tenth", "woman", "pirouette", a_tenth, .cause = CAUSE_UNIT, .factor = 0.1},
        {"a thousandth", "man", "kata", a_thousandth, .cause = CAUSE_UNIT},
        {"a thousand times", "man", "kata", a_thousand_times, .cause = CAUSE_NOTHING_IN_REACH},
        {"bytes", "child", "kata", swapped, .cause = CAUSE_BYTES_SWAPPED},
        {"inverted", "coat", "walk", inverted, .cause = CAUSE_INVERTED},
        {"raw disparity", "woman", "bend", raw_kinect, .cause = CAUSE_DISPARITY},
        {"half, tracked so", "child", "kata", half, .tracked = true, .scale = 0.5, .cause = CAUSE_UNIT},
        {"twice, tracked so", "woman", "kata", twice, .tracked = true, .scale = 2, .cause = CAUSE_UNIT},
    };
    for (size_t i = 0; i < COUNT_OF(films); i += SANITIZED ? 4 : 1)
        judge(&films[i]);
}

static void test_wrong_mounts_are_named(void **state)
{
    (void)state;
    const struct film films[] = {
        {"upside down", "man", "kata", same, {{0.1, -3.1, 1.15}, {0.02, 0, 1}, TURN}, .cause = CAUSE_UPSIDE_DOWN},
        {"under the ceiling", "woman", "bend", same, {{0.3, -3, 2.3}, {0, 0, 0.8}, TURN}, .cause = CAUSE_UPSIDE_DOWN},
        {"upside down, tracked",
         "man",
         "kata",
         same,
         {{0.1, -3.1, 1.15}, {0.02, 0, 1}, TURN},
         .tracked = true,
         .lost = true,
         .cause = CAUSE_UPSIDE_DOWN},
        {"on its left side",
         "heavy",
         "walk",
         same,
         {{0.1, -3.1, 1.15}, {0.02, 0, 1}, TURN / 2},
         .cause = CAUSE_ON_ITS_SIDE},
        {"on its right side",
         "child",
         "kata",
         same,
         {{0.1, -3.1, 1}, {0.02, 0, 0.8}, -TURN / 2},
         .cause = CAUSE_ON_ITS_SIDE},
        {"straight down", "man", "kata", same, {{0.1, -0.2, 2.55}, {0.02, 0, 0}, 0}, .cause = CAUSE_FROM_ABOVE},
    };
    for (size_t i = 0; i < COUNT_OF(films); i += SANITIZED ? 5 : 1)
        judge(&films[i]);
}

// The tracker's joints are the truth here, so that only the judgement is tried.
static void test_right_films_name_nothing(void **state)
{
    (void)state;
    const struct film films[] = {
        {"right", "woman", "kata", same, .tracked = true},
        {"0.9 m", "child", "walk", same, .tracked = true, .scale = 0.9 / 1.25},
        {"2.1 m", "tall", "bend", same, .tracked = true, .scale = 2.1 / 1.95},
        {"bent", "heavy", "bend", same, .tracked = true},
        {"low", "man", "kata", same, {{0.1, -2.6, 0.25}, {0.02, 0, 1.2}, 0}, .tracked = true},
        {"high", "man", "kata", same, {{0.1, -1.9, 2.3}, {0.02, 0, 0.7}, 0}, .tracked = true, .tilt = 40.1},
        {"up to the ceiling", "man", "kata", same, {{0.1, -1.8, 0.6}, {0.02, 0.5, 2.4}, 0}, .tracked = true},
        {"empty", "man", "still", same, .empty = true},
        {"empty, from a corner", "man", "still", same, {{-2.5, -3, 1.6}, {1, 1, 0.9}, 0}, .empty = true},
        {"empty, low", "man", "still", same, {{1.5, -2.5, 0.5}, {-1, 3, 0.9}, 0}, .empty = true},
        {"rolled by 40", "woman", "kata", same, {{0.1, -3.1, 1.15}, {0.02, 0, 1}, 0.7}, .tracked = true, .tilt = 40.1},
        {"upright, in part", "man", "kata", same, .tracked = true, .lost = true},
    };
    for (size_t i = 0; i < COUNT_OF(films); i += SANITIZED ? 4 : 1)
        judge(&films[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wrong_depth_is_named),
        cmocka_unit_test(test_wrong_mounts_are_named),
        cmocka_unit_test(test_right_films_name_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
