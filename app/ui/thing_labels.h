// Where labels stand so that none covers another or a control: each beside the point that it names, as near as there is
// room; the first in the list choose first. A label stays on its side as long as it can, so that it does not jump from
// frame to frame. Pure.
#pragma once
#include "platform/screen/ui.h"

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
