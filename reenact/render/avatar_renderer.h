// Draws the person's avatar (avatar.h) in one go: its colours lie on the GPU once
// and for all; when another frame is shown come that one's colours and depth; with
// each picture, the points and triangles that are seen in it. The avatar may come
// later; it is then brought to the GPU a little with each picture. One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/frame/frame_layer.h"

struct avatar_renderer;

// gpu and what source points to must outlive it. view: the tablet camera's lens, copied.
// max_bytes: of shown frames (frame_layer_cache.h). ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status avatar_renderer_open(struct avatar_renderer **out, struct gpu *gpu,
                                            const struct frame_source *source, const struct lens *view,
                                            size_t max_bytes);
void avatar_renderer_close(struct avatar_renderer **p);

// From here on this one. Its contents go over and *avatar is zeroed, on failure
// too. ERR_INPUT: too large to be drawn; ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status avatar_renderer_set_avatar(struct avatar_renderer *p, struct avatar *avatar);
bool avatar_renderer_has_avatar(const struct avatar_renderer *p);

// Brings at most `bytes` more of it to the GPU. True: all is there, and it can be drawn.
bool avatar_renderer_upload_step(struct avatar_renderer *p, size_t bytes);

// Draws nothing, in one more of the ways in which a picture may be drawn, into `actor` and with `room` as those of
// avatar_view: where no graphics chip draws, a program is compiled when it is first drawn with, and not the same for
// each way. True: they all were. Of a avatar that was brought. ERR_DEVICE.
MUST_CHECK enum status avatar_renderer_warm_up(struct avatar_renderer *p, struct gpu_target *actor,
                                               const struct gpu_texture *room, bool *done);

// The one that was given, which nothing changes any more; NULL: none.
const struct avatar *avatar_renderer_avatar(const struct avatar_renderer *p);

// A frame that will be shown, loaded by somebody else from that very avatar. Its contents go over and *loaded is
// zeroed, on failure too. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status avatar_renderer_add_frame(struct avatar_renderer *p, struct frame_layer *loaded);
// Of the frames that need not be loaded to be shown, the nearest to that one, at most that far from it in time; -1.
int64_t avatar_renderer_nearest_resident(const struct avatar_renderer *p, int64_t frame, int64_t within_ns);

// From here on for another tablet camera.
void avatar_renderer_set_lens(struct avatar_renderer *p, const struct lens *view);

struct avatar_view {
    int64_t frame;            // shown, the nearest in time or near it
    struct skeleton skeleton; // in the world, perhaps between two frames
    struct pose world_from_viewer;
    struct gpu_target *actor;
    struct gpu_target *source; // NULL: not wanted
    // How far away the room is that may lie before the person, all over the picture, as depth that the same lens has;
    // the outline is smooth where it hides the person. NULL: there is none. Of the source it hides what the target's
    // own depth says.
    const struct gpu_texture *room;
};
// *parts: how many were drawn; those of unknown joints are not. *within: nothing was drawn outside. NOTHING: none, or
// the skeleton has no trunk. As take_read; ERR_DEVICE.
MUST_CHECK enum status avatar_renderer_draw(struct avatar_renderer *p, const struct avatar_view *view, int *parts,
                                            struct gpu_box *within);

// A lens as the shaders take it, three vec4s.
void lens_uniform(const struct lens *lens, float out[12]);
