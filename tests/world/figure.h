// The figure's skin and clothes: a closed mesh made once in the rest frame from
// smooth shapes, bound to the bones, and painted by where a point is at rest.
// Internal to tests/world. Built once, then only read.
#pragma once
#include "tests/world/body.h"

struct vec3f {
    float x, y, z;
};

enum { BONES_A_VERTEX = 3 };

struct vertex {
    struct vec3f rest, normal; // rest frame
    float weight[BONES_A_VERTEX]; // sum 1
    uint8_t bone[BONES_A_VERTEX];
    float open; // 0..1: how much of the room light reaches it past the body itself, at rest
};

struct figure {
    struct physique physique;
    struct vertex *vertices;
    int vertex_count;
    int (*triangles)[3]; // anticlockwise from outside
    int triangle_count;
    double joint_radius[JOINT_COUNT];
};

// ERR_MEMORY.
MUST_CHECK enum status figure_build(struct figure *f, const struct physique *p);
void figure_free(struct figure *f); // zeroed is fine

// Where vertices stand in a pose: at[vertex_count], normal[vertex_count] (unit), from `first` on, `count` of them.
void figure_pose(const struct figure *f, const struct posed *posed, int first, int count, struct vec3 *at,
                 struct vec3f *normal);

// What a point of the surface is made of: linear albedo; the return value is how
// much it shines, 0..1.
float figure_albedo(const struct physique *p, struct vec3f rest, struct vec3f normal, float albedo[3]);
