// The depth and mask codecs: lossless for every image, safe on any bytes.
#include "tests/support/test.h"

#include "capture/recording/depth_codec.h"

#include <stdio.h>
#include <string.h>

enum { SEED = 2017, HOSTILE = 3000 };

static struct depth_coder *coder;

static int open_coder(void **state)
{
    (void)state;
    return depth_coder_open(&coder) == OK ? 0 : -1;
}

static int close_coder(void **state)
{
    (void)state;
    depth_coder_close(&coder);
    depth_coder_close(&coder);
    return 0;
}

static double expect_exact(const uint16_t *depth, int width, int height)
{
    size_t n = (size_t)width * (size_t)height, count;
    const uint8_t *bytes;
    EXPECT_STATUS(depth_encode(coder, depth, width, height, &bytes, &count), OK);
    // A copy of the exact size, so that a sanitizer sees any access beyond it.
    uint8_t *coded = malloc(count);
    uint16_t *back = malloc(n * sizeof *back);
    assert_true(coded && back);
    memcpy(coded, bytes, count);
    memset(back, 0xa5, n * sizeof *back);
    EXPECT_STATUS(depth_decode(coder, coded, count, back, width, height), OK);
    size_t wrong = 0;
    for (size_t i = 0; i < n; i++)
        wrong += back[i] != depth[i];
    if (wrong) {
        print_error("%d x %d: %zu of %zu pixels differ\n", width, height, wrong, n);
        fail_test();
    }
    free(coded);
    free(back);
    return (double)count;
}

// ------------------------------------------------------------- depth

// Paints an image of the given kind; each exercises another part of the codec.
static void paint(uint16_t *depth, int width, int height, int kind, struct rng *rng)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            double u = rng_uniform(rng);
            uint16_t d = 0;
            switch (kind) {
            case 0: d = 0; break;
            case 1: d = 65535; break;
            case 2: d = (uint16_t)(65536 * u); break; // incompressible
            case 3: d = u < 0.5 ? 0 : 65535; break;
            case 4: d = (uint16_t)(700 + 3 * x + 2 * y); break;                          // a slope
            case 5: d = (uint16_t)(u < 0.2 ? 0 : 1e6 / round(400 - 0.3 * x + u)); break; // disparity steps, holes
            case 6: d = (uint16_t)(3000 + 40 * rng_normal(rng)); break;                  // a noisy wall
            case 7: d = (uint16_t)((x / 5 + y / 3) % 2 ? 900 : 4000); break;             // edges everywhere
            case 8: d = (uint16_t)(x == width / 2 && y == height / 2); break;            // one pixel
            case 9: d = (uint16_t)(y * width + x); break;                                // each value once
            default: d = (uint16_t)(u < 0.01 ? 65536 * rng_uniform(rng) : 1234); break;
            }
            depth[y * width + x] = d;
        }
}
enum { KINDS = 11 };

static void test_every_image_is_lossless(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    const int sizes[][2] = {{1, 1}, {2, 1}, {1, 2}, {1, 77}, {77, 1}, {3, 3}, {17, 31}, {64, 48}, {320, 241}};
    for (size_t s = 0; s < COUNT_OF(sizes); s++) {
        int width = sizes[s][0], height = sizes[s][1];
        uint16_t *depth = malloc((size_t)(width * height) * sizeof *depth);
        assert_non_null(depth);
        for (int kind = 0; kind < KINDS; kind++) {
            paint(depth, width, height, kind, &rng);
            // Never much more than the raw pixels.
            EXPECT_AT_MOST(expect_exact(depth, width, height), 2.0 * width * height + 64);
        }
        free(depth);
    }
}

static void test_every_pair_of_extremes(void **state)
{
    (void)state;
    const uint16_t values[] = {0, 1, 2, 255, 256, 32767, 32768, 65534, 65535};
    for (size_t a = 0; a < COUNT_OF(values); a++)
        for (size_t b = 0; b < COUNT_OF(values); b++) {
            uint16_t depth[12];
            for (int i = 0; i < 12; i++)
                depth[i] = i * 5 % 3 ? values[a] : values[b];
            expect_exact(depth, 4, 3);
            expect_exact(depth, 12, 1);
            expect_exact(depth, 1, 12);
        }
}

static void test_sensor_image_compresses(void **state)
{
    (void)state;
    // A wall and a box, with steps of 1/8 pixel of disparity and noise of half a step.
    struct rng rng = {SEED};
    static uint16_t depth[640 * 480];
    for (int y = 0; y < 480; y++)
        for (int x = 0; x < 640; x++) {
            double metres = x > 200 && x < 400 && y > 100 ? 1.8 : 3 + 0.001 * x;
            double disparity = round(8 * 575 * 0.075 / metres + 0.5 * rng_normal(&rng));
            depth[y * 640 + x] = (uint16_t)(x > 190 && x <= 200 && y > 100 ? 0 : 8 * 575 * 75 / disparity);
        }
    double bytes = expect_exact(depth, 640, 480);
    printf("640 x 480: %.0f bytes, %.1f times smaller\n", bytes, sizeof depth / bytes);
    // The noise alone has an entropy of 1.1 to 1.5 bits a pixel.
    EXPECT_AT_MOST(bytes, 640 * 480 * 1.5 / 8);
}

