// What the mapper says of a sweep whose lens, depth or list of tags is wrong: the cause, and nothing of a right one.
// The sweep is the small world's, whose lens and tags are exact.
#include "tests/support/test.h"

#include "capture/mapping/map_advice.h"
#include "tests/support/other_tags.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { IMAGES = 20, MOST_TAGS = 32 };

static struct {
    struct world *world;
    struct calibration calibration;
    struct map_advice right; // what is said of the sweep as it is
    struct mapper_tag tags[MOST_TAGS];
    int32_t tag_count;
    uint8_t *color[IMAGES];
    uint16_t *depth[IMAGES];
} room;

static int64_t time_ns(int i) { return (int64_t)(1e9 * WORLD_SWEEP_S / 2 * i / IMAGES); }

static int film_room(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&room.world, &o), OK);
    room.calibration = world_calibration(0.5);
    const struct place_tag *tags = world_tags(room.world, &room.tag_count);
    for (int32_t i = 0; i < room.tag_count; i++)
        room.tags[i] = (struct mapper_tag){tags[i].id, tags[i].side_m};
    const size_t pixels = lens_pixels(&room.calibration.color);
    for (int i = 0; i < IMAGES; i++) {
        const struct world_shot shot = {room.calibration.color, world_sweep_pose(room.world, (double)time_ns(i) * 1e-9),
                                        0, false};
        room.color[i] = malloc(pixels * 3);
        room.depth[i] = malloc(pixels * sizeof *room.depth[i]);
        EXPECT_TRUE(room.color[i] && room.depth[i]);
        struct world_image image = {.color = room.color[i], .depth = room.depth[i]};
        EXPECT_STATUS(world_render(room.world, &shot, &image), OK);
        world_color_noise(room.color[i], shot.lens.width, shot.lens.height, 100 + (uint64_t)i);
        EXPECT_STATUS(world_depth_noise(&shot.lens, room.depth[i], 50 + (uint64_t)i, room.depth[i]), OK);
    }
    return 0;
}

static int leave_room(void **state)
{
    (void)state;
    for (int i = 0; i < IMAGES; i++) {
        free(room.color[i]);
        free(room.depth[i]);
    }
    world_close(&room.world);
    return 0;
}

// What is done to the sweep before it is mapped.
struct wrong {
    int32_t one; // index of the tag whose side is `one_side` times the true one in the list; only if that is not 0
    double one_side;
    double focal, centre_x;  // of the lens over the true one; added, a share of the width
    double unit;             // of depth
    double sides;            // of the list
    bool mirrored, upturned; // depth alone
    bool hung;               // colour and depth are both upside down
    bool untagged;           // the list is empty
};

// place: the caller's, freed with place_free.
static enum status map_place_wrongly(const struct wrong *w, struct place *place, struct mapper_report *report)
{
    struct calibration c = room.calibration;
    struct mapper_tag tags[MOST_TAGS];
    struct mapper_options options = mapper_default_options();
    struct mapper *m;
    const int width = c.color.width, height = c.color.height;
    const size_t pixels = lens_pixels(&c.color);
    uint16_t *depth = malloc(pixels * sizeof *depth);
    uint8_t *hung = malloc(pixels * 3);
    options.max_points = 900;
    for (int32_t i = 0; i < room.tag_count; i++)
        tags[i] = (struct mapper_tag){room.tags[i].id, room.tags[i].side_m * w->sides};
    if (w->one_side > 0)
        tags[w->one].side_m *= w->one_side;
    c.color.fx *= w->focal, c.color.fy *= w->focal, c.color.cx += w->centre_x * width;
    c.depth.fx *= w->focal, c.depth.fy *= w->focal, c.depth.cx += w->centre_x * width;
    EXPECT_STATUS(mapper_open(&m, &c, tags, w->untagged ? 0 : room.tag_count, &options), OK);
    for (int i = 0; i < IMAGES; i++) {
        const uint8_t *color = room.color[i];
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                const int from_x = w->mirrored ? width - 1 - x : x, from_y = w->upturned ? height - 1 - y : y;
                depth[y * width + x] = (uint16_t)fmin(w->unit * room.depth[i][from_y * width + from_x] + 0.5, 65535);
            }
        for (size_t k = 0; k < pixels && w->hung; k++) {
            memcpy(hung + 3 * k, color + 3 * (pixels - 1 - k), 3);
            depth[k] = room.depth[i][pixels - 1 - k];
        }
        color = w->hung ? hung : color;
        EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = time_ns(i), .color = color, .depth = depth}), OK);
    }
    const enum status status = mapper_finish(m, place, report);
    mapper_close(&m);
    free(depth);
    free(hung);
    return status;
}

