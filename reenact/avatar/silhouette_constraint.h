// The outlines that frames show: how the fused shape as a transforms places it meets them, place by place; and how
// thick it has to be, at each height of each bone and on each side, to meet them all. A shape gathered from many
// postures, none of them quite right, comes out too thin, thin limbs most of all, and too thick where noise blurs what
// was seen from the front; no single reading contradicts; outlines do. Pure.
#pragma once
#include "reenact/skeleton/bone_chart.h"
#include "reenact/avatar/tsdf.h"

// A place of the person's outline in a frame: the room is on one side of it, something of the person on the other.
struct silhouette_point {
    float x, y;        // depth picture's pixels
    int32_t inside;    // the person's pixel beside it
    int8_t in_x, in_y; // the step towards that
};
enum { SILHOUETTE_POINTS_MOST = 2000 };

// Of all places spread evenly over the outline at most SILHOUETTE_POINTS_MOST. How many there are.
int silhouette_find_points(const struct depth_frame *depth_frame,
                           struct silhouette_point places[SILHOUETTE_POINTS_MOST]);

// Which bone is seen beside a place. bind_from_color: of each bone.
int silhouette_point_bone(const struct bind_pose *bind_pose, const struct depth_frame *depth_frame,
                          const struct silhouette_point *place, const struct pose bind_from_color[BONE_COUNT]);

// Where the viewing ray through a place comes nearest to the shape, as one bone goes.
struct silhouette_contact {
    double gap;         // metres between them (+: the shape is too thin, or lies aside) or how deep it cuts (-)
    struct vec3 at;     // on the line, metres in the colour camera's axes
    struct vec3 normal; // of the shape, bind-pose axes, unit
    struct vec3 inward; // the step towards the person, colour camera's axes, unit
};
// False: it is nowhere near.
bool silhouette_find_contact(const struct tsdf *v, const struct calibration *calibration,
                             const struct depth_frame *depth_frame, const struct silhouette_point *place,
                             struct pose bind_from_color, struct silhouette_contact *out);

// How far viewing rays along the person's outline pass by the shape (+, metres: it is too thin) or cut into it (-),
// summed up by where on the bone they touch it, and how many did.
struct silhouette_gaps {
    struct bone_chart sum[BONE_COUNT], count[BONE_COUNT];
};

// Adds what one frame says, the person being in `transforms`.
void silhouette_measure(const struct tsdf *v, const struct calibration *calibration,
                        const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                        struct silhouette_gaps *gaps);

// Of some frames, then of others.
void silhouette_gaps_add(struct silhouette_gaps *to, const struct silhouette_gaps *gaps);

// Moves the surface out (or in) by the mean gap about each place, or of the whole bone where few places say anything.
void tsdf_match_silhouettes(struct tsdf *v, const struct silhouette_gaps *gaps);
