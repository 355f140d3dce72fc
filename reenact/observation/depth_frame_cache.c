#include "reenact/observation/depth_frame_cache.h"

#include <stdlib.h>
#include <string.h>

enum { PIXEL_BYTES = 5 }; // depth 2, part, edge_distance and half_width 1 each

struct cached_window {
    uint8_t *bytes; // planes of the window: depth, part, edge_distance, half_width; NULL: not kept
    int left, top, width, height;
    struct depth_frame bounds; // only the actor's bounds and has_mask are used
};

struct depth_frame_cache {
    struct frame_source source;
    int64_t *frames;
    struct cached_window *windows; // of each frame
    int count;
    size_t bytes, max_bytes;
};

enum status depth_frame_cache_open(struct depth_frame_cache **out, const struct frame_source *source,
                                   const int64_t *frames, int count, size_t max_bytes)
{
    struct depth_frame_cache *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->source = *source;
    s->count = count;
    s->max_bytes = max_bytes;
    s->frames = malloc(sizeof *s->frames * (size_t)count);
    s->windows = calloc((size_t)count, sizeof *s->windows);
    if (!s->frames || !s->windows) {
        depth_frame_cache_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    memcpy(s->frames, frames, sizeof *s->frames * (size_t)count);
    return OK;
}

void depth_frame_cache_close(struct depth_frame_cache **out)
{
    struct depth_frame_cache *s = *out;
    if (!s)
        return;
    for (int i = 0; i < s->count && s->windows; i++)
        free(s->windows[i].bytes);
    free(s->windows);
    free(s->frames);
    free(s);
    *out = NULL;
}

static int at_least(int value, int least) { return value > least ? value : least; }
static int at_most(int value, int most) { return value < most ? value : most; }

// The window that is kept: the actor's bounds, and as far about them as edge distances are measured.
static void set_window(struct cached_window *k, const struct depth_frame *s)
{
    k->left = at_least(s->left - DEPTH_FRAME_MAX_EDGE_PX, 0);
    k->top = at_least(s->top - DEPTH_FRAME_MAX_EDGE_PX, 0);
    k->width = at_most(s->right + DEPTH_FRAME_MAX_EDGE_PX, s->width - 1) + 1 - k->left;
    k->height = at_most(s->bottom + DEPTH_FRAME_MAX_EDGE_PX, s->height - 1) + 1 - k->top;
}

static void store_window(struct depth_frame_cache *all, int i, const struct depth_frame *s)
{
    struct cached_window *k = &all->windows[i];
    if (s->right < s->left)
        return;
    set_window(k, s);
    size_t pixels = (size_t)k->width * (size_t)k->height, row = (size_t)k->width;
    if (all->bytes + PIXEL_BYTES * pixels > all->max_bytes)
        return;
    k->bytes = malloc(PIXEL_BYTES * pixels);
    if (!k->bytes)
        return; // it is read from the take each time instead
    all->bytes += PIXEL_BYTES * pixels;
    k->bounds = *s;
    uint8_t *part = k->bytes + 2 * pixels, *edge = part + pixels, *half = edge + pixels;
    for (int y = 0; y < k->height; y++) {
        size_t from = (size_t)(k->top + y) * (size_t)s->width + (size_t)k->left, to = (size_t)y * row;
        memcpy(k->bytes + 2 * to, s->depth + from, 2 * row);
        memcpy(part + to, s->part + from, row);
        memcpy(edge + to, s->edge_distance + from, row);
        memcpy(half + to, s->half_width + from, row);
    }
}

static void restore_window(const struct cached_window *k, struct depth_frame *s)
{
    size_t pixels = (size_t)k->width * (size_t)k->height, row = (size_t)k->width,
           all = (size_t)s->width * (size_t)s->height;
    const uint8_t *part = k->bytes + 2 * pixels, *edge = part + pixels, *half = edge + pixels;
    s->has_mask = k->bounds.has_mask;
    s->left = k->bounds.left, s->top = k->bounds.top, s->right = k->bounds.right, s->bottom = k->bounds.bottom;
    memset(s->depth, 0, sizeof *s->depth * all);
    memset(s->part, DEPTH_FRAME_BACKGROUND, all);
    memset(s->edge_distance, DEPTH_FRAME_MAX_EDGE_PX, all);
    memset(s->half_width, UINT8_MAX, all);
    for (int y = 0; y < k->height; y++) {
        size_t to = (size_t)(k->top + y) * (size_t)s->width + (size_t)k->left, from = (size_t)y * row;
        memcpy(s->depth + to, k->bytes + 2 * from, 2 * row);
        memcpy(s->part + to, part + from, row);
        memcpy(s->edge_distance + to, edge + from, row);
        memcpy(s->half_width + to, half + from, row);
    }
}

static void copy_colors(const struct depth_frame_cache *s, const struct take_images *images, uint8_t *rgb)
{
    const struct lens *lens = &take_calibration(s->source.take)->color;
    memcpy(rgb, images->color, 3 * (size_t)lens->width * (size_t)lens->height);
}

enum status depth_frame_cache_read(struct depth_frame_cache *s, int i, struct depth_frame *into, uint8_t *rgb)
{
    assert(i >= 0 && i < s->count);
    const bool is_kept = s->windows[i].bytes != NULL;
    const struct take_entry *e = take_entry(s->source.take, s->frames[i]);
    if (!e->has_depth || !e->has_skeleton)
        return NOTHING;
    struct take_images images;
    const unsigned want = (is_kept ? 0u : TAKE_DEPTH | TAKE_MASK) | (rgb ? TAKE_COLOR : 0u);
    enum status status = take_read(s->source.take, s->frames[i], want, &images);
    if (status != OK)
        return status == ERR_CORRUPT ? NOTHING : status; // a damaged frame costs itself alone
    if (is_kept) {
        restore_window(&s->windows[i], into);
    } else {
        depth_frame_label(into, &images, take_skeletons_at(s->source.skeletons, s->frames[i]));
        store_window(s, i, into);
    }
    if (rgb && !images.color)
        return NOTHING;
    if (rgb)
        copy_colors(s, &images, rgb);
    return OK;
}
