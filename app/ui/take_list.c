#include "app/ui/take_list.h"

#include "app/ui/screens.h"
#include "base/pixels.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- screen takes

// The page of takes: scrollable cards, one per take.

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
static void draw_words(const struct brush *brush, const struct take_card *card, struct ui_box at)
{
    char text[200];
    const char *about = card_remark(card);
    if (card->judged && !card->trouble)
        icon_draw(brush->ui, card->good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&at, 22)), 18,
                  card->good ? brush->theme->accent : brush->theme->warn);
    snprintf(text, sizeof text, "%.1f s%s%s", (double)card->length_ns * 1e-9, *about ? " · " : "", about);
    label(brush, FACE_SMALL, at, brush->theme->quiet, text);
}

// What a touch does: play it, or compare it; the reference that was chosen is checked.
static enum icon card_icon(const struct take_choice *choice, int number)
{
    if (choice->asked == CHOICE_NONE)
        return ICON_PLAY;
    return choice->asked == CHOICE_ATTEMPT && number == choice->reference && !choice->attempt_count ? ICON_CHECK
                                                                                                    : ICON_COMPARE;
}

static void take_card(const struct brush *brush, struct view_state *state, struct screens *screens,
                      const struct take_card *card, int number, struct ui_box box)
{
    const struct theme *t = brush->theme;
    char name[32];
    snprintf(name, sizeof name, "take-%d", number);
    struct ui_touch touch = ui_area(brush->ui, name, box);
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
        view_state_choose_take(state, number);
    struct ui_box picture = {box.x, box.y, box.w, box.h - WORDS};
    ui_shadow(brush->ui, box, ROUND, 12, faint(t->shadow, 0.7));
    ui_fill(brush->ui, box, ROUND, t->surface);
    if (card->image) { // the image's upper corners are round, the lower ones are not
        double shape = picture.w / picture.h, part = fmin(1, card->image_aspect / shape);
        struct ui_uv_rect shown = {0, (1 - part) / 2, 1, (1 + part) / 2};
        ui_image(brush->ui, card->image, picture, shown, ROUND, 0xffffffff);
        ui_image(brush->ui, card->image, (struct ui_box){picture.x, picture.y + picture.h - ROUND, picture.w, ROUND},
                 (struct ui_uv_rect){0, shown.v1 - (shown.v1 - shown.v0) * ROUND / picture.h, 1, shown.v1}, 0,
                 0xffffffff);
    }
    ui_disc(brush->ui, (struct ui_point){picture.x + picture.w - 40, picture.y + picture.h}, 27, t->accent);
    icon_draw(brush->ui, card_icon(&state->compare, number),
              (struct ui_point){picture.x + picture.w - 39, picture.y + picture.h}, 26, t->on_accent);
    ui_border(brush->ui, box, ROUND, number == state->take ? 3 : 1, number == state->take ? t->accent : t->hairline);
    label(brush, FACE_STRONG, (struct ui_box){box.x + 18, picture.y + picture.h + 12, box.w - 100, 28}, t->text,
          card->name);
    if (card->loaded)
        draw_words(brush, card, (struct ui_box){box.x + 18, picture.y + picture.h + 42, box.w - 36, 24});
    if (touch.held && !screens->scrolling)
        ui_fill(brush->ui, box, ROUND, faint(t->text, 0.08));
}

void screen_takes_wheel(struct screens *screens, double notches)
{
    static const double NOTCH = 100; // dp
    screens->scroll -= notches * NOTCH;
}

// Scrolls no farther than is needed to have the card at `y` in sight.
static void scroll_to_card(struct screens *screens, double y, double card_h, double page_h)
{
    screens->scroll = fmin(screens->scroll, y);
    screens->scroll = fmax(screens->scroll, y + card_h - page_h);
}

static void draw_cards(const struct brush *brush, struct screens *screens, struct view_state *state,
                       const struct takes_page *page, struct ui_box in)
{
    // As many in a row as fit, and as large as possible.
    int columns = (int)fmax(1, fmin(page->count, floor((in.w + MARGIN) / (CARD + MARGIN))));
    double w = fmin((in.w - (columns - 1) * MARGIN) / columns, WIDEST);
    double h = w * 0.62 + WORDS;
    int rows = (page->count + columns - 1) / columns;
    double max = fmax(0, rows * (h + MARGIN) - in.h + BORDER);
    if (screens->followed != state->take + 1 || state->take_columns != columns)
        scroll_to_card(screens, state->take / columns * (h + MARGIN), h, in.h);
    screens->followed = state->take + 1;
    state->take_columns = columns;
    screens->scroll = fmin(fmax(screens->scroll, 0), max);
    screens->first_in_sight = (int)(screens->scroll / (h + MARGIN)) * columns;
    screens->end_in_sight = ((int)((screens->scroll + in.h + BORDER) / (h + MARGIN)) + 1) * columns;
    ui_clip(brush->ui, (struct ui_box){0, in.y - 8, ui_width(brush->ui), in.h + BORDER + 8});
    for (int i = 0; i < page->count; i++) {
        struct ui_box box = {in.x + (i % columns) * (w + MARGIN), in.y + (i / columns) * (h + MARGIN) - screens->scroll,
                             w, h};
        if (box.y + box.h > in.y && box.y < in.y + in.h + BORDER)
            take_card(brush, state, screens, &page->cards[i], i, box);
    }
    ui_unclip(brush->ui);
}

