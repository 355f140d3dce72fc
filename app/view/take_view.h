// A take, opened to be watched: it draws the actor into a camera's picture or an
// orbit's, and says where his joints and the floor are in it. Textures belong to
// the stage and are good until the next take_view_draw. One thread, the gpu's.
#pragma once
#include "app/state/orbit.h"
#include "app/state/view_state.h"
#include "capture/recording/recording.h"
#include "platform/gpu.h"
#include "platform/ui.h"

struct take_view;

struct take_view_options {
    const char *path, *take;
    void (*notify)(void *self); // called on another thread when preparing went on; may be NULL
    void *notify_self;
};
// The take can be drawn at once, as DETAIL_PAPER has it; what is better is prepared
// meanwhile on a thread of its own. ERR_…: as recording_open, take_open and renderer_open.
MUST_CHECK enum status take_view_open(struct take_view **out, struct gpu *gpu, const struct take_view_options *options);
void take_view_close(struct take_view **s); // NULL is fine; what is being prepared is given up

// Takes over what was prepared by now. An error, once: nothing better came of it, and why.
MUST_CHECK enum status take_view_adopt_avatar(struct take_view *s);
double take_view_progress(const struct take_view *s); // the share that is done; 1: nothing more is to come
bool take_view_final(const struct take_view *s);      // false: the next picture of the same will be another
bool take_view_waiting(const struct take_view *s);    // in a moment it will: the frame that is shown is being loaded

int64_t take_view_length_ns(const struct take_view *s);
int64_t take_view_frames(const struct take_view *s);
struct orbit take_view_orbit(const struct take_view *s); // from where the sensor stood

struct take_view_request {
    struct lens lens; // of the picture to draw into
    struct pose world_from_camera;
    int64_t time_ns;    // of the take
    bool playing, loop; // what will be looked at next
    struct placement placement;
    double resolution_scale;          // 0..1: the share of the picture's size that the actor is drawn at
    double error_px;                  // that he may be wrong by where drawing less is quicker
    bool sources, inset;              // are wanted
    bool camera_lost;                 // the camera does not know where it is
    bool former;                      // also the actor as he was drawn before he was prepared
    const struct gpu_texture *camera; // its picture, of the lens's size; NULL: an orbit
    int64_t camera_number;            // another number is another picture
};

struct take_view_image {
    struct lens lens;
    struct pose world_from_camera;
    const struct gpu_texture *camera;  // the look's
    const struct gpu_texture *actor;   // premultiplied; NULL: nobody
    struct ui_uv_rect actor_part;      // where he is, in shares of the picture; all of it where that is not known
    const struct gpu_texture *shadow;  // likewise, under him; NULL
    const struct gpu_texture *former;  // likewise, as he was drawn before; NULL
    bool prepared;                     // `actor` is what was prepared
    const struct gpu_texture *sources; // premultiplied, laid over the actor; NULL
    const struct gpu_texture *inset;   // the sensor's picture at that instant; NULL
    double inset_aspect;               // its width over its height
    bool flip_x;                       // actor and sources are to be drawn left to right
    bool has_skeleton;
    struct skeleton skeleton; // in the world, placed and mirrored
    struct vec3 floor_point;  // on the floor under the actor
    int64_t frame;            // the recorded one that is shown
    int parts;                // drawn
};
MUST_CHECK enum status take_view_draw(struct take_view *s, const struct take_view_request *request,
                                      struct take_view_image *out);

// The picture has been handed to the display: now there is time to load what the next ones show.
void take_view_presented(struct take_view *s);

// The lens an orbit looks through, for a picture of that size, pixels. From where an orbit begins the actor is seen in
// `free`, whole, what he circles in its middle.
struct lens take_view_orbit_lens(int width, int height, struct ui_box free);
