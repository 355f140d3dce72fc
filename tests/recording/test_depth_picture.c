// Takes of sensors without colour: the picture of a depth image on surfaces whose slopes are known, and what a take
// that is opened to be looked at says of itself.
#include "recording/depth_picture.h"
#include "tests/support/random.h"
#include "tests/support/recording_sample.h"

enum { W = 160, H = 120, PIXELS = W * H, BRIGHTEST = 226, DARKEST = 68 };

static const struct lens lens = {.width = W, .height = H, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
static const struct vec3 lamp = {-0.35, -0.6, -0.72}; // depth_picture.c's

static uint16_t depth[PIXELS];
static uint8_t mask[PIXELS], rgb[3 * PIXELS];

static struct vec3 ray(int x, int y) { return v3((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1); }

// What the picture's red should be where the surface has that normal, which need not be of length 1.
static double shade(struct vec3 normal)
{
    const double cosine = v3_dot(normal, lamp) / (v3_length(normal) * v3_length(lamp));
    return BRIGHTEST * (0.3 + 0.7 * fmax(0, cosine));
}

// A plane through (0, 0, z) that faces the camera, all of it the person. noise_m: of the depth, at a metre.
static void make_plane(struct vec3 normal, double z, double noise_m, struct rng *rng)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const double there = normal.z * z / v3_dot(normal, ray(x, y));
            depth[y * W + x] = (uint16_t)lround(1000 * (there + noise_m * there * there * rng_normal(rng)));
            mask[y * W + x] = 1;
        }
}

static void test_planes_have_the_light_of_their_slope(void **state)
{
    (void)state;
    static const struct vec3 normals[] = {{0, 0, -1}, {-0.5, 0, -1}, {0, -0.7, -1}, {0.5, 0.4, -1}, {-0.3, 0.8, -1}};
    struct rng rng = {SAMPLE_SEED};
    for (size_t i = 0; i < COUNT_OF(normals); i++)
        for (int noisy = 0; noisy < 2; noisy++) {
            make_plane(normals[i], 2, noisy ? 0.0015 : 0, &rng);
            depth_picture_draw(&lens, depth, mask, rgb);
            double sum = 0, squares = 0;
            for (int k = 0; k < PIXELS; k++) {
                sum += rgb[3 * k];
                squares += pow(rgb[3 * k] - shade(normals[i]), 2);
            }
            print_message("%g %g: %.1f on average, wanted %.1f, off by %.1f\n", normals[i].x, normals[i].y,
                          sum / PIXELS, shade(normals[i]), sqrt(squares / PIXELS));
            EXPECT_NEAR(sum / PIXELS, shade(normals[i]), noisy ? 4 : 1);
            EXPECT_AT_MOST(sqrt(squares / PIXELS), noisy ? 8 : 2);
        }
}

// A Kinect's depth at 4.2 m has steps of 5 cm: no pixel stands out because it is a step nearer than its neighbours.
static void test_steps_of_depth_are_no_edges(void **state)
{
    (void)state;
    const struct lens kinect = {.width = W, .height = H, .fx = 525, .fy = 525, .cx = 79.5, .cy = 59.5};
    const struct vec3 normal = {0.2, -0.3, -1};
    struct rng rng = {SAMPLE_SEED};
    for (int k = 0; k < PIXELS; k++) {
        const struct vec3 to = v3((k % W - kinect.cx) / kinect.fx, ((double)(k / W) - kinect.cy) / kinect.fy, 1);
        const double steps = 8 * 575 * 0.075 / (normal.z * 4.2 / v3_dot(normal, to)); // eighths of a pixel of disparity
        depth[k] = (uint16_t)lround(1000 * 8 * 575 * 0.075 / round(steps + 0.6 * rng_normal(&rng)));
        mask[k] = 1;
    }
    depth_picture_draw(&kinect, depth, mask, rgb);
    double squares = 0;
    int specks = 0;
    for (int k = 0; k < PIXELS; k++) {
        const int x = k % W, y = k / W;
        squares += pow(rgb[3 * k] - shade(normal), 2);
        if (x >= 2 && y >= 2 && x < W - 2 && y < H - 2)
            specks += abs(4 * rgb[3 * k] - rgb[3 * (k - 2)] - rgb[3 * (k + 2)] - rgb[3 * (k - 2 * W)] -
                          rgb[3 * (k + 2 * W)]) > 4 * 20;
    }
    print_message("off by %.1f, %d specks of %d pixels\n", sqrt(squares / PIXELS), specks, PIXELS);
    EXPECT_AT_MOST(sqrt(squares / PIXELS), 25);
    EXPECT_AT_MOST(specks, PIXELS / 100); // where steps count as edges, six times as many as it is
}

