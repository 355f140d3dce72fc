// What rigid parts cannot follow: feet flex, shoulders rise, cloth sways. For one frame
// a smooth field of small shifts over the bind pose, on a coarse grid, found from that
// frame's depth, the outline and the colours it shows; what it does not show goes along with
// what is beside it. (As in DynamicFusion, Newcombe et al. 2015, but within a skeleton's
// transforms.) Pure; deterministic.
#pragma once
#include "reenact/avatar/tsdf.h"

#define DEFORMATION_STEP_M       0.06 // between neighbouring nodes of the grid
#define DEFORMATION_SHIFT_MOST_M 0.08 // of each component of a shift

struct deformation;

// No shift anywhere yet. The surface tells where the person is. Bind pose and lens are copied. ERR_MEMORY.
MUST_CHECK enum status deformation_open(struct deformation **out, const struct bind_pose *bind_pose,
                                        const struct surface_mesh *surface, const struct calibration *calibration);
void deformation_close(struct deformation **w);

// What the fit goes by. The surface is the tsdf's, the skins are its points'.
struct deformation_model {
    const struct tsdf *tsdf;
    const struct surface_mesh *surface;
    const struct skin_weights *skins;
};

// A frame's colours, and those that are known of the surface's points: stripes and prints tell what slides along it.
struct vertex_colors;
struct deformation_colors {
    const struct vertex_colors *vertex_colors;
    const uint8_t *rgb; // nobody else's among them (depth_frame_clean_colors)
    const struct calibration *calibration;
    struct quat world_from_color;
};

// Lays the model, which is in `transforms` (colour camera's axes), on what one frame shows. colors: NULL: by its depth
// and outline alone.
void deformation_fit(struct deformation *w, const struct deformation_model *model,
                     const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                     const struct deformation_colors *colors);
void deformation_clear(struct deformation *w);

// How far a point of the bind pose is shifted; bind-pose axes, metres.
struct vec3 deformation_at(const struct deformation *w, struct vec3 bind_point);
