#include "tests/world/paint.h"

#include "tests/world/glyphs.h"
#include "tests/world/numbers.h"
#include "tests/world/rgb.h"

#include <math.h>
#include <string.h>

// Coverage: 1 inside (negative distance), 0 outside, over one texel.
static float cover(float distance, float texel) { return minf(1, maxf(0, 0.5f - distance / texel)); }

static const uint32_t schemes[6][5] = {
    {0xf2e8d5, 0xd1495b, 0xedae49, 0x00798c, 0x30343f}, {0xfaf3dd, 0x264653, 0x2a9d8f, 0xe9c46a, 0xe76f51},
    {0xeae2b7, 0x003049, 0xd62828, 0xf77f00, 0xfcbf49}, {0xf1faee, 0x1d3557, 0x457b9d, 0xe63946, 0xa8dadc},
    {0xfff1d0, 0x086788, 0x06aed5, 0xf0c808, 0xdd1c1a}, {0xf4f1de, 0x3d405b, 0x81b29a, 0xe07a5f, 0xf2cc8f},
};

// A texel's position: metres from the lower left corner, the poster's size, a texel's size.
struct paint_spot {
    float x, y, w, h, texel;
    uint32_t seed;
    const uint32_t *scheme;
};

static struct rgb landscape(const struct paint_spot *s)
{
    float u = s->x / s->w, v = s->y / s->h;
    struct rgb sky = mix(hex(s->scheme[4]), hex(s->scheme[0]), 1.5f * (1 - v));
    float sx = 0.3f + 0.4f * hash_unit(s->seed, 1, 0), dx = (u - sx) * s->w, dy = s->y - 0.68f * s->h;
    float r = sqrtf(dx * dx + dy * dy);
    struct rgb c = mix(sky, hex(s->scheme[2]), cover(r - 0.17f * s->w, s->texel));
    for (int layer = 0; layer < 5; layer++) {
        float height = 0.62f - 0.13f * (float)layer;
        height += 0.20f *
                  (fractal2(u * (2.0f + (float)layer), 3.7f * (float)layer, 4, s->seed + 11u * (uint32_t)layer) - 0.5f);
        struct rgb hill = mix(hex(s->scheme[3]), hex(s->scheme[1]), 0.25f * (float)layer);
        hill = dim(hill, 0.8f + 0.4f * noise2(u * 30, v * 40, s->seed));
        c = mix(c, hill, cover((v - height) * s->h, s->texel));
    }
    return c;
}

static struct rgb circles(const struct paint_spot *s)
{
    float cell = s->w / 4;
    int i = (int)floorf(s->x / cell), j = (int)floorf(s->y / cell);
    uint32_t h = hash_of((uint32_t)i, (uint32_t)j, s->seed);
    float x = s->x - (float)i * cell, y = s->y - (float)j * cell;
    if (h & 1)
        x = cell - x;
    if (h & 2)
        y = cell - y;
    struct rgb ground = hex(s->scheme[(h >> 4) % 5]), ink = hex(s->scheme[((h >> 4) + 1 + (h >> 8) % 4) % 5]);
    float r = sqrtf(x * x + y * y);
    struct rgb c = ground;
    if (h & 4) {
        c = mix(c, ink, cover(r - 0.98f * cell, s->texel));
        c = mix(c, ground, cover(r - 0.66f * cell, s->texel));
        c = mix(c, ink, cover(r - 0.33f * cell, s->texel));
    } else if (h & 8) {
        c = mix(c, ink, cover(r - 0.98f * cell, s->texel));
    } else {
        float dx = x - cell / 2, dy = y - cell / 2;
        c = mix(c, ink, cover((x - y) * 0.7071f, s->texel));
        c = mix(c, hex(s->scheme[(h >> 12) % 5]), cover(sqrtf(dx * dx + dy * dy) - 0.28f * cell, s->texel));
    }
    return c;
}

static struct rgb contours(const struct paint_spot *s)
{
    float n = fractal2(s->x * 4.5f, s->y * 4.5f, 4, s->seed);
    float step = n * 22, line = fabsf(step - floorf(step) - 0.5f);
    struct rgb c = mix(hex(s->scheme[0]), hex(s->scheme[2]), (floorf(step) - 7) / 9);
    if (n < 0.40f)
        c = mix(hex(s->scheme[1]), hex(s->scheme[4]), n * 1.6f);
    c = mix(c, hex(s->scheme[1]), 0.85f * minf(1, maxf(0, (line - 0.40f) * 12)));
    float gx = fabsf(fmodf(s->x, 0.1f) - 0.05f), gy = fabsf(fmodf(s->y, 0.1f) - 0.05f);
    return mix(c, hex(s->scheme[1]), 0.35f * cover(minf(gx, gy) - 0.0008f, s->texel));
}

