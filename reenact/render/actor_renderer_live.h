// The part of the actor renderer for an app that draws continuously: an avatar that comes
// later, from another thread; frame layers loaded ahead; images as textures; changes of
// resolution and lens. Threads, memory and errors as in actor_renderer.h.
#pragma once
#include "reenact/render/actor_renderer.h"

// ---- the avatar and its frame layers

// Sets the avatar that options.avatar_later announced, made by avatar_make from another handle on
// the same take, on any thread. It is uploaded in steps with the next images; until all is uploaded,
// every level is drawn as DETAIL_PAPER. NULL: there is none; DETAIL_FULL is then drawn as rounded
// cylinders. Takes over its contents and zeroes *avatar, also on failure. ERR_INPUT: too many
// vertices. ERR_DEVICE, ERR_MEMORY. After a failure there is no avatar.
MUST_CHECK enum status renderer_set_avatar(struct renderer *p, struct avatar *avatar);

// True: everything that was set is uploaded.
bool renderer_upload_done(const struct renderer *p);

// Uploads what is left of the avatar in one go: where a hitch costs less than another look of the actor.
void renderer_finish_upload(struct renderer *p);

// For prefetching frame layers on another thread (frame_layer.h): the avatar, owned by the renderer,
// valid until it is closed or another is set. NULL: there is none, or it is not uploaded yet.
const struct avatar *renderer_avatar(const struct renderer *p);

// Adds a prefetched frame layer. Images are the same with and without it. Takes over its contents
// and zeroes *loaded, also on failure. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_add_frame(struct renderer *p, struct frame_layer *loaded);

// The resident frame nearest in time to `frame`, at most within_ns away; -1: none.
int64_t renderer_nearest_resident_frame(const struct renderer *p, int64_t frame, int64_t within_ns);

// ---- images as textures, top row first, premultiplied alpha; owned by the renderer

const struct gpu_texture *renderer_actor_texture(struct renderer *p);   // the actor last drawn, alone
const struct gpu_texture *renderer_shadow_texture(struct renderer *p);  // its shadow, to compose below it. NULL: none
const struct gpu_texture *renderer_overlay_texture(struct renderer *p); // view.overlay's strokes. NULL: none drawn

// What was asked with the last view.overlay that had points: depth_overlay_read. ERR_DEVICE.
MUST_CHECK enum status renderer_read_seen(struct renderer *p, float share[OVERLAY_GROUPS_MOST], int *count);

// ---- changes between images

// Sets the resolution scale per axis, (0, 1]: the share of the lens's pixels at which the actor is
// drawn. Textures keep their displayed size; read-backs shrink. Allocates nothing. view.color must
// then be NULL.
void renderer_set_resolution_scale(struct renderer *p, double resolution_scale);

// Replaces the viewer camera's lens; the resolution scale stays. Cheap unless the image size changes.
// ERR_INPUT: nothing changed; ERR_DEVICE, ERR_MEMORY: the renderer can only be closed.
MUST_CHECK enum status renderer_set_lens(struct renderer *p, const struct lens *lens);

// With options.sources: whether the next images write their sources, which costs time. Initially true.
void renderer_set_sources(struct renderer *p, bool wanted);

// Sets the predicted error that DETAIL_AUTO accepts, pixels.
void renderer_set_error(struct renderer *p, double error_px);
