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

static double rounding(struct ui_box box) { return fmin(box.w, box.h) / 2; }

// Draws the button's background; returns the colour for its icon or text.
static uint32_t button_ground(const struct brush *b, enum button_kind kind, struct ui_box box,
                              const struct ui_touch *touch)
{
    const struct theme *t = b->theme;
    const double radius = rounding(box);
    uint32_t ink = t->text;
    if (kind == BUTTON_GLASS)
        ui_shadow(b->ui, box, radius, 8, t->shadow);
    switch (kind) {
    case BUTTON_PLAIN: break;
    case BUTTON_RAISED: ui_fill(b->ui, box, radius, t->raised); break;
    case BUTTON_GLASS: ui_fill(b->ui, box, radius, t->glass); break;
    case BUTTON_ON:
        ui_fill(b->ui, box, radius, faint(t->accent, 0.2));
        ink = t->accent;
        break;
    case BUTTON_MAIN:
        ui_fill(b->ui, box, radius, t->accent);
        ink = t->on_accent;
        break;
    }
    if (touch->held && touch->over)
        ui_fill(b->ui, box, radius, faint(t->text, 0.16));
    else if (touch->over)
        ui_fill(b->ui, box, radius, faint(t->text, 0.07));
    return ink;
}

bool icon_button(const struct brush *b, const char *name, enum icon icon, enum button_kind kind, struct ui_box box)
{
    struct ui_touch touch = ui_area(b->ui, name, box);
    uint32_t ink = button_ground(b, kind, box, &touch);
    icon_draw(b->ui, icon, middle(box), fmin(box.w, box.h) * 0.46, ink);
    return touch.tapped;
}

bool text_button(const struct brush *b, const char *name, const char *text, enum button_kind kind, struct ui_box box)
{
    struct ui_touch touch = ui_area(b->ui, name, box);
    uint32_t ink = button_ground(b, kind, box, &touch);
    label_centred(b, FACE_STRONG, box, ink, text);
    return touch.tapped;
}

bool switch_row(const struct brush *b, const char *name, enum icon icon, const char *text, bool on, struct ui_box box)
{
    const struct theme *t = b->theme;
    struct ui_touch touch = ui_area(b->ui, name, box);
    if (touch.over)
        ui_fill(b->ui, box, 12, faint(t->text, touch.held ? 0.12 : 0.05));
    struct ui_box row = {box.x + 5, box.y, box.w - 5, box.h};
    struct ui_box picture = cut_left(&row, 32), lever = cut_right(&row, 48);
    icon_draw(b->ui, icon, middle(picture), 26, on ? t->accent : t->quiet);
    label(b, FACE_BODY, row, t->text, text);
    struct ui_point m = middle(lever);
    struct ui_box groove = {m.x - 24, m.y - 14, 48, 28};
    ui_fill(b->ui, groove, 14, on ? t->accent : faint(t->text, 0.22));
    ui_disc(b->ui, (struct ui_point){groove.x + (on ? 34 : 14), m.y}, 10.5, on ? t->on_accent : t->surface);
    return touch.tapped;
}

struct slide slider(const struct brush *b, const char *name, double share, struct ui_box box)
{
    const struct theme *t = b->theme;
    const double knob = 11;
    struct ui_touch touch = ui_area(b->ui, name, box);
    struct slide slide = {touch.held, share};
    double left = box.x + knob, width = box.w - 2 * knob, y = box.y + box.h / 2;
    if (touch.held)
        slide.share = fmin(fmax((touch.x - knob) / width, 0), 1);
    double x = left + slide.share * width;
    ui_fill(b->ui, (struct ui_box){left - 3, y - 3, width + 6, 6}, 3, faint(t->text, 0.2));
    ui_fill(b->ui, (struct ui_box){left - 3, y - 3, x - left + 3, 6}, 3, t->accent);
    if (touch.held)
        ui_disc(b->ui, (struct ui_point){x, y}, knob + 7, faint(t->accent, 0.25));
    ui_disc(b->ui, (struct ui_point){x, y}, knob, t->accent);
    return slide;
}

void panel(const struct brush *b, struct ui_box box, bool glass)
{
    ui_shadow(b->ui, box, ROUND, 18, b->theme->shadow);
    ui_fill(b->ui, box, ROUND, glass ? b->theme->glass : b->theme->surface);
    ui_border(b->ui, box, ROUND, 1, b->theme->hairline);
}

static double line_height(const struct brush *b, enum face face) { return ui_text_height(b->ui, (int)face, "X", 0); }

// Writes as much of the text as fits into `out`.
static void fit(const struct brush *b, enum face face, double width, const char *text, char *out, size_t capacity)
{
    snprintf(out, capacity, "%s", text);
    size_t n = strlen(out);
    while (n > 0 && ui_text_width(b->ui, (int)face, out) > width) {
        do
            n--;
        while (n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80); // not within a UTF-8 sequence
        snprintf(out + n, capacity - n, "…");
    }
}

void label(const struct brush *b, enum face face, struct ui_box box, uint32_t color, const char *text)
{
    char line[260];
    fit(b, face, box.w, text, line, sizeof line - 4);
    ui_text(b->ui, (int)face, (struct ui_point){box.x, box.y + (box.h - line_height(b, face)) / 2}, color, line);
}

void label_centred(const struct brush *b, enum face face, struct ui_box box, uint32_t color, const char *text)
{
    char line[260];
    fit(b, face, box.w, text, line, sizeof line - 4);
    double width = ui_text_width(b->ui, (int)face, line);
    ui_text(b->ui, (int)face,
            (struct ui_point){box.x + (box.w - width) / 2, box.y + (box.h - line_height(b, face)) / 2}, color, line);
}

static double digit_width(const struct brush *b) { return ui_text_width(b->ui, FACE_SMALL, "0"); }

// Draws the time if `draw`; returns its width.
static double run_time(const struct brush *b, struct ui_point at, uint32_t color, int64_t time_ns, bool draw)
{
    char text[32];
    int64_t tenths = time_ns / 100000000;
    snprintf(text, sizeof text, "%lld:%02lld.%lld", (long long)(tenths / 600), (long long)(tenths / 10 % 60),
             (long long)(tenths % 10));
    double x = at.x;
    for (const char *c = text; *c; c++) {
        const char one[2] = {*c, 0};
        double own = ui_text_width(b->ui, FACE_SMALL, one), cell = *c >= '0' && *c <= '9' ? digit_width(b) : own;
        if (draw)
            ui_text(b->ui, FACE_SMALL, (struct ui_point){x + (cell - own) / 2, at.y}, color, one);
        x += cell;
    }
    return x - at.x;
}

void label_time(const struct brush *b, struct ui_point top_left, uint32_t color, int64_t time_ns)
{
    run_time(b, top_left, color, time_ns, true);
}

double label_time_width(const struct brush *b, int64_t time_ns)
{
    return run_time(b, (struct ui_point){0, 0}, 0, time_ns, false);
}