static struct rgb stripes(const struct paint_spot *s)
{
    // Split the rectangle repeatedly; the path gives the colour.
    float x0 = 0, y0 = 0, x1 = s->w, y1 = s->h, edge = 10;
    uint32_t path = 1;
    for (int i = 0; i < 6; i++) {
        float cut = 0.3f + 0.4f * hash_unit(path, 5, s->seed);
        bool across = x1 - x0 > (y1 - y0) * (0.7f + 0.6f * hash_unit(path, 6, s->seed));
        if (i > 2 && hash_unit(path, 7, s->seed) < 0.25f)
            break;
        float *low = across ? &x0 : &y0, *high = across ? &x1 : &y1, at = across ? s->x : s->y;
        float line = *low + cut * (*high - *low);
        edge = minf(edge, fabsf(at - line));
        path = path * 2 + (at > line);
        *(at > line ? low : high) = line;
    }
    float pick = hash_unit(path, 8, s->seed);
    struct rgb c = hex(s->scheme[pick < 0.35f ? 0 : (hash_of(path, 9, s->seed) % 4) + 1]);
    return mix(c, hex(0x1b1b1e), cover(edge - 0.007f, s->texel));
}

static struct rgb night(const struct paint_spot *s)
{
    float v = s->y / s->h;
    struct rgb c = mix(hex(0x2b2d6e), hex(0x0b0c2a), v);
    c = mix(c, hex(s->scheme[3]), 0.5f * maxf(0, fractal2(s->x * 5, s->y * 5, 4, s->seed) - 0.45f));
    int i = (int)floorf(s->x / 0.05f), j = (int)floorf(s->y / 0.05f);
    float sx = ((float)i + 0.2f + 0.6f * hash_unit((uint32_t)i, (uint32_t)j, s->seed)) * 0.05f;
    float sy = ((float)j + 0.2f + 0.6f * hash_unit((uint32_t)j, (uint32_t)i, s->seed + 1)) * 0.05f;
    float size = 0.006f * hash_unit((uint32_t)i, (uint32_t)j, s->seed + 2);
    c = mix(c, hex(0xfff8e0), cover(hypotf(s->x - sx, s->y - sy) - size, s->texel));
    for (uint32_t k = 0; k < 4; k++) {
        float px = s->w * (0.2f + 0.6f * hash_unit(k, 20, s->seed)), py = s->h * (0.15f + 0.2f * (float)k);
        float r = s->w * (0.07f + 0.12f * hash_unit(k, 21, s->seed)), dx = s->x - px, dy = s->y - py;
        float d = sqrtf(dx * dx + dy * dy);
        struct rgb planet =
            mix(hex(s->scheme[k % 5]), hex(s->scheme[(k + 2) % 5]), noise2(dx * 9, dy * 60 / (r * 20), s->seed + k));
        planet = dim(planet, minf(1, maxf(0.12f, 0.75f - (dx - dy) / r * 0.55f)));
        c = mix(c, planet, cover(d - r, s->texel));
        float ring = fabsf(hypotf(dx + 0.5f * dy, 3.2f * (dy - 0.3f * dx)) - 1.7f * r);
        if (k % 2 && (d > r || dy < 0.3f * dx))
            c = mix(c, hex(s->scheme[0]), cover(ring - 0.006f, s->texel));
    }
    return c;
}

