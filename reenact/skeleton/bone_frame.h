// A body part's own coordinates, so that a point of the part can be found again
// on the same part in another pose: z along the bone from its first joint, x and
// y across it. Pure; total: a limb of no length has no frame, anything else has.
//
// Across the bone two conventions are at hand. *Facing*: y leans towards an eye,
// so that the side that is seen here meets the side that was seen there (the
// projection of its own that the 2014 paper gives each cylinder). *Bodily*: x
// and y are fixed to the flesh as far as joints tell, so that front stays front.
#pragma once
#include "capture/recording/skeleton.h"

struct part_frame {
    struct vec3 origin;  // the joint the part begins at
    struct vec3 x, y, z; // unit, right-handed; z along the bone
    double length;       // of the bone, metres, > 0
};

// False when one of the part's joints is unknown or they coincide (< 1 mm).
// eye: in the skeleton's frame. Looking along the bone gives some x and y.
bool part_frame_facing(const struct skeleton *skeleton, enum part p, struct vec3 eye, struct part_frame *out);

// The same frame turned with the body: y is the part's front (the chest's side;
// for arms the side that faces forwards when they hang with the thumbs ahead).
// The trunk takes its twist from shoulders and hips, a limb from its hinge
// (elbow, knee) where that is bent, else it is carried along from the trunk by
// the shortest turn; between the two it passes smoothly. False also when no
// trunk direction is known.
bool part_frame_bodily(const struct skeleton *skeleton, enum part p, struct part_frame *out);

struct vec3 part_frame_middle(const struct part_frame *f); // of the bone

// A point or direction in the part's axes, metres.
struct vec3 part_frame_point_in(const struct part_frame *f, struct vec3 p);
struct vec3 part_frame_direction_in(const struct part_frame *f, struct vec3 d);
