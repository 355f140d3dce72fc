#include "reenact/surround/depth/dense_depth.h"

#include "reenact/surround/depth/depth_seeds.h"
#include "reenact/surround/depth/watershed.h"
#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

struct depth_options depth_default_options(void)
{
    return (struct depth_options){
        .upright = true, .reach = 24, .tolerance = 0.012, .nearest_m = 0.3, .farthest_m = 150};
}

// A pixel of the sky is reached from the top row without an edge, and coloured like the top.
enum { SKY_EDGE = 7, SKY_APART = 60 };

static int apart(const uint8_t *a, const uint8_t *b)
{
    int most = 0;
    for (int c = 0; c < 3; c++) {
        const int d = abs((int)a[c] - (int)b[c]);
        most = d > most ? d : most;
    }
    return most;
}

static void bar_sky(const struct surround_picture *p, int32_t *label, int32_t *stack)
{
    const int w = p->width, h = p->height;
    int n = 0;
    for (int u = 0; u < w; u++)
        stack[n++] = u, label[u] = WATERSHED_BARRED;
    while (n) {
        const int32_t from = stack[--n];
        const int u = from % w, v = from / w;
        for (int k = 0; k < 4; k++) {
            const int x = (u + (k == 0) - (k == 1) + w) % w, y = v + (k == 2) - (k == 3);
            if (y < 0 || y >= h)
                continue;
            const int32_t to = y * w + x;
            const uint8_t *color = p->rgb + 3 * (size_t)to;
            if (label[to] != WATERSHED_FREE || apart(color, p->rgb + 3 * (size_t)from) > SKY_EDGE ||
                apart(color, p->rgb + 3 * (size_t)x) > SKY_APART)
                continue;
            label[to] = WATERSHED_BARRED;
            stack[n++] = to;
        }
    }
}

static float dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void fill_segments(struct surround_picture *p, const struct depth_seeds *s, const int32_t *label)
{
    for (int v = 0; v < p->height; v++)
        for (int u = 0; u < p->width; u++) {
            const size_t i = (size_t)v * (size_t)p->width + (size_t)u;
            p->inverse[i] = label[i] == WATERSHED_BARRED ? 0 : DEPTH_UNKNOWN;
            if (label[i] < 0)
                continue;
            const struct seed *seed = &s->list[label[i]];
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            const float inverse = dot(seed->plane, ray);
            p->inverse[i] = inverse > 0.6f * seed->inverse && inverse < 1.6f * seed->inverse ? inverse : seed->inverse;
        }
}

// What stands upright: a plane whose normal is within 25 degrees of level.
static bool stands(const struct depth_seeds *s, const float plane[3])
{
    const float along = dot(plane, s->up);
    return along * along < 0.18f * dot(plane, plane);
}

static bool lies(const struct depth_seeds *s, const float plane[3])
{
    const float along = dot(plane, s->up);
    return along * along > 0.8f * dot(plane, plane);
}

// Continues a column's surfaces into its unknown pixels. Between two surfaces that both reach a pixel the farther is
// taken: nothing is put in front of what was seen.
static void fill_column(struct surround_picture *p, const struct depth_seeds *s, const int32_t *label, int u)
{
    const int w = p->width, h = p->height;
    for (int v = h - 1; v >= 0; v--) {
        if (label[(size_t)v * (size_t)w + (size_t)u] != WATERSHED_FREE)
            continue;
        int top = v;
        while (top > 0 && label[(size_t)(top - 1) * (size_t)w + (size_t)u] == WATERSHED_FREE)
            top--;
        const int32_t low = v + 1 < h ? label[(size_t)(v + 1) * (size_t)w + (size_t)u] : WATERSHED_FREE;
        const int32_t high = top > 0 ? label[(size_t)(top - 1) * (size_t)w + (size_t)u] : WATERSHED_FREE;
        const float *below = low >= 0 ? s->list[low].plane : NULL, *above = high >= 0 ? s->list[high].plane : NULL;
        if (below && !above && !stands(s, below))
            below = NULL;
        if (above && !below && !lies(s, above))
            above = NULL;
        for (int y = top; y <= v && (below || above); y++) {
            float ray[3];
            surround_picture_ray(p, u, y, ray);
            const float a = below ? dot(below, ray) : 1e9f, b = above ? dot(above, ray) : 1e9f;
            const float inverse = a <= 0 ? b : b <= 0 ? a : a < b ? a : b;
            if (inverse > 0 && inverse < 1e8f)
                p->inverse[(size_t)y * (size_t)w + (size_t)u] = inverse;
        }
        v = top;
    }
}

static enum status make(struct surround_picture *p, const struct depth_seeds *s, const struct depth_options *how,
                        int32_t *label)
{
    const size_t pixels = (size_t)p->width * (size_t)p->height;
    memset(label, 0xff, pixels * sizeof *label);
    if (how->sky && p->panorama) {
        int32_t *stack = malloc(pixels * sizeof *stack);
        if (!stack)
            return fail(ERR_MEMORY, "out of memory");
        bar_sky(p, label, stack);
        free(stack);
    }
    for (int i = 0; i < s->count; i++)
        if (!s->list[i].hidden)
            label[(size_t)s->list[i].v * (size_t)p->width + (size_t)s->list[i].u] = i;
    const int reach = p->panorama ? (how->reach * p->height + 512) / 1024 : how->reach;
    enum status status = watershed_grow(p, reach, label);
    if (status != OK)
        return status;
    fill_segments(p, s, label);
    for (int u = 0; how->upright && u < p->width; u++)
        fill_column(p, s, label, u);
    surround_picture_join(p);
    return OK;
}

enum status dense_depth_make(struct surround_picture *picture, const struct world_points *points,
                             const struct depth_options *how)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    if (!picture->inverse)
        picture->inverse = alloc_cache_aligned(pixels * sizeof *picture->inverse);
    if (!picture->joined)
        picture->joined = alloc_cache_aligned(pixels);
    int32_t *label = alloc_cache_aligned(pixels * sizeof *label);
    struct depth_seeds seeds = {0};
    enum status status = picture->inverse && picture->joined && label ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = depth_seeds_make(&seeds, picture, points, how);
    if (status == OK)
        status = make(picture, &seeds, how, label);
    depth_seeds_free(&seeds);
    free(label);
    return status;
}
