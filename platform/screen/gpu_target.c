// Render targets of gpu.h: framebuffers with their textures.
#include "platform/screen/gpu_internal.h"

#include <stdlib.h>

// A depth texture of 16 or 24 bit, attached to the framebuffer that is bound.
static void attach_depth_texture(struct gpu_target *t, struct gpu_texture *texture, int bits)
{
    glGenTextures(1, &texture->id);
    glBindTexture(GL_TEXTURE_2D, texture->id);
    glTexImage2D(GL_TEXTURE_2D, 0, bits == 16 ? GL_DEPTH_COMPONENT16 : GL_DEPTH_COMPONENT24, t->width, t->height, 0,
                 GL_DEPTH_COMPONENT, bits == 16 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT, NULL);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, texture->id, 0);
}

static enum status make_shadow_map(struct gpu_target *t)
{
    if (t->width > t->g->max_size || t->height > t->g->max_size)
        return gpu_fail_too_large(t->g, t->width, t->height);
    attach_depth_texture(t, &t->texture, 16);
    glDrawBuffers(1, &(const GLenum){GL_NONE});
    glReadBuffer(GL_NONE);
    return gpu_check(t->g);
}

static enum status make_color_texture(struct gpu_target *t)
{
    enum status status = gpu_make_texture(&t->texture, GPU_NEAREST, NULL);
    if (status == OK)
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, t->texture.id, 0);
    return status;
}

static enum status make_target(struct gpu_target *t)
{
    glGenFramebuffers(1, &t->framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, t->framebuffer);
    enum status status = t->kind == GPU_TARGET_DEPTH ? make_shadow_map(t) : make_color_texture(t);
    if (status != OK)
        return status;
    if (t->kind == GPU_TARGET_COMPARABLE) {
        attach_depth_texture(t, &t->depth_texture, 24);
    } else if (t->kind == GPU_TARGET_COLOR_DEPTH) {
        glGenRenderbuffers(1, &t->depth);
        glBindRenderbuffer(GL_RENDERBUFFER, t->depth);
        glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, t->width, t->height);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, t->depth);
    }
    status = gpu_check(t->g);
    if (status == OK && glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        status = fail(ERR_DEVICE, "the graphics driver (%s) cannot draw into an image of %d x %d pixels",
                      t->g->renderer, t->width, t->height);
    return status;
}

static enum status open_target(struct gpu_target **out, struct gpu *g, enum gpu_target_kind kind, int width, int height)
{
    static const size_t bytes_a_pixel[] = {
        [GPU_TARGET_COLOR_DEPTH] = 8, [GPU_TARGET_COMPARABLE] = 8, [GPU_TARGET_COLOR] = 4, [GPU_TARGET_DEPTH] = 2};
    assert(width > 0 && height > 0);
    *out = NULL;
    gpu_make_current(g);
    struct gpu_target *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "out of memory");
    *t = (struct gpu_target){.g = g,
                             .kind = kind,
                             .width = width,
                             .height = height,
                             .bytes = (size_t)width * (size_t)height * bytes_a_pixel[kind],
                             .texture = {.g = g, .format = GPU_RGBA8, .width = width, .height = height}};
    gpu_count_made(g, t->bytes);
    enum status status = make_target(t);
    if (status != OK) {
        gpu_target_close(&t);
        return status;
    }
    gpu_target_mark_drawn(t);
    gpu_target_clear(t);
    *out = t;
    return OK;
}

enum status gpu_target_open(struct gpu_target **out, struct gpu *g, int width, int height)
{
    return open_target(out, g, GPU_TARGET_COLOR_DEPTH, width, height);
}

enum status gpu_target_open_comparable(struct gpu_target **out, struct gpu *g, int width, int height)
{
    return open_target(out, g, GPU_TARGET_COMPARABLE, width, height);
}

enum status gpu_target_open_color(struct gpu_target **out, struct gpu *g, int width, int height)
{
    return open_target(out, g, GPU_TARGET_COLOR, width, height);
}

enum status gpu_target_open_depth(struct gpu_target **out, struct gpu *g, int width, int height)
{
    return open_target(out, g, GPU_TARGET_DEPTH, width, height);
}

void gpu_target_close(struct gpu_target **t)
{
    if (!*t)
        return;
    gpu_make_current((*t)->g);
    (*t)->g->counts.bytes_held -= (*t)->bytes;
    glDeleteFramebuffers(1, &(*t)->framebuffer);
    glDeleteRenderbuffers(1, &(*t)->depth);
    glDeleteTextures(1, &(*t)->texture.id);
    glDeleteTextures(1, &(*t)->depth_texture.id);
    free(*t);
    *t = NULL;
}

void gpu_target_mark_drawn(struct gpu_target *t)
{
    t->left = t->top = 0;
    t->right = t->width, t->bottom = t->height;
}

// A GPU clears a whole target at no cost per pixel, and then need not load its old contents. A software renderer clears
// pixel by pixel: only the area that was drawn into.
void gpu_target_clear(struct gpu_target *t)
{
    bool is_clear = t->right <= t->left || t->bottom <= t->top;
    gpu_make_current(t->g);
    glBindFramebuffer(GL_FRAMEBUFFER, t->framebuffer);
    glClearColor(0, 0, 0, 0);
    glClearDepthf(1);
    glDepthMask(GL_TRUE);
    if (t->g->software_renderer) {
        glEnable(GL_SCISSOR_TEST);
        glScissor(t->left, t->top, t->right - t->left, t->bottom - t->top);
    }
    if (!is_clear || !t->g->software_renderer)
        glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glDisable(GL_SCISSOR_TEST);
    t->left = t->top = t->right = t->bottom = 0;
}

void gpu_target_resize(struct gpu_target *t, int width, int height)
{
    assert(width > 0 && height > 0 && width <= t->texture.width && height <= t->texture.height);
    if (width == t->width && height == t->height)
        return;
    gpu_target_clear(t); // the old size may reach beyond the new one
    t->width = t->texture.used_width = width;
    t->height = t->texture.used_height = height;
}

int gpu_target_width(const struct gpu_target *t) { return t->width; }

const struct gpu_texture *gpu_target_texture(const struct gpu_target *t) { return &t->texture; }

const struct gpu_texture *gpu_target_depth(const struct gpu_target *t)
{
    assert(t->kind == GPU_TARGET_COMPARABLE);
    return &t->depth_texture;
}

enum status gpu_target_read(struct gpu_target *t, uint8_t *rgba)
{
    assert(t->kind != GPU_TARGET_DEPTH);
    gpu_make_current(t->g);
    glBindFramebuffer(GL_FRAMEBUFFER, t->framebuffer);
    glReadPixels(0, 0, t->width, t->height, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
    return gpu_check(t->g);
}
