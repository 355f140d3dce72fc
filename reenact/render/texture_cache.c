// LRU cache of source textures and of decoded images.
#include "reenact/render/texture_cache.h"

#include <stdlib.h>

enum { IMAGES = 12, WHOLE = PART_COUNT };

struct cached_texture {
    int64_t frame;
    int part; // or WHOLE
    struct gpu_texture *texture;
    float window[4];
    size_t bytes;
    int64_t used;
};

struct texture_cache {
    struct gpu *gpu;
    struct take *take;
    struct source_rays *rays; // NULL: the take has no depth
    struct cached_texture *entries;
    int count, capacity;
    size_t max_bytes;
    int64_t now;                        // counts uses
    struct source_image images[IMAGES]; // least recently used first out, too
    int64_t image_used[IMAGES];
    size_t bytes; // of the entries
};

enum status texture_cache_open(struct texture_cache **out, struct gpu *gpu, struct take *take, size_t max_bytes)
{
    *out = NULL;
    struct texture_cache *c = calloc(1, sizeof *c);
    if (!c)
        return fail(ERR_MEMORY, "no memory for the cache of textures");
    c->gpu = gpu;
    c->take = take;
    c->max_bytes = max_bytes;
    for (int i = 0; i < IMAGES; i++)
        c->images[i].frame = -1;
    enum status status = OK;
    if (take_calibration(take)->depth.width > 0)
        status = source_rays_open(&c->rays, take_calibration(take));
    if (status != OK) {
        texture_cache_close(&c);
        return status;
    }
    *out = c;
    return OK;
}

void texture_cache_close(struct texture_cache **cache)
{
    if (!*cache)
        return;
    for (int i = 0; i < (*cache)->count; i++)
        gpu_texture_close(&(*cache)->entries[i].texture);
    for (int i = 0; i < IMAGES; i++)
        source_image_free(&(*cache)->images[i]);
    source_rays_close(&(*cache)->rays);
    free((*cache)->entries);
    free(*cache);
    *cache = NULL;
}

static void drop_texture(struct texture_cache *cache, int i)
{
    cache->bytes -= cache->entries[i].bytes;
    gpu_texture_close(&cache->entries[i].texture);
    cache->entries[i] = cache->entries[--cache->count];
}

static enum status evict_until_fits(struct texture_cache *cache, size_t bytes)
{
    while (cache->count && cache->bytes + bytes > cache->max_bytes) {
        int oldest = 0;
        for (int i = 1; i < cache->count; i++)
            if (cache->entries[i].used < cache->entries[oldest].used)
                oldest = i;
        drop_texture(cache, oldest);
    }
    if (cache->count < cache->capacity)
        return OK;
    int capacity = cache->capacity ? cache->capacity * 2 : 64;
    struct cached_texture *entries = realloc(cache->entries, sizeof *entries * (size_t)capacity);
    if (!entries)
        return fail(ERR_MEMORY, "no memory for the cache of textures");
    cache->entries = entries;
    cache->capacity = capacity;
    return OK;
}

static bool find_texture(struct texture_cache *cache, int64_t frame, int part, struct source_texture *out)
{
    for (int i = 0; i < cache->count; i++) {
        struct cached_texture *texture = &cache->entries[i];
        if (texture->frame != frame || texture->part != part)
            continue;
        texture->used = ++cache->now;
        *out = (struct source_texture){
            texture->texture, {texture->window[0], texture->window[1], texture->window[2], texture->window[3]}};
        return true;
    }
    return false;
}

static enum status insert_texture(struct texture_cache *cache, int64_t frame, int part,
                                  const struct source_patch *patch, struct source_texture *out)
{
    size_t bytes = (size_t)patch->width * (size_t)patch->height * 4; // GPUs pad RGB to four bytes
    enum status status = evict_until_fits(cache, bytes);
    if (status != OK)
        return status;
    struct cached_texture e = {
        .frame = frame,
        .part = part,
        .bytes = bytes,
        .used = ++cache->now,
        .window = {(float)patch->left, (float)patch->top, (float)patch->width, (float)patch->height}};
    status =
        gpu_texture_open(&e.texture, cache->gpu,
                         &(struct gpu_texture_layout){GPU_RGB8, patch->width, patch->height, GPU_LINEAR}, patch->rgb);
    if (status != OK)
        return status;
    cache->bytes += bytes;
    cache->entries[cache->count++] = e;
    *out = (struct source_texture){e.texture, {e.window[0], e.window[1], e.window[2], e.window[3]}};
    return OK;
}

static enum status image_of(struct texture_cache *cache, int64_t frame, bool labelled, struct source_image **out)
{
    int oldest = 0;
    for (int i = 0; i < IMAGES; i++) {
        struct source_image *image = &cache->images[i];
        if (image->frame == frame && (!labelled || image->labelled)) {
            cache->image_used[i] = ++cache->now;
            *out = image;
            return OK;
        }
        if (cache->image_used[i] < cache->image_used[oldest])
            oldest = i;
    }
    cache->image_used[oldest] = ++cache->now;
    *out = &cache->images[oldest];
    return source_image_load(*out, cache->take, frame, labelled ? cache->rays : NULL);
}

enum status texture_cache_whole(struct texture_cache *c, int64_t frame, struct source_texture *out)
{
    if (find_texture(c, frame, WHOLE, out))
        return OK;
    struct source_image *image;
    enum status status = image_of(c, frame, false, &image);
    if (status != OK)
        return status;
    struct source_patch all = {0, 0, image->width, image->height, image->rgb};
    return insert_texture(c, frame, WHOLE, &all, out);
}

enum status texture_cache_part(struct texture_cache *c, int64_t frame, enum part p, struct source_texture *out)
{
    if (find_texture(c, frame, p, out))
        return OK;
    if (!c->rays || !take_entry(c->take, frame)->has_depth)
        return texture_cache_whole(c, frame, out);
    struct source_image *image;
    enum status status = image_of(c, frame, true, &image);
    struct source_patch patch;
    if (status == OK)
        status = source_patch_make(image, c->take, p, &patch);
    if (status != OK)
        return status;
    status = insert_texture(c, frame, p, &patch, out);
    free(patch.rgb);
    return status;
}
