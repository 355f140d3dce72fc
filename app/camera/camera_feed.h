// The camera feed: the camera's images with their poses, from two threads of its own. One waits for images, one
// localises the newest. Image and pose come as one frame, so that nothing is drawn into the image of another instant.
// While the camera is lost, frames come without a pose (camera_localizer.h). Images that arrive faster than they can
// be localised are dropped; so is one whose pose took so long that a newer image is better (frame_times.h).
//
// A camera that fails is closed and opened again every second. A folder is played at the pace of its recording, in an
// endless loop.
//
// Threads: one thread, the drawing one, calls camera_feed_open, _close, _latest, _take_dmabuf and _presented;
// camera_feed_query and _suspend may be called from any thread. Memory: at most eight images, and two in the
// relocalizer.
#pragma once
#include "app/camera/present_gap.h"
#include "base/status.h"
#include "platform/sensors/dmabuf_image.h"
#include "recording/place.h"

// ---------------------------------------------------------------- mailbox

// A slot for one item between two threads, newest wins: putting never waits, taking gets the newest item, and an item
// that is replaced before it was taken goes back to the thread that puts.

struct mailbox;

MUST_CHECK enum status mailbox_open(struct mailbox **out); // ERR_MEMORY
void mailbox_close(
    struct mailbox **mailbox); // NULL is fine; neither thread may use it any more; an item in it is not freed

// Returns the replaced item, which belongs to the caller again, or NULL.
void *mailbox_put(struct mailbox *mailbox, void *item);

// Takes the item, or NULL. wait: blocks until there is one; NULL then means stopped.
void *mailbox_take(struct mailbox *mailbox, bool wait);

// Whether an item is waiting.
bool mailbox_full(struct mailbox *mailbox);

// From either thread: mailbox_take returns NULL from now on.
void mailbox_stop(struct mailbox *mailbox);

// ---------------------------------------------------------------- camera feed

struct camera_feed;

struct camera_feed_options {
    const char *camera;         // URI; copied
    const struct place *place;  // to localise in; NULL: none; must outlive the feed
    void (*notify)(void *self); // called on the feed's threads whenever there is something new; may be NULL
    void *notify_self;
    bool lend_dmabuf; // also lend images as DMA buffers, where the camera can: camera_feed_take_dmabuf
};
// ERR_MEMORY: *out is NULL. A camera that cannot be opened is no error here: camera_feed_state.trouble says so.
MUST_CHECK enum status camera_feed_open(struct camera_feed **out, const struct camera_feed_options *options);
void camera_feed_close(struct camera_feed **f); // NULL is fine; waits for both threads

struct camera_frame {
    const uint8_t *rgb; // of the lens's size
    struct lens lens;
    bool placed; // world_from_camera is known
    struct pose world_from_camera;
    int32_t moved_tags, first_moved; // tags that are not where the place has them: localizer_moved_tags
    int64_t number;                  // 1, 2, … over all images that arrived
    // Times by clock_now_ns: when the image arrived, when localising it began and ended.
    int64_t received_ns, locating_ns, located_ns;
};
// The newest processed frame, NULL before the first. Borrowed until the next call.
const struct camera_frame *camera_feed_latest(struct camera_feed *feed);

// The DMA buffer of the frame that camera_feed_latest returned last, once per frame; the caller releases it. NULL: the
// camera lends none.
struct dmabuf_image *camera_feed_take_dmabuf(struct camera_feed *feed);

// A drawn frame has been handed to the display: a pending relocalisation may start.
void camera_feed_presented(struct camera_feed *feed);

struct camera_feed_state {
    bool seeing;               // the camera is open and has delivered an image
    int64_t received_ns;       // when the last image arrived; before the first: when opening began
    int64_t received, dropped; // number of images
    char trouble[512];         // one sentence; "": none
};
struct camera_feed_state camera_feed_query(struct camera_feed *feed);

// true: the camera is closed until the call with false.
void camera_feed_suspend(struct camera_feed *feed, bool suspend);
