// Things on a made-up desk: found where they stand with an honest covariance, and what is absent is not found.
#include "tests/support/test.h"

#include "objects/thing_recognition.h"
#include "platform/files/png.h"
#include "tests/bench/plain_matching.h"
#include "tests/support/desk.h"

enum { SEED = 33, PIXELS = 640 * 480 };

static struct desk desk;
static struct recognizer *recognizer;
static uint8_t rgb[2][PIXELS * 3];

static int make(void **state)
{
    (void)state;
    print_message("seed %d\n", SEED);
    return !desk_make(&desk, SEED) || recognizer_open(&recognizer, &desk.things, NULL) != OK;
}

static int tidy(void **state)
{
    (void)state;
    recognizer_close(&recognizer);
    desk_free(&desk);
    return recognizer != NULL;
}

static void film(struct pose world_from_left, struct thing_view views[2])
{
    const struct lens *lenses[2] = {&desk.rig.left, &desk.rig.right};
    const struct pose left_from[2] = {POSE_IDENTITY, desk.rig.left_from_right};
    for (int i = 0; i < 2; i++) {
        const struct pose world_from_camera = pose_multiply(world_from_left, left_from[i]),
                          camera_from_left = pose_inverse(left_from[i]);
        desk_film(&desk, lenses[i], &world_from_camera, 2, SEED + 1 + (uint64_t)i, rgb[i]);
        EXPECT_STATUS(thing_view_make(lenses[i], &camera_from_left, rgb[i], true, &views[i]), OK);
    }
    if (getenv("DESK_PICTURE"))
        EXPECT_STATUS(png_write(getenv("DESK_PICTURE"), PNG_RGB8, rgb[0], 640, 480), OK);
}

static void check(struct pose world_from_left, int wanted)
{
    struct thing_view views[2];
    struct detection found[DESK_THINGS];
    int count, right = 0;
    film(world_from_left, views);
    EXPECT_STATUS(recognizer_find(recognizer, views, 2, found, &count), OK);
    for (int i = 0; i < count; i++) {
        struct sighting s;
        EXPECT_STATUS(recognizer_refine(recognizer, &found[i], NULL, views, 2, &s), OK);
        const int thing = s.thing;
        if (thing >= DESK_THINGS / 2)
            print_error("%s was found\n", desk.storage[thing].name);
        EXPECT_TRUE(thing < DESK_THINGS / 2);
        const struct pose truth = pose_multiply(pose_inverse(world_from_left), desk.world_from_thing[thing]);
        const struct vec3 error = v3_sub(s.left_from_thing.translation, truth.translation);
        const struct vec3 up = quat_rotate(truth.rotation, v3(0, -1, 0));
        const double far = truth.translation.z, turn = fabs(s.angle - atan2(up.x, -up.y)) * 57.3;
        print_message("%s at %.2f m: %.2f %.2f %.2f mm, %.2f degrees, score %.3f\n", desk.storage[thing].name, far,
                      1e3 * error.x, 1e3 * error.y, 1e3 * error.z, turn, s.score);
        EXPECT_INT(s.shape, desk.turned[thing] ? THING_TURNED : THING_FLAT);
        EXPECT_AT_MOST(v3_length(error), far < 0.6 ? 0.003 : 0.008);
        EXPECT_AT_MOST(turn, 2);
        EXPECT_AT_LEAST(covariance3_along(&s.covariance, v3(0, 0, 1)), 1e-9);
        right++;
    }
    EXPECT_INT(right, wanted);
    thing_view_free(&views[0]);
    thing_view_free(&views[1]);
}

static void test_things_are_found_where_they_stand(void **state)
{
    (void)state;
    check((struct pose){{0, 0, 0, 1}, {0.05, 0, -0.15}}, 4);
}

static void test_from_aside_and_turned(void **state)
{
    (void)state;
    const struct quat turned =
        quat_multiply(quat_from_rotation_vector(v3(0, -0.15, 0)), quat_from_rotation_vector(v3(0, 0, 0.2)));
    check((struct pose){turned, {0.2, -0.02, -0.2}}, 4);
}

