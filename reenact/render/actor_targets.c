// The actor renderer's render targets: sizes, resolution scale, lens, read-back.
#include "reenact/render/actor_renderer_internal.h"

#include <stdlib.h>
#include <string.h>

enum { ROOM_SUPERSAMPLING = 2 }; // texels of the room's depth along a pixel's side
enum { SHADOW_PX = 2 };          // image pixels along a shadow pixel: it is soft, and each one visits the whole body

static void set_view_lens(struct renderer *p)
{
    cylinder_renderer_set_lens(p->cylinders, &p->drawn);
    if (p->avatar)
        avatar_renderer_set_lens(p->avatar, &p->drawn);
    occlusion_shadow_set_lens(p->occlusion, &p->drawn);
}

enum status actor_targets_open(struct renderer *p, bool sources, bool shadow)
{
    int w = p->lens.width, h = p->lens.height;
    enum status status =
        gpu_texture_open(&p->camera, p->gpu, &(struct gpu_texture_layout){GPU_RGB8, w, h, GPU_NEAREST}, NULL);
    if (status == OK && (p->detail != DETAIL_FULL || p->avatar_later))
        status = gpu_target_open_comparable(&p->paper, p->gpu, w, h);
    if (status == OK && p->detail != DETAIL_PAPER)
        status = gpu_target_open_comparable(&p->full, p->gpu, w, h);
    if (status == OK)
        status = gpu_target_open_color(&p->composed, p->gpu, w, h);
    if (status == OK && sources)
        status = gpu_target_open(&p->source, p->gpu, w, h);
    if (status == OK && shadow)
        status = gpu_target_open(&p->shadow, p->gpu, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
    p->actor = p->paper ? p->paper : p->full;
    p->writes_source = sources;
    return status;
}

enum status actor_targets_open_room_depth(struct renderer *p)
{
    return gpu_target_open_depth(&p->room_depth, p->gpu, ROOM_SUPERSAMPLING * p->lens.width,
                                 ROOM_SUPERSAMPLING * p->lens.height);
}

void actor_targets_close(struct renderer *p)
{
    gpu_target_close(&p->room_depth);
    gpu_target_close(&p->paper);
    gpu_target_close(&p->full);
    gpu_target_close(&p->composed);
    gpu_target_close(&p->strokes);
    gpu_target_close(&p->source);
    gpu_target_close(&p->shadow);
    gpu_texture_close(&p->camera);
}

struct gpu_target *actor_targets_room(const struct renderer *p)
{
    return p->actor == p->full && p->avatar && p->room_depth ? p->room_depth : p->actor;
}

static void resize(struct gpu_target *t, int width, int height)
{
    if (t)
        gpu_target_resize(t, width, height);
}

void actor_targets_apply_scale(struct renderer *p)
{
    p->drawn = lens_resized(&p->lens, p->resolution_scale);
    const int w = p->drawn.width, h = p->drawn.height;
    set_view_lens(p);
    resize(p->paper, w, h);
    resize(p->full, w, h);
    resize(p->source, w, h);
    resize(p->strokes, w, h);
    resize(p->room_depth, ROOM_SUPERSAMPLING * w, ROOM_SUPERSAMPLING * h);
    resize(p->shadow, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
}

void renderer_set_resolution_scale(struct renderer *p, double resolution_scale)
{
    if (resolution_scale == p->resolution_scale)
        return;
    p->resolution_scale = resolution_scale;
    actor_targets_apply_scale(p);
}

enum status renderer_set_lens(struct renderer *p, const struct lens *lens)
{
    enum status status = lens_check(lens, "tablet's");
    if (status != OK)
        return status;
    bool resized = lens->width != p->lens.width || lens->height != p->lens.height, sources = p->source,
         shadow = p->shadow, room_depth = p->room_depth, writes_source = p->writes_source;
    p->lens = *lens;
    if (resized) {
        actor_targets_close(p);
        status = actor_targets_open(p, sources, shadow);
        p->writes_source = writes_source;
    }
    if (resized && status == OK && room_depth)
        status = actor_targets_open_room_depth(p);
    actor_targets_apply_scale(p);
    return status;
}

// ---------------------------------------------------------------- read-back

static enum status read_rgb(const struct renderer *p, struct gpu_target *from, uint8_t *rgb)
{
    size_t pixels = (size_t)p->drawn.width * (size_t)p->drawn.height;
    uint8_t *rgba = malloc(pixels * 4);
    if (!rgba)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = gpu_target_read(from, rgba);
    for (size_t i = 0; i < pixels && status == OK; i++)
        memcpy(rgb + 3 * i, rgba + 4 * i, 3);
    free(rgba);
    return status;
}

enum status renderer_read(struct renderer *p, uint8_t *rgb) { return read_rgb(p, p->composed, rgb); }

enum status renderer_read_actor(struct renderer *p, uint8_t *rgba)
{
    enum status status = gpu_target_read(p->actor, rgba);
    if (status != OK)
        return status;
    size_t pixels = (size_t)p->drawn.width * (size_t)p->drawn.height;
    for (size_t i = 0; i < pixels; i++) { // premultiplied to straight
        uint8_t *at = rgba + 4 * i;
        for (int c = 0; c < 3 && at[3] && at[3] < 255; c++) {
            int straight = (at[c] * 255 + at[3] / 2) / at[3];
            at[c] = (uint8_t)(straight < 255 ? straight : 255);
        }
    }
    return OK;
}

enum status renderer_read_source(struct renderer *p, uint8_t *rgb)
{
    assert(p->source);
    return read_rgb(p, p->source, rgb);
}

const struct gpu_texture *renderer_actor_texture(struct renderer *p) { return gpu_target_texture(p->actor); }

const struct gpu_texture *renderer_shadow_texture(struct renderer *p)
{
    return p->shaded ? gpu_target_texture(p->shadow) : NULL;
}
