#include "app/ui/layout.h"

#include "app/ui/widgets.h"

#include <math.h>

static const double SHUTTER = 78, PANEL_W = 720, SHEET_W = 400, WIDE_SHEET_W = 460, CARD_W = 262, GRAPH_W = 380,
                    GRAPH_H = 140, TALL_SHEET = 600, LEAST_TALL = 330, NARROW = 530, LEAST_FREE = 60;

double layout_sources_height(void) { return 4 * 28 + 24; }

double sheet_buttons_height(int rows) { return TEXT_SIZE_NAME + rows * (TARGET + GAP); }

double sheet_rows_height(int rows) { return rows * SWITCH + sheet_buttons_height(1); }

double sheet_height_of(int rows) { return HEADING + GAP + 2 * SHEET_EDGE + sheet_rows_height(rows); }

static double sheet_height(const struct view_state *s, double width)
{
    const int sides = width < WIDE_SHEET_W ? 2 : 1; // rows of the buttons that choose from where an orbit looks
    switch (s->sheet) {
    case SHEET_THINGS:
    case SHEET_CARD: return TALL_SHEET;
    case SHEET_LAYERS:
        return sheet_height_of(LAYER_ROWS + (s->developer ? DEVELOPER_ROWS : 0)) +
               (s->orbiting ? sheet_buttons_height(sides) : 0);
    case SHEET_SPEED: return HEADING + GAP + 2 * SHEET_EDGE + 2 * SWITCH + GAP;
    default: return 0;
    }
}

enum live_marks layout_live_marks(double width, double height)
{
    static const double BUTTONS_W = 780, ROW_H = 700; // dp; from there on they leave the picture enough
    if (width >= BUTTONS_W)
        return MARKS_AMONG_BUTTONS;
    return height >= ROW_H ? MARKS_IN_A_ROW : MARKS_IN_SHEET;
}

struct ui_box layout_live_sheet(double width, double height)
{
    const double marks = layout_live_marks(width, height) == MARKS_IN_SHEET ? sheet_buttons_height(1) : 0;
    const double w = fmin(SHEET_W, width - 2 * MARGIN),
                 h = fmin(sheet_height_of(LIVE_ROWS) + marks, height - 2 * MARGIN);
    return (struct ui_box){width - MARGIN - w, height - MARGIN - h, w, h};
}

// Above the panel, on a wide screen at the right edge. Where that is too low for it, over the panel: better the sheet
// whole, or scrolling, than both in part.
static struct ui_box sheet_box(struct layout *l, const struct view_state *s, double width, double height)
{
    // A tall one reaches from below the top row, on an upright screen from the middle, to the panel.
    const bool tall = s->sheet == SHEET_THINGS || s->sheet == SHEET_CARD;
    const double below_top = l->wide ? l->top.y + l->top.h : 0.45 * l->panel.y, bottom = l->panel.y - GAP;
    const double w = fmin(l->wide ? SHEET_W : WIDE_SHEET_W, l->panel.w); // what is upright has the actor above it
    const double most = bottom - GAP - (tall ? below_top : l->top.y + l->top.h), wanted = sheet_height(s, w);
    const double right = l->wide ? width - MARGIN : l->panel.x + l->panel.w;
    l->sheet_covers = s->sheet != SHEET_NONE && most < (tall ? LEAST_TALL : wanted);
    if (l->sheet_covers) {
        const double h = fmin(wanted, height - 2 * MARGIN);
        return (struct ui_box){right - w, height - MARGIN - h, w, h};
    }
    const double h = tall ? fmin(TALL_SHEET, most) : wanted;
    return (struct ui_box){right - w, bottom - h, w, h};
}

// In the lower left corner, or above the panel where that extends there; beside a sheet. On a wide screen with a map it
// is over the map.
static struct ui_box frame_graph_box(const struct layout *l, const struct view_state *s, double width, double height)
{
    const bool on_map = l->wide && l->map.w > 0;
    const bool beside = l->wide && !on_map && l->panel.x > GRAPH_W + 2 * MARGIN;
    const double left = on_map ? l->map.x + MARGIN : MARGIN;
    const double bottom = beside ? height - MARGIN : l->panel.y - GAP;
    const double most = s->sheet != SHEET_NONE ? l->sheet.x - GAP - left : width - MARGIN - left;
    return (struct ui_box){left, bottom - GRAPH_H, fmin(GRAPH_W, most), GRAPH_H};
}

// Height of all cards; 0: there are none.
static double cards_height(const struct layout *l, const struct view_state *s, const struct take_view_image *shown)
{
    double h = s->inset && shown->inset ? l->cards.w / shown->inset_aspect + GAP : 0;
    return h + (s->sources && shown->sources ? layout_sources_height() + GAP : 0);
}

// No wider than high, as near to the screen's middle as possible.
static struct ui_box box_between(double left, double right, double top, double bottom, double width)
{
    const double wide = fmax(right - left, LEAST_FREE), high = fmax(bottom - top, LEAST_FREE);
    const double w = fmin(wide, high), middle_x = fmin(fmax(width / 2, left + w / 2), right - w / 2);
    return (struct ui_box){fmax(middle_x - w / 2, 0), fmin(top, fmax(bottom - high, 0)), w, high};
}

