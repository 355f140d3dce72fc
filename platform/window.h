// A window that shows pictures and hears keys, mouse and touch (SDL2). One
// thread, one window.
#pragma once
#include "platform/base.h"

struct window;

// width, height: of the pictures, pixels; the window keeps their shape when it
// is resized. ERR_DEVICE: no display; the sentence says so.
MUST_CHECK enum status window_open(struct window **out, const char *title, int width, int height);
void window_close(struct window **w);

// Shows an RGB picture of the window's picture size. ERR_DEVICE.
MUST_CHECK enum status window_show(struct window *w, const uint8_t *rgb);

struct window_events {
    bool quit;            // closed, Escape or Q
    bool play_pause;      // space
    int steps;            // right minus left arrow keys: frames
    double drag_x, drag_y; // since the last call, shares of the window's width and height
    double zoom;          // wheel notches or spread of two fingers, positive = nearer
};

// What happened since the last call; waits up to wait_ms for something to happen.
struct window_events window_poll(struct window *w, int wait_ms);
