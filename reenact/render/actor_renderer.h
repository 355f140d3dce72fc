// Draws the recorded actor into a viewer camera's image, after [D14] 4.2: interpolates and
// transforms the skeleton to the viewer camera, draws the level of detail asked for
// (base/level_of_detail.h), and composes it with the image; lens distortion included.
// What an app needs beyond this, which draws continuously, follows below.
//
// Pure but for the GPU and the take: no clock, but for renderer_measure_costs; an image does not depend on those drawn
// before, unless view.within_ns allows it. One renderer, one thread: that of the GPU context.
//
// GPU memory is bounded, however long the take: options.texture_bytes for recorded frames
// (with an avatar half for frame layers, half for cylinder textures), 8 bytes a pixel of
// the take's images for the shown frame, 38 bytes a pixel of the viewer's (with all options),
// and 16 MiB for meshes and the avatar's texture.
#pragma once
#include "base/level_of_detail.h"
#include "platform/screen/gpu.h"
#include "recording/recording.h"
#include "reenact/avatar/avatar.h"
#include "reenact/frame/frame_layer.h"
#include "reenact/render/depth_overlay.h"
#include "reenact/scene/occluder_mesh.h"

// ---------------------------------------------------------------- lod error

// Predicted error of each level of detail, before it is drawn: how far the drawn outline is from the true one, on the
// mean along it, metres, times pixels per metre at the actor's distance. Colours are not in it. Pure.

// The mean over the joints. in_viewer: the skeleton to be shown, viewer camera's axes. 0: no joint is before the
// camera.
double lod_pixels_per_metre(const struct lens *lens, const struct skeleton *in_viewer);

// Mean radius of the body's cylinders: a big person's outline is farther off than a child's. 0: no part is known.
double lod_body_radius_m(const struct body *body, const struct skeleton *skeleton);
double lod_simple_error_m(void); // of the simple avatar (avatar.h), fused

// Share of the avatar's surface that no frame showed: its shape is guessed there.
double lod_unseen_share(const struct avatar *avatar);
double lod_outline_error_m(enum detail level, double body_radius_m, double unseen_share); // level: below DETAIL_AUTO

// ---------------------------------------------------------------- actor renderer

struct renderer;

struct renderer_options {
    const struct take_skeletons *skeletons; // of the take, borrowed. Default NULL: the renderer makes its own
    enum detail detail;                     // default DETAIL_FULL; renderer_set_detail changes it
    size_t texture_bytes;                   // of recorded frames on the GPU; at least one is kept. Default 64 MiB
    double error_px;                        // predicted error that DETAIL_AUTO accepts, pixels. Default 1
    bool sources;                           // renderer_read_source will be called. Default no
    bool shadow;                            // occlusion shadow on the floor, where the take has a place. Default no
    bool avatar_later;                      // renderer_set_avatar will give the avatar. Default no
    const struct progress_watch *watch;     // of renderer_open making the avatar. Default NULL
};
struct renderer_options renderer_default_options(void);

// The gpu and the take, with all it depends on, must outlive the renderer; nothing else may read
// the take's images meanwhile. lens: the viewer camera's; copied. Makes the avatar unless
// options.avatar_later. ERR_INPUT: no skeleton to show (skeleton_track_open), no measured body,
// an image too large. ERR_DEVICE, ERR_MEMORY; ERR_CORRUPT, ERR_IO: the take. After a failure
// *out is NULL.
MUST_CHECK enum status renderer_open(struct renderer **out, struct gpu *gpu, struct take *take, const struct lens *lens,
                                     const struct renderer_options *options);
void renderer_close(struct renderer **p);

// Sets the occluder mesh that hides the actor (occluder_mesh_make). Takes over its contents and
// zeroes *room, also on failure. ERR_DEVICE, ERR_MEMORY; the mesh set before then stays.
MUST_CHECK enum status renderer_set_room(struct renderer *renderer, struct occluder_mesh *room);

struct renderer_view {
    struct pose world_from_camera; // of the viewer camera
    int64_t time_ns;               // of the take, since its first frame
    const uint8_t *color;          // camera image, RGB, of the lens's size; NULL: no composed image, the caller
                                   // composes renderer_actor_texture
    const struct affine_map *viewer_from_room; // from the occluder mesh's axes (the take's world) into the viewer
                                               // camera's. NULL: nothing hides the actor
    bool room_front;   // the room hides the actor only where its surfaces face the viewer (occlusion_shadow.h)
    int64_t within_ns; // where the nearest frame's layer is not resident, a resident one at most so far from it in
                       // time gives colours and deformation. 0: the nearest is loaded
    const struct overlay *overlay; // also drawn and asked for: viewer camera's axes. For renderer_overlay_texture and
                                   // renderer_read_seen. NULL: nothing
};

struct renderer_result {
    enum detail level;     // drawn: below DETAIL_AUTO. DETAIL_PARTS where there is no avatar to draw
    int64_t shown;         // the recorded frame whose instant is shown; -1: none
    int64_t source;        // at DETAIL_PAPER: the source frame; else -1
    int parts;             // number of body parts drawn
    int width, height;     // of the actor's image, pixels: the lens's, or less (renderer_set_resolution_scale)
    struct gpu_box within; // in that image: nothing of an avatar was drawn outside; empty for cylinders
    double error_px;       // predicted, of the level drawn
    double share_of_full;  // of DETAIL_FULL's time, by the costs measured before; NAN: none were
};

