// The tablet's camera and its idea of where it is, on two threads of their own: one
// waits for pictures, one locates the newest. What comes out is a picture together
// with the place it was taken from, so that whoever draws into it never mixes two
// instants; where the camera is lost, pictures have none for a while (camera_localizer.h). Pictures
// that come faster than they can be located are let go by, and so is one whose place took
// so long to find that a newer one is better (frame_skip.h).
//
// A camera that fails is closed and tried again every second. A folder is played at
// the pace it was filmed, over and over.
#pragma once
#include "capture/recording/place.h"
#include "platform/dmabuf_image.h"

struct camera_feed;

struct camera_feed_options {
    const char *camera;         // URI; copied
    const struct place *place;  // NULL: nothing to be located in; must outlive the eyes
    void (*notify)(void *self); // called on other threads whenever there is something new; may be NULL
    void *notify_self;
    bool lend_dmabuf; // pictures are wanted where they lie, too: camera_feed_take_dmabuf
};
MUST_CHECK enum status camera_feed_open(struct camera_feed **out,
                                        const struct camera_feed_options *options); // ERR_MEMORY
void camera_feed_close(struct camera_feed **e);                                     // NULL is fine

struct camera_frame {
    const uint8_t *rgb; // of the lens's size
    struct lens lens;
    bool placed; // world_from_camera is known
    struct pose world_from_camera;
    int32_t moved_tags, first_moved; // that hang elsewhere than the place has them, see localizer_moved_tags
    int64_t number;                  // 1, 2, … of all pictures that came
    // The clock (clock_now_ns) when the camera gave it, and when locating began and ended.
    int64_t came_ns, locating_ns, located_ns;
};
// The newest located picture, NULL before the first. Borrowed until the next call.
const struct camera_frame *camera_feed_latest(struct camera_feed *e);

// The picture of the sight last looked at, where it lies in the camera's memory, once: the caller's, who
// returns it. NULL: the camera lends none.
struct dmabuf_image *camera_feed_take_dmabuf(struct camera_feed *e);

// What was drawn has been handed to the display: now there is time to look for a camera that is lost.
void camera_feed_presented(struct camera_feed *e);

struct camera_feed_state {
    bool seeing;           // the camera is open and gave a picture
    int64_t came_ns;       // when the last picture came; of opening before the first
    int64_t came, dropped; // pictures
    char trouble[512];     // one sentence; "" while there is none
};
struct camera_feed_state camera_feed_query(struct camera_feed *e);

// Nobody looks: the camera is closed until it is called again with false.
void camera_feed_suspend(struct camera_feed *e, bool suspend);
