#include "app/start/start_screen.h"

#include <math.h>
#include <stdio.h>

static const double BORDER = 32, TITLE = 96, WORDS = 84, CARD_MIN = 260, CARD_MAX = 460, PICTURE = 0.6;

// ---------------------------------------------------------------- state

struct start_state start_state_new(bool dark, double text_size)
{
    return (struct start_state){.dark = dark, .text_size = text_size, .changed = true, .chosen = -1, .reference = -1};
}

void start_choose_mode(struct start_state *state, enum start_mode mode)
{
    state->mode = mode;
    state->reference = -1;
    state->notice[0] = 0;
    state->changed = true;
}

void start_wish(struct start_state *state, enum start_wish wish)
{
    state->wish = wish;
    state->notice[0] = 0;
    state->changed = true;
}

void start_choose_recording(struct start_state *state, int number)
{
    if (state->mode == START_COMPARE && state->reference < 0) {
        state->reference = number;
        state->changed = true;
        return;
    }
    state->chosen = number;
    start_wish(state, START_WISHES_RECORDING);
}

void start_back(struct start_state *state)
{
    if (state->reference >= 0)
        start_choose_mode(state, START_COMPARE);
    else if (state->mode != START_WATCH)
        start_choose_mode(state, START_WATCH);
    else
        start_wish(state, START_WISHES_LEAVE);
}

// ---------------------------------------------------------------- drawing

static const char *title_of(const struct start_state *state)
{
    if (state->mode == START_BESIDE)
        return "Choose what to do beside";
    if (state->mode == START_COMPARE)
        return state->reference < 0 ? "Choose the reference" : "Choose the attempt";
    return "Reenact";
}

static void say_below_title(const struct start_state *state, const struct start_page *page, char *out, size_t bytes)
{
    if (*state->notice)
        snprintf(out, bytes, "%s", state->notice);
    else if (state->reference >= 0)
        snprintf(out, bytes, "%.200s is the reference; the attempt may be in the same recording",
                 page->shelf->entries[state->reference].name);
    else
        snprintf(out, bytes, "%s",
                 page->shelf->count ? "Watch a recording, do it beside the actor, or film a new one"
                                    : "Film a movement, or look at the sample first");
}

// The title, what is said below it, and the buttons for colours and for leaving.
static void draw_head(const struct brush *brush, struct start_state *state, const struct start_page *page,
                      struct ui_box head)
{
    const struct theme *t = brush->theme;
    struct ui_box buttons = {head.x, head.y, head.w, TARGET};
    char text[300];
    if (icon_button(brush, "start-close", (struct icon_words){ICON_CLOSE, "Leave"}, BUTTON_RAISED,
                    cut_right(&buttons, TARGET)))
        start_wish(state, START_WISHES_LEAVE);
    if (icon_button(brush, "start-theme", theme_words(state->dark), BUTTON_RAISED, cut_right(&buttons, TARGET))) {
        state->dark = !state->dark;
        state->changed = true;
    }
    if ((state->mode != START_WATCH || state->reference >= 0) &&
        icon_button(brush, "start-back", (struct icon_words){ICON_BACK, "Back"}, BUTTON_RAISED,
                    cut_right(&buttons, TARGET)))
        start_back(state);
    say_below_title(state, page, text, sizeof text);
    label(brush, FACE_TITLE, (struct ui_box){head.x, head.y, buttons.w, 54}, t->text, title_of(state));
    label(brush, FACE_BODY, (struct ui_box){head.x, head.y + 60, head.w, 28}, *state->notice ? t->warn : t->quiet,
          text);
}

enum { DO_FILM = START_MODES, DO_SAMPLE };

static int list_actions(const struct start_state *state, const struct start_page *page, struct control out[5])
{
    static const char *const names[START_MODES] = {"start-watch", "start-beside", "start-compare"},
                             *const words[START_MODES] = {"Watch", "Do it beside", "Compare two"};
    int count = 0;
    out[count++] = (struct control){"start-film", "Film", BUTTON_MAIN, DO_FILM};
    for (int i = 0; i < START_MODES; i++)
        out[count++] = (struct control){names[i], words[i], (int)state->mode == i ? BUTTON_ON : BUTTON_RAISED, i};
    if (page->has_sample)
        out[count++] = (struct control){"start-sample", "See the sample", BUTTON_RAISED, DO_SAMPLE};
    return count;
}

// Returns the height of the row or rows.
static double draw_actions(const struct brush *brush, struct start_state *state, const struct start_page *page,
                           struct ui_box in)
{
    struct control controls[5];
    const int count = list_actions(state, page, controls);
    const double height = controls_height(brush, controls, count, in.w);
    const int action = controls_draw(brush, controls, count, (struct ui_box){in.x, in.y, in.w, height});
    if (action == DO_FILM || action == DO_SAMPLE)
        start_wish(state, action == DO_FILM ? START_WISHES_FILM : START_WISHES_SAMPLE);
    else if (action >= 0)
        start_choose_mode(state, (enum start_mode)action);
    return height;
}

