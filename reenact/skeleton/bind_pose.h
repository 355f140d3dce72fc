// The bind pose, in which the avatar is fused: upright, arms and legs spread so that no two
// limbs touch. Bone transforms: where each bone of the bind pose is at an instant. Skin
// weights and linear blend skinning (LBS) by them. Pure.
#pragma once
#include "recording/recording.h"
#include "recording/skeleton.h"

// ---------------------------------------------------------------- bone frame

// A body part's local coordinate frame, in which a point of the part has the same
// coordinates in every pose: z along the bone from its first joint, x and y across it.
// Pure; every part of known joints at least 1 mm apart has a frame.
//
// The axes across the bone have two conventions. *Viewer-aligned*: y points towards the
// viewpoint as far as the bone allows, so that the side seen by one camera maps to the side
// seen by another (the projection that [D14] 4.2 gives each cylinder). *Body-aligned*:
// x and y follow the body's axial rotation as far as joints determine it.

struct bone_frame {
    struct vec3 origin;  // the joint the part begins at
    struct vec3 x, y, z; // unit, right-handed; z along the bone
    double length;       // of the bone, metres, > 0
};

// False: one of the part's joints is unknown, or they coincide (< 1 mm). eye: the viewpoint, in the
// skeleton's axes; on the bone's line, x and y are arbitrary but deterministic.
bool bone_frame_viewer_aligned(const struct skeleton *skeleton, enum part part, struct vec3 eye,
                               struct bone_frame *out);

// Body-aligned: y is the part's front (the chest's side; for arms the side that faces forwards when
// they hang with the thumbs ahead). The trunk takes its axial rotation from shoulders and hips; a limb
// from the plane of its hinge (elbow, knee) where that is bent, else from the trunk by the shortest
// rotation; from 15 to 45 degrees of bend the two are blended. False also when the trunk is unknown.
bool bone_frame_body_aligned(const struct skeleton *skeleton, enum part part, struct bone_frame *out);

struct vec3 bone_frame_midpoint(const struct bone_frame *frame); // of the bone, skeleton's axes
struct quat bone_frame_rotation(const struct bone_frame *frame); // from the bone frame's axes into the skeleton's

// A point or direction of the skeleton's axes in the bone frame's, metres.
struct vec3 bone_frame_local_point(const struct bone_frame *frame, struct vec3 p);
struct vec3 bone_frame_local_direction(const struct bone_frame *frame, struct vec3 d);

// ---------------------------------------------------------------- bind pose

// What moves rigidly: the eleven parts, and end bones without joints of their own: hands and feet, which rotate about
// the last joint, and the skull, which rotates on the neck.
enum {
    BONE_LEFT_FOOT = PART_COUNT, // bones 0 to 10 are the parts
    BONE_RIGHT_FOOT,
    BONE_LEFT_HAND,
    BONE_RIGHT_HAND,
    BONE_SKULL,
    BONE_COUNT
};
enum part bone_part(int bone); // the part that an end bone is attached to; a part itself

// Metres; axes: x to the person's left, y down, z to the back; the origin is the neck.
struct bind_pose {
    struct skeleton skeleton;
    bool known[BONE_COUNT];
    struct bone_frame frame[BONE_COUNT]; // body-aligned; of the known bones
    double own_length[BONE_COUNT];       // along the bone up to its end bone, which may begin before the end
    double radius[BONE_COUNT];           // of the bone's cylinder
};

// From the take's median bone lengths. NOTHING: the joints of the upper torso were never known together. ERR_MEMORY.
MUST_CHECK enum status bind_pose_make(struct bind_pose *out, const struct take *take);

// Two bones that meet at a joint; ordered from the trunk outwards.
struct bone_link {
    int a, b;
    enum joint joint;
};
enum { BONE_LINKS = 15 };
extern const struct bone_link bone_links[BONE_LINKS];
bool bones_adjacent(int a, int b); // or the same

// Of each bone: maps bind-pose axes into the axes of a skeleton.
struct bone_transforms {
    struct pose bone[BONE_COUNT];
};

// From the skeleton's joints; bones with unknown joints move with the bone they are attached to.
// NOTHING: the upper torso is unknown.
MUST_CHECK enum status bone_transforms_of(const struct bind_pose *bind, const struct skeleton *skeleton,
                                          struct bone_transforms *out);

// The bind pose's joints under the bone transforms; where two bones meet, the mean. Confidence 1 or 0 (no known bone).
struct skeleton bone_transforms_skeleton(const struct bind_pose *bind, const struct bone_transforms *transforms);

// Skin weights of a point: they add up to 1, the nearest bone comes first.
enum { SKIN_BONES = 3 };
struct skin_weights {
    uint8_t bone[SKIN_BONES];
    float weight[SKIN_BONES];
};
struct skin_weights bind_pose_skin_weights(const struct bind_pose *bind, struct vec3 point);

// LBS: the position *p and unit normal *n of a point of the bind pose under the bone transforms.
void linear_blend_skin(const struct skin_weights *skin, const struct bone_transforms *transforms, struct vec3 point,
                       struct vec3 normal, struct vec3 *p, struct vec3 *n);

// The bone a point labelled `part` belongs to: the part itself or its end bone, whichever capsule is nearer.
// bind_from: of each bone, from the point's axes into the bind pose.
int bind_pose_bone_at(const struct bind_pose *bind, enum part part, struct vec3 point,
                      const struct pose bind_from[BONE_COUNT]);

// Signed distance of a point from the nearest bone's capsule, metres; negative inside.
double bind_pose_distance(const struct bind_pose *bind, struct vec3 point);
