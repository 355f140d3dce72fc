// What gpu.c, gpu_target.c, gpu_draw2d.c and gpu_import.c share: the objects behind gpu.h. For those
// alone; names are OpenGL's.
#pragma once
#include "platform/gpu.h"

#include <GLES3/gl3.h>

enum { MAX_UNIFORMS = 16, MAX_SAMPLERS = 4 };

typedef unsigned gpu_reset_status(void);

struct gpu {
    void *display, *context; // EGL's
    bool adopted;
    bool software_renderer; // no graphics chip draws, but the processor
    char renderer[128];
    int max_size;
    gpu_reset_status *reset_status; // NULL: the driver cannot say
    struct gpu_counts counts;
};

struct gpu_program {
    struct gpu *g;
    unsigned id;
    int uniforms[MAX_UNIFORMS];
    int sampler_count;
};

struct gpu_texture {
    struct gpu *g;
    unsigned id;
    enum gpu_format format;
    int width, height;
    int used_width, used_height; // of a target's, which may be used in part; else 0: all of it
    bool borrowed;               // somebody else's memory
};

struct gpu_mesh {
    struct gpu *g;
    unsigned array, vertices, indices;
    int index_count;
    size_t bytes;
};

enum gpu_target_kind { GPU_TARGET_COLOR_DEPTH, GPU_TARGET_COLOR, GPU_TARGET_DEPTH };

struct gpu_target {
    struct gpu *g;
    enum gpu_target_kind kind;
    int width, height; // as it is used; its texture keeps what it was opened for
    size_t bytes;
    unsigned framebuffer, depth; // framebuffer around `texture`, and its renderbuffer, of a whole one
    struct gpu_texture texture;
    int left, top, right, bottom; // where something was drawn since it was cleared; right <= left: nowhere
};

void gpu_count_made(struct gpu *g, size_t bytes);

// Of a size that this driver does not take: the sentence, ERR_DEVICE.
MUST_CHECK enum status gpu_fail_too_large(const struct gpu *g, int width, int height);

// The texture of that format and size itself. ERR_DEVICE.
MUST_CHECK enum status gpu_make_texture(struct gpu_texture *t, enum gpu_filter filter, const uint8_t *pixels);

// All of the target may have been drawn into.
void gpu_target_mark_drawn(struct gpu_target *t);

// Makes the gpu's context current, unless it is or is somebody else's to keep so.
void gpu_make_current(const struct gpu *g);

// Is the word in a list of words with blanks between them? A list that is NULL has none.
bool gpu_has_extension(const char *list, const char *word);