static void draw_picture(const struct brush *brush, const struct shelf_entry *entry, struct ui_box box)
{
    const struct take_card *card = entry->takes.count ? &entry->takes.cards[0] : NULL;
    if (!card || !card->image) {
        ui_fill(brush->ui, box, ROUND, brush->theme->raised);
        return;
    }
    const double part = fmin(1, card->image_aspect / (box.w / box.h));
    ui_image(brush->ui, card->image, box, (struct ui_uv_rect){0, (1 - part) / 2, 1, (1 + part) / 2}, ROUND, 0xffffffff);
}

// True: touched.
static bool forget_button(const struct brush *brush, int number, struct ui_box box)
{
    char name[32];
    snprintf(name, sizeof name, "start-forget-%d", number);
    return icon_button(brush, name, (struct icon_words){ICON_CLOSE, "Not in this list"}, BUTTON_PLAIN,
                       (struct ui_box){box.x + 8, box.y, TARGET, TARGET});
}

static void draw_card(const struct brush *brush, struct start_state *state, const struct shelf_entry *entry, int number,
                      struct ui_box box)
{
    const struct theme *t = brush->theme;
    const bool is_reference = number == state->reference;
    char name[32];
    struct ui_box picture = {box.x, box.y, box.w, box.h - WORDS};
    snprintf(name, sizeof name, "start-card-%d", number);
    ui_fill(brush->ui, box, ROUND, t->surface);
    draw_picture(brush, entry, picture);
    ui_border(brush->ui, box, ROUND, is_reference ? 3 : 1, is_reference ? t->accent : t->hairline);
    struct ui_box words = {box.x + 18, picture.y + picture.h + 12, box.w - 36, 28};
    if (entry->recent && forget_button(brush, number, cut_right(&words, TARGET))) {
        state->chosen = number;
        start_wish(state, START_WISHES_FORGET);
        return;
    }
    label(brush, FACE_STRONG, words, t->text, entry->name);
    words.y += 30;
    label(brush, FACE_SMALL, words, entry->loaded && !entry->usable ? t->warn : t->quiet, entry->words);
    if (touch_area(brush, name, box).tapped)
        start_choose_recording(state, number);
}

static void draw_cards(const struct brush *outer, struct start_state *state, const struct start_page *page,
                       struct ui_box in)
{
    const int count = page->shelf->count,
              columns = (int)fmax(1, fmin(fmax(count, 1), floor((in.w + MARGIN) / (CARD_MIN + MARGIN))));
    const double w = fmin((in.w - (columns - 1) * MARGIN) / columns, CARD_MAX), h = w * PICTURE + WORDS,
                 row_h = h + MARGIN;
    const int rows = (count + columns - 1) / columns;
    const struct brush brush = scroll_begin(outer, &state->scroll, &in, rows * row_h);
    int hidden = 0;
    for (int i = 0; i < count; i++) {
        const struct ui_box box = {in.x + i % columns * (w + MARGIN), in.y + i / columns * row_h - state->scroll.at, w,
                                   h};
        if (box.y + box.h > in.y && box.y < in.y + in.h)
            draw_card(&brush, state, &page->shelf->entries[i], i, box);
        hidden += i % columns == 0 && box.y + box.h > in.y + in.h + 1;
    }
    scroll_end(outer, &state->scroll, hidden);
    state->first_in_sight = (int)(state->scroll.at / row_h) * columns;
    state->end_in_sight = ((int)((state->scroll.at + in.h) / row_h) + 1) * columns;
}

static void draw_empty(const struct brush *brush, const struct start_page *page, struct ui_box in)
{
    char text[RECENT_PATH_BYTES + 200];
    snprintf(text, sizeof text,
             "Nothing has been recorded on this computer yet.\n\nNew recordings are kept in %s. Files from elsewhere "
             "appear here when they lie in Documents, Downloads or on a memory stick, and when they were opened once.",
             page->film_folder ? page->film_folder : "a folder that you choose");
    paragraph(brush, FACE_BODY, (struct ui_box){in.x, in.y, fmin(in.w, 640), in.h}, brush->theme->quiet, text);
}

void start_screen_draw(const struct brush *brush, struct start_state *state, const struct start_page *page)
{
    const struct ui_box all = {0, 0, ui_width(brush->ui), ui_height(brush->ui)};
    const double border = fmin(BORDER, 0.04 * all.w);
    struct ui_box in = inner(all, border);
    ui_fill(brush->ui, all, 0, brush->theme->ground);
    draw_head(brush, state, page, cut_top(&in, TITLE));
    const double actions = draw_actions(brush, state, page, in);
    (void)cut_top(&in, actions);
    (void)cut_top(&in, GAP);
    if (page->shelf->count)
        draw_cards(brush, state, page, in);
    else
        draw_empty(brush, page, in);
}
