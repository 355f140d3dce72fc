#include "locate/patch.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_ROUNDS = 8, HALF = PATCH_SIDE / 2, BORDER = PATCH_SIDE + 2 };
static const float SETTLED_PX = 0.02f;
static const float LEAST_SPREAD = 4;      // grey levels, standard deviation
static const float LEAST_LIKENESS = 0.85f; // correlation in the full picture
static const double MOST_PX = 16;         // further than this from the start it is another one

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

// Reads side x side values around (x, y), bilinear. False: not wholly in the picture.
static bool read_square(const struct patch_picture *p, int l, double x, double y, int side, float *out)
{
    double left = floor(x), top = floor(y);
    int x0 = (int)left - side / 2, y0 = (int)top - side / 2;
    float fx = (float)(x - left), fy = (float)(y - top);
    if (!(x > -1 && y > -1) || x0 < 0 || y0 < 0 || x0 + side >= p->width[l] || y0 + side >= p->height[l])
        return false;
    float w00 = (1 - fx) * (1 - fy), w10 = fx * (1 - fy), w01 = (1 - fx) * fy, w11 = fx * fy;
    for (int row = 0; row < side; row++) {
        const uint8_t *a = p->level[l] + (size_t)(y0 + row) * (size_t)p->width[l] + (size_t)x0, *b = a + p->width[l];
        for (int c = 0; c < side; c++)
            out[row * side + c] = w00 * (float)a[c] + w10 * (float)a[c + 1] + w01 * (float)b[c] + w11 * (float)b[c + 1];
    }
    return true;
}

// Takes the mean off and returns the standard deviation.
static float centre(float value[PATCH_PIXELS])
{
    float sum = 0, sum2 = 0;
    for (int i = 0; i < PATCH_PIXELS; i++)
        sum += value[i];
    sum /= PATCH_PIXELS;
    for (int i = 0; i < PATCH_PIXELS; i++) {
        value[i] -= sum;
        sum2 += value[i] * value[i];
    }
    return sqrtf(sum2 / PATCH_PIXELS);
}

static double at_level(double full, int l) { return (full + 0.5) / (1 << l) - 0.5; }

static bool cut_level(const struct patch_picture *p, int l, struct pixel at, struct patch_level *out)
{
    float wide[BORDER * BORDER], xx = 0, xy = 0, yy = 0;
    out->spread = 0;
    if (!read_square(p, l, at_level(at.x, l), at_level(at.y, l), BORDER, wide))
        return false;
    for (int i = 0; i < PATCH_PIXELS; i++) {
        const float *v = wide + (i / PATCH_SIDE + 1) * BORDER + i % PATCH_SIDE + 1;
        out->value[i] = *v;
        out->by_x[i] = (v[1] - v[-1]) / 2;
        out->by_y[i] = (v[BORDER] - v[-BORDER]) / 2;
        xx += out->by_x[i] * out->by_x[i];
        xy += out->by_x[i] * out->by_y[i];
        yy += out->by_y[i] * out->by_y[i];
    }
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
        if (!read_square(p, l, *x, *y, PATCH_SIDE, now))
            return false;
        float spread = centre(now), gain = patch->spread / fmaxf(spread, 0.5f), bx = 0, by = 0, dot = 0;
        for (int i = 0; i < PATCH_PIXELS; i++) {
            float error = now[i] * gain - patch->value[i];
            bx += patch->by_x[i] * error;
            by += patch->by_y[i] * error;
            dot += now[i] * patch->value[i];
        }
        *likeness = dot / (PATCH_PIXELS * patch->spread * fmaxf(spread, 0.5f));
        if (step < SETTLED_PX)
            break;
        float dx = patch->inverse[0] * bx + patch->inverse[1] * by, dy = patch->inverse[1] * bx + patch->inverse[2] * by;
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

bool patch_follow(const struct patch_picture *p, const struct patch *patch, struct pixel *at)
{
    struct pixel now = *at;
    for (int l = PATCH_LEVELS - 1; l >= 0; l--) {
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
    if (!(hypot(now.x - at->x, now.y - at->y) < MOST_PX))
        return false;
    *at = now;
    return true;
}
