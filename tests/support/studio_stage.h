// The studio drawn into memory, its keys and buttons pressed, for tests. Errors fail the test.
#pragma once
#include "app/studio/studio.h"
#include "app/viewer/viewer_inside.h"
#include "tests/support/scratch.h"

static const int64_t SECOND = 1000000000;

struct stage {
    struct scratch scratch;
    struct studio studio;
    struct gpu *gpu;
    struct gpu_target *target;
    int width, height;
    int64_t skipped_ns; // added to the clock, so that countdowns take no time
    uint8_t *rgba;
    const char *folder; // for images of the screens; NULL: none
};

// The screen's size, pixels.
void stage_size(struct stage *g, int width, int height);
// One update and one frame.
void stage_draw(struct stage *g);
// Draws until the page is shown and that many frames, and a person in them, were seen; 200 s at most.
void stage_wait_for(struct stage *g, enum studio_page page, int64_t frames);
// How many colours the screen has: tells a picture from a plain page.
int stage_colors(struct stage *g);
// The screen as FOLDER/studio-NAME.png; without a folder nothing.
void stage_save(struct stage *g, const char *name);
// The page wide and upright, dark and light.
void stage_save_all(struct stage *g, const char *page);
void stage_press(struct stage *g, int key);
void stage_type(struct stage *g, const char *text); // at most 31 bytes
int stage_takes_in(const char *file);
void stage_close(struct stage *g);
// A finger on the middle of the control that was drawn there, in dp.
void stage_tap(struct stage *g, double x, double y);
