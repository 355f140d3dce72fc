// Drawing with OpenGL ES 3.0, and the only door to it: nobody else names EGL or
// GLES. A context needs no window and no screen (EGL's surfaceless platform;
// Mesa's llvmpipe where there is no GPU), or is adopted from whoever has one.
//
// Pictures have their top row first, everywhere: in textures, in targets and in
// what is read back. A position of (-1, -1) in clip space is the outer corner of
// the top-left pixel. Who shows a target in a window turns it over there.
//
// One gpu and all that was made from it belong to one thread at a time. Objects
// go before their gpu. Every uniform is an array of vec4, which keeps the door
// narrow. A driver that fails or a context that is lost gives ERR_DEVICE at the
// next call that can say so, always at gpu_target_read; the picture is then not
// to be used and the way on is to close everything and open it again.
#pragma once
#include "base/status.h"

struct gpu;
struct gpu_program;
struct gpu_texture;
struct gpu_mesh;
struct gpu_target;

// A context of our own, without a window. ERR_DEVICE: no EGL, or no OpenGL ES 3.
MUST_CHECK enum status gpu_open(struct gpu **out);

// The context that is current on this thread, made by somebody else (a window)
// who keeps it and outlives the gpu. ERR_DEVICE: there is none, or it is no ES 3.
MUST_CHECK enum status gpu_adopt(struct gpu **out);

void gpu_close(struct gpu **g); // NULL is fine; sets *g = NULL. The same for all below

const char *gpu_renderer(const struct gpu *g); // the driver's own name for itself
int gpu_max_size(const struct gpu *g);         // pixels, of a texture's or target's longer side

// What was asked of the driver so far, and what it holds now; controls (gpu_draw2d.h) are not counted.
struct gpu_counts {
    int64_t draws, uploads; // pictures' and meshes' bytes that were written, whole or in part
    int64_t made;           // programs, textures, meshes, targets
    size_t bytes_held;      // by textures, meshes and targets, as a GPU keeps them: four bytes a pixel of RGB
};
struct gpu_counts gpu_get_counts(const struct gpu *g);

// OK, or ERR_DEVICE when the context was lost or an error came up since the last look.
MUST_CHECK enum status gpu_check(struct gpu *g);

// Returns when all that was asked for is drawn. ERR_DEVICE as gpu_check.
MUST_CHECK enum status gpu_wait(struct gpu *g);

// ---- programs
struct gpu_program_source {
    const char *name;              // for the sentence
    const char *vertex, *fragment; // GLSL ES 3.00; the first line is its version
    const char *const *uniforms;   // uniform_count names; `a` for `uniform vec4 a[3]`. NULL: none, never to be set
    int uniform_count;             // at most 16
    const char *const *samplers;   // in the order of gpu_job.textures
    int sampler_count;             // at most 4
    const char *word;              // is #defined in the fragment shader; NULL: none
};
// The texts are not needed afterwards. The vertex shader's inputs lie at
// locations 0 and up. ERR_DEVICE: it does not compile or link (with the driver's words),
// or lacks one of the uniforms.
MUST_CHECK enum status gpu_program_open(struct gpu_program **out, struct gpu *g, const struct gpu_program_source *text);
void gpu_program_close(struct gpu_program **p);

// Sets uniform number `index` of the list: `count` vec4s.
void gpu_program_set(struct gpu_program *p, int index, const float *vec4s, int count);

// ---- textures: bytes that the shader sees as 0..1; edges are clamped
enum gpu_format { GPU_R8 = 1, GPU_RG8 = 2, GPU_RGB8 = 3, GPU_RGBA8 = 4 }; // the value: bytes a pixel
enum gpu_filter { GPU_NEAREST, GPU_LINEAR };
// ERR_DEVICE: too large, or out of memory. pixels may be NULL: undefined until written.
MUST_CHECK enum status gpu_texture_open(struct gpu_texture **out, struct gpu *g, enum gpu_format format, int width,
                                        int height, enum gpu_filter filter, const uint8_t *pixels);
void gpu_texture_close(struct gpu_texture **t);
void gpu_texture_write(struct gpu_texture *t, const uint8_t *pixels); // all of it, rows without padding
void gpu_texture_write_rows(struct gpu_texture *t, int first, int count,
                            const uint8_t *pixels); // likewise, `count` of them

// ---- meshes: triangles
// vertices: `components` floats each: 2 to 4, or 8, 12, 16, 20, of which the shader
// finds four at each of the locations 0, 1, 2 ... vertices and indices may be NULL:
// undefined until written. ERR_DEVICE: out of memory.
MUST_CHECK enum status gpu_mesh_open(struct gpu_mesh **out, struct gpu *g, const float *vertices, int components,
                                     int vertex_count, const uint16_t *indices, int index_count);
void gpu_mesh_close(struct gpu_mesh **m);
// A part of them: `count` floats or indices from number `first` on.
void gpu_mesh_write_vertices(struct gpu_mesh *m, int first, const float *floats, int count);
void gpu_mesh_write_indices(struct gpu_mesh *m, int first, const uint16_t *indices, int count);

// Pixels of a target. Width 0: all of them.
struct gpu_box {
    int left, top, width, height;
};

// ---- targets: what is drawn into. RGBA, 8 bit, with a depth buffer
// ERR_DEVICE.
MUST_CHECK enum status gpu_target_open(struct gpu_target **out, struct gpu *g, int width, int height);
// One without a depth buffer, for jobs without depth_test; and one of depth alone, 16 bit, whose texture is a
// sampler2DShadow: what share of the four texels about a place lies no nearer than a depth. It cannot be read back.
MUST_CHECK enum status gpu_target_open_color(struct gpu_target **out, struct gpu *g, int width, int height);
MUST_CHECK enum status gpu_target_open_depth(struct gpu_target **out, struct gpu *g, int width, int height);
void gpu_target_close(struct gpu_target **t);
// From here on pictures of that size are drawn into it, no larger than what it was opened for; if that is another size
// it is cleared, but nothing is made. They take up its texture's top left, which is what is shown of it (gpu_draw2d.h),
// the last row and column fading over half a pixel.
void gpu_target_resize(struct gpu_target *t, int width, int height);
int gpu_target_width(const struct gpu_target *t); // as it is used
void gpu_target_clear(struct gpu_target *t);      // transparent black, the farthest depth

// The picture so far as a texture, for a later job; belongs to the target.
const struct gpu_texture *gpu_target_texture(const struct gpu_target *t);

// rgba[width * height * 4]. Waits for the GPU. ERR_DEVICE.
MUST_CHECK enum status gpu_target_read(struct gpu_target *t, uint8_t *rgba);

// ---- drawing
struct gpu_job {
    struct gpu_target *target;
    struct gpu_program *program; // with its uniforms as last set
    const struct gpu_mesh *mesh;
    const struct gpu_texture *textures[4]; // as many as the program has samplers
    bool closed;                           // leave out triangles seen from behind: those that run clockwise
    bool depth_test;                       // the nearer one wins; else drawn over what is there
    bool no_depth_write;                   // what is drawn later is not behind it
    bool blend;                            // colours are premultiplied and laid over what is there
    int first, count;                      // of the mesh's indices; count 0: all of them
    struct gpu_box within;                 // nothing outside is drawn; it may reach beyond the target
};
void gpu_draw(const struct gpu_job *job);
