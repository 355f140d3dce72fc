// Alignment of depth: branch and bound gives the exhaustive search's answer, and captures of a small world are placed
// where they were, also when the odometry jumps, where one flat wall leaves a shift open, and where a person walks by.
#include "tests/support/test.h"

#include "base/portable_math.h"
#include "surround/alignment/depth_alignment.h"
#include "surround/drive/simulated_rover.h"
#include "surround/surroundings.h"

#include <stdio.h>

enum { POINTS = 300, CLOUDS = 6 };

// Every turn and shift. cells: scratch, two numbers a point.
static struct search_result try_all(const struct search_grid *grid, const double (*points)[2], const double guess[3],
                                    const struct search_options *options, int (*cells)[2])
{
    const double share = 65536.0 * 0.01 * POINTS, shift = SEARCH_CELL_M / (0.05 * options->prior),
                 step = SEARCH_TURN_STEP / (0.02 * options->prior);
    const int64_t per_shift = (int64_t)(share * shift * shift) + 1, per_turn = (int64_t)(share * step * step) + 1;
    struct search_result best = {.score = INT64_MIN};
    for (int turn = -options->turns; turn <= options->turns; turn++) {
        const double angle = guess[2] + turn * SEARCH_TURN_STEP, c = portable_cos(angle), s = portable_sin(angle);
        for (int i = 0; i < POINTS; i++) {
            cells[i][0] = (int)floor((c * points[i][0] - s * points[i][1] + guess[0] - grid->x0) / SEARCH_CELL_M);
            cells[i][1] = (int)floor((s * points[i][0] + c * points[i][1] + guess[1] - grid->y0) / SEARCH_CELL_M);
        }
        for (int y = -options->reach; y <= options->reach; y++)
            for (int x = -options->reach; x <= options->reach; x++) {
                int hits = 0;
                for (int i = 0; i < POINTS; i++) {
                    const int u = cells[i][0] + x, v = cells[i][1] + y;
                    hits += u >= 0 && v >= 0 && u < grid->width && v < grid->height &&
                            grid->levels[0][(size_t)v * (size_t)grid->width + (size_t)u];
                }
                best.lookups += POINTS;
                const int64_t score =
                    (int64_t)hits * 65536 - per_shift * (x * (int64_t)x + y * (int64_t)y) - per_turn * turn * turn;
                if (score > best.score) // of equal ones the first in this order
                    best = (struct search_result){turn, x, y, hits, score, best.lookups};
            }
    }
    return best;
}

// The same answer on random maps with clutter, ties (an empty map) included, for a fraction of the reads.
static void test_branch_and_bound_is_exact(void **state)
{
    (void)state;
    struct search_options options = search_default_options();
    options.turns = 4;
    int64_t all = 0, bounded = 0;
    for (uint64_t seed = 1; seed <= CLOUDS; seed++) {
        struct rng random = {seed};
        double(*points)[2] = calloc(POINTS, sizeof *points);
        struct search_grid grid;
        const double low[2] = {-4, -4}, high[2] = {4, 4}, guess[3] = {0.05, -0.03, 0.02};
        assert_int_equal(search_grid_make(&grid, low, high), OK);
        for (int i = 0; i < POINTS; i++) {
            const bool wall = i % 3 > 0;
            points[i][0] = wall ? 2 : 3 * rng_between(&random, -1, 1);
            points[i][1] = wall ? 2 * rng_between(&random, -1, 1) : 3 * rng_between(&random, -1, 1);
            if (seed > 1 && i % 5)
                search_grid_mark(&grid, points[i][0] + 0.11, points[i][1] - 0.07);
        }
        search_grid_finish(&grid);
        int cells[POINTS][2];
        const struct search_result a = try_all(&grid, (const double(*)[2])points, guess, &options, cells);
        struct search_result b;
        assert_int_equal(search_branch_and_bound(&grid, (const double(*)[2])points, POINTS, guess, &options, &b), OK);
        if (a.turn != b.turn || a.x != b.x || a.y != b.y || a.score != b.score) {
            print_error("seed %d: all (%d %d %d, %d hits), branch and bound (%d %d %d, %d hits)\n", (int)seed, a.turn,
                        a.x, a.y, a.hits, b.turn, b.x, b.y, b.hits);
            fail_test();
        }
        all += seed > 1 ? a.lookups : 0;
        bounded += seed > 1 ? b.lookups : 0;
        search_grid_free(&grid);
        free(points);
    }
    EXPECT_AT_LEAST((double)all / (double)bounded, 10);
}

