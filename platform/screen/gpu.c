#include "platform/screen/gpu.h"

#include "platform/screen/gpu_internal.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES2/gl2ext.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- gpu draw

// The draw call of gpu.h.

static int min_int(int a, int b) { return a < b ? a : b; }
static int max_int(int a, int b) { return a > b ? a : b; }

// Limits drawing to the box and extends the area that the next clear has to cover.
static void set_scissor(struct gpu_target *target, const struct gpu_box *box)
{
    if (!box->width) {
        gpu_target_mark_drawn(target);
        return;
    }
    const int left = max_int(box->left, 0), right = max_int(left, min_int(box->left + box->width, target->width));
    const int top = max_int(box->top, 0), bottom = max_int(top, min_int(box->top + box->height, target->height));
    const bool cleared = target->right <= target->left;
    target->left = cleared ? left : min_int(target->left, left);
    target->top = cleared ? top : min_int(target->top, top);
    target->right = max_int(target->right, right);
    target->bottom = max_int(target->bottom, bottom);
    glEnable(GL_SCISSOR_TEST);
    glScissor(left, top, right - left, bottom - top);
}

void gpu_draw(const struct gpu_job *job)
{
    gpu_make_current(job->target->g);
    job->target->g->counts.draws++;
    assert(!job->depth_test || job->target->kind != GPU_TARGET_COLOR);
    glBindFramebuffer(GL_FRAMEBUFFER, job->target->framebuffer);
    glViewport(0, 0, job->target->width, job->target->height);
    set_scissor(job->target, &job->within);
    glFrontFace(GL_CW); // images have their top row first, which mirrors triangles
    if (job->closed)
        glEnable(GL_CULL_FACE);
    else
        glDisable(GL_CULL_FACE);
    if (job->blend) {
        glEnable(GL_BLEND);
        glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    } else {
        glDisable(GL_BLEND);
    }
    if (job->depth_test) {
        glEnable(GL_DEPTH_TEST);
        glDepthFunc(GL_LESS);
        glDepthMask(!job->no_depth_write);
    } else {
        glDisable(GL_DEPTH_TEST);
    }
    glUseProgram(job->program->id);
    for (int i = 0; i < job->program->sampler_count; i++) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        glBindTexture(job->textures[i]->layers ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D, job->textures[i]->id);
    }
    glActiveTexture(GL_TEXTURE0);
    glBindVertexArray(job->mesh->array);
    if (job->points)
        glDrawArrays(GL_POINTS, job->first, job->count ? job->count : job->mesh->vertex_count);
    else
        glDrawElements(GL_TRIANGLES, job->count ? job->count : job->mesh->index_count, GL_UNSIGNED_SHORT,
                       (const void *)(sizeof(uint16_t) * (size_t)job->first));
    glBindVertexArray(0);
    glDisable(GL_SCISSOR_TEST);
}

// ---------------------------------------------------------------- gpu import

// As in drm_fourcc.h: the letters name the channels from the most significant byte of a little-endian word.
#define FOURCC(a, b, c, d) ((EGLint)(a) | (EGLint)(b) << 8 | (EGLint)(c) << 16 | (EGLint)(d) << 24)

static EGLint drm_format(enum gpu_format format)
{
    switch (format) {
    case GPU_R8: return FOURCC('R', '8', ' ', ' ');
    case GPU_RG8: return FOURCC('G', 'R', '8', '8');
    case GPU_RGBA8: return FOURCC('A', 'B', '2', '4');
    default: return 0;
    }
}

static bool lists_format(EGLDisplay display, EGLint wanted)
{
    PFNEGLQUERYDMABUFFORMATSEXTPROC query =
        (PFNEGLQUERYDMABUFFORMATSEXTPROC)eglGetProcAddress("eglQueryDmaBufFormatsEXT");
    EGLint formats[256], count = 0;
    if (!query || !query(display, (EGLint)COUNT_OF(formats), formats, &count))
        return false;
    for (EGLint i = 0; i < count; i++)
        if (formats[i] == wanted)
            return true;
    return false;
}

bool gpu_can_import(struct gpu *gpu)
{
    gpu_make_current(gpu);
    EGLDisplay display = eglGetCurrentDisplay();
    const char *extensions = display == EGL_NO_DISPLAY ? NULL : eglQueryString(display, EGL_EXTENSIONS);
    if (!gpu_has_extension(extensions, "EGL_EXT_image_dma_buf_import") ||
        !gpu_has_extension(extensions, "EGL_KHR_image_base") ||
        !gpu_has_extension((const char *)glGetString(GL_EXTENSIONS), "GL_OES_EGL_image"))
        return false;
    // A driver that cannot list its formats may support them nevertheless.
    return !gpu_has_extension(extensions, "EGL_EXT_image_dma_buf_import_modifiers") ||
           (lists_format(display, drm_format(GPU_R8)) && lists_format(display, drm_format(GPU_RG8)) &&
            lists_format(display, drm_format(GPU_RGBA8)));
}

