// The page of takes: scrollable cards, one per take.
#include "app/ui/screens.h"

#include <math.h>
#include <stdio.h>

static const double CARD = 320, WIDEST = 520, WORDS = 84, BORDER = 28, HEAD = 148;

static const char *card_remark(const struct take_card *card)
{
    if (card->trouble)
        return card->trouble;
    if (card->judged)
        return card->verdict;
    return card->complete ? "" : "interrupted";
}

// How long it is and what it is worth, as its verdict says everywhere.
static void draw_words(const struct brush *b, const struct take_card *card, struct ui_box at)
{
    char text[200];
    const char *about = card_remark(card);
    if (card->judged && !card->trouble)
        icon_draw(b->ui, card->good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&at, 22)), 18,
                  card->good ? b->theme->accent : b->theme->warn);
    snprintf(text, sizeof text, "%.1f s%s%s", (double)card->length_ns * 1e-9, *about ? " · " : "", about);
    label(b, FACE_SMALL, at, b->theme->quiet, text);
}

static void take_card(const struct brush *b, struct view_state *s, struct screens *screens,
                      const struct take_card *card, int number, struct ui_box box)
{
    const struct theme *t = b->theme;
    char name[32];
    snprintf(name, sizeof name, "take-%d", number);
    struct ui_touch touch = ui_area(b->ui, name, box);
    if (touch.went_down) {
        screens->grabbed_y = touch.y + box.y;
        screens->scrolled_from = screens->scroll;
        screens->scrolling = false;
    }
    if (touch.held) {
        double by = touch.y + box.y - screens->grabbed_y;
        screens->scrolling |= fabs(by) > 12;
        if (screens->scrolling)
            screens->scroll = screens->scrolled_from - by;
    }
    if (touch.tapped && !screens->scrolling)
        view_state_choose_take(s, number);
    struct ui_box picture = {box.x, box.y, box.w, box.h - WORDS};
    ui_shadow(b->ui, box, ROUND, 12, faint(t->shadow, 0.7));
    ui_fill(b->ui, box, ROUND, t->surface);
    if (card->image) { // the image's upper corners are round, the lower ones are not
        double shape = picture.w / picture.h, part = fmin(1, card->image_aspect / shape);
        struct ui_uv_rect shown = {0, (1 - part) / 2, 1, (1 + part) / 2};
        ui_image(b->ui, card->image, picture, shown, ROUND, 0xffffffff);
        ui_image(b->ui, card->image, (struct ui_box){picture.x, picture.y + picture.h - ROUND, picture.w, ROUND},
                 (struct ui_uv_rect){0, shown.v1 - (shown.v1 - shown.v0) * ROUND / picture.h, 1, shown.v1}, 0,
                 0xffffffff);
    }
    ui_disc(b->ui, (struct ui_point){picture.x + picture.w - 40, picture.y + picture.h}, 27, t->accent);
    icon_draw(b->ui, ICON_PLAY, (struct ui_point){picture.x + picture.w - 39, picture.y + picture.h}, 26, t->on_accent);
    ui_border(b->ui, box, ROUND, number == s->take ? 3 : 1, number == s->take ? t->accent : t->hairline);
    label(b, FACE_STRONG, (struct ui_box){box.x + 18, picture.y + picture.h + 12, box.w - 100, 28}, t->text,
          card->name);
    if (card->loaded)
        draw_words(b, card, (struct ui_box){box.x + 18, picture.y + picture.h + 42, box.w - 36, 24});
    if (touch.held && !screens->scrolling)
        ui_fill(b->ui, box, ROUND, faint(t->text, 0.08));
}

void screen_takes_wheel(struct screens *screens, double notches)
{
    static const double NOTCH = 100; // dp
    screens->scroll -= notches * NOTCH;
}

// Scrolls no farther than is needed to have the card at `y` in sight.
static void follow(struct screens *screens, double y, double card_h, double page_h)
{
    screens->scroll = fmin(screens->scroll, y);
    screens->scroll = fmax(screens->scroll, y + card_h - page_h);
}

static void draw_cards(const struct brush *b, struct screens *screens, struct view_state *s,
                       const struct takes_page *page, struct ui_box in)
{
    // As many in a row as fit, and as large as possible.
    int columns = (int)fmax(1, fmin(page->count, floor((in.w + MARGIN) / (CARD + MARGIN))));
    double w = fmin((in.w - (columns - 1) * MARGIN) / columns, WIDEST);
    double h = w * 0.62 + WORDS;
    int rows = (page->count + columns - 1) / columns;
    double most = fmax(0, rows * (h + MARGIN) - in.h + BORDER);
    if (screens->followed != s->take + 1 || s->take_columns != columns)
        follow(screens, s->take / columns * (h + MARGIN), h, in.h);
    screens->followed = s->take + 1;
    s->take_columns = columns;
    screens->scroll = fmin(fmax(screens->scroll, 0), most);
    screens->first_in_sight = (int)(screens->scroll / (h + MARGIN)) * columns;
    screens->end_in_sight = ((int)((screens->scroll + in.h + BORDER) / (h + MARGIN)) + 1) * columns;
    ui_clip(b->ui, (struct ui_box){0, in.y - 8, ui_width(b->ui), in.h + BORDER + 8});
    for (int i = 0; i < page->count; i++) {
        struct ui_box box = {in.x + (i % columns) * (w + MARGIN), in.y + (i / columns) * (h + MARGIN) - screens->scroll,
                             w, h};
        if (box.y + box.h > in.y && box.y < in.y + in.h + BORDER)
            take_card(b, s, screens, &page->cards[i], i, box);
    }
    ui_unclip(b->ui);
}

void screen_takes(const struct brush *b, struct screens *screens, struct view_state *s, const struct takes_page *page,
                  int64_t now_ns)
{
    const struct theme *t = b->theme;
    char text[300];
    struct ui_box all = {0, 0, ui_width(b->ui), ui_height(b->ui)}, in = inner(all, BORDER);
    ui_fill(b->ui, all, 0, t->ground);
    struct ui_box head = cut_top(&in, HEAD - BORDER), buttons = {head.x, head.y, head.w, TARGET};
    if (icon_button(b, "takes-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&buttons, TARGET)))
        view_state_do(s, DO_QUIT, now_ns);
    if (icon_button(b, "takes-theme", theme_words(s->dark), BUTTON_RAISED, cut_right(&buttons, TARGET)))
        view_state_do(s, DO_THEME, now_ns);
    label(b, FACE_TITLE, (struct ui_box){head.x, head.y, buttons.w, 54}, t->text, "Choose a take");
    snprintf(text, sizeof text, page->count == 1 ? "%s · one take" : "%s · %d takes", page->file, page->count);
    label(b, FACE_BODY, (struct ui_box){head.x, head.y + 58, head.w, 28}, t->quiet, text);
    draw_cards(b, screens, s, page, in);
}
