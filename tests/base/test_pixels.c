// Conversion of camera images against the definition of their colours in double precision.
#include "tests/support/test.h"

#include "base/pixels.h"

#include <string.h>

static double clamp(double v) { return v < 0 ? 0 : v > 255 ? 255 : v; }

// ITU-R BT.601-7 and BT.709-6, written out from kr and kb.
static void reference(struct yuv_encoding m, int y, int cb, int cr, double rgb[3])
{
    double kr = m.matrix == YUV_BT601 ? 0.299 : 0.2126, kb = m.matrix == YUV_BT601 ? 0.114 : 0.0722, kg = 1 - kr - kb;
    double luma = m.full_range ? y : (y - 16) * 255.0 / 219, scale = m.full_range ? 1 : 255.0 / 224;
    double u = (cb - 128) * scale, v = (cr - 128) * scale;
    rgb[0] = clamp(luma + 2 * (1 - kr) * v);
    rgb[2] = clamp(luma + 2 * (1 - kb) * u);
    rgb[1] = clamp(luma - (2 * (1 - kb) * kb * u + 2 * (1 - kr) * kr * v) / kg);
}

static void expect_rgb(const uint8_t *got, struct yuv_encoding m, int y, int cb, int cr)
{
    double wanted[3];
    reference(m, y, cb, cr, wanted);
    for (int c = 0; c < 3; c++)
        EXPECT_NEAR(got[c], wanted[c], 0.51);
}

static void test_yuv_to_rgb(void **state)
{
    (void)state;
    enum { W = 6, H = 4, STRIDE = 2 * W + 5 };
    uint8_t in[STRIDE * H], chroma[(W + 3) * H / 2], rgb[W * H * 3];
    struct rng rng = {20};
    for (int round = 0; round < 400; round++) {
        struct yuv_encoding m = {round & 1 ? YUV_BT709 : YUV_BT601, round & 2};
        const struct yuv_layout layout = {m, W, H};
        for (size_t i = 0; i < sizeof in; i++)
            in[i] = (uint8_t)(rng_uniform(&rng) * 256);
        for (size_t i = 0; i < sizeof chroma; i++)
            chroma[i] = (uint8_t)(rng_uniform(&rng) * 256);
        pixels_from_yuv422(in, STRIDE, true, &layout, rgb);
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                const uint8_t *pair = in + y * STRIDE + x / 2 * 4;
                expect_rgb(rgb + (y * W + x) * 3, m, pair[x % 2 * 2], pair[1], pair[3]);
            }
        pixels_from_yuv422(in, STRIDE, false, &layout, rgb);
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                const uint8_t *pair = in + y * STRIDE + x / 2 * 4;
                expect_rgb(rgb + (y * W + x) * 3, m, pair[x % 2 * 2 + 1], pair[0], pair[2]);
            }
        pixels_from_nv12(in, STRIDE, chroma, W + 3, &layout, rgb);
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                const uint8_t *pair = chroma + y / 2 * (W + 3) + x / 2 * 2;
                expect_rgb(rgb + (y * W + x) * 3, m, in[y * STRIDE + x], pair[0], pair[1]);
            }
    }
}

static void test_packed_to_rgb(void **state)
{
    (void)state;
    const uint8_t in[] = {1, 2, 3, 4, 5, 6, 7, 8, 99, 11, 12, 13, 14, 15, 16, 17, 18, 99};
    uint8_t rgb[12];
    pixels_from_packed(in, 9, PACKED_RGB, 2, 2, rgb);
    assert_memory_equal(rgb, ((uint8_t[]){1, 2, 3, 4, 5, 6, 11, 12, 13, 14, 15, 16}), 12);
    pixels_from_packed(in, 9, PACKED_BGR, 2, 2, rgb);
    assert_memory_equal(rgb, ((uint8_t[]){3, 2, 1, 6, 5, 4, 13, 12, 11, 16, 15, 14}), 12);
    pixels_from_packed(in, 9, PACKED_RGBX, 2, 2, rgb);
    assert_memory_equal(rgb, ((uint8_t[]){1, 2, 3, 5, 6, 7, 11, 12, 13, 15, 16, 17}), 12);
    pixels_from_packed(in, 9, PACKED_BGRX, 2, 2, rgb);
    assert_memory_equal(rgb, ((uint8_t[]){3, 2, 1, 7, 6, 5, 13, 12, 11, 17, 16, 15}), 12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_yuv_to_rgb), cmocka_unit_test(test_packed_to_rgb)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
