// Tag corners, planar poses, the pose solver, and the locator on single images.
#include "tests/support/test.h"

#include "locate/locator.h"
#include "locate/pose_solver.h"
#include "tests/support/tag_picture.h"
#include "tests/support/tag_view.h"

#include <stdio.h>
#include <string.h>

enum { WIDTH = 640, HEIGHT = 480 };

static uint8_t rgb[WIDTH * HEIGHT * 3], gray[WIDTH * HEIGHT];
static uint16_t depth[WIDTH * HEIGHT];

static struct lens ideal_lens(void) { return tag_picture_lens(WIDTH, HEIGHT, 525); }

static struct lens distorting_lens(void)
{
    struct lens l = tag_picture_lens(WIDTH, HEIGHT, 545);
    l.k1 = -0.15, l.k2 = 0.04, l.p1 = 0.001, l.p2 = -0.0008;
    return l;
}

// Detects and refines the image's only tag. *rough: the relative error of its size by the detector alone, *fine: the
// same after refinement. Returns the largest corner error, pixels.
static double refined_error(struct tag_picture *p, double *rough, double *fine)
{
    struct tag_detector *f;
    struct tag_refiner *r;
    struct tag_detection seen[4];
    struct tag_observation s;
    struct tag_pattern pattern;
    struct pixel truth[4], centre = {0, 0};
    int count;
    p->rgb = rgb;
    EXPECT_TRUE(tag_picture_draw(p));
    gray_from_rgb(rgb, WIDTH * HEIGHT, gray);
    EXPECT_STATUS(tag_detector_open(&f, 1), OK);
    EXPECT_STATUS(tag_detector_detect(f, &(struct gray_image){gray, WIDTH, HEIGHT}, seen, 4, &count), OK);
    EXPECT_INT(count, 1);
    EXPECT_STATUS(tag_refiner_open(&r, &p->lens), OK);
    EXPECT_TRUE(tag_pattern(seen[0].id, &pattern));
    EXPECT_TRUE(tag_refine(r, rgb, seen[0].id, &pattern, seen[0].corner, &s));
    EXPECT_AT_LEAST(s.correlation, 0.9);
    tag_picture_corners(p, 0, truth);
    double worst = 0, size = 0, grown_rough = 0, grown_fine = 0;
    for (int k = 0; k < 4; k++)
        centre.x += truth[k].x / 4, centre.y += truth[k].y / 4;
    for (int k = 0; k < 4; k++) {
        struct pixel at = lens_project(&p->lens, s.ray[k]);
        double dx = truth[k].x - centre.x, dy = truth[k].y - centre.y;
        worst = fmax(worst, hypot(at.x - truth[k].x, at.y - truth[k].y));
        size += dx * dx + dy * dy;
        grown_fine += dx * (at.x - truth[k].x) + dy * (at.y - truth[k].y);
        grown_rough += dx * (seen[0].corner[k].x - truth[k].x) + dy * (seen[0].corner[k].y - truth[k].y);
    }
    *rough = grown_rough / size;
    *fine = grown_fine / size;
    tag_refiner_close(&r);
    tag_detector_close(&f);
    return worst;
}

static void test_corners_are_refined(void **state)
{
    (void)state;
    static const struct {
        const char *what;
        double distance, yaw, pitch, noise, within;
        bool distorted;
    } cases[] = {
        {"head-on", 1, 0, 0, 0, 0.01, false},
        {"head-on, noise", 1, 0, 0, 2, 0.015, false},
        {"rotated", 1.5, 0.6, -0.4, 2, 0.02, false},
        {"distorting lens", 1, 0.5, 0.3, 2, 0.015, true},
        {"edges along the rows", 1, 0.5, 0.3, 0, 0.015, false},
        {"far", 4, 0.4, 0.2, 2, 0.06, false},
        {"at 78 degrees", 0.7, 1.36, 0, 1, 0.015, false},
        {"tiny: 14 px", 6, 0.5, 0.4, 1, 0.06, false},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        struct place_tag tag = {.id = 3, .side_m = 0.16, .world_from_tag = {{0, 0, 0, 1}, {0.03, -0.02, 0}}};
        struct tag_picture p = {.lens = cases[i].distorted ? distorting_lens() : ideal_lens(),
                                .tags = &tag,
                                .tag_count = 1,
                                .seed = 100 + i,
                                .world_from_camera =
                                    tag_picture_view(cases[i].distance, cases[i].yaw, cases[i].pitch, 0.1),
                                .noise = cases[i].noise};
        double rough, fine, error = refined_error(&p, &rough, &fine);
        printf("%-16s worst corner %.3f px\n", cases[i].what, error);
        EXPECT_AT_MOST(error, cases[i].within);
    }
}

