// The viewer: all of the app but its window, so that it runs the same on a screen and, in tests, into memory.
//
// One thread, the GPU's. The camera feed, the avatar builder and the judge of takes have threads of their own.
#pragma once
#include "base/level_of_detail.h"
#include "base/status.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

struct gpu;
struct gpu_target;
struct window_event;
struct settings_keeper;

// The graphics card where there is one; or always the room worker; or the graphics card whatever its driver draws by.
enum room_drawing { ROOM_DRAWN_AS_FITS, ROOM_DRAWN_BY_WORKER, ROOM_DRAWN_BY_CARD };

struct viewer_options {
    const char *file;
    const char *take;         // NULL: the only one, or the user chooses
    const char *camera;       // URI; NULL: none
    const char *compare_with; // another recording, or the same: two takes are to be compared, the reference one of
                              // `file`'s and the attempt one of these; NULL: watch
    const char *sensor;       // URI of a depth sensor: do the move beside the actor; NULL: watch
    bool no_body_points;      // are looked for in the sensor's colour images
    bool every_frame;         // a film as sensor leaves nothing out, however slow the machine
    const char *photos;       // folder for screenshots; NULL: the user's pictures
    bool light, developer, fullscreen;
    double text_size;  // of view_text_sizes; 0: 1
    bool detail_given; // the actor is drawn as `detail`; else as the user chose last
    enum detail detail;
    const char *settings; // file in which the user's choices are kept; NULL: they are not
    bool mirrored;        // the actor is shown left and right exchanged from the start, and with a sensor judged by so
    bool offer_trim;      // the take's ends can be cut off: viewer_wishes.trim
    bool ask_knowledge;   // ask a thing's own address what is newer when its card is opened
    enum room_drawing room_drawing; // who draws the filmed room behind an orbit
    bool fixed_resolution;          // the actor is always drawn at every pixel
    double refresh_hz;
    void (*opening)(void *self); // with wake_self: called before the recording is opened, for viewer_draw_opening; may
                                 // be NULL
    void (*wake)(void *self);    // called on other threads: there is something new; may be NULL
    void *wake_self;
};

struct viewer;

// *out is set before options->opening is called. ERR_DEVICE, ERR_MEMORY: *out is NULL. A file that cannot be read is no
// error here; the screen says so. Strings of the options are borrowed until viewer_close.
MUST_CHECK enum status viewer_open(struct viewer **out, struct gpu *gpu, const struct viewer_options *options);
void viewer_close(struct viewer **viewer); // NULL is fine

// ---------------------------------------------------------------- for the window

// The screen is hidden or shown again. While it is hidden the camera is closed and the playback stands still.
void viewer_suspend(struct viewer *viewer, bool suspend, int64_t now_ns);

// Takes the camera's newest frame, opens the chosen take, advances to now_ns. Returns when to call it again at the
// latest; viewer_query says whether to draw.
int64_t viewer_update(struct viewer *viewer, int64_t now_ns);

// What the window, or the program round the viewer, is to do. Valid after each of the calls below and viewer_update.
struct viewer_wishes {
    bool draw;       // there is something new to draw
    bool type;       // text is typed
    bool fullscreen; // the window fills the screen
    bool quit;
    bool to_takes;                       // the list of takes is shown: a program with a list of its own goes there
    bool trim;                           // the take is to be cut to what follows
    int64_t trim_from_ns, trim_to_ns;    // of the take
    double text_size;                    // of view_text_sizes
    bool dark;                           // colours
    const struct settings_keeper *keeps; // the user's choices as the file has them
};
struct viewer_wishes viewer_query(const struct viewer *viewer);

struct viewer_surface {
    struct gpu_target *target; // NULL: the window
    int width, height;         // pixels, before rotation
    int quarter_turns;         // clockwise rotation of the display
    double px_per_dp;
};
// What the screen shows while viewer_open opens the recording (viewer_options.opening). ERR_DEVICE.
MUST_CHECK enum status viewer_draw_opening(struct viewer *v, const struct viewer_surface *surface);

// ERR_DEVICE: the GPU context is lost; close everything and open it again, as viewer_options_again says.
MUST_CHECK enum status viewer_draw(struct viewer *v, const struct viewer_surface *surface, int64_t now_ns);

// The frame has been handed to the display: completes its times and starts the present gap. True: it shows another page
// than the one before, for which what the user has pressed until now was not meant; the window drops that.
bool viewer_presented(struct viewer *viewer, int64_t now_ns);

// An event of the window; input that is older than the page it would land on is dropped. True: draw a frame before
// passing the next one.
bool viewer_event(struct viewer *viewer, const struct window_event *event, double px_per_dp, int64_t now_ns);

// Pixels per dp for a screen of that dpi.
double viewer_px_per_dp(double dpi);
// With everything larger by `text_size`, though never so large that less than 376 dp of the shorter side remain: below
// that the controls have no room.
double viewer_px_per_dp_with_text(double px_per_dp, double text_size, int width, int height);

// ---------------------------------------------------------------- for logs

// What has been shown so far.
struct viewer_shown {
    bool sensor;        // the last frame showed what the sensor saw, for want of a whole body, or the actor
    bool body, full;    // and a whole body; the take's full avatar
    const char *hint;   // the sentence on what is wrong or what to do; NULL: none; borrowed until the next call
    int64_t frames;     // since it was opened
    int64_t with_actor; // of them with the actor at a known pose of the camera
};
struct viewer_shown viewer_shown(const struct viewer *viewer);

// How many images came and were drawn, and how long each stage took.
void viewer_print_stats(const struct viewer *viewer, FILE *out);

// The options with which to begin where this viewer is: its take, colours, text size and mirroring. The take's name is
// the viewer's.
struct viewer_options viewer_options_again(const struct viewer *viewer);
