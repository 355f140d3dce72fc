#include "locate/klt_patch.h"

#include "locate/tag_corners.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- luminance

// Luminance of an RGB image, and its mirror image. Splitting three bytes a pixel is five times faster with instructions
// that not every x86 processor has, so the compiler makes several versions and the loader chooses; with integers all
// give the same result. Not under sanitizers, which interfere with the loader's choice, nor with clang 14, which
// mangles the name.

#if defined(__x86_64__) && !defined(__clang__) && !defined(REENACT_SANITIZED)
#define TARGET_CLONES __attribute__((target_clones("avx2", "ssse3", "default")))
#else
#define TARGET_CLONES
#endif

TARGET_CLONES
void gray_from_rgb(const uint8_t *restrict rgb, size_t pixels, uint8_t *restrict gray)
{
    for (size_t i = 0; i < pixels; i++) // BT.601, in 256ths
        gray[i] = (uint8_t)((77 * rgb[3 * i] + 150 * rgb[3 * i + 1] + 29 * rgb[3 * i + 2] + 128) >> 8);
}

void gray_mirror(uint8_t *gray, int width, int height)
{
    for (int y = 0; y < height; y++, gray += width)
        for (int x = 0; 2 * x < width - 1; x++) {
            const uint8_t left = gray[x];
            gray[x] = gray[width - 1 - x];
            gray[width - 1 - x] = left;
        }
}

// ---------------------------------------------------------------- klt patch

enum { MAX_ROUNDS = 8, WIDE = KLT_WIDTH + 2, HIGH = KLT_HEIGHT + 2 };
// Chosen by hand.
static const float CONVERGED_PX = 0.02f;
static const float MIN_SIGMA = 4;           // grey levels, standard deviation
static const float MIN_CORRELATION = 0.85f; // at full resolution
// Farther than this from the start it is something else.
static const double MAX_FAR_PX = 16, MAX_CLOSE_PX = 3;

enum status klt_pyramid_open(struct klt_pyramid *pyramid, int width, int height)
{
    *pyramid = (struct klt_pyramid){{0}, {0}, {NULL}};
    for (int l = 0; l < KLT_LEVELS; l++) {
        pyramid->width[l] = width >> l;
        pyramid->height[l] = height >> l;
        pyramid->level[l] = malloc((size_t)(pyramid->width[l] + 1) * (size_t)(pyramid->height[l] + 1));
        if (!pyramid->level[l]) {
            klt_pyramid_close(pyramid);
            return fail(ERR_MEMORY, "no memory to track a camera");
        }
    }
    return OK;
}

void klt_pyramid_close(struct klt_pyramid *pyramid)
{
    for (int l = 0; l < KLT_LEVELS; l++)
        free(pyramid->level[l]);
    *pyramid = (struct klt_pyramid){{0}, {0}, {NULL}};
}

