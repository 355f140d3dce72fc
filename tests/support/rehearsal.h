// A recording of the small world and a camera that walks in it, for tests of the app. Errors abort.
#pragma once
#include "tests/support/film.h"

struct rehearsal {
    struct scratch scratch;
    char file[256];   // a recording with a place and two takes, "turn" and "once more"
    char camera[256]; // folder:… of a tablet's camera there, a few images
    char blind[256];  // the same camera before a wall without a tag
};

enum { REHEARSAL_FRAMES = 8, REHEARSAL_IMAGES = 4 };

// Makes a folder `name` of a tablet camera's images in that world, or of a wall without a tag where world is NULL.
// scale: of 640 x 480.
void rehearse_camera(const struct scratch *scratch, const char *name, const struct world *world, double scale);
// Replaces the lens in that folder's calibration.json.
void rehearse_lens(const struct scratch *scratch, const char *name, const struct lens *lens);

struct rehearsal rehearsal_make(void);
void rehearsal_end(struct rehearsal *r);
