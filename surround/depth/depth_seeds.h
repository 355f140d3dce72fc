// The points that a picture sees, with a local plane each; steps of dense_depth_make.
#pragma once
#include "surround/depth/dense_depth.h"
#include "surround/picture/surround_picture.h"

// ---------------------------------------------------------------- watershed

// Watershed segmentation of an image by flooding from seeds (Meyer 1991). Pure but for memory.

// label[width * height]: the seed's number at seeds, WATERSHED_FREE where it may grow, WATERSHED_BARRED where not.
// Free pixels get the label of the seed that reaches them over the lowest edges of colour, at most `reach` steps away
// (steps along a panorama's row count by their true width) and over no edge above `max_edge` levels of a channel (255:
// over all); the others stay free. ERR_MEMORY.
enum { WATERSHED_FREE = -1, WATERSHED_BARRED = -2 };
MUST_CHECK enum status watershed_grow(const struct surround_picture *picture, int reach, int max_edge, int32_t *label);

// ---------------------------------------------------------------- point colors

// Colours of world points, by which a picture's view of a point is told from one of what stands before it: a point that
// lies behind a window, or between the leaves of a tree, has from elsewhere another colour than the picture has there
// (photo-consistency; Seitz and Dyer 1999). The scanner that measured a point stood near it and saw it, and so did the
// pictures nearest to it: the colour that most of them have there is the point's. Pure but for memory.

struct point_colors {
    uint8_t (*rgb)[4]; // the fourth: 255 where the pictures agree, 0 where nothing is known
    size_t capacity;
};

// Replaces what is in *colors. The pictures are placed; their gains are used. ERR_MEMORY.
MUST_CHECK enum status point_colors_make(struct point_colors *colors, const struct world_points *points,
                                         const struct surround_picture *pictures, int count);
void point_colors_free(struct point_colors *colors); // a zeroed one is fine

// ---------------------------------------------------------------- depth seeds

struct seed {
    int u, v;
    float ray[3];   // unit, camera axes, to the point itself
    float inverse;  // 1 / distance
    float plane[3]; // 1 / distance along a unit ray r is plane . r
    float weight;   // square root of its points' weights, so that one sharp point does not silence all others
    bool hidden;
};

struct depth_seeds {
    struct seed *list;
    int count;
    int32_t *at;     // width * height: index of the pixel's seed, or -1: none, or a hidden one
    int32_t *before; // (width + 1) * (height + 1): seeds above and left (summed-area table)
    float up[3];     // world's up in camera axes
    bool sparse;     // depth_options
};

// The nearest point of each pixel, with the planes fitted and the hidden marked. ERR_MEMORY.
MUST_CHECK enum status depth_seeds_make(struct depth_seeds *seeds, const struct surround_picture *picture,
                                        const struct world_points *points, const struct depth_options *options);
void depth_seeds_free(struct depth_seeds *seeds); // a zeroed one is fine
