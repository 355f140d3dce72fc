#include "app/ui/widgets.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

struct ui_box cut_left(struct ui_box *box, double w)
{
    struct ui_box cut = {box->x, box->y, w, box->h};
    box->x += w + GAP;
    box->w -= w + GAP;
    return cut;
}

struct ui_box cut_right(struct ui_box *box, double w)
{
    box->w -= w + GAP;
    return (struct ui_box){box->x + box->w + GAP, box->y, w, box->h};
}

struct ui_box cut_top(struct ui_box *box, double h)
{
    struct ui_box cut = {box->x, box->y, box->w, h};
    box->y += h + GAP;
    box->h -= h + GAP;
    return cut;
}

struct ui_box cut_bottom(struct ui_box *box, double h)
{
    box->h -= h + GAP;
    return (struct ui_box){box->x, box->y + box->h + GAP, box->w, h};
}

struct ui_box inner(struct ui_box box, double by)
{
    return (struct ui_box){box.x + by, box.y + by, box.w - 2 * by, box.h - 2 * by};
}

struct ui_point middle(struct ui_box box) { return (struct ui_point){box.x + box.w / 2, box.y + box.h / 2}; }

static const double PLAIN_MAX = 70; // higher buttons are as large as their icon, without words under it

static double corner_radius(struct ui_box box) { return fmin(box.w, box.h) / 2; }

// Draws the button's background; returns the colour for its icon or text.
static uint32_t button_ground(const struct brush *brush, enum button_kind kind, struct ui_box box,
                              const struct ui_touch *touch, double radius)
{
    const struct theme *t = brush->theme;
    uint32_t ink = t->text;
    if (kind == BUTTON_GLASS)
        ui_shadow(brush->ui, box, radius, 8, t->shadow);
    switch (kind) {
    case BUTTON_PLAIN: break;
    case BUTTON_RAISED: ui_fill(brush->ui, box, radius, t->raised); break;
    case BUTTON_GLASS: ui_fill(brush->ui, box, radius, t->glass); break;
    case BUTTON_ON:
        ui_fill(brush->ui, box, radius, faint(t->accent, 0.2));
        ink = t->accent;
        break;
    case BUTTON_MAIN:
        ui_fill(brush->ui, box, radius, t->accent);
        ink = t->on_accent;
        break;
    }
    if (touch->held && touch->over)
        ui_fill(brush->ui, box, radius, faint(t->text, 0.16));
    else if (touch->over)
        ui_fill(brush->ui, box, radius, faint(t->text, 0.07));
    return ink;
}

// A touch of what may be inside of something that scrolls: dragging it is no tap.
struct ui_touch touch_area(const struct brush *brush, const char *name, struct ui_box box)
{
    struct ui_touch touch = ui_area(brush->ui, name, box);
    if (brush->inside && brush->inside->moved)
        touch.tapped = touch.held = false;
    return touch;
}

struct icon_words theme_words(bool dark)
{
    return dark ? (struct icon_words){ICON_SUN, "Light"} : (struct icon_words){ICON_MOON, "Dark"};
}

// Beside the control, where the screen has room.
void icon_tip(const struct brush *brush, struct ui_box of, const char *words)
{
    const double w = ui_text_width(brush->ui, FACE_BODY, words) + 28, h = 40, wide = ui_width(brush->ui);
    const double x = fmin(fmax(of.x + (of.w - w) / 2, GAP), wide - w - GAP);
    const struct ui_box box = {x, of.y > h + 2 * GAP ? of.y - h - GAP : of.y + of.h + GAP, w, h};
    const int before = ui_layer(brush->ui, UI_LAYERS - 1);
    ui_fill(brush->ui, box, 12, brush->theme->text);
    label_centred(brush, FACE_BODY, box, brush->theme->surface, words);
    ui_layer(brush->ui, before);
}

