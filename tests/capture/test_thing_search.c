// Things looked for in single pictures with known poses: placed by size, and better by depth; what depth contradicts is
// left out.
#include "capture/objects/thing_search.h"
#include "tests/support/desk.h"
#include "tests/support/random.h"
#include "tests/support/test.h"

#include <math.h>

enum { SEED = 33, W = 640, H = 480, PIXELS = W * H };

static struct desk desk;
static uint8_t rgb[PIXELS * 3];
static uint16_t depth[PIXELS];

static int make(void **state)
{
    (void)state;
    print_message("seed %d\n", SEED);
    return !desk_make(&desk, SEED);
}

static int tidy(void **state)
{
    (void)state;
    desk_free(&desk);
    return 0;
}

// Depth of the things' fronts as planes, with a structured-light sensor's noise; `factor`: of all of it.
static void film_depth(const struct lens *lens, const struct pose *world_from_camera, double factor, uint64_t seed)
{
    struct rng rng = {seed};
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 ray = lens_ray(lens, (struct pixel){i % W, i / W});
        double nearest = 0;
        for (int t = 0; t < DESK_THINGS / 2; t++) {
            const struct pose thing_from_camera =
                pose_multiply(pose_inverse(desk.world_from_thing[t]), *world_from_camera);
            const struct vec3 from = thing_from_camera.translation,
                              along = quat_rotate(thing_from_camera.rotation, ray);
            const double z = -from.z / along.z;
            const struct vec3 p = v3_add(from, v3_scale(along, z));
            if (z > 0 && fabs(p.x) < desk.storage[t].width_m / 2 && fabs(p.y) < desk.storage[t].height_m / 2 &&
                (!(nearest > 0) || z < nearest))
                nearest = z;
        }
        const double noise =
            1.5e-3 * nearest * nearest * (rng_uniform(&rng) + rng_uniform(&rng) + rng_uniform(&rng) - 1.5) * 2;
        depth[i] = (uint16_t)(nearest > 0 ? factor * 1e3 * (nearest + noise) + 0.5 : 0);
    }
}

static const struct pose places[2] = {{{0, 0, 0, 1}, {0.05, 0, -0.15}}, {{0, 0, 0, 1}, {-0.05, -0.02, -0.1}}};

static void search(double factor, bool with_depth, struct thing_map *map, int *sightings, int *contradicted)
{
    struct thing_search *s;
    const struct depth_view view = {depth, desk.rig.left, POSE_IDENTITY};
    EXPECT_STATUS(thing_search_open(&s, &desk.things), OK);
    for (int i = 0; i < 2; i++) {
        desk_film(&desk, &desk.rig.left, &places[i], 2, SEED + 1 + (uint64_t)i, rgb);
        film_depth(&desk.rig.left, &places[i], factor, SEED + 7 + (uint64_t)i);
        EXPECT_STATUS(thing_search_add(s, &desk.rig.left, places[i], rgb, with_depth ? &view : NULL), OK);
    }
    EXPECT_STATUS(thing_search_finish(s, map, sightings, contradicted), OK);
    thing_search_close(&s);
    EXPECT_TRUE(!s);
}

// The largest error in space of flat things, of which the test's depth is true.
static double largest_error(const struct thing_map *map, double *sigma)
{
    double largest = 0;
    *sigma = 0;
    for (int i = 0; i < map->count; i++) {
        const struct mapped_thing *t = &map->things[i];
        EXPECT_TRUE(t->thing < DESK_THINGS / 2);
        if (desk.turned[t->thing])
            continue;
        const double error = v3_distance(t->world_from_thing.translation, desk.world_from_thing[t->thing].translation);
        print_message("%s: off by %.1f mm, standard deviation %.1f mm, %d sightings\n", desk.storage[t->thing].name,
                      1e3 * error, 1e3 * sqrt(covariance3_trace(&t->covariance)), t->sightings);
        EXPECT_AT_MOST(error, 4 * sqrt(covariance3_trace(&t->covariance)));
        largest = fmax(largest, error);
        *sigma = fmax(*sigma, sqrt(covariance3_trace(&t->covariance)));
    }
    return largest;
}

static void test_depth_places_things_better_than_size(void **state)
{
    (void)state;
    struct thing_map by_size, by_depth;
    int sightings, contradicted;
    double size_sigma, depth_sigma;
    search(1, false, &by_size, &sightings, &contradicted);
    EXPECT_AT_LEAST(by_size.count, 3);
    EXPECT_INT(contradicted, 0);
    EXPECT_AT_MOST(largest_error(&by_size, &size_sigma), 0.02);
    search(1, true, &by_depth, &sightings, &contradicted);
    EXPECT_INT(by_depth.count, by_size.count);
    EXPECT_AT_LEAST(sightings, by_depth.count);
    EXPECT_AT_MOST(largest_error(&by_depth, &depth_sigma), 0.008);
    EXPECT_AT_MOST(depth_sigma, size_sigma);
}

// A picture of the thing that hangs nearer and is smaller.
static void test_what_depth_contradicts_is_left_out(void **state)
{
    (void)state;
    struct thing_map map;
    int sightings, contradicted;
    search(0.6, true, &map, &sightings, &contradicted);
    print_message("%d sightings, %d contradicted\n", sightings, contradicted);
    EXPECT_AT_LEAST(contradicted, 4);
    EXPECT_INT(map.count, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_places_things_better_than_size),
        cmocka_unit_test(test_what_depth_contradicts_is_left_out),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
