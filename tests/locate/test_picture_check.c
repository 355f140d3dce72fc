// Whether pictures and lens belong together: a tablet's walk through the small world, mapped with its true lens, with
// the lens or the pictures changed.
#include "tests/support/test.h"

#include "capture/mapping/mapper.h"
#include "locate/camera_tracker.h"
#include "locate/picture_check.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { SWEEP = 24, WALK = 6 };

static struct {
    struct world *world;
    struct place place;
    struct lens lens;
    uint8_t *walk[WALK];
} room;

static int64_t sweep_ns(int i) { return (int64_t)(1e9 * WORLD_SWEEP_S / 2 * i / SWEEP); }

static void map_room(void)
{
    const struct calibration c = world_calibration(0.5);
    const size_t pixels = lens_pixels(&c.color);
    int32_t count;
    struct mapper_tag tags[32];
    struct mapper *m;
    struct mapper_report report;
    uint8_t *color = malloc(pixels * 3);
    uint16_t *depth = malloc(pixels * sizeof *depth);
    const struct place_tag *all = world_tags(room.world, &count);
    for (int32_t i = 0; i < count; i++)
        tags[i] = (struct mapper_tag){all[i].id, all[i].side_m};
    struct mapper_options options = mapper_default_options();
    options.max_points = SANITIZED ? 700 : 1500;
    EXPECT_STATUS(mapper_open(&m, &c, tags, count, &options), OK);
    for (int i = 0; i < SWEEP; i++) {
        const struct world_shot shot = {c.color, world_sweep_pose(room.world, (double)sweep_ns(i) * 1e-9), 0, false};
        EXPECT_STATUS(world_render(room.world, &shot, &(struct world_image){.color = color, .depth = depth}), OK);
        world_color_noise(color, c.color.width, c.color.height, 100 + (uint64_t)i);
        EXPECT_STATUS(world_depth_noise(&shot.lens, depth, 50 + (uint64_t)i, depth), OK);
        EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = sweep_ns(i), .color = color, .depth = depth}), OK);
    }
    EXPECT_STATUS(mapper_finish(m, &room.place, &report), OK);
    mapper_close(&m);
    free(color);
    free(depth);
}

static int film_room(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&room.world, &o), OK);
    map_room();
    room.lens = world_viewer_calibration(0.5).color;
    for (int i = 0; i < WALK; i++) { // over the part of the room that the sweep showed
        const struct world_shot shot = {room.lens, world_sweep_pose(room.world, 0.4 + 0.8 * i), 0, false};
        room.walk[i] = malloc(lens_pixels(&room.lens) * 3);
        EXPECT_STATUS(world_render(room.world, &shot, &(struct world_image){.color = room.walk[i]}), OK);
        world_color_noise(room.walk[i], room.lens.width, room.lens.height, 7 + (uint64_t)i);
    }
    return 0;
}

static int leave_room(void **state)
{
    (void)state;
    for (int i = 0; i < WALK; i++)
        free(room.walk[i]);
    place_free(&room.place);
    world_close(&room.world);
    return 0;
}

// ---------------------------------------------------------------- changed pictures

typedef void change(const uint8_t *from, uint8_t *to, const struct lens *lens);

static void as_filmed(const uint8_t *from, uint8_t *to, const struct lens *lens)
{
    memcpy(to, from, lens_pixels(lens) * 3);
}

static void in_a_mirror(const uint8_t *from, uint8_t *to, const struct lens *lens)
{
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++)
            memcpy(to + 3 * (y * lens->width + x), from + 3 * (y * lens->width + lens->width - 1 - x), 3);
}

// Squeezed to three quarters of the height, black above and below.
static void letterboxed(const uint8_t *from, uint8_t *to, const struct lens *lens)
{
    const int bar = lens->height / 8, high = lens->height - 2 * bar;
    memset(to, 0, lens_pixels(lens) * 3);
    for (int y = 0; y < high; y++)
        memcpy(to + 3 * (y + bar) * lens->width, from + 3 * (y * lens->height / high) * lens->width,
               3 * (size_t)lens->width);
}

static void overexposed(const uint8_t *from, uint8_t *to, const struct lens *lens)
{
    for (size_t i = 0; i < lens_pixels(lens) * 3; i++)
        to[i] = (uint8_t)(from[i] * 3 + 60 > 255 ? 255 : from[i] * 3 + 60);
}

