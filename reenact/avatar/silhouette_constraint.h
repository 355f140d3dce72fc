// The outlines that frames show: how the fused shape as a posture places it meets them, place by place; and how thick
// it has to be, at each height of each bone and on each side, to meet them all. A shape gathered from many postures,
// none of them quite right, comes out too thin, thin limbs most of all, and too thick where noise blurs what was seen
// from the front; no single reading contradicts; outlines do. Pure.
#pragma once
#include "reenact/skeleton/bone_chart.h"
#include "reenact/avatar/tsdf.h"

// A place of the person's outline in a frame: the room is on one side of it, something of the person on the other.
struct outline_place {
    float x, y;        // depth picture's pixels
    int32_t inside;    // the person's pixel beside it
    int8_t in_x, in_y; // the step towards that
};
enum { OUTLINE_MOST = 2000 };

// Of all places spread evenly over the outline at most OUTLINE_MOST. How many there are.
int outline_find(const struct sight *sight, struct outline_place places[OUTLINE_MOST]);

// Which bone is seen beside a place. rest_from_color: of each bone.
int outline_bone(const struct rest *rest, const struct sight *sight, const struct outline_place *place,
                 const struct pose rest_from_color[BONE_COUNT]);

// Where the line of sight through a place comes nearest to the shape, as one bone goes.
struct outline_touch {
    double gap;         // metres between them (+: the shape is too thin, or lies aside) or how deep it cuts (-)
    struct vec3 at;     // on the line, metres in the colour camera's axes
    struct vec3 normal; // of the shape, rest axes, unit
    struct vec3 inward; // the step towards the person, colour camera's axes, unit
};
// False: it is nowhere near.
bool outline_touches(const struct volume *v, const struct calibration *calibration, const struct sight *sight,
                     const struct outline_place *place, struct pose rest_from_color, struct outline_touch *out);

// How far lines of sight along the person's outline pass by the shape (+, metres: it is too thin) or cut into it (-),
// summed up by where on the bone they touch it, and how many did.
struct outline_gaps {
    struct bone_chart sum[BONE_COUNT], count[BONE_COUNT];
};

// Adds what one frame says, the person being in `posture`.
void outline_measure(const struct volume *v, const struct calibration *calibration, const struct sight *sight,
                     const struct posture *posture, struct outline_gaps *gaps);

// Of some frames, then of others.
void outline_add(struct outline_gaps *to, const struct outline_gaps *gaps);

// Moves the surface out (or in) by the mean gap about each place, or of the whole bone where few places say anything.
void outline_meet(struct volume *v, const struct outline_gaps *gaps);
