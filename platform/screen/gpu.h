// Drawing with OpenGL ES 3.0. No file outside platform/screen/gpu*.c uses EGL or GLES.
// A context needs no window and no screen (EGL's surfaceless platform; Mesa's
// llvmpipe where there is no GPU), or an existing one is adopted.
//
// Images have their top row first, everywhere: in textures, in targets and in
// what is read back. (-1, -1) in clip space is the outer corner of the top-left
// pixel. Drawing into a window mirrors the image vertically there (gpu_draw2d.h does).
//
// A gpu and all objects made from it belong to one thread at a time. Close
// objects before their gpu. Every uniform is an array of vec4, which keeps the
// interface small. A driver error or a lost context gives ERR_DEVICE at the next
// call that returns a status, always at gpu_target_read; the image is then
// undefined: close everything and open it again.
#pragma once
#include "base/status.h"

struct gpu;
struct gpu_program;
struct gpu_texture;
struct gpu_mesh;
struct gpu_target;

// A new context, without a window. ERR_DEVICE: no EGL, or no OpenGL ES 3.
MUST_CHECK enum status gpu_open(struct gpu **out);

// The context that is current on this thread. Its owner (a window) keeps it
// current and outlives the gpu. ERR_DEVICE: there is none, or it is no ES 3.
MUST_CHECK enum status gpu_adopt(struct gpu **out);

void gpu_close(struct gpu **gpu); // NULL is fine; sets *gpu = NULL. The same for all below

const char *gpu_renderer(const struct gpu *gpu); // the driver's GL_RENDERER string
bool gpu_is_software(const struct gpu *gpu);     // the driver draws by the processor
int gpu_max_size(const struct gpu *gpu);         // pixels, of a texture's or target's longer side

// Calls to the driver since the gpu was opened, and memory held now. gpu_draw2d.h is not counted.
struct gpu_counts {
    int64_t draws, uploads; // uploads: writes of a texture or mesh, whole or in part
    int64_t made;           // programs, textures, meshes, targets
    size_t bytes_held;      // textures, meshes and targets; RGB counts four bytes a pixel, as GPUs store it
};
struct gpu_counts gpu_get_counts(const struct gpu *gpu);

// ERR_DEVICE: the context was lost, or an error was raised since the last check.
MUST_CHECK enum status gpu_check(struct gpu *gpu);

// ---- programs
struct gpu_program_source {
    const char *name;              // for the sentence
    const char *vertex, *fragment; // GLSL ES 3.00; the first line is its version
    const char *const *uniforms;   // uniform_count names; `a` for `uniform vec4 a[3]`. A NULL name: an index never set
    int uniform_count;             // at most 16
    const char *const *samplers;   // in the order of gpu_job.textures
    int sampler_count;             // at most 4
    const char *word;              // #defined in both shaders, may be "NAME VALUE"; NULL: none
};
// The texts are not needed afterwards. The vertex shader's inputs are at
// locations 0 and up. ERR_DEVICE: it does not compile or link (the sentence has
// the driver's log), or lacks one of the uniforms or samplers.
MUST_CHECK enum status gpu_program_open(struct gpu_program **out, struct gpu *gpu,
                                        const struct gpu_program_source *text);
void gpu_program_close(struct gpu_program **program);

// Sets uniform `index` of gpu_program_source.uniforms to `count` vec4s. The program keeps them.
void gpu_program_set(struct gpu_program *program, int index, const float *vec4s, int count);

// ---- textures: bytes that the shader reads as 0..1; coordinates are clamped to the edge
enum gpu_format { GPU_R8 = 1, GPU_RG8 = 2, GPU_RGB8 = 3, GPU_RGBA8 = 4 }; // the value: bytes a pixel
enum gpu_filter { GPU_NEAREST, GPU_LINEAR };
struct gpu_texture_layout {
    enum gpu_format format;
    int width, height; // pixels
    enum gpu_filter filter;
};
// ERR_DEVICE: too large, or out of memory. pixels may be NULL: undefined until written.
MUST_CHECK enum status gpu_texture_open(struct gpu_texture **out, struct gpu *gpu,
                                        const struct gpu_texture_layout *layout, const uint8_t *pixels);
void gpu_texture_close(struct gpu_texture **texture);
// Overwrites the whole texture, or `count` rows from row `first` on. Rows without padding.
void gpu_texture_write(struct gpu_texture *texture, const uint8_t *pixels);
// The same for pictures whose size may change: opens the texture where *texture is NULL, and anew where its size or
// format is not the layout's. Errors as gpu_texture_open; *texture is NULL then.
MUST_CHECK enum status gpu_texture_put(struct gpu_texture **texture, struct gpu *gpu,
                                       const struct gpu_texture_layout *layout, const uint8_t *pixels);
void gpu_texture_write_rows(struct gpu_texture *texture, int first, int count, const uint8_t *pixels);

// Layers of one size, for a sampler2DArray: bytes read as 0..1, or numbers kept with 11 bits; filtered. Undefined until
// written. ERR_DEVICE: too large, or out of memory.
enum gpu_array_format { GPU_ARRAY_RGB8, GPU_ARRAY_R16F, GPU_ARRAY_RG16F };
struct gpu_array_layout {
    enum gpu_array_format format;
    int width, height, layers;
};
MUST_CHECK enum status gpu_texture_open_array(struct gpu_texture **out, struct gpu *gpu,
                                              const struct gpu_array_layout *layout);
