// The live screens without a window: drawn as the app's own loop draws, by a clock that does not run ahead of the film
// that stands in for the person, and an attempt played to its end. Errors fail the test.
#pragma once
#include "tests/support/glass.h"

struct live_glass {
    const char *file, *take, *sensor, *camera; // take NULL: the only one; camera NULL: none
};
void live_glass_open(struct glass *g, int width, int height, const struct live_glass *how);

// Draws what is new until that holds; for two minutes at most.
void live_glass_draw_until(struct glass *g, bool (*done)(const struct glass *g));
void live_glass_draw_what_is_new(struct glass *g);

bool live_glass_sees_person(const struct glass *g);
bool live_glass_is_doing(const struct glass *g);
bool live_glass_is_judged(const struct glass *g);

struct live_tally {
    int frames, different[PART_COUNT], same[PART_COUNT];
    int wrong_pixels; // of the colour for what differs, at most
};
// Starts an attempt, draws it to its end and counts the verdicts; prints them and the findings.
struct live_tally live_glass_do_attempt(struct glass *g);

// Whether a finding of the attempt that is shown holds these words.
bool live_glass_finds(const struct glass *g, const char *words);
