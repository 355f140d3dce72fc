// The start screen as a program within its window: lists recordings, takes events, draws, and says what was chosen. The
// same on a screen and, in tests, into memory. One thread, the GPU's.
#pragma once
#include "app/start/start_screen.h"
#include "app/ui/input_map.h"
#include "app/viewer/settings.h"
#include "app/viewer/viewer.h"

struct start_options {
    const char *settings; // as the viewer's; NULL: what is chosen is not kept
    const char *recents;  // file of the recordings that were opened; NULL: none
    const char *sample;   // a recording that was installed with the program; NULL: none
    const char *notice;   // what happened before, in a sentence; NULL: nothing
    bool light;
    double text_size; // as the viewer's; 0: as it was
};

struct start {
    struct start_options options;
    struct gpu *gpu;
    struct ui *ui;
    struct start_state state;
    struct input_map input;
    struct view_state ignored; // input_map's, of which only the pointer is used
    struct shelf shelf;
    struct settings_keeper settings;
    char film_folder[RECENT_PATH_BYTES]; // "": the user has none
    char dropped[RECENT_PATH_BYTES];     // a file that was dragged here; "": none
};

// ERR_DEVICE, ERR_MEMORY: call start_close.
MUST_CHECK enum status start_open(struct start *start, struct gpu *gpu, const struct start_options *options);
void start_close(struct start *start); // zeroed is fine

// An event of the window. True: draw a frame before passing the next one.
bool start_event(struct start *start, const struct window_event *event, double px_per_dp, int64_t now_ns);

// A file was dragged here: as if it were listed and touched.
void start_drop(struct start *start, const char *path);

// Completes cards; returns whether there are more to complete. state.changed says whether to draw. ERR_DEVICE,
// ERR_MEMORY: *more is false.
MUST_CHECK enum status start_update(struct start *start, bool *more);

// ERR_DEVICE: the GPU context is lost.
MUST_CHECK enum status start_draw(struct start *start, const struct viewer_surface *surface, int64_t now_ns);

// What the user chose, once. The paths are the caller's.
struct start_choice {
    enum start_wish wish; // START_WISHES_NOTHING: nothing yet; never START_WISHES_FORGET and _SAMPLE
    enum start_mode mode;
    char file[RECENT_PATH_BYTES]; // to be watched, done beside, filmed into; of two that are compared the reference's
    char with[RECENT_PATH_BYTES]; // the attempt's
};
void start_take_choice(struct start *start, struct start_choice *out);