// One camera alone knows the distance from the thing's size, which its picture tells to about half a percent.
static void test_one_camera_tells_the_distance_by_size(void **state)
{
    (void)state;
    struct thing_view views[2];
    struct detection found[DESK_THINGS];
    const struct pose here = {{0, 0, 0, 1}, {0.05, 0, -0.15}};
    int count;
    film(here, views);
    EXPECT_STATUS(recognizer_find(recognizer, views, 1, found, &count), OK);
    EXPECT_AT_LEAST(count, 3);
    for (int i = 0; i < count; i++) {
        struct sighting s;
        EXPECT_STATUS(recognizer_refine(recognizer, &found[i], NULL, views, 1, &s), OK);
        EXPECT_TRUE(s.thing < DESK_THINGS / 2);
        const struct vec3 truth = pose_apply(pose_inverse(here), desk.world_from_thing[s.thing].translation);
        const struct vec3 error = v3_sub(s.left_from_thing.translation, truth);
        const double along = v3_dot(error, v3_unit(truth)),
                     sigma = sqrt(covariance3_along(&s.covariance, v3_unit(truth)));
        print_message("%s: %.2f mm along the line of sight, standard deviation %.2f mm\n", desk.storage[s.thing].name,
                      1e3 * along, 1e3 * sigma);
        EXPECT_AT_MOST(fabs(along), 0.025 * truth.z);
        EXPECT_AT_MOST(fabs(along), 4 * sigma);
        EXPECT_AT_LEAST(sigma, 0.002 * truth.z); // it says that it does not know
        EXPECT_AT_MOST(v3_length(v3_sub(error, v3_scale(v3_unit(truth), along))), 0.003);
    }
    thing_view_free(&views[0]);
    thing_view_free(&views[1]);
}

// Nothing but wall.
static void test_nothing_is_found_where_nothing_stands(void **state)
{
    (void)state;
    check((struct pose){{0, 0, 0, 1}, {0, 0, 1.2}}, 0);
}

static void test_counting_by_vectors_equals_counting(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    uint8_t a[5000], b[5000];
    for (int i = 0; i < 5000; i++) {
        a[i] = rng_uniform(&rng) < 0.9;
        b[i] = rng_uniform(&rng) < 0.9;
    }
    for (int n = 0; n < 5000; n += 61)
        EXPECT_INT(plain_count_both(a + n % 7, b + n % 5, n - 7 > 0 ? n - 7 : 0),
                   plain_count_both_scalar(a + n % 7, b + n % 5, n - 7 > 0 ? n - 7 : 0));
}

// The paper's own conditions: upright before the camera, at a known size.
static void test_plain_matching_finds_what_is_upright(void **state)
{
    (void)state;
    struct thing_view views[2];
    static uint8_t image[PIXELS], picture[1000 * 1000];
    const struct thing *t = &desk.storage[1];
    const struct pose here = {{0, 0, 0, 1}, {0.05, 0, -0.15}};
    struct plain_options options = plain_default_options();
    struct plain_match m;
    film(here, views);
    image_gray(rgb[0], PIXELS, image);
    image_gray(t->picture.rgb, (size_t)t->picture.width * (size_t)t->picture.height, picture);
    const struct vec3 at = pose_apply(pose_inverse(here), desk.world_from_thing[1].translation);
    const double scale = 640 / at.z / (1500 / 0.9);
    options.least_scale = 0.9 * scale;
    options.most_scale = 1.15 * scale;
    options.scale_step = 1.1;
    EXPECT_STATUS(plain_match_find(&(struct gray_picture){picture, t->picture.width, t->picture.height},
                                   &(struct gray_picture){image, 640, 480}, &options, &m),
                  OK);
    const struct pixel truth = lens_project(&desk.rig.left, at);
    EXPECT_NEAR(m.middle.x, truth.x, 12);
    EXPECT_NEAR(m.middle.y, truth.y, 12);
    thing_view_free(&views[0]);
    thing_view_free(&views[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_things_are_found_where_they_stand),
        cmocka_unit_test(test_from_aside_and_turned),
        cmocka_unit_test(test_one_camera_tells_the_distance_by_size),
        cmocka_unit_test(test_nothing_is_found_where_nothing_stands),
        cmocka_unit_test(test_counting_by_vectors_equals_counting),
        cmocka_unit_test(test_plain_matching_finds_what_is_upright),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
