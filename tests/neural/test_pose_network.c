// Body points from colour on the small world's figure, whose joints are known; skipped where the networks are not there
// (tools/models fetches them).
#include "tests/support/test.h"

#include "base/clock.h"
#include "neural/pose_network.h"
#include "recording/skeleton.h"
#include "tests/world/world.h"

#include <unistd.h>

enum { FRAMES = 12 };

static struct pose_network *network;

static int open_network(void **state)
{
    (void)state;
    const enum status status = pose_network_open(&network, NULL, POSE_NETWORK_LITE);
    if (status != ERR_MISSING)
        EXPECT_STATUS(status, OK);
    return 0;
}

static int close_network(void **state)
{
    (void)state;
    pose_network_close(&network);
    return 0;
}

static const struct {
    enum joint joint;
    enum pose_point_name point;
} pairs[] = {
    {JOINT_LEFT_SHOULDER, POSE_LEFT_SHOULDER}, {JOINT_RIGHT_SHOULDER, POSE_RIGHT_SHOULDER},
    {JOINT_LEFT_ELBOW, POSE_LEFT_ELBOW},       {JOINT_RIGHT_ELBOW, POSE_RIGHT_ELBOW},
    {JOINT_LEFT_HAND, POSE_LEFT_WRIST},        {JOINT_RIGHT_HAND, POSE_RIGHT_WRIST},
    {JOINT_LEFT_HIP, POSE_LEFT_HIP},           {JOINT_RIGHT_HIP, POSE_RIGHT_HIP},
    {JOINT_LEFT_KNEE, POSE_LEFT_KNEE},         {JOINT_RIGHT_KNEE, POSE_RIGHT_KNEE},
    {JOINT_LEFT_FOOT, POSE_LEFT_ANKLE},        {JOINT_RIGHT_FOOT, POSE_RIGHT_ANKLE},
};

// The sensor's image of the world at that time.
static uint8_t *image_of(const struct world *world, const struct world_shot *shot)
{
    uint8_t *rgb = malloc(3 * (size_t)shot->lens.width * (size_t)shot->lens.height);
    assert_non_null(rgb);
    EXPECT_STATUS(world_render(world, shot, &(struct world_image){.color = rgb}), OK);
    return rgb;
}

// A figure that stands and moves its arms, facing the sensor: the points are near the joints, left is left.
static void test_points_are_near_the_joints(void **state)
{
    (void)state;
    if (!network)
        skip_without("the networks (reenact-capture models --fetch)");
    struct world *world;
    struct world_options options = world_default_options();
    options.motion = "kata";
    EXPECT_STATUS(world_open(&world, &options), OK);
    const struct pose sensor = world_sensor_pose(world);
    double sum = 0, right_way = 0, wrong_way = 0;
    int64_t spent_ns = 0;
    pose_network_restart(network);
    for (int f = 0; f < FRAMES; f++) {
        const double time_s = 0.5 + f / 15.0;
        const struct world_shot shot = {world_calibration(1).color, sensor, time_s, true};
        const struct skeleton truth = world_joints_in_camera(world, time_s, sensor);
        uint8_t *rgb = image_of(world, &shot);
        struct pose_points points;
        const int64_t begun_ns = clock_cpu_ns();
        EXPECT_STATUS(pose_network_find(network, rgb, shot.lens.width, shot.lens.height, &points), OK);
        spent_ns += clock_cpu_ns() - begun_ns;
        for (size_t i = 0; i < COUNT_OF(pairs); i++) {
            const size_t other = i ^ 1; // the same joint on the other side
            const struct pixel at = lens_project(&shot.lens, truth.joint[pairs[i].joint]);
            const struct pixel mirrored = lens_project(&shot.lens, truth.joint[pairs[other].joint]);
            const struct pose_point *p = &points.point[pairs[i].point];
            const double error = hypot(p->x_px - at.x, p->y_px - at.y);
            sum += error;
            right_way += error;
            wrong_way += hypot(p->x_px - mirrored.x, p->y_px - mirrored.y);
        }
        free(rgb);
    }
    print_message("%.1f px in the mean, %.1f if left were right; %.1f ms an image\n",
                  sum / (FRAMES * (double)COUNT_OF(pairs)), wrong_way / (FRAMES * (double)COUNT_OF(pairs)),
                  (double)spent_ns * 1e-6 / FRAMES);
    EXPECT_AT_MOST(sum / (FRAMES * (double)COUNT_OF(pairs)), 8);
    EXPECT_AT_MOST(right_way, wrong_way / 2);
    world_close(&world);
}

static void test_empty_room_has_no_person(void **state)
{
    (void)state;
    if (!network)
        skip_without("the networks (reenact-capture models --fetch)");
    struct world *world;
    const struct world_options options = world_default_options();
    EXPECT_STATUS(world_open(&world, &options), OK);
    const struct world_shot shot = {world_calibration(1).color, world_sensor_pose(world), 0, false};
    uint8_t *rgb = image_of(world, &shot);
    struct pose_points points;
    pose_network_restart(network);
    EXPECT_STATUS(pose_network_find(network, rgb, shot.lens.width, shot.lens.height, &points), NOTHING);
    free(rgb);
    world_close(&world);
}

static void test_networks_that_are_not_there(void **state)
{
    (void)state;
    struct pose_network *none;
    EXPECT_STATUS(pose_network_open(&none, "/nowhere", POSE_NETWORK_LITE), ERR_MISSING);
    EXPECT_TRUE(!none && strstr(status_message(), "reenact-capture models --fetch"));
    pose_network_close(&none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_are_near_the_joints),
        cmocka_unit_test(test_empty_room_has_no_person),
        cmocka_unit_test(test_networks_that_are_not_there),
    };
    return cmocka_run_group_tests(tests, open_network, close_network);
}