static enum status map_wrongly(const struct wrong *w, struct mapper_report *report, struct map_advice *advice)
{
    struct place place;
    const enum status status = map_place_wrongly(w, &place, report);
    memset(advice, 0, sizeof *advice);
    if (status == OK)
        map_advise(&place, report, &(struct sweep_trouble){.damaged = 0}, advice);
    place_free(&place);
    return status;
}

static const struct wrong right = {.focal = 1, .unit = 1, .sides = 1};

static bool is_said(const struct map_advice *advice, const char *words)
{
    for (int i = 0; i < advice->count; i++)
        if (strstr(advice->line[i], words))
            return true;
    return false;
}

static void test_right_sweep_is_not_blamed(void **state)
{
    (void)state;
    struct mapper_report r;
    struct map_advice advice;
    struct wrong half_percent = right;
    half_percent.focal = 1.005;
    for (int i = 0; i < (SANITIZED ? 1 : 2); i++) {
        EXPECT_STATUS(map_wrongly(i ? &half_percent : &right, &r, &advice), OK);
        printf("lens %.3f long: fault %d, depth ratio %.3f\n", i ? 1.005 : 1, (int)r.lens.fault, r.depth_ratio);
        EXPECT_INT(r.lens.fault, LENS_FITS);
        EXPECT_NEAR(r.depth_ratio, 1, 0.03);
        EXPECT_TRUE(!is_said(&advice, "calibrat") && !is_said(&advice, "measure the black"));
        room.right = i ? room.right : advice;
    }
}

// The lens is named first, and the tags are not blamed.
static void test_wrong_lens_is_named(void **state)
{
    (void)state;
    const struct {
        struct wrong how;
        enum lens_fault fault;
        double by;
    } lenses[] = {
        {{.focal = 1.04, .unit = 1, .sides = 1}, LENS_FOCAL, 0.04},
        {{.focal = 0.93, .unit = 1, .sides = 1}, LENS_FOCAL, -0.07},
        {{.focal = 1, .centre_x = 0.06, .unit = 1, .sides = 1}, LENS_CENTRE, 0.06},
    };
    for (size_t i = 0; i < COUNT_OF(lenses); i += SANITIZED ? 2 : 1) {
        struct mapper_report r;
        struct map_advice advice;
        EXPECT_STATUS(map_wrongly(&lenses[i].how, &r, &advice), OK);
        printf("fault %d by %.4f (sigma %.4f), in truth %.4f: %s\n", (int)r.lens.fault, r.lens.by, r.lens.sigma,
               lenses[i].by, advice.line[0]);
        EXPECT_INT(r.lens.fault, lenses[i].fault);
        EXPECT_NEAR(r.lens.by, lenses[i].by, 0.015);
        EXPECT_TRUE(strstr(advice.line[0], "calibrate the lens") != NULL);
        EXPECT_TRUE(!is_said(&advice, "correct the list"));
        EXPECT_NEAR(r.depth_ratio, 1, 0.04);
    }
}

static void test_useless_maps_are_refused(void **state)
{
    (void)state;
    const struct {
        struct wrong how;
        const char *words;
    } sweeps[] = {
        {{.focal = 1, .unit = 5, .sides = 1}, "unit_m"},
        {{.focal = 1, .unit = 0.5, .sides = 1}, "unit_m"},
        {{.focal = 1, .unit = 1, .sides = 1, .mirrored = true}, "mirrored"},
        {{.focal = 1, .unit = 1, .sides = 1, .mirrored = true, .untagged = true}, "mirrored against the colour"},
        {{.focal = 1, .unit = 1, .sides = 1, .mirrored = true, .upturned = true}, "upside down"},
        {{.focal = 1.6, .unit = 1, .sides = 1}, "focal length"},
        {{.focal = 1, .unit = 1, .sides = 0.7}, "list of tags"},
    };
    for (size_t i = 0; i < COUNT_OF(sweeps); i += SANITIZED ? 3 : 1) {
        struct mapper_report r;
        struct map_advice advice;
        EXPECT_STATUS(map_wrongly(&sweeps[i].how, &r, &advice), ERR_INPUT);
        printf("%s\n", status_message());
        EXPECT_TRUE(strstr(status_message(), sweeps[i].words) != NULL);
    }
}

