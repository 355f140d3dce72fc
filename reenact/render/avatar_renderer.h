// Draws the avatar (avatar.h) with one skinned mesh. Skinning (LBS) and silhouette
// selection run on the CPU, per image (avatar_renderer.c); texturing on the GPU. The
// atlas is uploaded once, in steps; the shown frame's colour and depth when that frame
// changes; the visible vertices and triangles with each image.
// The avatar may be set after opening. One thread: that of the GPU context.
#pragma once
#include "platform/screen/gpu.h"
#include "reenact/frame/frame_layer.h"

struct avatar_renderer;

// gpu and what source points to must outlive it. view: the viewer camera's lens, copied.
// max_bytes: of frame layers kept on the GPU.
// ERR_DEVICE, ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status avatar_renderer_open(struct avatar_renderer **out, struct gpu *gpu,
                                            const struct frame_source *source, const struct lens *view,
                                            size_t max_bytes);
void avatar_renderer_close(struct avatar_renderer **p);

// Replaces the avatar. Takes over its contents and zeroes *avatar, also on failure; after
// a failure there is no avatar. ERR_INPUT: more vertices than 16-bit indices address;
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status avatar_renderer_set_avatar(struct avatar_renderer *renderer, struct avatar *avatar);
bool avatar_renderer_has_avatar(const struct avatar_renderer *renderer);

// Uploads at most `bytes` more of the atlas. True: all is uploaded, the avatar can be drawn.
bool avatar_renderer_upload_step(struct avatar_renderer *renderer, size_t bytes);

// Draws an empty triangle with the next combination of program and state that an image may use, into `actor` and with
// `room` as in avatar_view: software rasterisers compile a program when it is first drawn with, once per state. *done:
// all combinations were drawn. The avatar must be uploaded. ERR_DEVICE.
MUST_CHECK enum status avatar_renderer_warm_up(struct avatar_renderer *renderer, struct gpu_target *actor,
                                               const struct gpu_texture *room, bool *done);

// The avatar, constant until it is replaced; NULL: none.
const struct avatar *avatar_renderer_avatar(const struct avatar_renderer *renderer);

// Adds a frame layer that was loaded elsewhere from this same avatar. Takes over its contents and zeroes *loaded, also
// on failure. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status avatar_renderer_add_frame(struct avatar_renderer *renderer, struct frame_layer *loaded);
// The resident frame nearest in time to `frame`, at most within_ns away; -1: none.
int64_t avatar_renderer_nearest_resident(const struct avatar_renderer *renderer, int64_t frame, int64_t within_ns);

// Replaces the viewer camera's lens.
void avatar_renderer_set_lens(struct avatar_renderer *renderer, const struct lens *view);

struct avatar_view {
    int64_t frame;            // nearest in time, or a resident one near it: its layer is drawn
    bool fused;               // without its layer: the avatar's own shape and colours; nothing is read of the take
    struct skeleton skeleton; // world axes, possibly interpolated between two frames
    struct pose world_from_viewer;
    struct gpu_target *actor;
    struct gpu_target *source; // encoding of renderer_read_source; NULL: not wanted
    // Depth of the occluder mesh, drawn with the same lens; hides the actor with smooth edges. NULL: none. In `source`
    // the target's own depth hides instead.
    const struct gpu_texture *room;
};
// *parts: number of body parts drawn (parts with unknown joints are omitted). *within: bounding box of what was drawn.
// NOTHING: no part, or the skeleton has no trunk. Errors of take_read; ERR_DEVICE.
MUST_CHECK enum status avatar_renderer_draw(struct avatar_renderer *renderer, const struct avatar_view *view,
                                            int *parts, struct gpu_box *within);
