// The rest pose, in which the person's likeness is gathered: upright, arms and legs
// held apart so that no two limbs touch. And postures: where every part of the
// rest pose is at an instant. Pure.
#pragma once
#include "capture/recording/recording.h"
#include "reenact/part_frame.h"

// Metres; axes: x to the person's left, y down, z to the back; 0 is the neck.
struct rest {
    struct skeleton skeleton;
    bool known[PART_COUNT];
    struct part_frame frame[PART_COUNT]; // bodily; of the known parts
    double radius[PART_COUNT];           // of the parts' cylinders
};

// From the take's median bone lengths. NOTHING: its trunk was never seen whole.
MUST_CHECK enum status rest_make(struct rest *out, const struct take *take);

// Two parts that meet, and where.
struct part_link {
    enum part a, b;
    enum joint joint;
};
enum { PART_LINKS = 10 };
extern const struct part_link part_links[PART_LINKS];
bool parts_meet(enum part a, enum part b); // or are the same

// Where each known part of the rest pose is: maps rest axes into the axes of a skeleton.
struct posture {
    struct pose part[PART_COUNT];
};

// As the skeleton's joints have it; a part that they do not know goes with the one
// it hangs on. NOTHING: the trunk is unknown.
MUST_CHECK enum status posture_of(const struct rest *rest, const struct skeleton *skeleton, struct posture *out);

// The rest pose's joints as the posture places them.
struct skeleton posture_skeleton(const struct rest *rest, const struct posture *posture);

// How a point of the rest pose goes with its parts; the weights add up to 1, the heaviest comes first.
enum { SKIN_PARTS = 3 };
struct skin {
    uint8_t part[SKIN_PARTS];
    float weight[SKIN_PARTS];
};
struct skin rest_skin(const struct rest *rest, struct vec3 point);

// Where a point of the rest pose and its normal are in `posture`.
void skin_place(const struct skin *skin, const struct posture *posture, struct vec3 point, struct vec3 normal,
                struct vec3 *p, struct vec3 *n);

// Distance of a point from the nearest part's cylinder with round ends; negative inside.
double rest_distance(const struct rest *rest, struct vec3 point);
