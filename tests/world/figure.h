// The figure's skin and clothes: a closed mesh made once in the bind frame from smooth implicit shapes, skinned to the
// bones, and painted by position in the bind pose. Internal to tests/world. Built once, then only read: safe from any
// thread.
#pragma once
#include "tests/world/mesh.h"

enum { BONES_A_VERTEX = 3 };

struct binding {
    float weight[BONES_A_VERTEX]; // sum 1, descending
    uint8_t bone[BONES_A_VERTEX];
    float open; // 0..1: ambient visibility past the body itself, in the bind pose
};

struct figure {
    struct physique physique;
    struct mesh mesh;         // in the bind pose
    struct binding *bindings; // one per vertex
    double joint_radius[JOINT_COUNT];
};

// `plain`: a coarser mesh without folds. ERR_MEMORY.
MUST_CHECK enum status figure_build(struct figure *f, const struct physique *p, bool plain);
void figure_free(struct figure *f); // zeroed is fine

// Skins the vertices [first, first + count); at and normal (unit) are the whole mesh's arrays.
void figure_pose(const struct figure *f, const struct posed *posed, int first, int count, struct vec3 *at,
                 struct vec3f *normal);

// Appearance of a surface point: linear albedo; returns its specular share, 0..1.
float figure_albedo(const struct physique *p, struct vec3f bind_point, float albedo[3]);
