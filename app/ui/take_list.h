// The takes of a recording as cards: name, length, and a picture of the actor.
#pragma once
#include "app/ui/screens.h"
#include "capture/recording/recording.h"

struct library {
    struct take_card *cards;
    struct gpu_texture **pictures;
    int count;
    char file[256]; // the recording's name without its folders
};

// Names are borrowed from `recording`. A take that cannot be read becomes a card
// without a picture. ERR_MEMORY, ERR_DEVICE.
MUST_CHECK enum status library_open(struct library *l, struct gpu *gpu, struct recording *recording, const char *path);
void library_close(struct library *l); // leaves it zeroed; zeroed is fine
