// A recording of the small world's exercise, and a film of another figure who does it with known mistakes, for tests of
// the live screens. Errors abort.
#pragma once
#include "tests/support/film.h"

struct live_rehearsal {
    struct scratch scratch;
    char file[256];   // a recording with a place and the take "exercise"
    char wrong[256];  // folder:… of a sensor that films the mistakes (tests/world/keys.c)
    char right[256];  // folder:… of a sensor that films what the take shows, the same frames
    char camera[256]; // folder:… of a tablet's camera in the same room, without anyone in it, a few images
};

// frames: of 30 a second, of each; scale: of 640 x 480.
struct live_rehearsal live_rehearsal_make(int frames, double scale);
#define LIVE_REHEARSAL_ASIDE_M 0.45 // the mistakes are made so far to the right (x) of where the take was
void live_rehearsal_end(struct live_rehearsal *r);
