// Each operator of a network against sums written down once more, in double; and the same bits on every machine.
#include "tests/support/test.h"

#include "neural/network.h"
#include "tests/support/tflite_file.h"

enum { SEED = 57, MOST = 20000 };

struct shape {
    int height, width, channels;
};

static int count_of(struct shape s) { return s.height * s.width * s.channels; }

static struct tflite_file_tensor image_of(struct shape s)
{
    return (struct tflite_file_tensor){.dimensions = 4, .size = {1, s.height, s.width, s.channels}};
}

static void fill(struct rng *rng, float *values, int count, double most)
{
    assert_true(count <= MOST);
    for (int i = 0; i < count; i++)
        values[i] = (float)rng_between(rng, -most, most);
}

// Runs the file's one operator on `in`; the output's values, which belong to *n.
static const float *run(const struct tflite_file *file, const float *in, struct network **n, size_t wanted)
{
    static uint8_t bytes[TFLITE_FILE_MOST];
    struct tflite_model model;
    size_t count;
    EXPECT_STATUS(tflite_read(&model, "test", bytes, tflite_file_write(file, bytes)), OK);
    EXPECT_STATUS(network_open(n, "test", &model, 1), OK);
    float *input = network_input(*n, &count);
    memcpy(input, in, sizeof *in * count);
    network_run(*n);
    const float *out = network_output(*n, 0, &count);
    EXPECT_INT(count, wanted);
    return out;
}

static double at(const float *values, struct shape s, int y, int x, int c)
{
    return y < 0 || x < 0 || y >= s.height || x >= s.width ? 0 : (double)values[(y * s.width + x) * s.channels + c];
}

static double activated(double x, enum tflite_activation a)
{
    return a == TFLITE_RELU6 ? fmin(fmax(x, 0), 6) : a == TFLITE_RELU ? fmax(x, 0) : x;
}

// TensorFlow's "same": as many outputs as strides fit, what is missing is split, the larger half after.
static int pad_of(int in, int out, int filter, int stride)
{
    const int missing = (out - 1) * stride + filter - in;
    return missing > 0 ? missing / 2 : 0;
}

struct convolution {
    struct shape in;
    int channels, filter, stride;
    bool depthwise, valid;
    enum tflite_activation activation;
};

static void check_convolution(const struct convolution *c, struct rng *rng)
{
    static float in[MOST], weights[MOST], bias[MOST];
    const int out_channels = c->depthwise ? c->in.channels : c->channels;
    const struct shape out = {
        c->valid ? (c->in.height - c->filter) / c->stride + 1 : (c->in.height + c->stride - 1) / c->stride,
        c->valid ? (c->in.width - c->filter) / c->stride + 1 : (c->in.width + c->stride - 1) / c->stride, out_channels};
    const int taps = c->filter * c->filter, weight_count = taps * c->in.channels * (c->depthwise ? 1 : c->channels);
    fill(rng, in, count_of(c->in), 2);
    fill(rng, weights, weight_count, 1);
    fill(rng, bias, out_channels, 3);
    struct tflite_file file = {
        .tensor =
            {image_of(c->in),
             {.dimensions = 4,
              .size = {c->depthwise ? 1 : c->channels, c->filter, c->filter, c->in.channels},
              .data = weights,
              .bytes = sizeof *weights * (size_t)weight_count},
             {.dimensions = 1, .size = {out_channels}, .data = bias, .bytes = sizeof *bias * (size_t)out_channels},
             image_of(out)},
        .tensor_count = 4,
        .op = {{.kind = c->depthwise ? TFLITE_DEPTHWISE_CONV_2D : TFLITE_CONV_2D,
                .inputs = {0, 1, 2},
                .input_count = 3,
                .output = 3,
                .option = {{1, c->valid}, {4, c->stride}, {4, c->stride}}}},
        .op_count = 1,
        .input = 0,
        .output = 3,
    };
    const int activation_field = c->depthwise ? 4 : 3;
    file.op[0].option[activation_field].width = 1;
    file.op[0].option[activation_field].value = (int)c->activation;
    struct network *n;
    const float *values = run(&file, in, &n, (size_t)count_of(out));
    const int pad_y = c->valid ? 0 : pad_of(c->in.height, out.height, c->filter, c->stride);
    const int pad_x = c->valid ? 0 : pad_of(c->in.width, out.width, c->filter, c->stride);
    double worst = 0;
    for (int i = 0; i < count_of(out); i++) {
        const int k = i % out_channels, x = i / out_channels % out.width, y = i / out_channels / out.width;
        double sum = (double)bias[k];
        for (int t = 0; t < taps; t++)
            for (int m = 0; m < c->in.channels; m++) {
                const int v = y * c->stride - pad_y + t / c->filter, u = x * c->stride - pad_x + t % c->filter;
                if (c->depthwise && m != k)
                    continue;
                const int w = c->depthwise ? t * c->in.channels + k : (k * taps + t) * c->in.channels + m;
                sum += at(in, c->in, v, u, m) * (double)weights[w];
            }
        worst = fmax(worst, fabs((double)values[i] - activated(sum, c->activation)));
    }
    print_message("%d x %d x %d -> %d, filter %d, stride %d%s%s: off by at most %.2g\n", c->in.height, c->in.width,
                  c->in.channels, out_channels, c->filter, c->stride, c->depthwise ? ", depthwise" : "",
                  c->valid ? ", valid" : "", worst);
    EXPECT_AT_MOST(worst, 3e-5);
    network_close(&n);
}

