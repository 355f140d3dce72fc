// Things looked for in single pictures with known poses: placed by size, and better by depth; what depth contradicts is
// left out.
#include "tests/support/test.h"

#include "objects/thing_search.h"
#include "tests/support/desk.h"
#include "tests/support/random.h"

#include <math.h>
#include <string.h>

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
static void film_depth(const struct desk *d, const struct lens *lens, const struct pose *world_from_camera,
                       double factor, uint64_t seed)
{
    struct rng rng = {seed};
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 ray = lens_ray(lens, (struct pixel){i % W, i / W});
        double nearest = 0;
        for (int t = 0; t < DESK_THINGS / 2; t++) {
            const struct pose thing_from_camera =
                pose_multiply(pose_inverse(d->world_from_thing[t]), *world_from_camera);
            const struct vec3 from = thing_from_camera.translation,
                              along = quat_rotate(thing_from_camera.rotation, ray);
            const double z = -from.z / along.z;
            const struct vec3 p = v3_add(from, v3_scale(along, z));
            if (z > 0 && fabs(p.x) < d->storage[t].width_m / 2 && fabs(p.y) < d->storage[t].height_m / 2 &&
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
        film_depth(&desk, &desk.rig.left, &places[i], factor, SEED + 7 + (uint64_t)i);
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

// ---------------------------------------------------------------- an earlier time, and now

// Viewpoints: so many that an empty place is believed to be empty, and one where something stands that is not the
// thing.
enum { THERE = DESK_THINGS / 2, FEW = 4, MANY = 7 };
static const double WALL_M = 2;
static const double from[MANY][2] = {{-0.06, -0.08}, {0.06, -0.08}, {-0.06, 0.04}, {0.06, 0.04},
                                     {0.18, -0.08},  {0.18, 0.04},  {0.06, 0.16}};
static const struct vec3 away = {0, 0, -40}; // behind the cameras

// A grey board upright before the desk, facing the cameras: what is behind it is hidden.
struct board {
    double left, right, top, bottom, z; // world; right <= left: none
};

// Makes all else that the depth shows the wall.
static void put_board(const struct lens *lens, const struct pose *world_from_camera, const struct board *b)
{
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 ray = quat_rotate(world_from_camera->rotation, lens_ray(lens, (struct pixel){i % W, i / W}));
        const double along = (b->z - world_from_camera->translation.z) / ray.z;
        const struct vec3 at = v3_add(world_from_camera->translation, v3_scale(ray, along));
        if (!depth[i])
            depth[i] = (uint16_t)(1e3 * (WALL_M - world_from_camera->translation.z) / ray.z);
        if (at.x > b->left && at.x < b->right && at.y > b->top && at.y < b->bottom) {
            depth[i] = (uint16_t)(1e3 * along);
            memset(rgb + (size_t)3 * (size_t)i, 120, 3);
        }
    }
}

// Looks for the things that stand, which were known where `before` has them, in pictures of the desk as it is now.
static void look(const struct desk *before, const struct desk *now, const struct board *board, int viewpoints,
                 bool with_depth, struct thing_map *map)
{
    struct thing_search *s;
    const struct thing_list things = {desk.storage, THERE};
    const struct depth_view view = {depth, desk.rig.left, POSE_IDENTITY};
    const struct covariance3 known = covariance3_isotropic(1e-5);
    int sightings, contradicted;
    EXPECT_STATUS(thing_search_open(&s, &things), OK);
    for (int t = 0; t < THERE; t++)
        thing_search_expect(s, t, &before->world_from_thing[t], &known);
    for (int i = 0; i < viewpoints; i++) {
        const struct pose camera = {{0, 0, 0, 1}, v3(from[i][0], from[i][1], -0.2)};
        desk_film(now, &desk.rig.left, &camera, 2, SEED + 20 + (uint64_t)i, rgb);
        film_depth(now, &desk.rig.left, &camera, 1, SEED + 40 + (uint64_t)i);
        put_board(&desk.rig.left, &camera, board);
        EXPECT_STATUS(thing_search_add(s, &desk.rig.left, camera, rgb, with_depth ? &view : NULL), OK);
    }
    EXPECT_STATUS(thing_search_finish(s, map, &sightings, &contradicted), OK);
    thing_search_close(&s);
    for (int t = 0; t < THERE; t++) {
        const struct mapped_thing *found = thing_map_find(map, t);
        EXPECT_TRUE(found != NULL);
        print_message("%s: %d sightings, moved %d times, off by %.1f mm%s\n", desk.storage[t].name, found->sightings,
                      found->moves,
                      1e3 * v3_distance(found->world_from_thing.translation, now->world_from_thing[t].translation),
                      found->gone ? ", gone" : "");
    }
}

static const struct board no_board = {0, 0, 0, 0, 0.2};

// One is moved, one is taken away, the others stay.
static void test_moved_taken_away_and_still_there(void **state)
{
    (void)state;
    enum { MOVED = 0, AWAY = 2 };
    struct desk now = desk;
    struct thing_map map;
    now.world_from_thing[MOVED].translation = v3_add(desk.world_from_thing[MOVED].translation, v3(0.02, -0.16, 0.05));
    now.world_from_thing[AWAY].translation = away;
    look(&desk, &now, &no_board, FEW, true, &map);
    for (int t = 0; t < THERE; t++) {
        const struct mapped_thing *found = thing_map_find(&map, t);
        EXPECT_INT(found->gone, t == AWAY);
        EXPECT_INT(found->moves > 0, t == MOVED);
        if (t != AWAY) // the turned ones are certain to their width along the line of sight
            EXPECT_AT_MOST(v3_distance(found->world_from_thing.translation, now.world_from_thing[t].translation), 0.05);
    }
}

// Both are away, but one's place is behind a board, and the other's out of every picture.
static void test_what_is_hidden_or_out_of_view_is_not_gone(void **state)
{
    (void)state;
    enum { HIDDEN = 1, OUTSIDE = 3 };
    struct desk before = desk, now = desk;
    struct thing_map map;
    const struct vec3 at = desk.world_from_thing[HIDDEN].translation;
    const struct board board = {at.x - 0.14, at.x + 0.14, at.y - 0.09, at.y + 0.09, at.z - 0.2};
    now.world_from_thing[HIDDEN].translation = now.world_from_thing[OUTSIDE].translation = away;
    before.world_from_thing[OUTSIDE].translation.x += 3;
    look(&before, &now, &board, MANY, true, &map);
    for (int t = 0; t < THERE; t++)
        EXPECT_TRUE(!thing_map_find(&map, t)->gone);
    EXPECT_INT(thing_map_find(&map, HIDDEN)->sightings, 0);
    EXPECT_INT(thing_map_find(&map, OUTSIDE)->sightings, 0);
    EXPECT_AT_LEAST(thing_map_find(&map, 0)->sightings, 1); // the board does not hide it
}

// Without depth nobody knows what stands before it.
static void test_without_depth_nothing_is_gone(void **state)
{
    (void)state;
    struct desk now = desk;
    struct thing_map map;
    for (int t = 0; t < THERE; t++)
        now.world_from_thing[t].translation = away;
    look(&desk, &now, &no_board, FEW, false, &map);
    for (int t = 0; t < THERE; t++)
        EXPECT_TRUE(!thing_map_find(&map, t)->gone);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_places_things_better_than_size),
        cmocka_unit_test(test_what_depth_contradicts_is_left_out),
        cmocka_unit_test(test_moved_taken_away_and_still_there),
        cmocka_unit_test(test_what_is_hidden_or_out_of_view_is_not_gone),
        cmocka_unit_test(test_without_depth_nothing_is_gone),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