// The person's arm before the trunk: each has its own light up to the edge.
static void test_no_light_across_edges(void **state)
{
    (void)state;
    const struct vec3 facing = {0, 0, -1};
    for (int k = 0; k < PIXELS; k++) {
        depth[k] = k % W < W / 2 ? 1500 : 1700;
        mask[k] = 1;
    }
    depth_picture_draw(&lens, depth, mask, rgb);
    for (int k = 0; k < PIXELS; k++)
        EXPECT_NEAR(rgb[3 * k], shade(facing), 1);
}

static void test_what_is_no_person_is_grey(void **state)
{
    (void)state;
    memset(mask, 0, sizeof mask);
    for (int k = 0; k < PIXELS; k++)
        depth[k] = (uint16_t)(k % W ? 400 * (k % W) : 0);
    depth_picture_draw(&lens, depth, mask, rgb);
    for (int k = 0; k < PIXELS; k++) {
        EXPECT_TRUE(rgb[3 * k] == rgb[3 * k + 1] && rgb[3 * k] == rgb[3 * k + 2]);
        if (k % W > 1)
            EXPECT_TRUE(rgb[3 * k] <= rgb[3 * k - 3] && rgb[3 * k] > rgb[3 * (k - k % W)]);
    }
    memset(mask, 1, sizeof mask); // as a damaged mask may say of holes
    memset(depth, 0, sizeof depth);
    depth_picture_draw(&lens, depth, mask, rgb);
    const uint8_t hole = rgb[0];
    depth_picture_draw(&lens, depth, NULL, rgb);
    EXPECT_INT(rgb[0], hole);
}

// No slope can be told, and none is made up: every value is one of a surface's.
static void test_hard_images(void **state)
{
    (void)state;
    struct rng rng = {SAMPLE_SEED};
    const struct lens one = {.width = 1, .height = 1, .fx = 1, .fy = 1},
                      row = {.width = W, .height = 1, .fx = 1e6, .fy = 1};
    static const uint16_t values[] = {1, 2, 65535, 65534, 0};
    for (int k = 0; k < PIXELS; k++) {
        depth[k] = values[rng_pick(&rng, COUNT_OF(values))];
        mask[k] = (uint8_t)rng_pick(&rng, 2);
    }
    depth_picture_draw(&one, depth, mask, rgb);
    depth_picture_draw(&row, depth, mask, rgb);
    depth_picture_draw(&lens, depth, mask, rgb);
    for (int k = 0; k < PIXELS; k++)
        if (mask[k] && depth[k])
            EXPECT_TRUE(rgb[3 * k] >= DARKEST - 1 && rgb[3 * k] <= BRIGHTEST);
}

// ------------------------------------------------------------- takes

enum color { COLOR, NO_COLOR_CAMERA, NO_COLOR_IMAGES };

static const char *record(enum color color)
{
    static struct sample_frame m;
    static const char *const names[] = {"with-color", "without-camera", "without-images"};
    struct calibration calibration = sample_calibration();
    if (color == NO_COLOR_CAMERA)
        calibration.color = (struct lens){0};
    if (color != COLOR)
        calibration.color_from_depth = POSE_IDENTITY;
    calibration.registered = color == NO_COLOR_IMAGES;
    const char *path = sample_path(names[color]);
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    for (int i = 0; i < 3; i++) {
        sample_frame_make(&m, 7 * i);
        m.frame.jpeg = color == COLOR ? m.jpeg : NULL;
        m.frame.depth = i == 2 ? NULL : m.depth;
        m.frame.mask = i == 1 ? NULL : m.frame.mask;
        EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
        free(m.jpeg);
    }
    EXPECT_STATUS(recording_close(&w), OK);
    return path;
}

