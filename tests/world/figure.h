// The figure's skin and clothes: a closed mesh made once in the rest frame from
// smooth shapes, bound to the bones, and painted by where a point is at rest.
// Internal to tests/world. Built once, then only read.
#pragma once
#include "tests/world/mesh.h"

enum { BONES_A_VERTEX = 3 };

struct binding {
    float weight[BONES_A_VERTEX]; // sum 1, falling
    uint8_t bone[BONES_A_VERTEX];
    float open; // 0..1: how much of the room's light reaches it past the body itself, at rest
};

struct figure {
    struct physique physique;
    struct mesh mesh;         // at rest
    struct binding *bindings; // one a vertex
    double joint_radius[JOINT_COUNT];
};

// `plain`: a coarser mesh without folds. ERR_MEMORY.
MUST_CHECK enum status figure_build(struct figure *f, const struct physique *p, bool plain);
void figure_free(struct figure *f); // zeroed is fine

// Where vertices stand in a pose, from number `first` on, `count` of them: at and normal
// (unit) are the whole mesh's arrays.
void figure_pose(const struct figure *f, const struct posed *posed, int first, int count, struct vec3 *at,
                 struct vec3f *normal);

// What a point of the surface looks like: linear albedo; returns how much it shines, 0..1.
float figure_albedo(const struct physique *p, struct vec3f bind_point, float albedo[3]);
