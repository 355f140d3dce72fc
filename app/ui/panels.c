// The sheets with settings: what is shown, speed, text size, and on the live page how the exercise is done.
#include "app/ui/screens.h"

#include <math.h>
#include <stdio.h>

// ---------------------------------------------------------------- frame graph

// The frame graph: a bar per frame, coloured by stage, against the time budget.

static const uint32_t colors[FRAME_STAGES] = {0xa78bfaff, 0x64748bff, 0x2dd4bfff, 0x60a5faff, 0xf472b6ff};

static void draw_bars(const struct brush *brush, const struct frame_times *times, double budget_ms, struct ui_box box)
{
    const double full_ms = fmax(2 * budget_ms, 1.5 * frame_times_median(times)), width = box.w / FRAMES_KEPT;
    for (int back = 0; back < FRAMES_KEPT; back++) {
        const float *ms = frame_times_at(times, back);
        if (!ms)
            break;
        double x = box.x + box.w - (back + 1) * width, y = box.y + box.h;
        for (int stage = 0; stage < FRAME_STAGES && y > box.y; stage++) {
            double h = fmin((double)ms[stage] / full_ms * box.h, y - box.y);
            ui_fill(brush->ui, (struct ui_box){x, y - h, width * 0.8, h}, 0, colors[stage]);
            y -= h;
        }
    }
    double line = box.y + box.h * (1 - budget_ms / full_ms);
    ui_line(brush->ui, (struct ui_point){box.x, line}, (struct ui_point){box.x + box.w, line}, 1, brush->theme->quiet);
}

void frame_graph_draw(const struct brush *brush, const struct frame_times *times, double budget_ms, struct ui_box box)
{
    const struct theme *t = brush->theme;
    char text[64];
    panel(brush, box, true);
    struct ui_box in = inner(box, 12), top = cut_top(&in, 20), names = cut_bottom(&in, 18);
    snprintf(text, sizeof text, "%.0f ms per frame; the display shows one every %.0f", frame_times_median(times),
             budget_ms);
    label(brush, FACE_SMALL, top, t->text, text);
    draw_bars(brush, times, budget_ms, in);
    for (int i = 0; i < FRAME_STAGES; i++) {
        ui_disc(brush->ui, (struct ui_point){names.x + 4, names.y + 9}, 4, colors[i]);
        names.x += 14;
        double width = ui_text_width(brush->ui, FACE_SMALL, frame_stage_names[i]);
        label(brush, FACE_SMALL, (struct ui_box){names.x, names.y, width + 1, names.h}, t->quiet, frame_stage_names[i]);
        names.x += width + 10;
    }
}

// ---------------------------------------------------------------- panels

struct sheet_row {
    const char *name, *text;
    enum icon icon;
    bool on;
    enum view_action action;
};

// Text size under its name; returns its height.
static double text_size_row(const struct brush *brush, struct view_state *state, struct ui_box at, int64_t now_ns)
{
    char texts[VIEW_TEXT_SIZES][16];
    struct control sizes[VIEW_TEXT_SIZES];
    static const char *const names[VIEW_TEXT_SIZES] = {"text-100", "text-125", "text-150"};
    for (int i = 0; i < VIEW_TEXT_SIZES; i++) {
        const bool on = fabs(state->text_size - view_text_sizes[i]) < 0.01;
        snprintf(texts[i], sizeof texts[i], "%.0f %%", 100 * view_text_sizes[i]);
        sizes[i] = (struct control){names[i], texts[i], on ? BUTTON_MAIN : BUTTON_RAISED, i};
    }
    label(brush, FACE_BODY, (struct ui_box){at.x + 8, at.y, at.w - 16, TEXT_SIZE_NAME}, brush->theme->text,
          "Size of the text");
    const struct ui_box row = {at.x + 4, at.y + TEXT_SIZE_NAME, at.w - 12, TARGET};
    const int chosen = controls_draw(brush, sizes, VIEW_TEXT_SIZES, row);
    if (chosen >= 0)
        view_state_set_text_size(state, view_text_sizes[chosen], now_ns);
    return TEXT_SIZE_NAME + controls_height(brush, sizes, VIEW_TEXT_SIZES, row.w);
}

static bool has_marks(const struct brush *brush, const struct view_state *state)
{
    return state->sheet == SHEET_LIVE && layout_live_marks(ui_width(brush->ui), ui_height(brush->ui)) == MARKS_IN_SHEET;
}

int live_mark_controls(const struct live_state *state, struct control out[2])
{
    const bool marked = state->marked_from_ns > 0 || state->marked_to_ns < state->length_ns;
    const bool takes_back = state->phase == LIVE_READY && marked;
    out[0] = (struct control){"live-mark-from", takes_back ? "All of it" : "From here", BUTTON_RAISED, DO_MARK_FROM};
    out[1] = (struct control){"live-mark-to", "To here", BUTTON_RAISED, DO_MARK_TO};
    return takes_back ? 1 : 2;
}

