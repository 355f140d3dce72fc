// What one recorded frame adds to the avatar while it is the frame that is shown: the
// person's own colours and depth in it, and how the avatar is laid on it and bent.
// It depends on the take and the avatar alone, not on who looks from where, so that it
// can be made before it is wanted, on any thread; frame_layer_cache.h brings it to the GPU.
// Pure; deterministic. One loader, one thread; loaders with a take handle each may share
// a avatar.
#pragma once
#include "reenact/avatar/avatar.h"

// What the frame knows of a point of the atlas's mesh.
struct frame_layer_point {
    float color_uv[2]; // where it saw it: in its colours, of their size
    float depth_uv[2]; // likewise
    float depth_m;     // in depth, if nothing is before it
    float visibility;  // how squarely: 1 straight on, 0 aside, away, or not at all
    float normal[3];   // its normal, colour camera's axes
    float irradiance;  // root of the room's light on it, as bright as the frame has it
};

struct frame_layer_image {
    uint8_t *pixels; // rows without padding
    int width, height;
};

struct frame_layer {
    int64_t frame;
    bool has_images;                // it has colours and depth; else these are of few pixels, of nobody
    struct frame_layer_image color; // RGB, the person's alone: others' colours are replaced by the nearest of theirs
    struct frame_layer_image
        depth;           // RGBA: millimetres (red high, green low byte); blue: how deep within one surface of
                         // the person it lies, 1 well within, 0 at an edge and elsewhere, and along the rim
    float windows[2][4]; // colours' and depth's: left, top, width, height in the frame's own pixels
    float exposure_gain; // than the take's frames are in the mean, of colours' roots (exposure.h)
    struct bone_corrections corrections; // of the joints' posture
    float (*shift)[3]; // beyond it (deformation.h), of each point of the atlas's mesh in the bind pose, metres
    struct frame_layer_point *points; // of each; NULL, as shift: the frame's posture is not known
    int point_count, triangle_count;
    bool *triangle_visible; // of each of its triangles: whether it may have colours of the frame's own
                            // (triangle_visibility.h); NULL, as points
};
void frame_layer_free(struct frame_layer *f);          // zeroed is fine
size_t frame_layer_bytes(const struct frame_layer *f); // pictures as textures, four a pixel

struct frame_layer_loader;

// All are borrowed and must outlive it; nobody else may read the take's pictures meanwhile. ERR_MEMORY.
MUST_CHECK enum status frame_layer_loader_open(struct frame_layer_loader **out, struct take *take,
                                               const struct source_rays *rays, const struct avatar *avatar);
void frame_layer_loader_close(struct frame_layer_loader **l); // NULL is fine

// On OK *out is the caller's: frame_layer_free. As take_read.
MUST_CHECK enum status frame_layer_loader_load(struct frame_layer_loader *l, int64_t frame, struct frame_layer *out);