// Edges found in gamma-encoded values make a tag too small; the refined ones must not.
static void test_gamma_does_not_shrink_tags(void **state)
{
    (void)state;
    struct place_tag tag = {.id = 8, .side_m = 0.16, .world_from_tag = POSE_IDENTITY};
    double rough_sum = 0, fine_sum = 0;
    for (int i = 0; i < 6; i++) {
        struct tag_picture p = {.lens = ideal_lens(),
                                .tags = &tag,
                                .tag_count = 1,
                                .noise = 1,
                                .seed = 40 + (uint64_t)i,
                                .world_from_camera = tag_picture_view(3.3 + 0.013 * i, 0.3, 0.2 - 0.1 * i, 0.15 * i)};
        double rough, fine;
        refined_error(&p, &rough, &fine);
        rough_sum += rough / 6;
        fine_sum += fine / 6;
    }
    printf("a tag 25 px wide: detector %.4f, refined %.4f of its size\n", rough_sum, fine_sum);
    EXPECT_AT_MOST(rough_sum, -0.008); // or this test shows nothing
    EXPECT_NEAR(fine_sum, 0, 0.0005);
}

// ---------------------------------------------------------------- planar poses

static void project(const struct pose *camera_from_tag, double side, struct vec3 ray[4])
{
    struct place_tag tag = {.side_m = side, .world_from_tag = *camera_from_tag};
    place_tag_corners(&tag, ray);
    for (int k = 0; k < 4; k++)
        ray[k] = v3(ray[k].x / ray[k].z, ray[k].y / ray[k].z, 1);
}

static void test_planar_poses_contain_truth(void **state)
{
    (void)state;
    struct rng rng = {11};
    for (int i = 0; i < 500; i++) {
        // every seventh exactly head-on and on the axis, where a formula may divide by zero
        double yaw = i % 7 ? rng_between(&rng, -1.3, 1.3) : 0;
        double pitch = i % 7 ? rng_between(&rng, -1.3, 1.3) : 0;
        double distance = rng_between(&rng, 0.3, 5.3);
        struct pose world_from_camera = tag_picture_view(distance, yaw, pitch, rng_between(&rng, 0, 6));
        struct pose truth = pose_inverse(world_from_camera), found[2];
        if (i % 3)
            truth.translation = v3_add(truth.translation, v3(0.3 * (rng_uniform(&rng) - 0.5), 0.1, 0));
        struct vec3 ray[4], normal = quat_rotate(truth.rotation, v3(0, 0, 1));
        if (v3_dot(normal, truth.translation) > -0.05 * v3_length(truth.translation))
            continue; // edge-on
        project(&truth, 0.16, ray);
        int n = planar_poses(0.16, ray, found);
        double best = 1e9;
        for (int k = 0; k < n; k++) {
            EXPECT_TRUE(pose_finite(found[k]));
            best = fmin(best, pose_angle(found[k], truth) + v3_distance(found[k].translation, truth.translation));
        }
        EXPECT_AT_MOST(best, 1e-5);
    }
}

static void test_invalid_squares(void **state)
{
    (void)state;
    struct pose truth = pose_inverse(tag_picture_view(1, 0.3, 0.2, 0)), out[2];
    struct vec3 ray[4], bad[4];
    project(&truth, 0.16, ray);
    EXPECT_INT(planar_poses(0.16, ray, out) > 0, 1);
    EXPECT_INT(planar_poses(0, ray, out), 0);
    EXPECT_INT(planar_poses(NAN, ray, out), 0);
    for (int k = 0; k < 4; k++) {
        memcpy(bad, ray, sizeof bad);
        bad[k].x = NAN;
        EXPECT_INT(planar_poses(0.16, bad, out), 0);
        memcpy(bad, ray, sizeof bad);
        bad[k] = v3_mix(ray[(k + 1) % 4], ray[(k + 2) % 4], 0.5); // three in a line
        EXPECT_INT(planar_poses(0.16, bad, out), 0);
    }
    for (int k = 0; k < 4; k++) // all in a line
        bad[k] = v3(0.1 * k, 0.05 * k, 1);
    EXPECT_INT(planar_poses(0.16, bad, out), 0);
    for (int k = 0; k < 4; k++) // all the same
        bad[k] = v3(0.1, 0.1, 1);
    EXPECT_INT(planar_poses(0.16, bad, out), 0);
    for (int k = 0; k < 4; k++) // seen from behind: the order runs the other way round
        bad[k] = ray[3 - k];
    EXPECT_INT(planar_poses(0.16, bad, out), 0);
}