// Buttons under their name.
struct button_group {
    const char *name;
    struct control controls[5];
    int count;
};

static struct button_group marks_group(const struct view_state *state)
{
    struct button_group g = {.name = "The part that is done"};
    g.count = live_mark_controls(&state->live, g.controls);
    return g;
}

static struct button_group sides_group(void)
{
    return (struct button_group){"Seen from",
                                 {{"see-front", "Front", BUTTON_RAISED, DO_SEE_FRONT},
                                  {"see-side", "Side", BUTTON_RAISED, DO_SEE_SIDE},
                                  {"see-back", "Back", BUTTON_RAISED, DO_SEE_BACK},
                                  {"see-above", "Top", BUTTON_RAISED, DO_SEE_ABOVE},
                                  {"see-start", "Reset", BUTTON_RAISED, DO_SEE_START}},
                                 5};
}

// What stands before the switches: for what moves meanwhile, and may be wanted again and again. Count 0: nothing.
static struct button_group first_group(const struct brush *brush, const struct view_state *state)
{
    if (has_marks(brush, state))
        return marks_group(state);
    return state->sheet == SHEET_LAYERS && state->orbiting ? sides_group() : (struct button_group){0};
}

static double group_height(const struct brush *brush, const struct button_group *group, double width)
{
    return group->count ? TEXT_SIZE_NAME + controls_height(brush, group->controls, group->count, width - 12) + GAP : 0;
}

static void group_draw(const struct brush *brush, struct view_state *state, const struct button_group *group,
                       struct ui_box at, int64_t now_ns)
{
    label(brush, FACE_BODY, (struct ui_box){at.x + 8, at.y, at.w - 16, TEXT_SIZE_NAME}, brush->theme->text,
          group->name);
    const struct ui_box row = {at.x + 4, at.y + TEXT_SIZE_NAME, at.w - 12, TARGET};
    const int done = controls_draw(brush, group->controls, group->count, row);
    if (done >= 0)
        view_state_do(state, (enum view_action)done, now_ns);
}

// Chooses the permitted error of the drawn actor, pixels: a larger one draws faster. For developers.
static void error_row(const struct brush *brush, struct view_state *state, struct ui_box row)
{
    static const double errors_px[] = {0.5, 1, 2, 4};
    char text[16], name[24];
    for (int i = (int)COUNT_OF(errors_px) - 1; i >= 0; i--) {
        snprintf(text, sizeof text, "%g", errors_px[i]);
        snprintf(name, sizeof name, "error-%d", i);
        const bool on = fabs(state->error_px - errors_px[i]) < 0.01;
        if (text_button(brush, name, text, on ? BUTTON_MAIN : BUTTON_RAISED, cut_right(&row, TARGET)))
            view_state_set_error(state, errors_px[i]);
    }
    label(brush, FACE_SMALL, (struct ui_box){row.x + 8, row.y, row.w - 8, row.h}, brush->theme->text, "Error, px");
}

// The sheet's title and what closes it; returns what is left for its content.
static struct ui_box sheet_frame(const struct brush *brush, struct view_state *state, const char *title,
                                 struct ui_box box)
{
    panel(brush, box, false);
    struct ui_box in = inner(box, SHEET_EDGE), head = cut_top(&in, SHEET_TITLE);
    if (icon_button(brush, "sheet-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_PLAIN,
                    cut_right(&head, TARGET)))
        state->sheet = SHEET_NONE;
    label(brush, FACE_HEAD, (struct ui_box){head.x + 8, head.y, head.w - 8, head.h}, brush->theme->text, title);
    return in;
}

// Rows that are switched, and below them the text size; scrolls where the sheet is lower.
static void rows_draw(const struct brush *brush, struct screens *screens, struct view_state *state,
                      const struct sheet_row *rows, int count, struct ui_box in, int64_t now_ns)
{
    const bool developer = state->developer && state->sheet == SHEET_LAYERS;
    const struct button_group first = first_group(brush, state);
    const double first_h = group_height(brush, &first, in.w),
                 content_h = sheet_rows_height(count + developer) + first_h;
    struct scroll *scroll = &screens->sheet;
    scroll->at += state->list_steps * SHEET_ROW;
    state->list_steps = 0;
    const struct brush inside = scroll_begin(brush, scroll, &in, content_h);
    double y = in.y - scroll->at;
    int more = 0;
    if (first.count)
        group_draw(&inside, state, &first, (struct ui_box){in.x, y, in.w, first_h}, now_ns);
    y += first_h;
    for (int i = 0; i < count; i++, y += SHEET_ROW) {
        if (switch_row(&inside, rows[i].name, rows[i].icon, rows[i].text, rows[i].on,
                       (struct ui_box){in.x, y, in.w - 6, SHEET_ROW}))
            view_state_do(state, rows[i].action, now_ns);
        more += y + SHEET_ROW > in.y + in.h + 1;
    }
    y += text_size_row(&inside, state, (struct ui_box){in.x, y, in.w, SHEET_ROW}, now_ns);
    more += y > in.y + in.h + 1;
    if (developer) {
        error_row(&inside, state, (struct ui_box){in.x, y + GAP, in.w - 6, TARGET});
        more += y + SHEET_ROW > in.y + in.h + 1;
    }
    scroll_end(brush, scroll, more);
}

