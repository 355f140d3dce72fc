#include "app/viewer/settings.h"

#include "platform/files/file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- settings

enum { SETTINGS_BYTES = 512 };

struct settings settings_of(const struct view_state *state)
{
    return (struct settings){state->dark,        state->skeleton,       state->inset,
                             state->room.filmed, state->room.names,     state->playback.loop,
                             state->text_size,   state->playback.speed, state->detail};
}

bool settings_equal(const struct settings *a, const struct settings *b)
{
    return a->dark == b->dark && a->skeleton == b->skeleton && a->inset == b->inset && a->filmed == b->filmed &&
           a->names == b->names && a->loop == b->loop && a->text_size == b->text_size && a->speed == b->speed &&
           a->detail == b->detail;
}

void settings_apply(const struct settings *settings, struct view_state *state, int64_t now_ns)
{
    state->dark = settings->dark;
    state->skeleton = settings->skeleton;
    state->inset = settings->inset;
    state->room.filmed = settings->filmed;
    state->room.names = settings->names;
    state->text_size = settings->text_size;
    state->detail = settings->detail;
    playback_set_loop(&state->playback, now_ns, settings->loop);
    playback_set_speed(&state->playback, now_ns, settings->speed);
    state->changed = true;
}

// The text of the file; returns its length.
static int settings_write(const struct settings *settings, char out[SETTINGS_BYTES])
{
    return snprintf(out, SETTINGS_BYTES,
                    "dark %d\nskeleton %d\ninset %d\nfilmed %d\nnames %d\nloop %d\ntext %.2f\nspeed %.2f\ndetail %s\n",
                    settings->dark, settings->skeleton, settings->inset, settings->filmed, settings->names,
                    settings->loop, settings->text_size, settings->speed, detail_names[settings->detail]);
}

// One of those values, and nothing else.
static bool read_choice(const char *text, const double *choices, int count, double *out)
{
    char *end;
    const double value = strtod(text, &end);
    if (end == text || *end)
        return false;
    for (int i = 0; i < count; i++)
        if (fabs(value - choices[i]) < 1e-6) {
            *out = choices[i];
            return true;
        }
    return false;
}

static bool read_detail(const char *text, enum detail *out)
{
    for (int i = 0; i < DETAIL_COUNT; i++)
        if (!strcmp(text, detail_names[i])) {
            *out = (enum detail)i;
            return true;
        }
    return false;
}

static bool read_line(struct settings *settings, char *line)
{
    static const double switches[2] = {0, 1};
    const struct {
        const char *name;
        bool *value;
    } names[] = {{"dark", &settings->dark},     {"skeleton", &settings->skeleton}, {"inset", &settings->inset},
                 {"filmed", &settings->filmed}, {"names", &settings->names},       {"loop", &settings->loop}};
    char *value = strchr(line, ' ');
    double number = 0;
    if (!value)
        return false;
    *value++ = 0;
    if (!strcmp(line, "text"))
        return read_choice(value, view_text_sizes, VIEW_TEXT_SIZES, &settings->text_size);
    if (!strcmp(line, "speed"))
        return read_choice(value, view_speeds, VIEW_SPEEDS, &settings->speed);
    if (!strcmp(line, "detail"))
        return read_detail(value, &settings->detail);
    for (size_t i = 0; i < COUNT_OF(names); i++)
        if (!strcmp(line, names[i].name) && read_choice(value, switches, 2, &number)) {
            *names[i].value = number > 0;
            return true;
        }
    return false;
}

int settings_read(struct settings *settings, const char *text)
{
    int wrong = 0;
    while (*text) {
        char line[64];
        const size_t length = strcspn(text, "\n");
        snprintf(line, sizeof line, "%.*s", (int)(length < sizeof line ? length : sizeof line - 1), text);
        if (length)
            wrong += length >= sizeof line || !read_line(settings, line);
        text += length + (text[length] == '\n');
    }
    return wrong;
}

// ---------------------------------------------------------------- their file

enum { PATH_BYTES = 1024, MAX_BYTES = 4096 }; // a larger file is none of ours

bool settings_file_path(char *out, size_t capacity)
{
    const char *config = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    int length = 0;
    if (config && *config == '/') // relative ones are to be ignored, by the XDG base directory specification
        length = snprintf(out, capacity, "%s/reenact/settings", config);
    else if (home && *home == '/')
        length = snprintf(out, capacity, "%s/.config/reenact/settings", home);
    return length > 0 && (size_t)length < capacity;
}

void settings_file_read(const char *path, struct settings *settings, char *why, size_t capacity)
{
    uint8_t *bytes = NULL;
    size_t count = 0;
    char text[MAX_BYTES + 1];
    *why = 0;
    if (!file_exists(path))
        return;
    if (file_read(path, &bytes, &count) != OK) {
        snprintf(why, capacity, "%s", status_message());
        return;
    }
    const bool fits = count <= MAX_BYTES && !memchr(bytes, 0, count);
    if (fits) {
        memcpy(text, bytes, count);
        text[count] = 0;
    }
    free(bytes);
    const int wrong = fits ? settings_read(settings, text) : 1;
    if (wrong)
        snprintf(why, capacity, "%s holds what is no setting of this version; it is left out", path);
}

enum status settings_file_write(const char *path, const struct settings *settings)
{
    char folder[PATH_BYTES], text[SETTINGS_BYTES];
    snprintf(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    if (slash)
        *slash = 0;
    const enum status status = folder_make(folder);
    if (status != OK)
        return status;
    return file_write(path, text, (size_t)settings_write(settings, text));
}

void settings_keeper_open(struct settings_keeper *keeper, const char *path, struct settings *settings, bool light,
                          double text_size)
{
    char why[512] = "";
    if (path)
        settings_file_read(path, settings, why, sizeof why);
    if (*why)
        fprintf(stderr, "%s\n", why);
    settings->dark &= !light;
    settings->text_size = text_size > 0 ? text_size : settings->text_size;
    *keeper = (struct settings_keeper){.path = path, .kept = *settings};
}

void settings_keeper_update(struct settings_keeper *keeper, const struct settings *now)
{
    if (!keeper->path || keeper->fails || settings_equal(now, &keeper->kept))
        return;
    keeper->kept = *now;
    if (settings_file_write(keeper->path, now) == OK)
        return;
    keeper->fails = true;
    fprintf(stderr, "what is chosen is not kept: %s\n", status_message());
}
