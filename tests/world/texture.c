#include "tests/world/texture.h"

#include "tests/world/numbers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/world/srgb.inl"

float srgb_to_linear(uint8_t value) { return level_linear[value]; }

uint8_t linear_to_srgb(float linear)
{
    if (!(linear > 0x1p-13f))
        return linear > level_end[0];
    if (linear >= 1)
        return 255;
    uint32_t bits;
    memcpy(&bits, &linear, sizeof bits);
    int level = level_start[(bits >> 18) - (FIRST_OCTAVE << 5)];
    while (level < 255 && linear >= level_end[level])
        level++;
    return (uint8_t)level;
}

enum status texture_make(struct texture *t, int width, int height)
{
    assert(width > 0 && height > 0);
    memset(t, 0, sizeof *t);
    size_t total = 0, at[TEXTURE_LEVELS];
    while (t->level_count < TEXTURE_LEVELS) {
        int i = t->level_count++;
        t->width[i] = width;
        t->height[i] = height;
        at[i] = total;
        total += (size_t)width * (size_t)height * 3;
        if (width == 1 && height == 1)
            break;
        width = width > 1 ? width / 2 : 1;
        height = height > 1 ? height / 2 : 1;
    }
    uint8_t *block = calloc(1, total);
    if (!block)
        return fail(ERR_MEMORY, "out of memory for a texture of %d x %d", t->width[0], t->height[0]);
    for (int i = 0; i < t->level_count; i++)
        t->level[i] = block + at[i];
    return OK;
}

void texture_free(struct texture *t)
{
    free(t->level[0]);
    memset(t, 0, sizeof *t);
}

void texture_set(struct texture *t, int x, int y, const float linear[3])
{
    uint8_t *p = t->level[0] + ((size_t)y * (size_t)t->width[0] + (size_t)x) * 3;
    for (int c = 0; c < 3; c++)
        p[c] = linear_to_srgb(linear[c]);
}

// The mean of channel c over the texels [x0, x1) x [y0, y1) of a level.
static float box_mean(const struct texture *t, int level, const int x[2], const int y[2], int c)
{
    float sum = 0;
    for (int v = y[0]; v < y[1]; v++)
        for (int u = x[0]; u < x[1]; u++)
            sum += level_linear[t->level[level][((size_t)v * (size_t)t->width[level] + (size_t)u) * 3 + (size_t)c]];
    return sum / (float)((x[1] - x[0]) * (y[1] - y[0]));
}

static void make_level(struct texture *t, int i)
{
    int w = t->width[i], h = t->height[i], pw = t->width[i - 1], ph = t->height[i - 1];
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            int columns[2] = {(int)((int64_t)x * pw / w), (int)((int64_t)(x + 1) * pw / w)};
            int rows[2] = {(int)((int64_t)y * ph / h), (int)((int64_t)(y + 1) * ph / h)};
            for (int c = 0; c < 3; c++)
                t->level[i][((size_t)y * (size_t)w + (size_t)x) * 3 + (size_t)c] =
                    linear_to_srgb(box_mean(t, i - 1, columns, rows, c));
        }
}

// Each level is the box-filtered half of the one below; odd edges are weighted by coverage.
void texture_finish(struct texture *t)
{
    for (int i = 1; i < t->level_count; i++)
        make_level(t, i);
}

