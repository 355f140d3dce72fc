// The colours of the avatar's surface, gathered over the take: what every frame
// that saw a place of the body says about it, and the room's light, so that a
// place has one colour, however it was turned when it was seen. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"
#include "reenact/observation/depth_frame.h"
#include "reenact/avatar/deformation.h"

// Light that falls on a surface by where it faces (world axes): spherical
// harmonics up to the second order; the sum is held within LEAST and MOST, for it
// means nothing where no surface ever faced. 1 is the mean.
enum { SH_TERMS = 9 };
#define IRRADIANCE_LEAST 0.4F
#define IRRADIANCE_MOST  1.6F
struct sh_irradiance {
    float term[SH_TERMS];
};
float sh_irradiance_at(const struct sh_irradiance *light, const float n[3]); // n: unit

struct vertex_colors {
    float (*color)[3]; // of each point of the surface, linear, in the mean light
    float *time_s;     // when it was seen best, since the take's first frame
    uint8_t *filled;   // 1: nobody saw it; its colour is made up (color_inpainting.h)
    struct sh_irradiance light;
};

struct vertex_color_builder;
// bind_pose, surface (in it) and skins (of its points) must outlive it. ERR_MEMORY.
MUST_CHECK enum status vertex_color_open(struct vertex_color_builder **out, const struct bind_pose *bind_pose,
                                         const struct surface_mesh *surface, const struct skin_weights *skins,
                                         const struct calibration *calibration);
void vertex_color_close(struct vertex_color_builder **m);

// What one frame saw, the person being in `transforms` (colour camera's axes), bent by `deformation`.
void vertex_color_add(struct vertex_color_builder *m, const struct depth_frame *depth_frame, const uint8_t *rgb,
                      const struct bone_transforms *transforms, const struct deformation *deformation,
                      struct pose world_from_camera, double time_s);

// ERR_MEMORY. vertex_colors_free.
MUST_CHECK enum status vertex_color_solve(struct vertex_color_builder *m, struct vertex_colors *out);
void vertex_colors_free(struct vertex_colors *c);
