#include "surround/depth/dense_depth.h"

#include "surround/depth/depth_seeds.h"
#include "surround/depth/large_planes.h"
#include "surround/depth/watershed.h"
#include "surround/picture/surround_mesh.h"
#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

struct depth_options depth_default_options(void)
{
    return (struct depth_options){
        .upright = true, .sparse = true, .reach = 24, .tolerance = 0.012, .nearest_m = 0.3, .farthest_m = 150};
}

// A pixel of the sky is reached from the top row without an edge, and coloured like the top.
enum { SKY_EDGE = 7, SKY_APART = 60 };
// Most difference of a channel between colours of one thing.
enum { OTHER_COLOR = 40 };
// No segment grows over an edge above this: what has no point of its own beyond it is continued from what stands below
// (a post taller than its points), not taken for what is beside it. The one value that was tried.
enum { MOST_EDGE = 30 };

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

// Gives a free pixel a seed's plane, unless that does not meet its ray.
static bool give(struct surround_picture *p, const struct depth_seeds *s, int32_t *label, size_t pixel, int32_t seed)
{
    float ray[3];
    surround_picture_ray(p, (int)(pixel % (size_t)p->width), (int)(pixel / (size_t)p->width), ray);
    const float inverse = dot(s->list[seed].plane, ray);
    if (!(inverse > 1e-4f && inverse < 10))
        return false;
    p->inverse[pixel] = inverse;
    label[pixel] = seed;
    return true;
}

// The one of two seeds (negative: none) whose plane is the farther along a pixel's ray.
static int32_t farther(const struct surround_picture *p, const struct depth_seeds *s, size_t pixel, int32_t a,
                       int32_t b)
{
    float ray[3];
    if (a < 0 || b < 0)
        return a < 0 ? b : a;
    surround_picture_ray(p, (int)(pixel % (size_t)p->width), (int)(pixel / (size_t)p->width), ray);
    const float x = dot(s->list[a].plane, ray), y = dot(s->list[b].plane, ray);
    if (x <= 0)
        return b;
    return y <= 0 || x < y ? a : b;
}

// Whether a seed's plane passes behind another's along a pixel's ray.
static bool behind(const struct surround_picture *p, const struct depth_seeds *s, size_t pixel, int32_t a, int32_t b)
{
    float ray[3];
    surround_picture_ray(p, (int)(pixel % (size_t)p->width), (int)(pixel / (size_t)p->width), ray);
    const float x = dot(s->list[a].plane, ray), y = dot(s->list[b].plane, ray);
    return x > 0 && x < 0.92f * y;
}

// Continues a column's surfaces into its unknown pixels. Between two surfaces that both reach a pixel the farther is
// taken: nothing is put in front of what was seen.
static void fill_column(struct surround_picture *p, const struct depth_seeds *s, int32_t *label, const int32_t *segment,
                        int u)
{
    const size_t w = (size_t)p->width;
    for (int v = p->height - 1; v >= 0; v--) {
        int32_t *at = label + (size_t)v * w + (size_t)u;
        if (*at != WATERSHED_FREE)
            continue;
        int top = v;
        while (top > 0 && label[(size_t)(top - 1) * w + (size_t)u] == WATERSHED_FREE)
            top--;
        int32_t below = v + 1 < p->height ? at[w] : WATERSHED_FREE;
        int32_t above = top > 0 ? label[(size_t)(top - 1) * w + (size_t)u] : WATERSHED_FREE;
        if (below >= 0 && above < 0 && !stands(s, s->list[below].plane))
            below = WATERSHED_FREE;
        if (above >= 0 && below < 0 && !lies(s, s->list[above].plane))
            above = WATERSHED_FREE;
        for (int y = top; y <= v && (below >= 0 || above >= 0); y++) {
            const size_t pixel = (size_t)y * w + (size_t)u;
            int32_t chosen = farther(p, s, pixel, below, above);
            // Above the top of something low the image has the colour of what stands behind it
            if (above < 0 && segment[pixel] >= 0 &&
                apart(p->rgb + 3 * pixel, p->rgb + 3 * ((size_t)(v + 1) * w + (size_t)u)) > OTHER_COLOR &&
                behind(p, s, pixel, segment[pixel], below))
                chosen = segment[pixel];
            give(p, s, label, pixel, chosen);
        }
        v = top;
    }
}

