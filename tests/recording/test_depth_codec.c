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

// An image as the first version of the codec wrote it, with one state: it opens for ever.
static void test_first_version_opens(void **state)
{
    (void)state;
    enum { W = 40, H = 30 };
    // clang-format off
    static const uint8_t code[] = {
    0x01, 0x28, 0x00, 0x1e, 0x00, 0x00, 0x72, 0x00, 0x00, 0x00, 0xf3, 0x01, 0x00, 0x00, 0x67, 0x01, 0x00, 0x00, 0x0c, 0x00,
    0x00, 0x00, 0x28, 0xb5, 0x2f, 0xfd, 0x60, 0xf3, 0x00, 0xed, 0x0a, 0x00, 0x46, 0x93, 0x44, 0x3b, 0x50, 0x67, 0x95, 0xc6,
    0x20, 0x4c, 0x50, 0xf1, 0x06, 0x0d, 0x7d, 0xee, 0xc7, 0x65, 0x70, 0x1f, 0x60, 0x06, 0x86, 0x03, 0x73, 0xa3, 0x4f, 0x07,
    0x1c, 0x34, 0xd0, 0x50, 0x9f, 0xca, 0x8f, 0x72, 0x55, 0x55, 0x55, 0x75, 0xdf, 0x2f, 0x66, 0xf4, 0x39, 0x46, 0x2b, 0x93,
    0x2d, 0x12, 0x96, 0xbf, 0xc9, 0xd1, 0x12, 0xb2, 0xb7, 0x1c, 0xf9, 0x84, 0x6c, 0x99, 0x02, 0x33, 0x00, 0x34, 0x00, 0x34,
    0x00, 0x23, 0x05, 0xc5, 0x2d, 0xdd, 0xef, 0x1f, 0x01, 0xbd, 0x26, 0xa1, 0x26, 0xf9, 0x9a, 0x43, 0xd3, 0x32, 0x2d, 0x63,
    0xc8, 0xb2, 0x39, 0x99, 0x73, 0xce, 0x29, 0xa7, 0x94, 0xc8, 0x95, 0x10, 0x29, 0x77, 0x77, 0x1f, 0x1b, 0xe3, 0xc6, 0x47,
    0x8c, 0x58, 0x8c, 0x8e, 0x88, 0x61, 0x58, 0xb4, 0x54, 0x0f, 0x04, 0x01, 0x90, 0xc0, 0xbe, 0x20, 0x20, 0x9e, 0xd4, 0xb4,
    0xdc, 0x17, 0xb1, 0x5b, 0x3a, 0x39, 0x87, 0x7a, 0x18, 0xda, 0xca, 0x83, 0xd5, 0xb3, 0xe0, 0xe9, 0x1b, 0x52, 0x9a, 0xd1,
    0xf8, 0x0a, 0x83, 0x5f, 0x2f, 0x1a, 0x14, 0x94, 0x15, 0x82, 0x30, 0x2e, 0xbd, 0x8f, 0x60, 0x14, 0xd8, 0x6b, 0x03, 0x45,
    0x27, 0x0c, 0xd8, 0x11, 0xea, 0x81, 0x44, 0x50, 0x8f, 0x06, 0x5a, 0x68, 0x4f, 0x54, 0x5f, 0xe2, 0xe8, 0xcb, 0xb0, 0x62,
    0xe7, 0xc4, 0x4b, 0x54, 0x0e, 0xaf, 0x07, 0x96, 0xfb, 0xfc, 0x06, 0x8a, 0x1a, 0x1d, 0x25, 0x51, 0x0c, 0xdc, 0x91, 0x18,
    0x4c, 0x06, 0xb1, 0x5c, 0xa9, 0xb7, 0x9d, 0x7a, 0xab, 0x1e, 0xb7, 0xe0, 0xf7, 0x24, 0x07, 0xe0, 0xb3, 0x34, 0x4b, 0x53,
    0xc1, 0xb6, 0x75, 0x6f, 0x98, 0xa5, 0xd3, 0xcc, 0x9f, 0x59, 0xa1, 0xc1, 0xa4, 0xd8, 0xad, 0xfb, 0xad, 0xbb, 0xb2, 0x00,
    0x73, 0xae, 0x94, 0x3a, 0xb0, 0x1e, 0x64, 0x89, 0xb3, 0x4a, 0x7a, 0xee, 0x23, 0xf5, 0xd3, 0x6f, 0x4d, 0xc3, 0x95, 0x7e,
    0x59, 0x82, 0x8e, 0x7e, 0x4f, 0xcd, 0x5f, 0x10, 0x02, 0x21, 0x20, 0x80, 0x82, 0x83, 0x54, 0x75, 0x04, 0x01, 0xbe, 0x92,
    0x0c, 0x7a, 0x12, 0x8a, 0xd4, 0x06, 0x93, 0x9e, 0xa6, 0x96, 0xd7, 0xec, 0xad, 0xce, 0xf1, 0xc2, 0x10, 0x66, 0x99, 0xb5,
    0x32, 0x2a, 0xf3, 0xc1, 0xd8, 0x33, 0x48, 0xde, 0x86, 0xb5, 0xcf, 0xc9, 0x5e, 0x81, 0xb5, 0x57, 0xa4, 0x42, 0x63, 0x8c,
    0x75, 0x07, 0x69, 0x27, 0x03, 0x36, 0x22, 0x46, 0xb9, 0x5b, 0x78, 0x6b, 0x34, 0xcb, 0x0c, 0x64, 0x8b, 0xa4, 0x44, 0xe0,
    0x23, 0xd8, 0x51, 0x14, 0x45, 0x59, 0x14, 0xad, 0x40, 0xa3, 0x28, 0x2a, 0x00, 0x01, 0xa4, 0x7f, 0x00, 0xdc, 0xd7, 0xfe,
    0x06, 0x49, 0xbf, 0xb3, 0xa7, 0x4f, 0x82, 0x91, 0x8f, 0x1a, 0x10, 0xca, 0xbc, 0x7e, 0x59, 0x0a, 0x76, 0x1d, 0x5a, 0xc8,
    0x56, 0x0b, 0x36, 0x49, 0xf3, 0x24, 0x99, 0x1b, 0x31, 0x47, 0x33, 0x2c, 0x60, 0x7c, 0x8a, 0x24, 0xd8, 0x71, 0xfd, 0xb9,
    0x7b, 0x4e, 0x6d, 0xdf, 0xc0, 0xf5, 0xc7, 0xf1, 0xc1, 0x05, 0x95, 0x8b, 0x33, 0xdd, 0x34, 0x61, 0xd1, 0xa9, 0x76, 0x6b,
    0xc2, 0x96, 0x9a, 0xd8, 0x6f, 0x7d, 0x09, 0x21, 0x72, 0xaf, 0x55, 0x85, 0x87, 0xf3, 0xc4, 0x4b, 0xe2, 0x97, 0x94, 0x93,
    0xf8, 0xff, 0x04, 0x35, 0xf5, 0x9a, 0x5e, 0x94, 0x2d, 0xd0, 0x1c, 0x9a, 0xb9, 0x0a, 0x5c, 0xb3, 0x50, 0xce, 0x56, 0xb3,
    0xaf, 0x31, 0xbb, 0x7f, 0xa0, 0x19, 0xa8, 0x62, 0xd0, 0xf2, 0xd4, 0x54, 0x62, 0xf5, 0x9a, 0x20, 0x82, 0x0a, 0x00, 0xf5,
    0x0e, 0x8b, 0x97, 0xf1, 0x46, 0x1f, 0x39, 0x93, 0xcf, 0xa7, 0x8c, 0x3e, 0x5a, 0xa5, 0xa0, 0xd1, 0x52, 0x35, 0xcc, 0xd2,
    0x96,
    };
    // clang-format on
    uint16_t depth[W * H];
    EXPECT_INT(code[0], 1);
    EXPECT_STATUS(depth_decode(coder, code, sizeof code, depth, W, H), OK);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const int disparity = 400 - 3 * x + x * y * 7 % 5;
            const bool hole = (x > 25 && x < 32 && y > 8) || (x * 31 + y * 17) % 23 == 0;
            EXPECT_INT(depth[y * W + x], y < 4 ? 2000 : hole ? 0 : 1000000 / disparity);
        }
    for (size_t cut = 0; cut < sizeof code; cut++)
        EXPECT_STATUS(depth_decode(coder, code, cut, depth, W, H), ERR_CORRUPT);
}

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
        cmocka_unit_test(test_first_version_opens),    cmocka_unit_test(test_every_image_is_lossless),
        cmocka_unit_test(test_every_pair_of_extremes), cmocka_unit_test(test_sensor_image_compresses),
        cmocka_unit_test(test_every_mask_is_lossless), cmocka_unit_test(test_hostile_bytes),
    };
    return cmocka_run_group_tests(tests, open_coder, close_coder);
}
