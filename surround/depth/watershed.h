// Watershed segmentation of an image by flooding from seeds (Meyer 1991). Pure but for memory.
#pragma once
#include "surround/picture/surround_picture.h"

// label[width * height]: the seed's number at seeds, WATERSHED_FREE where it may grow, WATERSHED_BARRED where not.
// Free pixels get the label of the seed that reaches them over the lowest edges of colour, at most `reach` steps away
// (steps along a panorama's row count by their true width) and over no edge above `most_edge` levels of a channel (255:
// over all); the others stay free. ERR_MEMORY.
enum { WATERSHED_FREE = -1, WATERSHED_BARRED = -2 };
MUST_CHECK enum status watershed_grow(const struct surround_picture *p, int reach, int most_edge, int32_t *label);