// The segments grown over the whole image from what stands upright; WATERSHED_FREE where none reaches. NULL: no memory.
static int32_t *grow_upright(const struct surround_picture *p, const struct depth_seeds *s, const int32_t *label)
{
    const size_t pixels = (size_t)p->width * (size_t)p->height;
    int32_t *segment = alloc_cache_aligned(pixels * sizeof *segment);
    for (size_t i = 0; segment && i < pixels; i++)
        segment[i] = label[i] < 0 || stands(s, s->list[label[i]].plane) ? label[i] : WATERSHED_BARRED;
    if (segment && watershed_grow(p, p->width / 2, 255, segment) == OK)
        return segment;
    free(segment);
    return NULL;
}

// What is left between two surfaces of a row, or not far beside one.
static void fill_row(struct surround_picture *p, const struct depth_seeds *s, int32_t *label, int v)
{
    const size_t row = (size_t)v * (size_t)p->width;
    for (int u = 0; u < p->width; u++) {
        if (label[row + (size_t)u] != WATERSHED_FREE)
            continue;
        int end = u;
        while (end + 1 < p->width && label[row + (size_t)end + 1] == WATERSHED_FREE)
            end++;
        const int32_t left = u > 0 ? label[row + (size_t)u - 1] : WATERSHED_FREE;
        const int32_t right = end + 1 < p->width ? label[row + (size_t)end + 1] : WATERSHED_FREE;
        for (int x = u; x <= end && (left >= 0 || right >= 0); x++) {
            const size_t pixel = row + (size_t)x;
            const bool between = left >= 0 && right >= 0;
            const int beside = left >= 0 ? x - u : end - x;
            if (between || beside <= p->width / 64)
                give(p, s, label, pixel, farther(p, s, pixel, left, right));
        }
        u = end;
    }
}

// Extrapolates the segments' surfaces into what no segment reaches, and marks it so.
static enum status extrapolate_surfaces(struct surround_picture *p, const struct depth_seeds *s, int32_t *label)
{
    const size_t pixels = (size_t)p->width * (size_t)p->height;
    int32_t *segment = grow_upright(p, s, label);
    bool *reached = malloc(pixels * sizeof *reached);
    if (!segment || !reached) {
        free(segment);
        free(reached);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (size_t i = 0; i < pixels; i++)
        reached[i] = label[i] != WATERSHED_FREE;
    for (int u = 0; u < p->width; u++)
        fill_column(p, s, label, segment, u);
    free(segment);
    for (int v = 0; v < p->height; v++)
        fill_row(p, s, label, v);
    surround_picture_join(p);
    for (size_t i = 0; i < pixels; i++)
        if (!reached[i])
            p->joined[i] |= DEPTH_EXTRAPOLATED;
    free(reached);
    return OK;
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
    enum status status = watershed_grow(p, reach, how->upright ? MOST_EDGE : 255, label);
    if (status != OK)
        return status;
    fill_segments(p, s, label);
    if (how->upright)
        return extrapolate_surfaces(p, s, label);
    surround_picture_join(p);
    return OK;
}

enum status dense_depth_make(struct surround_picture *picture, const struct world_points *points,
                             const struct depth_options *how)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    surround_picture_free_mesh(picture);
    if (!picture->inverse)
        picture->inverse = alloc_cache_aligned(pixels * sizeof *picture->inverse);
    if (!picture->joined)
        picture->joined = alloc_cache_aligned(pixels);
    int32_t *label = alloc_cache_aligned(pixels * sizeof *label);
    struct depth_seeds seeds = {0};
    enum status status = picture->inverse && picture->joined && label ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = depth_seeds_make(&seeds, picture, points, how);
    if (status == OK && how->walls)
        status = large_planes_snap(&seeds);
    if (status == OK)
        status = make(picture, &seeds, how, label);
    depth_seeds_free(&seeds);
    free(label);
    return status;
}
