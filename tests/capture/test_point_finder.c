// Body points beside the follower: found on a thread that no frame waits for, and used some frames late. The points are
// the true joints projected, so that no network is needed.
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/follow.h"
#include "capture/point_finder.h"
#include "tests/world/world.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 8, HEIGHT = 6, STEP_NS = 33333333 };
static const double SCALE = 0.25; // of 640 x 480

// ---------------------------------------------------------------- where the points are by now

// A person of one joint's speed each: joint j moves by (j + 1) cm a frame to the right, 3 m away.
static struct skeleton moving(int frame)
{
    struct skeleton s = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3(0.01 * (j + 1) * frame, 0.1 * j - 0.7, 3);
        s.confidence[j] = 1;
    }
    return s;
}

static void test_points_go_with_their_joints(void **state)
{
    (void)state;
    const struct lens lens = world_calibration(SCALE).color;
    struct point_motion m = {0};
    struct body_points points = {.person = true}, late;
    const struct skeleton then = moving(2), now = moving(6);
    for (int frame = 0; frame < 6; frame++) {
        struct skeleton s = moving(frame);
        s.confidence[JOINT_LEFT_FOOT] = frame == 5 ? 0 : 1;
        point_motion_add(&m, frame * STEP_NS, &s);
    }
    const struct pixel hand = lens_project(&lens, then.joint[JOINT_LEFT_HAND]);
    points.at[BODY_POINT_LEFT_WRIST] = (struct body_point){(float)hand.x + 2, (float)hand.y - 1, 1};
    points.at[BODY_POINT_LEFT_TOE] = (struct body_point){10, 20, 1};
    late = points;
    EXPECT_TRUE(point_motion_apply(&m, &lens, 2 * STEP_NS, 6 * STEP_NS, &late));
    const struct pixel there = lens_project(&lens, now.joint[JOINT_LEFT_HAND]);
    EXPECT_NEAR(late.at[BODY_POINT_LEFT_WRIST].x_px, there.x + 2, 0.01);
    EXPECT_NEAR(late.at[BODY_POINT_LEFT_WRIST].y_px, there.y - 1, 0.01);
    EXPECT_NEAR(late.at[BODY_POINT_LEFT_TOE].x_px, 10, 0); // its joint is lost: it stays
    late = points;
    EXPECT_TRUE(point_motion_apply(&m, &lens, 6 * STEP_NS, 6 * STEP_NS, &late)); // of the frame itself
    EXPECT_NEAR(late.at[BODY_POINT_LEFT_WRIST].x_px, points.at[BODY_POINT_LEFT_WRIST].x_px, 0);
    EXPECT_TRUE(!point_motion_apply(&m, &lens, 2 * STEP_NS, 20 * STEP_NS, &late)); // too old
    EXPECT_TRUE(!point_motion_apply(&m, &lens, 7, 6 * STEP_NS, &late));            // of no frame
    EXPECT_TRUE(!point_motion_apply(&m, &lens, 2 * STEP_NS, STEP_NS, &late));      // a clock that jumped
    point_motion_clear(&m);
    EXPECT_TRUE(!point_motion_apply(&m, &lens, 2 * STEP_NS, 6 * STEP_NS, &late));
}

// ---------------------------------------------------------------- the thread

struct finder {
    atomic_int looks, last; // last: the first byte of the image that was looked at last
    atomic_bool held;       // looking takes until this is false
    enum status answer;
};

static enum status look(void *self, const uint8_t *rgb, int width, int height, struct body_points *out)
{
    struct finder *f = self;
    assert(width == WIDTH && height == HEIGHT);
    atomic_store(&f->last, rgb[0]);
    atomic_fetch_add(&f->looks, 1);
    while (atomic_load(&f->held))
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    *out = (struct body_points){.person = true};
    out->at[BODY_POINT_NOSE].x_px = rgb[0];
    return f->answer < 0 ? fail(f->answer, "the finder is broken") : f->answer;
}

static struct point_finder *open_points(struct finder *f)
{
    struct point_finder *p;
    const struct point_finder_options options = {.width = WIDTH, .height = HEIGHT, .find = look, .find_self = f};
    EXPECT_STATUS(point_finder_open(&p, &options), OK);
    return p;
}

static void offer(struct point_finder *p, int number)
{
    uint8_t rgb[3 * WIDTH * HEIGHT];
    memset(rgb, number, sizeof rgb);
    point_finder_offer(p, number * STEP_NS, rgb);
}

