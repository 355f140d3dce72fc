// A place filmed without depth keeps the natural points that its pictures agree on, and a camera found by them is no
// further off than it says, with tags in sight and with all of them taken away.
//
//     test_color_sweep [CAMERAS [SEED]]      default 16 9
#include "capture/mapper.h"
#include "tests/honesty.h"
#include "tests/support/align.h"
#include "tests/world/world.h"

#include <stdlib.h>

enum { SWEEP = 36, LEAST_POINTS = 600 };
// Three numbers of a position: 95 % lie below the first, all but one in a million below the second.
static const double WITHIN_95_SHIFT = 7.815, NEVER = 30.7;

static int cameras = 16;
static uint64_t seed = 9;

static struct {
    struct world *world;
    const struct place_tag *tags; // where they are
    struct place place;
    struct pose world_from_place;
    double tags_off_m;
} room;

static enum status film(struct mapper *m, const struct lens *lens)
{
    uint8_t *color = malloc((size_t)lens->width * (size_t)lens->height * 3);
    EXPECT_TRUE(color != NULL);
    enum status status = OK;
    for (int i = 0; i < SWEEP && status == OK; i++) {
        double time_s = (double)WORLD_SWEEP_S * i / SWEEP;
        struct world_shot shot = {*lens, world_sweep_pose(room.world, time_s), 0, false};
        EXPECT_STATUS(world_render(room.world, &shot, &(struct world_picture){.color = color}), OK);
        world_color_noise(color, lens->width, lens->height, seed * 1000 + (uint64_t)i);
        status = mapper_add(m, &(struct frame){.time_ns = (int64_t)(time_s * 1e9), .color = color});
    }
    free(color);
    return status;
}

static int enter(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    struct calibration camera = {.color = world_calibration(1).color};
    struct mapper_tag listed[32];
    struct mapper *m;
    struct mapper_report report;
    int32_t count;
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&room.world, &o), OK);
    room.tags = world_tags(room.world, &count);
    EXPECT_AT_MOST(count, (int)COUNT_OF(listed));
    for (int32_t i = 0; i < count; i++)
        listed[i] = (struct mapper_tag){room.tags[i].id, room.tags[i].side_m};
    EXPECT_STATUS(mapper_open(&m, &camera, listed, count, NULL), OK);
    EXPECT_STATUS(film(m, &camera.color), OK);
    EXPECT_STATUS(mapper_finish(m, &room.place, &report), OK);
    mapper_close(&m);
    EXPECT_INT(report.frames_placed, SWEEP);
    EXPECT_INT(room.place.tag_count, count);
    room.tags_off_m = align_tags(&room.place, room.tags, count, &room.world_from_place);
    return 0;
}

static int leave(void **state)
{
    (void)state;
    place_free(&room.place);
    world_close(&room.world);
    return 0;
}

static void tags_are_where_they_say(void **state)
{
    (void)state;
    double squared = tags_squared(&room.place, room.tags, room.world_from_place);
    printf("%d tags within %.2f mm rms, off by %.1f where 6 is said\n", (int)room.place.tag_count, room.tags_off_m * 1e3,
           squared);
    EXPECT_AT_MOST(room.tags_off_m, 0.003);
    EXPECT_AT_MOST(squared, 2 * 6);
}

static void points_are_kept(void **state)
{
    (void)state;
    printf("%d points\n", (int)room.place.point_count);
    EXPECT_AT_LEAST(room.place.point_count, LEAST_POINTS);
    for (int32_t i = 0; i < room.place.point_count; i++) {
        const struct place_point *p = &room.place.points[i];
        EXPECT_TRUE(p->covariance[0] > 0); // each says how surely it is known
        EXPECT_AT_MOST(hypot(hypot((double)p->seen_from[0], (double)p->seen_from[1]), (double)p->seen_from[2]), 1.000001);
    }
}

// Squared error of a position in standard deviations.
static double shift_squared(struct pose found, const double covariance[36], struct pose truth)
{
    struct vec3 off = pose_multiply(pose_inverse(found), truth).translation;
    const double d[3] = {off.x, off.y, off.z};
    double shift[9], inverse[9], sum = 0;
    for (int i = 0; i < 9; i++)
        shift[i] = covariance[(3 + i / 3) * 6 + 3 + i % 3];
    EXPECT_TRUE(invert_symmetric(shift, 3, inverse));
    for (int i = 0; i < 9; i++)
        sum += d[i / 3] * inverse[i] * d[i % 3];
    return sum;
}

// Where the tablet is found on its way, each picture by itself.
static void look(const char *name, const struct place *place, int least_found)
{
    struct calibration viewer = world_viewer_calibration(1);
    uint8_t *color = malloc((size_t)viewer.color.width * (size_t)viewer.color.height * 3);
    struct locator *l;
    int found = 0, within = 0;
    double squares = 0, worst_m = 0, sum = 0, worst = 0;
    EXPECT_TRUE(color != NULL);
    EXPECT_STATUS(locator_open(&l, place, &viewer.color, NULL), OK);
    for (int i = 0; i < cameras; i++) {
        double time_s = world_seconds(room.world) * i / cameras;
        struct world_shot shot = {viewer.color, world_viewer_pose(room.world, time_s), time_s, false};
        struct location at;
        EXPECT_STATUS(world_render(room.world, &shot, &(struct world_picture){.color = color}), OK);
        world_color_noise(color, viewer.color.width, viewer.color.height, seed * 1000 + 500 + (uint64_t)i);
        enum status status = locator_find(l, color, NULL, &at);
        EXPECT_TRUE(status >= 0);
        if (status != OK)
            continue;
        struct pose in_world = pose_multiply(room.world_from_place, at.world_from_camera);
        double off = v3_distance(in_world.translation, shot.world_from_camera.translation);
        double e = shift_squared(in_world, at.covariance, shot.world_from_camera);
        if (e > WITHIN_95_SHIFT)
            printf("  %d: %.1f mm where %.1f are said, %d points, %d tags\n", i, off * 1e3, at.position_sigma_m * 1e3,
                   (int)at.points_used, (int)at.tags_used);
        found++;
        within += e <= WITHIN_95_SHIFT;
        squares += off * off;
        sum += e;
        worst_m = fmax(worst_m, off);
        worst = fmax(worst, e);
    }
    printf("%s: %d of %d found, %.1f mm rms, worst %.1f mm, %d within 95 %%, %.1f where 3 is said, worst %.1f\n", name,
           found, cameras, sqrt(squares / found) * 1e3, worst_m * 1e3, within, sum / found, worst);
    EXPECT_AT_LEAST(found, least_found);
    // All of them stand on the errors of one map, so chance makes more of a difference than among as many maps.
    EXPECT_AT_MOST(sum / found, 2 * 3);
    EXPECT_AT_MOST(worst, NEVER);
    locator_close(&l);
    free(color);
}

static void with_tags_in_sight(void **state)
{
    (void)state;
    look("tags and points", &room.place, cameras - 1);
}

static void with_tags_taken_away(void **state)
{
    (void)state;
    struct place bare = room.place;
    bare.tag_count = 0;
    look("points alone", &bare, cameras * 3 / 4);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tags_are_where_they_say),
        cmocka_unit_test(points_are_kept),
        cmocka_unit_test(with_tags_in_sight),
        cmocka_unit_test(with_tags_taken_away),
    };
    if (argc > 1)
        cameras = atoi(argv[1]);
    if (argc > 2)
        seed = (uint64_t)atoi(argv[2]);
    return cmocka_run_group_tests(tests, enter, leave);
}
