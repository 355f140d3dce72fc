// The covariances of poses from tags are consistent: of cameras with known poses, the expected share
// lies inside the 95 % ellipsoid.
//
//     test_map_covariance [IMAGES]      of each kind; default 20
#include "tests/support/covariance_check.h"
#include "tests/support/random.h"
#include "tests/support/tag_picture.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 320, HEIGHT = 240 };
static const double F_PX = 300;
static uint8_t rgb[WIDTH * HEIGHT * 3];
static int images = 20;

// Adds an error to the mapped pose of a tag: standard deviations in each of its own axes.
static const double MAP_ROTATION = 0.01, MAP_SHIFT_M = 0.002;
static void perturb_map(struct place_tag *tag, struct rng *rng)
{
    const struct vec3 rotation = rng_normal3(rng, MAP_ROTATION);
    const struct pose off = {quat_from_rotation_vector(rotation), rng_normal3(rng, MAP_SHIFT_M)};
    tag->world_from_tag = pose_multiply(tag->world_from_tag, off);
    memset(tag->covariance, 0, sizeof tag->covariance);
    for (int k = 0, i = 0; k < 6; i += 6 - k++)
        tag->covariance[i] = (float)(k < 3 ? MAP_ROTATION * MAP_ROTATION : MAP_SHIFT_M * MAP_SHIFT_M);
}

// Images of the first `count` tags from near and far, oblique and frontal, with `noise` grey levels.
static void observe_tags(int count, double noise, bool inaccurate_map, struct coverage_count *all)
{
    struct place_tag tags[3] = {
        {.id = 3, .side_m = 0.16, .world_from_tag = {{0, 0, 0, 1}, {-0.15, 0.1, 0}}},
        {.id = 58, .side_m = 0.16, .world_from_tag = {{0, 0, 0, 1}, {0.15, 0.05, 0}}},
        {.id = 201, .side_m = 0.16, .world_from_tag = {{0, 0.2588, 0, 0.9659}, {0, -0.15, 0.05}}},
    };
    struct place_tag mapped[3];
    const struct place place = {.tags = mapped, .tag_count = count};
    struct rng errors = {31 + (uint64_t)count};
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX);
    struct locator_options options = locator_default_options();
    struct locator *l;
    struct rng rng = {77 + (uint64_t)count};
    struct coverage_count t = {0};
    options.max_position_sigma_m = 10;
    for (int i = 0; i < images; i++) {
        memcpy(mapped, tags, sizeof mapped);
        for (int k = 0; k < count && inaccurate_map; k++)
            perturb_map(&mapped[k], &errors);
        EXPECT_STATUS(locator_open(&l, &place, &lens, &options), OK);
        double distance = 0.7 + 0.8 * rng_uniform(&rng), yaw = 1.6 * rng_uniform(&rng) - 0.8,
               pitch = 1 * rng_uniform(&rng) - 0.5, roll = 6.28 * rng_uniform(&rng);
        struct tag_picture p = {.lens = lens,
                                .tags = tags,
                                .tag_count = count,
                                .noise = noise,
                                .blur_px = 0.4,
                                .seed = 5000 + (uint64_t)i,
                                .rgb = rgb,
                                .world_from_camera = tag_picture_view(distance, yaw, pitch, roll)};
        struct location at;
        EXPECT_TRUE(tag_picture_draw(&p));
        enum status status = locator_localize(l, rgb, NULL, &at);
        locator_close(&l);
        if (status != OK || at.tags_used < count)
            continue;
        coverage_add(&t, &at, p.world_from_camera);
    }
    printf("%d tags, noise %.0f%s: ", count, noise, inaccurate_map ? ", inaccurate map" : "");
    print_coverage(&t);
    EXPECT_AT_LEAST(t.found, 0.9 * images);
    expect_coverage(&t);
    all->found += t.found;
    all->sum += t.sum;
    all->within_95 += t.within_95;
    all->within_50 += t.within_50;
}

static void test_tag_covariances_are_consistent(void **state)
{
    (void)state;
    struct coverage_count all = {0};
    observe_tags(1, 4, false, &all);
    observe_tags(2, 4, false, &all);
    observe_tags(3, 4, false, &all);
    observe_tags(1, 4, true, &all);
#ifndef EMULATED
    if (!SANITIZED) {
        observe_tags(1, 8, false, &all);
        observe_tags(2, 2, false, &all);
        observe_tags(2, 8, false, &all);
        observe_tags(3, 8, false, &all);
        observe_tags(3, 4, true, &all);
    }
#endif
    printf("together: ");
    print_coverage(&all);
    EXPECT_NEAR((double)all.within_95 / all.found, 0.95, 0.03);
    EXPECT_NEAR((double)all.within_50 / all.found, 0.5, 0.15);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_tag_covariances_are_consistent)};
    if (argc > 1)
        images = atoi(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