// Channels and pixels that fill no whole block or vector, too.
static void test_convolutions(void **state)
{
    (void)state;
    static const struct convolution all[] = {
        {{7, 9, 3}, 5, 3, 1, false, false, TFLITE_RELU6},   {{8, 8, 16}, 16, 1, 1, false, false, TFLITE_NO_ACTIVATION},
        {{9, 7, 37}, 41, 1, 1, false, false, TFLITE_RELU},  {{10, 11, 4}, 17, 3, 2, false, false, TFLITE_RELU6},
        {{9, 9, 5}, 3, 2, 2, false, true, TFLITE_RELU},     {{3, 3, 8}, 32, 3, 1, false, true, TFLITE_NO_ACTIVATION},
        {{9, 8, 1}, 1, 3, 1, true, false, TFLITE_RELU6},    {{9, 8, 37}, 0, 5, 2, true, false, TFLITE_RELU},
        {{12, 7, 64}, 0, 3, 2, true, true, TFLITE_RELU6},   {{6, 6, 72}, 0, 5, 1, true, false, TFLITE_NO_ACTIVATION},
        {{1, 1, 16}, 20, 1, 1, false, false, TFLITE_RELU6}, {{2, 2, 8}, 0, 5, 1, true, false, TFLITE_RELU},
    };
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    for (size_t i = 0; i < COUNT_OF(all); i++)
        check_convolution(&all[i], &rng);
}

// One operator from image to image, with at most a constant second input.
struct simple {
    int kind; // enum tflite_kind
    struct shape from, to;
    int option[6][2]; // width in bytes, value; see struct tflite_file_operator
    const int32_t *amounts;
    int amount_count;
};

static const float *run_simple(const struct simple *s, const float *in, struct network **n)
{
    struct tflite_file file = {
        .tensor = {image_of(s->from),
                   image_of(s->to),
                   {.dimensions = 2,
                    .size = {s->amount_count > 1 ? s->amount_count / 2 : 1, 2},
                    .type = FILE_INT32,
                    .data = s->amounts,
                    .bytes = sizeof *s->amounts * (size_t)s->amount_count}},
        .tensor_count = 3,
        .op = {{.kind = s->kind, .inputs = {0, 2}, .input_count = s->amounts ? 2 : 1, .output = 1}},
        .op_count = 1,
        .input = 0,
        .output = 1,
    };
    for (size_t i = 0; i < COUNT_OF(s->option); i++) {
        file.op[0].option[i].width = s->option[i][0];
        file.op[0].option[i].value = s->option[i][1];
    }
    return run(&file, in, n, (size_t)count_of(s->to));
}