static enum status bind_image(struct gpu_texture *texture, EGLDisplay display, const struct gpu_dmabuf *memory)
{
    PFNEGLCREATEIMAGEKHRPROC create = (PFNEGLCREATEIMAGEKHRPROC)eglGetProcAddress("eglCreateImageKHR");
    PFNEGLDESTROYIMAGEKHRPROC destroy = (PFNEGLDESTROYIMAGEKHRPROC)eglGetProcAddress("eglDestroyImageKHR");
    PFNGLEGLIMAGETARGETTEXTURE2DOESPROC use =
        (PFNGLEGLIMAGETARGETTEXTURE2DOESPROC)eglGetProcAddress("glEGLImageTargetTexture2DOES");
    if (!create || !destroy || !use)
        return fail(ERR_DEVICE, "the graphics driver (%s) cannot import memory", texture->g->renderer);
    const EGLint what[] = {EGL_WIDTH,
                           texture->width,
                           EGL_HEIGHT,
                           texture->height,
                           EGL_LINUX_DRM_FOURCC_EXT,
                           drm_format(texture->format),
                           EGL_DMA_BUF_PLANE0_FD_EXT,
                           memory->file,
                           EGL_DMA_BUF_PLANE0_OFFSET_EXT,
                           (EGLint)memory->offset,
                           EGL_DMA_BUF_PLANE0_PITCH_EXT,
                           (EGLint)memory->stride,
                           EGL_NONE};
    EGLImageKHR image = create(display, EGL_NO_CONTEXT, EGL_LINUX_DMA_BUF_EXT, NULL, what);
    if (image == EGL_NO_IMAGE_KHR)
        return fail(ERR_DEVICE, "the graphics driver (%s) cannot read the memory (EGL error 0x%x)",
                    texture->g->renderer, eglGetError());
    glBindTexture(GL_TEXTURE_2D, texture->id);
    use(GL_TEXTURE_2D, image);
    destroy(display, image); // the texture keeps its own reference
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return gpu_check(texture->g);
}

enum status gpu_texture_import(struct gpu_texture **out, struct gpu *gpu, enum gpu_format format, int width, int height,
                               const struct gpu_dmabuf *memory)
{
    assert(width > 0 && height > 0 && drm_format(format));
    *out = NULL;
    enum status status = gpu_check(gpu); // report earlier errors separately
    if (status != OK)
        return status;
    struct gpu_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for an imported image");
    *t = (struct gpu_texture){.g = gpu, .format = format, .width = width, .height = height, .borrowed = true};
    glGenTextures(1, &t->id);
    gpu->counts.made++;
    status = bind_image(t, eglGetCurrentDisplay(), memory);
    if (status != OK) {
        gpu_texture_close(&t);
        return status;
    }
    *out = t;
    return OK;
}

// ---------------------------------------------------------------- fences

struct gpu_fence {
    struct gpu *g;
    GLsync sync;
};

enum status gpu_fence_open(struct gpu_fence **out, struct gpu *gpu)
{
    *out = NULL;
    struct gpu_fence *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for an imported image");
    gpu_make_current(gpu);
    *f = (struct gpu_fence){gpu, glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)};
    if (!f->sync) {
        free(f);
        return fail(ERR_DEVICE, "the graphics driver (%s) has no fences", gpu->renderer);
    }
    *out = f;
    return OK;
}

bool gpu_fence_passed(struct gpu_fence *fence, bool wait)
{
    gpu_make_current(fence->g);
    GLenum result = glClientWaitSync(fence->sync, GL_SYNC_FLUSH_COMMANDS_BIT, wait ? 1000000000 : 0);
    return result != GL_TIMEOUT_EXPIRED;
}

void gpu_fence_close(struct gpu_fence **fence)
{
    if (!*fence)
        return;
    gpu_make_current((*fence)->g);
    glDeleteSync((*fence)->sync);
    free(*fence);
    *fence = NULL;
}

// ---------------------------------------------------------------- gpu target

// Render targets of gpu.h: framebuffers with their textures.

