// Which of the likeness's triangles may have some of the shown frame's own colours. The others, what it did not see,
// saw from the side, or saw something else before, are drawn without looking into it. Pure; deterministic.
#pragma once
#include "reenact/frame/frame_layer.h"

// out: of each of the mesh's triangles. f: its depth, and what it knows of the mesh's points. Never says no of a
// triangle of which avatar.frag would take the frame's colour for some pixel.
void own_triangles_find(const struct unfolded *mesh, const struct loaded_frame *f, bool *out);