// Begins or ends the choice of two takes; in words where there is room.
static bool compare_button(const struct brush *brush, bool asked, struct ui_box *row)
{
    static const double WIDE = 640, WORDS_W = 150;
    const char *words = asked ? "Cancel" : "Compare";
    const enum button_kind kind = asked ? BUTTON_ON : BUTTON_RAISED;
    if (row->w > WIDE - 2 * TARGET)
        return text_button(brush, "takes-compare", words, kind, cut_right(row, WORDS_W));
    return icon_button(brush, "takes-compare", (struct icon_words){ICON_COMPARE, words}, kind, cut_right(row, TARGET));
}

static const char *takes_title(const struct take_choice *choice)
{
    if (choice->asked == CHOICE_REFERENCE)
        return "Choose the reference";
    return choice->asked == CHOICE_ATTEMPT ? "Choose the attempt" : "Choose a take";
}

void screen_takes(const struct brush *brush, struct screens *screens, struct view_state *state,
                  const struct takes_page *page, int64_t now_ns)
{
    const struct theme *t = brush->theme;
    char text[300];
    struct ui_box all = {0, 0, ui_width(brush->ui), ui_height(brush->ui)}, in = inner(all, BORDER);
    ui_fill(brush->ui, all, 0, t->ground);
    struct ui_box head = cut_top(&in, HEAD - BORDER), buttons = {head.x, head.y, head.w, TARGET};
    if (icon_button(brush, "takes-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&buttons, TARGET)))
        view_state_do(state, DO_QUIT, now_ns);
    if (icon_button(brush, "takes-theme", theme_words(state->dark), BUTTON_RAISED, cut_right(&buttons, TARGET)))
        view_state_do(state, DO_THEME, now_ns);
    const struct take_choice *choice = &state->compare;
    if ((page->count > 1 || choice->attempt_count) && compare_button(brush, choice->asked != CHOICE_NONE, &buttons))
        view_state_do(state, DO_COMPARE, now_ns);
    label(brush, FACE_TITLE, (struct ui_box){head.x, head.y, buttons.w, 54}, t->text, takes_title(choice));
    snprintf(text, sizeof text, page->count == 1 ? "%s · one take" : "%s · %d takes", page->file, page->count);
    if (choice->asked == CHOICE_ATTEMPT && !choice->attempt_count)
        snprintf(text, sizeof text, "%.200s · the reference", page->cards[choice->reference].name);
    label(brush, FACE_BODY, (struct ui_box){head.x, head.y + 58, head.w, 28}, t->quiet, text);
    draw_cards(brush, screens, state, page, in);
}

// ---------------------------------------------------------------- take list

// Reads the colour of the frame for the card: nearest to two fifths of the take that has an image and a skeleton. A
// damaged one is passed over, a few times. False: none.
static bool read_cover(struct take *take, struct take_images *images)
{
    enum { TRIES = 8 };
    int64_t count = take_frame_count(take), wanted = count * 2 / 5;
    int tried = 0;
    for (int64_t away = 0; away < count && tried < TRIES; away++)
        for (int side = -1; side <= 1; side += 2) {
            int64_t i = wanted + side * away;
            if (i < 0 || i >= count || !take_entry(take, i)->has_color || !take_entry(take, i)->has_skeleton)
                continue;
            if (take_read(take, i, TAKE_COLOR, images) == OK && images->color)
                return true;
            tried++;
        }
    return false;
}

// Why the actor cannot be drawn; NULL: it can.
static const char *trouble_with(const struct take *take)
{
    if (take_body(take)->representative_frame < 0)
        return "no person in it";
    return take_calibration(take)->color.width ? NULL : "no colour and no depth";
}

// Uploads the image no larger than a card shows it: of many takes of a large camera they would fill a tablet's memory.
static enum status upload_cover(struct take_list *list, struct gpu *gpu, int number, const uint8_t *rgb,
                                const struct lens *lens)
{
    enum { MAX_PX = 640 }; // of its width
    struct take_card *card = &list->cards[number];
    struct gpu_texture_layout layout = {GPU_RGB8, lens->width, lens->height, GPU_LINEAR};
    uint8_t *small = NULL;
    if (lens->width > MAX_PX) {
        layout.width = MAX_PX;
        layout.height = (int)fmax(1, floor((double)lens->height * MAX_PX / lens->width));
        small = malloc((size_t)layout.width * (size_t)layout.height * 3);
        if (!small)
            return fail(ERR_MEMORY, "no memory for the list of takes");
        image_shrink(rgb, lens->width, lens->height, small, layout.width, layout.height);
    }
    const enum status status = gpu_texture_open(&list->images[number], gpu, &layout, small ? small : rgb);
    free(small);
    card->image = list->images[number];
    card->image_aspect = (double)lens->width / lens->height;
    return status;
}

void take_list_say(struct take_card *card, const struct take_verdict *verdict)
{
    card->judged = true;
    card->good = verdict_is_good(verdict);
    const int used = snprintf(card->verdict, sizeof card->verdict, "%s", verdict_headline(verdict));
    for (int i = 0; i < verdict->count; i++)
        if (verdict_shows_line(verdict, i)) {
            snprintf(card->verdict + used, sizeof card->verdict - (size_t)used, "; %s", verdict->line[i].text);
            break;
        }
}

// What is kept: to judge an older file's take would hold up the screen.
static enum status read_verdict(struct take_card *card, struct recording *recording)
{
    struct take *take;
    struct take_verdict v;
    bool fits = false;
    enum status status = card->judged ? NOTHING : take_open(&take, recording, card->name);
    if (status != OK)
        return status == ERR_MEMORY ? status : OK;
    status = recorded_verdict_read(take, &v, &fits);
    take_close(&take);
    if (status == OK && fits)
        take_list_say(card, &v);
    return status == ERR_MEMORY ? status : OK;
}

static enum status make_card(struct take_list *list, struct gpu *gpu, struct recording *recording, int number)
{
    struct take_card *card = &list->cards[number];
    struct take *take;
    enum status status = take_open_drawn(&take, recording, card->name);
    if (status == ERR_MEMORY)
        return status;
    if (status != OK) { // choosing it will report why
        card->complete = true;
        card->trouble = "damaged";
        return OK;
    }
    int64_t frames = take_frame_count(take);
    card->complete = take_is_complete(take);
    card->trouble = trouble_with(take);
    if (frames > 1)
        card->length_ns = take_entry(take, frames - 1)->time_ns - take_entry(take, 0)->time_ns;
    const struct lens *lens = &take_calibration(take)->color;
    struct take_images images = {0};
    if (read_cover(take, &images))
        status = upload_cover(list, gpu, number, images.color, lens);
    take_close(&take);
    return status == OK ? read_verdict(card, recording) : status;
}

enum status take_list_open(struct take_list *l, struct recording *recording, const char *path)
{
    *l = (struct take_list){.count = recording_take_count(recording)};
    const char *slash = strrchr(path, '/');
    snprintf(l->file, sizeof l->file, "%s", slash ? slash + 1 : path);
    size_t capacity = l->count > 0 ? (size_t)l->count : 1;
    l->cards = calloc(capacity, sizeof *l->cards);
    l->images = calloc(capacity, sizeof(struct gpu_texture *));
    if (!l->cards || !l->images) {
        take_list_close(l);
        return fail(ERR_MEMORY, "no memory for the list of takes");
    }
    for (int i = 0; i < l->count; i++)
        l->cards[i] = (struct take_card){.name = recording_take_name(recording, i)};
    return OK;
}

// How far a card is out of sight, in cards.
static int cards_out_of_sight(int i, int first, int end)
{
    if (i < first)
        return first - i;
    return i >= end ? i + 1 - end : 0;
}

enum status take_list_load(struct take_list *l, struct gpu *gpu, struct recording *recording, int first, int end)
{
    int next = -1;
    for (int i = 0; i < l->count; i++) {
        const int far = cards_out_of_sight(i, first, end);
        if (far > TAKE_LIST_AHEAD && l->images[i]) {
            gpu_texture_close(&l->images[i]);
            l->cards[i].image = NULL;
            l->cards[i].loaded = false;
        }
        if (far <= TAKE_LIST_AHEAD && !l->cards[i].loaded && (next < 0 || far < cards_out_of_sight(next, first, end)))
            next = i;
    }
    if (next < 0)
        return NOTHING;
    l->cards[next].loaded = true;
    return make_card(l, gpu, recording, next);
}

int take_list_unjudged(const struct take_list *list, int first, int end)
{
    int next = -1;
    for (int i = 0; i < list->count; i++) {
        const struct take_card *c = &list->cards[i];
        if (c->loaded && !c->judged && !c->unjudgeable && !c->trouble &&
            (next < 0 || cards_out_of_sight(i, first, end) < cards_out_of_sight(next, first, end)))
            next = i;
    }
    return next;
}

void take_list_close(struct take_list *list)
{
    for (int i = 0; i < list->count && list->images; i++)
        gpu_texture_close(&list->images[i]);
    free(list->cards);
    free(list->images);
    *list = (struct take_list){0};
}
