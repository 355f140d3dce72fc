// Draws what is about the actor: the room that hides him, as depth alone, and his
// soft shadow on the floor (z = 0 of the world). One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/scene/occluder_mesh.h"

struct around_painter;

// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status around_painter_open(struct around_painter **out, struct gpu *gpu, const struct lens *view);
void around_painter_close(struct around_painter **a); // NULL is fine

// From here on for another tablet camera; cheap.
void around_painter_set_lens(struct around_painter *a, const struct lens *view);

// From here on this room. Its contents go over and *room is zeroed, on failure too; the one before then stays.
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status around_painter_give(struct around_painter *a, struct room *room);

// The room's depth, as far as it may lie before what it may hide, into a cleared target of the picture's size or some
// times as fine; its colours stay transparent. False: there is nothing to draw.
bool around_painter_room(struct around_painter *a, struct gpu_target *target, const struct part_map *viewer_from_room,
                         const struct room_hidden *hidden);

// Draws nothing into such a target, so that nothing has to be compiled when the room comes to hide him.
void around_painter_rehearse(struct around_painter *a, struct gpu_target *target);

// Where a body and its shadow are.
struct around_view {
    struct pose world_from_viewer;
    const struct part_map *viewer_from_room; // NULL: no room hides the shadow
    const struct skeleton *skeleton;         // in the world
    const struct body *body;
};

// The shadow of a body into a cleared target, premultiplied: black with what it takes of the floor's light.
void around_painter_shadow(struct around_painter *a, struct gpu_target *target, const struct around_view *view);
