// reenact-capture studio: filming in a window, with coaching.
#include "app/commands/commands.h"
#include "app/commands/studio_window.h"
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
    struct window *window = NULL;
    struct gpu *gpu = NULL;
    struct studio_arguments given = {.size = {1280, 800}};
    command_parse(&argp, argc, argv, &given);
    const struct window_options screen = {"Reenact studio", given.size[0], given.size[1], given.fullscreen, 0,
                                          given.dpi};
    const bool keeps = settings_file_path(settings, sizeof settings);
    enum status status = check_file(given.file);
    if (status == OK)
        status = window_open(&window, &screen);
    if (status == OK)
        status = gpu_adopt(&gpu);
    if (status == OK) {
        const struct studio_options how = {.file = given.file,
                                           .sensor = given.sensor,
                                           .tags = given.tags,
                                           .light = given.light,
                                           .settings = keeps ? settings : NULL,
                                           .text_size = given.text,
                                           .purpose = given.purpose,
                                           .body_points = true};
        command_catch_signals();
        status = studio_window_run(window, gpu, &how,
                                   given.seconds > 0 ? clock_now_ns() + (int64_t)(given.seconds * 1e9) : 0);
    }
    gpu_close(&gpu);
    window_close(&window);
    if (status != OK && given.say_in_window)
        window_say("Reenact Studio", status_message());
    return status == OK ? 0 : command_failed(argv[0]);
}
