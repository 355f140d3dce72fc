// The person's shape in the bind pose: how far every place near the bones is from
// the surface, gathered from the depth of many frames (a truncated signed
// distance, after Curless and Levoy 1996). What a sensor looked through is empty,
// what lies just behind what it saw is not; what nobody saw stays as the parts'
// cylinders have it. Pure; deterministic.
#pragma once
#include "reenact/skeleton/bone_chart.h"
#include "reenact/skeleton/body_cylinders.h"
#include "reenact/skeleton/bind_pose.h"
#include "reenact/observation/depth_frame.h"

struct tsdf;

// Between neighbouring points of the avatar's grid; what is finer is not kept.
#define TSDF_VOXEL_M 0.009

// step_m: between neighbouring points of this one's grid. Bind pose and lens are copied. ERR_MEMORY.
MUST_CHECK enum status tsdf_open(struct tsdf **out, const struct bind_pose *bind_pose,
                                 const struct calibration *calibration, double step_m);
void tsdf_close(struct tsdf **v);

// Adds what one frame saw, the person being in `transforms` (colour camera's axes). ERR_MEMORY.
MUST_CHECK enum status tsdf_integrate(struct tsdf *v, const struct depth_frame *depth_frame,
                                      const struct bone_transforms *transforms);

// From here on leaves alone what `known`, another of the same bind pose, perhaps of a coarser grid, has
// found to be empty, well away from the surface: there v is as `known`. For speed. ERR_MEMORY.
MUST_CHECK enum status tsdf_copy_free_space(struct tsdf *v, const struct tsdf *known);

const struct bind_pose *tsdf_bind_pose(const struct tsdf *v);
const struct calibration *tsdf_calibration(const struct tsdf *v);

// Once all is gathered: where nothing was seen of a trunk it is as deep as trunks are, not as it is wide. (While it is
// gathered it is round: a back that is too near would draw the front with it, and with that every frame.)
void tsdf_flatten_unseen_trunk(struct tsdf *v);

// Evens out noise: `passes` times a binomial over neighbours. ERR_MEMORY.
MUST_CHECK enum status tsdf_smooth(struct tsdf *v, int passes);

// Moves the surface out by what each bone's chart has there, metres, in between where bones meet.
void tsdf_offset(struct tsdf *v, const struct bone_chart out_m[BONE_COUNT]);

// Signed distance, metres, negative inside, and its gradient at a point of the
// bind pose. *seen: how many frames' readings speak for it; where it is 0 the surface is
// guessed. False: too far from the bones, or deeper than distances are kept.
bool tsdf_sample(const struct tsdf *v, struct vec3 bind_point, double *distance, struct vec3 *gradient, double *seen);

// The surface as triangles, counter-clockwise from outside; bind-pose axes, metres. The
// caller frees both arrays. ERR_MEMORY; NOTHING: there is none.
struct surface_mesh {
    struct vec3 *points, *normals; // point_count; normals outwards, unit
    int32_t *corners;              // corner_count, three to a triangle
    int point_count, corner_count;
};
MUST_CHECK enum status tsdf_extract_surface(const struct tsdf *v, struct surface_mesh *out);
void surface_mesh_free(struct surface_mesh *s);