static struct rgb words(const struct paint_spot *s)
{
    static const char *const lines[8][4] = {
        {"MOVE", "AGAIN", "2014", "SLOWLY"}, {"DANCE", "HALL", "FRI 9", "OPEN"}, {"LEFT", "RIGHT", "TURN", "STOP"},
        {"KATA", "DOJO", "5 KYU", "HERE"},   {"STEP", "BY", "STEP", "1234"},     {"LOOK", "ALL", "ROUND", "360"},
        {"BODY", "WORDS", "16", "JOINTS"},   {"JAZZ", "NIGHT", "CLUB", "47"},
    };
    const char *const *line = lines[s->seed % 8];
    struct rgb c = hex(s->scheme[0]);
    float band = s->h / 4;
    int row = (int)minf(3, maxf(0, floorf((s->h - s->y) / band)));
    if ((row + (int)(s->seed / 8)) % 2)
        c = hex(s->scheme[1 + s->seed % 4]);
    float scale = minf(0.86f * s->w / text_width(line[row]), 0.62f * band / 6);
    float left = (s->w - scale * text_width(line[row])) / 2, low = s->h - ((float)row + 0.81f) * band;
    float d = text_distance(line[row], (s->x - left) / scale, (s->y - low) / scale) * scale;
    struct rgb ink = (row + (int)(s->seed / 8)) % 2 ? hex(s->scheme[0]) : hex(s->scheme[1 + (s->seed + 1) % 4]);
    return mix(c, ink, cover(d - 0.62f * scale, s->texel));
}

static struct rgb books(const struct paint_spot *s)
{
    float shelf = s->h / 5;
    int row = (int)minf(4, floorf(s->y / shelf));
    float y = s->y - (float)row * shelf, x = 0.02f;
    struct rgb wood = dim(hex(0x8a6642), 0.85f + 0.3f * noise2(s->x * 6, s->y * 90, s->seed));
    if (y < 0.022f || s->x < 0.02f || s->x > s->w - 0.02f || s->y > s->h - 0.02f)
        return wood;
    for (uint32_t k = 0; k < 60; k++) {
        uint32_t id = hash_of(k, (uint32_t)row, s->seed);
        float wide = 0.016f + 0.030f * hash_unit(id, 1, 0), tall = shelf * (0.58f + 0.30f * hash_unit(id, 2, 0));
        if (hash_unit(id, 9, 0) < 0.06f)
            wide += 0.05f, tall = 0; // a gap
        if (s->x < x + wide) {
            float in = (s->x - x) / wide;
            if (y - 0.022f > tall || s->x > s->w - 0.02f - wide * (1 - in))
                return dim(hex(0x3a2c20), 0.5f + 0.3f * y / shelf);
            struct rgb c = dim(hex(schemes[id % 6][(id >> 8) % 5]), 0.85f);
            float round = 1 - 1.3f * (in - 0.5f) * (in - 0.5f);
            float t = (y - 0.022f) / tall;
            if ((t > 0.12f && t < 0.16f) || (t > 0.80f && t < 0.85f))
                c = mix(c, hex(0xf3e3b0), 0.8f);
            if (t > 0.3f && t < 0.7f && fabsf(in - 0.5f) < 0.22f && hash_unit((uint32_t)(t * 40), id, 3) < 0.7f)
                c = mix(c, id & 64 ? hex(0xf7f2e5) : hex(0x22252b), 0.8f);
            return dim(c, round * (in < 0.04f || in > 0.96f ? 0.4f : 1));
        }
        x += wide;
    }
    return wood;
}

static struct rgb rug(const struct paint_spot *s)
{
    float in = minf(minf(s->x, s->w - s->x), minf(s->y, s->h - s->y));
    float weave = 0.86f + 0.28f * noise2(s->x * 260, s->y * 260, 5);
    float a = s->x - s->w / 2, b = s->y - s->h / 2;
    struct rgb c = hex(0x7d2e34);
    if (in < 0.03f) {
        c = hash_unit((uint32_t)(s->y * 160), 3, 1) < 0.5f ? hex(0xe9dcc0) : hex(0xc9b38c);
    } else if (in < 0.09f) {
        c = hex(0x27364f);
    } else if (in < 0.22f && fabsf(a) > s->w / 2 - 0.22f && fabsf(b) > s->h / 2 - 0.22f) {
        c = in > 0.13f && in < 0.18f ? hex(0xd9a441) : hex(0x27364f); // its corners
    } else if (in < 0.22f) {                                          // a border of lozenges
        float p = fmodf(fabsf(fabsf(a) > s->w / 2 - 0.22f ? b : a), 0.13f) / 0.13f - 0.5f, q = (in - 0.155f) / 0.13f;
        c = fabsf(p) + fabsf(q) < 0.26f ? hex(0xd9a441) : fabsf(p) + fabsf(q) < 0.42f ? hex(0xe9dcc0) : hex(0x7d2e34);
    } else if (in < 0.25f) {
        c = hex(0xe9dcc0);
    } else {
        float r = sqrtf(a * a * 0.62f + b * b);
        float k = fmodf(r * 7.5f + 0.18f * cosf(8 * atan2f(b, a)), 1);
        float lozenge = fabsf(fmodf(fabsf(a) + 0.15f, 0.3f) - 0.15f) + fabsf(fmodf(fabsf(b) + 0.15f, 0.3f) - 0.15f);
        c = r < 0.62f ? (k < 0.30f   ? hex(0x27364f)
                         : k < 0.5f  ? hex(0xd9a441)
                         : k < 0.62f ? hex(0xe9dcc0)
                                     : hex(0x8f353b))
                      : (lozenge < 0.06f   ? hex(0xe9dcc0)
                         : lozenge < 0.10f ? hex(0x27364f)
                                           : hex(0x8a3238));
    }
    return dim(c, weave);
}

