// Draws the occluder mesh, as depth only, and the actor's soft occlusion shadow on the floor
// (z = 0 of the world): each body part and foot blocks light from above as a ball does
// (occlusion_shadow.frag). One thread: that of the GPU context.
#pragma once
#include "base/lens.h"
#include "platform/screen/gpu.h"
#include "reenact/scene/occluder_mesh.h"

// ---------------------------------------------------------------- screen bounds

// Bounding box in pixels of what lies within a frustum, lens distortion included. Pure.

// low, high: bounds of x / z and y / z, camera axes; infinite: unbounded on that side. The box has a margin of 2 pixels
// for smooth silhouettes. Width 0: the whole image.
struct gpu_box screen_bounds(const struct lens *lens, const double low[2], const double high[2]);

// ---------------------------------------------------------------- occlusion shadow

struct occlusion_shadow;

// view: the viewer camera's lens; copied. ERR_DEVICE, ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status occlusion_shadow_open(struct occlusion_shadow **out, struct gpu *gpu, const struct lens *view);
void occlusion_shadow_close(struct occlusion_shadow **shadow); // NULL is fine

// Replaces the viewer camera's lens; cheap.
void occlusion_shadow_set_lens(struct occlusion_shadow *shadow, const struct lens *view);

// Replaces the occluder mesh. Takes over its contents and zeroes *room, also on failure; the previous mesh then stays.
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status occlusion_shadow_set_room(struct occlusion_shadow *shadow, struct occluder_mesh *room);

// front_only: triangles that turn their back to the viewer hide nothing, as when one looks into a room from outside
// through its walls. Initially false.
void occlusion_shadow_set_front_only(struct occlusion_shadow *shadow, bool front_only);

// Draws the depth of the triangles that may occlude `hidden` into a cleared target of the image's size or a multiple of
// it; colours stay transparent. False: there are none.
bool occlusion_shadow_draw_room(struct occlusion_shadow *shadow, struct gpu_target *target,
                                const struct affine_map *viewer_from_room, const struct occlusion_frustum *hidden);

// Draws an empty triangle into such a target, so that no shader is compiled when the room first hides the actor.
void occlusion_shadow_warm_up(struct occlusion_shadow *shadow, struct gpu_target *target);

struct occlusion_shadow_view {
    struct pose world_from_viewer;
    const struct affine_map *viewer_from_room; // NULL: no room hides the shadow
    const struct skeleton *skeleton;           // world axes
    const struct body *body;
};

// Draws a body's shadow into a cleared target, premultiplied: black, alpha the blocked share of the light.
void occlusion_shadow_draw(struct occlusion_shadow *occlusion_shadow, struct gpu_target *target,
                           const struct occlusion_shadow_view *view);
