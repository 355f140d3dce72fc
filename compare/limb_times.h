// One joint's difference between two aligned movements, at the limb's own time.
//
// A joint's part is looked at against what carries it: head and upper arms against the chest (the trunk's direction and
// the shoulders' line), thighs against the hips, forearms and shins against upper arms and thighs. A's direction is
// turned as A's carrier has to be turned onto B's; what remains is the joint's own difference.
#pragma once
#include "compare/angles.h"
#include "compare/difference.h"

enum carrier { CARRIER_NONE, CARRIER_TRUNK, CARRIER_PART };

struct body_joint {
    enum part part;
    enum carrier carrier;
    enum part carried_by; // where CARRIER_PART
    enum body_angle angle;
    int limb; // 0..3: left arm, right arm, left leg, right leg; -1: none
};
enum { BODY_JOINTS = 10, LIMBS = 4 };
extern const struct body_joint body_joints[BODY_JOINTS];

// Difference of the part's directions, B - A, upright frame. sigma: of its length, rad. False: a part is unknown.
bool joint_difference(const struct movement_frame *a, const struct movement_frame *b, const struct body_joint *j,
                      double difference[3], double *sigma);

struct limb_shift {
    int8_t frames; // of A, to be added to the timeline
    bool late;
};
// out: of each limb [count of the timeline]: the shift with which over a second before and after the limb fits best; up
// to 4 frames always, up to 15 (0.5 s) where that explains nearly half of a difference: then `late`. Of attempts above
// ten minutes not every frame is looked at. ERR_MEMORY.
MUST_CHECK enum status limb_shifts(const struct movement *a, const struct movement *b, const struct timeline *t,
                                   struct limb_shift *out[LIMBS]);
