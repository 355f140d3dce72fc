// Draws the person's likeness (avatar.h) in one go: its colours lie on the GPU once
// and for all; when another frame is shown come that one's colours and depth; with
// each picture, the points and triangles that are seen in it. The likeness may come
// later; it is then brought to the GPU a little with each picture. One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/frame/frame_layer.h"

struct likeness_painter;

// gpu, take and rays must outlive it. view: the tablet camera's lens, copied.
// max_bytes: of shown frames (frame_layer_cache.h). ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status likeness_painter_open(struct likeness_painter **out, struct gpu *gpu, struct take *take,
                                             const struct source_rays *rays, const struct lens *view, size_t max_bytes);
void likeness_painter_close(struct likeness_painter **p);

// From here on this one. Its contents go over and *likeness is zeroed, on failure
// too. ERR_INPUT: too large to be drawn; ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status likeness_painter_give(struct likeness_painter *p, struct likeness *likeness);
bool likeness_painter_given(const struct likeness_painter *p);

// Brings at most `bytes` more of it to the GPU. True: all is there, and it can be drawn.
bool likeness_painter_bring(struct likeness_painter *p, size_t bytes);

// Draws nothing, in one more of the ways in which a picture may be drawn, into `actor` and with `room` as those of
// likeness_view: where no graphics chip draws, a program is compiled when it is first drawn with, and not the same for
// each way. True: they all were. Of a likeness that was brought. ERR_DEVICE.
MUST_CHECK enum status likeness_painter_rehearse(struct likeness_painter *p, struct gpu_target *actor,
                                                 const struct gpu_texture *room, bool *done);

// The one that was given, which nothing changes any more; NULL: none.
const struct likeness *likeness_painter_likeness(const struct likeness_painter *p);

// A frame that will be shown, loaded by somebody else from that very likeness. Its contents go over and *loaded is
// zeroed, on failure too. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status likeness_painter_give_frame(struct likeness_painter *p, struct loaded_frame *loaded);
// Of the frames that need not be loaded to be shown, the nearest to that one, at most that far from it in time; -1.
int64_t likeness_painter_near(const struct likeness_painter *p, int64_t frame, int64_t within_ns);

// From here on for another tablet camera.
void likeness_painter_set_lens(struct likeness_painter *p, const struct lens *view);

struct likeness_view {
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
MUST_CHECK enum status likeness_painter_draw(struct likeness_painter *p, const struct likeness_view *view, int *parts,
                                             struct gpu_box *within);

// A lens as the shaders take it, three vec4s.
void lens_uniform(const struct lens *lens, float out[12]);
