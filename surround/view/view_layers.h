// Steps of surround_view_draw.
#pragma once
#include "surround/view/surround_view.h"

// Draws a picture's surface into inverse_z[width * height] (1 / z of the view; negative where it draws nothing; the
// nearest wins). Surfaces that turn their back to the view are left out.
void view_warp(const struct surround_view *view, const struct surround_picture *picture, float *inverse_z);

// Whether the picture sees the world point itself at `at`: 1 yes; 0 something in front hides it; -1 it looks through
// the point at something behind; 2 it knows nothing there. `apart`: share by which distances of one surface may differ.
enum sight { SIGHT_THROUGH = -1, SIGHT_HIDDEN = 0, SIGHT_SEEN = 1, SIGHT_UNKNOWN = 2 };
enum sight picture_sight(const struct surround_picture *picture, const struct picture_point *at, float apart);

// Which depth each pixel has, of `count` layers, each width * height, layer after layer. Fills inverse_z and first.
void view_merge(struct surround_view *view, const struct surround_picture *const *pictures, const float *layers,
                int count, const struct view_options *options);

// Colours; fills rgb and source. ERR_MEMORY.
MUST_CHECK enum status view_texture(struct surround_view *view, const struct surround_picture *const *pictures,
                                    int count, const struct view_options *options);