// ------------------------------------------------------------- masks

static void test_every_mask_is_lossless(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    const int sizes[][2] = {{1, 1}, {1, 9}, {9, 1}, {33, 17}, {640, 480}};
    for (size_t s = 0; s < COUNT_OF(sizes); s++)
        for (int kind = 0; kind < 6; kind++) {
            int width = sizes[s][0], height = sizes[s][1];
            size_t n = (size_t)(width * height), count;
            uint8_t *mask = malloc(n), *back = malloc(n);
            assert_true(mask && back);
            for (int i = 0; i < width * height; i++) {
                int x = i % width - width / 2, y = i / width - height / 2;
                mask[i] = (uint8_t)(kind == 0   ? 0
                                    : kind == 1 ? 1
                                    : kind == 2 ? rng_uniform(&rng) < 0.5
                                    : kind == 3 ? x * x * 4 + y * y < height * height / 5
                                    : kind == 4 ? (x + y) & 1
                                                : i == width * height - 1);
            }
            const uint8_t *bytes;
            EXPECT_STATUS(mask_encode(coder, mask, width, height, &bytes, &count), OK);
            uint8_t *coded = malloc(count);
            assert_non_null(coded);
            memcpy(coded, bytes, count);
            memset(back, 7, n);
            EXPECT_STATUS(mask_decode(coder, coded, count, back, width, height), OK);
            assert_memory_equal(back, mask, n);
            if (width == 640 && kind == 3) {
                printf("an oval in a mask of 640 x 480: %zu bytes\n", count);
                EXPECT_AT_MOST((double)count, 700);
            }
            EXPECT_STATUS(mask_decode(coder, coded, count, back, width + 1, height), ERR_CORRUPT);
            free(coded);
            free(mask);
            free(back);
        }
}

// ------------------------------------------------------------- hostile bytes

// Decodes `count` bytes from a copy of the exact size. Any status is allowed, but no access outside.
static bool survives(const uint8_t *bytes, size_t count, int width, int height)
{
    uint8_t *exact = malloc(count ? count : 1);
    uint16_t *depth = malloc((size_t)(width * height) * sizeof *depth);
    uint8_t *mask = malloc((size_t)(width * height));
    assert_true(exact && depth && mask);
    memcpy(exact, bytes, count);
    enum status a = depth_decode(coder, exact, count, depth, width, height);
    enum status b = mask_decode(coder, exact, count, mask, width, height);
    EXPECT_TRUE(a == OK || a == ERR_CORRUPT);
    EXPECT_TRUE(b == OK || b == ERR_CORRUPT);
    free(exact);
    free(depth);
    free(mask);
    return a == OK || b == OK;
}

static void test_hostile_bytes(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    enum { WIDTH = 40, HEIGHT = 30 };
    uint16_t depth[WIDTH * HEIGHT];
    uint8_t mask[WIDTH * HEIGHT], bytes[4 * WIDTH * HEIGHT];
    int accepted = 0;
    for (int i = 0; i < HOSTILE; i++) {
        const uint8_t *coded;
        size_t count;
        paint(depth, WIDTH, HEIGHT, i % KINDS, &rng);
        if (i % 3 == 2) {
            for (int k = 0; k < WIDTH * HEIGHT; k++)
                mask[k] = depth[k] > 1000;
            EXPECT_STATUS(mask_encode(coder, mask, WIDTH, HEIGHT, &coded, &count), OK);
        } else {
            EXPECT_STATUS(depth_encode(coder, depth, WIDTH, HEIGHT, &coded, &count), OK);
        }
        assert_true(count <= sizeof bytes);
        memcpy(bytes, coded, count);
        int changes = 1 + (int)(4 * rng_uniform(&rng));
        if (i % 5 == 0) // all random but the size, so that it is decoded
            for (size_t k = 5; k < count; k++)
                bytes[k] = (uint8_t)(256 * rng_uniform(&rng));
        for (int k = 0; k < changes; k++) {
            size_t at = (size_t)(rng_uniform(&rng) * (double)count);
            bytes[at] ^= (uint8_t)(1 << (int)(8 * rng_uniform(&rng)));
        }
        if (i % 7 == 0)
            count = (size_t)(rng_uniform(&rng) * (double)count);
        accepted += survives(bytes, count, WIDTH, HEIGHT);
    }
    printf("%d of %d wrong codes decoded to some image\n", accepted, HOSTILE);
    for (size_t count = 0; count < 40; count++)
        survives(bytes, count, WIDTH, HEIGHT);
}

int main(void)
{
    printf("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_image_is_lossless), cmocka_unit_test(test_every_pair_of_extremes),
        cmocka_unit_test(test_sensor_image_compresses), cmocka_unit_test(test_every_mask_is_lossless),
        cmocka_unit_test(test_hostile_bytes),
    };
    return cmocka_run_group_tests(tests, open_coder, close_coder);
}