// ---------------------------------------------------------------- pose solver, without images

static const struct place_tag wall[4] = {
    {.id = 0, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {-0.8, 0.3, 0}}},
    {.id = 1, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.7, 0.4, 0}}},
    {.id = 2, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.1, -0.6, 0}}},
    {.id = 3, .side_m = 0.2, .world_from_tag = {{0, 0.7071, 0, 0.7071}, {-1.2, 0, 0.8}}},
};

static void test_moved_tag_is_rejected(void **state)
{
    (void)state;
    struct rng rng = {5};
    for (int moved = 0; moved < 4; moved++) {
        struct pose truth = tag_picture_view(3, 0.3, -0.1, 0);
        struct tag_observation s[4];
        struct pnp_tag tags[4];
        struct pnp_solution fit;
        for (int i = 0; i < 4; i++) {
            struct place_tag now = wall[i];
            if (i == moved)
                now.world_from_tag.translation.y += 0.12;
            s[i] = tag_view_observe(&now, &truth, 0.1, &rng);
            tags[i] = tag_view_for_solver(&wall[i], &s[i]);
        }
        EXPECT_STATUS(tag_view_solve(tags, 4, 2.5, &fit), OK);
        EXPECT_INT(fit.used, 3);
        EXPECT_TRUE(!tags[moved].used);
        EXPECT_AT_MOST(v3_distance(pose_inverse(fit.camera_from_world).translation, truth.translation), 0.02);
        EXPECT_AT_MOST(pose_angle(pose_inverse(fit.camera_from_world), truth) * 57.3, 0.5);
    }
}

static void test_contradicting_tags_give_no_pose(void **state)
{
    (void)state;
    struct rng rng = {6};
    struct pose truth = tag_picture_view(2, 0.5, -0.3, 0);
    struct place_tag now = wall[1];
    now.world_from_tag.translation.y += 0.2;
    struct tag_observation s[2] = {tag_view_observe(&wall[0], &truth, 0.05, &rng),
                                   tag_view_observe(&now, &truth, 0.05, &rng)};
    struct pnp_tag tags[2] = {tag_view_for_solver(&wall[0], &s[0]), tag_view_for_solver(&wall[1], &s[1])};
    struct pnp_solution fit;
    enum status status = tag_view_solve(tags, 2, 2.5, &fit);
    EXPECT_TRUE(status == AMBIGUOUS || status == NOTHING);
}

static void test_duplicate_tag_id(void **state)
{
    (void)state;
    struct rng rng = {7};
    struct pose truth = tag_picture_view(2, 0.5, -0.3, 0);
    struct place_tag copy = wall[0];
    copy.world_from_tag.translation = v3(0.2, 0.9, 0.1);
    struct tag_observation s[3] = {tag_view_observe(&copy, &truth, 0.05, &rng),
                                   tag_view_observe(&wall[0], &truth, 0.05, &rng),
                                   tag_view_observe(&wall[2], &truth, 0.05, &rng)};
    struct pnp_solution fit;
    struct pnp_tag tags[3] = {tag_view_for_solver(&wall[0], &s[0]), tag_view_for_solver(&wall[0], &s[1]),
                              tag_view_for_solver(&wall[2], &s[2])};
    EXPECT_STATUS(tag_view_solve(tags, 2, 2.5, &fit), NOTHING); // which of the two is the mapped one?
    EXPECT_STATUS(tag_view_solve(tags, 3, 2.5, &fit), OK);      // the third tag decides
    EXPECT_INT(fit.used, 2);
    EXPECT_TRUE(!tags[0].used && tags[1].used && tags[2].used);
    EXPECT_AT_MOST(v3_distance(pose_inverse(fit.camera_from_world).translation, truth.translation), 0.02);
}

