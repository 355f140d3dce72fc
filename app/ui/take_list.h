// The takes of a recording as cards: name, length, and an image of the actor.
#pragma once
#include "app/ui/screens.h"
#include "recording/recorded_verdict.h"

struct take_list {
    struct take_card *cards;
    struct gpu_texture **images;
    int count;
    char file[256]; // the recording's name without its folders
};

// Only the names, which are borrowed from `recording`: a take's index may have a million frames. ERR_MEMORY: *l is
// zeroed.
MUST_CHECK enum status take_list_open(struct take_list *l, struct recording *recording, const char *path);
// Completes one card more: of those in sight, from `first` to before `end`, or within TAKE_LIST_AHEAD of them, in this
// order. Farther ones give up their images, so that a list of any length holds few. A take that cannot be read becomes
// one without an image. NOTHING: all of these are complete. ERR_MEMORY, ERR_DEVICE.
enum { TAKE_LIST_AHEAD = 24 };
MUST_CHECK enum status take_list_load(struct take_list *l, struct gpu *gpu, struct recording *recording, int first,
                                      int end);

// The card nearest to those in sight that is loaded, can be watched, and whose file keeps no verdict; -1: none.
int take_list_unjudged(const struct take_list *list, int first, int end);
// Its verdict, which stays when the card gives up its image.
void take_list_say(struct take_card *card, const struct take_verdict *verdict);

void take_list_close(struct take_list *list); // leaves it zeroed; zeroed is fine
