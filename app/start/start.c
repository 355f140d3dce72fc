#include "app/start/start.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

static const int64_t CARDS_NS = 50000000; // how long one update may complete cards

static void read_settings(struct start *start, int64_t now_ns)
{
    const struct view_state usual = view_state_start(0, true, now_ns);
    struct settings settings = settings_of(&usual);
    settings_keeper_open(&start->settings, start->options.settings, &settings, start->options.light,
                         start->options.text_size);
    start->state = start_state_new(settings.dark, settings.text_size);
    if (start->options.notice)
        snprintf(start->state.notice, sizeof start->state.notice, "%s", start->options.notice);
}

static void keep_settings(struct start *start)
{
    struct settings now = start->settings.kept;
    now.dark = start->state.dark;
    now.text_size = start->state.text_size;
    settings_keeper_update(&start->settings, &now);
}

enum status start_open(struct start *start, struct gpu *gpu, const struct start_options *options)
{
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    *start = (struct start){.options = *options, .gpu = gpu};
    read_settings(start, clock_now_ns());
    if (!shelf_film_folder(start->film_folder, sizeof start->film_folder))
        start->film_folder[0] = 0;
    const enum status status = shelf_open(&start->shelf, options->recents);
    return status == OK ? ui_open(&start->ui, gpu, &shaders, theme_faces(), FACE_COUNT) : status;
}

void start_close(struct start *start)
{
    shelf_close(&start->shelf);
    ui_close(&start->ui);
    *start = (struct start){0};
}

// ---------------------------------------------------------------- events

static void next_text_size(struct start_state *state)
{
    int next = 0;
    for (int i = 0; i < VIEW_TEXT_SIZES; i++)
        if (state->text_size == view_text_sizes[i])
            next = (i + 1) % VIEW_TEXT_SIZES;
    state->text_size = view_text_sizes[next];
    state->changed = true;
}

static bool handle_key(struct start_state *state, int key)
{
    switch (key) {
    case WINDOW_KEY_ESCAPE:
    case WINDOW_KEY_BACK: start_back(state); break;
    case 'q': start_wish(state, START_WISHES_LEAVE); break;
    case 'f': start_wish(state, START_WISHES_FILM); break;
    case 'b': start_choose_mode(state, START_BESIDE); break;
    case 'c': start_choose_mode(state, START_COMPARE); break;
    case 'd':
        state->dark = !state->dark;
        state->changed = true;
        break;
    case 'y': next_text_size(state); break;
    default: return false;
    }
    return true;
}

bool start_event(struct start *start, const struct window_event *event, double px_per_dp, int64_t now_ns)
{
    struct start_state *state = &start->state;
    if (event->kind == WINDOW_QUIT) {
        start_wish(state, START_WISHES_LEAVE);
        return true;
    }
    if (!input_map_is_meant(&start->input, 0, event)) {
        input_map_forget(&start->input);
        return false;
    }
    if (event->kind == WINDOW_KEY)
        return handle_key(state, event->key);
    if (event->kind == WINDOW_RESIZED || event->kind == WINDOW_SHOWN || event->kind == WINDOW_POINTER_MOVE ||
        event->kind == WINDOW_WHEEL)
        state->changed = true;
    const bool pressed = input_map_event(&start->input, &start->ignored, event, px_per_dp, now_ns);
    state->changed |= pressed;
    return pressed;
}

// ---------------------------------------------------------------- time and drawing

enum status start_update(struct start *start, bool *more)
{
    const int64_t until_ns = clock_now_ns() + CARDS_NS;
    enum status status = OK;
    while (status == OK && clock_now_ns() < until_ns) {
        status = shelf_load(&start->shelf, start->gpu, start->state.first_in_sight, start->state.end_in_sight);
        start->state.changed |= status == OK;
    }
    keep_settings(start);
    *more = status == OK;
    return status == NOTHING ? OK : status;
}

enum status start_draw(struct start *start, const struct viewer_surface *surface, int64_t now_ns)
{
    struct start_state *state = &start->state;
    const struct ui_input input = {
        surface->width,         surface->height,        surface->px_per_dp,        now_ns,
        start->input.pointer_x, start->input.pointer_y, start->input.pointer_down, start->input.pointer_there};
    enum status status = ui_begin(start->ui, &input);
    if (status != OK)
        return status;
    const struct brush brush = {start->ui, theme_of(state->dark), NULL};
    const struct start_page page = {&start->shelf, *start->film_folder ? start->film_folder : NULL,
                                    start->options.sample != NULL};
    state->changed = false;
    (void)scroll_turn(&state->scroll, (struct ui_point){start->input.pointer_x, start->input.pointer_y},
                      -start->input.wheel);
    start->input.wheel = 0;
    start_screen_draw(&brush, state, &page);
    ui_end(start->ui);
    status = ui_draw(start->ui, surface->target, surface->quarter_turns);
    state->changed |= start->input.leaving || ui_letters_wanted(start->ui) || ui_comes_to_rest(start->ui);
    input_map_frame_done(&start->input, 0);
    return status;
}

