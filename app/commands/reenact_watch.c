// reenact FILE: the viewer. A take in its place, seen through a camera or from an orbit. reenact: the start screen,
// from which recordings are opened and filmed, and to which one comes back.
#include "app/commands/commands.h"
#include "app/commands/start_window.h"
#include "app/commands/studio_window.h"
#include "app/viewer/settings.h"
#include "app/viewer/viewer.h"
#include "base/clamp.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/installed.h"
#include "platform/screen/gpu.h"
#include "platform/screen/window.h"
#include "platform/sensors/source.h"
#include "recording/recording.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct watch_arguments {
    const char *file, *take, *camera, *sensor, *photos; // file NULL: the start screen
    const char *with;                                   // chosen there: whose takes are compared with the file's
    bool fullscreen, light, developer, mirrored, no_body_points, stats, ask, say_in_window;
    int rotate, size[2];
    double dpi, seconds, text; // text: 0: as it was
    enum detail detail;        // DETAIL_COUNT: as it was
};

enum {
    KEY_TAKE = COMMAND_KEY,
    KEY_CAMERA,
    KEY_SENSOR,
    KEY_PHOTOS,
    KEY_FULLSCREEN,
    KEY_LIGHT,
    KEY_MIRRORED,
    KEY_NO_BODY_POINTS,
    KEY_ROTATE,
    KEY_SIZE,
    KEY_DPI,
    KEY_SECONDS,
    KEY_STATS,
    KEY_KNOWLEDGE,
    KEY_SAY_IN_WINDOW,
    KEY_TEXT,
    KEY_DETAIL,
    KEY_DEVELOPER
};

static const struct argp_option options[] = {
    {"take", KEY_TAKE, "NAME", 0, "the take to watch", 0},
    {"camera", KEY_CAMERA, "URI", 0,
     "look through this camera: libcamera, libcamera:N, folder:DIR, or none (default: the first there is)", 0},
    {"sensor", KEY_SENSOR, "URI", 0, "do the move beside the actor, seen by this depth sensor: " SOURCE_SENSOR_URIS, 0},
    {"photos", KEY_PHOTOS, "DIR", 0, "folder for photographs (default: your pictures)", 0},
    {"ask", KEY_KNOWLEDGE, NULL, 0,
     "ask a thing's own server for what is newer when its card is opened (default: only what the recording keeps)", 0},
    {"fullscreen", KEY_FULLSCREEN, NULL, 0, "fill the screen", 0},
    {"light", KEY_LIGHT, NULL, 0, "light colours", 0},
    {"text", KEY_TEXT, "PERCENT", 0, "size of the text and all else on the screen: 100, 125 or 150", 0},
    {"detail", KEY_DETAIL, "LEVEL", 0,
     "what the actor is drawn as: paper, parts, fused, full or auto, as of reenact render (default: what was chosen "
     "last; at first auto)",
     0},
    {"developer", KEY_DEVELOPER, NULL, 0, "offer what developers look at: times of frames, where pixels come from", 0},
    {"mirrored", KEY_MIRRORED, NULL, 0, "the actor with left and right exchanged; with --sensor you are judged by that",
     0},
    {"no-body-points", KEY_NO_BODY_POINTS, NULL, 0, "with --sensor: track from depth alone", 0},
    {"rotate", KEY_ROTATE, "DEGREES", 0, "how the screen is mounted, clockwise: 0, 90, 180 or 270", 0},
    {"size", KEY_SIZE, "WxH", 0, "of the window, pixels (default 1280x800)", 0},
    {"dpi", KEY_DPI, "N", 0, "pixels an inch, where the screen itself does not say", 0},
    {"seconds", KEY_SECONDS, "S", 0, "leave after this time", 0},
    {"say-in-window", KEY_SAY_IN_WINDOW, NULL, 0,
     "where FILE holds nothing to watch, say so in the window: who starts this from a desktop sees no terminal", 0},
    {"stats", KEY_STATS, NULL, 0, "say what the screen shows, and at the end how long each stage took", 0},
    {0},
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct watch_arguments *a = state->input;
    switch (key) {
    case KEY_TAKE: a->take = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_SENSOR: a->sensor = value; return 0;
    case KEY_PHOTOS: a->photos = value; return 0;
    case KEY_FULLSCREEN: a->fullscreen = true; return 0;
    case KEY_LIGHT: a->light = true; return 0;
    case KEY_DEVELOPER: a->developer = true; return 0;
    case KEY_DETAIL:
        a->detail = (enum detail)command_parse_choice(state, "--detail", value, detail_names, DETAIL_COUNT);
        return 0;
    case KEY_TEXT: a->text = command_parse_text_size(state, value); return 0;
    case KEY_MIRRORED: a->mirrored = true; return 0;
    case KEY_NO_BODY_POINTS: a->no_body_points = true; return 0;
    case KEY_KNOWLEDGE: a->ask = true; return 0;
    case KEY_STATS: a->stats = true; return 0;
    case KEY_SAY_IN_WINDOW: a->say_in_window = true; return 0;
    case KEY_DPI: a->dpi = command_parse_number(state, "--dpi", value, 50, 1000); return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.1, 1e6); return 0;
    case KEY_ROTATE:
        a->rotate = (int)command_parse_number(state, "--rotate", value, 0, 270);
        if (a->rotate % 90)
            argp_error(state, "--rotate takes 0, 90, 180 or 270, not '%s'", value);
        return 0;
    case KEY_SIZE: command_parse_size(state, "--size", value, 320, 8192, a->size); return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->file, value); return 0;
    case ARGP_KEY_END:
        if (!a->file && a->take)
            argp_error(state, "--take needs a FILE");
        return 0;
    }
    return ARGP_ERR_UNKNOWN;
}

