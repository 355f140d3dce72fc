// The camera feed: the camera's images with their poses, from two threads of its own. One waits for images, one
// localises the newest. Image and pose come as one frame, so that nothing is drawn into the image of another instant.
// While the camera is lost, frames come without a pose (localizer_locate). Images that arrive faster than they can be
// localised are dropped; so is one whose pose took so long that a newer image is better (frame_times.h).
//
// A camera that fails is closed and opened again every second. A folder is played at the pace of its recording, in an
// endless loop.
//
// Threads: one thread, the drawing one, calls camera_feed_open, _close, _latest, _take_dmabuf and _presented;
// camera_feed_query and _suspend may be called from any thread. Memory: at most eight images, and two in the
// relocalizer.
#pragma once
#include "base/status.h"
#include "locate/locator.h"
#include "platform/sensors/source.h"
#include "recording/place.h"

// ---------------------------------------------------------------- present gap

// The gap between two frames: from presenting one until drawing the next. A background computation that starts at the
// beginning of a gap delays no frame if it ends within it. Any thread may call.

struct present_gap;

MUST_CHECK enum status present_gap_open(struct present_gap **out); // ERR_MEMORY
void present_gap_close(struct present_gap **gap);                  // NULL is fine; no thread may be waiting

void present_gap_begin(struct present_gap *gap); // a frame has been presented

// How many gaps have begun: the argument of a later present_gap_wait.
int64_t present_gap_count(struct present_gap *gap);
// Blocks until more than `count` gaps have begun, at most 50 ms: maybe nothing is being drawn.
void present_gap_wait(struct present_gap *gap, int64_t count);

// ---------------------------------------------------------------- camera localizer

// The camera's pose, image after image: the app's interface to tracking and relocalisation (locate/camera_tracker.h).
// It survives a camera that is opened again and whose clock restarts.
//
// A camera that was tracked and is lost, or jumps, is relocalised on another thread of its own; meanwhile images come
// without a pose. Where relocalisation was no help, or nothing was tracked before, localizer_locate blocks until the
// image is localised.
//
// One thread calls.

struct camera_localizer;

// Copies what it needs of place and lens. gap: relocalisation starts in it; NULL: immediately; must outlive the
// localizer. ERR_INPUT, ERR_MEMORY as locator_open; *out is then NULL.
MUST_CHECK enum status localizer_open(struct camera_localizer **out, const struct place *place, const struct lens *lens,
                                      struct present_gap *gap);
void localizer_close(struct camera_localizer **localizer); // NULL is fine; waits for a running relocalisation

// The lens used for the last image; self-calibration may have changed it: camera_tracker_lens.
const struct lens *localizer_lens(const struct camera_localizer *localizer);

// How many tags are not where the place has them, by the last image that was localised. *first: the lowest of their
// numbers, -1 for none. See camera_tracker_moved_tags.
int32_t localizer_moved_tags(const struct camera_localizer *localizer, int32_t *first);

// color: RGB of the lens's size. time_ns: of the exposure, by the camera's clock.
// OK, AMBIGUOUS: *world_from_camera is filled. NOTHING: the pose is not known. Errors as locator_localize; the next
// image may be tried.
MUST_CHECK enum status localizer_locate(struct camera_localizer *localizer, const uint8_t *color, int64_t time_ns,
                                        struct pose *world_from_camera);

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
