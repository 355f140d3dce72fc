// A closed triangle mesh of a form, by naive surface nets (Gibson 1998) on a grid
// of which only the blocks near the surface are visited. Internal to tests/world.
#pragma once
#include "tests/world/shapes.h"

struct mesh {
    struct vec3f *at, *normal;
    int vertex_count;
    int (*triangles)[3]; // anticlockwise from outside
    int triangle_count;
};

// ERR_MEMORY. On error *out is empty.
MUST_CHECK enum status mesh_of(struct mesh *out, const struct form *form, float cell_m);
void mesh_free(struct mesh *m);