static struct rgb window_view(const struct paint_spot *s)
{
    float u = s->x / s->w, v = s->y / s->h;
    float frame = minf(minf(s->x, s->w - s->x), minf(s->y, s->h - s->y));
    float bar = minf(fabsf(s->x - s->w / 2), fabsf(s->y - 0.62f * s->h));
    if (frame < 0.06f || bar < 0.018f) {
        float edge = frame < 0.06f ? minf(frame, 0.06f - frame) : bar;
        return dim(hex(0xe8e4da), edge < 0.006f && frame < 0.06f ? 0.45f : 0.62f);
    }
    struct rgb c = mix(hex(0xcfe6f5), hex(0x6fa8dc), v);
    c = mix(c, hex(0xffffff), 1.6f * maxf(0, fractal2(u * 4, v * 7, 5, s->seed) - 0.5f));
    for (int layer = 0; layer < 3; layer++) {
        float height =
            0.46f - 0.12f * (float)layer + 0.16f * (fractal2(u * 3 + (float)layer * 5, 0.5f, 4, s->seed + 3) - 0.5f);
        if (layer == 2)
            height += 0.05f * noise2(u * 26, 0, s->seed);
        struct rgb land = mix(hex(0x9dbfa6), hex(0x3f6f3a), 0.5f * (float)layer);
        land = dim(land, 0.75f + 0.5f * fractal2(u * 40, v * 40, 3, s->seed + 9));
        c = mix(c, land, cover((v - height) * s->h, s->texel));
    }
    return c;
}

static struct rgb door(const struct paint_spot *s)
{
    float frame = minf(minf(s->x, s->w - s->x), s->h - s->y);
    struct rgb c = hex(0xd8cdb8);
    if (frame < 0.07f)
        return dim(c, frame > 0.064f ? 0.35f : 0.95f);
    c = dim(hex(0x6b8f8a), 0.93f + 0.14f * noise2(s->x * 60, s->y * 5, s->seed));
    float px = fabsf(fabsf(s->x - s->w / 2) - 0.17f) - 0.12f;
    float py = fabsf(s->y - (s->y < 0.95f ? 0.52f : 1.42f)) - (s->y < 0.95f ? 0.32f : 0.42f);
    float panel = maxf(px, py);
    if (panel > -0.03f && panel < 0)
        c = dim(c, px > py ? 0.62f : 1.18f);
    float knob = hypotf(s->x - (s->w - 0.14f), s->y - 1.0f);
    return mix(c, dim(hex(0xd9b24c), 1.1f - 12 * knob), cover(knob - 0.03f, s->texel));
}

static struct rgb drawers(const struct paint_spot *s)
{
    float wide = s->w / 3;
    float x = fmodf(s->x, wide), y = fmodf(s->y, s->h / 2);
    float edge = minf(minf(x, wide - x), minf(y, s->h / 2 - y));
    struct rgb c = dim(hex(0x3c7a80), 0.94f + 0.12f * noise2(s->x * 8, s->y * 70, s->seed));
    c = mix(c, hex(0x14282b), cover(edge - 0.006f, s->texel));
    float knob = hypotf(x - wide / 2, y - s->h / 4);
    return mix(c, dim(hex(0xe8c15a), 1.2f - 20 * knob), cover(knob - 0.02f, s->texel));
}

static struct rgb pixel_of(enum painting kind, const struct paint_spot *s)
{
    switch (kind) {
    case PAINTING_LANDSCAPE: return landscape(s);
    case PAINTING_CIRCLES: return circles(s);
    case PAINTING_MAP: return contours(s);
    case PAINTING_STRIPES: return stripes(s);
    case PAINTING_NIGHT: return night(s);
    case PAINTING_WORDS: return words(s);
    case PAINTING_BOOKS: return books(s);
    case PAINTING_RUG: return rug(s);
    case PAINTING_WINDOW: return window_view(s);
    case PAINTING_DOOR: return door(s);
    case PAINTING_DRAWERS: return drawers(s);
    }
    return hex(0xffffff);
}

