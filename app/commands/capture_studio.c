// reenact-capture studio: filming in a window, with coaching.
#include "app/commands/commands.h"
#include "app/studio/studio.h"
#include "base/clamp.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/screen/window.h"
#include "recording/recording.h"

#include <stdio.h>

struct studio_arguments {
    const char *file, *sensor, *tags;
    enum verdict_purpose purpose;
    bool fullscreen, light, say_in_window;
    double text; // 0: as it was
    int size[2]; // of the window, pixels
    double dpi, seconds;
};

enum {
    KEY_SENSOR = COMMAND_KEY,
    KEY_FULLSCREEN,
    KEY_LIGHT,
    KEY_TEXT,
    KEY_SIZE,
    KEY_DPI,
    KEY_SECONDS,
    KEY_TAGS,
    KEY_SAY_IN_WINDOW,
    KEY_FOR
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct studio_arguments *a = state->input;
    switch (key) {
    case KEY_SENSOR: a->sensor = value; return 0;
    case KEY_TAGS: a->tags = value; return 0;
    case KEY_FULLSCREEN: a->fullscreen = true; return 0;
    case KEY_LIGHT: a->light = true; return 0;
    case KEY_TEXT: a->text = command_parse_text_size(state, value); return 0;
    case KEY_DPI: a->dpi = command_parse_number(state, "--dpi", value, 50, 1000); return 0;
    case KEY_SAY_IN_WINDOW: a->say_in_window = true; return 0;
    case KEY_FOR:
        if (!verdict_purpose_named(value, &a->purpose))
            argp_error(state, "--for is compare, watch or both, not '%s'", value);
        return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.1, 1e6); return 0;
    case KEY_SIZE: command_parse_size(state, "--size", value, 320, 8192, a->size); return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->file, value); return 0;
    case ARGP_KEY_END: a->file = a->file ? a->file : "film.reenact"; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

struct studio_run {
    struct window *window;
    struct gpu *gpu;
    struct studio studio;
    int page_shown; // the studio's in its last frame
    bool played;    // the last frame was the player's
};

static void wake_window(void *self) { window_wake(((struct studio_run *)self)->window); }

// Whether the frame shows another page than the one before. What was pressed until now was not meant for this one.
static bool is_other_page(struct studio_run *run)
{
    struct input_map *input = &run->studio.input;
    bool other = run->studio.playing != run->played;
    run->played = run->studio.playing;
    if (run->studio.playing)
        return viewer_presented(run->studio.viewer, clock_now_ns()) || other;
    other |= input->shown_page != run->page_shown;
    if (other)
        input_map_forget(input);
    run->page_shown = input->shown_page;
    return other;
}

static enum status draw_page(struct studio_run *run, double px_per_dp, int64_t now_ns)
{
    struct viewer_surface surface = {.quarter_turns = window_quarter_turns(run->window), .px_per_dp = px_per_dp};
    window_size(run->window, &surface.width, &surface.height);
    enum status status = studio_draw(&run->studio, &surface, now_ns);
    if (status != OK)
        return status;
    window_present(run->window);
    if (is_other_page(run))
        window_drop_input(run->window);
    return OK;
}

static enum status run_event_loop(struct studio_run *run, int64_t until_ns)
{
    int64_t due_ns = 0;
    while (!studio_finished(&run->studio)) {
        int width, height;
        window_size(run->window, &width, &height);
        const double px_per_dp = viewer_px_per_dp_with_text(viewer_px_per_dp(window_dpi(run->window)),
                                                            run->studio.state.text_size, width, height);
        int64_t wait_ns = due_ns - clock_now_ns();
        for (;;) {
            const int wait_ms = (int)clamp_int64(wait_ns / 1000000, 0, 100);
            const struct window_event event = window_wait(run->window, wait_ms);
            wait_ns = 0;
            if (event.kind == WINDOW_NO_EVENT || studio_event(&run->studio, &event, px_per_dp, clock_now_ns()))
                break;
        }
        const int64_t now_ns = clock_now_ns();
        if ((until_ns && now_ns >= until_ns) || command_stopped())
            studio_do(&run->studio.state, STUDIO_QUIT, now_ns);
        due_ns = studio_update(&run->studio, now_ns);
        window_type(run->window, studio_types(&run->studio));
        if (!studio_changed(&run->studio))
            continue;
        enum status status = draw_page(run, px_per_dp, now_ns);
        if (status != OK)
            return status;
        if (run->studio.playing)
            due_ns = now_ns + 16000000;
    }
    return OK;
}

