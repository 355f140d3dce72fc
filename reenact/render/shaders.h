// The texts of shaders/, embedded at build time, and what several programs share: the depth range, the lens as a
// uniform, the mesh for fullscreen.vert. Threads and errors as in platform/screen/gpu.h.
#pragma once
#include "base/lens.h"
#include "platform/screen/gpu.h"

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

// Nearest and farthest z drawn, metres: one depth range for all that is drawn into one target.
#define VIEW_NEAREST_M  0.05
#define VIEW_FARTHEST_M 60

// One triangle over the whole target. ERR_DEVICE.
MUST_CHECK enum status fullscreen_mesh_open(struct gpu_mesh **out, struct gpu *gpu);