enum status paint(struct texture *t, enum painting kind, double width_m, double height_m, double texel_m, uint32_t seed)
{
    int w = (int)most(4, width_m / texel_m), h = (int)most(4, height_m / texel_m);
    enum status status = texture_make(t, w, h);
    if (status)
        return status;
    bool paper = kind < PAINTING_KIND_COUNT;
    float margin = paper ? 0.028f : 0; // a white margin and a thin dark frame
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            float px = ((float)x + 0.5f) / (float)w * (float)width_m,
                  py = ((float)y + 0.5f) / (float)h * (float)height_m;
            float edge = minf(minf(px, (float)width_m - px), minf(py, (float)height_m - py));
            struct rgb c;
            if (edge < margin) {
                c = edge < 0.010f ? hex(0x2c2622) : hex(0xf3efe6);
            } else {
                struct paint_spot s = {px - margin,
                                       py - margin,
                                       (float)width_m - 2 * margin,
                                       (float)height_m - 2 * margin,
                                       (float)texel_m,
                                       seed,
                                       schemes[seed % 6]};
                c = pixel_of(kind, &s);
            }
            texture_set(t, x, y, (float[3]){0.9f * c.r, 0.9f * c.g, 0.9f * c.b});
        }
    texture_finish(t);
    return OK;
}

// Noise with a period of `period` units in both directions.
static float tile_noise(float x, float y, int period_x, int period_y, uint32_t seed)
{
    float fx = floorf(x), fy = floorf(y), a = x - fx, b = y - fy;
    a = a * a * (3 - 2 * a), b = b * b * (3 - 2 * b);
    uint32_t i0 = (uint32_t)((int)fx % period_x), i1 = (uint32_t)(((int)fx + 1) % period_x);
    uint32_t j0 = (uint32_t)((int)fy % period_y), j1 = (uint32_t)(((int)fy + 1) % period_y);
    float top = hash_unit(i0, j0, seed) * (1 - a) + hash_unit(i1, j0, seed) * a;
    float low = hash_unit(i0, j1, seed) * (1 - a) + hash_unit(i1, j1, seed) * a;
    return top * (1 - b) + low * b;
}

enum status paint_grain(struct texture *t, uint32_t seed)
{
    enum status status = texture_make(t, 2 * TILE_TEXELS, TILE_TEXELS);
    if (status)
        return status;
    for (int y = 0; y < TILE_TEXELS; y++)
        for (int x = 0; x < 2 * TILE_TEXELS; x++) {
            float u = (float)x / (2 * TILE_TEXELS), v = (float)y / TILE_TEXELS;
            float wave = tile_noise(u * 4, v * 6, 4, 6, seed) * 3 + tile_noise(u * 8, v * 12, 8, 12, seed + 1);
            float ring = v * 22 + wave * 1.6f;
            float line = fabsf(ring - floorf(ring) - 0.5f) * 2;
            float fibre = tile_noise(u * 12, v * 128, 12, 128, seed + 2),
                  pore = tile_noise(u * 48, v * 256, 48, 256, seed + 3);
            float c = 0.52f + 0.14f * (line * line - 0.4f) + 0.10f * (fibre - 0.5f) - 0.16f * maxf(0, pore - 0.8f) * 5;
            texture_set(t, x, y, (float[3]){c, c, c});
        }
    texture_finish(t);
    return OK;
}

enum status paint_plaster(struct texture *t, uint32_t seed)
{
    enum status status = texture_make(t, TILE_TEXELS, TILE_TEXELS);
    if (status)
        return status;
    for (int y = 0; y < TILE_TEXELS; y++)
        for (int x = 0; x < TILE_TEXELS; x++) {
            float u = (float)x / TILE_TEXELS, v = (float)y / TILE_TEXELS;
            float c = 0.46f + 0.03f * tile_noise(u * 8, v * 8, 8, 8, seed) +
                      0.03f * tile_noise(u * 32, v * 32, 32, 32, seed + 1) +
                      0.02f * tile_noise(u * 128, v * 128, 128, 128, seed + 2);
            texture_set(t, x, y, (float[3]){c, c, c});
        }
    texture_finish(t);
    return OK;
}
