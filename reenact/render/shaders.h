// The texts of shaders/, embedded at build time, and the lens as their uniform. Pure.
#pragma once
#include "base/lens.h"
#include "base/status.h"

struct shader_text {
    const char *name; // file name: "actor.vert"
    const char *text; // GLSL ES 3.00
};
extern const struct shader_text shader_texts[];
extern const int shader_text_count;

const char *shader_find(const char *name); // by file name; asserts that it exists

// A lens as the shaders take it (lens.glsl), three vec4s: (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width,
// height).
void lens_uniform(const struct lens *lens, float out[12]);
