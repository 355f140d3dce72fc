// A skeleton drawn over an image: limbs of the person's left orange, of the right blue; joints of low confidence thin,
// unknown ones not at all; the truth as thin white lines. For pictures that people look at.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

// A rectangle of an RGB image that is drawn on; what lies outside of it is left alone.
struct drawing {
    uint8_t *rgb;      // of its upper left pixel
    int width, height; // pixels
    int stride;        // pixels from one row to the next
};

// The part of a camera's image that the drawing shows.
struct drawn_window {
    double x0, y0; // its upper left corner, pixels of the image
    double scale;  // the drawing's pixels to one of the image
};

// Depth in mm as brightness, the nearest pixel of the image for each of the drawing.
void drawing_put_depth(const struct drawing *d, const struct lens *lens, const uint16_t *depth,
                       const struct drawn_window *w);
// A line with round ends, pixels of the drawing; a == b is a dot.
void drawing_put_line(const struct drawing *d, struct pixel a, struct pixel b, double radius, const uint8_t rgb[3]);
// Joints in the camera's axes, m. truth: thin and white.
void drawing_put_skeleton(const struct drawing *d, const struct lens *lens, const struct skeleton *s,
                          const struct drawn_window *w, bool truth);
