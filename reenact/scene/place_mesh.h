// A coloured surface of a recorded place, for its map: the depth pictures of its views as triangles, merged by vertex
// clustering (Rossignac & Borrel 1993) so that walls that many views show are there once. Each triangle faces the
// camera that saw it. Pure but for memory; deterministic.
#pragma once
#include "recording/place.h"

struct place_mesh_vertex {
    float at[3];     // metres, world
    float normal[3]; // unit length
    uint8_t rgb[3];
};

struct place_mesh {
    struct place_mesh_vertex *vertices;
    uint32_t *corners; // three to a triangle, counter-clockwise from where it was seen
    int vertex_count, corner_count;
    struct vec3 low, high; // of what lies within; a twentieth of the vertices may lie outside
    double cell_m;         // side of a cluster's cell
};

enum { PLACE_MESH_VERTICES = 60000 }; // at most: cells grow until so many suffice

// keep_going(self): false cancels; NULL: never. NOTHING: no view holds depth, or it was cancelled. ERR_MEMORY. *out is
// zeroed unless OK.
MUST_CHECK enum status place_mesh_make(struct place_mesh *out, const struct place *place,
                                       bool (*keep_going)(void *self), void *self);
void place_mesh_free(struct place_mesh *mesh); // zeroed is fine
