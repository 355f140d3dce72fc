#include "platform/screen/gpu_internal.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- the context

void gpu_make_current(const struct gpu *g)
{
    if (!g->adopted && eglGetCurrentContext() != g->context)
        eglMakeCurrent(g->display, EGL_NO_SURFACE, EGL_NO_SURFACE, g->context);
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

enum status gpu_check(struct gpu *g)
{
    gpu_make_current(g);
    if (eglGetCurrentContext() == EGL_NO_CONTEXT || (g->reset_status && g->reset_status() != GL_NO_ERROR))
        return fail(ERR_DEVICE, "the graphics context was lost; start again");
    GLenum first = glGetError();
    if (first == GL_NO_ERROR)
        return OK;
    for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; i++) // bounded: a lost context may report errors for ever
        ;
    return fail(ERR_DEVICE, "the graphics driver (%s) reports: %s", g->renderer, error_name(first));
}

enum status gpu_wait(struct gpu *g)
{
    gpu_make_current(g);
    glFinish();
    return gpu_check(g);
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

static enum status make_context(struct gpu *g)
{
    g->display = find_display();
    if (g->display == EGL_NO_DISPLAY)
        return fail(ERR_DEVICE, "no graphics driver answers (EGL error 0x%x); is Mesa's EGL installed?", eglGetError());
    const char *extensions = eglQueryString(g->display, EGL_EXTENSIONS);
    if (!eglBindAPI(EGL_OPENGL_ES_API) || !gpu_has_extension(extensions, "EGL_KHR_surfaceless_context"))
        return fail(ERR_DEVICE, "the graphics driver cannot draw without a window; Mesa's can");
    // No surface is ever made, so any config that speaks ES 3 will do.
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_NONE};
    EGLConfig config;
    EGLint count = 0;
    if (!eglChooseConfig(g->display, wanted, &config, 1, &count) || count < 1)
        return fail(ERR_DEVICE, "the graphics driver has no OpenGL ES 3");
    // With robustness the driver reports a reset of the GPU.
    const EGLint robust[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_EXT,
                             EGL_LOSE_CONTEXT_ON_RESET_EXT, EGL_NONE};
    const EGLint plain[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_NONE};
    g->context = EGL_NO_CONTEXT;
    if (gpu_has_extension(extensions, "EGL_EXT_create_context_robustness"))
        g->context = eglCreateContext(g->display, config, EGL_NO_CONTEXT, robust);
    if (g->context == EGL_NO_CONTEXT)
        g->context = eglCreateContext(g->display, config, EGL_NO_CONTEXT, plain);
    if (g->context == EGL_NO_CONTEXT || !eglMakeCurrent(g->display, EGL_NO_SURFACE, EGL_NO_SURFACE, g->context))
        return fail(ERR_DEVICE, "no OpenGL ES 3 context could be made (EGL error 0x%x)", eglGetError());
    return OK;
}

static enum status query_limits(struct gpu *g)
{
    GLint major = 0;
    glGetIntegerv(GL_MAJOR_VERSION, &major);
    if (major < 3)
        return fail(ERR_DEVICE, "the graphics context is OpenGL ES %d, version 3 is needed", (int)major);
    GLint size = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &size);
    g->max_size = size;
    const char *renderer = (const char *)glGetString(GL_RENDERER);
    size_t length = renderer ? strnlen(renderer, sizeof g->renderer - 1) : 0;
    if (length)
        memcpy(g->renderer, renderer, length);
    g->renderer[length] = 0;
    g->software_renderer = strstr(g->renderer, "llvmpipe") || strstr(g->renderer, "softpipe");
    const char *extensions = (const char *)glGetString(GL_EXTENSIONS);
    if (gpu_has_extension(extensions, "GL_KHR_robustness"))
        g->reset_status = (gpu_reset_status *)eglGetProcAddress("glGetGraphicsResetStatusKHR");
    else if (gpu_has_extension(extensions, "GL_EXT_robustness"))
        g->reset_status = (gpu_reset_status *)eglGetProcAddress("glGetGraphicsResetStatusEXT");
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
        return fail(ERR_MEMORY, "out of memory");
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