// Before anybody films for it.
static enum status check_file(const char *path)
{
    return file_exists(path) ? recording_check_change(path) : recording_check_new(path);
}

int capture_studio(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"sensor", KEY_SENSOR, "URI", 0, SOURCE_SENSOR_URIS " (default: choose in the window)", 0},
        {"tags", KEY_TAGS, "TAGS.json", 0, "the room's tags, for mapping it (default: tags.json beside FILE)", 0},
        {"for", KEY_FOR, "PURPOSE", 0,
         "what takes are for: compare (turning round is not asked for), watch or both (the default)", 0},
        {"fullscreen", KEY_FULLSCREEN, NULL, 0, "fill the screen", 0},
        {"light", KEY_LIGHT, NULL, 0, "light colours", 0},
        {"text", KEY_TEXT, "PERCENT", 0, "size of the text and all else on the screen: 100, 125 or 150", 0},
        {"size", KEY_SIZE, "WxH", 0, "of the window, pixels (default 1280x800)", 0},
        {"dpi", KEY_DPI, "N", 0, "pixels an inch, where the screen itself does not say", 0},
        {"seconds", KEY_SECONDS, "S", 0, "leave after this time", 0},
        {"say-in-window", KEY_SAY_IN_WINDOW, NULL, 0,
         "say in a window, too, why it cannot begin: who starts this from a desktop sees no terminal", 0},
        {0},
    };
    static const struct argp argp = {
        options,
        parse_option,
        "[FILE]",
        "Films in a window, alone: what the sensor sees, what of you has been seen, what "
        "to do next, and after each take how "
        "it went.\vTakes go into FILE (default: film.reenact), whose place, if any, the "
        "sensor is located in. A hand held "
        "above the head starts and stops.\n\nKeys: space start and stop, M map the "
        "room, P pause and play, R takes in a row, F what they are for, K keep, X discard, U take that back, A once "
        "more, N "
        "rename; while a take plays , and . its new ends, S trim; D dark or light, Y larger letters, "
        "Escape back, Q leave.",
        NULL,
        NULL,
        NULL};
    static char settings[1024];
    static struct studio_run run; // snapshots are too large for the stack
    struct studio_arguments given = {.size = {1280, 800}};
    command_parse(&argp, argc, argv, &given);
    const struct window_options window = {"Reenact studio", given.size[0], given.size[1], given.fullscreen, 0,
                                          given.dpi};
    const bool keeps = settings_file_path(settings, sizeof settings);
    enum status status = check_file(given.file);
    if (status == OK)
        status = window_open(&run.window, &window);
    if (status == OK)
        status = gpu_adopt(&run.gpu);
    if (status == OK) {
        const struct studio_options how = {.file = given.file,
                                           .sensor = given.sensor,
                                           .tags = given.tags,
                                           .light = given.light,
                                           .settings = keeps ? settings : NULL,
                                           .text_size = given.text,
                                           .purpose = given.purpose,
                                           .body_points = true,
                                           .refresh_hz = window_refresh_hz(run.window),
                                           .wake = wake_window,
                                           .wake_self = &run};
        command_catch_signals();
        status = studio_open(&run.studio, run.gpu, &how);
    }
    if (status == OK)
        status = run_event_loop(&run, given.seconds > 0 ? clock_now_ns() + (int64_t)(given.seconds * 1e9) : 0);
    studio_close(&run.studio);
    gpu_close(&run.gpu);
    window_close(&run.window);
    if (status != OK && given.say_in_window)
        window_say("Reenact Studio", status_message());
    return status == OK ? 0 : command_failed(argv[0]);
}
