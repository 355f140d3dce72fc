// The least squares of stereo calibration against a rig that is known: centroids by summing over each disc's area,
// slopes by differences, and the spread of many calibrations against the covariance that one of them gives.
#include "tests/support/test.h"

#include "capture/calibration/stereo_bundle.h"

#include <stdio.h>

enum { SEED = 1971, BOARDS = 8, COLUMNS = 7, ROWS = 5, DISCS = COLUMNS * ROWS, SIGHTINGS = 2 * BOARDS * DISCS };
#define PITCH_M  0.04
#define RADIUS_M 0.012

struct scene {
    struct stereo_bundle bundle;
    struct pose pose[BOARDS];
    struct disc_sighting seen[SIGHTINGS];
};

static const struct lens true_lens[2] = {
    {.width = 640, .height = 480, .fx = 530, .fy = 533, .cx = 321, .cy = 238, .k1 = -0.12, .k2 = 0.05, .p1 = 1e-3},
    {.width = 640, .height = 480, .fx = 541, .fy = 538, .cx = 316, .cy = 243, .k1 = -0.09, .k2 = 0.03, .p2 = -8e-4}};

static struct pose pose_of(struct vec3 turn, struct vec3 shift)
{
    return (struct pose){quat_from_rotation_vector(turn), shift};
}

// The centroid of a disc's image by the sum over small pieces of its area, each as large as its image is.
static bool sum_over_disc(const struct stereo_bundle *b, const struct disc_sighting *s, struct pixel *out)
{
    enum { RINGS = 10, SECTORS = 24 };
    const struct pose camera = pose_multiply(b->camera_from_left[s->camera], b->left_from_board[s->board]);
    double sum = 0;
    *out = (struct pixel){0, 0};
    for (int r = 0; r < RINGS; r++)
        for (int k = 0; k < SECTORS; k++) {
            const double radius = b->radius_m * sqrt((r + 0.5) / RINGS), angle = 6.283185307179586 * k / SECTORS;
            const struct vec3 p = pose_apply(camera, v3(s->x_m + radius * cos(angle), s->y_m + radius * sin(angle), 0));
            if (p.z <= 0)
                return false;
            const struct pixel px = lens_project(&b->lens[s->camera], p);
            const double area = 1 / (p.z * p.z * p.z);
            out->x += area * px.x;
            out->y += area * px.y;
            sum += area;
        }
    *out = (struct pixel){out->x / sum, out->y / sum};
    return true;
}

// The rig with boards at several distances and tilts, and what it sees of them: exactly, or with noise.
static void make_scene(struct scene *scene, struct rng *rng, double noise_px)
{
    struct stereo_bundle *b = &scene->bundle;
    *b = (struct stereo_bundle){
        .left_from_board = scene->pose,
        .boards = BOARDS,
        .seen = scene->seen,
        .radius_m = RADIUS_M,
        .lens = {true_lens[0], true_lens[1]},
        .camera_from_left = {POSE_IDENTITY, pose_of(v3(0.01, -0.04, 0.006), v3(-0.12, 0, 0.003))}};
    for (int i = 0; i < BOARDS; i++) {
        const double about_x = 0.5 * cos(2.4 * i), about_y = 0.5 * sin(2.4 * i), about_z = 0.3 * i;
        scene->pose[i] = pose_of(v3(about_x, about_y, about_z), v3(0, 0, 0.45 + 0.06 * i));
        const struct vec3 middle =
            pose_apply(scene->pose[i], v3(0.5 * (COLUMNS - 1) * PITCH_M, 0.5 * (ROWS - 1) * PITCH_M, 0));
        scene->pose[i].translation.x += 0.06 * cos(1.7 * i) + 0.05 - middle.x;
        scene->pose[i].translation.y += 0.05 * sin(1.7 * i) - middle.y;
    }
    for (int i = 0; i < SIGHTINGS; i++) {
        const int disc = i % DISCS;
        struct disc_sighting *s = &scene->seen[b->count++];
        *s = (struct disc_sighting){.camera = i / DISCS % 2,
                                    .board = i / DISCS / 2,
                                    .x_m = disc % COLUMNS * PITCH_M,
                                    .y_m = disc / COLUMNS * PITCH_M};
        EXPECT_TRUE(sum_over_disc(b, s, &s->at));
        const double x = noise_px ? rng_normal(rng) : 0, y = noise_px ? rng_normal(rng) : 0;
        s->at = (struct pixel){s->at.x + noise_px * x, s->at.y + noise_px * y};
    }
}