// On a wide screen all controls but the panel are beside the actor.
static struct ui_box free_when_wide(const struct layout *l, const struct view_state *s, double cards)
{
    const double bottom = l->panel.y - GAP;
    double left = cards > 0 ? l->cards.x + l->cards.w + GAP : MARGIN;
    left = s->frame_graph && l->frame_graph.y < bottom && l->frame_graph.x < l->picture.w
               ? fmax(left, l->frame_graph.x + l->frame_graph.w + GAP)
               : left;
    return box_between(left, fmin(s->sheet != SHEET_NONE ? l->sheet.x : l->shutter.x, l->shutter.x) - GAP, MARGIN,
                       bottom, l->picture.w);
}

// On an upright screen the actor is between the controls above and below; the cards are above or beside the actor.
static struct ui_box free_when_upright(const struct layout *l, const struct view_state *s, double cards, double width)
{
    const bool beside_sheet = s->sheet != SHEET_NONE && !l->sheet_covers; // else nothing is free
    const double low = fmin(beside_sheet ? l->sheet.y : l->shutter.y, l->shutter.y) - GAP, right = width - MARGIN;
    const double bottom = s->frame_graph ? fmin(low, l->frame_graph.y - GAP) : low;
    const struct ui_box below = box_between(MARGIN, right, l->cards.y + cards, bottom, width);
    const struct ui_box beside = box_between(l->cards.x + l->cards.w + GAP, right, l->cards.y, bottom, width);
    return cards > 0 && beside.w > below.w ? beside : below;
}

struct layout layout_of(double width, double height, const struct view_state *s, const struct take_view_image *shown)
{
    struct layout l = {.wide = width >= height};
    struct ui_box within = inner((struct ui_box){0, 0, width, height}, MARGIN);
    const double panel_w = fmin(within.w, PANEL_W);
    l.narrow = panel_w < NARROW;
    const double rows = l.narrow ? TARGET + GAP : 0, trim_row = TARGET + GAP + (l.narrow ? 28 : 0);
    const double trim = s->trim.offered ? trim_row : 0;
    const double panel_h = s->moving ? 2 * TARGET + GAP + 28 + rows : TARGET + PLAY + 20 + rows + trim;
    l.panel = cut_bottom(&within, panel_h);
    l.panel = (struct ui_box){l.panel.x + (l.panel.w - panel_w) / 2, l.panel.y, panel_w, panel_h};
    l.top = cut_top(&within, TARGET);
    const bool map = s->room.map && s->page == PAGE_WATCH;
    l.picture = (struct ui_box){0, 0, map && l.wide ? width / 2 : width, map && !l.wide ? height / 2 : height};
    const double low = fmin(l.picture.h, l.panel.y);
    l.photo_on_top = low - l.top.y - l.top.h < SHUTTER + 3 * GAP;
    const int buttons = 2 + l.photo_on_top + s->camera.requested + s->room.has_place + (s->room.thing_count > 0);
    if (buttons * (TARGET + GAP) + 2 * GAP > l.top.w) // they go on below
        l.top.h += cut_top(&within, TARGET).h + GAP;
    l.cards = (struct ui_box){within.x, within.y + GAP, fmin(CARD_W, within.w * 0.42), within.h - GAP};
    if (map)
        l.map = l.wide ? (struct ui_box){width / 2, 0, width / 2, height}
                       : (struct ui_box){0, height / 2, width, height / 2};
    const double under_top = l.top.y + l.top.h + GAP;
    l.shutter = (struct ui_box){l.picture.w - MARGIN - SHUTTER,
                                fmax(under_top, fmin(l.wide ? (height - SHUTTER) / 2 : low, low - SHUTTER - 2 * GAP)),
                                SHUTTER, SHUTTER};
    l.sheet = sheet_box(&l, s, width, height);
    l.frame_graph = frame_graph_box(&l, s, width, height);
    const double cards = cards_height(&l, s, shown);
    l.free = l.wide ? free_when_wide(&l, s, cards) : free_when_upright(&l, s, cards, width);
    return l;
}

// ---------------------------------------------------------------- the live page

static const double LIVE_PANEL_W = 1480, ROWS_W = 1300;

// All buttons stand in one row; on a smaller screen what is set once is in a sheet.
bool layout_live_one_row(double width, double height) { return width >= height && width >= ROWS_W + 2 * MARGIN; }

static bool is_tiny(double width) { return width < 480; } // start, tempo and the sheet's button take two rows

struct ui_box layout_live_panel(double width, double height)
{
    const int rows = (layout_live_one_row(width, height) || !is_tiny(width) ? 2 : 3) +
                     (layout_live_marks(width, height) == MARKS_IN_A_ROW);
    const double w = fmin(width - 2 * MARGIN, LIVE_PANEL_W), h = rows * (LIVE_ROW + GAP) + 24;
    return (struct ui_box){(width - w) / 2, height - MARGIN - h, w, h};
}

struct ui_box layout_live_free(double width, double height)
{
    // On a wide screen the top row's buttons are in the corners, beside what is shown.
    const double top = width >= height ? MARGIN : MARGIN + TARGET + GAP,
                 bottom = layout_live_panel(width, height).y - GAP;
    return (struct ui_box){MARGIN, top, width - 2 * MARGIN, fmax(bottom - top, 60)};
}