static int inside(int i, int n, bool wrap)
{
    if (i >= 0 && i < n)
        return i;
    if (wrap) {
        i %= n;
        return i < 0 ? i + n : i;
    }
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

// A bilinear sample: level, position in texels of level 0, and its weight in the sum.
struct texture_tap {
    int level;
    double x, y;
    float weight;
};

static void bilinear(const struct texture *t, struct texture_tap tap, bool wrap, float sum[3])
{
    const int level = tap.level;
    int w = t->width[level], h = t->height[level];
    double u = tap.x * w / t->width[0] - 0.5, v = tap.y * h / t->height[0] - 0.5;
    const int i = floor_int(u), j = floor_int(v);
    float a = (float)(u - i), b = (float)(v - j);
    int x0 = inside(i, w, wrap), x1 = wrap ? inside(x0 + 1, w, wrap) : inside(i + 1, w, wrap);
    int y0 = inside(j, h, wrap), y1 = wrap ? inside(y0 + 1, h, wrap) : inside(j + 1, h, wrap);
    const uint8_t *row0 = t->level[level] + (size_t)y0 * (size_t)w * 3,
                  *row1 = t->level[level] + (size_t)y1 * (size_t)w * 3;
    for (int c = 0; c < 3; c++) {
        float top = level_linear[row0[x0 * 3 + c]] * (1 - a) + level_linear[row0[x1 * 3 + c]] * a;
        float low = level_linear[row1[x0 * 3 + c]] * (1 - a) + level_linear[row1[x1 * 3 + c]] * a;
        sum[c] += tap.weight * (top * (1 - b) + low * b);
    }
}

void texture_at(const struct texture *t, double x, double y, const struct texture_footprint *f, bool wrap,
                float linear[3])
{
    // Several taps along the longer axis, each as wide as the shorter one.
    enum { MOST_TAPS = 8 };
    float la = sqrtf(f->dxdu * f->dxdu + f->dydu * f->dydu), lb = sqrtf(f->dxdv * f->dxdv + f->dydv * f->dydv);
    float longer = la > lb ? la : lb, shorter = la > lb ? lb : la;
    float ax = la > lb ? f->dxdu : f->dxdv, ay = la > lb ? f->dydu : f->dydv;
    shorter = maxf(maxf(shorter, longer / MOST_TAPS), 1);
    int taps = (int)ceilf(longer / shorter - 0.01f);
    taps = taps < 1 ? 1 : taps > MOST_TAPS ? MOST_TAPS : taps;
    int whole;
    float fraction = frexpf(shorter, &whole); // shorter = fraction * 2^whole, fraction in [0.5, 1)
    float blend = 2 * fraction - 1;           // close to log2 and continuous
    int level = whole - 1;
    if (level >= t->level_count - 1) {
        level = t->level_count - 1;
        blend = 0;
    }
    linear[0] = linear[1] = linear[2] = 0;
    for (int i = 0; i < taps; i++) {
        float s = taps > 1 ? ((float)i + 0.5f) / (float)taps - 0.5f : 0;
        double px = x + (double)(s * ax), py = y + (double)(s * ay);
        bilinear(t, (struct texture_tap){level, px, py, (1 - blend) / (float)taps}, wrap, linear);
        if (blend > 0)
            bilinear(t, (struct texture_tap){level + 1, px, py, blend / (float)taps}, wrap, linear);
    }
}

// a 32-bit finaliser (lowbias32, Wellons 2018)
static inline uint32_t hash_mix(uint32_t h)
{
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return h ^ (h >> 16);
}

uint32_t hash_of(uint32_t a, uint32_t b, uint32_t c)
{
    return hash_mix(hash_mix(a * 0x9e3779b1u + b) ^ (c * 0x85ebca6bu + 0x7f4a7c15u));
}

float hash_unit(uint32_t a, uint32_t b, uint32_t c) { return (float)(hash_of(a, b, c) >> 8) * 0x1p-24f; }

static float ease(float t) { return t * t * (3 - 2 * t); }

float noise2(float x, float y, uint32_t seed)
{
    const int left = floor_int((double)x), above = floor_int((double)y);
    float a = ease(x - (float)left), b = ease(y - (float)above);
    const uint32_t i = (uint32_t)left, j = (uint32_t)above;
    float top = hash_unit(i, j, seed) * (1 - a) + hash_unit(i + 1, j, seed) * a;
    float low = hash_unit(i, j + 1, seed) * (1 - a) + hash_unit(i + 1, j + 1, seed) * a;
    return top * (1 - b) + low * b;
}

float fractal2(float x, float y, int octaves, uint32_t seed)
{
    float sum = 0, weight = 0.5f, total = 0;
    for (int i = 0; i < octaves; i++) {
        sum += weight * noise2(x, y, seed + (uint32_t)i);
        total += weight;
        weight *= 0.5f;
        x *= 2.03f, y *= 2.03f;
    }
    return sum / total;
}

float noise3(float x, float y, float z, uint32_t seed)
{
    const int left = floor_int((double)x), near = floor_int((double)y), under = floor_int((double)z);
    float a = ease(x - (float)left), b = ease(y - (float)near), c = ease(z - (float)under), sum = 0;
    const uint32_t i = (uint32_t)left, j = (uint32_t)near, k = (uint32_t)under;
    for (uint32_t l = 0; l < 2; l++) {
        uint32_t layer = seed ^ (k + l) * 0x9e3779b1u;
        float top = hash_unit(i, j, layer) * (1 - a) + hash_unit(i + 1, j, layer) * a;
        float low = hash_unit(i, j + 1, layer) * (1 - a) + hash_unit(i + 1, j + 1, layer) * a;
        sum += (top * (1 - b) + low * b) * (l ? c : 1 - c);
    }
    return sum;
}
