// The takes of a recording as cards: name, length, and an image of the actor.
#pragma once
#include "app/ui/screens.h"
#include "capture/recording/recording.h"

struct take_list {
    struct take_card *cards;
    struct gpu_texture **images;
    int count;
    char file[256]; // the recording's name without its folders
};

// Names are borrowed from `recording`. A take that cannot be read becomes a card without an image. ERR_MEMORY,
// ERR_DEVICE: *l is zeroed.
MUST_CHECK enum status take_list_open(struct take_list *l, struct gpu *gpu, struct recording *recording,
                                      const char *path);
void take_list_close(struct take_list *l); // leaves it zeroed; zeroed is fine
