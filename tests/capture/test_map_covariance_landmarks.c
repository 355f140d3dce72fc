// The covariances of poses from landmarks are consistent, with tags and without: cameras in the synthetic
// world, each with a map of its own that is exact except for the noise of its features.
//
//     test_map_covariance_landmarks [IMAGES [SEED]]      default 12 31
#include "locate/landmark_matching.h"
#include "locate/tag_corners.h"
#include "tests/support/covariance_check.h"
#include "tests/support/random.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 480, HEIGHT = 360, PIXELS = WIDTH * HEIGHT };

static uint8_t rgb[PIXELS * 3], gray[PIXELS];
static uint16_t depth[PIXELS];
static struct world *world;
static int images = 12;
static uint64_t seed = 31;

static void film(struct lens lens, struct pose world_from_camera, uint64_t noise)
{
    struct world_shot shot = {lens, world_from_camera, 0, false};
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = rgb, .depth = depth}), OK);
    world_color_noise(rgb, WIDTH, HEIGHT, noise);
}

// The features of the present image, at their true positions; none at depth edges.
static int map_points(const struct lens *lens, struct pose world_from_camera, struct place_landmark *points)
{
    static struct feature features[FEATURES_MAX];
    int found, count = 0;
    gray_from_rgb(rgb, PIXELS, gray);
    EXPECT_STATUS(features_detect(gray, WIDTH, HEIGHT, features, FEATURES_MAX, &found), OK);
    for (int i = 0; i < found; i++) {
        int x = (int)(features[i].at.x + 0.5), y = (int)(features[i].at.y + 0.5), low = 65535, high = 0;
        if (x < 3 || y < 3 || x > WIDTH - 4 || y > HEIGHT - 4)
            continue;
        for (int k = 0; k < 49; k++) {
            int z = depth[(y + k / 7 - 3) * WIDTH + x + k % 7 - 3];
            low = z < low ? z : low;
            high = z > high ? z : high;
        }
        if (high - low > 0.02 * low)
            continue;
        double z = depth[y * WIDTH + x] * 1e-3;
        points[count].world = pose_apply(world_from_camera, v3_scale(lens_ray(lens, features[i].at), z));
        memcpy(points[count++].descriptor, features[i].descriptor, sizeof points->descriptor);
    }
    return count;
}

// A random view from near the middle of the room.
static struct pose any_view(struct rng *rng)
{
    struct quat level = {-0.7071067811865476, 0, 0, 0.7071067811865476}; // z forward along the world's y, y down
    struct quat rotation = quat_multiply(quat_from_rotation_vector(v3(0, 0, rng_between(rng, -3.14, 3.14))), level);
    rotation =
        quat_multiply(rotation, quat_from_rotation_vector(v3_add(v3(-0.1, 0, 0), rng_within(rng, v3(0.2, 0, 0.2)))));
    return (struct pose){quat_unit(rotation), v3_add(v3(0, 0, 1.45), rng_within(rng, v3(1, 1, 0.25)))};
}

static struct pose perturbed_pose(struct pose view, struct rng *rng)
{
    struct vec3 rotation_vector = rng_within(rng, v3(0.1, 0.1, 0.1));
    struct vec3 shift = rng_within(rng, v3(0.2, 0.2, 0.2));
    return pose_multiply(view, (struct pose){quat_from_rotation_vector(rotation_vector), shift});
}

static void localize(const struct place *place, const struct lens *lens, struct pose truth, struct coverage_count *t)
{
    struct locator_options options = locator_default_options();
    struct locator *l;
    struct location at;
    options.max_position_sigma_m = 10;
    EXPECT_STATUS(locator_open(&l, place, lens, &options), OK);
    if (locator_localize(l, rgb, NULL, &at) == OK && at.points_used)
        coverage_add(t, &at, truth);
    locator_close(&l);
}

static void test_landmark_covariances_are_consistent(void **state)
{
    (void)state;
    static struct place_landmark points[FEATURES_MAX];
    struct world_options o = world_default_options();
    struct lens lens = world_viewer_calibration(0.75).color;
    struct rng rng = {seed};
    struct coverage_count alone = {0}, with_tags = {0};
    int32_t tag_count;
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&world, &o), OK);
    struct place_tag *tags = (struct place_tag *)(uintptr_t)world_tags(world, &tag_count);
    for (int i = 0; i < images; i++) {
        struct pose mapped = any_view(&rng), truth = perturbed_pose(mapped, &rng);
        film(lens, mapped, 100 + 2 * (uint64_t)i);
        int count = map_points(&lens, mapped, points);
        film(lens, truth, 101 + 2 * (uint64_t)i);
        localize(&(struct place){.points = points, .point_count = count}, &lens, truth, &alone);
        localize(&(struct place){.points = points, .point_count = count, .tags = tags, .tag_count = tag_count}, &lens,
                 truth, &with_tags);
    }
    world_close(&world);
    printf("points alone: ");
    print_coverage(&alone);
    printf("points and tags: ");
    print_coverage(&with_tags);
    EXPECT_AT_LEAST(alone.found, images / 2);
    EXPECT_AT_LEAST(with_tags.found, images / 2);
    expect_coverage(&alone);
    expect_coverage(&with_tags);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_landmark_covariances_are_consistent)};
    if (argc > 1)
        images = atoi(argv[1]);
    if (argc > 2)
        seed = (uint64_t)atoi(argv[2]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
