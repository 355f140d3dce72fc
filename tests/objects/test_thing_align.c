// Alignment by pixels against pictures whose pose is known: a printed sheet and a printed can, drawn by casting a ray
// for each pixel, with another gain and offset in each camera.
#include "tests/support/test.h"

#include "objects/thing_align.h"

#include <stdio.h>

enum { SEED = 1981, WIDTH = 320, HEIGHT = 240, ACROSS = 30, DOWN = 24, SAMPLES = ACROSS * DOWN, STARTS = 8 };
#define SHEET_WIDE_M 0.20
#define SHEET_HIGH_M 0.16
#define CAN_RADIUS_M 0.07

static const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 300, .fy = 300, .cx = 159.5, .cy = 119.5};
static const struct pose right_from_left = {{0, 0, 0, 1}, {-0.12, 0, 0}};

static struct thing_samples samples;
static struct thing_view views[2];

// What is printed at (x, y) metres: grey levels of a channel.
static double print_at(double x, double y, int channel)
{
    const double k = 60 + 13 * channel;
    return 120 + 45 * sin(k * x + 0.7 * channel) * cos(0.8 * k * y - 0.3) + 35 * sin(0.45 * k * (x + y) + channel);
}

// The sheet lies in the thing's plane z = 0, seen from its -z side. Of the can, whose axis is y, the half with z < 0 is
// sampled; what is printed goes around it.
static void make_samples(void)
{
    samples.count = SAMPLES;
    for (int i = 0; i < SAMPLES; i++) {
        const double x = ((i % ACROSS + 0.5) / ACROSS - 0.5) * SHEET_WIDE_M,
                     y = ((i / ACROSS + 0.5) / DOWN - 0.5) * SHEET_HIGH_M;
        const double angle = x / CAN_RADIUS_M;
        samples.at[THING_FLAT][i] = v3(x, y, 0);
        samples.normal[THING_FLAT][i] = v3(0, 0, -1);
        samples.facing[THING_FLAT][i] = 1;
        samples.at[THING_TURNED][i] = v3(CAN_RADIUS_M * sin(angle), y, -CAN_RADIUS_M * cos(angle));
        samples.normal[THING_TURNED][i] = v3(sin(angle), 0, -cos(angle));
        samples.facing[THING_TURNED][i] = (float)cos(angle);
        for (int c = 0; c < 3; c++)
            samples.color[i][c] = (float)print_at(x, y, c);
    }
}

// What is printed where the ray meets the thing first. False: it misses.
static bool cast(enum thing_shape shape, double scale, struct vec3 eye, struct vec3 along, double *x, double *y)
{
    double t;
    if (shape == THING_FLAT) {
        t = -eye.z / along.z;
        *x = (eye.x + t * along.x) / scale;
    } else {
        const double a = along.x * along.x + along.z * along.z, b = eye.x * along.x + eye.z * along.z;
        const double c = eye.x * eye.x + eye.z * eye.z - CAN_RADIUS_M * CAN_RADIUS_M * scale * scale;
        const double root = b * b - a * c;
        if (root < 0)
            return false;
        t = (-b - sqrt(root)) / a;
        *x = CAN_RADIUS_M * atan2(eye.x + t * along.x, -eye.z - t * along.z);
    }
    *y = (eye.y + t * along.y) / scale;
    return t > 0 && fabs(*x) < 0.5 * SHEET_WIDE_M && fabs(*y) < 0.5 * SHEET_HIGH_M;
}

static void draw(enum thing_shape shape, double scale, struct pose camera_from_thing, double gain, double offset,
                 uint8_t *rgb)
{
    enum { RAYS = 3 }; // of a pixel, each way
    const struct pose thing_from_camera = pose_inverse(camera_from_thing);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double sum[3] = {0};
        for (int k = 0; k < RAYS * RAYS; k++) {
            const struct pixel px = {i % WIDTH + (k % RAYS + 0.5) / RAYS - 0.5,
                                     i / WIDTH + (k / RAYS + 0.5) / RAYS - 0.5};
            const struct vec3 along = quat_rotate(thing_from_camera.rotation, lens_ray(&lens, px));
            double x, y;
            const bool hit = cast(shape, scale, thing_from_camera.translation, along, &x, &y);
            for (int c = 0; c < 3; c++)
                sum[c] += hit ? print_at(x, y, c) : 90;
        }
        for (int c = 0; c < 3; c++)
            rgb[3 * i + c] = (uint8_t)lround(fmin(255, fmax(0, gain * sum[c] / (RAYS * RAYS) + offset)));
    }
}

