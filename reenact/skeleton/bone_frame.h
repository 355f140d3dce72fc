// A body part's local coordinate frame, in which a point of the part has the same
// coordinates in every pose: z along the bone from its first joint, x and y across it.
// Pure; every part of known joints at least 1 mm apart has a frame.
//
// The axes across the bone have two conventions. *Viewer-aligned*: y points towards the
// viewpoint as far as the bone allows, so that the side seen by one camera maps to the side
// seen by another (the projection that [D14] 4.2 gives each cylinder). *Body-aligned*:
// x and y follow the body's axial rotation as far as joints determine it.
#pragma once
#include "recording/skeleton.h"

struct bone_frame {
    struct vec3 origin;  // the joint the part begins at
    struct vec3 x, y, z; // unit, right-handed; z along the bone
    double length;       // of the bone, metres, > 0
};

// False: one of the part's joints is unknown, or they coincide (< 1 mm). eye: the viewpoint, in the
// skeleton's axes; on the bone's line, x and y are arbitrary but deterministic.
bool bone_frame_viewer_aligned(const struct skeleton *skeleton, enum part p, struct vec3 eye, struct bone_frame *out);

// Body-aligned: y is the part's front (the chest's side; for arms the side that faces forwards when
// they hang with the thumbs ahead). The trunk takes its axial rotation from shoulders and hips; a limb
// from the plane of its hinge (elbow, knee) where that is bent, else from the trunk by the shortest
// rotation; from 15 to 45 degrees of bend the two are blended. False also when the trunk is unknown.
bool bone_frame_body_aligned(const struct skeleton *skeleton, enum part p, struct bone_frame *out);

struct vec3 bone_frame_midpoint(const struct bone_frame *f); // of the bone, skeleton's axes

// A point or direction of the skeleton's axes in the bone frame's, metres.
struct vec3 bone_frame_local_point(const struct bone_frame *f, struct vec3 p);
struct vec3 bone_frame_local_direction(const struct bone_frame *f, struct vec3 d);
