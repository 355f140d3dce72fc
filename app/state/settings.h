// What the user chose and finds again: colours, size of the text, speed, and what is shown. Lines "name value" in a
// small file of the user's; never in a recording. What such a line says wrongly is left out, and the others hold.
#pragma once
#include "app/state/view_state.h"

enum { SETTINGS_BYTES = 512 };

struct settings {
    bool dark, skeleton, inset, filmed, names, loop;
    double text_size, speed;
};

struct settings settings_of(const struct view_state *state);
bool settings_equal(const struct settings *a, const struct settings *b);
void settings_apply(const struct settings *settings, struct view_state *state, int64_t now_ns);

// The text of the file; returns its length.
int settings_write(const struct settings *settings, char out[SETTINGS_BYTES]);
// Changes what the text says. Returns how many lines are no setting or no value of it.
int settings_read(struct settings *settings, const char *text);