// A depth texture of 16 or 24 bit, attached to the framebuffer that is bound.
static void attach_depth_texture(struct gpu_target *target, struct gpu_texture *texture, int bits)
{
    glGenTextures(1, &texture->id);
    glBindTexture(GL_TEXTURE_2D, texture->id);
    glTexImage2D(GL_TEXTURE_2D, 0, bits == 16 ? GL_DEPTH_COMPONENT16 : GL_DEPTH_COMPONENT24, target->width,
                 target->height, 0, GL_DEPTH_COMPONENT, bits == 16 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT, NULL);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, texture->id, 0);
}

static enum status make_shadow_map(struct gpu_target *target)
{
    if (target->width > target->g->max_size || target->height > target->g->max_size)
        return gpu_fail_too_large(target->g, target->width, target->height);
    attach_depth_texture(target, &target->texture, 16);
    glDrawBuffers(1, &(const GLenum){GL_NONE});
    glReadBuffer(GL_NONE);
    return gpu_check(target->g);
}

static enum status make_color_texture(struct gpu_target *target)
{
    enum status status = gpu_make_texture(&target->texture, GPU_NEAREST, NULL);
    if (status == OK)
        glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target->texture.id, 0);
    return status;
}

static enum status make_target(struct gpu_target *target)
{
    glGenFramebuffers(1, &target->framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    enum status status = target->kind == GPU_TARGET_DEPTH ? make_shadow_map(target) : make_color_texture(target);
    if (status != OK)
        return status;
    if (target->kind == GPU_TARGET_COMPARABLE) {
        attach_depth_texture(target, &target->depth_texture, 24);
    } else if (target->kind == GPU_TARGET_COLOR_DEPTH) {
        glGenRenderbuffers(1, &target->depth);
        glBindRenderbuffer(GL_RENDERBUFFER, target->depth);
        glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, target->width, target->height);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, target->depth);
    }
    status = gpu_check(target->g);
    if (status == OK && glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        status = fail(ERR_DEVICE, "the graphics driver (%s) cannot draw into an image of %d x %d pixels",
                      target->g->renderer, target->width, target->height);
    return status;
}

