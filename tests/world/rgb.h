// Colours in linear light. Internal to tests/world.
#pragma once
#include "tests/world/numbers.h"
#include "tests/world/texture.h"

struct rgb {
    float r, g, b;
};

// 0xRRGGBB, as it is written on screens.
static inline struct rgb hex(uint32_t code)
{
    return (struct rgb){srgb_to_linear((uint8_t)(code >> 16)), srgb_to_linear((uint8_t)(code >> 8)),
                        srgb_to_linear((uint8_t)code)};
}

static inline struct rgb mix(struct rgb a, struct rgb b, float t)
{
    t = minf(1, maxf(0, t));
    return (struct rgb){a.r + (b.r - a.r) * t, a.g + (b.g - a.g) * t, a.b + (b.b - a.b) * t};
}

static inline struct rgb dim(struct rgb a, float s) { return (struct rgb){a.r * s, a.g * s, a.b * s}; }
