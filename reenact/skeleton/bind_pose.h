// The rest pose, in which the person's likeness is gathered: upright, arms and legs
// held apart so that no two limbs touch. And postures: where every part of the
// rest pose is at an instant. Pure.
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
struct rest {
    struct skeleton skeleton;
    bool known[BONE_COUNT];
    struct part_frame frame[BONE_COUNT]; // bodily; of the known
    double own_length[BONE_COUNT];       // how far along it is itself: what hangs on it may begin before its end
    double radius[BONE_COUNT];           // of their cylinders
};

// From the take's median bone lengths. NOTHING: its trunk was never seen whole.
MUST_CHECK enum status rest_make(struct rest *out, const struct take *take);

// Two bones that meet, and where.
struct bone_link {
    int a, b;
    enum joint joint;
};
enum { BONE_LINKS = 15 };
extern const struct bone_link bone_links[BONE_LINKS];
bool bones_meet(int a, int b); // or are the same

// Where each known bone of the rest pose is: maps rest axes into the axes of a skeleton.
struct posture {
    struct pose bone[BONE_COUNT];
};

// As the skeleton's joints have it; what they do not know goes with the part
// it hangs on. NOTHING: the trunk is unknown.
MUST_CHECK enum status posture_of(const struct rest *rest, const struct skeleton *skeleton, struct posture *out);

// The rest pose's joints as the posture places them.
struct skeleton posture_skeleton(const struct rest *rest, const struct posture *posture);

// How a point of the rest pose goes with its bones; the weights add up to 1, the heaviest comes first.
enum { SKIN_BONES = 3 };
struct skin {
    uint8_t bone[SKIN_BONES];
    float weight[SKIN_BONES];
};
struct skin rest_skin(const struct rest *rest, struct vec3 point);

// Where a point of the rest pose and its normal are in `posture`.
void skin_place(const struct skin *skin, const struct posture *posture, struct vec3 point, struct vec3 normal,
                struct vec3 *p, struct vec3 *n);

// Which bone shows at a place of `part`: the part itself or what hangs on its end. rest_from: of each bone, from the
// place's axes.
int rest_bone(const struct rest *rest, enum part part, struct vec3 place, const struct pose rest_from[BONE_COUNT]);

// Distance of a point from the nearest part's cylinder with round ends; negative inside.
double rest_distance(const struct rest *rest, struct vec3 point);