// Overwrites width x height values at a layer's top left: uint8_t[3], float or float[2] each, by the format. Rows
// without padding.
void gpu_texture_write_layer(struct gpu_texture *texture, int layer, int width, int height, const void *values);

// ---- meshes: triangles, three indices each
struct gpu_mesh_data {
    const float *vertices;   // NULL: undefined until written
    int components;          // floats of a vertex: 2 to 4, or 8, 12, 16, 20, four at each of the locations 0, 1, 2 ...
    int vertex_count;        // at most 65536
    const uint16_t *indices; // NULL: undefined until written
    int index_count;         // 0: points only
};
// ERR_DEVICE: out of memory. The data are copied.
MUST_CHECK enum status gpu_mesh_open(struct gpu_mesh **out, struct gpu *gpu, const struct gpu_mesh_data *data);
void gpu_mesh_close(struct gpu_mesh **mesh);
// Overwrites `count` floats or indices from number `first` on.
void gpu_mesh_write_vertices(struct gpu_mesh *mesh, int first, const float *floats, int count);
void gpu_mesh_write_indices(struct gpu_mesh *mesh, int first, const uint16_t *indices, int count);

// A rectangle of a target, in pixels. Width 0: the whole target.
struct gpu_box {
    int left, top, width, height;
};

// ---- targets: images to draw into
// RGBA, 8 bit, with a 24-bit depth buffer. ERR_DEVICE: too large, or out of memory; ERR_MEMORY.
MUST_CHECK enum status gpu_target_open(struct gpu_target **out, struct gpu *gpu, int width, int height);
// The same, whose depth a later job can compare with: gpu_target_depth.
MUST_CHECK enum status gpu_target_open_comparable(struct gpu_target **out, struct gpu *gpu, int width, int height);
// Without a depth buffer, for jobs without depth_test; and a shadow map: depth alone, 16 bit, which cannot be read
// back. Its texture is a sampler2DShadow with bilinear comparison: the share of the four nearest texels whose depth is
// not smaller than the reference.
MUST_CHECK enum status gpu_target_open_color(struct gpu_target **out, struct gpu *gpu, int width, int height);
MUST_CHECK enum status gpu_target_open_depth(struct gpu_target **out, struct gpu *gpu, int width, int height);
void gpu_target_close(struct gpu_target **target);
// Sets the size that is drawn, at most that of opening, without allocating; a change of size clears the target. The
// image takes up the top left of the texture, and gpu_draw2d.h draws that part of it; filtering at its last row and
// column reaches half a pixel into the unused part.
void gpu_target_resize(struct gpu_target *target, int width, int height);
int gpu_target_width(const struct gpu_target *target); // the size in use
void gpu_target_clear(struct gpu_target *target);      // to transparent black and depth 1

// The target's image as a texture, for a later job; belongs to the target.
const struct gpu_texture *gpu_target_texture(const struct gpu_target *target);
// The depth of a comparable target, a sampler2DShadow as a shadow map's; not for a job that draws into it.
const struct gpu_texture *gpu_target_depth(const struct gpu_target *target);

// rgba[width * height * 4], of the size in use. Waits for the GPU. ERR_DEVICE: rgba is undefined.
MUST_CHECK enum status gpu_target_read(struct gpu_target *target, uint8_t *rgba);

// ---- drawing (gpu.c)
struct gpu_job {
    struct gpu_target *target;
    struct gpu_program *program; // with its uniforms as set last
    const struct gpu_mesh *mesh;
    const struct gpu_texture *textures[4]; // as many as the program has samplers
    bool closed;           // a closed surface: back faces are culled. Front faces run counter-clockwise in the image
    bool depth_test;       // draw only what is nearer than the target's depth; otherwise over what is there
    bool no_depth_write;   // with depth_test: leave the target's depth as it is
    bool blend;            // alpha blending: colours are premultiplied; otherwise they replace what is there
    bool points;           // the mesh's vertices, without its indices, as points of the vertex shader's gl_PointSize
    int first, count;      // range of the mesh's indices, of its vertices with points; count 0: all of them
    struct gpu_box within; // scissor; it may reach beyond the target
};
void gpu_draw(const struct gpu_job *job);

// ---------------------------------------------------------------- gpu import

// Textures over memory of another device (dma-buf imported as an EGLImage, without a copy), and fences, which tell when
// the GPU has finished reading it. Threads and errors as above.

// Whether the driver offers the extensions and formats. A given buffer may still be refused by gpu_texture_import.
bool gpu_can_import(struct gpu *gpu);

struct gpu_dmabuf {
    int file;                // descriptor of the dma-buf; may be closed after gpu_texture_import
    uint32_t offset, stride; // bytes
};
// A texture over the memory, with nearest filtering, for formats of 1, 2 or 4 bytes a pixel. It must not be written.
// ERR_DEVICE: the driver cannot read the memory; the gpu remains usable. ERR_MEMORY.
MUST_CHECK enum status gpu_texture_import(struct gpu_texture **out, struct gpu *gpu, enum gpu_format format, int width,
                                          int height, const struct gpu_dmabuf *memory);

struct gpu_fence;
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status gpu_fence_open(struct gpu_fence **out, struct gpu *gpu);
// Whether all draws issued before the fence was opened are complete. wait: waits for that, at most a second. True for a
// lost context.
bool gpu_fence_passed(struct gpu_fence *fence, bool wait);
void gpu_fence_close(struct gpu_fence **fence); // NULL is fine
