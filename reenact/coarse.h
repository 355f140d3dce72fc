// The likeness's surface with a quarter of its triangles, for where its own are finer than the picture: points that
// lie in the same cube of two steps of the volume and hang together within it become one of them, so what is closed
// stays closed and two sides of something thin stay apart. Pure; deterministic.
#pragma once
#include "reenact/coat.h"

struct coarse {
    int32_t *points;   // point_count, numbers of the surface's points
    float (*color)[3]; // of each: the mean of all that it stands for, as in coat.h
    int32_t *corners;  // corner_count, three to a triangle: numbers in `points`
    int point_count, corner_count;
};

// ERR_MEMORY. coarse_free.
MUST_CHECK enum status coarse_make(struct coarse *out, const struct surface *surface, const struct coat *coat);
void coarse_free(struct coarse *c);