// Draws. For an image without a pose there is renderer_draw_background. OK also when no actor is
// visible. ERR_INPUT: the pose is not finite. ERR_DEVICE; ERR_CORRUPT, ERR_IO: the take.
MUST_CHECK enum status renderer_draw(struct renderer *renderer, const struct renderer_view *view,
                                     struct renderer_result *result);

// The camera image alone.
MUST_CHECK enum status renderer_draw_background(struct renderer *renderer, const uint8_t *color);

// Reads back the composed image last drawn, RGB. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_read(struct renderer *renderer, uint8_t *rgb);

// Reads back the actor alone, RGBA with straight alpha. ERR_DEVICE.
MUST_CHECK enum status renderer_read_actor(struct renderer *renderer, uint8_t *rgba);

// Reads back where each pixel of the actor last drawn comes from, RGB, not antialiased; needs
// options.sources. Red: 0 no actor, 85 the shown frame itself, 170 another frame, 255 inpainted
// (never seen; texture_atlas.h). Green, blue: high and low byte of that other frame's distance
// in time, hundredths of a second, at most 65535. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_read_source(struct renderer *renderer, uint8_t *rgb);

// ---------------------------------------------------------------- actor renderer live

// The part of the actor renderer for an app that draws continuously: an avatar that comes
// later, from another thread; frame layers loaded ahead; images as textures; changes of
// resolution and lens. Threads, memory and errors as above.

// ---- the avatar and its frame layers

// Sets the avatar that options.avatar_later announced, made by avatar_make from another handle on
// the same take, on any thread. It is uploaded in steps with the next images; until all is uploaded,
// every level that needs it is drawn as DETAIL_PAPER. NULL: there is none; these levels are then drawn as
// DETAIL_PARTS. Takes over its contents and zeroes *avatar, also on failure. ERR_INPUT: too many
// vertices. ERR_DEVICE, ERR_MEMORY. After a failure there is no avatar.
MUST_CHECK enum status renderer_set_avatar(struct renderer *renderer, struct avatar *avatar);

// True: everything that was set is uploaded.
bool renderer_upload_done(const struct renderer *renderer);

// Uploads what is left of the avatar in one go: where a hitch costs less than another look of the actor.
void renderer_finish_upload(struct renderer *renderer);

// For prefetching frame layers on another thread (frame_layer.h): the avatar, owned by the renderer,
// valid until it is closed or another is set. NULL: there is none, or it is not uploaded yet.
const struct avatar *renderer_avatar(const struct renderer *renderer);

// Adds a prefetched frame layer. Images are the same with and without it. Takes over its contents
// and zeroes *loaded, also on failure. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_add_frame(struct renderer *renderer, struct frame_layer *loaded);

// The resident frame nearest in time to `frame`, at most within_ns away; -1: none.
int64_t renderer_nearest_resident_frame(const struct renderer *renderer, int64_t frame, int64_t within_ns);

// ---- images as textures, top row first, premultiplied alpha; owned by the renderer

const struct gpu_texture *renderer_actor_texture(struct renderer *renderer); // the actor last drawn, alone
const struct gpu_texture *
renderer_shadow_texture(struct renderer *renderer); // its shadow, to compose below it. NULL: none
const struct gpu_texture *
renderer_overlay_texture(struct renderer *renderer); // view.overlay's strokes. NULL: none drawn

// What was asked with the last view.overlay that had points: depth_overlay_read. ERR_DEVICE.
MUST_CHECK enum status renderer_read_seen(struct renderer *renderer, float share[OVERLAY_GROUPS_MAX], int *count);

// ---- changes between images

// Sets the resolution scale per axis, (0, 1]: the share of the lens's pixels at which the actor is
// drawn. Textures keep their displayed size; read-backs shrink. Allocates nothing. view.color must
// then be NULL.
void renderer_set_resolution_scale(struct renderer *renderer, double resolution_scale);

// Replaces the viewer camera's lens; the resolution scale stays. Cheap unless the image size changes.
// ERR_INPUT: nothing changed; ERR_DEVICE, ERR_MEMORY: the renderer can only be closed.
MUST_CHECK enum status renderer_set_lens(struct renderer *renderer, const struct lens *lens);

// With options.sources: whether the next images write their sources, which costs time. Initially true.
void renderer_set_sources(struct renderer *renderer, bool wanted);

// Draws four recorded frames at each level and two sizes, which takes up to a second of the processor, and keeps what
// they cost, so that DETAIL_AUTO chooses by it: elapsed time or, where the driver draws by the processor, that of all
// threads. Again after another avatar was set. ERR_DEVICE; ERR_CORRUPT, ERR_IO: the take.
MUST_CHECK enum status renderer_measure_costs(struct renderer *renderer);

// As measured so far.
const struct detail_costs *renderer_costs(const struct renderer *renderer);

// Sets the level of the next images. Any, where options.detail was one that needs an avatar; else one that needs none.
void renderer_set_detail(struct renderer *renderer, enum detail detail);

// Sets the predicted error that DETAIL_AUTO accepts, pixels.
void renderer_set_error(struct renderer *renderer, double error_px);
