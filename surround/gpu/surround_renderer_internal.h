// What the files of the surroundings' renderer share.
#pragma once
#include "reenact/render/shaders.h"
#include "surround/gpu/picture_store.h"
#include "surround/gpu/surround_renderer.h"

struct surround_renderer {
    struct gpu *gpu;
    struct picture_store store;
    // For so many pictures, compiled when they are needed first
    struct gpu_program *surface_programs[SURROUND_RENDERER_MOST + 1], *texture_programs[SURROUND_RENDERER_MOST + 1];
    struct gpu_program *unasked_program; // for surfaces of pictures after the JUDGES first
    struct gpu_program *tint_program, *sample_program;
    struct gpu_mesh *fullscreen;
    struct gpu_texture *none; // an array, while there are no pictures
    struct gpu_target *surface, *image, *sample;
    struct lens lens; // of the image
    struct pose world_from_view;
    int sample_width, sample_height;
    // Of the image under way: its pictures in their order
    const struct surround_picture *pictures[SURROUND_RENDERER_MOST];
    int layers[SURROUND_RENDERER_MOST], count, missing;
};

// The programs of surround_readback.c. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status surround_renderer_open_overlay(struct surround_renderer *r);

// Rows of the rigid map's 3 x 4 matrix.
static inline void surround_rows_of(struct pose a_from_b, float rows[12])
{
    const double shift[3] = {a_from_b.translation.x, a_from_b.translation.y, a_from_b.translation.z};
    double m[3][3];
    quat_to_matrix(a_from_b.rotation, m);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            rows[4 * i + k] = (float)m[i][k];
        rows[4 * i + 3] = (float)shift[i];
    }
}

// As unpack_inverse_z in surround_depth.glsl.
static inline float surround_inverse_z(const uint8_t *s)
{
    return s[3] ? (float)((s[0] * 65536.0 + s[1] * 256.0 + s[2]) / 16777215.0 / VIEW_NEAREST_M) : DEPTH_UNKNOWN;
}
