// A tablet without a window: the app drawn into memory, for tests of its screens. Errors fail the test.
#pragma once
#include "app/viewer/viewer_inside.h"
#include "platform/screen/window.h"

enum { GLASS_LONG = 1280, GLASS_SHORT = 800 }; // px, of a 10-inch tablet

struct glass {
    struct gpu *gpu;
    struct gpu_target *target;
    int width, height;
    uint8_t *rgba; // filled by glass_read
    struct viewer *viewer;
    struct view_state *state;            // the viewer's
    const struct take_view_image *image; // likewise: the actor's picture that was drawn last
    int64_t behind_ns;                   // its clock is so much behind clock_now_ns: see live_glass.h
    int64_t film_frame, film_ns;         // of the film of a person, the newest frame and its instant, by that clock
};

void glass_open(struct glass *g, int width, int height, const struct viewer_options *options);
void glass_close(struct glass *g);

// Pixels per dp of a 10-inch tablet, whatever its number of pixels.
double glass_scale(const struct glass *g);

// The clock by which it is drawn and touched.
int64_t glass_now_ns(const struct glass *g);

void glass_draw(struct glass *g);

// An event of the window, lengths in dp: passed on as the program's loop does. Returns whether to draw before the next.
bool glass_event(struct glass *g, const struct window_event *event);
void glass_press(struct glass *g, int key);             // and draws
void glass_turn_wheel(struct glass *g, double notches); // and draws
void glass_tap(struct glass *g, struct ui_point at);    // a finger, at dp; draws

// Draws, and leaves the processors to the avatar builder while it runs.
void glass_draw_and_wait(struct glass *g);

// Draws until the actor's body is whole, and shown in place of what the sensor saw.
void glass_body(struct glass *g);

// Draws until the take is prepared and its avatar is shown.
void glass_prepare(struct glass *g);

// Draws until the camera's images were localised (or not), and the actor has faded in or out.
void glass_wait_located(struct glass *g, bool placed);

// Draws until nothing moves: the orbit has come to rest on the actor, within the free screen area.
void glass_wait_idle(struct glass *g);

// Pauses at that share of the take.
void glass_seek(struct glass *g, double share);

void glass_read(struct glass *g);

// How many of the pixels read are within `slack` of that colour, 0xRRGGBBAA.
int glass_count_color(const struct glass *g, uint32_t color, int slack);

// Mean absolute difference between the pixels read and `other`.
double glass_difference(const struct glass *g, const uint8_t *other);
