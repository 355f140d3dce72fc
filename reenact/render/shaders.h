// The texts of shaders/, embedded at build time.
#pragma once
#include "base/status.h"

struct shader_text {
    const char *name; // file name: "actor.vert"
    const char *text; // GLSL ES 3.00
};
extern const struct shader_text shader_texts[];
extern const int shader_text_count;

const char *shader_find(const char *name); // asserts that it is there
