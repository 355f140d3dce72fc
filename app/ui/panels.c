// The sheets of the page for watching: layers and speed.
#include "app/ui/screens.h"

#include <math.h>
#include <stdio.h>

// Chooses the permitted error of the drawn actor, pixels: a larger one draws faster.
static void error_row(const struct brush *b, struct view_state *s, struct ui_box row)
{
    static const double errors_px[] = {0.5, 1, 2, 4};
    char text[16], name[24];
    for (int i = (int)COUNT_OF(errors_px) - 1; i >= 0; i--) {
        snprintf(text, sizeof text, "%g", errors_px[i]);
        snprintf(name, sizeof name, "error-%d", i);
        bool on = fabs(s->error_px - errors_px[i]) < 0.01;
        if (text_button(b, name, text, on ? BUTTON_MAIN : BUTTON_RAISED, cut_right(&row, TARGET)))
            view_state_set_error(s, errors_px[i]);
    }
    label(b, FACE_BODY, (struct ui_box){row.x + 8, row.y + (row.h - 24) / 2, row.w - 8, 24}, b->theme->text,
          "Error, px");
}

static void layers_sheet(const struct brush *b, struct view_state *s, struct ui_box box, int64_t now_ns)
{
    const struct {
        const char *name, *text;
        enum icon icon;
        bool on;
        enum view_action action;
    } rows[] = {
        {"sheet-skeleton", "Skeleton", ICON_BONES, s->skeleton, DO_SKELETON},
        {"sheet-sources", "Where pixels come from", ICON_DROPS, s->sources, DO_SOURCES},
        {"sheet-inset", "The sensor's image", ICON_INSET, s->inset, DO_INSET},
        {"sheet-filmed", "The filmed room", ICON_ROOM, s->room.filmed, DO_FILMED},
        {"sheet-frame-graph", "Frame times", ICON_BARS, s->frame_graph, DO_FRAME_GRAPH},
        {"sheet-mirror", "Mirrored", ICON_MIRROR, s->placement.mirrored, DO_MIRROR},
        {"sheet-theme", "Dark", ICON_MOON, s->dark, DO_THEME},
    };
    const int count = (int)COUNT_OF(rows);
    assert(count + 1 == LAYER_ROWS);
    panel(b, box, false);
    struct ui_box in = inner(box, 12), head = {in.x + 8, in.y, in.w, HEADING};
    label(b, FACE_HEAD, head, b->theme->text, "Show");
    for (int i = 0; i < count; i++)
        if (switch_row(b, rows[i].name, rows[i].icon, rows[i].text, rows[i].on,
                       (struct ui_box){in.x, in.y + HEADING + i * SWITCH, in.w, SWITCH}))
            view_state_do(s, rows[i].action, now_ns);
    error_row(b, s, (struct ui_box){in.x, in.y + HEADING + count * SWITCH, in.w, SWITCH});
    (void)ui_area(b->ui, "sheet", box); // touches do not pass through
}

static void speed_sheet(const struct brush *b, struct view_state *s, struct ui_box box, int64_t now_ns)
{
    panel(b, box, false);
    struct ui_box in = inner(box, 12), head = {in.x + 8, in.y, in.w, HEADING};
    label(b, FACE_HEAD, head, b->theme->text, "Speed");
    double w = (in.w - 3 * GAP) / 4;
    for (int i = 0; i < VIEW_SPEEDS; i++) {
        char text[16], name[24];
        snprintf(text, sizeof text, "%g×", view_speeds[i]);
        snprintf(name, sizeof name, "speed-%d", i);
        bool on = fabs(s->playback.speed - view_speeds[i]) < 0.01;
        struct ui_box key = {in.x + (i % 4) * (w + GAP), in.y + HEADING + (i / 4) * (SWITCH + GAP), w, SWITCH};
        if (text_button(b, name, text, on ? BUTTON_MAIN : BUTTON_RAISED, key))
            view_state_set_speed(s, view_speeds[i], now_ns);
    }
    (void)ui_area(b->ui, "sheet", box);
}

void panels_draw(const struct brush *b, struct view_state *s, struct ui_box box, int64_t now_ns)
{
    if (s->sheet == SHEET_LAYERS)
        layers_sheet(b, s, box, now_ns);
    else if (s->sheet == SHEET_SPEED)
        speed_sheet(b, s, box, now_ns);
}