// The URI of the first camera; "": none.
static const char *find_camera(void)
{
    static struct source_device devices[16];
    int count = 0;
    if (source_devices(devices, (int)COUNT_OF(devices), &count) != OK)
        return "";
    for (int i = 0; i < count && i < (int)COUNT_OF(devices); i++)
        if (!strncmp(devices[i].uri, "libcamera", 9))
            return devices[i].uri;
    return "";
}

enum { MIN_DRAWN_FRAMES = 5 };

struct watch {
    const struct watch_arguments *arguments;
    struct window *screen;
    struct gpu *gpu;
    struct viewer *viewer;
    char *take; // after the graphics device was lost: that was shown
    bool fullscreen, hidden;
    bool closed; // by the window's own button: all of it is left, not only the recording
    int64_t started_ns, shown_ns, until_ns;
    int milestones;        // of those below, how many the screen has shown
    char status_text[512]; // the sentence that the screen shows
    int64_t placed_before; // images with the actor in place when that sentence appeared
};

static void wake_window(void *self) { window_wake(((struct watch *)self)->screen); }

static double px_per_dp(const struct watch *watch)
{
    int width, height;
    window_size(watch->screen, &width, &height);
    const double text_size = viewer_query(watch->viewer).text_size;
    return viewer_px_per_dp_with_text(viewer_px_per_dp(window_dpi(watch->screen)), text_size, width, height);
}

// Prints when, since the program began, the screen first showed something, the actor, and the actor's model.
static void print_milestones(struct watch *watch)
{
    static const char *const names[] = {"a screen", "what the sensor saw", "a whole body", "full"};
    const struct viewer_shown shown = viewer_shown(watch->viewer);
    const bool reached[] = {true, shown.sensor, shown.body, shown.full};
    for (; watch->milestones < (int)COUNT_OF(names) && reached[watch->milestones]; watch->milestones++)
        printf("opening   %s after %.0f ms, %.0f of them at work\n", names[watch->milestones],
               (double)(watch->shown_ns - watch->started_ns) * 1e-6, (double)clock_cpu_ns() * 1e-6);
}

static void surface_of(const struct watch *watch, struct viewer_surface *surface)
{
    *surface =
        (struct viewer_surface){.quarter_turns = window_quarter_turns(watch->screen), .px_per_dp = px_per_dp(watch)};
    window_size(watch->screen, &surface->width, &surface->height);
}

// While the recording is being opened.
static void show_opening(void *self)
{
    struct watch *w = self;
    struct viewer_surface surface;
    surface_of(w, &surface);
    if (viewer_draw_opening(w->viewer, &surface) != OK)
        return; // the first frame will report it
    window_present(w->screen);
    w->shown_ns = clock_now_ns();
    if (w->arguments->stats)
        print_milestones(w);
}