static void test_pad(void **state)
{
    (void)state;
    static float in[MOST];
    static const int32_t amounts[8] = {0, 0, 1, 2, 3, 0, 0, 1};
    const struct shape from = {3, 4, 2}, to = {6, 7, 3};
    const struct simple pad = {TFLITE_PAD, from, to, {{0}}, amounts, 8};
    struct rng rng = {SEED + 1};
    struct network *n;
    fill(&rng, in, count_of(from), 1);
    const float *out = run_simple(&pad, in, &n);
    for (int i = 0; i < count_of(to); i++) {
        const int c = i % 3, x = i / 3 % 7 - 3, y = i / 21 - 1;
        EXPECT_NEAR((double)out[i], c < 2 ? at(in, from, y, x, c) : 0, 0);
    }
    network_close(&n);
}

static void test_max_pool(void **state)
{
    (void)state;
    static float in[MOST];
    const struct shape from = {5, 7, 3}, to = {2, 3, 3};
    const struct simple pool = {
        TFLITE_MAX_POOL_2D, from, to, {{1, 1}, {4, 2}, {4, 2}, {4, 2}, {4, 2}, {1, 0}}, NULL, 0};
    struct rng rng = {SEED + 2};
    struct network *n;
    fill(&rng, in, count_of(from), 1);
    const float *out = run_simple(&pool, in, &n);
    for (int i = 0; i < count_of(to); i++) {
        const int c = i % 3, x = i / 3 % 3 * 2, y = i / 9 * 2;
        const double most = fmax(fmax(at(in, from, y, x, c), at(in, from, y, x + 1, c)),
                                 fmax(at(in, from, y + 1, x, c), at(in, from, y + 1, x + 1, c)));
        EXPECT_NEAR((double)out[i], most, 0);
    }
    network_close(&n);
}

// A ramp stays a ramp where pixels' centres keep their places, and is clamped at the border.
static void test_resize(void **state)
{
    (void)state;
    static float in[MOST];
    const struct shape from = {4, 5, 2}, to = {8, 10, 2};
    static const int32_t size[2] = {8, 10};
    const struct simple resize = {TFLITE_RESIZE_BILINEAR, from, to, {{0, 0}, {0, 0}, {1, 0}, {1, 1}}, size, 2};
    struct network *n;
    for (int i = 0; i < count_of(from); i++)
        in[i] = (float)(i % 2 ? i / 2 % 5 : 10 * (i / 10));
    const float *out = run_simple(&resize, in, &n);
    for (int i = 0; i < count_of(to); i++) {
        const double x = fmin(fmax((i / 2 % 10 + 0.5) / 2 - 0.5, 0), 4), y = fmin(fmax((i / 20 + 0.5) / 2 - 0.5, 0), 3);
        EXPECT_NEAR((double)out[i], i % 2 ? x : 10 * y, 1e-5);
    }
    network_close(&n);
}

static void test_depth_to_space(void **state)
{
    (void)state;
    static float in[MOST];
    const struct shape from = {2, 3, 8}, to = {4, 6, 2};
    const struct simple depth_to_space = {TFLITE_DEPTH_TO_SPACE, from, to, {{4, 2}}, NULL, 0};
    struct network *n;
    for (int i = 0; i < count_of(from); i++)
        in[i] = (float)i;
    const float *out = run_simple(&depth_to_space, in, &n);
    for (int i = 0; i < count_of(to); i++) {
        const int c = i % 2, x = i / 2 % 6, y = i / 12;
        EXPECT_NEAR((double)out[i], at(in, from, y / 2, x / 2, (y % 2 * 2 + x % 2) * 2 + c), 0);
    }
    network_close(&n);
}

static void test_logistic(void **state)
{
    (void)state;
    static float in[MOST];
    const struct simple logistic = {TFLITE_LOGISTIC, {1, 5, 1}, {1, 5, 1}, {{0}}, NULL, 0};
    static const float values[5] = {-200, -1, 0, 1, 200};
    struct network *n;
    memcpy(in, values, sizeof values);
    const float *out = run_simple(&logistic, in, &n);
    for (int i = 0; i < 5; i++)
        EXPECT_NEAR((double)out[i], 1 / (1 + exp(-(double)values[i])), 1e-7);
    network_close(&n);
}

