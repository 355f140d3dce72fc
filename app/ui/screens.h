// The app's screens. Each draws the view state's page, between ui_begin and ui_end, and passes touched controls back
// to the view state.
#pragma once
#include "app/state/frame_times.h"
#include "app/ui/layout.h"
#include "app/ui/room_page.h"
#include "app/ui/view_compositor.h"

// State of the screens between frames; zeroed at first.
struct screens {
    double scroll, grabbed_y, scrolled_from; // page of takes, dp
    bool scrolling;
    int followed; // 1 + the selected take that was brought into sight; another one is when it is selected
    int first_in_sight, end_in_sight; // cards that were drawn last
    bool image_held;                  // fingers are on the image, not on a control
    bool map_held;                    // or on the map
    struct room_ui room;
    struct scroll sheet, findings;
    int summary;       // the attempt whose findings these are
    int finding;       // 1 more than the number of the one that is chosen; 0: none
    bool all_findings; // listed, not only the worst
    int cue;           // 1 more than the part that is spoken of while it is done; 0: all is right
    int64_t cue_ns;    // since when
};

struct take_card {
    const char *name;
    bool loaded; // what follows is known
    int64_t length_ns;
    bool complete;
    const char *trouble; // why it cannot be watched; NULL: it can
    bool judged, good;   // whether there is a verdict, and what it says; else verdict is ""
    bool unjudgeable;
    char verdict[160];               // its headline and first sentence
    const struct gpu_texture *image; // NULL: none
    double image_aspect;             // width over height
};
struct takes_page {
    const char *file;
    const struct take_card *cards;
    int count;
};
// notches: of a mouse's wheel since the page was drawn last.
void screen_takes_wheel(struct screens *screens, double notches);
void screen_takes(const struct brush *brush, struct screens *screens, struct view_state *state,
                  const struct takes_page *page, int64_t now_ns);

struct watch_page {
    const char *file, *take;
    const struct take_view_image *image;
    const struct frame_times *times;
    double budget_ms; // for one frame, at the display's rate
    const struct room_page *room;
};
void screen_watch(const struct brush *brush, struct screens *screens, struct view_state *state,
                  const struct watch_page *page, int64_t now_ns);

// While the recording `file` is being opened.
void screen_opening(const struct brush *brush, const char *file);

void screen_trouble(const struct brush *brush, struct view_state *state, int64_t now_ns);

double screen_summary_bottom(double width, double height); // of all but the summary's buttons, dp

// The notice, the hint or the progress bar, over any screen.
void screen_message(const struct brush *brush, const struct view_state *state);
struct ui_box screen_message_box(const struct brush *brush, const struct view_state *state); // width 0: nothing is said

// The open sheet with settings.
void panels_draw(const struct brush *brush, struct screens *screens, struct view_state *state, struct ui_box box,
                 int64_t now_ns);

// The buttons by which the part that is done begins and ends where the actor is; one that takes it back where nothing
// moves. Returns how many.
int live_mark_controls(const struct live_state *state, struct control out[2]);

// A mouse's wheel over what scrolls on the pages for watching and for doing. False: nothing does there.
bool screens_wheel(struct screens *screens, const struct view_state *state, struct ui_point at, double notches);
