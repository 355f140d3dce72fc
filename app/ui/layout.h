// The layout of the page for watching: its controls, and the part of the screen that they leave free. All in dp. Pure.
#pragma once
#include "app/view/take_view.h"

static const double SHEET_TITLE = 58, SHEET_ROW = 58; // heights in a sheet: its title, a row
static const double SHEET_EDGE = 12, TEXT_SIZE_NAME = 34;
static const double PLAY = 74;                              // side of the play button
enum { LAYER_ROWS = 4, DEVELOPER_ROWS = 3, LIVE_ROWS = 7 }; // of the sheets

struct layout {
    bool wide;
    struct ui_box picture;     // the camera's image or the orbit
    struct ui_box map;         // beside or below it; width 0: none
    struct ui_box top;         // the row of round buttons; two rows where one is too short
    bool photo_on_top;         // the screenshot button is one of them, since it has no room of its own
    struct ui_box panel;       // timeline and buttons, or the controls for moving the actor
    bool narrow;               // its buttons stand in two rows
    struct ui_box shutter;     // the screenshot button; hidden by a sheet, and while the actor is moved
    struct ui_box sheet;       // of the open sheet's size; as high as the screen where it would be cut else
    bool sheet_covers;         // it lies over the panel, too, which is not drawn then
    struct ui_box cards;       // the column of the inset and the colour legend, which start at its top
    struct ui_box frame_graph; // times of the last frames
    struct ui_box free;        // covered by none of these; an orbit shows the actor in its middle
};

// For a screen of that size. shown: only its inset and sources count, which the cards show. Does not depend on whether
// the controls are hidden at the moment.
struct layout layout_of(double width, double height, const struct view_state *state,
                        const struct take_view_image *shown);

// Height of that many rows and the text size; of a sheet with them.
double sheet_rows_height(int rows);

// Where the live page's sheet is, and where "From here" and "To here" are: with the other buttons, in a row of their
// own on an upright screen, else in the sheet.
enum live_marks { MARKS_AMONG_BUTTONS, MARKS_IN_A_ROW, MARKS_IN_SHEET };
enum live_marks layout_live_marks(double width, double height);
struct ui_box layout_live_sheet(double width, double height);

// The live page's panel, whose rows are LIVE_ROW high; whether all buttons stand in one of them, else what is set once
// is in the sheet; and the part of the screen in which LIVE_BESIDE shows both figures, and LIVE_MIRROR the picture.
static const double LIVE_ROW = 58;
struct ui_box layout_live_panel(double width, double height);
bool layout_live_one_row(double width, double height);
struct ui_box layout_live_free(double width, double height);

// Height of the colour legend.
double layout_sources_height(void);
