// What rigid parts cannot follow: feet flex, shoulders rise, cloth sways. For one frame
// a smooth field of small shifts over the rest pose, on a coarse grid, found from that
// frame's depth and from the outline it shows; what it does not show goes along with
// what is beside it. (As in DynamicFusion, Newcombe et al. 2015, but within a skeleton's
// posture.) Pure; deterministic.
#pragma once
#include "reenact/volume.h"

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

// Lays the model, which is in `posture` (colour camera's axes), on what one frame shows.
void warp_fit(struct warp *w, const struct warp_model *model, const struct sight *sight, const struct posture *posture);
void warp_clear(struct warp *w);

// How far a point of the rest pose is shifted; rest axes, metres.
struct vec3 warp_at(const struct warp *w, struct vec3 rest);
