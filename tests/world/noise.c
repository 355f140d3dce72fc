// Noise models of a depth sensor and of a colour camera, applied to rendered images.
#include "tests/world/numbers.h"
#include "tests/world/texture.h"
#include "tests/world/world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Counter-based random numbers, one per pixel and purpose: independent of order and threads.
static uint64_t draw(uint64_t seed, uint64_t pixel, uint64_t purpose)
{
    // splitmix64's finaliser (Steele, Lea and Flood 2014)
    uint64_t z = seed + 0x9e3779b97f4a7c15u * (pixel * 8 + purpose + 1);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static double uniform(uint64_t seed, uint64_t pixel, uint64_t purpose)
{
    return (double)(draw(seed, pixel, purpose) >> 11) * 0x1p-53;
}

static double normal(uint64_t seed, uint64_t pixel, uint64_t purpose)
{
    double u = 1 - uniform(seed, pixel, purpose), v = uniform(seed, pixel, purpose + 1);
    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}

// normal / 2, rounded.
static int half_normal(uint64_t seed, uint64_t pixel, uint64_t purpose)
{
    // exp(-1/2) = 0.6065: |normal| < 1 for all above, which saves its logarithm and cosine
    return 1 - uniform(seed, pixel, purpose) > 0.607 ? 0 : (int)lround(0.5 * normal(seed, pixel, purpose));
}

// Kinect v1: baseline, noise per z^2, range, disparity step.
static const double BASELINE_M = 0.075, SIGMA = 1.5e-3, NEAR_M = 0.4, FAR_M = 8.0, STEP_PX = 0.125;

// Marks where the projector's light is blocked by something nearer to its right. The projector sees column u of depth z
// at u - f b / z; sweeping from the right, a column that falls right of an earlier one is behind it.
static void find_shadow(const struct lens *l, const uint16_t *row, uint8_t *dark)
{
    double fb = l->fx * BASELINE_M, right_of = 1e9;
    for (int x = l->width - 1; x >= 0; x--) {
        dark[x] = 0;
        if (!row[x])
            continue;
        double seen = x - fb / (row[x] * 1e-3);
        dark[x] = seen > right_of + 0.75;
        right_of = least(right_of, seen);
    }
}

struct noise_spot {
    const struct lens *lens;
    const uint16_t *ideal;
    const uint8_t *dark;
    uint64_t seed;
};

static uint16_t read_pixel(const struct noise_spot *s, int x, int y)
{
    int w = s->lens->width, h = s->lens->height;
    size_t at = (size_t)y * (size_t)w + (size_t)x;
    // The sensor matches windows: its depth comes from about half a pixel around.
    int rx = x + half_normal(s->seed, at, 0), ry = y + half_normal(s->seed, at, 2);
    rx = rx < 0 ? 0 : rx >= w ? w - 1 : rx;
    ry = ry < 0 ? 0 : ry >= h ? h - 1 : ry;
    size_t from = (size_t)ry * (size_t)w + (size_t)rx;
    if (s->dark[at] || s->dark[from] || !s->ideal[from])
        return 0;
    double z = s->ideal[from] * 1e-3, low = z, high = z;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            int nx = x + dx, ny = y + dy;
            if (nx < 0 || ny < 0 || nx >= w || ny >= h || !s->ideal[(size_t)ny * (size_t)w + (size_t)nx])
                continue;
            double n = s->ideal[(size_t)ny * (size_t)w + (size_t)nx] * 1e-3;
            low = least(low, n);
            high = most(high, n);
        }
    if (high - low > 0.04 + 0.03 * low) { // an edge
        double luck = uniform(s->seed, at, 4);
        if (luck < 0.18)
            return 0;
        if (luck < 0.36) // a window across the edge: something between
            z = 1 / (1 / low + (1 / high - 1 / low) * uniform(s->seed, at, 5));
    }
    if (z < NEAR_M || z > FAR_M)
        return 0;
    // noise and steps in disparity, of an image 640 pixels wide
    double fb = s->lens->fx * 640 / w * BASELINE_M;
    double disparity = fb / z + fb * SIGMA * normal(s->seed, at, 6);
    disparity = floor(disparity / STEP_PX + 0.5) * STEP_PX;
    if (!(disparity > 0.5))
        return 0;
    double mm = fb / disparity * 1000;
    return mm < 65535 ? (uint16_t)(mm + 0.5) : 0;
}

enum status world_depth_noise(const struct lens *lens, const uint16_t *ideal, uint64_t seed, uint16_t *out)
{
    enum status status = lens_check(lens, "small world's depth");
    if (status)
        return status;
    size_t w = (size_t)lens->width, h = (size_t)lens->height;
    uint8_t *dark = malloc(w * h);
    uint16_t *copy = malloc(w * h * sizeof *copy);
    if (dark && copy) {
        memcpy(copy, ideal, w * h * sizeof *copy);
        for (size_t y = 0; y < h; y++)
            find_shadow(lens, copy + y * w, dark + y * w);
        struct noise_spot s = {lens, copy, dark, draw(seed, 0, 7)};
        for (int y = 0; y < lens->height; y++)
            for (int x = 0; x < lens->width; x++)
                out[(size_t)y * w + (size_t)x] = read_pixel(&s, x, y);
    } else {
        status = fail(ERR_MEMORY, "out of memory for a depth image of %d x %d", lens->width, lens->height);
    }
    free(dark);
    free(copy);
    return status;
}

void world_color_noise(uint8_t *color, int width, int height, uint64_t seed)
{
    seed = draw(seed, 1, 7);
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        // Four bytes of one number, summed in pairs: a sufficient approximation of a Gaussian, and fast.
        uint64_t d = draw(seed, i, 0);
        double common = (double)(d & 0xffff) / 0xffff + (double)(d >> 16 & 0xffff) / 0xffff - 1;
        for (int c = 0; c < 3; c++) {
            double own = (double)(d >> (32 + 10 * c) & 0x3ff) / 0x3ff - 0.5;
            double value = color[i * 3 + (size_t)c] + 2.2 * common + 3.0 * own;
            color[i * 3 + (size_t)c] = (uint8_t)least(255, most(0, value + 0.5));
        }
    }
}
