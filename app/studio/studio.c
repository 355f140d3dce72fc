#include "app/studio/studio.h"

#include "app/studio/studio_screen.h"
#include "base/clock.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- opening

static enum status open_ui(struct studio *studio)
{
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    return ui_open(&studio->ui, studio->gpu, &shaders, theme_faces(), FACE_COUNT);
}

static void list_devices(struct studio *studio, int64_t now_ns)
{
    struct source_device all[STUDIO_DEVICES];
    int count = 0;
    studio->device_count = 0;
    if (source_devices(all, STUDIO_DEVICES, &count) != OK)
        count = 0;
    // Tablets' cameras are listed beside the sensors, and have no depth.
    for (int i = 0; i < count && i < STUDIO_DEVICES; i++)
        if (strncmp(all[i].uri, "libcamera", 9) != 0)
            studio->devices[studio->device_count++] = all[i];
    studio_set_sensors(&studio->state, studio->device_count, now_ns);
}

static int next_number(const char *file)
{
    struct recording *recording = NULL;
    int max = 0;
    if (recording_open(&recording, file) != OK)
        return 1;
    for (int i = 0; i < recording_take_count(recording); i++) {
        const int number = studio_take_number(recording_take_name(recording, i));
        max = number > max ? number : max;
    }
    recording_free(&recording);
    return max + 1;
}

static void read_settings(struct studio *studio, int64_t now_ns)
{
    const struct view_state start = view_state_start(0, true, now_ns);
    struct settings settings = settings_of(&start);
    settings_keeper_open(&studio->settings, studio->options.settings, &settings, studio->options.light,
                         studio->options.text_size);
    studio->state.dark = settings.dark;
    studio->state.text_size = settings.text_size;
}

static void keep_settings(struct studio *studio)
{
    struct settings now = studio->settings.kept;
    now.dark = studio->state.dark;
    now.text_size = studio->state.text_size;
    settings_keeper_update(&studio->settings, &now);
}

enum status studio_open(struct studio *studio, struct gpu *gpu, const struct studio_options *options)
{
    *studio = (struct studio){.options = *options, .gpu = gpu};
    const int64_t now_ns = clock_now_ns();
    studio->state = studio_start(true);
    read_settings(studio, now_ns);
    studio->state.number = next_number(options->file);
    studio->state.purpose = (int)options->purpose;
    enum status status = open_ui(studio);
    if (status == OK && sound_open(&studio->sound) < 0)
        status = ERR_MEMORY;
    if (status != OK)
        return status;
    if (options->sensor) {
        snprintf(studio->devices[0].uri, sizeof studio->devices[0].uri, "%s", options->sensor);
        snprintf(studio->devices[0].name, sizeof studio->devices[0].name, "%s", options->sensor);
        studio->device_count = 1;
        studio_set_sensors(&studio->state, 1, now_ns);
        studio_choose_sensor(&studio->state, 0, now_ns);
    } else {
        list_devices(studio, now_ns);
    }
    return OK;
}

void studio_close(struct studio *studio)
{
    studio_session_close(&studio->session);
    viewer_close(&studio->viewer);
    gpu_texture_close(&studio->color);
    gpu_texture_close(&studio->depth);
    gpu_texture_close(&studio->plan);
    ui_close(&studio->ui);
    studio_snapshot_free(&studio->shown);
    sound_close(&studio->sound);
    free(studio->depth_rgb);
    free(studio->plan_rgb);
    *studio = (struct studio){0};
}

// ---------------------------------------------------------------- commands

static void open_sensor(struct studio *studio, int64_t now_ns)
{
    const struct studio_session_options options = {.sensor = studio->devices[studio->state.sensor].uri,
                                                   .file = studio->options.file,
                                                   .tags = studio->options.tags,
                                                   .wake = studio->options.wake,
                                                   .wake_self = studio->options.wake_self,
                                                   .body_points = studio->options.body_points,
                                                   .purpose = (enum verdict_purpose)studio->state.purpose};
    studio_session_close(&studio->session);
    studio_snapshot_free(&studio->shown);
    studio->gestures = studio->takes_ready = studio->rooms_ready = studio->rooms_not_kept = 0;
    if (studio_session_open(&studio->session, &options) != OK)
        studio_fail(&studio->state, status_message(), now_ns);
}

