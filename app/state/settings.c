#include "app/state/settings.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct settings settings_of(const struct view_state *state)
{
    return (struct settings){state->dark,       state->skeleton,      state->inset,     state->room.filmed,
                             state->room.names, state->playback.loop, state->text_size, state->playback.speed};
}

bool settings_equal(const struct settings *a, const struct settings *b)
{
    return a->dark == b->dark && a->skeleton == b->skeleton && a->inset == b->inset && a->filmed == b->filmed &&
           a->names == b->names && a->loop == b->loop && a->text_size == b->text_size && a->speed == b->speed;
}

void settings_apply(const struct settings *settings, struct view_state *state, int64_t now_ns)
{
    state->dark = settings->dark;
    state->skeleton = settings->skeleton;
    state->inset = settings->inset;
    state->room.filmed = settings->filmed;
    state->room.names = settings->names;
    state->text_size = settings->text_size;
    playback_set_loop(&state->playback, now_ns, settings->loop);
    playback_set_speed(&state->playback, now_ns, settings->speed);
    state->changed = true;
}

int settings_write(const struct settings *settings, char out[SETTINGS_BYTES])
{
    return snprintf(out, SETTINGS_BYTES,
                    "dark %d\nskeleton %d\ninset %d\nfilmed %d\nnames %d\nloop %d\ntext %.2f\nspeed %.2f\n",
                    settings->dark, settings->skeleton, settings->inset, settings->filmed, settings->names,
                    settings->loop, settings->text_size, settings->speed);
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
