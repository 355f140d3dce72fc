// The page for watching: its controls, its sheets with settings (those of the live page, too), and what is said over
// any page; and the page for trouble.
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

// A graph of the last frames' times by stage.
static void frame_graph_draw(const struct brush *brush, const struct frame_times *times, double budget_ms,
                             struct ui_box box)
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
    const bool takes_back = state->phase == LIVE_READY && live_state_is_marked(state);
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

static const char *const group_names[LIVE_GROUPS] = {"Head", "Trunk", "Arms", "Legs"};

static struct button_group counts_group(const struct live_counting *state)
{
    static const char *const names[LIVE_GROUPS] = {"count-head", "count-trunk", "count-arms", "count-legs"};
    struct button_group g = {.name = "What counts", .count = LIVE_GROUPS};
    for (int i = 0; i < LIVE_GROUPS; i++)
        g.controls[i] =
            (struct control){names[i], group_names[i], state->counts[i] ? BUTTON_ON : BUTTON_RAISED, DO_COUNT + i};
    return g;
}

// A touch takes the next one. texts: of the buttons, borrowed by the group.
static struct button_group tolerances_group(const struct live_counting *counting, char texts[LIVE_GROUPS][24])
{
    static const char *const names[LIVE_GROUPS] = {"within-head", "within-trunk", "within-arms", "within-legs"};
    struct button_group g = {.name = "How closely", .count = LIVE_GROUPS};
    for (int i = 0; i < LIVE_GROUPS; i++) {
        const double deg = counting->tolerance_deg[i];
        const bool given = deg > 0;
        if (given)
            snprintf(texts[i], sizeof texts[i], "%s %.3g°", group_names[i], deg);
        else
            snprintf(texts[i], sizeof texts[i], "%s %s", group_names[i], deg < 0 ? "varied" : "usual");
        g.controls[i] = (struct control){names[i], texts[i], given ? BUTTON_ON : BUTTON_RAISED, DO_TOLERANCE + i};
    }
    return g;
}

// name: the group's, borrowed by it.
static struct button_group stretch_group(const struct live_counting *counting, char name[64])
{
    const bool all = counting->to_ns <= 0;
    snprintf(name, 64, "All of it counts");
    if (!all)
        snprintf(name, 64, "Only %.1f s to %.1f s counts", (double)counting->from_ns * 1e-9,
                 (double)counting->to_ns * 1e-9);
    return (struct button_group){name,
                                 {{"count-marked", "Only the marked part", BUTTON_RAISED, DO_COUNT_MARKED},
                                  {"count-all", "All of it", BUTTON_RAISED, DO_COUNT_ALL}},
                                 all ? 1 : 2};
}

// What the actor is drawn as, with what that costs; the name is that of the one chosen.
static struct button_group detail_group(const struct view_state *state)
{
    static const char *const names[DETAIL_COUNT] = {
        [DETAIL_PAPER] = "Actor: 2014's cylinders, at once", [DETAIL_PARTS] = "Actor: cylinders, at once",
        [DETAIL_FUSED] = "Actor: one body, made in seconds", [DETAIL_FULL] = "Actor: each instant, most to load",
        [DETAIL_AUTO] = "Actor: as fine as can be seen",
    };
    static const enum detail order[DETAIL_COUNT] = {DETAIL_AUTO, DETAIL_FULL, DETAIL_FUSED, DETAIL_PARTS, DETAIL_PAPER};
    static const struct {
        const char *name, *text;
    } buttons[DETAIL_COUNT] = {[DETAIL_PAPER] = {"detail-paper", "2014"},
                               [DETAIL_PARTS] = {"detail-parts", "Parts"},
                               [DETAIL_FUSED] = {"detail-fused", "Body"},
                               [DETAIL_FULL] = {"detail-full", "Finest"},
                               [DETAIL_AUTO] = {"detail-auto", "Auto"}};
    struct button_group g = {.name = names[state->detail], .count = DETAIL_COUNT};
    for (int i = 0; i < DETAIL_COUNT; i++)
        g.controls[i] = (struct control){buttons[order[i]].name, buttons[order[i]].text,
                                         order[i] == state->detail ? BUTTON_MAIN : BUTTON_RAISED, DO_DETAIL + order[i]};
    return g;
}

