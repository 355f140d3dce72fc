// The studio: all of it but its window, so that it runs the same on a screen and, in tests, into memory. One thread,
// the GPU's; the session has threads of its own.
#pragma once
#include "app/studio/studio_screen.h"
#include "app/ui/input_map.h"
#include "app/viewer/settings.h"
#include "app/viewer/viewer.h"
#include "platform/screen/sound.h"

enum { STUDIO_DEVICES = 16 };

struct studio_options {
    const char *file;
    const char *sensor;           // URI; NULL: the user chooses
    const char *tags;             // tags.json for sweeps of the room; NULL: the one beside the file, if there is one
    enum verdict_purpose purpose; // what takes are for, until the user chooses another one
    double text_size;             // as the viewer's; 0: 1
    bool light;
    const char *settings; // as the viewer's; NULL: what is chosen is not kept
    bool body_points;
    double refresh_hz;
    void (*wake)(void *self); // called on other threads; may be NULL
    void *wake_self;
};

struct studio {
    struct studio_options options;
    struct gpu *gpu;
    struct ui *ui; // NULL while the viewer plays a take back: one ui in a process
    struct studio_state state;
    struct input_map input;
    struct view_state ignored; // input_map's, of which only the pointer is used
    struct source_device devices[STUDIO_DEVICES];
    int device_count;
    struct studio_session *session;
    struct studio_snapshot shown;
    struct gpu_texture *color, *depth, *plan;
    uint8_t *depth_rgb, *plan_rgb;
    size_t depth_rgb_pixels;
    struct scroll scroll;                                   // of the page that is shown
    enum studio_page scrolled;                              // that page
    struct ui_box plan_part;                                // of the plan that is shown, shares of its width
    int gestures, takes_ready, rooms_ready, rooms_not_kept; // of the snapshot, handled
    bool no_points_told;                                    // why no body points are looked for
    struct settings_keeper settings;                        // colours and text size; the others are the viewer's
    struct viewer *viewer;                                  // page PLAYBACK; NULL: it could not be opened
    bool playing;
    struct sound *sound; // NULL: silent
};

// ERR_DEVICE, ERR_MEMORY: call studio_close. A sensor that does not open is shown, no error.
MUST_CHECK enum status studio_open(struct studio *studio, struct gpu *gpu, const struct studio_options *options);
void studio_close(struct studio *studio); // ends a take that is being made in good order; zeroed is fine

// An event of the window. True: draw a frame before passing the next one.
bool studio_event(struct studio *studio, const struct window_event *event, double px_per_dp, int64_t now_ns);

// Takes the session's news, runs commands. Returns when to call it again at the latest; state.changed, or the viewer's,
// says whether to draw.
int64_t studio_update(struct studio *studio, int64_t now_ns);
bool studio_changed(const struct studio *studio);
bool studio_types(const struct studio *studio); // whether text is typed

// ERR_DEVICE: the GPU context is lost.
MUST_CHECK enum status studio_draw(struct studio *studio, const struct viewer_surface *surface, int64_t now_ns);

// Whether the program may end: asked to, and no take is being written.
bool studio_finished(const struct studio *studio);