static void expect_drawn(enum color color)
{
    static uint8_t wanted[3 * WIDTH * HEIGHT];
    struct recording *r, *again;
    struct take *take, *shared, *plain;
    struct take_images images, plain_images;
    const uint8_t *jpeg;
    size_t bytes;
    const char *path = record(color);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_open(&again, path), OK);
    EXPECT_STATUS(take_open_drawn(&take, r, "a"), OK);
    EXPECT_STATUS(take_open(&plain, r, "a"), OK);
    EXPECT_STATUS(take_open_shared(&shared, again, take), OK);
    EXPECT_TRUE(take_is_drawn_from_depth(shared) && !take_is_drawn_from_depth(plain));
    EXPECT_INT(take_calibration(plain)->color.width, color == NO_COLOR_CAMERA ? 0 : COLOR_WIDTH);
    EXPECT_TRUE(!take_entry(plain, 0)->has_color);
    EXPECT_TRUE(lens_equal(&take_calibration(take)->color, &take_calibration(plain)->depth));
    EXPECT_TRUE(take_calibration(take)->registered);
    for (int i = 0; i < 2; i++) {
        EXPECT_TRUE(take_entry(take, i)->has_color);
        EXPECT_STATUS(take_read(plain, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &plain_images), OK);
        EXPECT_TRUE(!plain_images.color && plain_images.depth && !plain_images.mask == (i == 1));
        depth_picture_draw(&take_calibration(plain)->depth, plain_images.depth, plain_images.mask, wanted);
        EXPECT_STATUS(take_read(shared, i, TAKE_COLOR, &images), OK);
        EXPECT_TRUE(images.color && !images.depth && !images.mask);
        EXPECT_TRUE(!memcmp(images.color, wanted, sizeof wanted));
        EXPECT_STATUS(take_read_jpeg(take, i, &jpeg, &bytes), NOTHING);
    }
    EXPECT_TRUE(!take_entry(take, 2)->has_color); // a frame without depth
    EXPECT_STATUS(take_read(take, 2, TAKE_COLOR, &images), OK);
    EXPECT_TRUE(!images.color);
    take_close(&shared);
    take_close(&plain);
    take_close(&take);
    recording_free(&again);
    recording_free(&r);
}

static void test_take_without_color_is_drawn(void **state)
{
    (void)state;
    expect_drawn(NO_COLOR_CAMERA);
    expect_drawn(NO_COLOR_IMAGES);
}

static void test_take_with_color_keeps_it(void **state)
{
    (void)state;
    struct recording *r;
    struct take *take;
    const uint8_t *jpeg;
    size_t bytes;
    EXPECT_STATUS(recording_open(&r, record(COLOR)), OK);
    EXPECT_STATUS(take_open_drawn(&take, r, "a"), OK);
    EXPECT_TRUE(!take_is_drawn_from_depth(take));
    EXPECT_INT(take_calibration(take)->color.width, COLOR_WIDTH);
    EXPECT_STATUS(take_read_jpeg(take, 0, &jpeg, &bytes), OK);
    take_close(&take);
    EXPECT_STATUS(take_open_drawn(&take, r, "b"), ERR_MISSING);
    EXPECT_TRUE(!take);
    recording_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_planes_have_the_light_of_their_slope),
        cmocka_unit_test(test_steps_of_depth_are_no_edges),
        cmocka_unit_test(test_no_light_across_edges),
        cmocka_unit_test(test_what_is_no_person_is_grey),
        cmocka_unit_test(test_hard_images),
        cmocka_unit_test(test_take_without_color_is_drawn),
        cmocka_unit_test(test_take_with_color_keeps_it),
    };
    print_message("seed %d\n", SAMPLE_SEED);
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