static enum status open_target(struct gpu_target **out, struct gpu *gpu, enum gpu_target_kind kind, int width,
                               int height)
{
    static const size_t bytes_a_pixel[] = {
        [GPU_TARGET_COLOR_DEPTH] = 8, [GPU_TARGET_COMPARABLE] = 8, [GPU_TARGET_COLOR] = 4, [GPU_TARGET_DEPTH] = 2};
    assert(width > 0 && height > 0);
    *out = NULL;
    gpu_make_current(gpu);
    struct gpu_target *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for a render target");
    *t = (struct gpu_target){.g = gpu,
                             .kind = kind,
                             .width = width,
                             .height = height,
                             .bytes = (size_t)width * (size_t)height * bytes_a_pixel[kind],
                             .texture = {.g = gpu, .format = GPU_RGBA8, .width = width, .height = height}};
    gpu_count_made(gpu, t->bytes);
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

enum status gpu_target_open(struct gpu_target **out, struct gpu *gpu, int width, int height)
{
    return open_target(out, gpu, GPU_TARGET_COLOR_DEPTH, width, height);
}

enum status gpu_target_open_comparable(struct gpu_target **out, struct gpu *gpu, int width, int height)
{
    return open_target(out, gpu, GPU_TARGET_COMPARABLE, width, height);
}

enum status gpu_target_open_color(struct gpu_target **out, struct gpu *gpu, int width, int height)
{
    return open_target(out, gpu, GPU_TARGET_COLOR, width, height);
}

enum status gpu_target_open_depth(struct gpu_target **out, struct gpu *gpu, int width, int height)
{
    return open_target(out, gpu, GPU_TARGET_DEPTH, width, height);
}

void gpu_target_close(struct gpu_target **target)
{
    if (!*target)
        return;
    gpu_make_current((*target)->g);
    (*target)->g->counts.bytes_held -= (*target)->bytes;
    glDeleteFramebuffers(1, &(*target)->framebuffer);
    glDeleteRenderbuffers(1, &(*target)->depth);
    glDeleteTextures(1, &(*target)->texture.id);
    glDeleteTextures(1, &(*target)->depth_texture.id);
    free(*target);
    *target = NULL;
}

void gpu_target_mark_drawn(struct gpu_target *target)
{
    target->left = target->top = 0;
    target->right = target->width, target->bottom = target->height;
}

// A GPU clears a whole target at no cost per pixel, and then need not load its old contents. A software renderer clears
// pixel by pixel: only the area that was drawn into.
void gpu_target_clear(struct gpu_target *target)
{
    bool is_clear = target->right <= target->left || target->bottom <= target->top;
    gpu_make_current(target->g);
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    glClearColor(0, 0, 0, 0);
    glClearDepthf(1);
    glDepthMask(GL_TRUE);
    if (target->g->software_renderer) {
        glEnable(GL_SCISSOR_TEST);
        glScissor(target->left, target->top, target->right - target->left, target->bottom - target->top);
    }
    if (!is_clear || !target->g->software_renderer)
        glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glDisable(GL_SCISSOR_TEST);
    target->left = target->top = target->right = target->bottom = 0;
}

void gpu_target_resize(struct gpu_target *target, int width, int height)
{
    assert(width > 0 && height > 0 && width <= target->texture.width && height <= target->texture.height);
    if (width == target->width && height == target->height)
        return;
    gpu_target_clear(target); // the old size may reach beyond the new one
    target->width = target->texture.used_width = width;
    target->height = target->texture.used_height = height;
}

int gpu_target_width(const struct gpu_target *target) { return target->width; }

const struct gpu_texture *gpu_target_texture(const struct gpu_target *target) { return &target->texture; }

const struct gpu_texture *gpu_target_depth(const struct gpu_target *target)
{
    assert(target->kind == GPU_TARGET_COMPARABLE);
    return &target->depth_texture;
}

enum status gpu_target_read(struct gpu_target *target, uint8_t *rgba)
{
    assert(target->kind != GPU_TARGET_DEPTH);
    gpu_make_current(target->g);
    glBindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    glReadPixels(0, 0, target->width, target->height, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
    return gpu_check(target->g);
}

// ---------------------------------------------------------------- the context

void gpu_make_current(const struct gpu *gpu)
{
    if (!gpu->adopted && eglGetCurrentContext() != gpu->context)
        eglMakeCurrent(gpu->display, EGL_NO_SURFACE, EGL_NO_SURFACE, gpu->context);
}

static const char *error_name(GLenum error)
{
    switch (error) {
    case GL_OUT_OF_MEMORY: return "out of memory";
    case GL_INVALID_ENUM: return "invalid enum";
    case GL_INVALID_VALUE: return "invalid value";
    case GL_INVALID_OPERATION: return "invalid operation";
    case GL_INVALID_FRAMEBUFFER_OPERATION: return "incomplete framebuffer";
    default: return "unknown error";
    }
}

enum status gpu_check(struct gpu *gpu)
{
    gpu_make_current(gpu);
    if (eglGetCurrentContext() == EGL_NO_CONTEXT || (gpu->reset_status && gpu->reset_status() != GL_NO_ERROR))
        return fail(ERR_DEVICE, "the graphics context was lost; start again");
    GLenum first = glGetError();
    if (first == GL_NO_ERROR)
        return OK;
    for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; i++) // bounded: a lost context may report errors for ever
        ;
    return fail(ERR_DEVICE, "the graphics driver (%s) reports: %s", gpu->renderer, error_name(first));
}

bool gpu_has_extension(const char *list, const char *word)
{
    size_t length = strlen(word);
    for (const char *at = list; at && (at = strstr(at, word)); at += length)
        if ((at == list || at[-1] == ' ') && (at[length] == ' ' || at[length] == 0))
            return true;
    return false;
}

static EGLDisplay find_display(void)
{
    const char *client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    if (gpu_has_extension(client, "EGL_MESA_platform_surfaceless")) {
        PFNEGLGETPLATFORMDISPLAYEXTPROC get =
            (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress("eglGetPlatformDisplayEXT");
        EGLDisplay display = get ? get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL) : EGL_NO_DISPLAY;
        if (display != EGL_NO_DISPLAY && eglInitialize(display, NULL, NULL))
            return display;
    }
    EGLDisplay display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
    if (display != EGL_NO_DISPLAY && eglInitialize(display, NULL, NULL))
        return display;
    return EGL_NO_DISPLAY;
}

static enum status make_context(struct gpu *gpu)
{
    gpu->display = find_display();
    if (gpu->display == EGL_NO_DISPLAY)
        return fail(ERR_DEVICE, "no graphics driver answers (EGL error 0x%x); is Mesa's EGL installed?", eglGetError());
    const char *extensions = eglQueryString(gpu->display, EGL_EXTENSIONS);
    if (!eglBindAPI(EGL_OPENGL_ES_API) || !gpu_has_extension(extensions, "EGL_KHR_surfaceless_context"))
        return fail(ERR_DEVICE, "the graphics driver cannot draw without a window; Mesa's can");
    // No surface is ever made, so any config that speaks ES 3 will do.
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_NONE};
    EGLConfig config;
    EGLint count = 0;
    if (!eglChooseConfig(gpu->display, wanted, &config, 1, &count) || count < 1)
        return fail(ERR_DEVICE, "the graphics driver has no OpenGL ES 3");
    // With robustness the driver reports a reset of the GPU.
    const EGLint robust[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_EXT,
                             EGL_LOSE_CONTEXT_ON_RESET_EXT, EGL_NONE};
    const EGLint plain[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_NONE};
    gpu->context = EGL_NO_CONTEXT;
    if (gpu_has_extension(extensions, "EGL_EXT_create_context_robustness"))
        gpu->context = eglCreateContext(gpu->display, config, EGL_NO_CONTEXT, robust);
    if (gpu->context == EGL_NO_CONTEXT)
        gpu->context = eglCreateContext(gpu->display, config, EGL_NO_CONTEXT, plain);
    if (gpu->context == EGL_NO_CONTEXT || !eglMakeCurrent(gpu->display, EGL_NO_SURFACE, EGL_NO_SURFACE, gpu->context))
        return fail(ERR_DEVICE, "no OpenGL ES 3 context could be made (EGL error 0x%x)", eglGetError());
    return OK;
}