void gpu_close(struct gpu **g)
{
    if (!*g)
        return;
    // The display is shared within the process and may serve another context: it is not terminated.
    if (!(*g)->adopted && (*g)->context != EGL_NO_CONTEXT) {
        eglMakeCurrent((*g)->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        eglDestroyContext((*g)->display, (*g)->context);
    }
    free(*g);
    *g = NULL;
}

const char *gpu_renderer(const struct gpu *g) { return g->renderer; }
bool gpu_is_software(const struct gpu *g) { return g->software_renderer; }
int gpu_max_size(const struct gpu *g) { return g->max_size; }
struct gpu_counts gpu_get_counts(const struct gpu *g) { return g->counts; }

void gpu_count_made(struct gpu *g, size_t bytes)
{
    g->counts.made++;
    g->counts.bytes_held += bytes;
}

// ---------------------------------------------------------------- programs

// word: #defined after the first line; may be NULL.
static enum status compile(GLuint *out, GLenum kind, const char *text, const char *word, const char *name)
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

static enum status link_program(struct gpu_program *p, GLuint vertex, GLuint fragment, const char *name)
{
    glAttachShader(p->id, vertex);
    glAttachShader(p->id, fragment);
    glLinkProgram(p->id);
    GLint good = 0;
    glGetProgramiv(p->id, GL_LINK_STATUS, &good);
    if (good)
        return OK;
    char log[300] = "";
    glGetProgramInfoLog(p->id, sizeof log, NULL, log);
    return fail(ERR_DEVICE, "the shaders of '%s' do not link: %s", name, log);
}

static enum status find_inputs(struct gpu_program *p, const struct gpu_program_source *text)
{
    glUseProgram(p->id);
    for (int i = 0; i < text->uniform_count; i++) {
        if (!text->uniforms[i])
            continue;
        p->uniforms[i] = glGetUniformLocation(p->id, text->uniforms[i]);
        if (p->uniforms[i] < 0)
            return fail(ERR_DEVICE, "the shaders of '%s' have no uniform '%s'", text->name, text->uniforms[i]);
    }
    for (int i = 0; i < text->sampler_count; i++) {
        GLint location = glGetUniformLocation(p->id, text->samplers[i]);
        if (location < 0)
            return fail(ERR_DEVICE, "the shaders of '%s' have no sampler '%s'", text->name, text->samplers[i]);
        glUniform1i(location, i);
    }
    return OK;
}

enum status gpu_program_open(struct gpu_program **out, struct gpu *g, const struct gpu_program_source *text)
{
    assert(text->uniform_count <= MAX_UNIFORMS && text->sampler_count <= MAX_SAMPLERS);
    *out = NULL;
    gpu_make_current(g);
    struct gpu_program *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "out of memory");
    p->g = g;
    p->sampler_count = text->sampler_count;
    p->id = glCreateProgram();
    GLuint vertex = 0, fragment = 0;
    enum status status = compile(&vertex, GL_VERTEX_SHADER, text->vertex, text->word, text->name);
    if (status == OK)
        status = compile(&fragment, GL_FRAGMENT_SHADER, text->fragment, text->word, text->name);
    if (status == OK)
        status = link_program(p, vertex, fragment, text->name);
    glDeleteShader(vertex); // 0 is ignored; attached shaders are freed with the program
    glDeleteShader(fragment);
    if (status == OK)
        status = find_inputs(p, text);
    if (status == OK)
        status = gpu_check(g);
    if (status != OK) {
        gpu_program_close(&p);
        return status;
    }
    gpu_count_made(g, 0);
    *out = p;
    return OK;
}

void gpu_program_close(struct gpu_program **p)
{
    if (!*p)
        return;
    gpu_make_current((*p)->g);
    glDeleteProgram((*p)->id);
    free(*p);
    *p = NULL;
}

void gpu_program_set(struct gpu_program *p, int index, const float *vec4s, int count)
{
    assert(index >= 0 && index < MAX_UNIFORMS);
    gpu_make_current(p->g);
    glUseProgram(p->id);
    glUniform4fv(p->uniforms[index], count, vec4s);
}

// ---------------------------------------------------------------- textures

