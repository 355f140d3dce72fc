// Colours of world points, by which a picture's view of a point is told from one of what stands before it: a point that
// lies behind a window, or between the leaves of a tree, has from elsewhere another colour than the picture has there
// (photo-consistency; Seitz and Dyer 1999). The scanner that measured a point stood near it and saw it, and so did the
// pictures nearest to it: the colour that most of them have there is the point's. Pure but for memory.
#pragma once
#include "surround/depth/dense_depth.h"

struct point_colors {
    uint8_t (*rgb)[4]; // the fourth: 255 where the pictures agree, 0 where nothing is known
    size_t room;
};

// Replaces what is in *colors. The pictures are placed; their gains are used. ERR_MEMORY.
MUST_CHECK enum status point_colors_make(struct point_colors *colors, const struct world_points *points,
                                         const struct surround_picture *pictures, int count);
void point_colors_free(struct point_colors *colors); // what was zeroed, too

// What a picture's colours are to be multiplied by to be like the points' (its exposure): the median over the points
// within a few metres, which it mostly sees.
void point_colors_gain(const struct surround_picture *p, const struct world_points *points, float gain[3]);

// Whether any of the 3 x 3 pixels around (u, v), times gain, has a point's colour. Of a point without one: true.
bool point_color_agrees(const struct surround_picture *p, int u, int v, const float gain[3], const uint8_t rgb[4]);
