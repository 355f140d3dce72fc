// Smaller copies: means of what each pixel covers, of whole and of other ratios.
#include "tests/support/test.h"

#include "base/pixels.h"

static void test_means(void **state)
{
    (void)state;
    static const uint8_t in[4 * 2 * 3] = {0, 10, 255, 2, 20, 255, 100, 0, 0, 100, 0, 0,
                                          4, 30, 255, 6, 40, 255, 200, 0, 0, 200, 0, 4};
    uint8_t out[2 * 3];
    image_shrink(in, 4, 2, out, 2, 1);
    assert_memory_equal(out, ((uint8_t[]){3, 25, 255, 150, 0, 1}), sizeof out);
}

// Every pixel of the original counts once, whatever the ratio: the weighted mean stays.
static void test_other_ratios(void **state)
{
    (void)state;
    enum { W = 37, H = 23 };
    uint8_t in[W * H * 3], out[W * H * 3];
    struct rng rng = {31};
    for (size_t i = 0; i < sizeof in; i++)
        in[i] = (uint8_t)(rng_uniform(&rng) * 256);
    image_shrink(in, W, H, out, W, H);
    assert_memory_equal(out, in, sizeof in);
    static const int sizes[][2] = {{36, 23}, {20, 11}, {7, 22}, {1, 1}};
    for (size_t i = 0; i < COUNT_OF(sizes); i++) {
        const int w = sizes[i][0], h = sizes[i][1];
        double whole = 0, sum = 0;
        image_shrink(in, W, H, out, w, h);
        for (int k = 0; k < W * H; k++)
            whole += in[3 * k + 1];
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++)
                sum += out[3 * (y * w + x) + 1] * (double)((y + 1) * H / h - y * H / h) * ((x + 1) * W / w - x * W / w);
        EXPECT_NEAR(sum / (W * H), whole / (W * H), 1); // means are rounded down
        EXPECT_AT_MOST(sum, whole);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_means), cmocka_unit_test(test_other_ratios)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
