// The takes of a recording as cards: name, length, and an image of the actor.
#pragma once
#include "app/ui/screens.h"
#include "capture/recording/recording.h"

struct take_list {
    struct take_card *cards;
    struct gpu_texture **images;
    int count, loaded; // cards before `loaded` have their length and image
    char file[256];    // the recording's name without its folders
};

// Only the names, which are borrowed from `recording`: a take's index may have a million frames. ERR_MEMORY: *l is
// zeroed.
MUST_CHECK enum status take_list_open(struct take_list *l, struct recording *recording, const char *path);
// Completes the next card. A take that cannot be read becomes one without an image. NOTHING: all are complete.
// ERR_MEMORY, ERR_DEVICE.
MUST_CHECK enum status take_list_load(struct take_list *l, struct gpu *gpu, struct recording *recording);
void take_list_close(struct take_list *l); // leaves it zeroed; zeroed is fine