// Offers images until that many looks have begun. Returns the next number.
static int offer_until(struct point_finder *p, struct finder *f, int looks, int number)
{
    for (const int64_t until_ns = clock_now_ns() + 30000000000;
         atomic_load(&f->looks) < looks && clock_now_ns() < until_ns;) {
        offer(p, number++ % 200);
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    EXPECT_AT_LEAST(atomic_load(&f->looks), looks);
    return number;
}

static bool wait_for_points(struct point_finder *p, int64_t *time_ns, struct body_points *points)
{
    for (const int64_t until_ns = clock_now_ns() + 30000000000; clock_now_ns() < until_ns;) {
        if (point_finder_take(p, time_ns, points))
            return true;
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    return false;
}

static void test_no_frame_waits_and_points_know_their_image(void **state)
{
    (void)state;
    struct finder f = {.answer = OK, .held = true};
    struct point_finder *p = open_points(&f);
    struct body_points points;
    int64_t time_ns;
    int number = offer_until(p, &f, 1, 0);
    const int looked_at = atomic_load(&f.last);
    for (int i = 0; i < 50; i++)
        offer(p, number++ % 200); // it is busy: none waits, none is kept
    EXPECT_INT(atomic_load(&f.looks), 1);
    EXPECT_TRUE(!point_finder_take(p, &time_ns, &points));
    atomic_store(&f.held, false);
    EXPECT_TRUE(wait_for_points(p, &time_ns, &points));
    EXPECT_INT(time_ns, (int64_t)looked_at * STEP_NS);
    EXPECT_NEAR(points.at[BODY_POINT_NOSE].x_px, looked_at, 0);
    EXPECT_TRUE(!point_finder_take(p, &time_ns, &points)); // once
    point_finder_close(&p);
}

static void test_not_every_image_is_looked_at(void **state)
{
    (void)state;
    struct finder f = {.answer = OK};
    struct point_finder *p = open_points(&f);
    const int number = offer_until(p, &f, 10, 0);
    print_message("10 looks in %d images\n", number);
    EXPECT_AT_LEAST(number, 30);
    point_finder_close(&p);
}

static void test_a_film_that_starts_again_has_no_old_points(void **state)
{
    (void)state;
    struct finder f = {.answer = OK, .held = true};
    struct point_finder *p = open_points(&f);
    struct body_points points;
    int64_t time_ns;
    const int number = offer_until(p, &f, 1, 0);
    point_finder_restart(p);
    atomic_store(&f.held, false);
    offer_until(p, &f, 2, number);
    EXPECT_TRUE(wait_for_points(p, &time_ns, &points));
    EXPECT_AT_LEAST(time_ns, (int64_t)number * STEP_NS);
    point_finder_close(&p);
}

static void test_why_there_are_none(void **state)
{
    (void)state;
    struct finder f = {.answer = ERR_FORMAT};
    struct point_finder *p = open_points(&f);
    struct body_points points;
    int64_t time_ns;
    int number = offer_until(p, &f, 1, 0);
    for (const int64_t until_ns = clock_now_ns() + 30000000000;
         !*point_finder_query(p).why_not && clock_now_ns() < until_ns;)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    EXPECT_TRUE(strstr(point_finder_query(p).why_not, "broken"));
    for (int i = 0; i < 20; i++)
        offer(p, number++ % 200);
    EXPECT_INT(atomic_load(&f.looks), 1);
    EXPECT_TRUE(!point_finder_take(p, &time_ns, &points));
    point_finder_close(&p);
    point_finder_close(&p);
}

static void test_a_dark_image_gives_none(void **state)
{
    (void)state;
    struct finder f = {.answer = NOTHING};
    struct point_finder *p = open_points(&f);
    struct body_points points;
    int64_t time_ns;
    offer_until(p, &f, 3, 0);
    EXPECT_TRUE(!point_finder_take(p, &time_ns, &points));
    EXPECT_TRUE(!*point_finder_query(p).why_not);
    point_finder_close(&p);
}

// ---------------------------------------------------------------- what late points are good for

static struct body_points points_of(const struct lens *lens, const struct skeleton *truth)
{
    static const enum joint joints[BODY_POINT_COUNT] = {
        [BODY_POINT_LEFT_SHOULDER] = JOINT_LEFT_SHOULDER, [BODY_POINT_RIGHT_SHOULDER] = JOINT_RIGHT_SHOULDER,
        [BODY_POINT_LEFT_ELBOW] = JOINT_LEFT_ELBOW,       [BODY_POINT_RIGHT_ELBOW] = JOINT_RIGHT_ELBOW,
        [BODY_POINT_LEFT_WRIST] = JOINT_LEFT_HAND,        [BODY_POINT_RIGHT_WRIST] = JOINT_RIGHT_HAND,
        [BODY_POINT_LEFT_HIP] = JOINT_LEFT_HIP,           [BODY_POINT_RIGHT_HIP] = JOINT_RIGHT_HIP,
        [BODY_POINT_LEFT_KNEE] = JOINT_LEFT_KNEE,         [BODY_POINT_RIGHT_KNEE] = JOINT_RIGHT_KNEE,
        [BODY_POINT_LEFT_ANKLE] = JOINT_LEFT_FOOT,        [BODY_POINT_RIGHT_ANKLE] = JOINT_RIGHT_FOOT,
    };
    struct body_points points = {.person = true};
    for (int k = BODY_POINT_LEFT_SHOULDER; k <= BODY_POINT_RIGHT_ANKLE; k++) {
        const struct pixel px = lens_project(lens, truth->joint[joints[k]]);
        points.at[k] = (struct body_point){(float)px.x, (float)px.y, 1};
    }
    return points;
}

// A person in mid-motion: the mean error of the joints after some frames, m. late: of the points, frames; 0: none.
static double error_after(int late, int frames)
{
    enum { EVERY = 3 };
    static const double TIME_S = 4.71, TURNED_RAD = 43 * 3.14159265358979323846 / 180;
    struct world *world;
    struct world_options options = world_default_options();
    options.motion = "kata";
    options.threads = 2;
    options.plain = true;
    EXPECT_TRUE(world_figure_named("skirt", &options.figure));
    EXPECT_STATUS(world_open(&world, &options), OK);
    const struct calibration c = world_calibration(2 * SCALE);
    const struct pose turned = {{0, 0, sin(TURNED_RAD / 2), cos(TURNED_RAD / 2)}, {0, 0, 0}},
                      from = pose_multiply(turned, world_sensor_pose(world));
    const struct world_shot shot = {c.color, from, TIME_S, true};
    const struct skeleton truth = world_joints_in_camera(world, TIME_S, from);
    const struct body_points points = points_of(&c.color, &truth);
    uint16_t *ideal = malloc(sizeof *ideal * (size_t)c.depth.width * (size_t)c.depth.height),
             *depth = malloc(sizeof *depth * (size_t)c.depth.width * (size_t)c.depth.height);
    struct followed_frame followed = {0};
    struct follower *follower;
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.depth = ideal}), OK);
    EXPECT_STATUS(follower_open(&follower, &c, NULL), OK);
    for (int k = 0; k < frames; k++) {
        EXPECT_STATUS(world_depth_noise(&c.depth, ideal, (uint64_t)k + 1, depth), OK);
        if (late && k >= late && (k - late) % EVERY == 0)
            follower_set_points(follower, (int64_t)(k - late) * STEP_NS, &points);
        const struct follower_frame frame = {.time_ns = (int64_t)k * STEP_NS, .depth = depth};
        EXPECT_STATUS(follower_next(follower, &frame, &followed), OK);
    }
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum +=
            followed.person ? v3_distance(followed.skeleton.joint[j], truth.joint[j]) / JOINT_COUNT : 1.0 / JOINT_COUNT;
    follower_close(&follower);
    free(ideal);
    free(depth);
    world_close(&world);
    return sum;
}

static void test_late_points_are_used_and_old_ones_are_not(void **state)
{
    (void)state;
    enum { FRAMES = 12, LATE = 2, OLD = 10 }; // OLD: beyond POINT_MOTION_MAX_NS
    const double depth_m = error_after(0, FRAMES), late_m = error_after(LATE, FRAMES), old_m = error_after(OLD, FRAMES);
    print_message("after %d frames %.2f mm from depth alone, %.2f with late points\n", FRAMES, 1000 * depth_m,
                  1000 * late_m);
    EXPECT_TRUE(late_m != depth_m);
    EXPECT_AT_MOST(late_m, depth_m + 0.003);
    EXPECT_NEAR(old_m, depth_m, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_go_with_their_joints),
        cmocka_unit_test(test_no_frame_waits_and_points_know_their_image),
        cmocka_unit_test(test_not_every_image_is_looked_at),
        cmocka_unit_test(test_a_film_that_starts_again_has_no_old_points),
        cmocka_unit_test(test_why_there_are_none),
        cmocka_unit_test(test_a_dark_image_gives_none),
        cmocka_unit_test(test_late_points_are_used_and_old_ones_are_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
