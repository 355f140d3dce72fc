// The body networks as neural/network.h runs them, against the same graphs by OpenCV's layers: every output, of
// images with a person, without one, of noise and of nothing. Skipped where the networks are not there (tools/models
// fetches them).
#include "tests/support/test.h"

#include "neural/network.h"
#include "platform/files/file.h"
#include "tests/neural/network_by_opencv.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <unistd.h>

enum { SEED = 91, FILE_NAME_MOST = 4096 };

enum input { INPUT_PERSON, INPUT_ROOM, INPUT_NOISE, INPUT_ZEROS, INPUTS };
static const char *const input_names[INPUTS] = {"person", "room", "noise", "zeros"};

// The engines take the same sums in another order, in single precision, and may differ by this: pixels of the network's
// image where the output is a place, elsewhere an argument of the logistic function.
static const double MOST = 0.01;
// The person's outline, which neural/pose_network.c does not want, hangs on every bit of the input: 2e-7 of each
// value change it by 4e-4 of its largest value, and the engines differed by up to 4e-3 of that (of zeros). By this
// share:
static const double MAX_SHARE = 1e-2;
enum { NO_OUTLINE = -1, OUTLINE = 2 };

static struct world *world;

static int open_world(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.motion = "kata";
    EXPECT_STATUS(world_open(&world, &options), OK);
    return 0;
}

static int close_world(void **state)
{
    (void)state;
    world_close(&world);
    return 0;
}

static void render(bool figure, int side, float low, float high, float *to)
{
    const size_t count = 3 * (size_t)side * (size_t)side;
    const struct lens lens = {
        .width = side, .height = side, .fx = side, .fy = side, .cx = (side - 1) / 2.0, .cy = (side - 1) / 2.0};
    const struct world_shot shot = {lens, world_sensor_pose(world), 0.7, figure};
    uint8_t *rgb = malloc(count);
    assert_non_null(rgb);
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = rgb}), OK);
    for (size_t i = 0; i < count; i++)
        to[i] = low + (high - low) * (float)rgb[i] / 255;
    free(rgb);
}

static void fill(enum input input, int side, float low, float *to)
{
    struct rng rng = {SEED};
    switch (input) {
    case INPUT_PERSON:
    case INPUT_ROOM: render(input == INPUT_PERSON, side, low, 1, to); break;
    case INPUT_NOISE:
        for (int i = 0; i < 3 * side * side; i++)
            to[i] = (float)rng_between(&rng, (double)low, 1);
        break;
    case INPUT_ZEROS:
    case INPUTS: memset(to, 0, 3 * sizeof *to * (size_t)side * (size_t)side);
    }
}

static void compare(const char *name, bool is_outline, const float *ours, const float *theirs, size_t count)
{
    double worst = 0, largest = 0;
    for (size_t i = 0; i < count; i++) {
        const double a = (double)ours[i], b = (double)theirs[i];
        assert_true(isfinite(a) && isfinite(b));
        worst = fmax(worst, fabs(a - b));
        largest = fmax(largest, fabs(b));
    }
    print_message("%s: %zu values up to %.4g, off by at most %.2g\n", name, count, largest, worst);
    EXPECT_AT_MOST(worst, is_outline ? MAX_SHARE * largest : MOST);
}

// False: it is not there.
static bool read_model(const char *name, struct tflite_model *out)
{
    char path[FILE_NAME_MOST];
    const char *data = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
    const bool own = data && *data;
    snprintf(path, sizeof path, "%s%s/reenact/models/%s",
             own    ? data
             : home ? home
                    : "",
             own ? "" : "/.local/share", name);
    if (access(path, R_OK)) {
        print_message("skipped: %s is not there; tools/models fetches it\n", path);
        return false;
    }
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    EXPECT_STATUS(tflite_read(out, path, bytes, count), OK);
    free(bytes);
    return true;
}

// side: of the network's image, pixels; its values go from low to 1.
static void check_network(const char *name, int side, float low, int outline)
{
    struct tflite_model model;
    struct network_by_opencv *theirs;
    struct network *ours;
    if (!read_model(name, &model))
        skip_without("the networks (reenact-capture models --fetch)");
    const int outputs = model.output_count;
    EXPECT_STATUS(network_by_opencv_open(&theirs, &model), OK);
    EXPECT_STATUS(network_open(&ours, name, &model, (1u << outputs) - 1), OK);
    size_t count, count_of_theirs;
    float *input = network_input(ours, &count);
    EXPECT_INT(count, 3 * (size_t)side * (size_t)side);
    for (enum input k = 0; k < INPUTS; k++) {
        fill(k, side, low, input);
        network_run(ours);
        EXPECT_STATUS(network_by_opencv_run(theirs, input), OK);
        for (int i = 0; i < outputs; i++) {
            const float *a = network_output(ours, i, &count);
            const float *b = network_by_opencv_output(theirs, i, &count_of_theirs);
            EXPECT_INT(count, count_of_theirs);
            char label[64];
            snprintf(label, sizeof label, "%s, output %d", input_names[k], i);
            compare(label, i == outline, a, b, count);
        }
    }
    network_by_opencv_close(&theirs);
    network_close(&ours);
}

static void test_detector(void **state)
{
    (void)state;
    check_network("pose_detection.tflite", 224, -1, NO_OUTLINE);
}

static void test_lite_points(void **state)
{
    (void)state;
    check_network("pose_landmark_lite.tflite", 256, 0, OUTLINE);
}

static void test_full_points(void **state)
{
    (void)state;
    check_network("pose_landmark_full.tflite", 256, 0, OUTLINE);
}

int main(void)
{
    print_message("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_detector),
        cmocka_unit_test(test_lite_points),
        cmocka_unit_test(test_full_points),
    };
    return cmocka_run_group_tests(tests, open_world, close_world);
}
