// Which of the avatar's triangles may have some of the shown frame's own colours. The others, what it did not see,
// saw from the side, or saw something else before, are drawn without looking into it. Pure; deterministic.
#pragma once
#include "reenact/frame/frame_layer.h"

// out: of each of the mesh's triangles. f: its depth, and what it knows of the mesh's points. Never says no of a
// triangle of which avatar.frag would take the frame's colour for some pixel.
void triangle_visibility_find(const struct uv_mesh *mesh, const struct frame_layer *f, bool *out);
