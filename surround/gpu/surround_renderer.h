// surround_view_draw by the graphics card: a picture of the surroundings from a free viewpoint, for every image that a
// display shows. Each picture's colours, depth and surface (surround_picture.h) are uploaded once and stay there.
//
// Two passes. The first draws the surfaces of the nearest pictures into one image of 1 / z: what other pictures look
// through (the view-dependent depth test) lies behind all that they do not, and is left out where most look through it,
// as is what nothing supports: extrapolated in a picture after the eight nearest, and seen by none of these. Of
// surfaces that agree that of the nearest picture is taken, where surround_view_draw takes their mean. The second gives
// each pixel the colours of the two best pictures. What no picture has seen has alpha 0.
//
// Threads, errors and images as in platform/screen/gpu.h.
#pragma once
#include "platform/screen/gpu.h"
#include "reenact/render/shaders.h"
#include "surround/picture/surround_picture.h"
#include "surround/view/surround_view.h"

// ---------------------------------------------------------------- picture store

// The pictures that are on the graphics card: colours and depth in layers of texture arrays, surfaces as meshes. What
// was not drawn for longest makes room. Threads, errors as in platform/screen/gpu.h.

struct stored_piece {
    struct gpu_mesh *mesh;
    float rays[SURROUND_MESH_RAYS][3]; // as in surround_mesh_piece
    float least, most;
};

struct stored_picture {
    int64_t depth_number; // 0: the layer is free
    int64_t used;         // when it was drawn last
    struct stored_piece *pieces;
    int count;
};

struct picture_store {
    struct gpu *gpu;
    struct stored_picture *pictures; // one a layer
    int layers, width, height;       // of the arrays; 0: none yet
    // RGB; inverse distances, 1/m; least and most of those about each 2 x 2 pixels, half as wide and high, the least
    // negated where none of the four is measured.
    struct gpu_texture *colors, *depths, *ranges;
    int64_t now;
};

// ---------------------------------------------------------------- surround renderer, types

// At most so many pictures make an image; the first of the list are taken, of one camera (size and lens): the first's.
// A picture takes 7 bytes a pixel of the graphics card's memory, and about 16 for each vertex of its surface.
enum { SURROUND_RENDERER_MAX = 16 };

struct surround_renderer;
// ERR_DEVICE: this driver cannot; ERR_MEMORY.
MUST_CHECK enum status surround_renderer_open(struct surround_renderer **out, struct gpu *gpu);
void surround_renderer_close(struct surround_renderer **r); // NULL is fine

struct surround_image {
    struct lens lens; // ideal
    struct pose world_from_view;
    struct view_options options; // texture_pictures is 2
    bool hatched;                // what was not seen is hatched, opaque over black; else black
    int max_uploads;             // new pictures in one call, so that none takes long; 0: all
};

// The pictures have depth with a depth_number each, and are sorted by surround_view_rank. The texture is the
// renderer's, valid until the next call. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status surround_renderer_draw(struct surround_renderer *renderer, const struct surround_image *image,
                                              const struct surround_picture *const *pictures, int count,
                                              const struct gpu_texture **out);

// How many of the last image's pictures were left out because of max_uploads.
int surround_renderer_missing(const struct surround_renderer *renderer);

// A transparent box over the last image, hidden where something stands in front of it. Not drawn where the eye is
// inside. low, high: opposite corners in the box's axes.
struct surround_box {
    struct pose world_from_box;
    double low[3], high[3];
    uint8_t color[3];
    double opacity; // 0..1
};
void surround_renderer_tint(struct surround_renderer *renderer, const struct surround_box *box);

// Depth of every step-th pixel of the last image: *view gets its lens, its pose, inverse_z, and source; it is opened
// where its size is another. Waits for that image alone if it is called before the next one is drawn. NOTHING: none
// was drawn yet. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status surround_renderer_read_depth(struct surround_renderer *renderer, int step,
                                                    struct surround_view *view);

// ---------------------------------------------------------------- surround renderer

// The renderer's state, for reading back.

struct surround_renderer {
    struct gpu *gpu;
    struct picture_store store;
    // For so many pictures, compiled when they are needed first
    struct gpu_program *surface_programs[SURROUND_RENDERER_MAX + 1], *texture_programs[SURROUND_RENDERER_MAX + 1];
    struct gpu_program *unasked_program; // for surfaces of pictures after the JUDGES first
    struct gpu_program *tint_program, *sample_program;
    struct gpu_mesh *fullscreen;
    struct gpu_texture *none; // an array, while there are no pictures
    struct gpu_target *surface, *image, *sample;
    struct lens lens; // of the image
    struct pose world_from_view;
    int sample_width, sample_height;
    // Of the image under way: its pictures in their order
    const struct surround_picture *pictures[SURROUND_RENDERER_MAX];
    int layers[SURROUND_RENDERER_MAX], count, missing;
};

// Rows of the rigid map's 3 x 4 matrix.
static inline void surround_rows_of(struct pose a_from_b, float rows[12])
{
    const double shift[3] = {a_from_b.translation.x, a_from_b.translation.y, a_from_b.translation.z};
    double m[3][3];
    quat_to_matrix(a_from_b.rotation, m);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            rows[4 * i + k] = (float)m[i][k];
        rows[4 * i + 3] = (float)shift[i];
    }
}

// As unpack_inverse_z in surround_depth.glsl.
static inline float surround_inverse_z(const uint8_t *s)
{
    return s[3] ? (float)((s[0] * 65536.0 + s[1] * 256.0 + s[2]) / 16777215.0 / VIEW_NEAREST_M) : DEPTH_UNKNOWN;
}
