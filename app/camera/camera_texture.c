#include "app/camera/camera_texture.h"

#include "platform/gpu_import.h"
#include "reenact/render/yuv_to_rgb.h"

#include <stdio.h>
#include <stdlib.h>

enum { MOST_OUT = 2 };

// What the GPU may still be reading.
struct reading {
    struct loan *loan;
    struct gpu_fence *fence;
};

struct viewfinder {
    struct gpu *gpu;
    struct gpu_texture *uploaded;
    int width, height; // of `uploaded`
    struct raw_picture *raw;
    bool shows_raw; // the picture last shown is there, not in `uploaded`
    bool can_borrow;
    struct loan tried; // its kind of picture was tried
    enum { UNTRIED, GOOD, BAD } trust;
    struct reading readings[MOST_OUT];
    struct viewfinder_counts counts;
    char why[512];
};

enum status viewfinder_open(struct viewfinder **out, struct gpu *gpu)
{
    *out = NULL;
    struct viewfinder *v = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "out of memory");
    v->gpu = gpu;
    v->can_borrow = gpu_can_import(gpu);
    enum status status = v->can_borrow ? raw_picture_open(&v->raw, gpu) : OK;
    if (status != OK) {
        free(v);
        return status;
    }
    *out = v;
    return OK;
}

// Returns what the GPU is done with.
static void give_back(struct viewfinder *v, bool wait)
{
    for (int i = 0; i < MOST_OUT; i++) {
        struct reading *r = &v->readings[i];
        if (!r->loan || (!gpu_fence_passed(r->fence, wait) && !wait))
            continue;
        gpu_fence_close(&r->fence);
        loan_return(&r->loan);
    }
}

void viewfinder_close(struct viewfinder **out)
{
    struct viewfinder *v = *out;
    if (!v)
        return;
    give_back(v, true);
    raw_picture_close(&v->raw);
    gpu_texture_close(&v->uploaded);
    free(v);
    *out = NULL;
}

bool viewfinder_can_borrow(const struct viewfinder *v) { return v->can_borrow; }

static enum status upload(struct viewfinder *v, const struct sight *sight)
{
    v->counts.uploaded++;
    v->shows_raw = false;
    if (v->uploaded && v->width == sight->lens.width && v->height == sight->lens.height) {
        gpu_texture_write(v->uploaded, sight->rgb);
        return OK;
    }
    gpu_texture_close(&v->uploaded);
    v->width = sight->lens.width;
    v->height = sight->lens.height;
    return gpu_texture_open(&v->uploaded, v->gpu, GPU_RGB8, v->width, v->height, GPU_LINEAR, sight->rgb);
}

// ---------------------------------------------------------------- borrowing

static bool same_kind(const struct loan *a, const struct loan *b)
{
    return a->layout == b->layout && a->width == b->width && a->height == b->height &&
           a->meaning.matrix == b->meaning.matrix && a->meaning.full_range == b->meaning.full_range &&
           a->planes[0].stride == b->planes[0].stride;
}

static enum status draw(struct viewfinder *v, const struct loan *l)
{
    struct raw_plane planes[2];
    struct gpu_texture *textures[2] = {NULL, NULL};
    int count = raw_planes(l->layout, l->width, l->height, planes);
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        const struct gpu_memory memory = {l->planes[i].file, l->planes[i].offset, l->planes[i].stride};
        status = gpu_texture_import(&textures[i], v->gpu, planes[i].format, planes[i].width, planes[i].height, &memory);
    }
    const struct gpu_texture *const read[2] = {textures[0], textures[1]};
    if (status == OK)
        status = raw_picture_draw(v->raw, l, read);
    for (int i = 0; i < count; i++)
        gpu_texture_close(&textures[i]); // the driver keeps what it still draws with
    return status;
}

static enum status compare(struct viewfinder *v, const struct sight *sight)
{
    const size_t pixels = (size_t)sight->lens.width * (size_t)sight->lens.height;
    uint8_t *rgba = malloc(4 * pixels);
    if (!rgba)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = raw_picture_read(v->raw, rgba);
    size_t others = 0;
    for (size_t i = 0; i < pixels && status == OK; i++)
        others += rgba[4 * i] != sight->rgb[3 * i] || rgba[4 * i + 1] != sight->rgb[3 * i + 1] ||
                  rgba[4 * i + 2] != sight->rgb[3 * i + 2];
    free(rgba);
    if (status == OK && others)
        return fail(ERR_DEVICE, "the graphics driver reads the memory wrongly: %zu of %zu pixels", others, pixels);
    return status;
}

// OK: the picture is drawn and the loan taken over, until the GPU is done with it.
static enum status borrow(struct viewfinder *v, const struct sight *sight, struct loan **loan)
{
    if (!same_kind(*loan, &v->tried)) {
        v->tried = **loan;
        v->trust = UNTRIED;
    }
    if (v->trust == BAD)
        return NOTHING;
    struct reading *free_one = NULL;
    for (int i = 0; i < MOST_OUT; i++)
        if (!v->readings[i].loan)
            free_one = &v->readings[i];
    if (!free_one)
        return NOTHING; // the GPU is far behind
    enum status status = draw(v, *loan);
    if (status == OK && v->trust == UNTRIED)
        status = compare(v, sight);
    if (status == OK)
        status = gpu_fence_open(&free_one->fence, v->gpu);
    v->trust = status == OK ? GOOD : BAD;
    if (status != OK) {
        snprintf(v->why, sizeof v->why, "%s", status_sentence());
        return NOTHING;
    }
    free_one->loan = *loan;
    *loan = NULL;
    v->shows_raw = true;
    v->counts.borrowed++;
    return OK;
}

enum status viewfinder_show(struct viewfinder *v, const struct sight *sight, struct loan **loan)
{
    give_back(v, false);
    bool fits = *loan && v->can_borrow && (*loan)->width == sight->lens.width && (*loan)->height == sight->lens.height;
    if (fits && borrow(v, sight, loan) == OK)
        return OK;
    loan_return(loan);
    return upload(v, sight);
}

const struct gpu_texture *viewfinder_texture(struct viewfinder *v)
{
    return v->shows_raw ? raw_picture_texture(v->raw) : v->uploaded;
}

struct viewfinder_counts viewfinder_counts(const struct viewfinder *v)
{
    struct viewfinder_counts counts = v->counts;
    counts.why = v->why;
    return counts;
}