// As a first estimate of each part is off.
static void disturb(struct stereo_bundle *b, struct rng *rng)
{
    for (int i = 0; i < 2; i++) {
        b->lens[i].fx *= 1 + 0.02 * rng_normal(rng);
        b->lens[i].fy *= 1 + 0.02 * rng_normal(rng);
        b->lens[i].cx += 4 * rng_normal(rng);
        b->lens[i].cy += 4 * rng_normal(rng);
        b->lens[i].k1 = b->lens[i].k2 = b->lens[i].p1 = b->lens[i].p2 = 0;
    }
    for (int i = -1; i < b->boards; i++) {
        struct pose *pose = i < 0 ? &b->camera_from_left[1] : &b->left_from_board[i];
        const struct vec3 turn = rng_normal3(rng, 0.02), shift = rng_normal3(rng, 0.005);
        *pose = pose_multiply(*pose, pose_of(turn, shift));
    }
}

static double unknown_of(const struct stereo_bundle *b, int i)
{
    const struct lens *l = &b->lens[i / BUNDLE_LENS % 2];
    const double numbers[BUNDLE_LENS] = {l->fx, l->fy, l->cx, l->cy, l->k1, l->k2, l->p1, l->p2};
    return numbers[i % BUNDLE_LENS];
}

static double baseline_m(const struct stereo_bundle *b) { return v3_length(b->camera_from_left[1].translation); }

static struct scene scene, truth;

// ------------------------------------------------------------- the model

static void test_centroid_of_a_disc(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    double most = 0, centre = 0;
    for (int i = 0; i < scene.bundle.count; i++) {
        const struct disc_sighting *s = &scene.seen[i];
        struct pixel predicted;
        EXPECT_TRUE(stereo_predict(&scene.bundle, s, &predicted));
        most = fmax(most, hypot(predicted.x - s->at.x, predicted.y - s->at.y));
        const struct pose camera =
            pose_multiply(scene.bundle.camera_from_left[s->camera], scene.bundle.left_from_board[s->board]);
        const struct pixel middle =
            lens_project(&scene.bundle.lens[s->camera], pose_apply(camera, v3(s->x_m, s->y_m, 0)));
        centre = fmax(centre, hypot(middle.x - s->at.x, middle.y - s->at.y));
    }
    print_message("centroids: %.2g px off; the images of the centres %.2g px\n", most, centre);
    EXPECT_AT_MOST(most, 1e-6);   // measured 3.4e-7 px
    EXPECT_AT_LEAST(centre, 0.1); // measured 0.25 px
}

static void test_behind_the_camera(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    struct pixel out;
    EXPECT_AT_MOST(stereo_bundle_cost(&scene.bundle), 1e-6);
    scene.pose[2].translation.z = -1;
    const struct disc_sighting *s = &scene.seen[2 * 2 * DISCS];
    EXPECT_INT(s->board, 2);
    EXPECT_TRUE(!stereo_predict(&scene.bundle, s, &out));
    EXPECT_NEAR(stereo_bundle_cost(&scene.bundle), 1e30, 0);
    scene.pose[2].translation.z = NAN;
    EXPECT_TRUE(!stereo_predict(&scene.bundle, s, &out));
}

