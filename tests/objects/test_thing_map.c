// Sightings become one thing in the map: smaller covariance, moved, gone; an outlier changes nothing.
#include "tests/support/test.h"

#include "objects/thing_map.h"

static struct sighting at(double x, double y, double z, double sigma)
{
    return (struct sighting){.thing = 3,
                             .left_from_thing = {{0, 0, 0, 1}, v3(x, y, z)},
                             .covariance = {sigma * sigma, 0, 0, sigma * sigma, 0, 16 * sigma * sigma}};
}

static const struct pose here = {{0, 0, 0, 1}, {0, 0, 0}};

static void test_sightings_are_averaged_by_their_covariance(void **state)
{
    (void)state;
    struct thing_map map = {0};
    struct rng rng = {7};
    double squares = 0;
    enum { N = 16 };
    print_message("seed 7\n");
    for (int i = 0; i < N; i++) {
        struct sighting s = at(0, 0, 1, 0.002);
        const struct vec3 noise = rng_normal3(&rng, 1);
        s.left_from_thing.translation = v3(0.002 * noise.x, 0.002 * noise.y, 1 + 0.008 * noise.z);
        thing_map_add(&map, &s, &here);
    }
    const struct mapped_thing *t = thing_map_find(&map, 3);
    EXPECT_TRUE(t != NULL);
    EXPECT_INT(t->sightings, N);
    EXPECT_INT(t->moves, 0);
    EXPECT_NEAR(sqrt(t->covariance.xx), 0.002 / 4, 0.0001);
    squares = v3_distance(t->world_from_thing.translation, v3(0, 0, 1));
    EXPECT_AT_MOST(squares, 4 * 0.008 / 4);
    EXPECT_TRUE(thing_map_find(&map, 2) == NULL);
}

// Two cameras that look from different sides: each is uncertain along its own line of sight.
static void test_crossing_lines_of_sight(void **state)
{
    (void)state;
    struct thing_map map = {0};
    const struct pose aside = {quat_from_rotation_vector(v3(0, 1.5707963267948966, 0)), v3(-1, 0, 1)}; // looks along x
    struct sighting s = at(0, 0, 1, 0.001);
    thing_map_add(&map, &s, &here);
    thing_map_add(&map, &s, &aside);
    const struct mapped_thing *t = thing_map_find(&map, 3);
    EXPECT_INT(t->moves, 0);
    EXPECT_AT_MOST(sqrt(t->covariance.zz), 0.0011);
    EXPECT_AT_MOST(v3_distance(t->world_from_thing.translation, v3(0, 0, 1)), 1e-6);
}

static void test_one_outlier_does_not_move_it_and_two_do(void **state)
{
    (void)state;
    struct thing_map map = {0};
    struct sighting s = at(0, 0, 1, 0.002), off = at(0.3, 0, 1, 0.002), other = at(-0.3, 0, 1, 0.002);
    for (int i = 0; i < 3; i++)
        thing_map_add(&map, &s, &here);
    thing_map_add(&map, &off, &here);
    thing_map_add(&map, &other, &here);
    thing_map_add(&map, &s, &here);
    const struct mapped_thing *t = thing_map_find(&map, 3);
    EXPECT_INT(t->moves, 0);
    EXPECT_NEAR(t->world_from_thing.translation.x, 0, 1e-9);
    thing_map_add(&map, &off, &here);
    thing_map_add(&map, &off, &here);
    EXPECT_INT(t->moves, 1);
    EXPECT_NEAR(t->world_from_thing.translation.x, 0.3, 1e-9);
}

static void test_what_is_not_found_is_gone_until_it_is_found(void **state)
{
    (void)state;
    struct thing_map map = {0};
    struct sighting s = at(0, 0, 1, 0.002);
    thing_map_add(&map, &s, &here);
    const struct mapped_thing *t = thing_map_find(&map, 3);
    for (int i = 0; i < THING_MISSES_TO_GONE; i++) {
        EXPECT_TRUE(!t->gone);
        thing_map_miss(&map, 3);
    }
    EXPECT_TRUE(t->gone);
    thing_map_add(&map, &s, &here);
    EXPECT_TRUE(!t->gone);
    thing_map_miss(&map, 5); // never seen: nothing happens
    EXPECT_INT(map.count, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sightings_are_averaged_by_their_covariance),
        cmocka_unit_test(test_crossing_lines_of_sight),
        cmocka_unit_test(test_one_outlier_does_not_move_it_and_two_do),
        cmocka_unit_test(test_what_is_not_found_is_gone_until_it_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
