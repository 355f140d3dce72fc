// The person of a take as an armature: bones of constant length with a T-pose at rest, moved by rotations alone but for
// the root, as programs of animation retarget them; by the names that these programs look for.
//
// Axes: y up; at rest the person faces +z with the left arm along +x, and every bone's own axes are these. The bones
// begin at the take's joints; three have none: spine and upper chest, on the line of the trunk, and the clavicles,
// beside the neck. Toes go with the foot, and foot and hand with shin and forearm, since a take has no joints of them.
// Bone lengths are the take's medians, so that joints are off by what a tracker lets lengths vary; each bone points at
// its joint from where it is itself, which keeps that from adding up. Pure.
#pragma once
#include "formats/markers.h"
#include "reenact/skeleton/bind_pose.h"

enum armature_bone {
    ARMATURE_HIPS, // the root, at the waist
    ARMATURE_SPINE,
    ARMATURE_CHEST, // at the torso
    ARMATURE_UPPER_CHEST,
    ARMATURE_NECK,
    ARMATURE_HEAD,
    ARMATURE_LEFT_CLAVICLE,
    ARMATURE_LEFT_UPPER_ARM,
    ARMATURE_LEFT_FOREARM,
    ARMATURE_LEFT_HAND,
    ARMATURE_RIGHT_CLAVICLE,
    ARMATURE_RIGHT_UPPER_ARM,
    ARMATURE_RIGHT_FOREARM,
    ARMATURE_RIGHT_HAND,
    ARMATURE_LEFT_THIGH,
    ARMATURE_LEFT_SHIN,
    ARMATURE_LEFT_FOOT,
    ARMATURE_LEFT_TOES,
    ARMATURE_RIGHT_THIGH,
    ARMATURE_RIGHT_SHIN,
    ARMATURE_RIGHT_FOOT,
    ARMATURE_RIGHT_TOES,
    ARMATURE_BONES
};

enum armature_naming {
    ARMATURE_OURS,    // a joint's name where a bone begins at one
    ARMATURE_MIXAMO,  // mixamorig:LeftForeArm
    ARMATURE_UNREAL,  // lowerarm_l, as the mannequin's
    ARMATURE_HUMANIK, // LeftForeArm, as HumanIK's template
    ARMATURE_NAMINGS
};
const char *armature_bone_name(enum armature_naming naming, enum armature_bone bone);
int armature_parent(enum armature_bone bone);       // -1: the root; parents come before their children
enum joint armature_joint(enum armature_bone bone); // that begins there; JOINT_COUNT: none

struct armature {
    struct vec3 offset[ARMATURE_BONES]; // from the parent, metres; of the hips above the soles
    struct vec3 rest[ARMATURE_BONES];   // where each begins at rest; the floor is y = 0
    struct quat part_rest[PART_COUNT];  // of each part: its bone frame's rotation at rest
};

// From joints over time. ERR_INPUT: a bone of trunk, arms or
// legs is never known, so that it has no length. ERR_MEMORY.
MUST_CHECK enum status armature_make(struct armature *out, const struct markers *markers);

struct armature_pose {
    bool known;                           // false: nothing has been seen yet, and this is the T-pose
    struct vec3 root;                     // of the hips, metres
    struct quat rotation[ARMATURE_BONES]; // in the parent's axes
};

// Below, joints are a frame of struct markers: [JOINT_COUNT][3], metres, y up, NaN where not known.

// The rotations of the body's parts, from their axes at rest into the joints' axes.
struct armature_parts {
    struct quat rotation[PART_COUNT];
    bool known[PART_COUNT];
};
struct armature_parts armature_parts_of(const struct armature *armature, const float *joints);

// Moves `pose` on to an instant; what is not known then keeps its rotation in its parent's axes. Zeroed at first.
void armature_pose_move(struct armature_pose *pose, const struct armature *armature, const struct armature_parts *parts,
                        const float *joints);

// Where the bones begin in a pose: forward kinematics.
void armature_positions(const struct armature *armature, const struct armature_pose *pose,
                        struct vec3 out[ARMATURE_BONES]);

// How far the armature's joints are from the ones it was made of.
struct armature_fit {
    double mean_m, max_m; // over all known joints of all instants
};

// Markers as BVH with three channels a bone, six of the root. Errors as armature_make; of writing in ferror(out).
MUST_CHECK enum status armature_bvh_print(const struct markers *markers, enum armature_naming naming, FILE *out,
                                          struct armature_fit *fit);
