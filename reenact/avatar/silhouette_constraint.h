// Silhouette constraint: how the fused shape, placed by a frame's transforms, meets the frame's silhouette, point by
// point; and how thick the shape has to be, by height and side of each bone, to meet the silhouettes of all frames.
// A TSDF fused from many poses, none of them exact, is too thin, thin limbs most of all, and too thick where noise
// blurs what was seen frontally. No single depth sample contradicts that; silhouettes do. No state of its own, no
// threads; deterministic. Memory: silhouette_measure takes 32 KiB of stack.
#pragma once
#include "reenact/avatar/tsdf.h"
#include "reenact/skeleton/body_cylinders.h"

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
