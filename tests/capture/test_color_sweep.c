// A place filmed without depth keeps landmarks that are triangulated consistently, and poses from them are as accurate
// as their covariances say, with tags in sight and with all tags removed.
//
//     test_color_sweep [CAMERAS [SEED]]      default 8 9
#include "capture/mapping/mapper.h"
#include "tests/support/align.h"
#include "tests/support/covariance_check.h"
#include "tests/world/world.h"

#include <stdlib.h>

enum { SWEEP = 36, MIN_POINTS = 1000 };
// Quantiles of chi-square with three degrees of freedom: 95 %, and all but one in a million.
static const double WITHIN_95_SHIFT = 7.815, ONE_IN_A_MILLION = 30.7;

static int cameras = 8;
static uint64_t seed = 9;

static struct {
    struct world *world;
    const struct place_tag *tags; // the true ones
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
        EXPECT_STATUS(world_render(room.world, &shot, &(struct world_image){.color = color}), OK);
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

static void test_tag_poses_are_consistent(void **state)
{
    (void)state;
    double squared = tags_mahalanobis_squared(&room.place, room.tags, room.world_from_place);
    printf("%d tags within %.2f mm rms, squared Mahalanobis distance %.1f, expected 6\n", (int)room.place.tag_count,
           room.tags_off_m * 1e3, squared);
    EXPECT_AT_MOST(room.tags_off_m, 0.0015);
    EXPECT_AT_MOST(squared, 2 * 6);
}

static void test_landmarks_are_kept(void **state)
{
    (void)state;
    printf("%d points\n", (int)room.place.point_count);
    EXPECT_AT_LEAST(room.place.point_count, MIN_POINTS);
    for (int32_t i = 0; i < room.place.point_count; i++) {
        const struct place_landmark *p = &room.place.points[i];
        EXPECT_TRUE(p->covariance[0] > 0); // has a covariance
        struct vec3 from = v3((double)p->seen_from[0], (double)p->seen_from[1], (double)p->seen_from[2]);
        EXPECT_AT_LEAST(v3_length(from), 0.1); // and a viewing direction
        EXPECT_AT_MOST(v3_length(from), 1.000001);
    }
}

// Squared Mahalanobis distance of a position.
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

// Errors of the tablet's poses, each image localised by itself.
struct found {
    int images, within;
    double squares, worst_m; // of errors, metres
    double sum, worst;       // of squared Mahalanobis distances
};

static void find(struct locator *l, const uint8_t *color, struct pose truth, struct found *f)
{
    struct location at;
    enum status status = locator_localize(l, color, NULL, &at);
    EXPECT_TRUE(status >= 0);
    if (status != OK)
        return;
    struct pose in_world = pose_multiply(room.world_from_place, at.world_from_camera);
    double off = v3_distance(in_world.translation, truth.translation);
    double e = shift_squared(in_world, at.covariance, truth);
    if (e > WITHIN_95_SHIFT)
        printf("  %.1f mm where sigma is %.1f, %d points, %d tags\n", off * 1e3, at.position_sigma_m * 1e3,
               (int)at.points_used, (int)at.tags_used);
    f->images++;
    f->within += e <= WITHIN_95_SHIFT;
    f->squares += off * off;
    f->sum += e;
    f->worst_m = fmax(f->worst_m, off);
    f->worst = fmax(f->worst, e);
}

static void expect_consistent(const char *name, const struct found *f, int least_found)
{
    printf("%s: %d of %d found, %.1f mm rms, worst %.1f mm, %d within 95 %%, squared Mahalanobis distance %.1f, "
           "expected 3, worst %.1f\n",
           name, f->images, cameras, sqrt(f->squares / f->images) * 1e3, f->worst_m * 1e3, f->within,
           f->sum / f->images, f->worst);
    EXPECT_AT_LEAST(f->images, least_found);
    // All poses share the errors of one map, so the mean varies more than over as many maps.
    EXPECT_AT_MOST(f->sum / f->images, 2 * 3);
    EXPECT_AT_MOST(f->worst, ONE_IN_A_MILLION);
}

static void test_camera_poses_are_consistent(void **state)
{
    (void)state;
    const struct lens lens = world_viewer_calibration(1).color;
    uint8_t *color = malloc((size_t)lens.width * (size_t)lens.height * 3);
    struct place bare = room.place; // without its tags
    struct locator *with_tags, *without;
    struct found with_tags_in_sight = {0}, removed = {0};
    EXPECT_TRUE(color != NULL);
    bare.tag_count = 0;
    EXPECT_STATUS(locator_open(&with_tags, &room.place, &lens, NULL), OK);
    EXPECT_STATUS(locator_open(&without, &bare, &lens, NULL), OK);
    for (int i = 0; i < cameras; i++) {
        double time_s = world_seconds(room.world) * i / cameras;
        struct world_shot shot = {lens, world_viewer_pose(room.world, time_s), time_s, false};
        EXPECT_STATUS(world_render(room.world, &shot, &(struct world_image){.color = color}), OK);
        world_color_noise(color, lens.width, lens.height, seed * 1000 + 500 + (uint64_t)i);
        find(with_tags, color, shot.world_from_camera, &with_tags_in_sight);
        find(without, color, shot.world_from_camera, &removed);
    }
    expect_consistent("tags and points", &with_tags_in_sight, cameras - 1);
    expect_consistent("points alone", &removed, cameras * 3 / 4);
    locator_close(&with_tags);
    locator_close(&without);
    free(color);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tag_poses_are_consistent),
        cmocka_unit_test(test_landmarks_are_kept),
        cmocka_unit_test(test_camera_poses_are_consistent),
    };
    if (argc > 1)
        cameras = atoi(argv[1]);
    if (argc > 2)
        seed = (uint64_t)atoi(argv[2]);
    printf("%d cameras, seed %llu\n", cameras, (unsigned long long)seed);
    return cmocka_run_group_tests(tests, enter, leave);
}