bool icon_button(const struct brush *brush, const char *name, struct icon_words what, enum button_kind kind,
                 struct ui_box box)
{
    static const double WORDS_H = 17, MAX_W = 10; // words may be a little wider than their button
    struct ui_touch touch = touch_area(brush, name, box);
    const bool below = ui_text_width(brush->ui, FACE_TINY, what.words) <= box.w - MAX_W;
    const bool labelled = below && kind != BUTTON_MAIN && box.h < PLAIN_MAX;
    const uint32_t ink = button_ground(brush, kind, box, &touch, labelled ? ROUND : corner_radius(box));
    const double side = fmin(box.w, box.h) * (labelled ? 0.4 : 0.46);
    const struct ui_point m = middle(box);
    icon_draw(brush->ui, what.icon, (struct ui_point){m.x, m.y - (labelled ? 9 : 0)}, side, ink);
    if (labelled)
        label_centred(brush, FACE_TINY, (struct ui_box){box.x, box.y + box.h - WORDS_H - 4, box.w, WORDS_H}, ink,
                      what.words);
    else if (touch.rests)
        icon_tip(brush, box, what.words);
    return touch.tapped && (labelled || !touch.rested);
}

bool text_button(const struct brush *brush, const char *name, const char *text, enum button_kind kind,
                 struct ui_box box)
{
    struct ui_touch touch = touch_area(brush, name, box);
    uint32_t ink = button_ground(brush, kind, box, &touch, corner_radius(box));
    label_centred(brush, FACE_STRONG, box, ink, text);
    return touch.tapped;
}

// How many from number `first` on stand in one row.
static int row_count(const struct brush *brush, const struct control *controls, int count, double width, double *sum)
{
    int n = 0;
    *sum = 0;
    for (; n < count; n++) {
        const double w = fmax(TARGET, ui_text_width(brush->ui, FACE_STRONG, controls[n].text) + 28);
        if (n && *sum + w + n * GAP > width)
            break;
        *sum += w;
    }
    return n;
}

double controls_height(const struct brush *brush, const struct control *controls, int count, double width)
{
    double h = -GAP, sum;
    for (int i = 0; i < count; h += TARGET + GAP)
        i += row_count(brush, controls + i, count - i, width, &sum);
    return fmax(h, 0);
}

int controls_draw(const struct brush *brush, const struct control *controls, int count, struct ui_box box)
{
    int touched = -1;
    double sum;
    for (int i = 0, n; i < count; i += n) {
        n = row_count(brush, controls + i, count - i, box.w, &sum);
        struct ui_box row = cut_top(&box, TARGET);
        const double wider = (row.w - (n - 1) * GAP - sum) / n;
        for (int k = i; k < i + n; k++) {
            const double w = fmax(TARGET, ui_text_width(brush->ui, FACE_STRONG, controls[k].text) + 28) + wider;
            if (text_button(brush, controls[k].name, controls[k].text, controls[k].kind, cut_left(&row, w)))
                touched = controls[k].action;
        }
    }
    return touched;
}

bool switch_row(const struct brush *brush, const char *name, enum icon icon, const char *text, bool on,
                struct ui_box box)
{
    const struct theme *t = brush->theme;
    struct ui_touch touch = touch_area(brush, name, box);
    if (touch.over)
        ui_fill(brush->ui, box, 12, faint(t->text, touch.held ? 0.12 : 0.05));
    struct ui_box row = {box.x + 5, box.y, box.w - 5, box.h};
    struct ui_box picture = cut_left(&row, 32), lever = cut_right(&row, 48);
    icon_draw(brush->ui, icon, middle(picture), 26, on ? t->accent : t->quiet);
    label(brush, FACE_BODY, row, t->text, text);
    struct ui_point m = middle(lever);
    struct ui_box groove = {m.x - 24, m.y - 14, 48, 28};
    ui_fill(brush->ui, groove, 14, on ? t->accent : faint(t->text, 0.22));
    ui_disc(brush->ui, (struct ui_point){groove.x + (on ? 34 : 14), m.y}, 10.5, on ? t->on_accent : t->surface);
    return touch.tapped;
}