// The viewer has a ui of its own, and there is one in a process.
static enum status open_playback(struct studio *studio, int64_t now_ns)
{
    const struct viewer_options options = {.file = studio->options.file,
                                           .take = studio->state.take,
                                           .offer_trim = true,
                                           .light = !studio->state.dark,
                                           .settings = studio->options.settings,
                                           .text_size = studio->state.text_size,
                                           .refresh_hz = studio->options.refresh_hz,
                                           .wake = studio->options.wake,
                                           .wake_self = studio->options.wake_self};
    ui_close(&studio->ui);
    studio->playing = true;
    studio->input.shows = false; // behind it comes a new picture
    enum status status = viewer_open(&studio->viewer, studio->gpu, &options);
    if (status == OK)
        return OK;
    studio_do(&studio->state, STUDIO_BACK, now_ns);
    return status;
}

static enum status close_playback(struct studio *studio)
{
    if (!studio->playing)
        return OK;
    if (studio->viewer) { // it could be opened; what was chosen there is in the file
        const struct viewer_wishes wishes = viewer_query(studio->viewer);
        studio->settings = *wishes.keeps;
        studio->state.dark = wishes.dark;
        studio->state.text_size = wishes.text_size;
    }
    viewer_close(&studio->viewer);
    studio->playing = false;
    return open_ui(studio);
}

// Another program has the file for now: it is tried again. Who has left reads it in the terminal.
static void erasure_failed(struct studio *studio, enum status status, int64_t now_ns)
{
    studio_erasure_failed(&studio->state, status_message(), status == ERR_IO, now_ns);
    if (studio->state.quit)
        fprintf(stderr, "reenact-capture studio: %s\n", status_message());
}

static void delete_take(struct studio *studio, int64_t now_ns)
{
    char text[160];
    const char *take = studio->state.erasing.take;
    const enum status status = recording_delete_take(studio->options.file, take, NULL);
    if (status != OK) {
        erasure_failed(studio, status, now_ns);
        return;
    }
    snprintf(text, sizeof text, "%.60s was discarded", take);
    studio_say(&studio->state, text, now_ns);
}

static void rename_take(struct studio *studio, int64_t now_ns)
{
    const bool done = recording_rename_take(studio->options.file, studio->state.take, studio->state.name) == OK;
    if (!done)
        studio_say(&studio->state, status_message(), now_ns);
    studio_renamed(&studio->state, done, now_ns);
}

static void trim_take(struct studio *studio, int64_t now_ns)
{
    char text[160];
    const struct studio_erasure *e = &studio->state.erasing;
    const enum status status = recording_trim_take(studio->options.file, e->take, e->from_ns, e->to_ns, NULL);
    if (status != OK) {
        erasure_failed(studio, status, now_ns);
        return;
    }
    snprintf(text, sizeof text, "%.60s is %.1f s long now", e->take, (double)(e->to_ns - e->from_ns) * 1e-9);
    studio_say(&studio->state, text, now_ns);
    if (studio->session && !strcmp(e->take, studio->state.take)) // whose verdict is shown
        studio_session_judge(studio->session, e->take);
}

static enum status run_command(struct studio *studio, enum studio_command command, int64_t now_ns)
{
    switch (command) {
    case STUDIO_OPEN_SENSOR: open_sensor(studio, now_ns); break;
    case STUDIO_LIST_SENSORS:
        studio_session_close(&studio->session);
        list_devices(studio, now_ns);
        break;
    case STUDIO_BEGIN_TAKE: studio_session_begin(studio->session, studio->state.take); break;
    case STUDIO_END_TAKE: studio_session_end(studio->session); break;
    case STUDIO_DELETE_TAKE: delete_take(studio, now_ns); break;
    case STUDIO_RENAME_TAKE: rename_take(studio, now_ns); break;
    case STUDIO_TRIM_TAKE: trim_take(studio, now_ns); break;
    case STUDIO_CHOOSE_PURPOSE:
        if (studio->session)
            studio_session_choose(studio->session, (enum verdict_purpose)studio->state.purpose);
        break;
    case STUDIO_PAUSE_TAKE: studio_session_pause(studio->session, true); break;
    case STUDIO_RESUME_TAKE: studio_session_pause(studio->session, false); break;
    case STUDIO_BEGIN_SWEEP: studio_session_sweep(studio->session); break;
    case STUDIO_END_SWEEP: studio_session_end_sweep(studio->session, false); break;
    case STUDIO_DROP_SWEEP: studio_session_end_sweep(studio->session, true); break;
    case STUDIO_KEEP_ROOM: studio_session_keep_room(studio->session, true); break;
    case STUDIO_DROP_ROOM: studio_session_keep_room(studio->session, false); break;
    case STUDIO_OPEN_PLAYBACK: return open_playback(studio, now_ns);
    case STUDIO_CLOSE_PLAYBACK: return close_playback(studio);
    case STUDIO_TONE: sound_tone(studio->sound, 660, 0.12); break;
    case STUDIO_TONE_BEGIN: sound_tone(studio->sound, 990, 0.5); break;
    case STUDIO_TONE_END: sound_tone(studio->sound, 440, 0.4); break;
    }
    return OK;
}

