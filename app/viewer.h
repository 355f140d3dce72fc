// The app with all its parts open but for the screen it is seen on, so that it runs
// the same on a tablet's glass and on a picture in a test.
//
// One thread; the camera and the locating have their own behind `eyes`.
#pragma once
#include "app/camera/camera_feed.h"
#include "app/state/resolution_governor.h"
#include "app/ui/input_map.h"
#include "app/ui/take_list.h"
#include "app/view/take_view.h"
#include "app/camera/camera_texture.h"

struct viewer_options {
    const char *file;
    const char *take;   // NULL: the only one, or the user chooses
    const char *camera; // URI; NULL: none
    const char *photos; // folder; NULL: the user's pictures
    bool light;
    bool fixed_resolution; // never less than every pixel
    double refresh_hz;
    void (*wake)(void *self); // there is something new; from other threads
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
    struct place place;
    bool has_place;
    struct take_view *take_view;
    struct camera_feed *feed;
    struct camera_texture *camera_texture; // of the eyes
    int64_t uploaded_number;               // number of the sight that is in it
    const struct camera_frame *frame;      // the newest at the last viewer_update; what is drawn until the next
    struct take_view_request request;      // what `picture` was drawn for
    bool has_image;
    struct pose last_placed;
    struct ui_box free; // dp: where an orbit has the actor; it goes slowly to what the controls leave
    int64_t freed_ns;   // when it last went
    struct take_view_image image;
    struct resolution_governor governor;
    struct frame_times times;
    int64_t placed; // pictures drawn with the actor in his place
    struct camera_feed_state feed_state;
    char trouble[512], problem[512];
    int64_t checked_ns, pad_ns, timed_frame;
    bool suspended;
    int64_t suspended_ns;                      // since when
    int64_t drawing_ns, drawn_ns, controls_ns; // when the last frame's stages began and ended
};

// A file that cannot be read is told of on the screen, not here. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_open(struct viewer *t, struct gpu *gpu, const struct viewer_options *options);
void viewer_close(struct viewer *t); // zeroed is fine

// Nobody sees the screen, or somebody does again: meanwhile the camera rests, and the take's time stands still.
void viewer_suspend(struct viewer *t, bool suspend, int64_t now_ns);

// Hears the camera, opens what was chosen, lets time pass. Returns when it wants
// to be called again at the latest; t->state.changed says whether to draw.
int64_t viewer_update(struct viewer *t, int64_t now_ns);

struct viewer_surface {
    struct gpu_target *target; // NULL: the window
    int width, height;         // pixels, upright
    int quarter_turns;
    double px_per_dp;
};
// ERR_DEVICE: the graphics are gone; close everything and open it again.
MUST_CHECK enum status viewer_draw(struct viewer *t, const struct viewer_surface *glass, int64_t now_ns);

// What was drawn has been handed to the display: the picture's times are complete.
void viewer_presented(struct viewer *t, int64_t now_ns);

// Pixels a dp, for a screen of that dpi.
double viewer_px_per_dp(double dpi);
