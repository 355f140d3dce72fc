// Hard cases of localisation, by name; each prints its error.
#include "tests/support/test.h"

#include "locate/focal_estimate.h"
#include "locate/locator.h"
#include "tests/support/tag_picture.h"
#include "tests/support/tag_view.h"

#include <stdio.h>
#include <string.h>

enum { WIDTH = 640, HEIGHT = 480 };
static const double F_PX = TAG_VIEW_F_PX, NOISE = 2;

static uint8_t rgb[WIDTH * HEIGHT * 3];

static const struct place_tag one[1] = {{.id = 7, .side_m = 0.16, .world_from_tag = {{0, 0, 0, 1}, {0, 0, 0}}}};

// Two tags on a wall, one on another, one nearer to the camera: a corner of a room.
static const struct place_tag corner[4] = {
    {.id = 0, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {-0.5, 0.3, 0}}},
    {.id = 1, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.5, 0.4, 0}}},
    {.id = 2, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.1, -0.4, 0.9}}},
    {.id = 3, .side_m = 0.2, .world_from_tag = {{0, 0.7071067811865476, 0, 0.7071067811865476}, {-0.9, 0, 0.6}}},
};

static void draw(const struct place_tag *tags, int count, const struct lens *lens, struct pose world_from_camera,
                 uint64_t seed)
{
    struct tag_picture p = {.lens = *lens,
                            .tags = tags,
                            .tag_count = count,
                            .noise = NOISE,
                            .seed = seed,
                            .rgb = rgb,
                            .world_from_camera = world_from_camera};
    EXPECT_TRUE(tag_picture_draw(&p));
}

static enum status find(const struct place_tag *tags, int count, const struct lens *lens, struct location *at)
{
    const struct place place = {.tags = (struct place_tag *)(uintptr_t)tags, .tag_count = count};
    struct locator_options options = locator_default_options();
    struct locator *l;
    options.max_position_sigma_m = 1;
    EXPECT_STATUS(locator_open(&l, &place, lens, &options), OK);
    enum status status = locator_localize(l, rgb, NULL, at);
    locator_close(&l);
    return status;
}

static double off_m(struct pose a, struct pose b) { return v3_distance(a.translation, b.translation); }

static double off_deg(struct pose a, struct pose b) { return pose_angle(a, b) * 57.29577951308232; }

// The pose or, if it is ambiguous, the other one is right.
static void expect_one_tag(const char *name, struct pose truth, uint64_t seed, double max_m, double most_deg)
{
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX);
    struct location at;
    draw(one, 1, &lens, truth, seed);
    enum status status = find(one, 1, &lens, &at);
    EXPECT_TRUE(status == OK || status == AMBIGUOUS);
    bool other = status == AMBIGUOUS && off_deg(at.other, truth) < off_deg(at.world_from_camera, truth);
    struct pose found = other ? at.other : at.world_from_camera;
    printf("%s: %.2f mm, %.3f degrees (sigma %.2f mm)%s\n", name, off_m(found, truth) * 1e3, off_deg(found, truth),
           at.position_sigma_m * 1e3, status == AMBIGUOUS ? ", ambiguous" : "");
    EXPECT_AT_MOST(off_m(found, truth), max_m);
    EXPECT_AT_MOST(off_deg(found, truth), most_deg);
}

static void test_frontal_tag(void **state)
{
    (void)state;
    expect_one_tag("head-on at 1 m", tag_picture_view(1, 0, 0, 0), 1, 0.001, 0.05);
    expect_one_tag("head-on at 2 m", tag_picture_view(2, 0, 0, 0.3), 2, 0.006, 0.2);
}

static void test_tag_at_80_degrees(void **state)
{
    (void)state;
    expect_one_tag("at 80 degrees, 0.6 m", tag_picture_view(0.6, 80 / 57.29577951308232, 0, 0), 3, 0.001, 0.05);
}

static void test_tag_of_20_pixels(void **state)
{
    (void)state;
    expect_one_tag("20 pixels wide", tag_picture_view(F_PX * 0.16 / 20, 0.6, 0.2, 0), 4, 0.025, 0.5);
}

