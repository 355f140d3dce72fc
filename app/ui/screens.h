// The app's screens, from what `show` says to what is seen, and from what is touched
// back to `show`. Each draws the whole of it, between ui_begin and ui_end.
#pragma once
#include "app/state/frame_times.h"
#include "app/ui/layout.h"
#include "app/ui/view_compositor.h"

// What a screen remembers of itself; zeroed at first.
struct screens {
    double scroll, grabbed_y, scrolled_from; // the page of takes, dp
    bool scrolling;
    bool image_held; // fingers are on the picture, not on a control
};

struct take_card {
    const char *name;
    int64_t length_ns;
    bool complete, watchable;
    const struct gpu_texture *image; // NULL: none
    double image_aspect;             // width over height
};
struct takes_page {
    const char *file;
    const struct take_card *cards;
    int count;
};
void screen_takes(const struct brush *b, struct screens *screens, struct view_state *show,
                  const struct takes_page *page, int64_t now_ns);

struct watch_page {
    const char *file, *take;
    const struct take_view_image *image;
    const struct frame_times *times;
    double budget_ms; // of a picture, at the display's rate
};
void screen_watch(const struct brush *b, struct screens *screens, struct view_state *show,
                  const struct watch_page *page, int64_t now_ns);

void screen_trouble(const struct brush *b, struct view_state *show, int64_t now_ns);

// The notice or the hint, over whatever screen there is.
void screen_message(const struct brush *b, const struct view_state *show);

// How long the last pictures took, and what of it was spent on what.
void frame_graph_draw(const struct brush *b, const struct frame_times *times, double budget_ms, struct ui_box box);

// What is laid over the page of watching.
void panels_draw(const struct brush *b, struct view_state *show, struct ui_box box, int64_t now_ns);
