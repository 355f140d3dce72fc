// The bind pose, in which the person's avatar is gathered: upright, arms and legs
// held apart so that no two limbs touch. And postures: where every part of the
// bind pose is at an instant. Pure.
#pragma once
#include "capture/recording/recording.h"
#include "reenact/skeleton/bone_frame.h"

// What moves stiffly: the eleven parts, and beyond them hands and feet, which turn about the last joint as no joint
// tells, and the skull, which nods and turns on the neck.
enum {
    BONE_LEFT_FOOT = PART_COUNT, // the first eleven are the parts
    BONE_RIGHT_FOOT,
    BONE_LEFT_HAND,
    BONE_RIGHT_HAND,
    BONE_SKULL,
    BONE_COUNT
};
enum part bone_part(int bone); // the part that it hangs on; a part itself

// Metres; axes: x to the person's left, y down, z to the back; 0 is the neck.
struct bind_pose {
    struct skeleton skeleton;
    bool known[BONE_COUNT];
    struct bone_frame frame[BONE_COUNT]; // bodily; of the known
    double own_length[BONE_COUNT];       // how far along it is itself: what hangs on it may begin before its end
    double radius[BONE_COUNT];           // of their cylinders
};

// From the take's median bone lengths. NOTHING: its trunk was never seen whole.
MUST_CHECK enum status bind_pose_make(struct bind_pose *out, const struct take *take);

// Two bones that meet, and where.
struct bone_link {
    int a, b;
    enum joint joint;
};
enum { BONE_LINKS = 15 };
extern const struct bone_link bone_links[BONE_LINKS];
bool bones_adjacent(int a, int b); // or are the same

// Where each known bone of the bind pose is: maps bind-pose axes into the axes of a skeleton.
struct bone_transforms {
    struct pose bone[BONE_COUNT];
};

// As the skeleton's joints have it; what they do not know goes with the part
// it hangs on. NOTHING: the trunk is unknown.
MUST_CHECK enum status bone_transforms_of(const struct bind_pose *bind, const struct skeleton *skeleton,
                                          struct bone_transforms *out);

// The bind pose's joints as the posture places them.
struct skeleton bone_transforms_skeleton(const struct bind_pose *bind, const struct bone_transforms *transforms);

// How a point of the bind pose goes with its bones; the weights add up to 1, the heaviest comes first.
enum { SKIN_BONES = 3 };
struct skin_weights {
    uint8_t bone[SKIN_BONES];
    float weight[SKIN_BONES];
};
struct skin_weights bind_pose_skin_weights(const struct bind_pose *bind, struct vec3 point);

// Where a point of the bind pose and its normal are in `posture`.
void linear_blend_skin(const struct skin_weights *skin, const struct bone_transforms *transforms, struct vec3 point,
                       struct vec3 normal, struct vec3 *p, struct vec3 *n);

// Which bone shows at a place of `part`: the part itself or what hangs on its end. bind_from: of each bone, from the
// place's axes.
int bind_pose_bone_at(const struct bind_pose *bind, enum part part, struct vec3 place,
                      const struct pose bind_from[BONE_COUNT]);

// Distance of a point from the nearest part's cylinder with round ends; negative inside.
double bind_pose_distance(const struct bind_pose *bind, struct vec3 point);