struct slide slider(const struct brush *brush, const char *name, double share, struct ui_box box)
{
    const struct theme *t = brush->theme;
    const double knob = 11;
    struct ui_touch touch = ui_area(brush->ui, name, box);
    struct slide slide = {touch.held, share};
    double left = box.x + knob, width = box.w - 2 * knob, y = box.y + box.h / 2;
    if (touch.held)
        slide.share = fmin(fmax((touch.x - knob) / width, 0), 1);
    double x = left + slide.share * width;
    ui_fill(brush->ui, (struct ui_box){left - 3, y - 3, width + 6, 6}, 3, faint(t->text, 0.2));
    ui_fill(brush->ui, (struct ui_box){left - 3, y - 3, x - left + 3, 6}, 3, t->accent);
    if (touch.held)
        ui_disc(brush->ui, (struct ui_point){x, y}, knob + 7, faint(t->accent, 0.25));
    ui_disc(brush->ui, (struct ui_point){x, y}, knob, t->accent);
    return slide;
}

void panel(const struct brush *brush, struct ui_box box, bool glass)
{
    ui_shadow(brush->ui, box, ROUND, 18, brush->theme->shadow);
    ui_fill(brush->ui, box, ROUND, glass ? brush->theme->glass : brush->theme->surface);
    ui_border(brush->ui, box, ROUND, 1, brush->theme->hairline);
}

static double line_height(const struct brush *brush, enum face face)
{
    return ui_text_height(brush->ui, (int)face, "X", 0);
}

// Writes as much of the text as fits into `out`.
static void fit_text(const struct brush *brush, enum face face, double width, const char *text, char *out,
                     size_t capacity)
{
    snprintf(out, capacity, "%s", text);
    size_t n = strlen(out);
    while (n > 0 && ui_text_width(brush->ui, (int)face, out) > width) {
        do
            n--;
        while (n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80); // not within a UTF-8 sequence
        snprintf(out + n, capacity - n, "…");
    }
}

double paragraph(const struct brush *brush, enum face face, struct ui_box box, uint32_t color, const char *text)
{
    double h = ui_text_height(brush->ui, (int)face, text, box.w);
    while (h > box.h && face > FACE_TINY)
        h = ui_text_height(brush->ui, (int)--face, text, box.w);
    ui_text_lines(brush->ui, (int)face, (struct ui_point){box.x, box.y}, box.w, color, text);
    return h;
}

// The face itself, or a smaller one if all of the text fits in that.
static enum face face_that_fits(const struct brush *brush, enum face face, double width, const char *text)
{
    for (enum face f = face; face < FACE_CUE; f--) {
        if (ui_text_width(brush->ui, (int)f, text) <= width)
            return f;
        if (f == FACE_TINY)
            break;
    }
    return face;
}

static void draw_label(const struct brush *brush, enum face wanted, struct ui_box box, uint32_t color, const char *text,
                       bool centred)
{
    char line[260];
    const enum face face = face_that_fits(brush, wanted, box.w, text);
    fit_text(brush, face, box.w, text, line, sizeof line - 4);
    const double x = centred ? box.x + (box.w - ui_text_width(brush->ui, (int)face, line)) / 2 : box.x;
    ui_text(brush->ui, (int)face, (struct ui_point){x, box.y + (box.h - line_height(brush, face)) / 2}, color, line);
}

void label(const struct brush *brush, enum face face, struct ui_box box, uint32_t color, const char *text)
{
    draw_label(brush, face, box, color, text, false);
}

void label_centred(const struct brush *brush, enum face face, struct ui_box box, uint32_t color, const char *text)
{
    draw_label(brush, face, box, color, text, true);
}

static double digit_width(const struct brush *brush) { return ui_text_width(brush->ui, FACE_SMALL, "0"); }

// Draws the time if `draw`; returns its width.
static double run_time(const struct brush *brush, struct ui_point at, uint32_t color, int64_t time_ns, bool draw)
{
    char text[32];
    int64_t tenths = time_ns / 100000000;
    snprintf(text, sizeof text, "%lld:%02lld.%lld", (long long)(tenths / 600), (long long)(tenths / 10 % 60),
             (long long)(tenths % 10));
    double x = at.x;
    for (const char *c = text; *c; c++) {
        const char one[2] = {*c, 0};
        double own = ui_text_width(brush->ui, FACE_SMALL, one),
               cell = *c >= '0' && *c <= '9' ? digit_width(brush) : own;
        if (draw)
            ui_text(brush->ui, FACE_SMALL, (struct ui_point){x + (cell - own) / 2, at.y}, color, one);
        x += cell;
    }
    return x - at.x;
}

