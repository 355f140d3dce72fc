// What the viewer's parts have in common, and each part's interface to viewer.c. Each part owns its state and defines
// it in its own file. Included in app/viewer alone; tests get at the parts by viewer_inside.h.
#pragma once
#include "app/camera/camera_feed.h"
#include "app/ui/take_list.h"
#include "app/view/take_view.h"
#include "app/viewer/viewer.h"

// Owned by viewer.c; the parts read it, and write where it says so.
struct viewer_shared {
    struct viewer_options options;
    struct gpu *gpu;
    struct view_state state; // the parts report to it
    struct screens screens;
    struct recording *recording; // NULL: it could not be opened
    struct take_list takes;
    struct recording *other;   // options.compare_with, where that is another one; else NULL
    struct take_list attempts; // its takes
    struct place place;
    bool has_place;
    const struct camera_frame *frame; // set by the camera: the newest at the last update; NULL: none
    struct take_view *take_view;      // NULL: no take is open
    struct take_view_image image;     // drawn by viewer.c, on live screens by viewer_live_draw
    bool has_image;
};

// ---------------------------------------------------------------- camera

// The camera's images, and when none are needed. Without options.camera there are none, and it says so to the state.
struct viewer_camera;

// After the recording. ERR_DEVICE, ERR_MEMORY: *out is NULL.
MUST_CHECK enum status viewer_camera_open(struct viewer_camera **out, struct viewer_shared *shared);
void viewer_camera_close(struct viewer_camera **camera); // NULL is fine
void viewer_camera_suspend(struct viewer_camera *camera, bool suspend);
// Fetches the newest frame. The camera is not read while its images would change nothing.
void viewer_camera_update(struct viewer_camera *camera, int64_t now_ns);
int64_t viewer_camera_due_ns(const struct viewer_camera *camera); // when to update it at the latest; INT64_MAX: never
// Puts shared.frame's image into the texture, once. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_camera_upload(struct viewer_camera *camera);
const struct gpu_texture *viewer_camera_texture(const struct viewer_camera *camera); // with shared.frame
void viewer_camera_presented(struct viewer_camera *camera);
struct camera_feed_state viewer_camera_query(const struct viewer_camera *camera); // without a camera: zeros
bool viewer_camera_is_resting(const struct viewer_camera *camera); // closed, since its images are not needed
void viewer_camera_print_stats(const struct viewer_camera *camera, FILE *out);

// ---------------------------------------------------------------- live

// The sensor's frames, the judgement of attempts, and what the live screens are drawn from.
struct viewer_live;

MUST_CHECK enum status viewer_live_open(struct viewer_live **out, struct viewer_shared *shared); // ERR_MEMORY
void viewer_live_close(struct viewer_live **live);                                               // NULL is fine
// When a take was opened: reads its movement and opens the sensor. A take that cannot be judged is no error; the screen
// says so. ERR_MEMORY.
MUST_CHECK enum status viewer_live_open_take(struct viewer_live *live, const char *take);
void viewer_live_suspend(struct viewer_live *live, bool suspend);
void viewer_live_update(struct viewer_live *live, int64_t now_ns); // before view_state_tick
void viewer_live_after_tick(struct viewer_live *live, int64_t now_ns);
// The viewpoint of the figures beside each other, and of the summary.
void viewer_live_request(struct viewer_live *live, const struct viewer_surface *surface,
                         struct take_view_request *request);
// Draws the actor for the live screen into shared.image, and fills the page. *request: of an orbit or a camera image,
// as for watching; the mirror replaces lens and pose. ERR_DEVICE, ERR_MEMORY, and those of take_view_draw.
MUST_CHECK enum status viewer_live_draw(struct viewer_live *live, const struct viewer_surface *surface,
                                        struct take_view_request *request);
struct live_page;
const struct live_page *viewer_live_page(const struct viewer_live *live);
struct viewer_live_view viewer_live_view_of(struct viewer_live *live); // viewer_inside.h
void viewer_live_print_stats(const struct viewer_live *live, FILE *out);

// ---------------------------------------------------------------- room

// The room about the actor: the recording's things, its filmed views behind an orbit, and the map. What takes long runs
// on threads (room_worker, knowledge_asker); nothing here waits for them.
struct viewer_room;

// Reads the recording's things. What of them is damaged is no error: there are none then. ERR_DEVICE, ERR_MEMORY: *out
// is NULL.
MUST_CHECK enum status viewer_room_open(struct viewer_room **out, struct viewer_shared *shared);
void viewer_room_close(struct viewer_room **room); // NULL is fine
// Fetches what the threads have made.
void viewer_room_update(struct viewer_room *room);
// Whether the recorded views are to be shown behind the orbit.
bool viewer_room_wants_filmed(const struct viewer_room *room);
// The recorded views behind an orbit, as seen by the request; *out NULL: there are none (yet). ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_draw_filmed(struct viewer_room *room, const struct take_view_request *request,
                                               int64_t now_ns, const struct gpu_texture **out);
// The map's surface as seen by the request, and the room's bounds, into the image: what is behind the recorded views
// where they show nothing. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_draw_surface(struct viewer_room *room, const struct take_view_request *request,
                                                struct take_view_image *out);
// Asks with the request which things are seen in its picture; the answer is read before the next one is drawn, when the
// GPU has it.
void viewer_room_ask_seen(struct viewer_room *room, struct take_view_request *request);
void viewer_room_expect_seen(struct viewer_room *room, bool asked);     // a request was drawn, which asked or did not
MUST_CHECK enum status viewer_room_read_seen(struct viewer_room *room); // ERR_DEVICE
// Fills the page, with the map and the card's pictures where they are open. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_draw(struct viewer_room *room, const struct viewer_surface *surface, int64_t now_ns);
const struct room_page *viewer_room_page(const struct viewer_room *room);
struct viewer_room_view viewer_room_view_of(struct viewer_room *room); // viewer_inside.h
