// Textures with mipmaps and anisotropic filtering. Albedo: stored as 8-bit sRGB, filtered in linear light. Internal to
// tests/world.
#pragma once
#include "base/status.h"

enum { TEXTURE_LEVELS = 12 };

struct texture {
    int width[TEXTURE_LEVELS], height[TEXTURE_LEVELS];
    uint8_t *level[TEXTURE_LEVELS]; // RGB; level 0 is the finest, all in one block
    int level_count;
};

// ERR_MEMORY. Level 0 is written with texture_set, the others come from texture_finish.
MUST_CHECK enum status texture_make(struct texture *t, int width, int height);
void texture_free(struct texture *t);
void texture_set(struct texture *t, int x, int y, const float linear[3]);
void texture_finish(struct texture *t);

// How far x and y run over a sample along the image's u and v, texels of level 0.
struct texture_footprint {
    float dxdu, dydu, dxdv, dydv;
};

// The filtered albedo at (x, y) in texels of level 0, whose centres are at +0.5. wrap: a repeating tile.
void texture_at(const struct texture *t, double x, double y, const struct texture_footprint *footprint, bool wrap,
                float linear[3]);

float srgb_to_linear(uint8_t value);  // a table
uint8_t linear_to_srgb(float linear); // rounds, clamps; table lookup, off by less than half a grey level

// Deterministic noise.
uint32_t hash_of(uint32_t a, uint32_t b, uint32_t c);
float hash_unit(uint32_t a, uint32_t b, uint32_t c); // [0, 1)
float noise2(float x, float y, uint32_t seed);       // smooth, [0, 1], one bump a unit
float fractal2(float x, float y, int octaves, uint32_t seed);
float noise3(float x, float y, float z, uint32_t seed);
