#include "locate/klt_patch.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_ROUNDS = 8, WIDE = PATCH_ACROSS + 2, HIGH = PATCH_DOWN + 2 };
static const float SETTLED_PX = 0.02f;
static const float LEAST_SPREAD = 4;       // grey levels, standard deviation
static const float LEAST_LIKENESS = 0.85f; // correlation in the full picture
// Further than this from the start it is another one.
static const double MOST_PX = 16, NEAR_PX = 3;

enum status patch_picture_open(struct patch_picture *p, int width, int height)
{
    *p = (struct patch_picture){{0}, {0}, {NULL}};
    for (int l = 0; l < PATCH_LEVELS; l++) {
        p->width[l] = width >> l;
        p->height[l] = height >> l;
        p->level[l] = malloc((size_t)(p->width[l] + 1) * (size_t)(p->height[l] + 1));
        if (!p->level[l]) {
            patch_picture_close(p);
            return fail(ERR_MEMORY, "no memory to follow a camera");
        }
    }
    return OK;
}

void patch_picture_close(struct patch_picture *p)
{
    for (int l = 0; l < PATCH_LEVELS; l++)
        free(p->level[l]);
    *p = (struct patch_picture){{0}, {0}, {NULL}};
}

void patch_picture_fill(struct patch_picture *p, const uint8_t *gray)
{
    memcpy(p->level[0], gray, (size_t)p->width[0] * (size_t)p->height[0]);
    for (int l = 1; l < PATCH_LEVELS; l++) {
        int wide = p->width[l - 1], across = p->width[l];
        for (int y = 0; y < p->height[l]; y++) {
            const uint8_t *a = p->level[l - 1] + (size_t)(2 * y) * (size_t)wide, *b = a + wide;
            uint8_t *out = p->level[l] + (size_t)y * (size_t)across;
            for (int x = 0; x < across; x++)
                out[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
        }
    }
}

// Reads across x down values around (x, y), bilinear. False: not wholly in the picture.
static inline bool read_around(const struct patch_picture *p, int l, double x, double y, int across, int down,
                               float *restrict out)
{
    double left = x - (across - 1) * 0.5, top = y - (down - 1) * 0.5;
    if (!(left >= 0 && top >= 0 && left < p->width[l] - across && top < p->height[l] - down))
        return false;
    int x0 = (int)left, y0 = (int)top;
    float fx = (float)(left - x0), fy = (float)(top - y0);
    float w00 = (1 - fx) * (1 - fy), w10 = fx * (1 - fy), w01 = (1 - fx) * fy, w11 = fx * fy;
    const uint8_t *a = p->level[l] + (size_t)y0 * (size_t)p->width[l] + (size_t)x0, *b = a + p->width[l];
    for (int row = 0; row < down; row++, a = b, b += p->width[l], out += across)
        for (int c = 0; c < across; c++)
            out[c] = w00 * (float)a[c] + w10 * (float)a[c + 1] + w01 * (float)b[c] + w11 * (float)b[c + 1];
    return true;
}

// Sums over a patch are taken column by column, then over the columns in pairs: in vectors of any
// length the result is the same.
static inline float sum_columns(const float column[PATCH_ACROSS])
{
    return ((column[0] + column[4]) + (column[1] + column[5])) + ((column[2] + column[6]) + (column[3] + column[7]));
}

static inline float sum_products(const float a[PATCH_PIXELS], const float b[PATCH_PIXELS])
{
    float column[PATCH_ACROSS] = {0};
    for (int i = 0; i < PATCH_PIXELS; i += PATCH_ACROSS)
        for (int c = 0; c < PATCH_ACROSS; c++)
            column[c] += a[i + c] * b[i + c];
    return sum_columns(column);
}

// Takes the mean off and returns the standard deviation.
static inline float centre(float value[PATCH_PIXELS])
{
    float column[PATCH_ACROSS] = {0};
    for (int i = 0; i < PATCH_PIXELS; i += PATCH_ACROSS)
        for (int c = 0; c < PATCH_ACROSS; c++)
            column[c] += value[i + c];
    float mean = sum_columns(column) / PATCH_PIXELS;
    for (int i = 0; i < PATCH_PIXELS; i++)
        value[i] -= mean;
    return sqrtf(sum_products(value, value) / PATCH_PIXELS);
}

static double at_level(double full, int l) { return (full + 0.5) / (1 << l) - 0.5; }

static bool cut_level(const struct patch_picture *p, int l, struct pixel at, struct patch_level *out)
{
    float wide[WIDE * HIGH];
    out->spread = 0;
    if (!read_around(p, l, at_level(at.x, l), at_level(at.y, l), WIDE, HIGH, wide))
        return false;
    for (int row = 0, i = 0; row < PATCH_DOWN; row++) {
        const float *v = wide + (row + 1) * WIDE + 1;
        for (int c = 0; c < PATCH_ACROSS; c++, v++, i++) {
            out->value[i] = *v;
            out->by_x[i] = (v[1] - v[-1]) / 2;
            out->by_y[i] = (v[WIDE] - v[-WIDE]) / 2;
        }
    }
    float xx = sum_products(out->by_x, out->by_x), xy = sum_products(out->by_x, out->by_y),
          yy = sum_products(out->by_y, out->by_y);
    float spread = centre(out->value), det = xx * yy - xy * xy;
    // An edge alone lets the patch slide along it.
    if (!(spread > LEAST_SPREAD) || !(det > 0.02f * (xx + yy) * (xx + yy)))
        return false;
    out->inverse[0] = yy / det, out->inverse[1] = -xy / det, out->inverse[2] = xx / det;
    out->spread = spread;
    return true;
}

bool patch_cut(const struct patch_picture *p, struct pixel at, struct patch *out)
{
    for (int l = 1; l < PATCH_LEVELS; l++)
        cut_level(p, l, at, &out->level[l]);
    return cut_level(p, 0, at, &out->level[0]);
}

// One level. *likeness: the correlation in the end.
static bool settle(const struct patch_picture *p, int l, const struct patch_level *patch, double *x, double *y,
                   float *likeness)
{
    float now[PATCH_PIXELS], step = 1;
    for (int round = 0; round < MOST_ROUNDS; round++) {
        if (!read_around(p, l, *x, *y, PATCH_ACROSS, PATCH_DOWN, now))
            return false;
        float spread = centre(now), gain = patch->spread / fmaxf(spread, 0.5f);
        *likeness = sum_products(now, patch->value) / (PATCH_PIXELS * patch->spread * fmaxf(spread, 0.5f));
        if (step < SETTLED_PX)
            break;
        for (int i = 0; i < PATCH_PIXELS; i++)
            now[i] = now[i] * gain - patch->value[i];
        float bx = sum_products(now, patch->by_x), by = sum_products(now, patch->by_y);
        float dx = patch->inverse[0] * bx + patch->inverse[1] * by,
              dy = patch->inverse[1] * bx + patch->inverse[2] * by;
        step = fmaxf(fabsf(dx), fabsf(dy));
        if (step > 2) { // a slope holds for a pixel or two
            dx *= 2 / step;
            dy *= 2 / step;
        }
        *x -= dx;
        *y -= dy;
    }
    return isfinite(*x) && isfinite(*y);
}

bool patch_follow(const struct patch_picture *p, const struct patch *patch, bool near, struct pixel *at)
{
    struct pixel now = *at;
    for (int l = near ? 0 : PATCH_LEVELS - 1; l >= 0; l--) {
        double x = at_level(now.x, l), y = at_level(now.y, l);
        float likeness = 0;
        if (!(patch->level[l].spread > 0))
            continue;
        if (!settle(p, l, &patch->level[l], &x, &y, &likeness)) {
            if (l == 0)
                return false;
            continue;
        }
        if (l == 0 && !(likeness > LEAST_LIKENESS))
            return false;
        if (l == 0 || likeness > 0.6f) // a copy that shows something else misleads
            now = (struct pixel){(x + 0.5) * (1 << l) - 0.5, (y + 0.5) * (1 << l) - 0.5};
    }
    if (!(hypot(now.x - at->x, now.y - at->y) < (near ? NEAR_PX : MOST_PX)))
        return false;
    *at = now;
    return true;
}
