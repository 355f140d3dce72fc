// The person's shape in the rest pose: how far every place near the bones is from
// the surface, gathered from the depth of many frames (a truncated signed
// distance, after Curless and Levoy 1996). What a sensor looked through is empty,
// what lies just behind what it saw is not; what nobody saw stays as the parts'
// cylinders have it. Pure; deterministic.
#pragma once
#include "reenact/skeleton/bone_chart.h"
#include "reenact/skeleton/body_cylinders.h"
#include "reenact/skeleton/bind_pose.h"
#include "reenact/observation/depth_frame.h"

struct volume;

// Between neighbouring points of the likeness's grid; what is finer is not kept.
#define VOLUME_STEP_M 0.009

// step_m: between neighbouring points of this one's grid. Rest pose and lens are copied. ERR_MEMORY.
MUST_CHECK enum status volume_open(struct volume **out, const struct rest *rest, const struct calibration *calibration,
                                   double step_m);
void volume_close(struct volume **v);

// Adds what one frame saw, the person being in `posture` (colour camera's axes). ERR_MEMORY.
MUST_CHECK enum status volume_add(struct volume *v, const struct sight *sight, const struct posture *posture);

// From here on leaves alone what `known`, another of the same rest pose, perhaps of a coarser grid, has
// found to be empty, well away from the surface: there v is as `known`. For speed. ERR_MEMORY.
MUST_CHECK enum status volume_leave_empty(struct volume *v, const struct volume *known);

const struct rest *volume_rest(const struct volume *v);
const struct calibration *volume_calibration(const struct volume *v);

// Once all is gathered: where nothing was seen of a trunk it is as deep as trunks are, not as it is wide. (While it is
// gathered it is round: a back that is too near would draw the front with it, and with that every frame.)
void volume_flatten_unseen(struct volume *v);

// Evens out noise: `passes` times a binomial over neighbours. ERR_MEMORY.
MUST_CHECK enum status volume_smooth(struct volume *v, int passes);

// Moves the surface out by what each bone's chart has there, metres, in between where bones meet.
void volume_grow(struct volume *v, const struct bone_chart out_m[BONE_COUNT]);

// Signed distance, metres, negative inside, and its gradient at a point of the
// rest pose. *seen: how many frames' readings speak for it; where it is 0 the surface is
// guessed. False: too far from the bones, or deeper than distances are kept.
bool volume_at(const struct volume *v, struct vec3 rest, double *distance, struct vec3 *gradient, double *seen);

// The surface as triangles, counter-clockwise from outside; rest axes, metres. The
// caller frees both arrays. ERR_MEMORY; NOTHING: there is none.
struct surface {
    struct vec3 *points, *normals; // point_count; normals outwards, unit
    int32_t *corners;              // corner_count, three to a triangle
    int point_count, corner_count;
};
MUST_CHECK enum status volume_surface(const struct volume *v, struct surface *out);
void surface_free(struct surface *s);
