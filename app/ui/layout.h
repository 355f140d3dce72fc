// Where the page of watching has its controls, and what of the picture they leave free. All in dp. Pure.
#pragma once
#include "app/view/take_view.h"

static const double HEADING = 44, SWITCH = 58; // of a sheet: its name, a row
enum { LAYER_ROWS = 7 };                       // of the layers' sheet

struct layout {
    bool wide;
    struct ui_box top;         // the row of round buttons
    struct ui_box panel;       // time and buttons, or moving
    struct ui_box shutter;     // what photographs; hidden behind a sheet, and while he is moved
    struct ui_box sheet;       // as large as the one that is open
    struct ui_box cards;       // the sensor's picture, what colours mean: from its top as far down as they need
    struct ui_box frame_graph; // time of each picture
    struct ui_box free;        // covered by nothing of that; an orbit has the actor in its middle
};

// Of a screen of that size. shown: its inset and sources are what the cards show. Whether the controls are hidden just
// now makes no difference.
struct layout layout_of(double width, double height, const struct view_state *show,
                        const struct take_view_image *shown);

// How high the card is that says what colours mean.
double layout_sources_height(void);
