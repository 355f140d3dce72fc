// The file of settings: $XDG_CONFIG_HOME/reenact/settings, else ~/.config/reenact/settings; written whole or not at
// all.
#pragma once
#include "app/state/settings.h"

// False: the user has no folder for it, and nothing is kept.
bool settings_file_path(char *out, size_t capacity);

// Changes *settings by what the file says. A file that is missing is none; one that cannot be read, or that holds what
// is no setting, gets one line in *why (else ""), and the rest holds.
void settings_file_read(const char *path, struct settings *settings, char *why, size_t capacity);

// Makes the folder. ERR_IO, ERR_INPUT, ERR_MEMORY.
MUST_CHECK enum status settings_file_write(const char *path, const struct settings *settings);