static void film(enum thing_shape shape, double scale, struct pose left_from_thing)
{
    static uint8_t rgb[WIDTH * HEIGHT * 3];
    for (int i = 0; i < 2; i++) {
        const struct pose camera_from_left = i ? right_from_left : POSE_IDENTITY;
        thing_view_free(&views[i]);
        draw(shape, scale, pose_multiply(camera_from_left, left_from_thing), i ? 0.7 : 1.1, i ? 25 : -10, rgb);
        EXPECT_STATUS(thing_view_make(&lens, &camera_from_left, rgb, false, &views[i]), OK);
    }
}

static int free_views(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        thing_view_free(&views[i]);
    return 0;
}

static struct align_input input_of(enum thing_shape shape, int view_count)
{
    return (struct align_input){.samples = &samples,
                                .shape = shape,
                                .views = views,
                                .view_count = view_count,
                                .size = {0, 0.1},
                                .variance_factor = 4};
}

// The thing upright before the cameras, its front to them but for some degrees.
static struct pose true_pose(void)
{
    return (struct pose){quat_from_rotation_vector(v3(0.15, -0.2, 0.1)), {0.05, -0.01, 0.5}};
}

static struct pose moved(struct pose pose, struct vec3 turn, struct vec3 shift)
{
    const struct quat rotation = quat_multiply(quat_from_rotation_vector(turn), pose.rotation);
    return (struct pose){quat_unit(rotation), v3_add(pose.translation, shift)};
}

struct errors {
    double turn, shift_m, log_scale;
};

// Aligns from starts up to 1.5 degrees and 4 mm beside the truth; gives the largest errors.
static struct errors align_from_starts(enum thing_shape shape, int view_count, double log_scale)
{
    struct errors most = {0};
    const struct align_input in = input_of(shape, view_count);
    film(shape, exp(log_scale), true_pose());
    for (int i = 0; i < STARTS / (SANITIZED ? 4 : 1); i++) {
        struct rng rng = rng_of(SEED, i);
        const struct vec3 turn = rng_within(&rng, v3(0.025, 0.025, 0.025)),
                          shift = rng_within(&rng, v3(0.004, 0.004, 0.004));
        struct alignment a = {.left_from_thing = moved(true_pose(), turn, shift)};
        EXPECT_TRUE(thing_align(&in, 30, &a));
        most.turn = fmax(most.turn, pose_angle(a.left_from_thing, true_pose()));
        most.shift_m = fmax(most.shift_m, v3_distance(a.left_from_thing.translation, true_pose().translation));
        most.log_scale = fmax(most.log_scale, fabs(a.log_scale - log_scale));
        for (int v = 0; v < view_count; v++) {
            EXPECT_AT_LEAST(a.score[v], 0.995);                           // measured 0.999
            EXPECT_AT_LEAST(a.visible[v], shape == THING_FLAT ? 1 : 0.8); // of the can, less what is turned away: 0.87
        }
    }
    print_message("%s, %d views: %.2g degrees, %.2g mm, size %.2g %%\n", shape == THING_FLAT ? "sheet" : "can",
                  view_count, most.turn * 57.3, 1e3 * most.shift_m, 100 * most.log_scale);
    return most;
}

// ------------------------------------------------------------- the solution

static void test_sheet_by_two_views(void **state)
{
    (void)state;
    const struct errors most = align_from_starts(THING_FLAT, 2, 0.03);
    EXPECT_AT_MOST(most.turn, 0.0015);      // measured 0.0004
    EXPECT_AT_MOST(most.shift_m, 0.00005);  // measured 0.011 mm
    EXPECT_AT_MOST(most.log_scale, 0.0003); // measured 0.00008
}

static void test_can_by_two_views(void **state)
{
    (void)state;
    const struct errors most = align_from_starts(THING_TURNED, 2, -0.02);
    EXPECT_AT_MOST(most.turn, 0.003);       // measured 0.0008
    EXPECT_AT_MOST(most.shift_m, 0.0002);   // measured 0.048 mm
    EXPECT_AT_MOST(most.log_scale, 0.0007); // measured 0.00017
}

