// Which of the avatar's triangles may take colours of the shown frame: a conservative test of the shader's depth
// agreement over each triangle's footprint in the depth image. The others, which the frame did not see, saw at a
// grazing angle or saw occluded, are drawn without sampling the frame. Pure; deterministic.
#pragma once
#include "reenact/frame/frame_layer.h"

// out: one flag for each of the mesh's triangles. f: its depth image and points are used. Conservative: never false for
// a triangle of which avatar.frag would take the frame's colour for some pixel.
void triangle_visibility_find(const struct uv_mesh *mesh, const struct frame_layer *f, bool *out);
