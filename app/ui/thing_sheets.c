// The sheets of things: finding one by its name, and what is known of it.
#include "app/ui/room_page.h"

#include "app/state/view_state.h"
#include "base/text.h"

#include <math.h>
#include <stdio.h>

static const double ROW = 62, PAD = 14;

static void thing_row(const struct brush *b, const struct room_thing *t, struct ui_box row, double away_m, bool wanted)
{
    char text[64];
    const struct theme *th = b->theme;
    if (wanted)
        ui_fill(b->ui, row, ROUND, faint(th->accent, 0.2));
    label(b, FACE_BODY, (struct ui_box){row.x + 14, row.y + 6, row.w - 28, 28}, wanted ? th->accent : th->text,
          t->name);
    snprintf(text, sizeof text, "%.1f m away%s", away_m, t->gone ? " · not where it stood" : "");
    label(b, FACE_SMALL, (struct ui_box){row.x + 14, row.y + 33, row.w - 28, 22}, th->quiet, text);
}

static void filter_field(const struct brush *b, const struct view_state *s, struct ui_box box)
{
    const struct theme *t = b->theme;
    ui_fill(b->ui, box, box.h / 2, t->raised);
    icon_draw(b->ui, ICON_FIND, (struct ui_point){box.x + 26, box.y + box.h / 2}, 22, t->quiet);
    const bool empty = !s->room.filter[0];
    const struct ui_box in = {box.x + 48, box.y, box.w - 60, box.h};
    label(b, FACE_BODY, in, empty ? t->quiet : t->text, empty ? "Type a name, or choose" : s->room.filter);
    if (!empty) {
        const double x = in.x + fmin(ui_text_width(b->ui, FACE_BODY, s->room.filter), in.w) + 2;
        ui_fill(b->ui, (struct ui_box){x, box.y + 12, 2, box.h - 24}, 0, t->accent);
    }
}

