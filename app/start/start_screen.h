// The start screen: what is chosen on it, and how it is drawn. Pure but for drawing, between ui_begin and ui_end.
#pragma once
#include "app/start/shelf.h"
#include "app/ui/widgets.h"

// What a recording is chosen for.
enum start_mode { START_WATCH, START_BESIDE, START_COMPARE, START_MODES };

enum start_wish {
    START_WISHES_NOTHING,
    START_WISHES_RECORDING, // `mode` says what for: `chosen`; to compare, `reference` too
    START_WISHES_FILM,
    START_WISHES_SAMPLE,
    START_WISHES_FORGET, // `chosen` is not to be listed any more
    START_WISHES_LEAVE,
};

struct start_state {
    enum start_mode mode;
    enum start_wish wish;  // until the owner takes it
    int chosen, reference; // entries of the shelf; reference -1: not chosen yet
    bool dark, changed;
    double text_size;
    struct scroll scroll;
    int first_in_sight, end_in_sight; // cards that were drawn last
    char notice[300];                 // a sentence, until something else is done
};

struct start_state start_state_new(bool dark, double text_size);

void start_choose_mode(struct start_state *state, enum start_mode mode);
// A recording was touched: chosen, or of two to be compared the first.
void start_choose_recording(struct start_state *state, int number);
void start_wish(struct start_state *state, enum start_wish wish);
// Back: of two to be compared the first is chosen anew; then to watching; then leave.
void start_back(struct start_state *state);

struct start_page {
    const struct shelf *shelf;
    const char *film_folder; // NULL: none
    bool has_sample;
};
void start_screen_draw(const struct brush *brush, struct start_state *state, const struct start_page *page);