static void test_bad_observations_give_no_pose(void **state)
{
    (void)state;
    struct rng rng = {8};
    struct pose truth = tag_picture_view(2, 0.5, -0.3, 0);
    struct tag_observation s[2] = {tag_view_observe(&wall[0], &truth, 0.05, &rng),
                                   tag_view_observe(&wall[2], &truth, 0.05, &rng)};
    struct pnp_tag tags[2] = {tag_view_for_solver(&wall[0], &s[0]), tag_view_for_solver(&wall[2], &s[1])};
    struct pnp_solution fit;
    EXPECT_STATUS(tag_view_solve(tags, 0, 2.5, &fit), NOTHING);
    s[0].ray[2].x = NAN;
    EXPECT_STATUS(tag_view_solve(tags, 1, 2.5, &fit), NOTHING);
    EXPECT_STATUS(tag_view_solve(tags, 2, 2.5, &fit), OK); // the other tag is valid
    EXPECT_INT(fit.used, 1);
    EXPECT_TRUE(pose_finite(fit.camera_from_world));
    for (int k = 0; k < 4; k++) // what a tag behind the camera would project to
        s[0].ray[k] = v3(-s[1].ray[k].x, -s[1].ray[k].y, 1);
    s[0].ray[0] = v3_scale(s[0].ray[0], 1.3);
    enum status status = tag_view_solve(tags, 1, 0.5, &fit);
    if (status != NOTHING)
        EXPECT_TRUE(pose_apply(fit.camera_from_world, wall[0].world_from_tag.translation).z > 0);
}

static void test_mirrored_pose_is_reported(void **state)
{
    (void)state;
    // 12 px wide, nearly head-on: noise decides between two poses
    struct rng rng = {9};
    int ambiguous = 0, wrong = 0, resolved = 0;
    for (int i = 0; i < 50; i++) {
        struct vec3 off = rng_normal3(&rng, 0.25);
        struct pose truth = tag_picture_view(8, off.x, off.y, 0);
        struct place_tag tag = {.id = 0, .side_m = 0.2, .world_from_tag = POSE_IDENTITY};
        struct tag_observation s = tag_view_observe(&tag, &truth, 0.1, &rng);
        struct pnp_tag one = tag_view_for_solver(&tag, &s);
        struct pnp_solution fit;
        enum status status = tag_view_solve(&one, 1, 2.5, &fit);
        bool flipped = pose_angle(pose_inverse(fit.camera_from_world), truth) > 0.35;
        ambiguous += status == AMBIGUOUS;
        wrong += status == OK && flipped;
        // Depth of the tag's plane decides, where the tag is near enough.
        struct pose close = tag_picture_view(1.2, 0.5, 0, 0);
        struct tag_observation seen_close = tag_view_observe(&tag, &close, 1.5, &rng);
        struct tag_depth plane = {.share = 0.25};
        for (int k = 0; k < TAG_DEPTH_SAMPLES; k++) {
            struct vec3 p = pose_apply(pose_inverse(close), v3((k % 6 - 2.5) * 0.033, (k / 6 - 2.5) * 0.033, 0));
            plane.sample[plane.count++] = (struct depth_sample){p.x / p.z, p.y / p.z, p.z + 0.002 * rng_normal(&rng)};
        }
        one = tag_view_for_solver(&tag, &seen_close);
        one.depth = &plane;
        status = tag_view_solve(&one, 1, 8, &fit);
        resolved += status >= 0 && status != NOTHING && pose_angle(pose_inverse(fit.camera_from_world), close) < 0.2;
    }
    printf("50 small tags: %d ambiguous, %d mirrored but not ambiguous; with depth %d right\n", ambiguous, wrong,
           resolved);
    EXPECT_AT_LEAST(ambiguous, 40);
    EXPECT_AT_MOST(wrong, 1);
    EXPECT_AT_LEAST(resolved, 48);
}

// ---------------------------------------------------------------- locator, with images

static enum status locate(const struct place *place, const struct lens *lens, bool use_depth, struct location *out)
{
    struct locator *l;
    EXPECT_STATUS(locator_open(&l, place, lens, NULL), OK);
    enum status status = locator_localize(l, rgb, use_depth ? depth : NULL, out);
    locator_close(&l);
    return status;
}

