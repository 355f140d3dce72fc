// What rigid parts cannot follow: feet flex, shoulders rise, cloth sways. For one frame
// a smooth field of small shifts over the rest pose, on a coarse grid, found from that
// frame's depth, the outline and the colours it shows; what it does not show goes along with
// what is beside it. (As in DynamicFusion, Newcombe et al. 2015, but within a skeleton's
// posture.) Pure; deterministic.
#pragma once
#include "reenact/avatar/tsdf.h"

#define WARP_STEP_M 0.06 // between neighbouring nodes of the grid
#define WARP_MOST_M 0.08 // of each component of a shift

struct warp;

// No shift anywhere yet. The surface tells where the person is. Rest pose and lens are copied. ERR_MEMORY.
MUST_CHECK enum status warp_open(struct warp **out, const struct rest *rest, const struct surface *surface,
                                 const struct calibration *calibration);
void warp_close(struct warp **w);

// What the fit goes by. The surface is the volume's, the skins are its points'.
struct warp_model {
    const struct volume *volume;
    const struct surface *surface;
    const struct skin *skins;
};

// A frame's colours, and those that are known of the surface's points: stripes and prints tell what slides along it.
struct coat;
struct warp_colors {
    const struct coat *coat;
    const uint8_t *rgb; // nobody else's among them (sight_colors)
    const struct calibration *calibration;
    struct quat world_from_color;
};

// Lays the model, which is in `posture` (colour camera's axes), on what one frame shows. colors: NULL: by its depth and
// outline alone.
void warp_fit(struct warp *w, const struct warp_model *model, const struct sight *sight, const struct posture *posture,
              const struct warp_colors *colors);
void warp_clear(struct warp *w);

// How far a point of the rest pose is shifted; rest axes, metres.
struct vec3 warp_at(const struct warp *w, struct vec3 rest);
