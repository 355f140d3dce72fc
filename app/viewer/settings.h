// What the user chose and finds again: colours, size of the text, speed, what is shown, and what the actor is drawn as.
// Lines "name value" in a small file of the user's; never in a recording. What such a line says wrongly is left out,
// and the others hold.
#pragma once
#include "app/state/view_state.h"

// ---------------------------------------------------------------- settings

struct settings {
    bool dark, skeleton, inset, filmed, names, loop;
    double text_size, speed;
    enum detail detail;
};

struct settings settings_of(const struct view_state *state);
bool settings_equal(const struct settings *a, const struct settings *b);
void settings_apply(const struct settings *settings, struct view_state *state, int64_t now_ns);

// Changes what the text says. Returns how many lines are no setting or no value of it.
int settings_read(struct settings *settings, const char *text);

// ---------------------------------------------------------------- their file

// The file of settings: $XDG_CONFIG_HOME/reenact/settings, else ~/.config/reenact/settings; written whole or not at
// all.

// False: the user has no folder for it, and nothing is kept.
bool settings_file_path(char *out, size_t capacity);

// Changes *settings by what the file says. A file that is missing is none; one that cannot be read, or that holds what
// is no setting, gets one line in *why (else ""), and the rest holds.
void settings_file_read(const char *path, struct settings *settings, char *why, size_t capacity);

// Makes the folder. ERR_IO, ERR_INPUT, ERR_MEMORY.
MUST_CHECK enum status settings_file_write(const char *path, const struct settings *settings);

// The file while a program runs: read once, written when something is chosen.
struct settings_keeper {
    const char *path;     // borrowed; NULL: nothing is kept
    struct settings kept; // as the file has them, or would not take them
    bool fails;           // the file cannot be written; said once, on stderr
};
// What the user chose last, in place of *settings, then what this start asks for: light colours, a text size (0: none).
// The file does without the latter until something is chosen. Says on stderr what the file holds that is no setting.
void settings_keeper_open(struct settings_keeper *keeper, const char *path, struct settings *settings, bool light,
                          double text_size);
// Writes the file where something was chosen since.
void settings_keeper_update(struct settings_keeper *keeper, const struct settings *now);
