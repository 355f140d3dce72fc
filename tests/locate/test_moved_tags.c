// Tags that were moved, while the place was mapped and since. They are left out and reported, and no camera is
// localised by them, even where no other tag is in view.
#include "tests/support/test.h"

#include "capture/mapping/mapper.h"
#include "locate/locator.h"
#include "tests/support/align.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { IMAGES = 24, HALF = IMAGES / 2, MOST_TAGS = 32, WIDTH = 640, HEIGHT = 480, PIXELS = WIDTH * HEIGHT };

// A sweep once round the room; and its second half with tag 8 moved.
static struct tag_sweep {
    struct world *world;
    struct calibration calibration;
    struct mapper_tag tags[MOST_TAGS];
    int32_t tag_count;
    uint8_t color[IMAGES][PIXELS * 3], late_color[HALF][PIXELS * 3];
    uint16_t depth[IMAGES][PIXELS], late_depth[HALF][PIXELS];
} sweep;

static struct world *open_world(struct world_moved moved)
{
    struct world *w;
    struct world_options o = world_default_options();
    o.motion = "still";
    o.seed = 3;
    o.threads = 2;
    o.moved = moved;
    EXPECT_STATUS(world_open(&w, &o), OK);
    return w;
}

static int64_t time_ns(int i) { return (int64_t)(1e9 * WORLD_SWEEP_S * i / IMAGES); }

static void film(const struct world *w, int i, uint8_t *color, uint16_t *depth)
{
    struct world_shot shot = {sweep.calibration.color, world_sweep_pose(w, (double)time_ns(i) * 1e-9), 0, false};
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.color = color, .depth = depth}), OK);
    world_color_noise(color, WIDTH, HEIGHT, 500 + (uint64_t)i);
    EXPECT_STATUS(world_depth_noise(&shot.lens, depth, 900 + (uint64_t)i, depth), OK);
}

static int enter(void **state)
{
    (void)state;
    sweep.calibration = world_calibration(1);
    sweep.world = open_world((struct world_moved){0});
    struct world *late = open_world((struct world_moved){.tags = 1u << 8, .right = 0.5, .up = -0.4});
    const struct place_tag *tags = world_tags(sweep.world, &sweep.tag_count);
    for (int32_t i = 0; i < sweep.tag_count; i++)
        sweep.tags[i] = (struct mapper_tag){tags[i].id, tags[i].side_m};
    for (int i = 0; i < IMAGES; i++)
        film(sweep.world, i, sweep.color[i], sweep.depth[i]);
    for (int i = 0; i < HALF; i++)
        film(late, HALF + i, sweep.late_color[i], sweep.late_depth[i]);
    world_close(&late);
    return 0;
}

static int leave(void **state)
{
    (void)state;
    world_close(&sweep.world);
    return 0;
}

// moved: tag 8 is moved half-way through the sweep.
static struct place map(const struct mapper_tag *tags, int32_t tag_count, bool moved, struct mapper_report *report)
{
    struct mapper *m;
    struct place place;
    EXPECT_STATUS(mapper_open(&m, &sweep.calibration, tags, tag_count, NULL), OK);
    for (int i = 0; i < IMAGES; i++) {
        bool late = moved && i >= HALF;
        struct frame frame = {.time_ns = time_ns(i),
                              .color = late ? sweep.late_color[i - HALF] : sweep.color[i],
                              .depth = late ? sweep.late_depth[i - HALF] : sweep.depth[i]};
        EXPECT_STATUS(mapper_add(m, &frame), OK);
    }
    EXPECT_STATUS(mapper_finish(m, &place, report), OK);
    mapper_close(&m);
    return place;
}

