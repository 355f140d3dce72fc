// Non-rigid correction on top of skinning, for one frame: what rigid bones cannot follow (feet flex, shoulders rise,
// cloth sways). A smooth field of small shifts of the bind pose's points, on a coarse grid, fitted to one frame's depth
// (point to plane), silhouette and, if given, colours; what the frame does not show follows its neighbours. The idea is
// DynamicFusion's (Newcombe et al. 2015), here inside a skeleton's bone transforms: robust Gauss-Newton, three
// iterations, each solved by conjugate gradients.
//
// Shifts are in bind-pose axes, metres. A fit starts from zero shift and depends on nothing before it. No threads are
// started; one deformation is used by one thread at a time. Deterministic.
#pragma once
#include "reenact/avatar/irradiance_sh.h"
#include "reenact/avatar/tsdf.h"
#include "reenact/skeleton/body_cylinders.h"

// ---------------------------------------------------------------- silhouette constraint

// Silhouette constraint: how the fused shape, placed by a frame's transforms, meets the frame's silhouette, point by
// point; and how thick the shape has to be, by height and side of each bone, to meet the silhouettes of all frames.
// A TSDF fused from many poses, none of them exact, is too thin, thin limbs most of all, and too thick where noise
// blurs what was seen frontally. No single depth sample contradicts that; silhouettes do. No state of its own, no
// threads; deterministic. Memory: silhouette_measure takes 32 KiB of stack.

// A point of the actor's silhouette in a frame, between a background pixel and one of the actor's.
struct silhouette_point {
    float x, y;        // depth image, pixels
    int32_t inside;    // index of the actor's pixel beside it
    int8_t in_x, in_y; // the step towards that
};
enum { SILHOUETTE_POINTS_MAX = 2000 };

// Points evenly spread over the silhouette, fewer than SILHOUETTE_POINTS_MAX. Returns their number.
int silhouette_find_points(const struct depth_frame *depth_frame,
                           struct silhouette_point points[SILHOUETTE_POINTS_MAX]);

// Which bone is seen beside a point. bind_from_color: of each bone.
int silhouette_point_bone(const struct bind_pose *bind_pose, const struct depth_frame *depth_frame,
                          const struct silhouette_point *point, const struct pose bind_from_color[BONE_COUNT]);

// Where the viewing ray through a silhouette point comes nearest to the shape, which moves with one bone.
struct silhouette_contact {
    double gap;         // metres: positive: the ray misses the shape, which is too thin or displaced; negative: it cuts
    struct vec3 at;     // on the ray, metres, colour camera's axes
    struct vec3 normal; // of the shape, bind-pose axes, unit
    struct vec3 inward; // from the silhouette towards the actor, colour camera's axes, unit
};
// False: the shape is not within some 10 cm along the ray, or has no clear normal.
bool silhouette_find_contact(const struct tsdf *tsdf, const struct calibration *calibration,
                             const struct depth_frame *depth_frame, const struct silhouette_point *point,
                             struct pose bind_from_color, struct silhouette_contact *out);

// The sum of gaps, metres, and the number of contacts, by where on the bone they are.
struct silhouette_gaps {
    struct bone_chart sum[BONE_COUNT], count[BONE_COUNT];
};

// Adds one frame's contacts, the bones being at `transforms` (colour camera's axes).
void silhouette_measure(const struct tsdf *tsdf, const struct calibration *calibration,
                        const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                        struct silhouette_gaps *gaps);

// Adds the gaps of other frames.
void silhouette_gaps_add(struct silhouette_gaps *to, const struct silhouette_gaps *gaps);

// Moves the surface by the local mean gap, or towards the whole bone's mean where few contacts were counted.
void tsdf_match_silhouettes(struct tsdf *tsdf, const struct silhouette_gaps *gaps);

// ---------------------------------------------------------------- deformation grid

// The regular grid that carries a deformation: a box about the avatar's surface in the bind pose, with trilinear
// interpolation between its points. Bind-pose axes, metres. No state; any thread.

#define DEFORMATION_STEP_M 0.06 // between neighbouring points; chosen by hand

enum { DEFORMATION_POINTS_MAX = 1 << 20 }; // 226 cubic metres; the models of three filmed people take 6900 to 10700

// Point (x, y, z) lies at corner + (x, y, z) * DEFORMATION_STEP_M; its index is (z * size[1] + y) * size[0] + x.
struct deformation_grid {
    struct vec3 corner;
    int size[3];
};

// The surface's bounding box with one step of margin on each side. The surface has at least one point, and its box at
// most DEFORMATION_POINTS_MAX.
struct deformation_grid deformation_grid_about(const struct surface_mesh *surface);
// Whether the box has at most that many points. Those of the surface lie within 1 km.
bool deformation_grid_is_small(const struct surface_mesh *surface);

// The eight grid points about a point, with the trilinear weight of each.
struct deformation_cell {
    int at[8];
    double weight[8]; // add up to 1
};

// ---------------------------------------------------------------- deformation

#define DEFORMATION_SHIFT_MAX_M 0.08 // of each component of a shift, which is clamped to it

struct deformation;

// Without any shift. Nodes of the grid are where the surface is and inside the body. Bind pose and lens are copied;
// the surface may go, but deformation_fit has to be given one of no more points. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status deformation_open(struct deformation **out, const struct bind_pose *bind_pose,
                                        const struct surface_mesh *surface, const struct calibration *calibration);
void deformation_close(struct deformation **w); // accepts NULL in *w

// What is fitted. The surface is the TSDF's, the skin weights are those of its points.
struct deformation_model {
    const struct tsdf *tsdf;
    const struct surface_mesh *surface;
    const struct skin_weights *skins;
};

// A frame's colours, and the avatar's at the surface's points: stripes and prints show what slides along the surface.
struct deformation_colors {
    const float (*albedo)[3];               // of each point of the surface; linear (vertex_color.h)
    const uint8_t *filled;                  // of each point: not 0: albedo is inpainted, and not used
    const struct sh_irradiance *irradiance; // that the albedo was divided by
    const uint8_t *rgb;                     // of the frame, without background colours (depth_frame_clean_colors)
    const struct calibration *calibration;
    struct quat world_from_color;
};

// Fits the model, which is in `transforms` (colour camera's axes), to one frame. colors: NULL: to depth and silhouette
// only. Cannot fail; a frame without evidence gives zero shift.
void deformation_fit(struct deformation *deformation, const struct deformation_model *model,
                     const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                     const struct deformation_colors *colors);
void deformation_clear(struct deformation *deformation); // back to zero shift

// The fitted shift of a point of the bind pose, quantised to DEFORMATION_SHIFT_MAX_M / 127; zero outside the grid.
struct vec3 deformation_at(const struct deformation *deformation, struct vec3 bind_point);