// ---------------------------------------------------------------- the choice

static void say(struct start *start, const char *sentence)
{
    snprintf(start->state.notice, sizeof start->state.notice, "%s", sentence);
    start->state.changed = true;
}

// It stays on the disk; where it lies in one of the user's folders it is listed again by the next start.
static void forget(struct start *start)
{
    struct shelf_entry *entry = &start->shelf.entries[start->state.chosen];
    char text[300];
    snprintf(text, sizeof text, "%.100s is not listed any more; the recording itself stays where it is", entry->name);
    if (start->options.recents && recent_remove(start->options.recents, entry->path) != OK)
        snprintf(text, sizeof text, "%s", status_message());
    take_list_close(&entry->takes);
    start->shelf.count--;
    memmove(entry, entry + 1, sizeof *entry * (size_t)(start->shelf.count - start->state.chosen));
    start->state.reference = -1;
    say(start, text);
}

// A name that makes itself: the day's recording, into which all its takes go.
static bool name_film(const struct start *start, char *out, size_t capacity)
{
    const time_t now = time(NULL);
    struct tm day;
    char date[32];
    if (!*start->film_folder || !localtime_r(&now, &day) || !strftime(date, sizeof date, "%Y-%m-%d", &day))
        return false;
    return snprintf(out, capacity, "%s/%s.reenact", start->film_folder, date) < (int)capacity;
}

static void take_film(struct start *start, struct start_choice *out)
{
    if (!name_film(start, out->file, sizeof out->file)) {
        say(start, "There is no folder for new recordings: HOME is not set");
        out->wish = START_WISHES_NOTHING;
    } else if (folder_make(start->film_folder) != OK) {
        say(start, status_message());
        out->wish = START_WISHES_NOTHING;
    }
}

void start_drop(struct start *start, const char *path)
{
    if (strlen(path) >= sizeof start->dropped)
        return;
    snprintf(start->dropped, sizeof start->dropped, "%s", path);
    start_wish(&start->state, START_WISHES_RECORDING);
}

static void choose_dropped(struct start *start, struct start_choice *out)
{
    out->mode = out->mode == START_BESIDE ? START_BESIDE : START_WATCH;
    snprintf(out->file, sizeof out->file, "%s", start->dropped);
    start->dropped[0] = 0;
}

static void take_recording(struct start *start, struct start_choice *out)
{
    const struct start_state *state = &start->state;
    const struct shelf_entry *chosen = &start->shelf.entries[state->chosen],
                             *first = state->mode == START_COMPARE ? &start->shelf.entries[state->reference] : chosen;
    if (state->mode == START_COMPARE && first == chosen && first->takes.count == 1) {
        say(start, "It has one take alone: choose another recording as the attempt");
        out->wish = START_WISHES_NOTHING;
        return;
    }
    const struct shelf_entry *unusable = first->loaded && !first->usable ? first : chosen;
    if (unusable->loaded && !unusable->usable) {
        char text[300];
        snprintf(text, sizeof text, "%.100s: %.100s", unusable->name, unusable->words);
        say(start, text);
        out->wish = START_WISHES_NOTHING;
        return;
    }
    snprintf(out->file, sizeof out->file, "%s", first->path);
    snprintf(out->with, sizeof out->with, "%s", chosen->path);
}

void start_take_choice(struct start *start, struct start_choice *out)
{
    struct start_state *state = &start->state;
    *out = (struct start_choice){.wish = state->wish, .mode = state->mode};
    state->wish = START_WISHES_NOTHING;
    switch (out->wish) {
    case START_WISHES_RECORDING:
        if (*start->dropped)
            choose_dropped(start, out);
        else
            take_recording(start, out);
        break;
    case START_WISHES_FILM: take_film(start, out); break;
    case START_WISHES_SAMPLE:
        out->wish = START_WISHES_RECORDING;
        out->mode = START_WATCH;
        snprintf(out->file, sizeof out->file, "%s", start->options.sample);
        break;
    case START_WISHES_FORGET:
        forget(start);
        out->wish = START_WISHES_NOTHING;
        break;
    default: break;
    }
}
