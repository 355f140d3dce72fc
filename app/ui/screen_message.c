// What is said over any page: the notice or the hint, and the progress of building the avatar.
#include "app/ui/screens.h"

#include <math.h>

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
