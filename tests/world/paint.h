// Procedural posters, rugs and surface textures of the room, by kind and seed. Internal to tests/world.
#pragma once
#include "tests/world/texture.h"

enum painting {
    PAINTING_LANDSCAPE, // hills under a sun
    PAINTING_CIRCLES,   // quarter circles in squares
    PAINTING_MAP,       // contour lines
    PAINTING_STRIPES,   // rectangles and rules, De Stijl
    PAINTING_NIGHT,     // planets and stars
    PAINTING_WORDS,     // large type
    PAINTING_KIND_COUNT,
    PAINTING_BOOKS = PAINTING_KIND_COUNT,
    PAINTING_RUG,
    PAINTING_WINDOW,
    PAINTING_DOOR,
    PAINTING_DRAWERS,
};

// width_m x height_m at texels of `texel_m`. ERR_MEMORY.
MUST_CHECK enum status paint(struct texture *t, enum painting kind, double width_m, double height_m, double texel_m,
                             uint32_t seed);

// Tiles that repeat, mean about 0.5: wood grain along x, plaster, cardboard.
enum { TILE_TEXELS = 256 };
MUST_CHECK enum status paint_grain(struct texture *t, uint32_t seed);
MUST_CHECK enum status paint_plaster(struct texture *t, uint32_t seed);