// One view tells size and distance apart by the prior alone: what is across the line of sight is as good as before.
static void test_one_view_leaves_size_to_the_prior(void **state)
{
    (void)state;
    const struct errors most = align_from_starts(THING_FLAT, 1, 0);
    EXPECT_AT_MOST(most.turn, 0.001);       // measured 0.0003
    EXPECT_AT_MOST(most.log_scale, 0.0015); // measured 0.0003: the start had the true size
    struct align_input in = input_of(THING_FLAT, 1);
    in.size.sigma = 0.03;
    struct alignment a = {.left_from_thing = true_pose()}, both = a;
    EXPECT_TRUE(thing_align(&in, 30, &a));
    in.view_count = 2;
    EXPECT_TRUE(thing_align(&in, 30, &both));
    // The information along growing with the distance, which the picture does not show, is but the prior's.
    double along[ALIGN_UNKNOWNS] = {0}, one = 0, two = 0;
    along[3] = a.left_from_thing.translation.x;
    along[4] = a.left_from_thing.translation.y;
    along[5] = a.left_from_thing.translation.z;
    along[6] = 1;
    for (int i = 0; i < ALIGN_UNKNOWNS; i++)
        for (int k = 0; k < ALIGN_UNKNOWNS; k++) {
            one += along[i] * along[k] * a.information[ALIGN_UNKNOWNS * i + k];
            two += along[i] * along[k] * both.information[ALIGN_UNKNOWNS * i + k];
            EXPECT_NEAR(a.information[ALIGN_UNKNOWNS * i + k], a.information[ALIGN_UNKNOWNS * k + i], 0);
        }
    EXPECT_NEAR(one * 0.03 * 0.03, 1, 0.05);
    EXPECT_AT_LEAST(two, 100 * one);
}

static void test_start_at_the_truth_stays(void **state)
{
    (void)state;
    film(THING_FLAT, 1, true_pose());
    const struct align_input in = input_of(THING_FLAT, 2);
    struct alignment a = {.left_from_thing = true_pose()};
    EXPECT_TRUE(thing_align(&in, 30, &a));
    EXPECT_AT_MOST(v3_distance(a.left_from_thing.translation, true_pose().translation), 0.0005);
    const struct pose before = a.left_from_thing;
    EXPECT_TRUE(thing_align(&in, 0, &a)); // no step: only the rest is filled
    EXPECT_NEAR(v3_distance(a.left_from_thing.translation, before.translation), 0, 0);
}

// ------------------------------------------------------------- what a view says

// The correlation of all channels about their own means, by the pixels that a picture of one colour a point shows.
static void test_score_is_a_correlation(void **state)
{
    (void)state;
    film(THING_FLAT, 1, true_pose());
    const struct align_input in = input_of(THING_FLAT, 2);
    struct alignment a = {.left_from_thing = moved(true_pose(), v3(0, 0, 0), v3(0.006, 0, 0))};
    double wanted_ti = 0, wanted_tt = 0, wanted_ii = 0;
    for (int c = 0; c < 3; c++) {
        double t = 0, n = 0, value[SAMPLES], mean = 0;
        for (int i = 0; i < SAMPLES; i++) {
            const struct vec3 p = pose_apply(a.left_from_thing, samples.at[THING_FLAT][i]);
            const struct pose back = pose_inverse(true_pose()); // the picture there, from what was drawn
            const struct vec3 along = quat_rotate(back.rotation, p);
            double x, y;
            const bool hit = cast(THING_FLAT, 1, back.translation, along, &x, &y);
            value[i] = 1.1 * (hit ? print_at(x, y, c) : 90) - 10;
            t += samples.color[i][c];
            mean += value[i];
            n++;
        }
        for (int i = 0; i < SAMPLES; i++) {
            const double dt = samples.color[i][c] - t / n, di = value[i] - mean / n;
            wanted_ti += dt * di;
            wanted_tt += dt * dt;
            wanted_ii += di * di;
        }
    }
    const double wanted = wanted_ti / sqrt(wanted_tt * wanted_ii);
    print_message("score %.4f, wanted %.4f\n", thing_score(&in, 0, &a), wanted);
    EXPECT_NEAR(thing_score(&in, 0, &a), wanted, 0.001); // measured 0.0001 off
    EXPECT_AT_MOST(wanted, 0.95);
}

static void test_half_out_of_the_picture(void **state)
{
    (void)state;
    const struct pose at_the_edge = {{0, 0, 0, 1}, {0.5 * WIDTH / lens.fx * 0.5, 0, 0.5}};
    film(THING_FLAT, 1, at_the_edge);
    const struct align_input in = input_of(THING_FLAT, 1);
    struct alignment a = {.left_from_thing = at_the_edge};
    EXPECT_AT_LEAST(thing_score(&in, 0, &a), 0.99);
    EXPECT_NEAR(a.visible[0], 0.5, 0.03);
}