static void test_nearly_collinear_corners(void **state)
{
    (void)state;
    struct rng rng = {11};
    struct pose truth = tag_picture_view(1, 89.5 / 57.29577951308232, 0, 0);
    struct tag_observation s = tag_view_observe(&one[0], &truth, 0.1, &rng);
    struct pnp_tag tag = tag_view_for_solver(&one[0], &s);
    struct pnp_solution fit = {.used = 0};
    enum status status = tag_view_solve(&tag, 1, 2.5, &fit);
    double covariance[36], off = off_m(pose_inverse(fit.camera_from_world), truth);
    const struct pose_problem problem = {.tags = &tag, .tag_count = 1, .fx = F_PX, .fy = F_PX};
    bool known = status != NOTHING && pnp_covariance(&problem, &fit.camera_from_world, covariance);
    double sigma = known ? sqrt(covariance[21] + covariance[28] + covariance[35]) : INFINITY;
    printf("corners nearly in a line: %s, %.1f mm off, sigma %.1f mm\n", status_name(status), off * 1e3, sigma * 1e3);
    EXPECT_TRUE(status >= 0);
    if (status == OK) { // then its covariance must cover the error
        EXPECT_TRUE(pose_finite(fit.camera_from_world));
        EXPECT_AT_MOST(off, 4 * sigma);
    }
    for (int k = 0; k < 4; k++) // wholly in a line
        s.ray[k] = v3(0.1 * k, 0.05 * k, 1);
    EXPECT_STATUS(tag_view_solve(&tag, 1, 2.5, &fit), NOTHING);
}

static void test_nan_corner(void **state)
{
    (void)state;
    struct rng rng = {12};
    struct pose truth = tag_picture_view(2, 0.4, -0.2, 0);
    struct tag_observation s[3];
    struct pnp_tag tags[3];
    struct pnp_solution fit;
    for (int i = 0; i < 3; i++) {
        s[i] = tag_view_observe(&corner[i], &truth, 0.1, &rng);
        tags[i] = tag_view_for_solver(&corner[i], &s[i]);
    }
    s[1].ray[2].x = NAN;
    EXPECT_STATUS(tag_view_solve(tags, 3, 2.5, &fit), OK);
    double off = off_m(pose_inverse(fit.camera_from_world), truth);
    printf("one corner of three tags not a number: %.2f mm, %d tags used\n", off * 1e3, (int)fit.used);
    EXPECT_INT(fit.used, 2);
    EXPECT_AT_MOST(off, 0.004);
    EXPECT_STATUS(tag_view_solve(&tags[1], 1, 2.5, &fit), NOTHING);
}

// Points as projected by a camera, with noise; those behind it, too, as false measurements.
static int observe_points(const struct vec3 *world, int count, const struct pose *world_from_camera, struct rng *rng,
                          struct pnp_point *out)
{
    for (int i = 0; i < count; i++) {
        struct vec3 p = pose_apply(pose_inverse(*world_from_camera), world[i]);
        out[i] = (struct pnp_point){.world = world[i], .x = p.x / p.z, .y = p.y / p.z, .sigma_px = 0.5};
        out[i].x += 0.5 * rng_normal(rng) / F_PX;
        out[i].y += 0.5 * rng_normal(rng) / F_PX;
    }
    return count;
}

static void test_coplanar_points(void **state)
{
    (void)state;
    struct rng rng = {13};
    struct vec3 wall[60];
    struct pnp_point seen[60];
    struct pose truth = tag_picture_view(2.5, 0.3, 0.1, 0), found = pose_inverse(tag_picture_view(2.8, 0.1, 0.2, 0.1));
    for (int i = 0; i < 60; i++)
        wall[i] = rng_within(&rng, v3(1, 0.75, 0));
    observe_points(wall, 60, &truth, &rng, seen);
    struct pose_problem problem = {.points = seen, .point_count = 60, .fx = F_PX, .fy = F_PX};
    for (problem.point_px = 30; problem.point_px > 0.5; problem.point_px /= 3)
        pnp_refine(&problem, &found);
    problem.point_px = 0;
    pnp_refine(&problem, &found);
    double off = off_m(pose_inverse(found), truth), off_angle = off_deg(pose_inverse(found), truth);
    printf("all points on one plane: %.2f mm, %.3f degrees\n", off * 1e3, off_angle);
    EXPECT_AT_MOST(off, 0.01);
    EXPECT_AT_MOST(off_angle, 0.2);
}