static enum status query_limits(struct gpu *gpu)
{
    GLint major = 0;
    glGetIntegerv(GL_MAJOR_VERSION, &major);
    if (major < 3)
        return fail(ERR_DEVICE, "the graphics context is OpenGL ES %d, version 3 is needed", (int)major);
    GLint size = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &size);
    gpu->max_size = size;
    const char *renderer = (const char *)glGetString(GL_RENDERER);
    size_t length = renderer ? strnlen(renderer, sizeof gpu->renderer - 1) : 0;
    if (length)
        memcpy(gpu->renderer, renderer, length);
    gpu->renderer[length] = 0;
    gpu->software_renderer = strstr(gpu->renderer, "llvmpipe") || strstr(gpu->renderer, "softpipe");
    const char *extensions = (const char *)glGetString(GL_EXTENSIONS);
    if (gpu_has_extension(extensions, "GL_KHR_robustness"))
        gpu->reset_status = (gpu_reset_status *)eglGetProcAddress("glGetGraphicsResetStatusKHR");
    else if (gpu_has_extension(extensions, "GL_EXT_robustness"))
        gpu->reset_status = (gpu_reset_status *)eglGetProcAddress("glGetGraphicsResetStatusEXT");
    // Rows without padding; no dithering, so that drivers give the same pixels.
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glDisable(GL_DITHER);
    return OK;
}

static enum status open_as(struct gpu **out, bool adopted)
{
    *out = NULL;
    struct gpu *g = calloc(1, sizeof *g);
    if (!g)
        return fail(ERR_MEMORY, "no memory for the graphics card's objects");
    g->adopted = adopted;
    enum status status = OK;
    if (!adopted)
        status = make_context(g);
    else if ((g->context = eglGetCurrentContext()) == EGL_NO_CONTEXT)
        status = fail(ERR_DEVICE, "there is no graphics context on this thread");
    if (status == OK)
        status = query_limits(g);
    if (status == OK)
        status = gpu_check(g);
    if (status != OK) {
        gpu_close(&g);
        return status;
    }
    *out = g;
    return OK;
}

enum status gpu_open(struct gpu **out) { return open_as(out, false); }
enum status gpu_adopt(struct gpu **out) { return open_as(out, true); }

