// A take opened for drawing: draws the actor from a camera's or an orbit's viewpoint, and gives joints and floor point
// in the same world. Joints are inpainted once when it opens; the avatar is built and frame layers are prefetched on
// other threads, whose handles share the take's index. One thread calls it, the gpu's. Textures belong to the take view
// and are valid until the next take_view_draw.
//
// Memory that grows with the take, beside the renderer's pose index: the take's index, 712 bytes a frame (recording.h),
// 8 of take_skeletons (8 more while the avatar is built) and 640 for each frame with inpainted joints, and 4 of each of
// two skeleton_tracks: 80 MB for an hour, with 640 bytes for each inpainted frame on top. It was 437 MB when
// each of four handles had an index of 528 bytes a frame and each of two tracks 968.
#pragma once
#include "app/state/orbit.h"
#include "app/state/view_state.h"
#include "base/level_of_detail.h"
#include "platform/screen/gpu.h"
#include "platform/screen/ui.h"
#include "recording/recording.h"
#include "reenact/render/depth_overlay.h"

struct take_view;

struct take_view_options {
    const char *path, *take;
    void (*notify)(void *self); // called on another thread when the avatar has progressed; may be NULL
    void *notify_self;
};
// The take can be drawn immediately: with the avatar that the recording keeps; or without the actor, but with what the
// sensor saw, until, after the first take_view_presented, a simple avatar and then the full one were built in the
// background. Where no avatar can be made, what the sensor saw is all there is: DETAIL_PAPER and _PARTS have gaps
// between the parts. They are drawn where they are asked for, and no avatar is made then. Errors: as recording_open,
// take_open and skeleton_track_open; *out is then NULL.
MUST_CHECK enum status take_view_open(struct take_view **out, struct gpu *gpu, const struct take_view_options *options);
void take_view_close(struct take_view **s); // NULL is fine; sets *s = NULL; cancels background work

// Adopts the avatar when it is finished. An error, once: it could not be built, and the sentence says why; drawing goes
// on without it; or it was built and the recording cannot keep it.
MUST_CHECK enum status take_view_adopt_avatar(struct take_view *view);
double take_view_progress(const struct take_view *view); // share of the avatar's work, 0..1; 1: nothing is running
bool take_view_final(const struct take_view *view);      // false: drawing the same request again would improve it
bool take_view_waiting(
    const struct take_view *view); // the frame that is shown is still being loaded; another stands in

int64_t take_view_length_ns(const struct take_view *view);
int64_t take_view_frames_decoded(const struct take_view *view); // so far, on all threads
int64_t take_view_frames(const struct take_view *view);
bool take_view_is_located(const struct take_view *view);    // take_is_located; false for NULL, no take
struct orbit take_view_orbit(const struct take_view *view); // starts at the sensor's viewpoint

struct take_view_request {
    struct lens lens; // of the image to draw
    struct pose world_from_camera;
    int64_t time_ns;    // since the take's first frame
    bool playing, loop; // for predicting the next frames
    struct placement placement;
    double resolution_scale;          // (0, 1]: share of the image's pixels per axis at which the actor is drawn
    enum detail detail;               // what the actor is drawn as
    double error_px;                  // allowed error of DETAIL_AUTO
    bool sources, inset;              // draw them, too
    bool camera_lost;                 // the camera is not localised: the actor is not drawn
    bool in_room;                     // an orbit in which the room hides the actor, where it faces the viewpoint
    bool sensor;                      // while the body comes: also what the sensor saw, which stood in for it
    const struct gpu_texture *camera; // the camera's image, of the lens's size; NULL: an orbit
    int64_t camera_number;            // number of that image
    const struct overlay *overlay;    // at its own depth over the actor, world axes; NULL: nothing
};

// Whether two requests would draw the same. Compares the fields, not the bytes: padding does not count.
bool take_view_request_equal(const struct take_view_request *a, const struct take_view_request *b);

struct take_view_image {
    struct lens lens;
    struct pose world_from_camera;
    const struct gpu_texture *camera; // the request's
    const struct gpu_texture *filmed; // set by the viewer: the place's recorded views behind an orbit, premultiplied,
                                      // transparent where nothing was filmed; NULL: none
    const struct gpu_texture
        *surface;                     // set by the viewer: the place's surface behind those views, likewise; NULL: none
    struct vec3 room_low, room_high;  // with surface: of the room, world axes; what lies beyond is not its
    const struct gpu_texture *actor;  // premultiplied alpha; NULL: not drawn
    struct ui_uv_rect actor_part;     // bounds of the actor in shares of the image; all of it where unknown
    const struct gpu_texture *shadow; // occlusion shadow, to be drawn under the actor; NULL: none
    const struct gpu_texture *overlay; // the request's strokes, premultiplied, where neither actor nor room hides them;
                                       // NULL: none, or the camera is lost
    bool making;                       // the actor's body is not whole yet, and nothing of it is given: not `actor`,
                                       // nor `shadow`
    bool bodiless;                     // the same for good: no avatar can be made of the take
    const struct gpu_texture
        *sensor; // the sensor's colour image while `making` or `bodiless`, and after it while it is asked for; NULL
    double sensor_aspect;              // its width divided by its height
    bool prepared;                     // `actor` is an avatar
    bool full;                         // and as good as it gets: the take's full avatar
    enum detail level;                 // `actor` was drawn at
    const struct gpu_texture *sources; // where each pixel is from, premultiplied, to be drawn over the actor; NULL
    const struct gpu_texture *inset;   // the sensor's colour image at that instant; NULL
    double inset_aspect;               // its width divided by its height
    bool flip_x;                       // actor, shadow, overlay and sources are to be drawn mirrored, left to right
    bool has_skeleton;
    struct skeleton skeleton; // world axes, placement and mirroring applied
    struct vec3 floor_point;  // on the floor under the actor
    int64_t frame;            // the recorded frame that is shown; -1: none
    int parts;                // body parts drawn
};
// Draws one request. ERR_DEVICE, ERR_MEMORY, ERR_CORRUPT, ERR_IO; *out is then undefined.
MUST_CHECK enum status take_view_draw(struct take_view *view, const struct take_view_request *request,
                                      struct take_view_image *out);

// Of each group of the last request.overlay that was drawn the share that is seen (depth_overlay_read). *count: 0: none
// was drawn yet. ERR_DEVICE.
MUST_CHECK enum status take_view_read_seen(struct take_view *view, float share[OVERLAY_GROUPS_MAX], int *count);

// To be called after the image was presented: starts loading what the next ones are predicted to show.
void take_view_presented(struct take_view *view);

// From so far a metre at the orbit's centre is the lens's fx / ORBIT_NEAREST_M pixels.
static const double ORBIT_NEAREST_M = 3;

// The lens of an orbit for an image of that size, pixels. At the orbit's initial distance the whole actor is seen
// inside `free`, the orbit's centre in its middle.
struct lens take_view_orbit_lens(int width, int height, struct ui_box free);
