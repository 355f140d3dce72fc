#include "app/camera/camera_texture.h"

#include "platform/gpu_import.h"
#include "reenact/render/yuv_to_rgb.h"

#include <stdio.h>
#include <stdlib.h>

enum { MAX_PENDING = 2 };

// What the GPU may still be reading.
struct pending_read {
    struct dmabuf_image *dmabuf;
    struct gpu_fence *fence;
};

struct camera_texture {
    struct gpu *gpu;
    struct gpu_texture *uploaded;
    int width, height; // of `uploaded`
    struct yuv_to_rgb *converter;
    bool shows_imported; // the picture last shown is there, not in `uploaded`
    bool can_import;
    struct dmabuf_image tried; // its kind of picture was tried
    enum { UNTRIED, GOOD, BAD } trust;
    struct pending_read pending[MAX_PENDING];
    struct camera_texture_counts counts;
    char why[512];
};

enum status camera_texture_open(struct camera_texture **out, struct gpu *gpu)
{
    *out = NULL;
    struct camera_texture *v = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "out of memory");
    v->gpu = gpu;
    v->can_import = gpu_can_import(gpu);
    enum status status = v->can_import ? yuv_to_rgb_open(&v->converter, gpu) : OK;
    if (status != OK) {
        free(v);
        return status;
    }
    *out = v;
    return OK;
}

// Returns what the GPU is done with.
static void release_finished(struct camera_texture *v, bool wait)
{
    for (int i = 0; i < MAX_PENDING; i++) {
        struct pending_read *r = &v->pending[i];
        if (!r->dmabuf || (!gpu_fence_passed(r->fence, wait) && !wait))
            continue;
        gpu_fence_close(&r->fence);
        dmabuf_image_release(&r->dmabuf);
    }
}

void camera_texture_close(struct camera_texture **out)
{
    struct camera_texture *v = *out;
    if (!v)
        return;
    release_finished(v, true);
    yuv_to_rgb_close(&v->converter);
    gpu_texture_close(&v->uploaded);
    free(v);
    *out = NULL;
}

bool camera_texture_can_import(const struct camera_texture *v) { return v->can_import; }

static enum status upload(struct camera_texture *v, const struct camera_frame *frame)
{
    v->counts.uploaded++;
    v->shows_imported = false;
    if (v->uploaded && v->width == frame->lens.width && v->height == frame->lens.height) {
        gpu_texture_write(v->uploaded, frame->rgb);
        return OK;
    }
    gpu_texture_close(&v->uploaded);
    v->width = frame->lens.width;
    v->height = frame->lens.height;
    return gpu_texture_open(&v->uploaded, v->gpu,
                            &(struct gpu_texture_layout){GPU_RGB8, v->width, v->height, GPU_LINEAR}, frame->rgb);
}

// ---------------------------------------------------------------- borrowing

static bool same_kind(const struct dmabuf_image *a, const struct dmabuf_image *b)
{
    return a->layout == b->layout && a->width == b->width && a->height == b->height &&
           a->encoding.matrix == b->encoding.matrix && a->encoding.full_range == b->encoding.full_range &&
           a->planes[0].stride == b->planes[0].stride;
}

static enum status draw(struct camera_texture *v, const struct dmabuf_image *l)
{
    struct yuv_plane planes[2];
    struct gpu_texture *textures[2] = {NULL, NULL};
    int count = yuv_planes(l->layout, l->width, l->height, planes);
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        const struct gpu_dmabuf memory = {l->planes[i].file, l->planes[i].offset, l->planes[i].stride};
        status = gpu_texture_import(&textures[i], v->gpu, planes[i].format, planes[i].width, planes[i].height, &memory);
    }
    const struct gpu_texture *const read[2] = {textures[0], textures[1]};
    if (status == OK)
        status = yuv_to_rgb_draw(v->converter, l, read);
    for (int i = 0; i < count; i++)
        gpu_texture_close(&textures[i]); // the driver keeps what it still draws with
    return status;
}

static enum status compare(struct camera_texture *v, const struct camera_frame *frame)
{
    const size_t pixels = (size_t)frame->lens.width * (size_t)frame->lens.height;
    uint8_t *rgba = malloc(4 * pixels);
    if (!rgba)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = yuv_to_rgb_read(v->converter, rgba);
    size_t others = 0;
    for (size_t i = 0; i < pixels && status == OK; i++)
        others += rgba[4 * i] != frame->rgb[3 * i] || rgba[4 * i + 1] != frame->rgb[3 * i + 1] ||
                  rgba[4 * i + 2] != frame->rgb[3 * i + 2];
    free(rgba);
    if (status == OK && others)
        return fail(ERR_DEVICE, "the graphics driver reads the memory wrongly: %zu of %zu pixels", others, pixels);
    return status;
}

// OK: the picture is drawn and the loan taken over, until the GPU is done with it.
static enum status import_dmabuf(struct camera_texture *v, const struct camera_frame *frame,
                                 struct dmabuf_image **dmabuf)
{
    if (!same_kind(*dmabuf, &v->tried)) {
        v->tried = **dmabuf;
        v->trust = UNTRIED;
    }
    if (v->trust == BAD)
        return NOTHING;
    struct pending_read *slot = NULL;
    for (int i = 0; i < MAX_PENDING; i++)
        if (!v->pending[i].dmabuf)
            slot = &v->pending[i];
    if (!slot)
        return NOTHING; // the GPU is far behind
    enum status status = draw(v, *dmabuf);
    if (status == OK && v->trust == UNTRIED)
        status = compare(v, frame);
    if (status == OK)
        status = gpu_fence_open(&slot->fence, v->gpu);
    v->trust = status == OK ? GOOD : BAD;
    if (status != OK) {
        snprintf(v->why, sizeof v->why, "%s", status_message());
        return NOTHING;
    }
    slot->dmabuf = *dmabuf;
    *dmabuf = NULL;
    v->shows_imported = true;
    v->counts.imported++;
    return OK;
}

enum status camera_texture_update(struct camera_texture *v, const struct camera_frame *frame,
                                  struct dmabuf_image **dmabuf)
{
    release_finished(v, false);
    bool fits =
        *dmabuf && v->can_import && (*dmabuf)->width == frame->lens.width && (*dmabuf)->height == frame->lens.height;
    if (fits && import_dmabuf(v, frame, dmabuf) == OK)
        return OK;
    dmabuf_image_release(dmabuf);
    return upload(v, frame);
}

const struct gpu_texture *camera_texture_current(struct camera_texture *v)
{
    return v->shows_imported ? yuv_to_rgb_texture(v->converter) : v->uploaded;
}

struct camera_texture_counts camera_texture_count(const struct camera_texture *v)
{
    struct camera_texture_counts counts = v->counts;
    counts.why = v->why;
    return counts;
}