// Whether there is something to watch, before a window opens: who starts this from a shell or a program learns it
// there.
static enum status check_file(const struct watch_arguments *arguments)
{
    struct recording *recording;
    enum status status = recording_open(&recording, arguments->file);
    if (status != OK)
        return status;
    const int count = recording_take_count(recording);
    bool found = !arguments->take;
    for (int i = 0; i < count && !found; i++)
        found = !strcmp(recording_take_name(recording, i), arguments->take);
    if (!count)
        status = fail(ERR_MISSING, "%s holds no take; film one with reenact-capture record", arguments->file);
    else if (!found)
        status = fail(ERR_MISSING, "%s has no take '%s'; reenact-capture info lists those it has", arguments->file,
                      arguments->take);
    recording_free(&recording);
    return status;
}

static struct viewer_options options_of(struct watch *watch)
{
    static char settings[1024];
    const bool keeps = settings_file_path(settings, sizeof settings);
    const struct watch_arguments *a = watch->arguments;
    const char *camera = a->camera;
    if (!camera)
        camera = a->sensor ? "none" : find_camera();
    return (struct viewer_options){.file = a->file,
                                   .take = a->take,
                                   .camera = *camera && strcmp(camera, "none") ? camera : NULL,
                                   .sensor = a->sensor,
                                   .compare_with = a->with,
                                   .no_body_points = a->no_body_points,
                                   .photos = a->photos,
                                   .light = a->light,
                                   .developer = a->developer,
                                   .fullscreen = a->fullscreen,
                                   .settings = keeps ? settings : NULL,
                                   .text_size = a->text,
                                   .detail_given = a->detail < DETAIL_COUNT,
                                   .detail = a->detail < DETAIL_COUNT ? a->detail : DETAIL_AUTO,
                                   .mirrored = a->mirrored,
                                   .ask_knowledge = a->ask,
                                   .opening = show_opening,
                                   .wake = wake_window,
                                   .wake_self = watch};
}

static enum status open_screen(struct watch *watch, bool fullscreen)
{
    const struct watch_arguments *a = watch->arguments;
    const struct window_options screen = {"Reenact", a->size[0], a->size[1], fullscreen, a->rotate / 90, a->dpi};
    const enum status status = window_open(&watch->screen, &screen);
    watch->fullscreen = fullscreen;
    return status == OK ? gpu_adopt(&watch->gpu) : status;
}

// Opens the window, too, where there is none.
static enum status watch_open(struct watch *watch, const struct viewer_options *from)
{
    struct viewer_options how = *from;
    const enum status status = watch->screen ? OK : open_screen(watch, how.fullscreen);
    if (status != OK)
        return status;
    how.refresh_hz = window_refresh_hz(watch->screen);
    return viewer_open(&watch->viewer, watch->gpu, &how);
}

static void watch_close(struct watch *watch)
{
    viewer_close(&watch->viewer);
    gpu_close(&watch->gpu);
    window_close(&watch->screen);
}

// After the graphics device was lost (driver reset, suspend): everything on it is created again, and the take restarts.
static enum status watch_reopen(struct watch *watch)
{
    struct viewer_options again = viewer_options_again(watch->viewer);
    char *take = again.take ? strdup(again.take) : NULL;
    again.take = take;
    watch_close(watch);
    free(watch->take);
    watch->take = take;
    watch->status_text[0] = 0;
    watch->placed_before = 0;
    watch->hidden = false;
    return watch_open(watch, &again);
}

// ---------------------------------------------------------------- the loop

// Handles events until none is left, or one needs a redraw first.
static void handle_events(struct watch *watch, int wait_ms)
{
    for (;;) {
        struct window_event event = window_wait(watch->screen, wait_ms);
        wait_ms = 0;
        if (event.kind == WINDOW_NO_EVENT)
            return;
        watch->closed |= event.kind == WINDOW_QUIT;
        if (event.kind == WINDOW_HIDDEN || event.kind == WINDOW_SHOWN)
            viewer_suspend(watch->viewer, watch->hidden = event.kind == WINDOW_HIDDEN, clock_now_ns());
        if (viewer_event(watch->viewer, &event, px_per_dp(watch), clock_now_ns()))
            return;
    }
}

// Prints what the screen shows when it changes, for tests and logs.
static void print_status_change(struct watch *watch)
{
    const struct viewer_shown so_far = viewer_shown(watch->viewer);
    const char *shown = so_far.hint;
    if (!shown)
        shown = so_far.with_actor > watch->placed_before ? "the actor in place" : watch->status_text;
    if (strcmp(shown, watch->status_text))
        printf("shows     %s\n", shown);
    fflush(stdout);
    snprintf(watch->status_text, sizeof watch->status_text, "%s", shown);
    if (so_far.hint)
        watch->placed_before = so_far.with_actor;
}

