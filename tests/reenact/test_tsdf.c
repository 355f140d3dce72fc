// The TSDF without any frame: the shape of a side that was never seen, and bind poses that are refused.
#include "tests/support/test.h"

#include "reenact/avatar/tsdf.h"

static const double RADIUS_M = 0.16;

// A bind pose of one part, from the origin down.
static struct bind_pose bind_of(enum part part)
{
    struct bind_pose bind = {0};
    const struct part_ends ends = part_ends[part];
    bind.skeleton.joint[ends.to] = v3(0, 0.4, 0);
    bind.skeleton.confidence[ends.from] = bind.skeleton.confidence[ends.to] = 1;
    bind.known[part] = true;
    bind.radius[part] = RADIUS_M;
    bind.own_length[part] = 0.4;
    bind.frame[part] = (struct bone_frame){v3(0, 0, 0), v3(1, 0, 0), v3(0, 0, -1), v3(0, 1, 0), 0.4};
    return bind;
}

static const struct calibration calibration = {.registered = true, .depth = {.width = 64, .height = 48}};

static struct tsdf *unseen(enum part part)
{
    const struct bind_pose bind = bind_of(part);
    struct tsdf *v;
    EXPECT_STATUS(tsdf_open(&v, &bind, &calibration, TSDF_VOXEL_M, 2), OK);
    return v;
}

// Distance of the surface from the bone's middle along a direction.
static double surface_at(const struct tsdf *v, struct vec3 direction)
{
    double distance, seen, inside = 0;
    struct vec3 gradient;
    for (double far = 0; far < 2 * RADIUS_M; far += 0.001)
        if (tsdf_sample(v, v3_add(v3(0, 0.2, 0), v3_scale(direction, far)), &distance, &gradient, &seen) &&
            distance < 0)
            inside = far;
    return inside;
}

static void test_unseen_trunk_is_wider_than_deep(void **state)
{
    (void)state;
    struct tsdf *v = unseen(PART_UPPER_TORSO);
    EXPECT_NEAR(surface_at(v, v3(0, 0, 1)), RADIUS_M, 0.003);
    tsdf_flatten_unseen_trunk(v);
    EXPECT_NEAR(surface_at(v, v3(1, 0, 0)), RADIUS_M, 0.003);
    EXPECT_NEAR(surface_at(v, v3(-1, 0, 0)), RADIUS_M, 0.003);
    EXPECT_NEAR(surface_at(v, v3(0, 0, 1)), 0.7 * RADIUS_M, 0.003);
    EXPECT_NEAR(surface_at(v, v3(0, 0, -1)), 0.7 * RADIUS_M, 0.003);
    tsdf_close(&v);
}

static void test_unseen_thigh_is_round(void **state)
{
    (void)state;
    struct tsdf *v = unseen(PART_LEFT_THIGH);
    tsdf_flatten_unseen_trunk(v);
    EXPECT_NEAR(surface_at(v, v3(1, 0, 0)), RADIUS_M, 0.003);
    EXPECT_NEAR(surface_at(v, v3(0, 0, 1)), RADIUS_M, 0.003);
    tsdf_close(&v);
}

// Extents that are finite, but that no integer holds, nor any memory.
static void test_absurd_extent_is_refused(void **state)
{
    (void)state;
    static const struct vec3 ends[] = {{100, 100, 100}, {0, 1e12, 0}, {1e12, -1e12, 0}, {1e300, 1e300, -1e300}};
    for (size_t i = 0; i < COUNT_OF(ends); i++) {
        struct bind_pose bind = bind_of(PART_UPPER_TORSO);
        struct tsdf *v;
        bind.skeleton.joint[part_ends[PART_UPPER_TORSO].to] = ends[i];
        EXPECT_STATUS(tsdf_open(&v, &bind, &calibration, TSDF_VOXEL_M, 2), ERR_INPUT);
        EXPECT_TRUE(!v);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_unseen_trunk_is_wider_than_deep),
                                       cmocka_unit_test(test_unseen_thigh_is_round),
                                       cmocka_unit_test(test_absurd_extent_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