static void test_points_behind_camera(void **state)
{
    (void)state;
    struct rng rng = {14};
    struct vec3 world[80];
    struct pnp_point seen[80];
    struct pose truth = tag_picture_view(2, 0.2, 0, 0), found = pose_inverse(tag_picture_view(2.05, 0.22, 0.02, 0));
    for (int i = 0; i < 80; i++) { // the last 30 are behind the camera
        double z = i < 50 ? rng_between(&rng, -0.6, 0) : rng_between(&rng, 3, 4);
        world[i] = v3_add(v3(0, 0, z), rng_within(&rng, v3(0.8, 0.6, 0)));
    }
    observe_points(world, 80, &truth, &rng, seen);
    pnp_refine(&(struct pose_problem){.points = seen, .point_count = 80, .fx = F_PX, .fy = F_PX}, &found);
    double off = off_m(pose_inverse(found), truth);
    printf("30 of 80 points behind the camera: %.2f mm\n", off * 1e3);
    EXPECT_AT_MOST(off, 0.01);
    for (int i = 50; i < 80; i++)
        EXPECT_AT_LEAST(pnp_point_error(&seen[i], NULL, &found, F_PX, F_PX), PNP_NOT_VISIBLE);
}

static void test_duplicate_tag_in_view(void **state)
{
    (void)state;
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX);
    struct pose truth = tag_picture_view(2.2, 0.3, -0.1, 0);
    struct place_tag hung[5];
    struct location at;
    memcpy(hung, corner, sizeof corner);
    hung[4] = corner[0]; // number 0 was printed again
    hung[4].world_from_tag.translation = v3(0.1, 0.2, 0);
    draw(hung, 5, &lens, truth, 15);
    EXPECT_STATUS(find(corner, 4, &lens, &at), OK);
    printf("a number twice in view: %.2f mm, %d tags used, %d left out\n", off_m(at.world_from_camera, truth) * 1e3,
           (int)at.tags_used, (int)at.tags_rejected);
    EXPECT_AT_MOST(off_m(at.world_from_camera, truth), 0.001);
    EXPECT_AT_LEAST(at.tags_rejected, 1);
}

static void test_tag_moved_after_mapping(void **state)
{
    (void)state;
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX);
    struct pose truth = tag_picture_view(2.2, 0.3, -0.1, 0);
    struct place_tag hung[4];
    struct location at;
    memcpy(hung, corner, sizeof corner);
    hung[1].world_from_tag.translation.x -= 0.1;
    draw(hung, 4, &lens, truth, 16);
    EXPECT_STATUS(find(corner, 4, &lens, &at), OK);
    printf("a tag moved by 10 cm: %.2f mm, %d tags used, %d left out\n", off_m(at.world_from_camera, truth) * 1e3,
           (int)at.tags_used, (int)at.tags_rejected);
    EXPECT_INT(at.tags_rejected, 1);
    EXPECT_AT_MOST(off_m(at.world_from_camera, truth), 0.001);
}

// A mirror on the wall, or a camera that mirrors its images: tags are not decoded, and there must be no pose.
static void test_mirrored_room(void **state)
{
    (void)state;
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX);
    struct location at;
    draw(corner, 4, &lens, tag_picture_view(2.2, 0.3, -0.1, 0), 17);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH / 2; x++)
            for (int c = 0; c < 3; c++) {
                uint8_t *a = &rgb[(y * WIDTH + x) * 3 + c], *b = &rgb[(y * WIDTH + WIDTH - 1 - x) * 3 + c], kept = *a;
                *a = *b;
                *b = kept;
            }
    enum status status = find(corner, 4, &lens, &at);
    printf("a mirrored image: %s\n", status_name(status));
    EXPECT_STATUS(status, NOTHING);
}