void label_time(const struct brush *brush, struct ui_point top_left, uint32_t color, int64_t time_ns)
{
    run_time(brush, top_left, color, time_ns, true);
}

double label_time_width(const struct brush *brush, int64_t time_ns)
{
    return run_time(brush, (struct ui_point){0, 0}, 0, time_ns, false);
}

// ---------------------------------------------------------------- scrolling

static const double SLACK = 12, MORE_H = 26; // dp; a finger that taps moves no farther; chosen by hand

static bool is_in_box(struct ui_box box, double x, double y)
{
    return x >= box.x && x < box.x + box.w && y >= box.y && y < box.y + box.h;
}

static void clamp_scroll(struct scroll *scroll)
{
    scroll->at = fmax(0, fmin(scroll->at, scroll->content_h - scroll->box.h));
}

struct brush scroll_begin(const struct brush *brush, struct scroll *scroll, struct ui_box *box, double content_h)
{
    const struct ui_pointer p = ui_pointer_now(brush->ui);
    if (content_h > box->h)
        box->h -= MORE_H;
    scroll->box = *box;
    scroll->content_h = content_h;
    if (p.down && !scroll->was_down) {
        scroll->moved = false;
        scroll->held = is_in_box(*box, p.x, p.y);
        scroll->grabbed_y = p.y;
        scroll->grabbed_at = scroll->at;
    }
    scroll->held &= p.down;
    scroll->was_down = p.down;
    if (scroll->held) {
        scroll->moved |= fabs(p.y - scroll->grabbed_y) > SLACK;
        if (scroll->moved)
            scroll->at = scroll->grabbed_at + scroll->grabbed_y - p.y;
    }
    clamp_scroll(scroll);
    ui_clip(brush->ui, *box);
    return (struct brush){brush->ui, brush->theme, scroll};
}

void scroll_end(const struct brush *brush, struct scroll *scroll, int more)
{
    char text[48];
    const struct ui_box box = scroll->box;
    ui_unclip(brush->ui);
    if (scroll->content_h <= box.h)
        return;
    const double share = box.h / scroll->content_h, bar = fmax(24, box.h * share);
    const double y = box.y + (box.h - bar) * scroll->at / (scroll->content_h - box.h);
    ui_fill(brush->ui, (struct ui_box){box.x + box.w - 4, y, 4, bar}, 2, faint(brush->theme->text, 0.35));
    snprintf(text, sizeof text, "and %d more", more);
    if (more > 0)
        label_centred(brush, FACE_SMALL, (struct ui_box){box.x, box.y + box.h, box.w, MORE_H}, brush->theme->accent,
                      text);
}

bool scroll_turn(struct scroll *scroll, struct ui_point at, double rows)
{
    if (!is_in_box(scroll->box, at.x, at.y))
        return false;
    scroll->at += rows * TARGET;
    clamp_scroll(scroll);
    return true;
}

void scroll_show(struct scroll *scroll, double y, double h)
{
    scroll->at = fmin(scroll->at, y);
    scroll->at = fmax(scroll->at, y + h - scroll->box.h);
}

void bullet_list(const struct brush *brush, struct scroll *scroll, struct ui_box box, const char *const *lines,
                 int count)
{
    static const double INDENT = 24, BETWEEN = 8;
    double content_h = 0, y = 0;
    int more = 0;
    for (int i = 0; i < count; i++)
        content_h += ui_text_height(brush->ui, FACE_BODY, lines[i], box.w - INDENT - 6) + BETWEEN;
    (void)scroll_begin(brush, scroll, &box, content_h);
    for (int i = 0; i < count; i++) {
        const double h = ui_text_height(brush->ui, FACE_BODY, lines[i], box.w - INDENT - 6),
                     at = box.y + y - scroll->at;
        ui_disc(brush->ui, (struct ui_point){box.x + 8, at + 13}, 3, brush->theme->quiet);
        ui_text_lines(brush->ui, FACE_BODY, (struct ui_point){box.x + INDENT, at}, box.w - INDENT - 6,
                      brush->theme->text, lines[i]);
        y += h + BETWEEN;
        more += at + h > box.y + box.h + 1;
    }
    scroll_end(brush, scroll, more);
}