// The whole sensor upside down gives the same place, with its floor below: heights of tags, and those that lie face up.
static void test_sensor_hung_upside_down(void **state)
{
    (void)state;
    struct wrong hung = right;
    struct place place;
    struct mapper_report r;
    int32_t count;
    int lying = 0;
    const struct place_tag *truth = world_tags(room.world, &count);
    hung.hung = true;
    EXPECT_STATUS(map_place_wrongly(&hung, &place, &r), OK);
    EXPECT_TRUE(r.floor_from_depth);
    for (int32_t i = 0; i < place.tag_count; i++)
        for (int32_t k = 0; k < count; k++) {
            const struct vec3 face = quat_rotate(place.tags[i].world_from_tag.rotation, v3(0, 0, 1));
            if (truth[k].id != place.tags[i].id)
                continue;
            printf("tag %d: height %.3f, in truth %.3f; it faces up by %.2f\n", (int)truth[k].id,
                   place.tags[i].world_from_tag.translation.z, truth[k].world_from_tag.translation.z, face.z);
            EXPECT_NEAR(place.tags[i].world_from_tag.translation.z, truth[k].world_from_tag.translation.z, 0.05);
            lying += face.z > 0.9;
        }
    EXPECT_AT_LEAST(lying, 1);
    place_free(&place);
}

// All sides of the list off alike: the list is named, and the unit as the other cause.
static void test_scaled_list_is_named(void **state)
{
    (void)state;
    struct mapper_report r;
    struct map_advice advice;
    struct wrong printed = right;
    printed.sides = 0.9;
    EXPECT_STATUS(map_wrongly(&printed, &r, &advice), OK);
    printf("ratio %.3f, in truth %.3f; %d tags\n", r.depth_ratio, 1 / 0.9, (int)r.tags_mapped);
    EXPECT_INT(r.lens.fault, LENS_FITS);
    EXPECT_NEAR(r.depth_ratio, 1 / 0.9, 0.03);
    EXPECT_INT(r.tags_outlier, 0);
    EXPECT_TRUE(is_said(&advice, "correct the list"));
}

// One side of the list is a little off: less than depth shows, but the tag fits worse than the others.
static void test_one_tag_that_fits_badly_is_named(void **state)
{
    (void)state;
    struct mapper_report r;
    struct map_advice advice;
    struct wrong one = right;
    char name[24];
    one.one = 2;
    one.one_side = 1.05;
    snprintf(name, sizeof name, "tag %d fits", (int)room.tags[one.one].id);
    EXPECT_STATUS(map_wrongly(&one, &r, &advice), OK);
    for (int i = 0; i < advice.count; i++)
        printf("%s\n", advice.line[i]);
    EXPECT_INT(r.lens.fault, LENS_FITS);
    EXPECT_TRUE(is_said(&advice, name));
    EXPECT_TRUE(!is_said(&room.right, "fits to"));
}

// A sensor on a stand shows the same again and again: most of it is left out, however long it films.
static void test_still_sensor_is_mapped_from_some_pictures(void **state)
{
    (void)state;
    enum { STILL = 36 };
    const struct lens *lens = &room.calibration.color;
    struct mapper *m;
    struct mapper_report report;
    struct place place;
    uint8_t *color = malloc(lens_pixels(lens) * 3);
    struct mapper_options options = mapper_default_options();
    options.max_points = 600;
    EXPECT_STATUS(mapper_open(&m, &room.calibration, room.tags, room.tag_count, &options), OK);
    for (int i = 0; i < STILL; i++) {
        memcpy(color, room.color[6], lens_pixels(lens) * 3);
        world_color_noise(color, lens->width, lens->height, 900 + (uint64_t)i);
        EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = 33333333LL * i, .color = color, .depth = room.depth[6]}),
                      OK);
    }
    EXPECT_STATUS(mapper_finish(m, &place, &report), OK);
    printf("%d of %d pictures used, %d placed, %d landmarks\n", (int)report.frames, (int)report.frames_seen,
           (int)report.frames_placed, (int)place.point_count);
    EXPECT_INT(report.frames_seen, STILL);
    EXPECT_AT_MOST(report.frames, STILL / 2); // measured 15
    EXPECT_INT(report.frames_placed, report.frames);
    EXPECT_AT_LEAST(place.point_count, 100); // measured 497
    place_free(&place);
    mapper_close(&m);
    free(color);
}

