// The avatar's vertex colours: albedo and irradiance, estimated together from the take's frames, so that a point has
// one colour however it was lit. Each frame adds one sample to each point it sees; each point keeps the best 16.
// vertex_color_solve alternates between the albedo of every point and one irradiance for the take:
// eight iterations of robust least squares. Points without samples are inpainted (texture_atlas.h).
//
// Colour space: "linear" here is the square of the gamma-encoded value, value = byte / 255, an approximation of sRGB's
// curve (within 0.05) that a square root undoes exactly. The irradiance has the mean 1, so an albedo is the colour
// under mean light.
//
// vertex_color_add and _solve start up to `threads` threads of their own and end them before they return; the result
// does not depend on how many. The caller calls them one at a time.
#pragma once
#include "reenact/avatar/deformation.h"
#include "reenact/avatar/irradiance_sh.h"
#include "reenact/observation/depth_frame.h"
#include "reenact/skeleton/bind_pose.h"

struct vertex_colors {
    float (*color)[3]; // of each point of the surface: albedo, RGB, linear
    float *time_s;     // when it was seen best, since the take's first frame
    uint8_t *filled;   // 1: it was never seen; its colour is inpainted
    struct sh_irradiance irradiance;
};

struct vertex_color_builder;

// The avatar that colours are for. All must outlive the builder.
struct vertex_color_target {
    const struct bind_pose *bind_pose;
    const struct surface_mesh *surface; // in the bind pose
    const struct skin_weights *skins;   // of its points
};

// Holds 512 bytes for each of the surface's points. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status vertex_color_open(struct vertex_color_builder **out, const struct vertex_color_target *target,
                                         const struct calibration *calibration, int threads);
void vertex_color_close(struct vertex_color_builder **builder); // accepts NULL in *builder

// One frame's colours, with the model's transforms (colour camera's axes) and deformation in it.
struct vertex_color_frame {
    const struct depth_frame *depth_frame;
    const uint8_t *rgb;
    const struct bone_transforms *transforms;
    const struct deformation *deformation;
    struct pose world_from_camera;
    double time_s;
};
void vertex_color_add(struct vertex_color_builder *builder, const struct vertex_color_frame *frame);

// Of all frames added. The caller frees *out with vertex_colors_free. ERR_MEMORY; *out is then empty.
MUST_CHECK enum status vertex_color_solve(struct vertex_color_builder *builder, struct vertex_colors *out);
void vertex_colors_free(struct vertex_colors *colors);
