#include "reenact/observation/depth_frame_cache.h"

#include <stdlib.h>
#include <string.h>

enum { PIXEL_BYTES = 5 }; // depth, part, edge, half

struct kept {
    uint8_t *bytes; // of a window of the picture: its depth, then its part, edge and half; NULL: not kept
    int left, top, width, height;
    struct sight sight; // bounds and mask alone
};

struct sights {
    struct take *take;
    int64_t *frames;
    struct kept *kept; // of each frame
    int count;
    size_t bytes, max_bytes;
};

enum status sights_open(struct sights **out, struct take *take, const int64_t *frames, int count, size_t max_bytes)
{
    struct sights *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->take = take;
    s->count = count;
    s->max_bytes = max_bytes;
    s->frames = malloc(sizeof *s->frames * (size_t)count);
    s->kept = calloc((size_t)count, sizeof *s->kept);
    if (!s->frames || !s->kept) {
        sights_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    memcpy(s->frames, frames, sizeof *s->frames * (size_t)count);
    return OK;
}

void sights_close(struct sights **out)
{
    struct sights *s = *out;
    if (!s)
        return;
    for (int i = 0; i < s->count && s->kept; i++)
        free(s->kept[i].bytes);
    free(s->kept);
    free(s->frames);
    free(s);
    *out = NULL;
}

static int at_least(int value, int least) { return value > least ? value : least; }
static int at_most(int value, int most) { return value < most ? value : most; }

// The window that is kept: as far about the person as edges are told.
static void set_window(struct kept *k, const struct sight *s)
{
    k->left = at_least(s->left - SIGHT_EDGE_MOST, 0);
    k->top = at_least(s->top - SIGHT_EDGE_MOST, 0);
    k->width = at_most(s->right + SIGHT_EDGE_MOST, s->width - 1) + 1 - k->left;
    k->height = at_most(s->bottom + SIGHT_EDGE_MOST, s->height - 1) + 1 - k->top;
}

static void keep(struct sights *all, int i, const struct sight *s)
{
    struct kept *k = &all->kept[i];
    if (s->right < s->left)
        return;
    set_window(k, s);
    size_t pixels = (size_t)k->width * (size_t)k->height, row = (size_t)k->width;
    if (all->bytes + PIXEL_BYTES * pixels > all->max_bytes)
        return;
    k->bytes = malloc(PIXEL_BYTES * pixels);
    if (!k->bytes)
        return; // read anew instead
    all->bytes += PIXEL_BYTES * pixels;
    k->sight = *s;
    uint8_t *part = k->bytes + 2 * pixels, *edge = part + pixels, *half = edge + pixels;
    for (int y = 0; y < k->height; y++) {
        size_t from = (size_t)(k->top + y) * (size_t)s->width + (size_t)k->left, to = (size_t)y * row;
        memcpy(k->bytes + 2 * to, s->depth + from, 2 * row);
        memcpy(part + to, s->part + from, row);
        memcpy(edge + to, s->edge + from, row);
        memcpy(half + to, s->half + from, row);
    }
}

static void bring(const struct kept *k, struct sight *s)
{
    size_t pixels = (size_t)k->width * (size_t)k->height, row = (size_t)k->width,
           all = (size_t)s->width * (size_t)s->height;
    const uint8_t *part = k->bytes + 2 * pixels, *edge = part + pixels, *half = edge + pixels;
    s->has_mask = k->sight.has_mask;
    s->left = k->sight.left, s->top = k->sight.top, s->right = k->sight.right, s->bottom = k->sight.bottom;
    memset(s->depth, 0, sizeof *s->depth * all);
    memset(s->part, SIGHT_ROOM, all);
    memset(s->edge, SIGHT_EDGE_MOST, all);
    memset(s->half, UINT8_MAX, all);
    for (int y = 0; y < k->height; y++) {
        size_t to = (size_t)(k->top + y) * (size_t)s->width + (size_t)k->left, from = (size_t)y * row;
        memcpy(s->depth + to, k->bytes + 2 * from, 2 * row);
        memcpy(s->part + to, part + from, row);
        memcpy(s->edge + to, edge + from, row);
        memcpy(s->half + to, half + from, row);
    }
}

enum status sights_read(struct sights *s, int i, struct sight *into)
{
    assert(i >= 0 && i < s->count);
    if (s->kept[i].bytes) {
        bring(&s->kept[i], into);
        return OK;
    }
    enum status status = sight_read(into, s->take, s->frames[i]);
    if (status == OK)
        keep(s, i, into);
    return status;
}