// A network whose shapes do not fit together would read or write outside them.
static void test_shapes_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    static uint8_t bytes[TFLITE_FILE_MOST];
    static float weights[MOST];
    const struct shape right = {6, 6, 4};
    const struct shape wrong[] = {{6, 7, 4}, {5, 6, 4}, {6, 6, 5}, {12, 12, 4}};
    for (size_t i = 0; i <= COUNT_OF(wrong); i++) {
        struct tflite_file file = {
            .tensor = {image_of(right),
                       {.dimensions = 4, .size = {4, 3, 3, 4}, .data = weights, .bytes = 4 * 144},
                       {.dimensions = 1, .size = {4}, .data = weights, .bytes = 16},
                       image_of(i ? wrong[i - 1] : right)},
            .tensor_count = 4,
            .op = {{.kind = TFLITE_CONV_2D,
                    .inputs = {0, 1, 2},
                    .input_count = 3,
                    .output = 3,
                    .option = {{1, 0}, {4, 1}, {4, 1}}}},
            .op_count = 1,
            .input = 0,
            .output = 3,
        };
        struct tflite_model model;
        struct network *n;
        EXPECT_STATUS(tflite_read(&model, "test", bytes, tflite_file_write(&file, bytes)), OK);
        EXPECT_STATUS(network_open(&n, "test", &model, 1), i ? ERR_FORMAT : OK);
        EXPECT_TRUE(i ? !n : !!n);
        network_close(&n);
        file.op[0].inputs[0] = 3; // what it makes itself
        EXPECT_STATUS(tflite_read(&model, "test", bytes, tflite_file_write(&file, bytes)), OK);
        EXPECT_STATUS(network_open(&n, "test", &model, 1), ERR_FORMAT);
    }
}

// FNV-1a over a convolution's output: the sum was made on x86-64 with AVX2 and holds on 64-bit ARM.
static void test_bits_are_the_same_everywhere(void **state)
{
    (void)state;
    static float in[MOST], weights[MOST], bias[64];
    const struct shape from = {16, 16, 24}, to = {16, 16, 40};
    struct rng rng = {SEED + 3};
    fill(&rng, in, count_of(from), 1);
    fill(&rng, weights, 9 * 24 * 40, 1);
    fill(&rng, bias, 40, 1);
    const struct tflite_file file = {
        .tensor = {image_of(from),
                   {.dimensions = 4, .size = {40, 3, 3, 24}, .data = weights, .bytes = 4 * 9 * 24 * 40},
                   {.dimensions = 1, .size = {40}, .data = bias, .bytes = 160},
                   image_of(to)},
        .tensor_count = 4,
        .op = {{.kind = TFLITE_CONV_2D,
                .inputs = {0, 1, 2},
                .input_count = 3,
                .output = 3,
                .option = {{1, 0}, {4, 1}, {4, 1}}}},
        .op_count = 1,
        .input = 0,
        .output = 3,
    };
    struct network *n;
    const float *out = run(&file, in, &n, (size_t)count_of(to));
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (int i = 0; i < count_of(to); i++) {
        uint32_t bits;
        memcpy(&bits, &out[i], sizeof bits);
        sum = (sum ^ bits) * UINT64_C(0x100000001b3);
    }
    print_message("the sum is 0x%016llx\n", (unsigned long long)sum);
    EXPECT_TRUE(sum == UINT64_C(0xe0d200214f60c2c7));
    network_close(&n);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_convolutions),
        cmocka_unit_test(test_pad),
        cmocka_unit_test(test_max_pool),
        cmocka_unit_test(test_resize),
        cmocka_unit_test(test_depth_to_space),
        cmocka_unit_test(test_logistic),
        cmocka_unit_test(test_shapes_that_do_not_fit_are_refused),
        cmocka_unit_test(test_bits_are_the_same_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