// Huber's function: squares up to 0.3 pixels, a line beyond.
static void test_cost(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    const double offsets[] = {0.1, 0.3, 0.5, 40};
    for (size_t i = 0; i < COUNT_OF(offsets); i++) {
        const double d = offsets[i], wanted = d <= 0.3 ? d * d : 0.3 * (2 * d - 0.3);
        struct pixel *at = &scene.seen[5].at, before = *at;
        at->x += 0.6 * d;
        at->y -= 0.8 * d;
        EXPECT_NEAR(stereo_bundle_cost(&scene.bundle), wanted, 2e-4 * (1 + d));
        scene.seen[5].outlier = true;
        EXPECT_AT_MOST(stereo_bundle_cost(&scene.bundle), 1e-6);
        scene.seen[5].outlier = false;
        *at = before;
    }
}

static void test_moves(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    truth = scene;
    for (int i = 0; i < BUNDLE_SHARED; i++) {
        stereo_bundle_move(&scene.bundle, i, 1e-3);
        for (int k = 0; k < 2 * BUNDLE_LENS; k++)
            EXPECT_NEAR(unknown_of(&scene.bundle, k) - unknown_of(&truth.bundle, k), k == i ? 1e-3 : 0, 1e-12);
        const struct pose moved = scene.bundle.camera_from_left[1], pose = truth.bundle.camera_from_left[1];
        EXPECT_NEAR(pose_angle(moved, pose), i >= 2 * BUNDLE_LENS && i < 2 * BUNDLE_LENS + 3 ? 1e-3 : 0, 1e-7);
        EXPECT_NEAR(v3_distance(moved.translation, pose.translation), i >= 2 * BUNDLE_LENS + 3 ? 1e-3 : 0, 1e-12);
        stereo_bundle_move(&scene.bundle, i, -1e-3);
    }
}

// ------------------------------------------------------------- the solution

static void test_exact_sightings(void **state)
{
    (void)state;
    double focal = 0, baseline = 0;
    for (int round = 0; round < 3; round++) {
        struct rng rng = rng_of(SEED, 10 + round);
        make_scene(&scene, &rng, 0);
        truth.bundle = scene.bundle;
        disturb(&scene.bundle, &rng);
        EXPECT_AT_LEAST(stereo_bundle_cost(&scene.bundle), 100);
        EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, NULL), OK);
        EXPECT_AT_MOST(stereo_bundle_cost(&scene.bundle), 1e-6); // as at the truth: Radon's rule against the sum
        focal = fmax(focal, fabs(scene.bundle.lens[0].fx - true_lens[0].fx));
        focal = fmax(focal, fabs(scene.bundle.lens[1].fy - true_lens[1].fy));
        baseline = fmax(baseline, fabs(baseline_m(&scene.bundle) - baseline_m(&truth.bundle)));
    }
    print_message("exact sightings: focal length %.2g px, baseline %.2g m off\n", focal, baseline);
    EXPECT_AT_MOST(focal, 1e-5);    // measured 6.1e-7 px
    EXPECT_AT_MOST(baseline, 1e-9); // measured 1.8e-11 m
}

// The errors of many calibrations, in the standard deviations that each of them states.
static void test_covariance(void **state)
{
    (void)state;
    enum { ROUNDS = SANITIZED ? 6 : 24 };
    static double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    double squares = 0;
    int numbers = 0;
    for (int round = 0; round < ROUNDS; round++) {
        struct rng rng = rng_of(SEED, 100 + round);
        make_scene(&scene, &rng, 0.05);
        EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, covariance), OK);
        for (int i = 0; i < 2 * BUNDLE_LENS; i++) {
            const double variance = covariance[i * BUNDLE_SHARED + i];
            const double error = unknown_of(&scene.bundle, i) -
                                 unknown_of(&(struct stereo_bundle){.lens = {true_lens[0], true_lens[1]}}, i);
            EXPECT_TRUE(variance > 0);
            squares += error * error / variance;
            numbers++;
        }
        for (int i = 0; i < BUNDLE_SHARED; i++)
            for (int k = 0; k < i; k++)
                EXPECT_NEAR(covariance[i * BUNDLE_SHARED + k], covariance[k * BUNDLE_SHARED + i],
                            1e-6 * sqrt(covariance[i * BUNDLE_SHARED + i] * covariance[k * BUNDLE_SHARED + k]));
    }
    print_message("errors are %.2f of their standard deviations\n", sqrt(squares / numbers));
    EXPECT_NEAR(sqrt(squares / numbers), 1, 0.2); // measured 0.94
}

