// The recordings that the user opened last: lines "seconds path" in a small file of the user's, the newest first. Never
// in a recording. A line that says it wrongly is left out, and the others hold.
#pragma once
#include "base/status.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { RECENT_MAX = 40, RECENT_PATH_BYTES = 1024 };

struct recent_list {
    int count;
    struct recent {
        int64_t opened_s;             // since 1970
        char path[RECENT_PATH_BYTES]; // absolute
    } at[RECENT_MAX];
};

// $XDG_STATE_HOME/reenact/recent, else ~/.local/state/reenact/recent. False: the user has no folder for it, and nothing
// is kept.
bool recent_file_path(char *out, size_t capacity);

// A file that is missing, or that cannot be read, is an empty list.
void recent_read(const char *file, struct recent_list *out);

// The recording is the newest of the list. Makes the file's folder. ERR_IO, ERR_INPUT, ERR_MEMORY.
MUST_CHECK enum status recent_add(const char *file, const char *recording, int64_t now_s);
// It is none of the list any more; the recording itself stays as it is. The same errors.
MUST_CHECK enum status recent_remove(const char *file, const char *recording);