void gpu_close(struct gpu **gpu)
{
    if (!*gpu)
        return;
    // The display is shared within the process and may serve another context: it is not terminated.
    if (!(*gpu)->adopted && (*gpu)->context != EGL_NO_CONTEXT) {
        eglMakeCurrent((*gpu)->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        eglDestroyContext((*gpu)->display, (*gpu)->context);
    }
    free(*gpu);
    *gpu = NULL;
}

const char *gpu_renderer(const struct gpu *gpu) { return gpu->renderer; }
bool gpu_is_software(const struct gpu *gpu) { return gpu->software_renderer; }
int gpu_max_size(const struct gpu *gpu) { return gpu->max_size; }
struct gpu_counts gpu_get_counts(const struct gpu *gpu) { return gpu->counts; }

void gpu_count_made(struct gpu *gpu, size_t bytes)
{
    gpu->counts.made++;
    gpu->counts.bytes_held += bytes;
}

// ---------------------------------------------------------------- programs

// word: #defined after the first line; may be NULL.
static enum status compile_shader(GLuint *out, GLenum kind, const char *text, const char *word, const char *name)
{
    GLuint shader = glCreateShader(kind);
    const size_t version = strcspn(text, "\n");
    char define[80] = "\n";
    if (word)
        snprintf(define, sizeof define, "\n#define %s\n#line 2\n", word);
    const char *const parts[] = {text, define, text[version] ? text + version + 1 : ""};
    glShaderSource(shader, 3, parts, (const GLint[]){(GLint)version, -1, -1});
    glCompileShader(shader);
    GLint good = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    *out = shader;
    if (good)
        return OK;
    char log[300] = "";
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    return fail(ERR_DEVICE, "the %s shader '%s' does not compile: %s", kind == GL_VERTEX_SHADER ? "vertex" : "fragment",
                name, log);
}

static enum status link_program(struct gpu_program *program, GLuint vertex, GLuint fragment, const char *name)
{
    glAttachShader(program->id, vertex);
    glAttachShader(program->id, fragment);
    glLinkProgram(program->id);
    GLint good = 0;
    glGetProgramiv(program->id, GL_LINK_STATUS, &good);
    if (good)
        return OK;
    char log[300] = "";
    glGetProgramInfoLog(program->id, sizeof log, NULL, log);
    return fail(ERR_DEVICE, "the shaders of '%s' do not link: %s", name, log);
}

static enum status find_inputs(struct gpu_program *program, const struct gpu_program_source *text)
{
    glUseProgram(program->id);
    for (int i = 0; i < text->uniform_count; i++) {
        if (!text->uniforms[i])
            continue;
        program->uniforms[i] = glGetUniformLocation(program->id, text->uniforms[i]);
        if (program->uniforms[i] < 0)
            return fail(ERR_DEVICE, "the shaders of '%s' have no uniform '%s'", text->name, text->uniforms[i]);
    }
    for (int i = 0; i < text->sampler_count; i++) {
        GLint location = glGetUniformLocation(program->id, text->samplers[i]);
        if (location < 0)
            return fail(ERR_DEVICE, "the shaders of '%s' have no sampler '%s'", text->name, text->samplers[i]);
        glUniform1i(location, i);
    }
    return OK;
}

enum status gpu_program_open(struct gpu_program **out, struct gpu *gpu, const struct gpu_program_source *text)
{
    assert(text->uniform_count <= MAX_UNIFORMS && text->sampler_count <= MAX_SAMPLERS);
    *out = NULL;
    gpu_make_current(gpu);
    struct gpu_program *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for the graphics card's objects");
    p->g = gpu;
    p->sampler_count = text->sampler_count;
    p->id = glCreateProgram();
    GLuint vertex = 0, fragment = 0;
    enum status status = compile_shader(&vertex, GL_VERTEX_SHADER, text->vertex, text->word, text->name);
    if (status == OK)
        status = compile_shader(&fragment, GL_FRAGMENT_SHADER, text->fragment, text->word, text->name);
    if (status == OK)
        status = link_program(p, vertex, fragment, text->name);
    glDeleteShader(vertex); // 0 is ignored; attached shaders are freed with the program
    glDeleteShader(fragment);
    if (status == OK)
        status = find_inputs(p, text);
    if (status == OK)
        status = gpu_check(gpu);
    if (status != OK) {
        gpu_program_close(&p);
        return status;
    }
    gpu_count_made(gpu, 0);
    *out = p;
    return OK;
}

void gpu_program_close(struct gpu_program **program)
{
    if (!*program)
        return;
    gpu_make_current((*program)->g);
    glDeleteProgram((*program)->id);
    free(*program);
    *program = NULL;
}

void gpu_program_set(struct gpu_program *program, int index, const float *vec4s, int count)
{
    assert(index >= 0 && index < MAX_UNIFORMS);
    gpu_make_current(program->g);
    glUseProgram(program->id);
    glUniform4fv(program->uniforms[index], count, vec4s);
}

// ---------------------------------------------------------------- textures

static size_t texture_bytes(const struct gpu_texture *texture)
{
    if (texture->layers)
        return texture->bytes;
    if (texture->borrowed)
        return 0;
    const size_t pixel_bytes = texture->format == GPU_RGB8 ? 4 : (size_t)texture->format;
    return (size_t)texture->width * (size_t)texture->height * pixel_bytes;
}

static GLenum layout_of(const struct gpu_texture *texture)
{
    static const GLenum layouts[] = {[GPU_R8] = GL_RED, [GPU_RG8] = GL_RG, [GPU_RGB8] = GL_RGB, [GPU_RGBA8] = GL_RGBA};
    return layouts[texture->format];
}

enum status gpu_fail_too_large(const struct gpu *gpu, int width, int height)
{
    return fail(ERR_DEVICE, "an image of %d x %d pixels is larger than the %d this graphics driver (%s) takes", width,
                height, gpu->max_size, gpu->renderer);
}

enum status gpu_make_texture(struct gpu_texture *texture, enum gpu_filter filter, const uint8_t *pixels)
{
    if (texture->width > texture->g->max_size || texture->height > texture->g->max_size)
        return gpu_fail_too_large(texture->g, texture->width, texture->height);
    glGenTextures(1, &texture->id);
    glBindTexture(GL_TEXTURE_2D, texture->id);
    static const GLint kept[] = {[GPU_R8] = GL_R8, [GPU_RG8] = GL_RG8, [GPU_RGB8] = GL_RGB8, [GPU_RGBA8] = GL_RGBA8};
    glTexImage2D(GL_TEXTURE_2D, 0, kept[texture->format], texture->width, texture->height, 0, layout_of(texture),
                 GL_UNSIGNED_BYTE, pixels);
    GLint how = filter == GPU_LINEAR ? GL_LINEAR : GL_NEAREST;
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, how);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, how);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    return gpu_check(texture->g);
}

