// Draws the recorded person into a tablet camera's picture (2014 paper, section
// 4.2): moves the skeleton to the viewer, builds the rough model from the radius
// rates, chooses frames for its colours, gives every part a projection of its
// own into its frame, and lays it over the picture, lens distortion included.
//
// Pure but for the GPU it is given: no clock, no file, no memory of pictures
// drawn before that would change the next, unless view.within_ns allows it. One renderer, one thread.
#pragma once
#include "capture/recording/recording.h"
#include "platform/gpu.h"
#include "reenact/frame/frame_layer.h"
#include "reenact/scene/occluder_mesh.h"

enum detail {
    DETAIL_PAPER, // 2014 to the letter: the yardstick. One frame for the whole body
                  // (equation 5), that frame's plain colours, open cylinders
    DETAIL_FULL,  // our best: what the shown frame itself saw, and about it measured shapes, a frame for each part, its
                  // own pixels only, smooth edges, joints between recorded instants
    DETAIL_AUTO,  // the cheapest whose predicted error is no more than options.error_px
};

// What a renderer holds on the GPU is bounded, however long the take: options.texture_bytes
// of recorded frames (beyond paper half of them for those that were shown, half for those
// that colours were borrowed from), 8 bytes a pixel of the take's pictures for the shown one,
// 42 bytes a pixel of the tablet's (with everything that can be asked for), and 16 MiB for
// meshes and the person's colours.
struct renderer;

struct renderer_options {
    const struct take_skeletons *skeletons; // of the take, borrowed; NULL, the default: the renderer makes them
    enum detail detail;                     // default DETAIL_FULL
    size_t texture_bytes; // of recorded frames kept on the GPU, see below; at least one is. Default 64 MiB
    double error_px;      // that DETAIL_AUTO may be wrong by. Default 1
    bool sources;         // renderer_read_source will be asked for. Default no
    bool shadow;          // he casts one on the floor, where the take has a place and so a floor. Default no
    bool avatar_later;    // somebody else makes it and gives it (renderer_set_avatar). Default no
    const struct progress_watch *watch; // while renderer_open makes it; NULL, the default: nobody waits
};
struct renderer_options renderer_default_options(void);

// The take, with everything it needs, must outlive the renderer, and nobody else may
// read its pictures meanwhile; so must the gpu. lens: the tablet camera's; copied.
// ERR_INPUT: nobody to show (skeleton_track_open), no body, a picture too large. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_open(struct renderer **out, struct gpu *gpu, struct take *take, const struct lens *lens,
                                     const struct renderer_options *options);
void renderer_close(struct renderer **p);

// What options.avatar_later promised, made by avatar_make from another handle on
// the same take, perhaps on another thread. Until all of it is on the GPU, some
// pictures later, every level is drawn as DETAIL_PAPER. NULL: there is none; what is
// beyond paper is then drawn as rounded cylinders. Its contents go over to the
// renderer and *avatar is zeroed, on failure too. ERR_INPUT: too large to be drawn.
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_set_avatar(struct renderer *p, struct avatar *avatar);

// For whoever loads the frames that will be shown before they are, on another thread (frame_layer.h): the avatar to
// do it with, which is the renderer's and good until it is closed or given another. NULL: there is none, or not all of
// it is on the GPU yet.
const struct avatar *renderer_avatar(const struct renderer *p);

// Such a frame. A picture is the same with it as without, only sooner drawn. Its contents go over to the renderer and
// *loaded is zeroed, on failure too. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_add_frame(struct renderer *p, struct frame_layer *loaded);

// Of the frames that need not be loaded to be shown, the one nearest in time to `frame`, at most that far from it; -1.
int64_t renderer_nearest_resident_frame(const struct renderer *p, int64_t frame, int64_t within_ns);

// The room that hides him where it stands before him (occluder_mesh_make); as above. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_set_room(struct renderer *p, struct occluder_mesh *room);

