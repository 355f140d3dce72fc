#include "app/camera/camera_texture.h"

#include "platform/screen/gpu.h"
#include "reenact/render/yuv_to_rgb.h"

#include <stdio.h>
#include <stdlib.h>

enum { MAX_PENDING = 2 };

// A DMA buffer that the GPU may still be reading.
struct pending_read {
    struct dmabuf_image *dmabuf;
    struct gpu_fence *fence;
};

struct camera_texture {
    struct gpu *gpu;
    struct gpu_texture *uploaded;
    struct yuv_to_rgb *converter;
    bool shows_imported; // the image shown last is the converter's, not `uploaded`
    bool can_import;
    struct dmabuf_image tried; // the kind of image that `trust` is about
    enum { UNTRIED, GOOD, BAD } trust;
    struct pending_read pending[MAX_PENDING];
    struct camera_texture_counts counts;
    char why[512];
};

enum status camera_texture_open(struct camera_texture **out, struct gpu *gpu)
{
    *out = NULL;
    struct camera_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for the camera's image");
    t->gpu = gpu;
    t->can_import = gpu_can_import(gpu);
    enum status status = t->can_import ? yuv_to_rgb_open(&t->converter, gpu) : OK;
    if (status != OK) {
        free(t);
        return status;
    }
    *out = t;
    return OK;
}

// Releases what the GPU has finished reading; wait: waits for it.
static void release_finished(struct camera_texture *texture, bool wait)
{
    for (int i = 0; i < MAX_PENDING; i++) {
        struct pending_read *r = &texture->pending[i];
        if (!r->dmabuf || (!gpu_fence_passed(r->fence, wait) && !wait))
            continue;
        gpu_fence_close(&r->fence);
        dmabuf_image_release(&r->dmabuf);
    }
}

void camera_texture_close(struct camera_texture **out)
{
    struct camera_texture *t = *out;
    if (!t)
        return;
    release_finished(t, true);
    yuv_to_rgb_close(&t->converter);
    gpu_texture_close(&t->uploaded);
    free(t);
    *out = NULL;
}

bool camera_texture_can_import(const struct camera_texture *texture) { return texture->can_import; }

static enum status upload(struct camera_texture *texture, const struct camera_frame *frame)
{
    texture->counts.uploaded++;
    texture->shows_imported = false;
    const struct gpu_texture_layout layout = {GPU_RGB8, frame->lens.width, frame->lens.height, GPU_LINEAR};
    return gpu_texture_put(&texture->uploaded, texture->gpu, &layout, frame->rgb);
}

// ---------------------------------------------------------------- import

static bool same_kind(const struct dmabuf_image *a, const struct dmabuf_image *b)
{
    return a->layout == b->layout && a->width == b->width && a->height == b->height &&
           a->encoding.matrix == b->encoding.matrix && a->encoding.full_range == b->encoding.full_range &&
           a->planes[0].stride == b->planes[0].stride;
}

static enum status convert(struct camera_texture *texture, const struct dmabuf_image *image)
{
    struct yuv_plane planes[2];
    struct gpu_texture *textures[2] = {NULL, NULL};
    int count = yuv_planes(image->layout, image->width, image->height, planes);
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        const struct gpu_dmabuf memory = {image->planes[i].file, image->planes[i].offset, image->planes[i].stride};
        status = gpu_texture_import(&textures[i], texture->gpu, planes[i].format, planes[i].width, planes[i].height,
                                    &memory);
    }
    const struct gpu_texture *const read[2] = {textures[0], textures[1]};
    if (status == OK)
        status = yuv_to_rgb_draw(texture->converter, image, read);
    for (int i = 0; i < count; i++)
        gpu_texture_close(&textures[i]); // the driver keeps what it still reads
    return status;
}

// Whether the GPU's pixels equal the CPU's. ERR_DEVICE: they do not.
static enum status compare(struct camera_texture *texture, const struct camera_frame *frame)
{
    const size_t pixels = (size_t)frame->lens.width * (size_t)frame->lens.height;
    uint8_t *rgba = malloc(4 * pixels);
    if (!rgba)
        return fail(ERR_MEMORY, "no memory for the camera's image");
    enum status status = yuv_to_rgb_read(texture->converter, rgba);
    size_t different = 0;
    for (size_t i = 0; i < pixels && status == OK; i++)
        different += rgba[4 * i] != frame->rgb[3 * i] || rgba[4 * i + 1] != frame->rgb[3 * i + 1] ||
                     rgba[4 * i + 2] != frame->rgb[3 * i + 2];
    free(rgba);
    if (status == OK && different)
        return fail(ERR_DEVICE, "the graphics driver reads the memory wrongly: %zu of %zu pixels", different, pixels);
    return status;
}

// OK: the image is converted, and *dmabuf taken over until the GPU has finished. NOTHING: to be uploaded instead.
static enum status import_dmabuf(struct camera_texture *texture, const struct camera_frame *frame,
                                 struct dmabuf_image **dmabuf)
{
    if (!same_kind(*dmabuf, &texture->tried)) {
        texture->tried = **dmabuf;
        texture->trust = UNTRIED;
    }
    if (texture->trust == BAD)
        return NOTHING;
    struct pending_read *slot = NULL;
    for (int i = 0; i < MAX_PENDING; i++)
        if (!texture->pending[i].dmabuf)
            slot = &texture->pending[i];
    if (!slot)
        return NOTHING; // the GPU is far behind
    enum status status = convert(texture, *dmabuf);
    if (status == OK && texture->trust == UNTRIED)
        status = compare(texture, frame);
    if (status == OK)
        status = gpu_fence_open(&slot->fence, texture->gpu);
    texture->trust = status == OK ? GOOD : BAD;
    if (status != OK) {
        snprintf(texture->why, sizeof texture->why, "%s", status_message());
        return NOTHING;
    }
    slot->dmabuf = *dmabuf;
    *dmabuf = NULL;
    texture->shows_imported = true;
    texture->counts.imported++;
    return OK;
}

enum status camera_texture_update(struct camera_texture *texture, const struct camera_frame *frame,
                                  struct dmabuf_image **dmabuf)
{
    release_finished(texture, false);
    bool fits = *dmabuf && texture->can_import && (*dmabuf)->width == frame->lens.width &&
                (*dmabuf)->height == frame->lens.height;
    if (fits && import_dmabuf(texture, frame, dmabuf) == OK)
        return OK;
    dmabuf_image_release(dmabuf);
    return upload(texture, frame);
}

const struct gpu_texture *camera_texture_current(struct camera_texture *texture)
{
    return texture->shows_imported ? yuv_to_rgb_texture(texture->converter) : texture->uploaded;
}

struct camera_texture_counts camera_texture_count(const struct camera_texture *texture)
{
    struct camera_texture_counts counts = texture->counts;
    counts.why = texture->why;
    return counts;
}