// ---------------------------------------------------------------- the session's news

// In a row there is no review: the verdict is said in passing.
static void say_kept(struct studio *studio, int64_t now_ns)
{
    char text[160];
    snprintf(text, sizeof text, "%.40s is kept: %.100s", studio->state.take,
             verdict_headline(&studio->shown.judgement.verdict));
    studio_say(&studio->state, text, now_ns);
}

static void take_news(struct studio *studio, int64_t now_ns)
{
    struct studio_state *state = &studio->state;
    if (!studio->session || !studio_session_read(studio->session, &studio->shown))
        return;
    state->changed = true;
    if (studio->shown.number > 0)
        studio_sensor_ready(state, now_ns);
    if (*studio->shown.points.why_not &&
        !studio->no_points_told) { // once; what is tracked from depth alone is less sure
        char notice[200];
        snprintf(notice, sizeof notice, "Tracked from depth alone: %.150s", studio->shown.points.why_not);
        studio_say(state, notice, now_ns);
        studio->no_points_told = true;
    }
    if (studio->shown.gestures != studio->gestures) {
        studio->gestures = studio->shown.gestures;
        if (state->page == STUDIO_LIVE || state->page == STUDIO_RECORDING)
            studio_do(state, STUDIO_START, now_ns);
    }
    if (studio->shown.doing == STUDIO_DOING_SMOOTH)
        studio_take_finishing(state, now_ns);
    if (studio->shown.takes_ready != studio->takes_ready) {
        studio->takes_ready = studio->shown.takes_ready;
        studio_take_ready(state, studio->shown.judgement.frames, now_ns);
        if (state->page == STUDIO_LIVE && studio->shown.judgement.frames > 0)
            say_kept(studio, now_ns);
    }
    if (studio->shown.doing == STUDIO_DOING_MAP)
        studio_sweep_finishing(state, now_ns);
    if (studio->shown.room.ready != studio->rooms_ready) {
        studio->rooms_ready = studio->shown.room.ready;
        studio_sweep_ready(state, now_ns);
    }
    if (studio->shown.room.not_kept != studio->rooms_not_kept) {
        studio->rooms_not_kept = studio->shown.room.not_kept;
        studio_room_not_kept(state, studio->shown.room.why_not_kept, now_ns);
    }
}

// A sensor that failed: said immediately, but for a take that is still to be kept or discarded, after that.
static void check_sensor(struct studio *studio, int64_t now_ns)
{
    switch (studio->state.page) {
    case STUDIO_OPENING:
    case STUDIO_LIVE:
    case STUDIO_COUNTDOWN:
    case STUDIO_RECORDING:
    case STUDIO_FINISHING:
    case STUDIO_ROOM:
    case STUDIO_ROOM_FINISHING:
        if (studio->session && studio->shown.doing == STUDIO_DOING_FAILED)
            studio_fail(&studio->state, studio->shown.failure, now_ns);
        break;
    default: break;
    }
}

