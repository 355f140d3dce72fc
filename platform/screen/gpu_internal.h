// The objects behind gpu.h, shared by gpu.c and gpu_draw2d.c only. Names are
// OpenGL's.
#pragma once
#include "platform/screen/gpu.h"

#include <GLES3/gl3.h>

enum { MAX_UNIFORMS = 16, MAX_SAMPLERS = 4 };

typedef unsigned gpu_reset_status(void);

struct gpu {
    void *display, *context; // EGL's
    bool adopted;
    bool software_renderer; // drawn by the processor (Mesa's llvmpipe or softpipe)
    char renderer[128];
    int max_size;
    gpu_reset_status *reset_status; // NULL: the driver cannot report a reset
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
    int layers; // of an array; 0: it is none
    enum gpu_array_format array_format;
    size_t bytes;                // of an array
    int used_width, used_height; // of a target's texture, which may be used in part; 0: all of it
    bool borrowed;               // imported memory, not counted in bytes_held
};

struct gpu_mesh {
    struct gpu *g;
    unsigned array, vertices, indices;
    int index_count, vertex_count;
    size_t bytes;
};

enum gpu_target_kind { GPU_TARGET_COLOR_DEPTH, GPU_TARGET_COMPARABLE, GPU_TARGET_COLOR, GPU_TARGET_DEPTH };

struct gpu_target {
    struct gpu *g;
    enum gpu_target_kind kind;
    int width, height; // in use; the texture keeps the size it was opened with
    size_t bytes;
    unsigned framebuffer, depth; // `depth`: renderbuffer of GPU_TARGET_COLOR_DEPTH, otherwise 0
    struct gpu_texture texture;
    struct gpu_texture depth_texture; // of GPU_TARGET_COMPARABLE
    int left, top, right, bottom;     // bounds of what was drawn since the last clear; right <= left: nothing
};

void gpu_count_made(struct gpu *gpu, size_t bytes);

// ERR_DEVICE with the sentence for a size beyond the driver's limit.
MUST_CHECK enum status gpu_fail_too_large(const struct gpu *gpu, int width, int height);

// Creates the OpenGL texture for the format and size in *texture. ERR_DEVICE; *texture then still has to be closed.
MUST_CHECK enum status gpu_make_texture(struct gpu_texture *texture, enum gpu_filter filter, const uint8_t *pixels);

// Marks all of the target as drawn into, for the next clear.
void gpu_target_mark_drawn(struct gpu_target *target);

// Makes the gpu's context current, unless it is already, or was adopted: then its owner keeps it current.
void gpu_make_current(const struct gpu *gpu);

// Whether the blank-separated list contains the word; false for NULL.
bool gpu_has_extension(const char *list, const char *word);