static size_t texture_bytes(const struct gpu_texture *t)
{
    if (t->layers)
        return t->bytes;
    if (t->borrowed)
        return 0;
    const size_t pixel_bytes = t->format == GPU_RGB8 ? 4 : (size_t)t->format;
    return (size_t)t->width * (size_t)t->height * pixel_bytes;
}

static GLenum layout_of(const struct gpu_texture *t)
{
    static const GLenum layouts[] = {[GPU_R8] = GL_RED, [GPU_RG8] = GL_RG, [GPU_RGB8] = GL_RGB, [GPU_RGBA8] = GL_RGBA};
    return layouts[t->format];
}

enum status gpu_fail_too_large(const struct gpu *g, int width, int height)
{
    return fail(ERR_DEVICE, "an image of %d x %d pixels is larger than the %d this graphics driver (%s) takes", width,
                height, g->max_size, g->renderer);
}

enum status gpu_make_texture(struct gpu_texture *t, enum gpu_filter filter, const uint8_t *pixels)
{
    if (t->width > t->g->max_size || t->height > t->g->max_size)
        return gpu_fail_too_large(t->g, t->width, t->height);
    glGenTextures(1, &t->id);
    glBindTexture(GL_TEXTURE_2D, t->id);
    static const GLint kept[] = {[GPU_R8] = GL_R8, [GPU_RG8] = GL_RG8, [GPU_RGB8] = GL_RGB8, [GPU_RGBA8] = GL_RGBA8};
    glTexImage2D(GL_TEXTURE_2D, 0, kept[t->format], t->width, t->height, 0, layout_of(t), GL_UNSIGNED_BYTE, pixels);
    GLint how = filter == GPU_LINEAR ? GL_LINEAR : GL_NEAREST;
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, how);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, how);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    return gpu_check(t->g);
}

enum status gpu_texture_open(struct gpu_texture **out, struct gpu *g, const struct gpu_texture_layout *layout,
                             const uint8_t *pixels)
{
    assert(layout->width > 0 && layout->height > 0);
    *out = NULL;
    gpu_make_current(g);
    struct gpu_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "out of memory");
    *t = (struct gpu_texture){.g = g, .format = layout->format, .width = layout->width, .height = layout->height};
    enum status status = gpu_make_texture(t, layout->filter, pixels);
    gpu_count_made(g, texture_bytes(t));
    g->counts.uploads += pixels != NULL;
    if (status != OK) {
        gpu_texture_close(&t);
        return status;
    }
    *out = t;
    return OK;
}

void gpu_texture_close(struct gpu_texture **t)
{
    if (!*t)
        return;
    gpu_make_current((*t)->g);
    glDeleteTextures(1, &(*t)->id);
    (*t)->g->counts.bytes_held -= texture_bytes(*t);
    free(*t);
    *t = NULL;
}

void gpu_texture_write_rows(struct gpu_texture *t, int first, int count, const uint8_t *pixels)
{
    gpu_make_current(t->g);
    t->g->counts.uploads++;
    glBindTexture(GL_TEXTURE_2D, t->id);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, first, t->width, count, layout_of(t), GL_UNSIGNED_BYTE, pixels);
}

void gpu_texture_write(struct gpu_texture *t, const uint8_t *pixels)
{
    gpu_texture_write_rows(t, 0, t->height, pixels);
}

enum status gpu_texture_put(struct gpu_texture **t, struct gpu *g, const struct gpu_texture_layout *layout,
                            const uint8_t *pixels)
{
    const struct gpu_texture *now = *t;
    if (now && now->format == layout->format && now->width == layout->width && now->height == layout->height) {
        gpu_texture_write(*t, pixels);
        return OK;
    }
    gpu_texture_close(t);
    return gpu_texture_open(t, g, layout, pixels);
}

// ---------------------------------------------------------------- arrays of textures

static const struct {
    GLenum kept, layout, type;
    size_t bytes; // a pixel, as GPUs store it
} array_formats[] = {[GPU_ARRAY_RGB8] = {GL_RGB8, GL_RGB, GL_UNSIGNED_BYTE, 4},
                     [GPU_ARRAY_R16F] = {GL_R16F, GL_RED, GL_FLOAT, 2},
                     [GPU_ARRAY_RG16F] = {GL_RG16F, GL_RG, GL_FLOAT, 4}};