int64_t studio_update(struct studio *studio, int64_t now_ns)
{
    enum studio_command command;
    take_news(studio, now_ns);
    check_sensor(studio, now_ns);
    int64_t next_ns = studio_tick(&studio->state, now_ns);
    while (studio_take_command(&studio->state, &command))
        if (run_command(studio, command, now_ns) != OK)
            studio_say(&studio->state, status_message(), now_ns);
    if (!studio->playing) {
        keep_settings(studio);
        return next_ns;
    }
    const int64_t viewer_ns = viewer_update(studio->viewer, now_ns);
    const struct viewer_wishes wishes = viewer_query(studio->viewer);
    if (wishes.trim) {
        studio->state.trim_from_ns = wishes.trim_from_ns;
        studio->state.trim_to_ns = wishes.trim_to_ns;
        studio_do(&studio->state, STUDIO_TRIM, now_ns);
        return now_ns;
    }
    if (wishes.quit || wishes.to_takes) {
        studio_do(&studio->state, STUDIO_BACK, now_ns);
        return now_ns;
    }
    return viewer_ns < next_ns ? viewer_ns : next_ns;
}

bool studio_changed(const struct studio *studio)
{
    return studio->state.changed || (studio->playing && viewer_query(studio->viewer).draw);
}

bool studio_types(const struct studio *studio)
{
    return studio->playing ? viewer_query(studio->viewer).type : studio->state.page == STUDIO_RENAME;
}

bool studio_finished(const struct studio *studio)
{
    return studio->state.quit && studio->state.page != STUDIO_RECORDING && studio->state.page != STUDIO_FINISHING &&
           studio->state.waiting.kind == ERASES_NOTHING && !studio->state.queued;
}

// ---------------------------------------------------------------- events

static bool handle_key(struct studio *studio, const struct window_event *event, int64_t now_ns)
{
    struct studio_state *state = &studio->state;
    if (state->page == STUDIO_RENAME && event->key != WINDOW_KEY_ESCAPE) {
        if (event->key == WINDOW_KEY_BACKSPACE)
            studio_type_back(state);
        else if (event->key == WINDOW_KEY_ENTER)
            studio_type_done(state, now_ns);
        return true; // letters come as text
    }
    switch (event->key) {
    case WINDOW_KEY_SPACE:
    case WINDOW_KEY_ENTER:
        studio_do(state,
                  state->page == STUDIO_REVIEW || state->page == STUDIO_ROOM_REVIEW || state->page == STUDIO_LEAVING
                      ? STUDIO_KEEP
                      : STUDIO_START,
                  now_ns);
        break;
    case WINDOW_KEY_ESCAPE:
    case WINDOW_KEY_BACK: studio_do(state, STUDIO_BACK, now_ns); break;
    case 'k': studio_do(state, STUDIO_KEEP, now_ns); break;
    case 'x': studio_do(state, STUDIO_DISCARD, now_ns); break;
    case 'a': studio_do(state, STUDIO_RETAKE, now_ns); break;
    case 'p': studio_do(state, state->page == STUDIO_RECORDING ? STUDIO_PAUSE : STUDIO_PLAY, now_ns); break;
    case 'm': studio_do(state, STUDIO_MAP_ROOM, now_ns); break;
    case 'r': studio_do(state, STUDIO_IN_A_ROW, now_ns); break;
    case 'f': studio_do(state, STUDIO_PURPOSE, now_ns); break;
    case 'n': studio_do(state, STUDIO_EDIT_NAME, now_ns); break;
    case 'u': studio_do(state, STUDIO_UNDO, now_ns); break;
    case 'd': studio_do(state, STUDIO_THEME, now_ns); break;
    case 'y': studio_do(state, STUDIO_TEXT_SIZE, now_ns); break;
    case 'q': studio_do(state, STUDIO_QUIT, now_ns); break;
    default: break;
    }
    return true;
}

bool studio_event(struct studio *studio, const struct window_event *event, double px_per_dp, int64_t now_ns)
{
    if (event->kind == WINDOW_QUIT) {
        studio_do(&studio->state, STUDIO_QUIT, now_ns);
        return true;
    }
    if (studio->playing)
        return viewer_event(studio->viewer, event, px_per_dp, now_ns);
    if (!input_map_is_meant(&studio->input, (int)studio->state.page, event)) {
        input_map_forget(&studio->input);
        return false;
    }
    if (event->kind == WINDOW_KEY)
        return handle_key(studio, event, now_ns);
    if (event->kind == WINDOW_TEXT) {
        studio_type(&studio->state, event->text);
        return true;
    }
    if (event->kind == WINDOW_RESIZED || event->kind == WINDOW_SHOWN || event->kind == WINDOW_POINTER_MOVE ||
        event->kind == WINDOW_WHEEL)
        studio->state.changed = true;
    const bool pressed = input_map_event(&studio->input, &studio->ignored, event, px_per_dp, now_ns);
    studio->state.changed |= pressed;
    return pressed;
}