static enum status draw_window(struct watch *watch, int64_t now_ns)
{
    struct viewer_surface surface;
    surface_of(watch, &surface);
    const bool fullscreen = viewer_query(watch->viewer).fullscreen;
    if (watch->fullscreen != fullscreen)
        window_fullscreen(watch->screen, watch->fullscreen = fullscreen);
    enum status status = viewer_draw(watch->viewer, &surface, now_ns);
    if (status != OK)
        return status;
    window_present(watch->screen);
    watch->shown_ns = clock_now_ns();
    if (viewer_presented(watch->viewer, watch->shown_ns))
        window_drop_input(watch->screen);
    if (watch->arguments->stats) {
        print_milestones(watch);
        print_status_change(watch);
    }
    return OK;
}

static enum status watch_loop(struct watch *watch)
{
    const int64_t frame_ns = (int64_t)(1e9 / window_refresh_hz(watch->screen));
    int64_t due_ns = 0;
    while (!command_stopped() && !viewer_query(watch->viewer).quit) {
        int64_t now_ns = clock_now_ns();
        int64_t wait_ns = watch->hidden ? 500000000 : due_ns - now_ns;
        if (watch->until_ns && watch->until_ns - now_ns < wait_ns)
            wait_ns = watch->until_ns - now_ns;
        handle_events(watch, (int)((clamp_int64(wait_ns, 0, 500000000) + 999999) / 1000000));
        now_ns = clock_now_ns();
        if (watch->until_ns && now_ns >= watch->until_ns)
            return OK;
        if (watch->hidden)
            continue;
        due_ns = viewer_update(watch->viewer, now_ns);
        window_type(watch->screen, viewer_query(watch->viewer).type);
        if (viewer_query(watch->viewer).draw) {
            enum status status = draw_window(watch, now_ns);
            if (status != OK)
                return status;
        }
        // Animations run at the display's rate, also where presenting does not wait for it.
        if ((viewer_query(watch->viewer).draw || due_ns <= now_ns) && due_ns < watch->shown_ns + frame_ns)
            due_ns = now_ns + frame_ns - (clock_now_ns() - now_ns);
    }
    return OK;
}

// Until the user leaves it. A device that is lost within a few frames is not opened again.
static enum status watch_recording(struct watch *watch, const struct viewer_options *first)
{
    enum status status = watch_open(watch, first);
    if (status == OK)
        status = watch_loop(watch);
    while (status == ERR_DEVICE && watch->viewer && viewer_shown(watch->viewer).frames >= MIN_DRAWN_FRAMES) {
        status = watch_reopen(watch);
        if (status == OK)
            status = watch_loop(watch);
    }
    if (status == OK && watch->arguments->stats) {
        printf("screen    %s, %s\n", window_driver(watch->screen), gpu_renderer(watch->gpu));
        viewer_print_stats(watch->viewer, stdout);
    }
    return status;
}

// ---------------------------------------------------------------- from the start screen

static void note_opened(const char *file)
{
    char recents[RECENT_PATH_BYTES];
    if (recent_file_path(recents, sizeof recents))
        status_ignore(recent_add(recents, file, (int64_t)time(NULL))); // a list that cannot be written is none
}

// The first depth sensor, if there is one.
static bool find_sensor(char *out, size_t bytes)
{
    struct source_device devices[16];
    int count = 0;
    if (source_devices(devices, (int)COUNT_OF(devices), &count) != OK)
        return false;
    for (int i = 0; i < count && i < (int)COUNT_OF(devices); i++)
        if (strncmp(devices[i].uri, "libcamera", 9) != 0)
            return snprintf(out, bytes, "%s", devices[i].uri) < (int)bytes;
    return false;
}

// What the start screen is to say next, or "".
struct notice {
    char text[300];
};

static enum status film(struct watch *watch, const struct start_choice *choice, const char *settings,
                        struct notice *notice)
{
    const struct studio_options how = {.file = choice->file,
                                       .sensor = watch->arguments->sensor,
                                       .settings = settings,
                                       .body_points = !watch->arguments->no_body_points};
    const enum status status = studio_window_run(watch->screen, watch->gpu, &how, watch->until_ns);
    if (status == OK && file_exists(choice->file)) {
        note_opened(choice->file);
        snprintf(notice->text, sizeof notice->text, "The takes are in %.250s", choice->file);
    }
    return status;
}