static void test_moved_during_mapping(void **state)
{
    (void)state;
    struct mapper_report report;
    struct pose world_from_place;
    int32_t count;
    struct place place = map(sweep.tags, sweep.tag_count, true, &report);
    const struct place_tag *truth = world_tags(sweep.world, &count);
    double off_m = align_tags(&place, truth, count, &world_from_place);
    printf("tag 8 moved half-way: %d tags in two places, the first %d; %d others mapped within %.2f mm rms\n",
           (int)report.tags_outlier, (int)report.first_outlier, (int)place.tag_count, off_m * 1e3);
    EXPECT_INT(report.tags_outlier, 1);
    EXPECT_INT(report.first_outlier, 8);
    EXPECT_INT(report.tags_disconnected, 0);
    EXPECT_INT(report.frames_placed, IMAGES);
    for (int32_t i = 0; i < place.tag_count; i++)
        EXPECT_TRUE(place.tags[i].id != 8);
    EXPECT_AT_LEAST(place.tag_count, sweep.tag_count - 2);
    EXPECT_AT_MOST(off_m, 0.003);
    place_free(&place);
}

enum { VIEWS = 3 };

// How images of a room in which tags were moved are localised.
struct moved_result {
    int found;
    double worst_m;
    int32_t moved_count, first; // tags reported as moved, and the lowest number of them
};

static struct moved_result localize_in(const struct place *place, struct world_moved moved)
{
    static uint8_t color[PIXELS * 3];
    struct world *w = open_world(moved);
    struct lens lens = world_viewer_calibration(1).color;
    struct pose world_from_place;
    struct locator *l;
    struct moved_result result = {0};
    int32_t count;
    const struct place_tag *truth = world_tags(sweep.world, &count);
    EXPECT_AT_MOST(align_tags(place, truth, count, &world_from_place), 0.005);
    EXPECT_STATUS(locator_open(&l, place, &lens, NULL), OK);
    for (int i = 0; i < VIEWS; i++) {
        struct world_shot shot = {lens, world_viewer_pose(w, world_seconds(w) * i / 24), 0, false};
        struct location at;
        EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.color = color}), OK);
        world_color_noise(color, lens.width, lens.height, 40 + (uint64_t)i);
        if (locator_localize(l, color, NULL, &at) != OK)
            continue;
        struct pose in_world = pose_multiply(world_from_place, at.world_from_camera);
        result.worst_m = fmax(result.worst_m, v3_distance(in_world.translation, shot.world_from_camera.translation));
        result.found++;
    }
    result.moved_count = locator_moved_tags(l, &result.first);
    locator_close(&l);
    world_close(&w);
    return result;
}

static void expect_localized(const struct place *place, struct world_moved moved, int32_t least_moved, int32_t first)
{
    const struct moved_result r = localize_in(place, moved);
    printf("%d of %d localised, the worst %.1f mm off; %d tags reported as moved, the first %d\n", r.found, VIEWS,
           r.worst_m * 1e3, (int)r.moved_count, (int)r.first);
    EXPECT_INT(r.found, VIEWS);
    EXPECT_AT_MOST(r.worst_m, 0.015);
    EXPECT_AT_LEAST(r.moved_count, least_moved);
    EXPECT_INT(r.first, first);
    if (!least_moved)
        EXPECT_INT(r.moved_count, 0);
}

static void test_moved_after_mapping(void **state)
{
    (void)state;
    const struct world_moved none = {0}, one = {.tags = 1u << 1, .right = -0.3, .up = 0.1},
                             together = {.tags = 1u << 0 | 1u << 1 | 1u << 8, .right = 0.3, .up = 0.1};
    struct mapper_report report;
    struct place all = map(sweep.tags, sweep.tag_count, false, &report);
    EXPECT_INT(report.tags_outlier, 0);
    EXPECT_INT(report.first_outlier, -1);
    expect_localized(&all, none, 0, -1);
    expect_localized(&all, one, 1, 1);
    expect_localized(&all, together, 2, 0); // two on one wall, their distance unchanged
    place_free(&all);
    if (SANITIZED)
        return;
    const struct mapper_tag few[] = {sweep.tags[1], sweep.tags[6]};
    struct place two = map(few, COUNT_OF(few), false, &report);
    expect_localized(&two, none, 0, -1);
    expect_localized(&two, one, 1, 1); // the only one in view
    place_free(&two);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_moved_during_mapping),
        cmocka_unit_test(test_moved_after_mapping),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