void klt_pyramid_build(struct klt_pyramid *pyramid, const uint8_t *gray)
{
    memcpy(pyramid->level[0], gray, (size_t)pyramid->width[0] * (size_t)pyramid->height[0]);
    for (int l = 1; l < KLT_LEVELS; l++) {
        int wide = pyramid->width[l - 1], across = pyramid->width[l];
        for (int y = 0; y < pyramid->height[l]; y++) {
            const uint8_t *a = pyramid->level[l - 1] + (size_t)(2 * y) * (size_t)wide, *b = a + wide;
            uint8_t *out = pyramid->level[l] + (size_t)y * (size_t)across;
            for (int x = 0; x < across; x++)
                out[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
        }
    }
}

// Reads across x down values around `at`, bilinear. False: not wholly in the image.
static inline bool read_around(const struct klt_pyramid *pyramid, int l, struct pixel at, int across, int down,
                               float *restrict out)
{
    double left = at.x - (across - 1) * 0.5, top = at.y - (down - 1) * 0.5;
    if (!(left >= 0 && top >= 0 && left < pyramid->width[l] - across && top < pyramid->height[l] - down))
        return false;
    int x0 = (int)left, y0 = (int)top;
    float fx = (float)(left - x0), fy = (float)(top - y0);
    float w00 = (1 - fx) * (1 - fy), w10 = fx * (1 - fy), w01 = (1 - fx) * fy, w11 = fx * fy;
    const uint8_t *a = pyramid->level[l] + (size_t)y0 * (size_t)pyramid->width[l] + (size_t)x0,
                  *b = a + pyramid->width[l];
    for (int row = 0; row < down; row++, a = b, b += pyramid->width[l], out += across)
        for (int c = 0; c < across; c++)
            out[c] = w00 * (float)a[c] + w10 * (float)a[c + 1] + w01 * (float)b[c] + w11 * (float)b[c + 1];
    return true;
}

// Sums over a patch are taken column by column, then over the columns in pairs: the result does not depend on the
// length of vector registers.
static inline float sum_columns(const float column[KLT_WIDTH])
{
    return ((column[0] + column[4]) + (column[1] + column[5])) + ((column[2] + column[6]) + (column[3] + column[7]));
}

static inline float sum_products(const float a[KLT_PIXELS], const float b[KLT_PIXELS])
{
    float column[KLT_WIDTH] = {0};
    for (int i = 0; i < KLT_PIXELS; i += KLT_WIDTH)
        for (int c = 0; c < KLT_WIDTH; c++)
            column[c] += a[i + c] * b[i + c];
    return sum_columns(column);
}

// Subtracts the mean and returns the standard deviation.
static inline float centre_values(float value[KLT_PIXELS])
{
    float column[KLT_WIDTH] = {0};
    for (int i = 0; i < KLT_PIXELS; i += KLT_WIDTH)
        for (int c = 0; c < KLT_WIDTH; c++)
            column[c] += value[i + c];
    float mean = sum_columns(column) / KLT_PIXELS;
    for (int i = 0; i < KLT_PIXELS; i++)
        value[i] -= mean;
    return sqrtf(sum_products(value, value) / KLT_PIXELS);
}

static double level_coordinate(double full, int l) { return (full + 0.5) / (1 << l) - 0.5; }

static bool extract_level(const struct klt_pyramid *pyramid, int l, struct pixel at, struct klt_level *out)
{
    float wide[WIDE * HIGH];
    out->sigma = 0;
    if (!read_around(pyramid, l, (struct pixel){level_coordinate(at.x, l), level_coordinate(at.y, l)}, WIDE, HIGH,
                     wide))
        return false;
    for (int row = 0, i = 0; row < KLT_HEIGHT; row++) {
        const float *v = wide + (row + 1) * WIDE + 1;
        for (int c = 0; c < KLT_WIDTH; c++, v++, i++) {
            out->value[i] = *v;
            out->grad_x[i] = (v[1] - v[-1]) / 2;
            out->grad_y[i] = (v[WIDE] - v[-WIDE]) / 2;
        }
    }
    float xx = sum_products(out->grad_x, out->grad_x), xy = sum_products(out->grad_x, out->grad_y),
          yy = sum_products(out->grad_y, out->grad_y);
    float sigma = centre_values(out->value), det = xx * yy - xy * xy;
    // Along a single edge the position would be undetermined.
    if (!(sigma > MIN_SIGMA) || !(det > 0.02f * (xx + yy) * (xx + yy)))
        return false;
    out->inverse[0] = yy / det, out->inverse[1] = -xy / det, out->inverse[2] = xx / det;
    out->sigma = sigma;
    return true;
}

bool klt_patch_extract(const struct klt_pyramid *pyramid, struct pixel at, struct klt_patch *out)
{
    for (int l = 1; l < KLT_LEVELS; l++)
        extract_level(pyramid, l, at, &out->level[l]);
    return extract_level(pyramid, 0, at, &out->level[0]);
}

// One level, from *at in its pixels. *correlation: at the end. False: it left the image; *at is undefined.
static bool align_level(const struct klt_pyramid *pyramid, int l, const struct klt_level *patch, struct pixel *at,
                        float *correlation)
{
    float now[KLT_PIXELS], step = 1;
    for (int round = 0; round < MAX_ROUNDS; round++) {
        if (!read_around(pyramid, l, *at, KLT_WIDTH, KLT_HEIGHT, now))
            return false;
        float sigma = centre_values(now), gain = patch->sigma / fmaxf(sigma, 0.5f);
        *correlation = sum_products(now, patch->value) / (KLT_PIXELS * patch->sigma * fmaxf(sigma, 0.5f));
        if (step < CONVERGED_PX)
            break;
        for (int i = 0; i < KLT_PIXELS; i++)
            now[i] = now[i] * gain - patch->value[i];
        float bx = sum_products(now, patch->grad_x), by = sum_products(now, patch->grad_y);
        float dx = patch->inverse[0] * bx + patch->inverse[1] * by,
              dy = patch->inverse[1] * bx + patch->inverse[2] * by;
        step = fmaxf(fabsf(dx), fabsf(dy));
        if (step > 2) { // the gradient is valid for a pixel or two
            dx *= 2 / step;
            dy *= 2 / step;
        }
        at->x -= dx;
        at->y -= dy;
    }
    return isfinite(at->x) && isfinite(at->y);
}

bool klt_patch_track(const struct klt_pyramid *pyramid, const struct klt_patch *patch, bool near_guess,
                     struct pixel *at)
{
    struct pixel now = *at;
    for (int l = near_guess ? 0 : KLT_LEVELS - 1; l >= 0; l--) {
        struct pixel here = {level_coordinate(now.x, l), level_coordinate(now.y, l)};
        float correlation = 0;
        if (!(patch->level[l].sigma > 0))
            continue;
        if (!align_level(pyramid, l, &patch->level[l], &here, &correlation)) {
            if (l == 0)
                return false;
            continue;
        }
        if (l == 0 && !(correlation > MIN_CORRELATION))
            return false;
        if (l == 0 || correlation > 0.6f) // a coarse level that shows something else misleads
            now = (struct pixel){(here.x + 0.5) * (1 << l) - 0.5, (here.y + 0.5) * (1 << l) - 0.5};
    }
    if (!(hypot(now.x - at->x, now.y - at->y) < (near_guess ? MAX_CLOSE_PX : MAX_FAR_PX)))
        return false;
    *at = now;
    return true;
}
