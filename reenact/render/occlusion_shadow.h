// Draws what is about the actor: the room that hides him, as depth alone, and his
// soft shadow on the floor (z = 0 of the world). One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/scene/occluder_mesh.h"

struct occlusion_shadow;

// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status occlusion_shadow_open(struct occlusion_shadow **out, struct gpu *gpu, const struct lens *view);
void occlusion_shadow_close(struct occlusion_shadow **a); // NULL is fine

// From here on for another tablet camera; cheap.
void occlusion_shadow_set_lens(struct occlusion_shadow *a, const struct lens *view);

// From here on this room. Its contents go over and *room is zeroed, on failure too; the one before then stays.
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status occlusion_shadow_set_room(struct occlusion_shadow *a, struct occluder_mesh *room);

// The room's depth, as far as it may lie before what it may hide, into a cleared target of the picture's size or some
// times as fine; its colours stay transparent. False: there is nothing to draw.
bool occlusion_shadow_draw_room(struct occlusion_shadow *a, struct gpu_target *target,
                                const struct affine_map *viewer_from_room, const struct occlusion_frustum *hidden);

// Draws nothing into such a target, so that nothing has to be compiled when the room comes to hide him.
void occlusion_shadow_warm_up(struct occlusion_shadow *a, struct gpu_target *target);

// Where a body and its shadow are.
struct occlusion_shadow_view {
    struct pose world_from_viewer;
    const struct affine_map *viewer_from_room; // NULL: no room hides the shadow
    const struct skeleton *skeleton;           // in the world
    const struct body *body;
};

// The shadow of a body into a cleared target, premultiplied: black with what it takes of the floor's light.
void occlusion_shadow_draw(struct occlusion_shadow *a, struct gpu_target *target,
                           const struct occlusion_shadow_view *view);
