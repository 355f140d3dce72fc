// TSDF: the actor's shape in the bind pose, a truncated signed distance field fused from the depth of many frames
// (Curless & Levoy 1996: weighted running mean of distances along viewing rays). Each grid point is skinned into each
// frame. Space that the sensor saw through is free, what lies just behind a depth sample is inside; grid points that
// were never observed keep the distance to the bones' cylinders.
//
// Bind-pose axes, metres; distances negative inside. tsdf_open, _integrate and _offset start up to the given number of
// threads and end them before they return; results do not depend on how many. One thread at a time calls a function
// that changes a TSDF; any number may read one that is not being changed. Deterministic.
// Memory: 12 bytes for each grid point, some 90 for each grid point near a bone, 6 for each depth pixel.
#pragma once
#include "base/archive.h"
#include "reenact/observation/depth_frame.h"
#include "reenact/skeleton/bind_pose.h"
#include "reenact/skeleton/body_cylinders.h"

struct tsdf;

// Between neighbouring grid points of the avatar; finer detail is not kept. Chosen by hand: a depth camera's pixel at
// 3 to 4 m is 5 to 8 mm wide.
#define TSDF_VOXEL_M 0.009

// step_m: between neighbouring grid points. Bind pose and lens are copied. ERR_INPUT: the bind pose's joints are too
// far apart to be one person's, or not finite (the grid would have more than 64 million points); ERR_MEMORY. *out is
// then NULL.
MUST_CHECK enum status tsdf_open(struct tsdf **out, const struct bind_pose *bind_pose,
                                 const struct calibration *calibration, double step_m, int threads);
void tsdf_close(struct tsdf **tsdf); // accepts NULL in *tsdf

// Fuses one frame, the bones being at `transforms` (colour camera's axes). ERR_MEMORY; nothing is changed then.
MUST_CHECK enum status tsdf_integrate(struct tsdf *tsdf, const struct depth_frame *depth_frame,
                                      const struct bone_transforms *transforms);

// For speed: copies from `known`, a TSDF of the same bind pose and of any step, where that found free space well away
// from the surface; no later frame is integrated there. ERR_MEMORY; nothing is changed then.
MUST_CHECK enum status tsdf_copy_free_space(struct tsdf *tsdf, const struct tsdf *known);

const struct bind_pose *tsdf_bind_pose(const struct tsdf *tsdf);
const struct calibration *tsdf_calibration(const struct tsdf *tsdf);

// After the last frame: where a trunk was not observed, makes it as deep as trunks are instead of as deep as wide. (Not
// before: a back too near would pull the front with it, and with the front the registration of every frame.)
void tsdf_flatten_unseen_trunk(struct tsdf *tsdf);

// Reduces noise: `passes` times a binomial filter (1 2 1) along each axis. ERR_MEMORY.
MUST_CHECK enum status tsdf_smooth(struct tsdf *tsdf, int passes);

// Moves the surface outwards by each bone's chart, metres, blended by the skin weights.
void tsdf_offset(struct tsdf *tsdf, const struct bone_chart out_m[BONE_COUNT]);

// Signed distance and its gradient (without unit, about 1 long) at a point of the bind pose, trilinear. *seen: the
// weight, in frames, of the depth samples of this surface; 0: the surface is the cylinders'. False: too far from the
// bones, or at the truncation.
bool tsdf_sample(const struct tsdf *tsdf, struct vec3 bind_point, double *distance, struct vec3 *gradient,
                 double *seen);

// The surface as triangles (naive surface nets, Gibson 1998), counter-clockwise seen from outside; bind-pose axes,
// metres.
struct surface_mesh {
    struct vec3 *points, *normals; // point_count; normals outwards, unit
    int32_t *corners;              // corner_count, three to a triangle
    int point_count, corner_count;
};
// NOTHING: there is no surface. ERR_MEMORY. *out is empty then; else the caller frees it with surface_mesh_free.
MUST_CHECK enum status tsdf_extract_surface(const struct tsdf *tsdf, struct surface_mesh *out);
void surface_mesh_free(struct surface_mesh *mesh);

// ---------------------------------------------------------------- tsdf

// The state of a TSDF, for tsdf.c and its tests only.

#define TSDF_TRUNCATION_M 0.045F // distances are clamped to this; 5 voxels

// A grid point that is near a bone.
struct tsdf_cell {
    int32_t at;     // its index in the grid
    float point[3]; // bind-pose axes
    struct skin_weights skin;
};

// The value at a grid point; one struct, since all of it is read together.
struct tsdf_voxel {
    float distance, weight; // weight 0: not near a bone, no value
    float seen;             // the part of the weight that came from depth samples of a surface near it
};

// A pixel of a depth frame, likewise.
struct labelled_sample {
    uint16_t depth;
    uint8_t part, edge, half;
};

// Cells with the same bones, processed together.
enum { TSDF_LANES = 8 };
struct tsdf_block {
    int32_t at[TSDF_LANES]; // lanes from `count` on repeat the first
    float point[3][TSDF_LANES], weight[SKIN_BONES][TSDF_LANES];
    uint8_t bone[SKIN_BONES]; // unused bones repeat the first, with weight 0
    uint8_t count;
};

enum { TSDF_POINTS_MAX = 32000000 }; // of a grid, 384 MB: ten times what a dancer's takes (3.3 million)

struct tsdf {
    struct bind_pose bind_pose;
    struct calibration calibration;
    struct pose depth_from_color;
    struct vec3 corner;
    double step; // between neighbouring grid points, metres
    int threads;
    int size[3]; // index of point (x, y, z): (z * size[1] + y) * size[0] + x
    struct tsdf_cell *cells;
    int cell_count;
    struct tsdf_cell *active_cells; // copies of those that are still integrated, in their order; NULL: all are
    int active_count;
    struct tsdf_block *blocks; // of the active cells; NULL: no frame was integrated since they changed
    int block_count;
    struct tsdf_voxel *voxels;       // of the grid
    struct labelled_sample *samples; // of the frame that is being integrated
};

// ---------------------------------------------------------------- tsdf store

// A TSDF's values to and from an archive, for avatar.c: the grid points near a bone.

// What a TSDF that is read belongs to.
struct tsdf_of {
    const struct bind_pose *bind_pose;
    const struct calibration *calibration;
};

// Writes *tsdf, or makes it (of: not NULL then). What is made can be sampled (tsdf_sample) and nothing else. Where the
// archive fails, as it does on numbers that are not finite or not a person's, *tsdf is NULL.
void tsdf_archive(struct archive *archive, struct tsdf **tsdf, const struct tsdf_of *of);
