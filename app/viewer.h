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

struct tablet_options {
    const char *file;
    const char *take;   // NULL: the only one, or the user chooses
    const char *camera; // URI; NULL: none
    const char *photos; // folder; NULL: the user's pictures
    bool light;
    bool fixed_fineness; // never less than every pixel
    double refresh_hz;
    void (*wake)(void *self); // there is something new; from other threads
    void *wake_self;
};

struct tablet {
    struct tablet_options options;
    struct gpu *gpu;
    struct ui *ui;
    struct show show;
    struct screens screens;
    struct hands hands;
    struct recording *recording;
    struct library library;
    struct place place;
    bool has_place;
    struct stage *stage;
    struct eyes *eyes;
    struct viewfinder *viewfinder; // of the eyes
    int64_t found;                 // number of the sight that is in it
    const struct sight *sight;     // the newest at the last tablet_update; what is drawn until the next
    struct stage_look look;        // what `picture` was drawn for
    bool looked;
    struct pose last_placed;
    struct ui_box free; // dp: where an orbit has the actor; it goes slowly to what the controls leave
    int64_t freed_ns;   // when it last went
    struct stage_picture picture;
    struct governor governor;
    struct frame_times times;
    int64_t placed; // pictures drawn with the actor in his place
    struct eyes_state eyes_now;
    char trouble[512], ailing[512];
    int64_t checked_ns, padded_ns, timed_sight;
    bool resting;
    int64_t rested_ns;                         // since when
    int64_t drawing_ns, drawn_ns, controls_ns; // when the last frame's stages began and ended
};

// A file that cannot be read is told of on the screen, not here. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status tablet_open(struct tablet *t, struct gpu *gpu, const struct tablet_options *options);
void tablet_close(struct tablet *t); // zeroed is fine

// Nobody sees the screen, or somebody does again: meanwhile the camera rests, and the take's time stands still.
void tablet_rest(struct tablet *t, bool rest, int64_t now_ns);

// Hears the camera, opens what was chosen, lets time pass. Returns when it wants
// to be called again at the latest; t->show.changed says whether to draw.
int64_t tablet_update(struct tablet *t, int64_t now_ns);

struct tablet_glass {
    struct gpu_target *target; // NULL: the window
    int width, height;         // pixels, upright
    int quarter_turns;
    double px_per_dp;
};
// ERR_DEVICE: the graphics are gone; close everything and open it again.
MUST_CHECK enum status tablet_draw(struct tablet *t, const struct tablet_glass *glass, int64_t now_ns);

// What was drawn has been handed to the display: the picture's times are complete.
void tablet_shown(struct tablet *t, int64_t now_ns);

// Pixels a dp, for a screen of that dpi.
double tablet_px_per_dp(double dpi);