static void find_sheet(const struct brush *b, struct room_ui *ui, struct view_state *s, const struct room_page *page,
                       struct ui_box box, struct vec3 eye, int64_t now_ns)
{
    struct ui_box in = inner(box, PAD), head = cut_top(&in, HEADING);
    if (icon_button(b, "things-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&head, TARGET)))
        view_state_do(s, DO_THINGS, now_ns);
    label(b, FACE_HEAD, (struct ui_box){head.x + 6, head.y, head.w - 6, head.h}, b->theme->text, "Find a thing");
    filter_field(b, s, cut_top(&in, 48));
    if (switch_row(b, "sheet-names", ICON_TAG, "Names in the picture", s->room.names, cut_bottom(&in, SWITCH)))
        view_state_do(s, DO_NAMES, now_ns);
    int rows = 0, first = -1, more = 0;
    for (int i = 0; i < page->count; i++)
        rows += text_contains(page->things[i].name, s->room.filter);
    ui->list.at += s->list_steps * ROW;
    s->list_steps = 0;
    const struct brush inside = scroll_begin(b, &ui->list, &in, rows * ROW);
    for (int i = 0, row = 0; i < page->count; i++) {
        char name[32];
        if (!text_contains(page->things[i].name, s->room.filter))
            continue;
        const double away = v3_distance(page->things[i].world_from_thing.translation, eye);
        const struct ui_box at = {in.x, in.y + row * ROW - ui->list.at, in.w - 6, ROW - 4};
        first = first < 0 ? i : first;
        more += at.y + at.h > in.y + in.h;
        row++;
        if (at.y + at.h < in.y || at.y > in.y + in.h)
            continue;
        thing_row(b, &page->things[i], at, away, i == s->room.wanted);
        snprintf(name, sizeof name, "thing-%d", i);
        if (touch_area(&inside, name, at).tapped)
            view_state_find_thing(s, i, now_ns);
    }
    scroll_end(b, &ui->list, more);
    if (!rows)
        label_centred(b, FACE_BODY, (struct ui_box){in.x, in.y + 20, in.w, 30}, b->theme->quiet,
                      "Nothing of that name");
    if (s->room.enter && first >= 0)
        view_state_find_thing(s, first, now_ns);
    s->room.enter = false;
}

// ---------------------------------------------------------------- what is known

static double passage(const struct brush *b, struct ui_box in, double y, const char *head, const char *text)
{
    const struct theme *t = b->theme;
    if (!text[0])
        return y;
    if (head) {
        label(b, FACE_SMALL, (struct ui_box){in.x, y, in.w, 22}, t->quiet, head);
        y += 23;
    }
    ui_text_lines(b->ui, FACE_BODY, (struct ui_point){in.x, y}, in.w, t->text, text);
    return y + ui_text_height(b->ui, FACE_BODY, text, in.w) + 12;
}

static double pictures(const struct brush *b, const struct thing_card *c, struct ui_box in, double y)
{
    const struct ui_uv_rect whole = {0, 0, 1, 1};
    const double h = fmin(170, (in.w - GAP) / 2);
    double x = in.x;
    if (c->picture) {
        const double w = fmin(h * c->picture_aspect, in.w - h - GAP), own_h = w / c->picture_aspect;
        ui_image(b->ui, c->picture, (struct ui_box){x, y + (h - own_h) / 2, w, own_h}, whole, 10, 0xffffffff);
        x += w + GAP;
    }
    if (c->body) {
        const struct ui_box box = {x, y, h, h};
        ui_fill(b->ui, box, 12, b->theme->raised);
        ui_image(b->ui, c->body, box, whole, 12, 0xffffffff);
        if (!c->is_model)
            label_centred(b, FACE_SMALL, (struct ui_box){x, y + h - 26, h, 24}, b->theme->quiet, "no model kept");
    }
    return c->picture || c->body ? y + h + 14 : y;
}

static double card_text(const struct brush *b, const struct thing_card *c, const struct room_thing *t, struct ui_box in,
                        double y)
{
    char where[128];
    const struct vec3 at = t->world_from_thing.translation;
    y = passage(b, in, y, NULL, c->description);
    y = passage(b, in, y, "Weight", c->weight);
    y = passage(b, in, y, "Material", c->material);
    y = passage(b, in, y, "How to use it", c->instructions);
    y = passage(b, in, y, "Note", c->note);
    const int n = snprintf(where, sizeof where, "%.2f, %.2f, %.2f m", at.x, at.y, at.z);
    if (t->sigma_m > 0)
        snprintf(where + n, sizeof where - (size_t)n, ", to %.0f mm", fmax(1, t->sigma_m * 1e3));
    y = passage(b, in, y, "Where it stands", where);
    ui_text_lines(b->ui, FACE_SMALL, (struct ui_point){in.x, y}, in.w,
                  c->source_warns ? b->theme->warn : b->theme->quiet, c->source);
    return y + ui_text_height(b->ui, FACE_SMALL, c->source, in.w) + 8;
}

static void card_sheet(const struct brush *b, struct room_ui *ui, struct view_state *s, const struct room_page *page,
                       struct ui_box box, int64_t now_ns)
{
    const struct thing_card *c = page->card;
    const int i = s->room.card;
    struct ui_box in = inner(box, PAD), head = cut_top(&in, TARGET), foot = cut_bottom(&in, TARGET);
    if (icon_button(b, "card-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED, cut_right(&head, TARGET)))
        view_state_open_card(s, i, now_ns);
    label(b, FACE_HEAD, (struct ui_box){head.x + 6, head.y, head.w - 6, head.h}, b->theme->text, c->name);
    const bool led = s->room.wanted == i;
    if (text_button(b, "card-find", led ? "Hide the arrow" : "Lead me there", led ? BUTTON_RAISED : BUTTON_MAIN, foot))
        view_state_find_thing(s, i, now_ns);
    ui->text.at += s->list_steps * ROW;
    s->list_steps = 0;
    (void)scroll_begin(b, &ui->text, &in, ui->text_h); // of the last frame: it is known once it was laid out
    const struct ui_box text = {in.x + 6, in.y, in.w - 12, in.h};
    const double from = in.y - ui->text.at, y = pictures(b, c, text, from);
    ui->text_h = card_text(b, c, &page->things[i], text, y) - from;
    scroll_end(b, &ui->text, 0);
}

void thing_sheet_draw(const struct brush *b, struct room_ui *ui, struct view_state *s, const struct room_page *page,
                      struct ui_box box, struct vec3 eye, int64_t now_ns)
{
    panel(b, box, false);
    if (s->sheet == SHEET_THINGS)
        find_sheet(b, ui, s, page, box, eye, now_ns);
    else if (s->sheet == SHEET_CARD && page->card && s->room.card >= 0 && s->room.card < page->count)
        card_sheet(b, ui, s, page, box, now_ns);
    (void)ui_area(b->ui, "sheet", box); // touches do not pass through
}
