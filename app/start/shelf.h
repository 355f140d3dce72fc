// The recordings that the start screen offers: those that were opened, and those that lie in the user's folders. Each
// with the picture of a take, how many takes it has and when it was made. One thread, the GPU's.
#pragma once
#include "app/start/recent.h"
#include "app/ui/take_list.h"

struct shelf_entry {
    char path[RECENT_PATH_BYTES]; // absolute
    char name[128];               // the file's, without ".reenact"
    char words[160];              // takes, and when; "": not loaded yet
    int64_t time_s;               // opened or changed last, since 1970
    bool loaded, usable;          // usable: there is a take in it
    bool recent;                  // listed because it was opened: it lies in none of the user's folders
    struct take_list takes;       // whose first card has the picture
};

struct shelf {
    struct shelf_entry *entries;
    int count;
};

// The folder for new recordings: "Reenact" in the user's folder for films (XDG user directories), which need not exist.
// False: the user has none.
bool shelf_film_folder(char *out, size_t capacity);

// Those in `recents` that are still there; then those in the film folder, in Documents, Downloads, on the desktop and
// on memory sticks, at most 500. The newest first. recents: its file; NULL: none. ERR_MEMORY: *out is zeroed.
MUST_CHECK enum status shelf_open(struct shelf *out, const char *recents);
void shelf_close(struct shelf *shelf); // leaves it zeroed; zeroed is fine

// Completes one entry more, of those from `first` to before `end`. One that cannot be read says so. NOTHING: all of
// these are complete. ERR_MEMORY, ERR_DEVICE.
MUST_CHECK enum status shelf_load(struct shelf *shelf, struct gpu *gpu, int first, int end);