static void test_far_from_origin(void **state)
{
    (void)state;
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX);
    struct vec3 far = v3(1e4, -1e4, 1e4);
    struct pose truth = tag_picture_view(2.2, 0.3, -0.1, 0);
    struct place_tag away[4];
    struct location close_at, far_at;
    memcpy(away, corner, sizeof corner);
    for (int i = 0; i < 4; i++)
        away[i].world_from_tag.translation = v3_add(away[i].world_from_tag.translation, far);
    draw(corner, 4, &lens, truth, 18);
    EXPECT_STATUS(find(corner, 4, &lens, &close_at), OK);
    EXPECT_STATUS(find(away, 4, &lens, &far_at), OK);
    far_at.world_from_camera.translation = v3_sub(far_at.world_from_camera.translation, far);
    double apart = off_m(far_at.world_from_camera, close_at.world_from_camera);
    printf("1e4 m from the origin: %.2f mm, %.6f mm from what is found at the origin\n",
           off_m(far_at.world_from_camera, truth) * 1e3, apart * 1e3);
    EXPECT_AT_MOST(off_m(far_at.world_from_camera, truth), 0.001);
    EXPECT_AT_MOST(apart, 1e-5);
}

// Localises images taken with focal length F_PX by a lens of `given`. Whether that is judged to be wrong.
static bool focal_is_wrong(double given, int images, double *scale)
{
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, F_PX), wrong_lens = tag_picture_lens(WIDTH, HEIGHT, given);
    const struct place place = {.tags = (struct place_tag *)(uintptr_t)corner, .tag_count = 4};
    struct locator *l;
    EXPECT_STATUS(locator_open(&l, &place, &wrong_lens, NULL), OK);
    for (int i = 0; i < images; i++) {
        struct location at;
        draw(corner, 4, &lens, tag_picture_view(2.2 - 0.2 * i, 0.3 - 0.2 * i, -0.1, 0), 19 + (uint64_t)i);
        EXPECT_TRUE(locator_localize(l, rgb, NULL, &at) >= 0);
    }
    bool wrong = locator_focal_is_wrong(l, scale);
    locator_close(&l);
    return wrong;
}

static void test_focal_length_off_by_5_percent(void **state)
{
    (void)state;
    const double given[] = {F_PX * 1.05, F_PX / 1.05};
    double scale;
    for (int i = 0; i < 2; i++) {
        bool wrong = focal_is_wrong(given[i], 3, &scale);
        printf("focal length given as %.1f for %.1f: %s, fits %.1f\n", given[i], F_PX, wrong ? "wrong" : "accepted",
               given[i] * scale);
        EXPECT_TRUE(wrong);
        EXPECT_NEAR(given[i] * scale, F_PX, 0.001 * F_PX);
    }
    EXPECT_TRUE(!focal_is_wrong(F_PX, 3, &scale));
    printf("focal length right: fits %.2f for %.2f\n", F_PX * scale, F_PX);
    EXPECT_NEAR(scale, 1, 0.001);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frontal_tag),
        cmocka_unit_test(test_tag_at_80_degrees),
        cmocka_unit_test(test_tag_of_20_pixels),
        cmocka_unit_test(test_nearly_collinear_corners),
        cmocka_unit_test(test_nan_corner),
        cmocka_unit_test(test_coplanar_points),
        cmocka_unit_test(test_points_behind_camera),
        cmocka_unit_test(test_duplicate_tag_in_view),
        cmocka_unit_test(test_tag_moved_after_mapping),
        cmocka_unit_test(test_mirrored_room),
        cmocka_unit_test(test_far_from_origin),
        cmocka_unit_test(test_focal_length_off_by_5_percent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