static void layers_sheet(const struct brush *brush, struct screens *screens, struct view_state *state,
                         struct ui_box box, int64_t now_ns)
{
    // Those for developers are last.
    const struct sheet_row rows[] = {
        {"sheet-skeleton", "Skeleton", ICON_BONES, state->skeleton, DO_SKELETON},
        {"sheet-inset", "The sensor's picture", ICON_INSET, state->inset, DO_INSET},
        {"sheet-filmed", "The filmed room", ICON_ROOM, state->room.filmed, DO_FILMED},
        {"sheet-theme", "Dark colours", ICON_MOON, state->dark, DO_THEME},
        {"sheet-sources", "Where pixels come from", ICON_DROPS, state->sources, DO_SOURCES},
        {"sheet-frame-graph", "Frame times", ICON_BARS, state->frame_graph, DO_FRAME_GRAPH},
    };
    static_assert(COUNT_OF(rows) == LAYER_ROWS + DEVELOPER_ROWS - 1, "and the permitted error");
    const struct ui_box in = sheet_frame(brush, state, "Show", box);
    rows_draw(brush, screens, state, rows, state->developer ? (int)COUNT_OF(rows) : LAYER_ROWS, in, now_ns);
}

static void live_sheet(const struct brush *brush, struct screens *screens, struct view_state *state, struct ui_box box,
                       int64_t now_ns)
{
    const struct live_state *l = &state->live;
    const struct sheet_row rows[] = {
        {"live-hands-free", "Start when I stand there", ICON_PLAY, l->hands_free, DO_HANDS_FREE},
        {"live-pace", "The actor waits for me", ICON_PAUSE, l->pace == LIVE_FOLLOW, DO_PACE},
        {"live-loop", "Again and again", ICON_LOOP, l->loop, DO_LOOP},
        {"live-ghost", "Show the next pose", ICON_BONES, l->ghost, DO_GHOST},
        {"live-mirrored", "Mirrored", ICON_MIRROR, l->mirrored, DO_MIRROR},
        {"live-dark", "Dark colours", ICON_MOON, state->dark, DO_THEME},
        {"live-over", "The actor over me", ICON_LAYERS, l->over, DO_OVER}, // of the mirror alone
    };
    static_assert(COUNT_OF(rows) == LIVE_ROWS, "the sheet's height counts them");
    const struct ui_box in = sheet_frame(brush, state, "Options", box);
    rows_draw(brush, screens, state, rows, (int)COUNT_OF(rows) - (l->screen != LIVE_MIRROR), in, now_ns);
}

static void speed_sheet(const struct brush *brush, struct view_state *state, struct ui_box box, int64_t now_ns)
{
    const struct ui_box in = sheet_frame(brush, state, "Speed", box);
    const double w = (in.w - 3 * GAP) / 4;
    for (int i = 0; i < VIEW_SPEEDS; i++) {
        char text[16], name[24];
        snprintf(text, sizeof text, "%g×", view_speeds[i]);
        snprintf(name, sizeof name, "speed-%d", i);
        const bool on = fabs(state->playback.speed - view_speeds[i]) < 0.01;
        const struct ui_box key = {in.x + (i % 4) * (w + GAP), in.y + (i / 4) * (SHEET_ROW + GAP), w, SHEET_ROW};
        if (text_button(brush, name, text, on ? BUTTON_MAIN : BUTTON_RAISED, key))
            view_state_set_speed(state, view_speeds[i], now_ns);
    }
}

void panels_draw(const struct brush *brush, struct screens *screens, struct view_state *state, struct ui_box box,
                 int64_t now_ns)
{
    if (state->sheet == SHEET_LAYERS)
        layers_sheet(brush, screens, state, box, now_ns);
    else if (state->sheet == SHEET_LIVE)
        live_sheet(brush, screens, state, box, now_ns);
    else if (state->sheet == SHEET_SPEED)
        speed_sheet(brush, state, box, now_ns);
    (void)ui_area(brush->ui, "sheet", box); // touches do not pass through
}
