// What of the room the page for watching draws beside the actor: labels at the things, an arrow to the one that was
// looked for, the sheets to find a thing and to read what is known of it, and the map.
#pragma once
#include "app/state/view_state.h"
#include "app/ui/figure_draw.h"
#include "app/ui/layout.h"
#include "platform/screen/ui.h"
#include "recording/place.h"
#include "recording/recorded_things.h"

// ---------------------------------------------------------------- label layout

// Where labels stand so that none covers another or a control: each beside the point that it names, as near as there is
// room; the first in the list choose first. A label stays on its side as long as it can, so that it does not jump from
// frame to frame. Pure.

enum { LABEL_NO_SIDE = -1 };

struct placed_label {
    struct ui_point at; // what it names, dp
    double w, h;        // dp
    int side;           // before: that of the last frame, or LABEL_NO_SIDE; after: its own, or none: there is no room
    struct ui_box box;  // after, where it has a side; within `bounds`
};

// taken: boxes that no label may cover. Labels whose point lies outside of `bounds` get no side.
void label_layout(struct placed_label *labels, int count, struct ui_box bounds, const struct ui_box *taken,
                  int taken_count);

// Where an arrow to a point points that may be out of sight. (x, y): the point on the screen's plane relative to the
// view's axis, dp, right and down; ahead: it is before the viewpoint, not behind. bounds: where the arrow may be.
struct edge_arrow {
    bool inside;        // the point itself is in bounds: the arrow is above it
    struct ui_point at; // of the arrow's tip
    double dx, dy;      // unit vector that it points along
};
struct edge_arrow edge_arrow_of(struct ui_point axis, double x, double y, bool ahead, struct ui_box bounds);

// ---------------------------------------------------------------- room page

enum { ROOM_LABELS_MAX = 64 }; // things with a label; all are in the sheet

enum answer { ANSWER_KEPT, ANSWER_ASKING, ANSWER_NONE }; // of the knowledge base; NONE: it gave none

struct room_thing {
    const char *name;
    struct pose world_from_thing;
    double width_m, height_m, sigma_m; // sigma: the largest of its position
    struct vec3 ellipsoid[3];          // half axes of 95 %, world axes
    bool gone;
    bool hidden; // in the picture, by the actor or by the room
    enum answer answer;
};

struct thing_card {
    const char *name, *description, *weight, *material, *instructions, *note; // "" where nothing is known
    const char *source; // where this is from, or why nothing newer came
    bool source_warns;
    const struct gpu_texture *picture; // NULL: none
    double picture_aspect;             // width over height
    const struct gpu_texture *body;    // the model or box as it turns, square
    bool is_model;
};

struct room_page {
    const struct room_thing *things;
    int count;
    bool apart; // the picture's actor has no known position in the place: nothing of the place is marked there
    const struct thing_card *card; // of view_state.room.card; NULL: none

    // The map, of view_state.room.map.
    const struct gpu_texture *map; // the place's surface and the things' bodies; NULL: being made, or there is none
    struct figure_view map_view;   // cover: of the map's box
    bool map_is_coming;
    const struct place_tag *tags;
    int tag_count;
    const struct skeleton *actor; // world axes; NULL: none
    const struct vec3 *path;      // where the tablet was, oldest first, world axes
    int path_count;
    const struct recorded_drive *drive; // of a robot; NULL: none
    bool viewer_known;
    struct pose world_from_viewer; // of the tablet, else of the orbit
    struct lens viewer_lens;
};

struct room_ui {                             // between frames; room_ui_start
    int sides[2][ROOM_LABELS_MAX];           // of labels: in the picture, in the map
    struct ui_box boxes[2][ROOM_LABELS_MAX]; // where they were drawn, dp; valid with a side
    struct scroll list, text;                // of the sheets
    double text_h;                           // dp, of the card's text when it was drawn last
};
void room_ui_start(struct room_ui *ui);

// The picture over which labels stand.
struct label_view {
    const struct figure_view *view;
    int number;                 // 0 the picture, 1 the map
    struct ui_box bounds;       // within which they stand
    const struct ui_box *taken; // that they leave free
    int taken_count;
};
// Labels, and the arrow to the thing that is wanted. Returns the thing whose label was touched, or ROOM_NOTHING.
int thing_labels_draw(const struct brush *brush, struct room_ui *ui, const struct room_state *state,
                      const struct room_page *page, const struct label_view *where);

// The open sheet: SHEET_THINGS or SHEET_CARD.
void thing_sheet_draw(const struct brush *brush, struct room_ui *ui, struct view_state *state,
                      const struct room_page *page, struct ui_box box, struct vec3 eye, int64_t now_ns);

// What is known of the place, over an image of the page's map_view; map_draw draws it over the map.
void map_overlay_draw(const struct brush *brush, const struct room_page *page);
void map_draw(const struct brush *brush, const struct room_page *page, struct ui_box box);