struct ride {
    struct box_world world;
    struct depth_alignment alignment;
    uint32_t seed;
};

static struct pose at(double x, double y, double degrees)
{
    return (struct pose){quat_from_rotation_vector(v3(0, 0, degrees * 0.017453292519943295)), v3(x, y, 0)};
}

static void see(struct ride *r, struct pose world_from_body, struct depth_points *points)
{
    const struct lens lens = {.width = 120, .height = 90, .fx = 107, .fy = 107, .cx = 59.5, .cy = 44.5};
    static uint16_t depth[120 * 90];
    for (int c = 0; c < 4; c++) {
        double level[3][3] = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
        const struct quat down = quat_from_rotation_vector(v3(0, 0.436, 0));
        const struct quat turn = quat_from_rotation_vector(v3(0, 0, c * 1.5707963));
        const struct pose camera = {quat_multiply(turn, quat_multiply(down, quat_from_matrix(level))), v3(0, 0, 0.9)};
        box_world_depth(&r->world, pose_multiply(world_from_body, camera), &lens, 4, ++r->seed, depth);
        assert_int_equal(depth_points_add(points, depth, &lens, camera, 1), OK);
    }
}

static enum status capture(struct ride *r, struct pose truth, struct pose odometry, struct pose *found)
{
    struct depth_points points = {0};
    see(r, truth, &points);
    const enum status status = depth_alignment_add(&r->alignment, &points, odometry, found);
    depth_points_free(&points);
    return status;
}

static void start(struct ride *r, int stage)
{
    struct pose begin;
    *r = (struct ride){.seed = 7};
    rover_stage_world(stage, &r->world, &begin);
    assert_int_equal(depth_alignment_open(&r->alignment, 0.02), OK);
}

static void expect_pose(struct pose found, struct pose truth, double within_m, double within_degrees)
{
    EXPECT_NEAR(found.translation.x, truth.translation.x, within_m);
    EXPECT_NEAR(found.translation.y, truth.translation.y, within_m);
    EXPECT_NEAR(pose_angle(found, truth) * 57.29577951308232, 0, within_degrees);
}

static void test_captures_are_placed(void **state)
{
    (void)state;
    struct ride r;
    struct pose found;
    start(&r, 3);
    assert_int_equal(capture(&r, at(0, 0, 0), at(0, 0, 0), &found), OK);
    assert_int_equal(capture(&r, at(0.3, 0.05, 8), at(0.33, 0.02, 9.5), &found), OK);
    expect_pose(found, at(0.3, 0.05, 8), 0.006, 0.2);
    assert_int_equal(capture(&r, at(0.6, 0.1, 0), at(0.66, 0.05, 3), &found), OK);
    expect_pose(found, at(0.6, 0.1, 0), 0.006, 0.2);
    depth_alignment_close(&r.alignment);
}

static void test_odometry_that_jumps(void **state)
{
    (void)state;
    struct ride r;
    struct pose found;
    start(&r, 3);
    assert_int_equal(capture(&r, at(0, 0, 0), at(0, 0, 0), &found), OK);
    assert_int_equal(capture(&r, at(0.3, 0.05, 4), at(1.1, 0.6, 14), &found), OK);
    expect_pose(found, at(0.3, 0.05, 4), 0.01, 0.3);
    depth_alignment_close(&r.alignment);
}

// Along the wall the odometry stands; across it the wall decides.
static void test_one_flat_wall(void **state)
{
    (void)state;
    struct ride r;
    struct pose found;
    start(&r, 1);
    r.world.boxes[0].low[0] = -30; // no end in range
    r.world.boxes[0].high[0] = 30;
    assert_int_equal(capture(&r, at(0, 0, 0), at(0, 0, 0), &found), OK);
    assert_int_equal(capture(&r, at(0.5, 0.1, 2), at(0.52, 0.06, 3), &found), OK);
    EXPECT_NEAR(found.translation.y, 0.1, 0.006);
    EXPECT_NEAR(pose_angle(found, at(0, 0, 2)) * 57.3, 0, 0.2);
    EXPECT_NEAR(found.translation.x, 0.52, 0.03);
    depth_alignment_close(&r.alignment);
}

