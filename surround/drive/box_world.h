// A small world of boxes that a simulated robot drives in, seen by ray casting: its panorama and depth pictures, and
// what its body touches. Colours are a fixed function of the place, so that the same view gives the same picture. Pure.
#pragma once
#include "base/lens.h"

enum { BOX_WORLD_MAX = 32 };

struct box {
    double low[3], high[3]; // metres, world: x, y level, z up
    uint8_t color[3];
    bool inside; // seen from inside: a room's walls, floor and ceiling
};

struct box_world {
    struct box boxes[BOX_WORLD_MAX];
    int count;
};

// What a ray from `from` along unit `ray` meets first: its distance, and its colour where rgb is not NULL. 0: nothing.
double box_world_cast(const struct box_world *world, const double from[3], const double ray[3], uint8_t rgb[3]);

// Equirectangular, width x height, RGB.
void box_world_panorama(const struct box_world *world, struct pose world_from_camera, int width, int height,
                        uint8_t *rgb);

// Millimetres along the optical axis, 0 beyond `range_m`; noise of a structured-light sensor when `seed` is not 0.
void box_world_depth(const struct box_world *world, struct pose world_from_camera, const struct lens *lens,
                     double range_m, uint32_t seed, uint16_t *depth);

// Distance from a body's rectangle (centre at pose, length along x) to the nearest box that reaches into its height;
// negative or 0: they touch.
double box_world_clearance(const struct box_world *world, struct pose world_from_body, const double size_m[3]);