static enum status open_choice(struct watch *watch, const struct watch_arguments *given,
                               const struct start_choice *choice, struct notice *notice)
{
    char sensor[300];
    struct watch_arguments chosen = *given;
    chosen.file = choice->file;
    chosen.with = choice->mode == START_COMPARE ? choice->with : NULL;
    chosen.sensor = NULL;
    if (choice->mode == START_BESIDE) {
        chosen.sensor = given->sensor;
        if (!chosen.sensor && find_sensor(sensor, sizeof sensor))
            chosen.sensor = sensor;
        if (!chosen.sensor) {
            snprintf(notice->text, sizeof notice->text,
                     "No depth sensor is plugged in; plug one in to do it beside the actor, or watch it");
            return OK;
        }
    }
    note_opened(choice->file);
    watch->arguments = &chosen;
    const struct viewer_options first = options_of(watch);
    const enum status status = watch_recording(watch, &first);
    watch->arguments = given;
    viewer_close(&watch->viewer);
    return status;
}

static enum status start_and_watch(struct watch *watch, const struct watch_arguments *given)
{
    char settings[RECENT_PATH_BYTES], recents[RECENT_PATH_BYTES], sample[FILE_PATH_BYTES];
    const bool keeps = settings_file_path(settings, sizeof settings), notes = recent_file_path(recents, sizeof recents),
               has_sample = installed_sample(sample) != NULL;
    struct notice notice = {""};
    enum status status = open_screen(watch, given->fullscreen);
    while (status == OK && !watch->closed && !command_stopped()) {
        struct start_choice choice;
        const struct start_options how = {.settings = keeps ? settings : NULL,
                                          .recents = notes ? recents : NULL,
                                          .sample = has_sample ? sample : NULL,
                                          .notice = *notice.text ? notice.text : NULL,
                                          .light = given->light,
                                          .text_size = given->text};
        status = start_window_run(watch->screen, watch->gpu, &how, watch->until_ns, &choice);
        notice.text[0] = 0;
        if (status != OK || choice.wish == START_WISHES_LEAVE)
            break;
        if (choice.wish == START_WISHES_FILM)
            status = film(watch, &choice, how.settings, &notice);
        else
            status = open_choice(watch, given, &choice, &notice);
        if (watch->until_ns && clock_now_ns() >= watch->until_ns)
            break;
    }
    return status;
}

int reenact_watch(int argc, char **argv)
{
    static const struct argp argp = {
        options,
        parse_option,
        "[FILE]",
        "Watch a recorded person, life-size, where they stood. Without FILE a start screen opens: recordings to watch, "
        "to do beside and to compare, and filming.\v"
        "Through a camera the actor stands in its picture; without one, or with O, you walk round by dragging and come "
        "nearer with two fingers or the wheel.\n\n"
        "Keys: space play, arrows step, Home and End, - and + speed, L loop, M mirror, B skeleton, X where pixels come "
        "from, I the sensor's picture, T times, 1 front, 2 side, 3 back, 4 above, 0 as at first, Y larger letters, G "
        "move the actor, R put back, P photograph, E names "
        "at the things, W "
        "find a "
        "thing, C map, Z the filmed room, D dark or light, F fullscreen, Escape back, Q leave. A game pad: A play, X "
        "photograph, Y move, shoulders speed, cross step, "
        "sticks walk round, triggers wind.",
        0,
        0,
        0};
    struct watch_arguments given = {.size = {1280, 800}, .detail = DETAIL_COUNT};
    command_parse(&argp, argc, argv, &given);
    struct watch watch = {.arguments = &given, .started_ns = clock_now_ns()};
    command_catch_signals();
    struct failure nothing_to_watch;
    enum status status = given.file ? check_file(&given) : OK;
    failure_keep(&nothing_to_watch, status);
    if (given.seconds > 0)
        watch.until_ns = clock_now_ns() + (int64_t)(given.seconds * 1e9);
    if (!given.file) {
        status = start_and_watch(&watch, &given);
    } else if (status == OK || given.say_in_window) { // before that no camera is looked for
        const struct viewer_options first = options_of(&watch);
        if (status == OK)
            note_opened(given.file);
        status = watch_recording(&watch, &first);
    }
    watch_close(&watch);
    free(watch.take);
    if (status == OK)
        status = failure_restore(&nothing_to_watch);
    else if (given.say_in_window) // no window that could say it, or it failed
        window_say("Reenact", status_message());
    return status == OK ? 0 : command_failed(argv[0]);
}