enum status gpu_texture_open(struct gpu_texture **out, struct gpu *gpu, const struct gpu_texture_layout *layout,
                             const uint8_t *pixels)
{
    assert(layout->width > 0 && layout->height > 0);
    *out = NULL;
    gpu_make_current(gpu);
    struct gpu_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for the graphics card's objects");
    *t = (struct gpu_texture){.g = gpu, .format = layout->format, .width = layout->width, .height = layout->height};
    enum status status = gpu_make_texture(t, layout->filter, pixels);
    gpu_count_made(gpu, texture_bytes(t));
    gpu->counts.uploads += pixels != NULL;
    if (status != OK) {
        gpu_texture_close(&t);
        return status;
    }
    *out = t;
    return OK;
}

void gpu_texture_close(struct gpu_texture **texture)
{
    if (!*texture)
        return;
    gpu_make_current((*texture)->g);
    glDeleteTextures(1, &(*texture)->id);
    (*texture)->g->counts.bytes_held -= texture_bytes(*texture);
    free(*texture);
    *texture = NULL;
}

void gpu_texture_write_rows(struct gpu_texture *texture, int first, int count, const uint8_t *pixels)
{
    gpu_make_current(texture->g);
    texture->g->counts.uploads++;
    glBindTexture(GL_TEXTURE_2D, texture->id);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, first, texture->width, count, layout_of(texture), GL_UNSIGNED_BYTE, pixels);
}

void gpu_texture_write(struct gpu_texture *texture, const uint8_t *pixels)
{
    gpu_texture_write_rows(texture, 0, texture->height, pixels);
}

enum status gpu_texture_put(struct gpu_texture **texture, struct gpu *gpu, const struct gpu_texture_layout *layout,
                            const uint8_t *pixels)
{
    const struct gpu_texture *now = *texture;
    if (now && now->format == layout->format && now->width == layout->width && now->height == layout->height) {
        gpu_texture_write(*texture, pixels);
        return OK;
    }
    gpu_texture_close(texture);
    return gpu_texture_open(texture, gpu, layout, pixels);
}

// ---------------------------------------------------------------- arrays of textures

static const struct {
    GLenum kept, layout, type;
    size_t bytes; // a pixel, as GPUs store it
} array_formats[] = {[GPU_ARRAY_RGB8] = {GL_RGB8, GL_RGB, GL_UNSIGNED_BYTE, 4},
                     [GPU_ARRAY_R16F] = {GL_R16F, GL_RED, GL_FLOAT, 2},
                     [GPU_ARRAY_RG16F] = {GL_RG16F, GL_RG, GL_FLOAT, 4}};

