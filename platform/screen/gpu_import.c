#include "platform/screen/gpu_import.h"
#include "platform/screen/gpu_internal.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES2/gl2ext.h>

#include <stdlib.h>

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

bool gpu_can_import(struct gpu *g)
{
    gpu_make_current(g);
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

static enum status bind_image(struct gpu_texture *t, EGLDisplay display, const struct gpu_dmabuf *memory)
{
    PFNEGLCREATEIMAGEKHRPROC create = (PFNEGLCREATEIMAGEKHRPROC)eglGetProcAddress("eglCreateImageKHR");
    PFNEGLDESTROYIMAGEKHRPROC destroy = (PFNEGLDESTROYIMAGEKHRPROC)eglGetProcAddress("eglDestroyImageKHR");
    PFNGLEGLIMAGETARGETTEXTURE2DOESPROC use =
        (PFNGLEGLIMAGETARGETTEXTURE2DOESPROC)eglGetProcAddress("glEGLImageTargetTexture2DOES");
    if (!create || !destroy || !use)
        return fail(ERR_DEVICE, "the graphics driver (%s) cannot import memory", t->g->renderer);
    const EGLint what[] = {EGL_WIDTH,
                           t->width,
                           EGL_HEIGHT,
                           t->height,
                           EGL_LINUX_DRM_FOURCC_EXT,
                           drm_format(t->format),
                           EGL_DMA_BUF_PLANE0_FD_EXT,
                           memory->file,
                           EGL_DMA_BUF_PLANE0_OFFSET_EXT,
                           (EGLint)memory->offset,
                           EGL_DMA_BUF_PLANE0_PITCH_EXT,
                           (EGLint)memory->stride,
                           EGL_NONE};
    EGLImageKHR image = create(display, EGL_NO_CONTEXT, EGL_LINUX_DMA_BUF_EXT, NULL, what);
    if (image == EGL_NO_IMAGE_KHR)
        return fail(ERR_DEVICE, "the graphics driver (%s) cannot read the memory (EGL error 0x%x)", t->g->renderer,
                    eglGetError());
    glBindTexture(GL_TEXTURE_2D, t->id);
    use(GL_TEXTURE_2D, image);
    destroy(display, image); // the texture keeps its own reference
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return gpu_check(t->g);
}

enum status gpu_texture_import(struct gpu_texture **out, struct gpu *g, enum gpu_format format, int width, int height,
                               const struct gpu_dmabuf *memory)
{
    assert(width > 0 && height > 0 && drm_format(format));
    *out = NULL;
    enum status status = gpu_check(g); // report earlier errors separately
    if (status != OK)
        return status;
    struct gpu_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "out of memory");
    *t = (struct gpu_texture){.g = g, .format = format, .width = width, .height = height, .borrowed = true};
    glGenTextures(1, &t->id);
    g->counts.made++;
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

enum status gpu_fence_open(struct gpu_fence **out, struct gpu *g)
{
    *out = NULL;
    struct gpu_fence *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    gpu_make_current(g);
    *f = (struct gpu_fence){g, glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)};
    if (!f->sync) {
        free(f);
        return fail(ERR_DEVICE, "the graphics driver (%s) has no fences", g->renderer);
    }
    *out = f;
    return OK;
}

bool gpu_fence_passed(struct gpu_fence *f, bool wait)
{
    gpu_make_current(f->g);
    GLenum result = glClientWaitSync(f->sync, GL_SYNC_FLUSH_COMMANDS_BIT, wait ? 1000000000 : 0);
    return result != GL_TIMEOUT_EXPIRED;
}

void gpu_fence_close(struct gpu_fence **f)
{
    if (!*f)
        return;
    gpu_make_current((*f)->g);
    glDeleteSync((*f)->sync);
    free(*f);
    *f = NULL;
}