// Some discs are another's, and nothing else is left out.
static void test_outliers(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 1);
    make_scene(&scene, &rng, 0.05);
    const struct stereo_bundle exact = scene.bundle;
    for (int i = 0; i < SIGHTINGS; i += 40)
        scene.seen[i].at.x += i % 80 ? 25 : -8;
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, NULL), OK);
    for (int i = 0; i < SIGHTINGS; i++)
        EXPECT_INT(scene.seen[i].outlier, i % 40 == 0);
    EXPECT_NEAR(scene.bundle.lens[0].fx, true_lens[0].fx, 1.5);
    EXPECT_NEAR(baseline_m(&scene.bundle), baseline_m(&exact), 3e-4);
}

// ------------------------------------------------------------- nothing to solve

static void test_no_sightings(void **state)
{
    (void)state;
    static double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    truth = scene;
    scene.bundle.count = 0;
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, covariance), OK);
    for (int i = 0; i < 2 * BUNDLE_LENS; i++)
        EXPECT_NEAR(unknown_of(&scene.bundle, i), unknown_of(&truth.bundle, i), 0); // all stays
    scene.bundle.boards = 0;
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, covariance), OK);
}

static void test_one_disc(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    scene.bundle.count = 1;
    scene.seen[0].at.x += 3;
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, NULL), OK);
    struct pixel at;
    EXPECT_TRUE(stereo_predict(&scene.bundle, &scene.seen[0], &at));
    EXPECT_NEAR(at.x, scene.seen[0].at.x, 0.01);
}

// One board straight ahead tells distance and focal length apart by nothing: they stay together what they were, and
// the covariance says so.
static void test_one_board_straight_ahead(void **state)
{
    (void)state;
    static double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    scene.bundle.count = DISCS;
    scene.bundle.boards = 1;
    scene.pose[0] = pose_of(v3(0, 0, 0), v3(-0.12, -0.08, 0.6));
    for (int i = 0; i < DISCS; i++) {
        scene.seen[i].camera = scene.seen[i].board = 0;
        EXPECT_TRUE(sum_over_disc(&scene.bundle, &scene.seen[i], &scene.seen[i].at));
        scene.seen[i].at.x += 0.05 * rng_normal(&rng);
        scene.seen[i].at.y += 0.05 * rng_normal(&rng);
    }
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, covariance), OK);
    const double relative = sqrt(covariance[0]) / scene.bundle.lens[0].fx;
    print_message("one board: focal length known to %.2g of itself\n", relative);
    EXPECT_TRUE(relative == 0 || relative > 0.05); // 0: not known
}

static void test_boards_behind_the_camera(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    for (int i = 0; i < BOARDS; i++)
        scene.pose[i].translation.z *= -1;
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, NULL), ERR_SOLVER);
}

static void test_sighting_that_is_no_number(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    make_scene(&scene, &rng, 0);
    scene.seen[17].at.y = NAN;
    EXPECT_STATUS(stereo_bundle_solve(&scene.bundle, NULL), ERR_SOLVER);
}

int main(void)
{
    print_message("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_centroid_of_a_disc),
        cmocka_unit_test(test_behind_the_camera),
        cmocka_unit_test(test_cost),
        cmocka_unit_test(test_moves),
        cmocka_unit_test(test_exact_sightings),
        cmocka_unit_test(test_covariance),
        cmocka_unit_test(test_outliers),
        cmocka_unit_test(test_no_sightings),
        cmocka_unit_test(test_one_disc),
        cmocka_unit_test(test_one_board_straight_ahead),
        cmocka_unit_test(test_boards_behind_the_camera),
        cmocka_unit_test(test_sighting_that_is_no_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
