// The viewer: all of the app but its window, so that it runs the same on a screen and, in tests, into memory.
//
// One thread, the GPU's. The camera feed, the avatar builder and the judge of takes have threads of their own.
#pragma once
#include "app/camera/camera_feed.h"
#include "app/camera/camera_texture.h"
#include "app/state/frame_times.h"
#include "app/ui/input_map.h"
#include "app/ui/take_list.h"
#include "app/view/take_view.h"
#include "app/viewer/settings_file.h"
#include "app/viewer/take_judge.h"
#include "app/viewer/viewer_live.h"
#include "app/viewer/viewer_room.h"

// The graphics card where there is one; or always the room worker; or the graphics card whatever its driver draws by.
enum room_drawing { ROOM_DRAWN_AS_FITS, ROOM_DRAWN_BY_WORKER, ROOM_DRAWN_BY_CARD };

struct viewer_options {
    const char *file;
    const char *take;    // NULL: the only one, or the user chooses
    const char *camera;  // URI; NULL: none
    const char *sensor;  // URI of a depth sensor: do the move beside the actor; NULL: watch
    bool no_body_points; // are looked for in the sensor's colour images
    bool every_frame;    // a film as sensor leaves nothing out, however slow the machine
    const char *photos;  // folder for screenshots; NULL: the user's pictures
    bool light, developer;
    double text_size;     // of view_text_sizes; 0: 1
    const char *settings; // file in which the user's choices are kept; NULL: they are not
    bool mirrored;        // the actor is shown left and right exchanged from the start, and with a sensor judged by so
    bool offer_trim;      // the take's ends can be cut off: state.trim
    bool ask_knowledge;   // ask a thing's own address what is newer when its card is opened
    enum room_drawing room_drawing; // who draws the filmed room behind an orbit
    bool fixed_resolution;          // the actor is always drawn at every pixel
    double refresh_hz;
    void (*opening)(void *self); // with wake_self: called before the recording is opened, for viewer_draw_opening; may
                                 // be NULL
    void (*wake)(void *self);    // called on other threads: there is something new; may be NULL
    void *wake_self;
};

struct viewer {
    struct viewer_options options;
    struct gpu *gpu;
    struct ui *ui;
    struct view_state state;
    struct screens screens;
    struct input_map input;
    struct recording *recording;
    struct take_list takes;
    struct take_judge *judge; // of takes whose file keeps no verdict; NULL: there was none yet
    struct place place;
    bool has_place;
    struct take_view *take_view;
    struct camera_feed *feed;
    struct camera_texture *camera_texture; // the feed's image
    struct viewer_live live;               // with options.sensor
    struct viewer_room room;
    int64_t uploaded_number;          // camera_frame.number of that image
    const struct camera_frame *frame; // the newest at the last viewer_update; NULL: none
    struct take_view_request request; // what `image` was drawn for
    bool has_image;
    struct pose last_placed;
    struct ui_box free; // dp: where an orbit shows the actor; moves smoothly to what the controls leave free
    int64_t eased_ns;   // when `free` last moved
    struct take_view_image image;
    struct resolution_governor governor;
    struct frame_times times;
    int64_t placed; // frames drawn with the actor at a known camera pose
    struct camera_feed_state feed_state;
    char trouble[512], problem[300];
    struct settings_keeper settings;
    int64_t checked_ns, pad_ns, timed_frame;
    bool suspended;
    bool camera_rests;                         // the camera is closed, since its images are not needed
    int64_t camera_unneeded_ns;                // since when; 0: they are needed
    int64_t suspended_ns;                      // when it was suspended
    int64_t drawing_ns, drawn_ns, controls_ns; // when the last frame's stages began and ended
};

// ERR_DEVICE, ERR_MEMORY: call viewer_close. A file that cannot be read is no error here; the screen says so.
MUST_CHECK enum status viewer_open(struct viewer *v, struct gpu *gpu, const struct viewer_options *options);
void viewer_close(struct viewer *viewer); // zeroed is fine

// The screen is hidden or shown again. While it is hidden the camera is closed and the playback stands still.
void viewer_suspend(struct viewer *viewer, bool suspend, int64_t now_ns);

// Takes the camera's newest frame, opens the chosen take, advances to now_ns. Returns when to call it again at the
// latest; viewer->state.changed says whether to draw.
int64_t viewer_update(struct viewer *viewer, int64_t now_ns);

struct viewer_surface {
    struct gpu_target *target; // NULL: the window
    int width, height;         // pixels, before rotation
    int quarter_turns;         // clockwise rotation of the display
    double px_per_dp;
};
// What the screen shows while viewer_open opens the recording (viewer_options.opening). ERR_DEVICE.
MUST_CHECK enum status viewer_draw_opening(struct viewer *v, const struct viewer_surface *surface);

// ERR_DEVICE: the GPU context is lost; close everything and open it again.
MUST_CHECK enum status viewer_draw(struct viewer *v, const struct viewer_surface *surface, int64_t now_ns);

// The frame has been handed to the display: completes its times and starts the present gap.
void viewer_presented(struct viewer *viewer, int64_t now_ns);

// An event of the window; input that is older than the page it would land on is dropped. True: draw a frame before
// passing the next one.
bool viewer_event(struct viewer *viewer, const struct window_event *event, double px_per_dp, int64_t now_ns);

// Whether two requests would draw the same. Compares the fields, not the bytes: padding does not count.
bool view_request_equal(const struct take_view_request *a, const struct take_view_request *b);

// Pixels per dp for a screen of that dpi.
double viewer_px_per_dp(double dpi);
// With everything larger by `text_size`, though never so large that less than 376 dp of the shorter side remain: below
// that the controls have no room.
double viewer_px_per_dp_with_text(double px_per_dp, double text_size, int width, int height);