static struct picture_verdict check(const struct lens *lens, change *how)
{
    struct picture_check *c;
    struct picture_verdict verdict;
    uint8_t *color = malloc(lens_pixels(lens) * 3);
    EXPECT_STATUS(picture_check_open(&c, &room.place, lens), OK);
    for (int i = 0; i < WALK; i++) {
        how(room.walk[i], color, lens);
        EXPECT_STATUS(picture_check_add(c, color), OK);
    }
    EXPECT_STATUS(picture_check_judge(c, lens, &verdict), OK);
    picture_check_close(&c);
    free(color);
    printf("%d of %d recognised, fault %d by %.3f (sigma %.3f), mirrored %d, bars %d, overexposed %d\n",
           verdict.recognised, verdict.looked_at, (int)verdict.lens.fault, verdict.lens.by, verdict.lens.sigma,
           (int)verdict.mirrored, (int)verdict.barred, (int)verdict.overexposed);
    return verdict;
}

static void expect_cause(const struct picture_verdict *v, const char *words, bool expect_useless)
{
    char text[PICTURE_TEXT_BYTES];
    bool useless;
    picture_verdict_text(v, true, text, &useless);
    printf("%s\n", text);
    EXPECT_TRUE(*words ? strstr(text, words) != NULL : !*text);
    EXPECT_INT(useless, expect_useless);
}

static void test_right_lens_is_not_blamed(void **state)
{
    (void)state;
    const struct picture_verdict v = check(&room.lens, as_filmed);
    EXPECT_AT_LEAST(v.recognised, WALK - 1);
    expect_cause(&v, "", false);
}

static void test_wrong_focal_length_is_named(void **state)
{
    (void)state;
    const double times[] = {0.5, 0.8, 1.3};
    for (size_t i = 0; i < COUNT_OF(times); i += SANITIZED ? 2 : 1) {
        struct lens lens = room.lens;
        lens.fx *= times[i];
        lens.fy *= times[i];
        const struct picture_verdict v = check(&lens, as_filmed);
        EXPECT_INT(v.lens.fault, LENS_FOCAL);
        EXPECT_NEAR(v.lens.by, times[i] - 1, 0.04);
        expect_cause(&v, times[i] > 1 ? "too long" : "too short", true);
    }
}

static void test_changed_pictures_are_named(void **state)
{
    (void)state;
    struct picture_verdict v = check(&room.lens, in_a_mirror);
    expect_cause(&v, "mirrored", true);
    v = check(&room.lens, letterboxed);
    EXPECT_INT(v.lens.fault, LENS_STRETCHED);
    EXPECT_NEAR(v.lens.by, -0.25, 0.04);
    expect_cause(&v, "black bars", true);
    if (SANITIZED)
        return;
    v = check(&room.lens, overexposed);
    expect_cause(&v, "overexposed", false);
}

// In a place of tags alone the tags tell.
static void test_mirrored_tags_are_named(void **state)
{
    (void)state;
    const int32_t points = room.place.point_count;
    room.place.point_count = 0;
    struct picture_verdict v = check(&room.lens, in_a_mirror);
    expect_cause(&v, "mirrored", true);
    v = check(&room.lens, as_filmed);
    EXPECT_TRUE(!v.mirrored);
    room.place.point_count = points;
}

// No pose is better than one that is metres off.
static void test_no_pose_of_mirrored_pictures(void **state)
{
    (void)state;
    struct locator *l;
    int placed[2] = {0, 0};
    uint8_t *color = malloc(lens_pixels(&room.lens) * 3);
    EXPECT_STATUS(locator_open(&l, &room.place, &room.lens, NULL), OK);
    const int last = SANITIZED ? 4 : 2 * WALK;
    for (int i = 0; i < last; i++) {
        struct location at;
        (i % 2 ? as_filmed : in_a_mirror)(room.walk[i / 2], color, &room.lens);
        const enum status found = locator_localize(l, color, NULL, &at);
        printf("picture %d%s: %d\n", i / 2, i % 2 ? "" : ", mirrored", (int)found);
        placed[i % 2] += found != NOTHING;
    }
    EXPECT_INT(placed[0], 0);
    EXPECT_INT(placed[1], last / 2);
    locator_close(&l);
    free(color);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_right_lens_is_not_blamed),     cmocka_unit_test(test_wrong_focal_length_is_named),
        cmocka_unit_test(test_changed_pictures_are_named),   cmocka_unit_test(test_mirrored_tags_are_named),
        cmocka_unit_test(test_no_pose_of_mirrored_pictures),
    };
    return cmocka_run_group_tests_name("picture_check", tests, film_room, leave_room);
}
