// A tablet without a window: the app drawn into memory, for tests that look at its screens.
#pragma once
#include "app/viewer.h"

enum { GLASS_LONG = 1280, GLASS_SHORT = 800 }; // px, of a tablet of 10 inches

struct glass {
    struct gpu *gpu;
    struct gpu_target *target;
    int width, height;
    uint8_t *rgba; // what glass_read has read
    struct viewer viewer;
};

void glass_open(struct glass *g, int width, int height, const struct viewer_options *options);
void glass_close(struct glass *g);

// Pixels for each dp: of the same tablet, whatever number of pixels it has.
double glass_scale(const struct glass *g);

void glass_draw(struct glass *g);

// Leaves the processors to the preparing of the take, while that lasts.
void glass_draw_and_wait(struct glass *g);

// Draws until the take is prepared and its actor is the better one.
void glass_prepare(struct glass *g);

// Draws until the camera's pictures were located (or not), and he has faded in or out.
void glass_wait_located(struct glass *g, bool placed);

// Draws until nothing moves any more: an orbit has come to rest on him, in the room there is for him.
void glass_wait_idle(struct glass *g);

// Pauses at that share of the take.
void glass_seek(struct glass *g, double share);

void glass_read(struct glass *g);

// How many of the pixels read are within `slack` of that colour, 0xRRGGBBAA.
int glass_count_color(const struct glass *g, uint32_t color, int slack);

// Of the pixels read from as many others: mean of the values' differences.
double glass_difference(const struct glass *g, const uint8_t *other);
