// What is said over any page: the notice or the hint, and the progress of building the avatar.
#include "app/ui/screens.h"

#include <math.h>

// The progress of building the avatar: along the screen's upper edge, where it hides nothing of the actor.
static void draw_progress(const struct brush *b, const struct view_state *s)
{
    enum { THICK = 4 };
    const double w = ui_width(b->ui);
    ui_layer(b->ui, 2);
    ui_fill(b->ui, (struct ui_box){0, 0, w, THICK}, 0, faint(b->theme->text, 0.2));
    ui_fill(b->ui, (struct ui_box){0, 0, w * s->avatar_progress, THICK}, 0, b->theme->accent);
    ui_layer(b->ui, 0);
}

// What is said, and where.
struct message {
    const char *text; // NULL: nothing
    bool is_notice;
    enum face face;
    double text_w, text_h;
    struct ui_box box;
};

static void break_lines(const struct brush *b, struct message *m, double most)
{
    m->text_w = fmin(most, 640) - 72;
    m->face =
        ui_text_height(b->ui, FACE_STRONG, m->text, m->text_w) > 0.3 * ui_height(b->ui) ? FACE_SMALL : FACE_STRONG;
    m->text_h = ui_text_height(b->ui, (int)m->face, m->text, m->text_w);
    m->box.w = fmin(ui_text_width(b->ui, FACE_STRONG, m->text), m->text_w) + 78;
    m->box.h = fmax(m->text_h + 28, TARGET);
}

// Below the top row, beside the screenshot button; where something is done above the panel, for the cue is on top; in
// the summary over the strip, so that score and findings stay in sight.
static void place_message(const struct brush *b, const struct view_state *s, struct message *m)
{
    const double width = ui_width(b->ui), height = ui_height(b->ui);
    const struct take_view_image none = {0};
    const struct layout l = layout_of(width, height, s, &none);
    const bool shutter = s->page == PAGE_WATCH && view_state_controls_shown(s) && s->sheet == SHEET_NONE &&
                         !s->moving && !l.photo_on_top;
    double right = width;
    break_lines(b, m, width - 2 * MARGIN);
    if (s->page == PAGE_LIVE && s->live.phase == LIVE_SUMMARY) {
        m->box.y = screen_summary_bottom(width, height) - m->box.h;
    } else if (s->page == PAGE_LIVE) {
        const struct ui_box free = layout_live_free(width, height);
        m->box.y = fmax(free.y, free.y + free.h - m->box.h);
    } else {
        m->box.y = l.top.y + l.top.h + 2 * GAP;
        if (shutter && m->box.y + m->box.h > l.shutter.y && (width + m->box.w) / 2 > l.shutter.x - GAP) {
            right = l.shutter.x - GAP + MARGIN;
            break_lines(b, m, right - 2 * MARGIN);
        }
    }
    m->box.x = (right - m->box.w) / 2;
}

static struct message find_message(const struct brush *b, const struct view_state *s)
{
    const char *hint = view_state_hint(s);
    struct message m = {.text = s->notice[0] ? s->notice : hint};
    m.is_notice = m.text == s->notice;
    if (m.text == hint && s->sheet != SHEET_NONE) // a sheet has that place
        m.text = NULL;
    if (m.text)
        place_message(b, s, &m);
    return m;
}

struct ui_box screen_message_box(const struct brush *b, const struct view_state *s) { return find_message(b, s).box; }

void screen_message(const struct brush *b, const struct view_state *s)
{
    const struct theme *t = b->theme;
    const struct message m = find_message(b, s);
    const struct ui_box box = m.box;
    if (s->page == PAGE_WATCH && s->avatar_progress < 1)
        draw_progress(b, s);
    if (!m.text)
        return;
    const bool tag = !m.is_notice && s->page == PAGE_WATCH && s->camera.seeing && !s->problem && !s->frozen;
    ui_layer(b->ui, 2);
    ui_shadow(b->ui, box, box.h / 2, 16, t->shadow);
    ui_fill(b->ui, box, fmin(box.h / 2, 29), t->glass);
    const bool done = m.is_notice && !s->notice_warns;
    const bool calm = !m.is_notice && !view_state_hint_warns(s);
    const uint32_t color = done || tag || calm ? t->accent : t->warn;
    enum icon icon = ICON_WARNING;
    if (done)
        icon = ICON_CHECK;
    else if (calm)
        icon = ICON_BONES;
    else if (tag)
        icon = ICON_TAG;
    icon_draw(b->ui, icon, (struct ui_point){box.x + 34, box.y + box.h / 2}, 28, color);
    ui_text_lines(b->ui, (int)m.face, (struct ui_point){box.x + 58, box.y + (box.h - m.text_h) / 2}, m.text_w + 1,
                  t->text, m.text);
    ui_layer(b->ui, 0);
}
