// Watches the pictures of a sensor on a stand: another person who comes in, a sensor that was pushed, one that delivers
// the same picture again and again, no depth, bad light. From a coarse grid of depth samples and their background.
// Pure; no allocation; one frame takes some tens of microseconds.
//
// The background is the farthest depth that a grid cell has shown, outside the actor's mask; what stands in front of it
// without moving for three seconds becomes background. Who is in the picture from the first frame on and does not move
// is therefore not noticed.
#pragma once
#include "base/lens.h"

enum { SCENE_COLUMNS = 80, SCENE_ROWS = 60, SCENE_CELLS = SCENE_COLUMNS * SCENE_ROWS };

struct scene_watch {
    uint16_t background[SCENE_CELLS], last[SCENE_CELLS]; // millimetres; 0: unknown
    uint16_t still[SCENE_CELLS];                         // frames since the cell last changed
    int frames, same_frames, moved_frames;               // of the sensor
};

struct scene_view {
    const struct calibration *calibration;
    const uint8_t *color;  // RGB; NULL: none
    const uint16_t *depth; // millimetres; NULL: none
    const uint8_t *mask;   // not 0: the actor; NULL: no person
    int skipped;           // frames of the sensor since the view before that nobody looked at
};

struct scene_state {
    bool second_person, pushed, frozen, no_depth, dark, bright;
    double luma; // mean grey level of the actor, else of the picture; -1: no colour
};

void scene_watch_reset(struct scene_watch *w);
void scene_watch_next(struct scene_watch *w, const struct scene_view *view, struct scene_state *out);