enum status gpu_texture_open_array(struct gpu_texture **out, struct gpu *g, const struct gpu_array_layout *layout)
{
    const int width = layout->width, height = layout->height, layers = layout->layers;
    assert(width > 0 && height > 0 && layers > 0);
    *out = NULL;
    gpu_make_current(g);
    if (width > g->max_size || height > g->max_size)
        return gpu_fail_too_large(g, width, height);
    struct gpu_texture *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "out of memory");
    *t = (struct gpu_texture){.g = g, .array_format = layout->format, .width = width, .height = height};
    t->layers = layers;
    t->bytes = (size_t)width * (size_t)height * (size_t)layers * array_formats[layout->format].bytes;
    gpu_count_made(g, t->bytes);
    glGenTextures(1, &t->id);
    glBindTexture(GL_TEXTURE_2D_ARRAY, t->id);
    glTexStorage3D(GL_TEXTURE_2D_ARRAY, 1, array_formats[layout->format].kept, width, height, layers);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    const enum status status = gpu_check(g);
    if (status != OK)
        gpu_texture_close(&t);
    *out = t;
    return status;
}

void gpu_texture_write_layer(struct gpu_texture *t, int layer, int width, int height, const void *values)
{
    assert(layer < t->layers && width <= t->width && height <= t->height);
    gpu_make_current(t->g);
    t->g->counts.uploads++;
    glBindTexture(GL_TEXTURE_2D_ARRAY, t->id);
    glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, layer, width, height, 1, array_formats[t->array_format].layout,
                    array_formats[t->array_format].type, values);
}

// ---------------------------------------------------------------- meshes

enum status gpu_mesh_open(struct gpu_mesh **out, struct gpu *g, const struct gpu_mesh_data *data)
{
    const int components = data->components, vertex_count = data->vertex_count, index_count = data->index_count;
    assert(((components >= 2 && components <= 4) || (components % 4 == 0 && components <= 20)) && vertex_count > 0 &&
           vertex_count <= 65536 && index_count >= 0);
    *out = NULL;
    gpu_make_current(g);
    struct gpu_mesh *m = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "out of memory");
    *m = (struct gpu_mesh){.g = g,
                           .index_count = index_count,
                           .vertex_count = vertex_count,
                           .bytes = sizeof(float) * (size_t)components * (size_t)vertex_count +
                                    sizeof(uint16_t) * (size_t)index_count};
    gpu_count_made(g, m->bytes);
    g->counts.uploads += data->vertices != NULL;
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
    enum status status = gpu_check(g);
    if (status != OK) {
        gpu_mesh_close(&m);
        return status;
    }
    *out = m;
    return OK;
}

void gpu_mesh_write_vertices(struct gpu_mesh *m, int first, const float *floats, int count)
{
    gpu_make_current(m->g);
    m->g->counts.uploads++;
    glBindBuffer(GL_ARRAY_BUFFER, m->vertices);
    glBufferSubData(GL_ARRAY_BUFFER, (GLintptr)sizeof(float) * first, (GLsizeiptr)sizeof(float) * count, floats);
}

void gpu_mesh_write_indices(struct gpu_mesh *m, int first, const uint16_t *indices, int count)
{
    gpu_make_current(m->g);
    m->g->counts.uploads++;
    glBindVertexArray(m->array); // the index buffer's binding belongs to it
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, m->indices);
    glBufferSubData(GL_ELEMENT_ARRAY_BUFFER, (GLintptr)sizeof(uint16_t) * first, (GLsizeiptr)sizeof(uint16_t) * count,
                    indices);
    glBindVertexArray(0);
}

void gpu_mesh_close(struct gpu_mesh **m)
{
    if (!*m)
        return;
    gpu_make_current((*m)->g);
    (*m)->g->counts.bytes_held -= (*m)->bytes;
    glDeleteVertexArrays(1, &(*m)->array);
    glDeleteBuffers(1, &(*m)->vertices);
    glDeleteBuffers(1, &(*m)->indices);
    free(*m);
    *m = NULL;
}