// Along it the pictures decide, if there is something on it to see; exposures may differ.
static void test_one_flat_wall_with_pictures(void **state)
{
    (void)state;
    enum { HEIGHT = 256 };
    struct ride r;
    struct photo_refinement photo = {.body_from_picture = rover_head()};
    const struct pose truth[3] = {at(0, 0, 0), at(0.5, 0.1, 2), at(0.9, 0.05, -3)};
    const struct pose odometry[3] = {at(0, 0, 0), at(0.52, 0.06, 3), at(0.95, 0.02, -1)};
    start(&r, 1);
    r.world.boxes[0].low[0] = -30; // no end in range
    r.world.boxes[0].high[0] = 30;
    for (int i = 0; i < 3; i++) {
        struct depth_points points = {0};
        struct surround_picture picture;
        struct pose found;
        uint8_t *rgb = malloc((size_t)HEIGHT * HEIGHT * 2 * 3);
        box_world_panorama(&r.world, pose_multiply(truth[i], rover_head()), 2 * HEIGHT, HEIGHT, rgb);
        for (int k = 0; i == 1 && k < HEIGHT * HEIGHT * 2 * 3; k++)
            rgb[k] = (uint8_t)(rgb[k] * 0.7);
        assert_int_equal(surround_picture_make(&picture, rgb, 2 * HEIGHT, HEIGHT, NULL), OK);
        see(&r, truth[i], &points);
        assert_int_equal(photo_alignment_add(&photo, &r.alignment, &picture, &points, odometry[i], &found), OK);
        expect_pose(found, truth[i], 0.006, 0.1);
        depth_points_free(&points);
        surround_picture_free(&picture);
    }
    photo_refinement_free(&photo);
    depth_alignment_close(&r.alignment);
}

static void test_a_person_walks_through(void **state)
{
    (void)state;
    struct ride r;
    struct pose found;
    start(&r, 3);
    struct box *person = &r.world.boxes[r.world.count++];
    *person = (struct box){.low = {1.0, -0.2, 0}, .high = {1.3, 0.2, 1.8}};
    assert_int_equal(capture(&r, at(0, 0, 0), at(0, 0, 0), &found), OK);
    person->low[1] = 0.3, person->high[1] = 0.7;
    assert_int_equal(capture(&r, at(0.2, 0, 5), at(0.23, 0.02, 6), &found), OK);
    expect_pose(found, at(0.2, 0, 5), 0.01, 0.3);
    depth_alignment_close(&r.alignment);
}

// What does not fit keeps the odometry's pose, says so, and leaves the map alone.
static void test_what_does_not_fit(void **state)
{
    (void)state;
    struct ride r, other;
    struct pose found;
    start(&r, 3);
    assert_int_equal(capture(&r, at(0, 0, 0), at(0, 0, 0), &found), OK);
    const size_t before = r.alignment.surface.used;
    rover_stage_world(1, &other.world, &found);
    r.world = other.world;
    r.world.boxes[0].low[0] = -0.4, r.world.boxes[0].high[0] = 0.45;
    assert_int_equal(capture(&r, at(0, 0, 0), at(0.1, 0, 0), &found), NOTHING);
    expect_pose(found, at(0.1, 0, 0), 1e-9, 1e-6);
    assert_int_equal(r.alignment.surface.used, before);
    assert_int_equal(r.alignment.capture_count, 1);
    depth_alignment_close(&r.alignment);
}

static void test_when_to_capture(void **state)
{
    (void)state;
    struct surroundings s = {.any_taken = false};
    EXPECT_TRUE(surroundings_wants(&s, at(0, 0, 0), 0));
    s.any_taken = true;
    s.taken_odometry = at(0, 0, 0);
    EXPECT_TRUE(!surroundings_wants(&s, at(0.59, 0, 0), 0));
    EXPECT_TRUE(surroundings_wants(&s, at(0.61, 0, 0), 0));
    EXPECT_TRUE(surroundings_wants(&s, at(0, 0, 21), 0));
    EXPECT_TRUE(!surroundings_wants(&s, at(0, 0, 19), 199000000000));
    EXPECT_TRUE(surroundings_wants(&s, at(0, 0, 0), 200000000000));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_branch_and_bound_is_exact),   cmocka_unit_test(test_captures_are_placed),
        cmocka_unit_test(test_odometry_that_jumps),         cmocka_unit_test(test_one_flat_wall),
        cmocka_unit_test(test_one_flat_wall_with_pictures), cmocka_unit_test(test_a_person_walks_through),
        cmocka_unit_test(test_what_does_not_fit),           cmocka_unit_test(test_when_to_capture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
