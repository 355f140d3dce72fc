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

struct bone_frame {
    struct vec3 origin;  // the joint the part begins at
    struct vec3 x, y, z; // unit, right-handed; z along the bone
    double length;       // of the bone, metres, > 0
};

// False when one of the part's joints is unknown or they coincide (< 1 mm).
// eye: in the skeleton's frame. Looking along the bone gives some x and y.
bool bone_frame_viewer_aligned(const struct skeleton *skeleton, enum part p, struct vec3 eye, struct bone_frame *out);

// The same frame turned with the body: y is the part's front (the chest's side;
// for arms the side that faces forwards when they hang with the thumbs ahead).
// The trunk takes its twist from shoulders and hips, a limb from its hinge
// (elbow, knee) where that is bent, else it is carried along from the trunk by
// the shortest turn; between the two it passes smoothly. False also when no
// trunk direction is known.
bool bone_frame_body_aligned(const struct skeleton *skeleton, enum part p, struct bone_frame *out);

struct vec3 bone_frame_midpoint(const struct bone_frame *f); // of the bone

// A point or direction in the part's axes, metres.
struct vec3 bone_frame_local_point(const struct bone_frame *f, struct vec3 p);
struct vec3 bone_frame_local_direction(const struct bone_frame *f, struct vec3 d);
