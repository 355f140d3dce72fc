// The sensor's images in the studio's pages.
#pragma once
#include "app/ui/widgets.h"
#include "base/lens.h"

// Draws the image as large as fits, at the box's upper edge, mirrored as a mirror would show it or not. Returns where
// it is.
struct ui_box studio_picture_draw(const struct brush *brush, const struct gpu_texture *image, const struct lens *lens,
                                  struct ui_box box, bool mirrored);

// Colours for a depth image, RGB: near warm, far cold; no reading hatched. out: 3 * width * height bytes.
void studio_depth_colors(const uint16_t *depth, int width, int height, uint8_t *out);

// What to do now, over the picture's lower edge: readable from four metres.
void studio_hint_draw(const struct brush *brush, enum icon icon, bool warns, const char *text, struct ui_box picture);
