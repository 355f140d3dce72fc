// A frame layer: what one recorded frame adds to the avatar while that frame is shown: its colours and depth about the
// actor, the registration of the avatar to it (articulated_icp.h), the non-rigid deformation (deformation.h) and the
// exposure (frame_layer.c). It depends on the take and the avatar alone, not on the viewpoint, so it can be prefetched
// on any thread; avatar_renderer.c uploads it. Deterministic. One loader, one thread; loaders with their own take
// handles may share an avatar.
#pragma once
#include "reenact/avatar/avatar.h"

// A point of the texture atlas's mesh, as the frame saw it.
struct frame_layer_point {
    float color_uv[2]; // its projection into `color`, shares of that image's size
    float depth_uv[2]; // likewise into `depth`
    float depth_m;     // of the point itself, depth camera
    float visibility;  // 1 seen frontally, 0 at grazing angles, facing away or outside; occlusion is not tested
    float normal[3];   // its normal, colour camera's axes
    float irradiance;  // square root of the irradiance, times exposure_gain
};

struct frame_layer_image {
    uint8_t *pixels; // rows without padding
    int width, height;
};

struct frame_layer {
    int64_t frame;
    bool has_images;                // colours and depth show the actor; else both are empty images of a few pixels
    struct frame_layer_image color; // RGB, gamma-encoded; colours mixed with other surfaces are replaced
                                    // (depth_frame_clean_colors)
    struct frame_layer_image
        depth;           // RGBA: millimetres (red high, green low byte); blue: distance to the nearest edge,
                         // 255 well within a surface of the actor, 0 at its edges, elsewhere and on the border
    float windows[2][4]; // of color and depth: left, top, width, height in the frame's pixels
    float exposure_gain; // of gamma-encoded colours against the avatar's (frame_layer.c)
    struct bone_corrections corrections; // of the joints' pose
    float (*shift)[3];                   // deformation of each point of the atlas's mesh, in the bind pose, metres
    struct frame_layer_point *points;    // of the same points; NULL, as shift: the frame's pose is unknown
    int point_count, triangle_count;
    bool *triangle_visible; // of each of the mesh's triangles (frame_layer.c); NULL, as points
};
void frame_layer_free(struct frame_layer *layer);          // zeroed is fine
size_t frame_layer_bytes(const struct frame_layer *layer); // with images as textures of 4 bytes a pixel

struct frame_layer_loader;

// source is copied; what it points to and avatar are borrowed and must outlive the loader, and no other thread may read
// from the take handle meanwhile. ERR_MEMORY: *out is then NULL.
MUST_CHECK enum status frame_layer_loader_open(struct frame_layer_loader **out, const struct frame_source *source,
                                               const struct avatar *avatar);
void frame_layer_loader_close(struct frame_layer_loader **l); // NULL is fine; sets *l = NULL

// Reads the frame's row once and makes its layer. On OK *out is the caller's (frame_layer_free); on failure it is
// zeroed. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status frame_layer_loader_load(struct frame_layer_loader *loader, int64_t frame,
                                               struct frame_layer *out);