struct renderer_view {
    struct pose world_from_camera; // of the tablet
    int64_t time_ns;               // of the take, since its first frame
    const uint8_t *color;          // the camera's picture, RGB of the lens's size; NULL: whoever asks for
                                   // renderer_actor_texture has it himself, and there is no composed picture
    const struct affine_map *viewer_from_room; // where the room is that hides him: from its axes, which are
                                               // the take's world, into the tablet camera's. NULL: nothing hides him
    int64_t within_ns; // where the frame nearest in time would have to be loaded, another that need not and
                       // is at most so far from it gives its colours and shape. 0: none does
    bool also_paper;   // draw him at paper, too, for renderer_paper_texture. With avatar_later
};

struct renderer_result {
    enum detail level; // what was drawn: paper or full
    int64_t shown;     // the recorded frame whose instant is shown; -1: nobody
    int64_t source;    // at paper: the frame the colours came from; else -1
    int parts;         // drawn
    int width, height; // of the picture he was drawn in, pixels: the lens's, or less (renderer_set_resolution_scale)
    struct gpu_box within; // of that: outside nothing of him was drawn at full
    double error_px;       // predicted (reenact/render/lod_error.h), of the level that was drawn
};

// Draws. For a picture that could not be placed there is renderer_draw_background.
// OK also when nobody is to be seen. ERR_INPUT: a pose that is not finite. ERR_DEVICE; ERR_CORRUPT, ERR_IO: the take.
MUST_CHECK enum status renderer_draw(struct renderer *p, const struct renderer_view *view,
                                     struct renderer_result *result);

// The camera's picture alone.
MUST_CHECK enum status renderer_draw_background(struct renderer *p, const uint8_t *color);

// The picture last drawn, RGB. ERR_DEVICE.
MUST_CHECK enum status renderer_read(struct renderer *p, uint8_t *rgb);

// The actor alone, RGBA with straight alpha. ERR_DEVICE.
MUST_CHECK enum status renderer_read_actor(struct renderer *p, uint8_t *rgba);

// Where each pixel of the actor last drawn is from, RGB, without smooth edges; needs options.sources.
// Red: 0 nobody, 85 seen by the shown frame itself, 170 borrowed from another
// frame, 255 filled in (a side that nobody saw; color_inpainting.h). Green, blue: high and low byte of the borrowed
// frame's distance in time, hundredths of a second, at most 65535. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status renderer_read_source(struct renderer *p, uint8_t *rgb);

// The actor last drawn alone as a texture, top row first, premultiplied alpha, for whoever shows it in a window.
const struct gpu_texture *renderer_actor_texture(struct renderer *p);

// His shadow in the picture last drawn, premultiplied, likewise: to be laid under him. NULL: there is none.
const struct gpu_texture *renderer_shadow_texture(struct renderer *p);

// The actor at paper where view.also_paper asked for it, likewise.
const struct gpu_texture *renderer_paper_texture(struct renderer *p);

// From now on he is drawn with that share of the lens's pixels along either side, 0 to 1: his textures show him as
// large as ever, and what is read of them is so small. Costs nothing, and what is composed (view.color) is not to be
// had.
void renderer_set_resolution_scale(struct renderer *p, double resolution_scale);

// From now on for this lens, as finely as before. Cheap as long as pictures keep their size.
// ERR_INPUT; ERR_DEVICE, ERR_MEMORY: nothing more can be drawn.
MUST_CHECK enum status renderer_set_lens(struct renderer *p, const struct lens *lens);

// With options.sources: whether the next pictures' sources are wanted, which cost time. At first they are.
void renderer_set_sources(struct renderer *p, bool wanted);

// Nothing that was given is still on its way to the GPU.
bool renderer_upload_done(const struct renderer *p);

// From now on DETAIL_AUTO may be wrong by that, pixels.
void renderer_set_error(struct renderer *p, double error_px);