// ---------------------------------------------------------------- drawing

static enum status write_texture(struct studio *studio, struct gpu_texture **texture, const struct lens *lens,
                                 const uint8_t *rgb)
{
    const struct gpu_texture_layout layout = {GPU_RGB8, lens->width, lens->height, GPU_LINEAR};
    return gpu_texture_put(texture, studio->gpu, &layout, rgb);
}

// The sensors that are chosen one after another have pictures of different sizes.
static enum status write_textures(struct studio *studio)
{
    const struct studio_snapshot *shown = &studio->shown;
    const struct lens *depth = &shown->calibration.depth;
    enum status status = OK;
    if (shown->has_color)
        status = write_texture(studio, &studio->color, &shown->calibration.color, shown->color);
    if (status != OK || !shown->has_depth)
        return status;
    if (studio->depth_rgb_pixels != shown->depth_pixels) {
        free(studio->depth_rgb);
        studio->depth_rgb = malloc(3 * shown->depth_pixels + 1);
        studio->depth_rgb_pixels = studio->depth_rgb ? shown->depth_pixels : 0;
        if (!studio->depth_rgb)
            return fail(ERR_MEMORY, "no memory for the depth picture");
    }
    studio_depth_colors(shown->depth, depth->width, depth->height, studio->depth_rgb);
    return write_texture(studio, &studio->depth, depth, studio->depth_rgb);
}

static enum status write_plan(struct studio *studio)
{
    const enum studio_page page = studio->state.page;
    if (page != STUDIO_ROOM && page != STUDIO_ROOM_FINISHING && page != STUDIO_ROOM_REVIEW)
        return OK;
    if (!studio->plan_rgb && !(studio->plan_rgb = malloc(3 * (size_t)ROOM_PLAN_PX * ROOM_PLAN_PX)))
        return fail(ERR_MEMORY, "no memory for the plan of the room");
    const struct lens size = {.width = ROOM_PLAN_PX, .height = ROOM_PLAN_PX};
    room_plan_colors(&studio->shown.room.plan, theme_of(studio->state.dark), studio->plan_rgb);
    studio->plan_part = room_plan_part(&studio->shown.room.plan);
    return write_texture(studio, &studio->plan, &size, studio->plan_rgb);
}

enum status studio_draw(struct studio *studio, const struct viewer_surface *surface, int64_t now_ns)
{
    const int page = (int)studio->state.page; // a button that is touched while it is drawn may lead to another
    studio->state.changed = false;
    if (studio->playing)
        return viewer_draw(studio->viewer, surface, now_ns);
    enum status status = write_textures(studio);
    if (status == OK)
        status = write_plan(studio);
    if (status != OK)
        return status;
    const struct ui_input input = {
        surface->width,          surface->height,         surface->px_per_dp,         now_ns,
        studio->input.pointer_x, studio->input.pointer_y, studio->input.pointer_down, studio->input.pointer_there};
    status = ui_begin(studio->ui, &input);
    if (status != OK)
        return status;
    const struct brush brush = {studio->ui, theme_of(studio->state.dark), NULL};
    if (studio->scrolled != studio->state.page)
        studio->scroll = (struct scroll){0};
    studio->scrolled = studio->state.page;
    (void)scroll_turn(&studio->scroll, (struct ui_point){studio->input.pointer_x, studio->input.pointer_y},
                      -studio->input.wheel);
    studio->input.wheel = 0;
    const struct studio_view view = {studio->options.file, studio->devices,   studio->device_count,
                                     &studio->shown,       studio->color,     studio->depth,
                                     studio->plan,         studio->plan_part, &studio->scroll};
    studio_screen_draw(&brush, &studio->state, &view, now_ns);
    ui_end(studio->ui);
    status = ui_draw(studio->ui, surface->target, surface->quarter_turns);
    studio->state.changed |= studio->input.leaving || ui_letters_wanted(studio->ui) || ui_comes_to_rest(studio->ui);
    input_map_frame_done(&studio->input, page);
    return status;
}
