#include "app/ui/layout.h"

#include "app/ui/widgets.h"

#include <math.h>

static const double SHUTTER = 78, PANEL_W = 720, SHEET_W = 400, WIDE_SHEET_W = 460, CARD_W = 262, GRAPH_W = 380,
                    GRAPH_H = 140, TALL_SHEET = 600, MIN_TALL = 330, NARROW = 530, MIN_FREE = 60;

double layout_sources_height(void) { return 4 * 28 + 24; }

// Of buttons under a name, in a sheet.
static double sheet_buttons_height(int rows) { return TEXT_SIZE_NAME + rows * (TARGET + GAP); }

double sheet_rows_height(int rows) { return rows * SHEET_ROW + sheet_buttons_height(1); }

static double sheet_height_of(int rows) { return SHEET_TITLE + GAP + 2 * SHEET_EDGE + sheet_rows_height(rows); }

static double sheet_height(const struct view_state *state, double width)
{
    const int sides = width < WIDE_SHEET_W ? 2 : 1; // rows of the buttons that choose from where an orbit looks
    switch (state->sheet) {
    case SHEET_THINGS:
    case SHEET_CARD: return TALL_SHEET;
    case SHEET_LAYERS:
        return sheet_height_of(LAYER_ROWS + (state->developer ? DEVELOPER_ROWS : 0)) +
               (state->orbiting ? sheet_buttons_height(sides) : 0);
    case SHEET_SPEED: return SHEET_TITLE + GAP + 2 * SHEET_EDGE + 2 * SHEET_ROW + GAP;
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
                 counting = 2 * sheet_buttons_height(1) + sheet_buttons_height(2), // how closely: in two rows
        h = fmin(sheet_height_of(LIVE_ROWS) + marks + counting, height - 2 * MARGIN);
    return (struct ui_box){width - MARGIN - w, height - MARGIN - h, w, h};
}

// Above the panel, on a wide screen at the right edge. Where that is too low for it, over the panel: better the sheet
// whole, or scrolling, than both in part.
static struct ui_box sheet_box(struct layout *layout, const struct view_state *state, double width, double height)
{
    // A tall one reaches from below the top row, on an upright screen from the middle, to the panel.
    const bool tall = state->sheet == SHEET_THINGS || state->sheet == SHEET_CARD;
    const double below_top = layout->wide ? layout->top.y + layout->top.h : 0.45 * layout->panel.y,
                 bottom = layout->panel.y - GAP;
    const double w =
        fmin(layout->wide ? SHEET_W : WIDE_SHEET_W, layout->panel.w); // what is upright has the actor above it
    const double max = bottom - GAP - (tall ? below_top : layout->top.y + layout->top.h),
                 wanted = sheet_height(state, w);
    const double right = layout->wide ? width - MARGIN : layout->panel.x + layout->panel.w;
    layout->sheet_covers = state->sheet != SHEET_NONE && max < (tall ? MIN_TALL : wanted);
    if (layout->sheet_covers) {
        const double h = fmin(wanted, height - 2 * MARGIN);
        return (struct ui_box){right - w, height - MARGIN - h, w, h};
    }
    const double h = tall ? fmin(TALL_SHEET, max) : wanted;
    return (struct ui_box){right - w, bottom - h, w, h};
}

// In the lower left corner, or above the panel where that extends there; beside a sheet. On a wide screen with a map it
// is over the map.
static struct ui_box frame_graph_box(const struct layout *layout, const struct view_state *state, double width,
                                     double height)
{
    const bool on_map = layout->wide && layout->map.w > 0;
    const bool beside = layout->wide && !on_map && layout->panel.x > GRAPH_W + 2 * MARGIN;
    const double left = on_map ? layout->map.x + MARGIN : MARGIN;
    const double bottom = beside ? height - MARGIN : layout->panel.y - GAP;
    const double max = state->sheet != SHEET_NONE ? layout->sheet.x - GAP - left : width - MARGIN - left;
    return (struct ui_box){left, bottom - GRAPH_H, fmin(GRAPH_W, max), GRAPH_H};
}

// Height of all cards; 0: there are none.
static double cards_height(const struct layout *layout, const struct view_state *state,
                           const struct take_view_image *shown)
{
    double h = state->inset && shown->inset ? layout->cards.w / shown->inset_aspect + GAP : 0;
    return h + (state->sources && shown->sources ? layout_sources_height() + GAP : 0);
}

// No wider than high, as near to the screen's middle as possible.
static struct ui_box box_between(double left, double right, double top, double bottom, double width)
{
    const double wide = fmax(right - left, MIN_FREE), high = fmax(bottom - top, MIN_FREE);
    const double w = fmin(wide, high), middle_x = fmin(fmax(width / 2, left + w / 2), right - w / 2);
    return (struct ui_box){fmax(middle_x - w / 2, 0), fmin(top, fmax(bottom - high, 0)), w, high};
}

// On a wide screen all controls but the panel are beside the actor.
static struct ui_box free_when_wide(const struct layout *layout, const struct view_state *state, double cards)
{
    const double bottom = layout->panel.y - GAP;
    double left = cards > 0 ? layout->cards.x + layout->cards.w + GAP : MARGIN;
    left = state->frame_graph && layout->frame_graph.y < bottom && layout->frame_graph.x < layout->picture.w
               ? fmax(left, layout->frame_graph.x + layout->frame_graph.w + GAP)
               : left;
    return box_between(left,
                       fmin(state->sheet != SHEET_NONE ? layout->sheet.x : layout->shutter.x, layout->shutter.x) - GAP,
                       MARGIN, bottom, layout->picture.w);
}

// On an upright screen the actor is between the controls above and below; the cards are above or beside the actor.
static struct ui_box free_when_upright(const struct layout *layout, const struct view_state *state, double cards,
                                       double width)
{
    const bool beside_sheet = state->sheet != SHEET_NONE && !layout->sheet_covers; // else nothing is free
    const double low = fmin(beside_sheet ? layout->sheet.y : layout->shutter.y, layout->shutter.y) - GAP,
                 right = width - MARGIN;
    const double bottom = state->frame_graph ? fmin(low, layout->frame_graph.y - GAP) : low;
    const struct ui_box below = box_between(MARGIN, right, layout->cards.y + cards, bottom, width);
    const struct ui_box beside =
        box_between(layout->cards.x + layout->cards.w + GAP, right, layout->cards.y, bottom, width);
    return cards > 0 && beside.w > below.w ? beside : below;
}

struct layout layout_of(double width, double height, const struct view_state *state,
                        const struct take_view_image *shown)
{
    struct layout l = {.wide = width >= height};
    struct ui_box within = inner((struct ui_box){0, 0, width, height}, MARGIN);
    const double panel_w = fmin(within.w, PANEL_W);
    l.narrow = panel_w < NARROW;
    const double rows = l.narrow ? TARGET + GAP : 0, trim_row = TARGET + GAP + (l.narrow ? 28 : 0);
    const double trim = state->trim.offered ? trim_row : 0;
    const double panel_h = state->moving ? 2 * TARGET + GAP + 28 + rows : TARGET + PLAY + 20 + rows + trim;
    l.panel = cut_bottom(&within, panel_h);
    l.panel = (struct ui_box){l.panel.x + (l.panel.w - panel_w) / 2, l.panel.y, panel_w, panel_h};
    l.top = cut_top(&within, TARGET);
    const bool map = state->room.map && state->page == PAGE_WATCH;
    l.picture = (struct ui_box){0, 0, map && l.wide ? width / 2 : width, map && !l.wide ? height / 2 : height};
    const double low = fmin(l.picture.h, l.panel.y);
    l.photo_on_top = low - l.top.y - l.top.h < SHUTTER + 3 * GAP;
    const int buttons =
        2 + l.photo_on_top + state->camera.requested + state->room.has_place + (state->room.thing_count > 0);
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
    l.sheet = sheet_box(&l, state, width, height);
    l.frame_graph = frame_graph_box(&l, state, width, height);
    const double cards = cards_height(&l, state, shown);
    l.free = l.wide ? free_when_wide(&l, state, cards) : free_when_upright(&l, state, cards, width);
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