static void test_camera_is_localized(void **state)
{
    (void)state;
    const struct place place = {.tags = (struct place_tag *)(uintptr_t)wall, .tag_count = 4};
    struct tag_picture p = {.lens = distorting_lens(),
                            .tags = wall,
                            .tag_count = 4,
                            .noise = 2,
                            .seed = 21,
                            .rgb = rgb,
                            .depth = depth,
                            .world_from_camera = tag_picture_view(2.8, 0.4, -0.15, 0.1)};
    struct location at;
    EXPECT_TRUE(tag_picture_draw(&p));
    for (int use_depth = 0; use_depth < 2; use_depth++) {
        EXPECT_STATUS(locate(&place, &p.lens, use_depth, &at), OK);
        double off = v3_distance(at.world_from_camera.translation, p.world_from_camera.translation);
        printf("localised within %.2f mm, %.3f degrees, rms %.3f px, %d tags\n", off * 1e3,
               pose_angle(at.world_from_camera, p.world_from_camera) * 57.2958, at.rms_px, (int)at.tags_used);
        EXPECT_AT_MOST(off, 0.0005);
        EXPECT_AT_MOST(pose_angle(at.world_from_camera, p.world_from_camera) * 57.2958, 0.01);
        EXPECT_AT_LEAST(at.tags_used, 3);
        EXPECT_INT(at.tags_rejected, 0);
    }
    // The same image with a lens that is not the camera's: the residuals must show it.
    struct lens wrong = p.lens;
    wrong.fx *= 1.08;
    wrong.fy *= 1.08;
    double rms = at.rms_px;
    enum status status = locate(&place, &wrong, false, &at);
    if (status != NOTHING)
        EXPECT_AT_LEAST(at.rms_px, 4 * rms);
}

static void test_empty_image(void **state)
{
    (void)state;
    const struct place place = {.tags = (struct place_tag *)(uintptr_t)wall, .tag_count = 4};
    struct lens lens = ideal_lens();
    struct location at = {.rms_px = -1};
    memset(rgb, 120, sizeof rgb);
    EXPECT_STATUS(locate(&place, &lens, false, &at), NOTHING);
    EXPECT_NEAR(at.rms_px, -1, 0); // untouched
    // a tag that is not of this place
    struct place_tag other = wall[0];
    other.id = 99;
    struct tag_picture p = {
        .lens = lens, .tags = &other, .tag_count = 1, .rgb = rgb, .world_from_camera = tag_picture_view(2, 0.4, 0, 0)};
    EXPECT_TRUE(tag_picture_draw(&p));
    EXPECT_STATUS(locate(&place, &lens, false, &at), NOTHING);
}

static void test_invalid_places(void **state)
{
    (void)state;
    struct place_tag tags[2] = {wall[0], wall[1]};
    struct place place = {.tags = tags, .tag_count = 2};
    struct lens lens = ideal_lens(), bad = lens;
    struct locator *l;
    bad.fx = NAN;
    EXPECT_STATUS(locator_open(&l, &place, &bad, NULL), ERR_INPUT);
    EXPECT_TRUE(l == NULL);
    tags[1].id = tags[0].id;
    EXPECT_STATUS(locator_open(&l, &place, &lens, NULL), ERR_INPUT);
    tags[1] = wall[1];
    tags[1].side_m = 0;
    EXPECT_STATUS(locator_open(&l, &place, &lens, NULL), ERR_INPUT);
    tags[1] = wall[1];
    tags[1].world_from_tag.translation.x = INFINITY;
    EXPECT_STATUS(locator_open(&l, &place, &lens, NULL), ERR_INPUT);
    place.tag_count = 0;
    EXPECT_STATUS(locator_open(&l, &place, &lens, NULL), ERR_INPUT);
    EXPECT_TRUE(l == NULL);
    locator_close(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_corners_are_refined),
        cmocka_unit_test(test_gamma_does_not_shrink_tags),
        cmocka_unit_test(test_planar_poses_contain_truth),
        cmocka_unit_test(test_invalid_squares),
        cmocka_unit_test(test_moved_tag_is_rejected),
        cmocka_unit_test(test_contradicting_tags_give_no_pose),
        cmocka_unit_test(test_duplicate_tag_id),
        cmocka_unit_test(test_bad_observations_give_no_pose),
        cmocka_unit_test(test_mirrored_pose_is_reported),
        cmocka_unit_test(test_camera_is_localized),
        cmocka_unit_test(test_empty_image),
        cmocka_unit_test(test_invalid_places),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