// Why no listed tag is in any picture.
static void test_missing_tags_are_explained(void **state)
{
    (void)state;
    static const char *const words[] = {"mirrored", "correct the numbers", "overexposed", "too dark"};
    const struct lens *lens = &room.calibration.color;
    uint8_t *changed = malloc(lens_pixels(lens) * 3);
    for (int how = 0; how < 4; how++) {
        struct mapper_tag tags[MOST_TAGS];
        struct mapper_report report;
        struct mapper *m;
        struct place place;
        for (int32_t i = 0; i < room.tag_count; i++)
            tags[i] = (struct mapper_tag){how == 1 ? 300 + i : room.tags[i].id, 0.2};
        EXPECT_STATUS(mapper_open(&m, &room.calibration, tags, room.tag_count, NULL), OK);
        for (int i = 0; i < 5; i++) {
            for (size_t k = 0; k < lens_pixels(lens); k++)
                for (size_t c = 0; c < 3; c++) {
                    const size_t x = k % (size_t)lens->width, mirrored = k - x + (size_t)lens->width - 1 - x;
                    const int value = room.color[i][3 * (how ? k : mirrored) + c];
                    changed[3 * k + c] = (uint8_t)(how == 2   ? fmin(4 * value + 120, 255)
                                                   : how == 3 ? value / 40
                                                              : value);
                }
            EXPECT_STATUS(
                mapper_add(m, &(struct frame){.time_ns = time_ns(i), .color = changed, .depth = room.depth[i]}), OK);
        }
        EXPECT_STATUS(mapper_finish(m, &place, &report), ERR_INPUT);
        printf("%s\n", status_message());
        EXPECT_TRUE(strstr(status_message(), words[how]) != NULL);
        mapper_close(&m);
    }
    free(changed);
}

static void test_tags_of_another_family_are_named(void **state)
{
    (void)state;
    const struct lens *lens = &room.calibration.color;
    const size_t pixels = lens_pixels(lens);
    uint8_t *color = malloc(pixels * 4), *gray = color + 3 * pixels;
    struct mapper *m;
    struct mapper_report report;
    struct place place;
    assert_non_null(color);
    EXPECT_STATUS(mapper_open(&m, &room.calibration, room.tags, room.tag_count, NULL), OK);
    for (int i = 0; i < 8; i++) {
        memset(gray, 150 + i, pixels);
        for (int tag = 0; tag < 2; tag++)
            other_tag_draw(6, 5 + tag, gray, lens->width, lens->height, 20 + 5 * i + 130 * tag, 30 + 3 * i, 8);
        for (size_t k = 0; k < 3 * pixels; k++)
            color[k] = gray[k / 3];
        EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = time_ns(i), .color = color, .depth = room.depth[i]}),
                      OK);
    }
    EXPECT_STATUS(mapper_finish(m, &place, &report), ERR_INPUT);
    EXPECT_SAYS("of the family tagStandard41h12");
    mapper_close(&m);
    free(color);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_right_sweep_is_not_blamed),
        cmocka_unit_test(test_wrong_lens_is_named),
        cmocka_unit_test(test_useless_maps_are_refused),
        cmocka_unit_test(test_sensor_hung_upside_down),
        cmocka_unit_test(test_scaled_list_is_named),
        cmocka_unit_test(test_one_tag_that_fits_badly_is_named),
        cmocka_unit_test(test_still_sensor_is_mapped_from_some_pictures),
        cmocka_unit_test(test_missing_tags_are_explained),
        cmocka_unit_test(test_tags_of_another_family_are_named),
    };
    return cmocka_run_group_tests_name("map_lens", tests, film_room, leave_room);
}