// What stands after the switches, with its texts.
struct last_groups {
    struct button_group group[3];
    int count;
    char tolerances[LIVE_GROUPS][24], stretch[64];
};

static void fill_counting(struct last_groups *last, const struct live_counting *counting)
{
    last->group[0] = counts_group(counting);
    last->group[1] = tolerances_group(counting, last->tolerances);
    last->group[2] = stretch_group(counting, last->stretch);
    last->count = 3;
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
    struct last_groups last = {.count = 0};
    if (state->sheet == SHEET_LIVE)
        fill_counting(&last, &state->live.counting);
    if (state->sheet == SHEET_LAYERS)
        last.group[last.count++] = detail_group(state);
    const double first_h = group_height(brush, &first, in.w);
    double content_h = sheet_rows_height(count + developer) + first_h;
    for (int i = 0; i < last.count; i++)
        content_h += group_height(brush, &last.group[i], in.w);
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
    for (int i = 0; i < last.count; i++) {
        const double h = group_height(brush, &last.group[i], in.w);
        group_draw(&inside, state, &last.group[i], (struct ui_box){in.x, y, in.w, h}, now_ns);
        y += h;
        more += y > in.y + in.h + 1;
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

// ---------------------------------------------------------------- message

// The progress of building the avatar: along the screen's upper edge, where it hides nothing of the actor.
static void draw_progress(const struct brush *brush, const struct view_state *state)
{
    enum { THICK = 4 };
    const double w = ui_width(brush->ui);
    ui_layer(brush->ui, 2);
    ui_fill(brush->ui, (struct ui_box){0, 0, w, THICK}, 0, faint(brush->theme->text, 0.2));
    ui_fill(brush->ui, (struct ui_box){0, 0, w * state->avatar_progress, THICK}, 0, brush->theme->accent);
    ui_layer(brush->ui, 0);
}

// What is said, and where.
struct message {
    const char *text; // NULL: nothing
    bool is_notice;
    enum face face;
    double text_w, text_h;
    struct ui_box box;
};

static void break_lines(const struct brush *brush, struct message *message, double max)
{
    message->text_w = fmin(max, 640) - 72;
    message->face = ui_text_height(brush->ui, FACE_STRONG, message->text, message->text_w) > 0.3 * ui_height(brush->ui)
                        ? FACE_SMALL
                        : FACE_STRONG;
    message->text_h = ui_text_height(brush->ui, (int)message->face, message->text, message->text_w);
    message->box.w = fmin(ui_text_width(brush->ui, FACE_STRONG, message->text), message->text_w) + 78;
    message->box.h = fmax(message->text_h + 28, TARGET);
}

// Below the top row, beside the screenshot button; where something is done above the panel, for the cue is on top; in
// the summary over the strip, so that score and findings stay in sight.
static void place_message(const struct brush *brush, const struct view_state *state, struct message *message)
{
    const double width = ui_width(brush->ui), height = ui_height(brush->ui);
    const struct take_view_image none = {0};
    const struct layout l = layout_of(width, height, state, &none);
    const bool shutter = state->page == PAGE_WATCH && view_state_controls_shown(state) && state->sheet == SHEET_NONE &&
                         !state->moving && !l.photo_on_top;
    double right = width;
    break_lines(brush, message, width - 2 * MARGIN);
    if (state->page == PAGE_LIVE && state->live.phase == LIVE_SUMMARY) {
        message->box.y = screen_summary_bottom(width, height) - message->box.h;
    } else if (state->page == PAGE_LIVE) {
        const struct ui_box free = layout_live_free(width, height);
        message->box.y = fmax(free.y, free.y + free.h - message->box.h);
    } else {
        message->box.y = l.top.y + l.top.h + 2 * GAP;
        if (shutter && message->box.y + message->box.h > l.shutter.y &&
            (width + message->box.w) / 2 > l.shutter.x - GAP) {
            right = l.shutter.x - GAP + MARGIN;
            break_lines(brush, message, right - 2 * MARGIN);
        }
    }
    message->box.x = (right - message->box.w) / 2;
}

static struct message find_message(const struct brush *brush, const struct view_state *state)
{
    const char *hint = view_state_hint(state);
    struct message m = {.text = state->notice[0] ? state->notice : hint};
    m.is_notice = m.text == state->notice;
    if (m.text == hint && state->sheet != SHEET_NONE) // a sheet has that place
        m.text = NULL;
    if (m.text)
        place_message(brush, state, &m);
    return m;
}

struct ui_box screen_message_box(const struct brush *brush, const struct view_state *state)
{
    return find_message(brush, state).box;
}

void screen_message(const struct brush *brush, const struct view_state *state)
{
    const struct theme *t = brush->theme;
    const struct message m = find_message(brush, state);
    const struct ui_box box = m.box;
    if (state->page == PAGE_WATCH && state->avatar_progress < 1)
        draw_progress(brush, state);
    if (!m.text)
        return;
    const bool tag =
        !m.is_notice && state->page == PAGE_WATCH && state->camera.seeing && !state->problem && !state->frozen;
    ui_layer(brush->ui, 2);
    ui_shadow(brush->ui, box, box.h / 2, 16, t->shadow);
    ui_fill(brush->ui, box, fmin(box.h / 2, 29), t->glass);
    const bool done = m.is_notice && !state->notice_warns;
    const bool calm = !m.is_notice && !view_state_hint_warns(state);
    const uint32_t color = done || tag || calm ? t->accent : t->warn;
    enum icon icon = ICON_WARNING;
    if (done)
        icon = ICON_CHECK;
    else if (calm)
        icon = ICON_BONES;
    else if (tag)
        icon = ICON_TAG;
    icon_draw(brush->ui, icon, (struct ui_point){box.x + 34, box.y + box.h / 2}, 28, color);
    ui_text_lines(brush->ui, (int)m.face, (struct ui_point){box.x + 58, box.y + (box.h - m.text_h) / 2}, m.text_w + 1,
                  t->text, m.text);
    ui_layer(brush->ui, 0);
}

static const double PI = 3.14159265358979323846;

// ---------------------------------------------------------------- bottom panel

static void time_row(const struct brush *brush, struct view_state *state, struct ui_box row, int64_t now_ns)
{
    const struct theme *t = brush->theme;
    int64_t at = playback_at(&state->playback, now_ns), length = state->playback.length_ns;
    double label_w = label_time_width(brush, length), y = row.y + row.h / 2 - 9;
    struct ui_box before = cut_left(&row, label_w), behind = cut_right(&row, label_w);
    label_time(brush, (struct ui_point){before.x, y}, t->text, at);
    label_time(brush, (struct ui_point){behind.x, y}, t->quiet, length);
    struct slide slide = slider(brush, "timeline", length > 0 ? (double)at / (double)length : 0, row);
    view_state_scrub(state, slide.held, slide.share, now_ns);
    for (int end = 0; state->trim.offered && end < 2 && length > 0; end++) {
        const double share = (double)(end ? state->trim.to_ns : state->trim.from_ns) / (double)length,
                     x = row.x + 11 + share * (row.w - 22); // as the slider's knob
        ui_line(brush->ui, (struct ui_point){x, row.y + 12}, (struct ui_point){x, row.y + row.h - 12}, 4, t->accent);
    }
}

// Where the ends that stay are, over the timeline; and what cuts the others off.
static void trim_row(const struct brush *brush, struct view_state *state, struct ui_box row, bool narrow,
                     int64_t now_ns)
{
    char text[64];
    const struct view_trim *t = &state->trim;
    const bool cuts = t->from_ns > 0 || t->to_ns < state->playback.length_ns;
    snprintf(text, sizeof text, "%.1f s to %.1f s", (double)t->from_ns * 1e-9, (double)t->to_ns * 1e-9);
    const struct ui_box words = narrow ? cut_top(&row, 20) : cut_right(&row, 130);
    label(brush, FACE_SMALL, words, cuts ? brush->theme->accent : brush->theme->quiet, cuts ? text : "All of it stays");
    const struct control controls[] = {{"trim-from", "From here", BUTTON_RAISED, DO_MARK_FROM},
                                       {"trim-to", "To here", BUTTON_RAISED, DO_MARK_TO},
                                       {"trim", "Trim", BUTTON_MAIN, DO_KEEP}};
    const int done = controls_draw(brush, controls, cuts ? 3 : 2, row);
    if (done >= 0)
        view_state_do(state, (enum view_action)done, now_ns);
}

struct icon_control {
    const char *name;
    struct icon_words what;
    enum button_kind kind;
    enum view_action action;
};

static void icon_row(const struct brush *brush, struct view_state *state, const struct icon_control *controls,
                     int count, struct ui_box row, int64_t now_ns)
{
    const double w = (row.w - (count - 1) * GAP) / count;
    for (int i = 0; i < count; i++)
        if (icon_button(brush, controls[i].name, controls[i].what, controls[i].kind, cut_left(&row, w)))
            view_state_do(state, controls[i].action, now_ns);
}

// Play in the middle; the others beside it, where the panel is narrow below it.
static void button_row(const struct brush *brush, struct view_state *state, struct ui_box row, bool narrow,
                       int64_t now_ns)
{
    char speed[16];
    const struct playback_clock *p = &state->playback;
    static const double BESIDE = 2 * TARGET + GAP + 16; // for words a little wider than their icons
    snprintf(speed, sizeof speed, "%g×", p->speed);
    const struct icon_control left[] = {
        {"loop", {ICON_LOOP, "Repeat"}, p->loop ? BUTTON_ON : BUTTON_PLAIN, DO_LOOP},
        {"mirror", {ICON_MIRROR, "Mirror"}, state->placement.mirrored ? BUTTON_ON : BUTTON_PLAIN, DO_MIRROR}};
    const struct icon_control right[] = {
        {"layers", {ICON_LAYERS, "Show"}, state->sheet == SHEET_LAYERS ? BUTTON_ON : BUTTON_PLAIN, DO_LAYERS}};
    const double y = row.y + (PLAY - TARGET) / 2, below = row.y + PLAY + GAP;
    struct ui_box at_left = {row.x, narrow ? below : y, narrow ? row.w / 2 - GAP / 2 : BESIDE, TARGET},
                  at_right = at_left;
    at_right.x = row.x + row.w - at_right.w;
    icon_row(brush, state, left, (int)COUNT_OF(left), at_left, now_ns);
    struct ui_box speed_box = cut_left(&at_right, (at_right.w - GAP) / 2);
    if (text_button(brush, "speed", speed, state->sheet == SHEET_SPEED ? BUTTON_ON : BUTTON_PLAIN, speed_box))
        view_state_do(state, DO_SPEED, now_ns);
    icon_row(brush, state, right, (int)COUNT_OF(right), at_right, now_ns);
    const double x = row.x + row.w / 2;
    if (icon_button(brush, "step-back", (struct icon_words){ICON_STEP_BACK, "Back"}, BUTTON_PLAIN,
                    (struct ui_box){x - PLAY / 2 - GAP - TARGET, y, TARGET, TARGET}))
        view_state_do(state, DO_STEP_BACK, now_ns);
    if (icon_button(brush, "play",
                    (struct icon_words){p->playing ? ICON_PAUSE : ICON_PLAY, p->playing ? "Pause" : "Play"},
                    BUTTON_MAIN, (struct ui_box){x - PLAY / 2, row.y, PLAY, PLAY}))
        view_state_do(state, DO_PLAY_PAUSE, now_ns);
    if (icon_button(brush, "step-on", (struct icon_words){ICON_STEP_ON, "On"}, BUTTON_PLAIN,
                    (struct ui_box){x + PLAY / 2 + GAP, y, TARGET, TARGET}))
        view_state_do(state, DO_STEP_ON, now_ns);
}

static void moving_panel(const struct brush *brush, struct view_state *state, struct ui_box box, bool narrow,
                         int64_t now_ns)
{
    const struct theme *t = brush->theme;
    char text[32];
    struct ui_box in = inner(box, 14), words = cut_top(&in, TARGET), buttons = words;
    if (narrow)
        buttons = cut_top(&in, TARGET);
    else
        buttons = cut_right(&words, 240);
    const struct control controls[] = {{"move-back", "Put back", BUTTON_RAISED, DO_RESET_PLACEMENT},
                                       {"move-done", "Done", BUTTON_MAIN, DO_MOVE}};
    const int done = controls_draw(brush, controls, (int)COUNT_OF(controls), buttons);
    if (done >= 0)
        view_state_do(state, (enum view_action)done, now_ns);
    struct ui_box first = {words.x + 4, words.y + 2, words.w - 4, 30},
                  second = {words.x + 4, words.y + 31, words.w - 4, 24};
    label(brush, FACE_STRONG, first, t->text, "Move the actor");
    label(brush, FACE_SMALL, second, t->quiet, "Drag over the floor");
    snprintf(text, sizeof text, "%+.0f°", state->placement.yaw_rad * 180 / PI);
    struct ui_box icon = cut_left(&in, 34), degrees = cut_right(&in, 70);
    icon_draw(brush->ui, ICON_ORBIT, middle(icon), 26, t->quiet);
    label_centred(brush, FACE_STRONG, degrees, t->text, text);
    struct slide slide = slider(brush, "yaw", state->placement.yaw_rad / (2 * PI) + 0.5, in);
    if (slide.held)
        view_state_set_yaw(state, (slide.share - 0.5) * 2 * PI * 0.9999);
}

// ---------------------------------------------------------------- controls over the image

static const double WORD_W = 70, MIN_NAME = 110; // dp; a narrower name would be dots

static void top_row(const struct brush *brush, struct view_state *state, const struct watch_page *page,
                    const struct layout *layout, int64_t now_ns)
{
    struct ui_box top = layout->top;
    const struct theme *t = brush->theme;
    const struct room_state *room = &state->room;
    const bool others = state->take_count > 1, finding = state->sheet == SHEET_THINGS;
    struct icon_control controls[5];
    int count = 0;
    if (state->camera.requested)
        controls[count++] =
            (struct icon_control){"orbit",
                                  {state->orbiting ? ICON_CAMERA : ICON_ORBIT, state->orbiting ? "Camera" : "Around"},
                                  BUTTON_GLASS,
                                  DO_ORBIT};
    controls[count++] =
        (struct icon_control){"move", {ICON_MOVE, "Move"}, state->moving ? BUTTON_MAIN : BUTTON_GLASS, DO_MOVE};
    if (room->has_place)
        controls[count++] =
            (struct icon_control){"map", {ICON_MAP, "Map"}, room->map ? BUTTON_MAIN : BUTTON_GLASS, DO_MAP};
    if (room->thing_count)
        controls[count++] =
            (struct icon_control){"find", {ICON_FIND, "Find"}, finding ? BUTTON_MAIN : BUTTON_GLASS, DO_THINGS};
    if (layout->photo_on_top && !state->moving)
        controls[count++] = (struct icon_control){"screenshot", {ICON_PHOTO, "Photo"}, BUTTON_GLASS, DO_SCREENSHOT};
    struct ui_box row = cut_top(&top, TARGET);
    if (icon_button(brush, "back", (struct icon_words){others ? ICON_BACK : ICON_CLOSE, others ? "Takes" : "Close"},
                    BUTTON_GLASS, cut_left(&row, TARGET)))
        view_state_do(state, DO_BACK, now_ns);
    for (int i = 0; i < count; i++) {
        if (row.w < WORD_W)
            row = cut_top(&top, TARGET);
        if (icon_button(brush, controls[i].name, controls[i].what, controls[i].kind,
                        cut_right(&row, i == 0 && state->camera.requested ? WORD_W : TARGET)))
            view_state_do(state, controls[i].action, now_ns);
    }
    if (row.y > layout->top.y || row.w < MIN_NAME)
        return;
    char making[64];
    snprintf(making, sizeof making, "Improving the picture, %.0f %%", 100 * state->avatar_progress);
    const char *second = state->avatar_progress < 1 ? making : page->file;
    double width =
        fmax(ui_text_width(brush->ui, FACE_STRONG, page->take), ui_text_width(brush->ui, FACE_SMALL, second));
    struct ui_box name = {row.x, row.y, fmin(width + 44, row.w), row.h};
    ui_shadow(brush->ui, name, TARGET / 2, 8, t->shadow);
    ui_fill(brush->ui, name, TARGET / 2, t->glass);
    label(brush, FACE_STRONG, (struct ui_box){name.x + 22, name.y + 8, name.w - 40, 22}, t->text, page->take);
    label(brush, FACE_SMALL, (struct ui_box){name.x + 22, name.y + 31, name.w - 40, 20}, t->quiet, second);
}

static void draw_shutter(const struct brush *brush, struct view_state *state, struct ui_box box, int64_t now_ns)
{
    struct ui_touch touch = ui_area(brush->ui, "screenshot", box);
    if (touch.rests)
        icon_tip(brush, box, "Photograph");
    struct ui_point m = middle(box);
    ui_shadow(brush->ui, box, box.w / 2, 8, brush->theme->shadow);
    ui_disc(brush->ui, m, box.w / 2, brush->theme->glass);
    ui_disc(brush->ui, m, box.w / 2 - (touch.held ? 11 : 8), brush->theme->accent);
    icon_draw(brush->ui, ICON_PHOTO, m, 32, brush->theme->on_accent);
    if (touch.tapped && !touch.rested)
        view_state_do(state, DO_SCREENSHOT, now_ns);
}

static void inset_card(const struct brush *brush, const struct take_view_image *image, struct ui_box box)
{
    const struct ui_uv_rect whole = {0, 0, 1, 1};
    ui_shadow(brush->ui, box, 14, 12, brush->theme->shadow);
    ui_image(brush->ui, image->inset, box, whole, 14, 0xffffffff);
    ui_border(brush->ui, box, 14, 2, brush->theme->glass);
    double width = ui_text_width(brush->ui, FACE_SMALL, "Sensor") + 22;
    struct ui_box name = {box.x + 8, box.y + box.h - 34, width, 26};
    ui_fill(brush->ui, name, 13, brush->theme->glass);
    label_centred(brush, FACE_SMALL, name, brush->theme->text, "Sensor");
}

static void sources_card(const struct brush *brush, struct ui_box at)
{
    static const struct {
        uint32_t color;
        const char *text;
    } rows[] = {{0x34d399ff, "seen at this instant"},
                {0x38bdf8ff, "from a frame near in time"},
                {0xa73ef0ff, "from a frame far in time"},
                {0xfb923cff, "never seen: filled in"}};
    struct ui_box box = {at.x, at.y, at.w, layout_sources_height()};
    panel(brush, box, true);
    struct ui_box in = inner(box, 12);
    for (size_t i = 0; i < COUNT_OF(rows); i++) {
        double y = in.y + 28 * (double)i;
        ui_disc(brush->ui, (struct ui_point){in.x + 8, y + 14}, 6, rows[i].color);
        label(brush, FACE_SMALL, (struct ui_box){in.x + 26, y, in.w - 26, 28}, brush->theme->text, rows[i].text);
    }
}

// Cards without controls, down the left side.
static void draw_cards(const struct brush *brush, const struct view_state *state, const struct watch_page *page,
                       struct ui_box column, struct ui_box frame_graph)
{
    if (state->inset && page->image->inset)
        inset_card(brush, page->image, cut_top(&column, column.w / page->image->inset_aspect));
    if (state->sources && page->image->sources)
        sources_card(brush, column);
    if (state->frame_graph)
        frame_graph_draw(brush, page->times, page->budget_ms, frame_graph);
}

// Touches of the image itself; tested last, so that every control comes first.
static void sense_image_touch(const struct brush *brush, struct screens *screens, const struct layout *layout)
{
    screens->image_held = ui_area(brush->ui, "image", layout->picture).held;
    const struct ui_touch map = ui_area(brush->ui, "map-image", layout->map);
    screens->map_held = map.held || map.over;
}

static void draw_controls(const struct brush *brush, struct screens *screens, struct view_state *state,
                          const struct watch_page *page, const struct layout *layout, int64_t now_ns)
{
    const struct ui_box low = layout->panel;
    const bool sheet = state->sheet != SHEET_NONE && !state->moving, covered = sheet && layout->sheet_covers;
    if (sheet) {
        ui_layer(brush->ui, 2);
        if (state->sheet == SHEET_THINGS || state->sheet == SHEET_CARD)
            thing_sheet_draw(brush, &screens->room, state, page->room, layout->sheet,
                             page->image->world_from_camera.translation, now_ns);
        else
            panels_draw(brush, screens, state, layout->sheet, now_ns);
    }
    if (covered) { // the others would be seen in part
        ui_layer(brush->ui, 0);
        return;
    }
    ui_layer(brush->ui, 1);
    panel(brush, low, true);
    if (state->moving) {
        moving_panel(brush, state, low, layout->narrow, now_ns);
    } else {
        struct ui_box in = {low.x + 20, low.y + 4, low.w - 40, low.h - 12};
        const double buttons_h = PLAY + (layout->narrow ? TARGET + GAP : 0);
        time_row(brush, state, (struct ui_box){in.x, in.y, in.w, TARGET}, now_ns);
        button_row(brush, state, (struct ui_box){in.x - 6, in.y + TARGET, in.w + 12, buttons_h}, layout->narrow,
                   now_ns);
        if (state->trim.offered)
            trim_row(brush, state,
                     (struct ui_box){in.x, in.y + TARGET + buttons_h + GAP, in.w, TARGET + (layout->narrow ? 28 : 0)},
                     layout->narrow, now_ns);
        if (!sheet && !layout->photo_on_top) // else a sheet may cover it
            draw_shutter(brush, state, layout->shutter, now_ns);
    }
    top_row(brush, state, page, layout, now_ns);
    draw_cards(brush, state, page, layout->cards, layout->frame_graph);
    (void)ui_area(brush->ui, "panel", low);
    ui_layer(brush->ui, 0);
}

// Labels over the picture and over the map; they leave the controls free.
static void draw_thing_labels(const struct brush *brush, struct screens *screens, struct view_state *state,
                              const struct watch_page *page, const struct layout *layout, int64_t now_ns)
{
    const struct take_view_image *image = page->image;
    const struct figure_view view = {image->lens, image->world_from_camera, cover_of(&image->lens, layout->picture),
                                     false};
    const bool shown = view_state_controls_shown(state), sheet = shown && state->sheet != SHEET_NONE && !state->moving;
    const struct ui_box none = {0, 0, 0, 0};
    struct ui_box cards = layout->cards;
    cards.h = (state->inset && image->inset ? cards.w / image->inset_aspect + GAP : 0) +
              (state->sources && image->sources ? layout_sources_height() + GAP : 0);
    const struct ui_box taken[] = {shown ? layout->panel : none,
                                   shown ? layout->top : none,
                                   shown && !sheet && !state->moving ? layout->shutter : none,
                                   sheet ? layout->sheet : none,
                                   cards.h > 0 ? cards : none,
                                   state->frame_graph ? layout->frame_graph : none};
    if (!page->room->count)
        return;
    const struct label_view picture = {&view, 0, layout->picture, taken, (int)COUNT_OF(taken)};
    const struct label_view map = {&page->room->map_view, 1, layout->map, taken, (int)COUNT_OF(taken)};
    int touched = ROOM_NOTHING, on_map = ROOM_NOTHING;
    if (!page->room->apart && ((image->camera == NULL && !image->making && !image->bodiless) ||
                               (state->camera.placed && state->presence > 0)))
        touched = thing_labels_draw(brush, &screens->room, &state->room, page->room, &picture);
    if (layout->map.w > 0)
        on_map = thing_labels_draw(brush, &screens->room, &state->room, page->room, &map);
    if (touched != ROOM_NOTHING || on_map != ROOM_NOTHING)
        view_state_open_card(state, touched != ROOM_NOTHING ? touched : on_map, now_ns);
}

void screen_watch(const struct brush *brush, struct screens *screens, struct view_state *state,
                  const struct watch_page *page, int64_t now_ns)
{
    struct ui_box all = {0, 0, ui_width(brush->ui), ui_height(brush->ui)};
    const struct layout l = layout_of(all.w, all.h, state, page->image);
    compositor_draw(brush, l.picture, page->image, state);
    if (l.map.w > 0)
        map_draw(brush, page->room, l.map);
    if (view_state_controls_shown(state)) {
        draw_controls(brush, screens, state, page, &l, now_ns);
    } else if (state->frame_graph || state->inset || state->sources) {
        const struct ui_box column = {l.cards.x, MARGIN, l.cards.w, l.cards.h};
        const struct ui_box frame_graph = {l.frame_graph.x, all.h - MARGIN - l.frame_graph.h, l.frame_graph.w,
                                           l.frame_graph.h};
        ui_layer(brush->ui, 1);
        draw_cards(brush, state, page, column, frame_graph);
        ui_layer(brush->ui, 0);
    }
    draw_thing_labels(brush, screens, state, page, &l, now_ns);
    sense_image_touch(brush, screens, &l);
}

bool screens_wheel(struct screens *screens, const struct view_state *state, struct ui_point at, double notches)
{
    if (state->page == PAGE_LIVE && state->live.phase == LIVE_SUMMARY)
        return scroll_turn(&screens->findings, at, -notches);
    if ((state->page != PAGE_WATCH && state->page != PAGE_LIVE) || state->moving)
        return false;
    switch (state->sheet) {
    case SHEET_THINGS: return scroll_turn(&screens->room.list, at, -notches);
    case SHEET_CARD: return scroll_turn(&screens->room.text, at, -notches);
    case SHEET_LAYERS:
    case SHEET_LIVE: return scroll_turn(&screens->sheet, at, -notches);
    default: return false;
    }
}

void screen_opening(const struct brush *brush, const char *file)
{
    const struct theme *t = brush->theme;
    const double w = ui_width(brush->ui), h = ui_height(brush->ui);
    ui_fill(brush->ui, (struct ui_box){0, 0, w, h}, 0, t->ground);
    label_centred(brush, FACE_HEAD, (struct ui_box){MARGIN, h / 2 - 36, w - 2 * MARGIN, 36}, t->text, "Opening");
    label_centred(brush, FACE_BODY, (struct ui_box){MARGIN, h / 2 + 6, w - 2 * MARGIN, 30}, t->quiet, file);
}

void screen_trouble(const struct brush *brush, struct view_state *state, int64_t now_ns)
{
    const struct theme *t = brush->theme;
    const double w = ui_width(brush->ui), h = ui_height(brush->ui), column = fmin(w - 4 * MARGIN, 560),
                 x = (w - column) / 2;
    const bool low = h < 500; // no room for a large picture
    const double above = low ? MARGIN : h / 2 - 196;
    ui_fill(brush->ui, (struct ui_box){0, 0, w, h}, 0, t->ground);
    const double radius = low ? 26 : 46;
    ui_disc(brush->ui, (struct ui_point){w / 2, above + radius}, radius, faint(t->warn, 0.16));
    icon_draw(brush->ui, ICON_WARNING, (struct ui_point){w / 2, above + radius - 2}, radius, t->warn);
    double y = above + 2 * radius + (low ? GAP : 24);
    label_centred(brush, FACE_HEAD, (struct ui_box){x, y, column, 36}, t->text, "This cannot be watched");
    y += 48;
    const struct ui_box words = {x, y, column + 1, h - y - TARGET - 2 * MARGIN};
    y += paragraph(brush, FACE_BODY, words, t->quiet, state->trouble) + 24;
    const struct ui_box close = {(w - 180) / 2, fmin(y, h - MARGIN - TARGET), 180, TARGET};
    if (text_button(brush, "close", state->take_count > 1 ? "Other takes" : "Close", BUTTON_MAIN, close))
        view_state_do(state, DO_BACK, now_ns);
}