static void test_tint_of_coloured_light(void **state)
{
    (void)state;
    static uint8_t rgb[WIDTH * HEIGHT * 3];
    draw(THING_FLAT, 1, true_pose(), 1, 0, rgb);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        rgb[3 * i + 2] = (uint8_t)(rgb[3 * i + 2] / 2); // half of the blue is missing
    thing_view_free(&views[0]);
    EXPECT_STATUS(thing_view_make(&lens, &(struct pose){{0, 0, 0, 1}, {0, 0, 0}}, rgb, false, &views[0]), OK);
    const struct align_input in = input_of(THING_FLAT, 1);
    struct alignment a = {.left_from_thing = true_pose()};
    EXPECT_AT_LEAST(thing_score(&in, 0, &a), 0.9);
    EXPECT_NEAR(a.tint[0], 1.8, 0.15); // 2, less what is added to both
}

// ------------------------------------------------------------- nothing in sight

static void expect_not_in_sight(struct alignment a, const struct align_input *in)
{
    EXPECT_TRUE(!thing_align(in, 20, &a));
    EXPECT_NEAR(thing_score(in, 0, &a), -1, 0);
}

static void test_not_in_sight(void **state)
{
    (void)state;
    film(THING_FLAT, 1, true_pose());
    struct align_input in = input_of(THING_FLAT, 2);
    struct pose pose = true_pose();
    pose.translation.z = -0.5;
    expect_not_in_sight((struct alignment){.left_from_thing = pose}, &in);
    pose.translation = v3(3, 0, 0.5);
    expect_not_in_sight((struct alignment){.left_from_thing = pose}, &in);
    pose = moved(true_pose(), v3(0, 3.14159, 0), v3(0, 0, 0)); // its back
    expect_not_in_sight((struct alignment){.left_from_thing = pose}, &in);
    pose.translation.x = NAN;
    expect_not_in_sight((struct alignment){.left_from_thing = pose}, &in);
    in.view_count = 0;
    EXPECT_TRUE(!thing_align(&in, 20, &(struct alignment){.left_from_thing = true_pose()}));
}

static void test_too_few_points(void **state)
{
    (void)state;
    film(THING_FLAT, 1, true_pose());
    const struct align_input in = input_of(THING_FLAT, 2);
    const int counts[] = {0, 1, 23};
    for (size_t i = 0; i < COUNT_OF(counts); i++) {
        samples.count = counts[i];
        expect_not_in_sight((struct alignment){.left_from_thing = true_pose()}, &in);
    }
    samples.count = SAMPLES;
    for (int i = 0; i < SAMPLES; i++)
        samples.facing[THING_FLAT][i] = 0.1F; // the reference picture shows it too obliquely
    expect_not_in_sight((struct alignment){.left_from_thing = true_pose()}, &in);
    make_samples();
}

// A wall of one colour: nothing to go by, and nothing that goes by it is a number less.
static void test_picture_of_one_colour(void **state)
{
    (void)state;
    static uint8_t rgb[WIDTH * HEIGHT * 3];
    memset(rgb, 128, sizeof rgb);
    thing_view_free(&views[0]);
    EXPECT_STATUS(thing_view_make(&lens, &(struct pose){{0, 0, 0, 1}, {0, 0, 0}}, rgb, false, &views[0]), OK);
    const struct align_input in = input_of(THING_FLAT, 1);
    struct alignment a = {.left_from_thing = true_pose()};
    EXPECT_TRUE(thing_align(&in, 20, &a));
    EXPECT_NEAR(a.score[0], -1, 0);
    EXPECT_TRUE(pose_finite(a.left_from_thing));
    EXPECT_AT_MOST(v3_distance(a.left_from_thing.translation, true_pose().translation), 1e-6);
}

int main(void)
{
    print_message("seed %d\n", SEED);
    make_samples();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sheet_by_two_views),
        cmocka_unit_test(test_can_by_two_views),
        cmocka_unit_test(test_one_view_leaves_size_to_the_prior),
        cmocka_unit_test(test_start_at_the_truth_stays),
        cmocka_unit_test(test_score_is_a_correlation),
        cmocka_unit_test(test_half_out_of_the_picture),
        cmocka_unit_test(test_tint_of_coloured_light),
        cmocka_unit_test(test_not_in_sight),
        cmocka_unit_test(test_too_few_points),
        cmocka_unit_test(test_picture_of_one_colour),
    };
    return cmocka_run_group_tests(tests, NULL, free_views);
}
