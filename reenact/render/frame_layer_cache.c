// Cache of frame layers on the GPU.
#include "reenact/render/frame_layer_cache.h"

#include <stdlib.h>
#include <string.h>

// The frames used last are not evicted: stepping back shows them again. Chosen by hand.
enum { PROTECTED_FRAMES = 16 };

struct cached_layer {
    struct gpu_frame_layer shown;
    int64_t frame, used;
    size_t bytes;
};

struct frame_layer_cache {
    struct gpu *gpu;
    struct frame_source source;
    struct frame_layer_loader *loader; // for the avatar; NULL before the first frame
    struct cached_layer *layers;
    int count, capacity;
    size_t bytes, max_bytes;
    int64_t now; // counts uses
};

enum status frame_layer_cache_open(struct frame_layer_cache **out, struct gpu *gpu, const struct frame_source *source,
                                   size_t max_bytes)
{
    struct frame_layer_cache *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for the cache of frame layers");
    f->gpu = gpu;
    f->source = *source;
    f->max_bytes = max_bytes;
    return OK;
}

static void drop_layer(struct frame_layer_cache *cache, int i)
{
    cache->bytes -= cache->layers[i].bytes;
    gpu_texture_close(&cache->layers[i].shown.color);
    gpu_texture_close(&cache->layers[i].shown.depth);
    free(cache->layers[i].shown.shift);
    free(cache->layers[i].shown.points);
    free(cache->layers[i].shown.triangle_visible);
    cache->layers[i] = cache->layers[--cache->count];
}

void frame_layer_cache_clear(struct frame_layer_cache *cache)
{
    while (cache->count)
        drop_layer(cache, cache->count - 1);
    frame_layer_loader_close(&cache->loader);
}

void frame_layer_cache_close(struct frame_layer_cache **out)
{
    struct frame_layer_cache *f = *out;
    if (!f)
        return;
    frame_layer_cache_clear(f);
    free(f->layers);
    free(f);
    *out = NULL;
}

// Frames from the resident frame before layer i to the one after it, cyclically over the take.
static int64_t neighbor_gap(const struct frame_layer_cache *cache, int i)
{
    const int64_t frames = take_frame_count(cache->source.take);
    int64_t before = frames, after = frames;
    for (int k = 0; k < cache->count; k++) {
        const int64_t on = (cache->layers[k].frame - cache->layers[i].frame + frames) % frames;
        if (k == i)
            continue;
        after = on < after ? on : after;
        before = frames - on < before ? frames - on : before;
    }
    return before + after;
}

// The layer to evict: among those not used recently, the one with the smallest neighbour gap, so that residents spread
// over the take; if all were used recently, the least recently used.
static int eviction_candidate(const struct frame_layer_cache *cache)
{
    const int64_t longest = 2 * take_frame_count(cache->source.take);
    int min = 0;
    int64_t least_worth = INT64_MAX;
    for (int i = 0; i < cache->count; i++) {
        const bool recent = cache->layers[i].used > cache->now - PROTECTED_FRAMES;
        const int64_t worth = recent ? longest + cache->layers[i].used : neighbor_gap(cache, i);
        if (worth < least_worth)
            least_worth = worth, min = i;
    }
    return min;
}

static enum status evict_until_fits(struct frame_layer_cache *cache, size_t bytes)
{
    while (cache->count && cache->bytes + bytes > cache->max_bytes)
        drop_layer(cache, eviction_candidate(cache));
    if (cache->count < cache->capacity)
        return OK;
    int capacity = cache->capacity ? 2 * cache->capacity : 16;
    struct cached_layer *layers = realloc(cache->layers, sizeof *layers * (size_t)capacity);
    if (!layers)
        return fail(ERR_MEMORY, "no memory for the cache of frame layers");
    cache->layers = layers;
    cache->capacity = capacity;
    return OK;
}

static enum status upload_image(struct gpu_texture **out, struct gpu *gpu, enum gpu_format format,
                                enum gpu_filter filter, const struct frame_layer_image *image)
{
    return gpu_texture_open(out, gpu, &(struct gpu_texture_layout){format, image->width, image->height, filter},
                            image->pixels);
}

static enum status insert_layer(struct frame_layer_cache *cache, struct frame_layer *loaded)
{
    const size_t bytes = frame_layer_bytes(loaded);
    enum status status = evict_until_fits(cache, bytes);
    if (status != OK)
        return status;
    struct cached_layer *layer = &cache->layers[cache->count++];
    *layer = (struct cached_layer){.frame = loaded->frame, .used = ++cache->now, .bytes = bytes};
    cache->bytes += bytes;
    struct gpu_frame_layer *gpu_frame_layer = &layer->shown;
    gpu_frame_layer->corrections = loaded->corrections;
    gpu_frame_layer->shift = loaded->shift;
    gpu_frame_layer->points = loaded->points;
    gpu_frame_layer->triangle_visible = loaded->triangle_visible;
    loaded->shift = NULL;
    loaded->points = NULL;
    loaded->triangle_visible = NULL;
    status = upload_image(&gpu_frame_layer->depth, cache->gpu, GPU_RGBA8, GPU_NEAREST, &loaded->depth);
    if (status == OK)
        status = upload_image(&gpu_frame_layer->color, cache->gpu, GPU_RGB8, GPU_LINEAR, &loaded->color);
    if (status != OK)
        drop_layer(cache, cache->count - 1);
    return status;
}

static int find_layer(const struct frame_layer_cache *cache, int64_t frame)
{
    int i = 0;
    while (i < cache->count && cache->layers[i].frame != frame)
        i++;
    return i;
}

static bool frame_layer_cache_has(const struct frame_layer_cache *cache, int64_t frame)
{
    return find_layer(cache, frame) < cache->count;
}

int64_t frame_layer_cache_nearest(const struct frame_layer_cache *cache, int64_t frame, int64_t within_ns)
{
    const int64_t at_ns = take_entry(cache->source.take, frame)->time_ns;
    int64_t best = -1, best_ns = within_ns;
    for (int i = 0; i < cache->count; i++) {
        const int64_t away_ns = llabs(take_entry(cache->source.take, cache->layers[i].frame)->time_ns - at_ns);
        const bool nearer = best < 0 || away_ns < best_ns || (away_ns == best_ns && cache->layers[i].frame < best);
        if (away_ns <= within_ns && nearer)
            best = cache->layers[i].frame, best_ns = away_ns;
    }
    return best;
}

enum status frame_layer_cache_add(struct frame_layer_cache *f, struct frame_layer *loaded)
{
    enum status status = frame_layer_cache_has(f, loaded->frame) ? OK : insert_layer(f, loaded);
    frame_layer_free(loaded);
    return status;
}

static enum status load_layer(struct frame_layer_cache *cache, const struct avatar *avatar, int64_t frame)
{
    struct frame_layer loaded;
    enum status status = cache->loader ? OK : frame_layer_loader_open(&cache->loader, &cache->source, avatar);
    if (status == OK)
        status = frame_layer_loader_load(cache->loader, frame, &loaded);
    return status == OK ? frame_layer_cache_add(cache, &loaded) : status;
}

enum status frame_layer_cache_get(struct frame_layer_cache *f, const struct avatar *avatar, int64_t frame,
                                  const struct gpu_frame_layer **out)
{
    if (!frame_layer_cache_has(f, frame)) {
        enum status status = load_layer(f, avatar, frame);
        if (status != OK)
            return status;
    }
    struct cached_layer *k = &f->layers[find_layer(f, frame)];
    if (k->used != f->now)
        k->used = ++f->now;
    *out = &k->shown;
    return OK;
}