enum status gpu_texture_open_array(struct gpu_texture **out, struct gpu *gpu, const struct gpu_array_layout *layout)
{
    const int width = layout->width, height = layout->height, layers = layout->layers;
    assert(width > 0 && height > 0 && layers > 0);
    *out = NULL;
    gpu_make_current(gpu);
    if (width > gpu->max_size || height > gpu->max_size)
        return gpu_fail_too_large(gpu, width, height);
    struct gpu_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for the graphics card's objects");
    *t = (struct gpu_texture){.g = gpu, .array_format = layout->format, .width = width, .height = height};
    t->layers = layers;
    t->bytes = (size_t)width * (size_t)height * (size_t)layers * array_formats[layout->format].bytes;
    gpu_count_made(gpu, t->bytes);
    glGenTextures(1, &t->id);
    glBindTexture(GL_TEXTURE_2D_ARRAY, t->id);
    glTexStorage3D(GL_TEXTURE_2D_ARRAY, 1, array_formats[layout->format].kept, width, height, layers);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    const enum status status = gpu_check(gpu);
    if (status != OK)
        gpu_texture_close(&t);
    *out = t;
    return status;
}

void gpu_texture_write_layer(struct gpu_texture *texture, int layer, int width, int height, const void *values)
{
    assert(layer < texture->layers && width <= texture->width && height <= texture->height);
    gpu_make_current(texture->g);
    texture->g->counts.uploads++;
    glBindTexture(GL_TEXTURE_2D_ARRAY, texture->id);
    glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, layer, width, height, 1, array_formats[texture->array_format].layout,
                    array_formats[texture->array_format].type, values);
}

// ---------------------------------------------------------------- meshes

enum status gpu_mesh_open(struct gpu_mesh **out, struct gpu *gpu, const struct gpu_mesh_data *data)
{
    const int components = data->components, vertex_count = data->vertex_count, index_count = data->index_count;
    assert(((components >= 2 && components <= 4) || (components % 4 == 0 && components <= 20)) && vertex_count > 0 &&
           vertex_count <= 65536 && index_count >= 0);
    *out = NULL;
    gpu_make_current(gpu);
    struct gpu_mesh *m = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "no memory for the graphics card's objects");
    *m = (struct gpu_mesh){.g = gpu,
                           .index_count = index_count,
                           .vertex_count = vertex_count,
                           .bytes = sizeof(float) * (size_t)components * (size_t)vertex_count +
                                    sizeof(uint16_t) * (size_t)index_count};
    gpu_count_made(gpu, m->bytes);
    gpu->counts.uploads += data->vertices != NULL;
    glGenVertexArrays(1, &m->array);
    glGenBuffers(1, &m->vertices);
    glGenBuffers(1, &m->indices);
    glBindVertexArray(m->array);
    glBindBuffer(GL_ARRAY_BUFFER, m->vertices);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)sizeof(float) * components * vertex_count, data->vertices,
                 GL_STATIC_DRAW);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, m->indices);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)sizeof(uint16_t) * index_count, data->indices, GL_STATIC_DRAW);
    for (int at = 0; at < components; at += 4) {
        int size = components - at < 4 ? components - at : 4;
        glEnableVertexAttribArray((GLuint)at / 4);
        glVertexAttribPointer((GLuint)at / 4, size, GL_FLOAT, GL_FALSE, (GLsizei)sizeof(float) * components,
                              (const void *)(sizeof(float) * (size_t)at));
    }
    glBindVertexArray(0);
    enum status status = gpu_check(gpu);
    if (status != OK) {
        gpu_mesh_close(&m);
        return status;
    }
    *out = m;
    return OK;
}

void gpu_mesh_write_vertices(struct gpu_mesh *mesh, int first, const float *floats, int count)
{
    gpu_make_current(mesh->g);
    mesh->g->counts.uploads++;
    glBindBuffer(GL_ARRAY_BUFFER, mesh->vertices);
    glBufferSubData(GL_ARRAY_BUFFER, (GLintptr)sizeof(float) * first, (GLsizeiptr)sizeof(float) * count, floats);
}

void gpu_mesh_write_indices(struct gpu_mesh *mesh, int first, const uint16_t *indices, int count)
{
    gpu_make_current(mesh->g);
    mesh->g->counts.uploads++;
    glBindVertexArray(mesh->array); // the index buffer's binding belongs to it
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, mesh->indices);
    glBufferSubData(GL_ELEMENT_ARRAY_BUFFER, (GLintptr)sizeof(uint16_t) * first, (GLsizeiptr)sizeof(uint16_t) * count,
                    indices);
    glBindVertexArray(0);
}

void gpu_mesh_close(struct gpu_mesh **mesh)
{
    if (!*mesh)
        return;
    gpu_make_current((*mesh)->g);
    (*mesh)->g->counts.bytes_held -= (*mesh)->bytes;
    glDeleteVertexArrays(1, &(*mesh)->array);
    glDeleteBuffers(1, &(*mesh)->vertices);
    glDeleteBuffers(1, &(*mesh)->indices);
    free(*mesh);
    *mesh = NULL;
}
