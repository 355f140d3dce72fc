// Smaller copies of images, for thumbnails. Pure; safe from any thread.
#pragma once
#include <stdint.h>

// RGB, 8 bits a channel, rows without padding: `in` of width x height into `out` of w x h, each pixel the mean of those
// it covers. w and h: at least 1, not larger than width and height.
void image_shrink(const uint8_t *in, int width, int height, uint8_t *out, int w, int h);
