// The difference of two aligned movements, instant by instant of the attempt B.
#pragma once
#include "compare/alignment.h"
#include "compare/expectation.h"
#include "compare/feature_box.h"
#include "compare/movement.h"

enum verdict { VERDICT_UNKNOWN, VERDICT_SAME, VERDICT_DIFFERENT };
const char *verdict_name(enum verdict verdict); // "unknown", "same", "different"

// A part is different where its directions are more than this apart, the same where they are less. Chosen by hand,
// half-way between what a viewer does not notice (5 degrees) and does (15).
#define DIFFERENT_RAD (10 * 3.14159265358979323846 / 180)

// Of an angle between two directions and its standard deviation: which side of DIFFERENT_RAD it is on, at a level of
// VERDICT_LEVEL for a Gaussian error; unknown where neither is that sure, or the standard deviation is above 17
// degrees.
#define VERDICT_LEVEL 0.73
enum verdict verdict_of(double angle_rad, double sigma_rad);
// The same of another angle than DIFFERENT_RAD.
enum verdict verdict_within(double angle_rad, double sigma_rad, double different_rad);

struct part_difference {
    float angle_rad, sigma_rad; // NaN where unknown
    enum verdict verdict;
};

// The frame of A that a frame of B shows. NaN: none, B is getting into position or out of it.
struct timeline {
    float *reference; // [count], in frames of A
    int32_t count;
};
void timeline_free(struct timeline *timeline);
// From the pairs of an alignment. Where one frame of B stands for many of A (a piece of A is missing in B) it is the
// one it resembles most, else their mean, smoothed over 5 frames. ERR_MEMORY.
MUST_CHECK enum status timeline_from_alignment(const struct alignment *x, const struct features *a,
                                               const struct features *b, struct timeline *out);

// A movement's frame at any time, interpolated; known where both neighbours are.
struct movement_frame movement_at(const struct movement *movement, double frame);

// out: [PART_COUNT] of frame `frame` of B. The difference of the directions is averaged over 5 frames, and the variance
// of one axis is taken off its square: noise alone never points nowhere, and would be taken for an angle (two axes of
// it would be right for independent frames and an exact sigma; by hand).
void part_differences(const struct movement *a, const struct movement *b, const struct timeline *timeline,
                      int32_t frame, struct part_difference out[PART_COUNT]);

// Sets the verdicts by these tolerances: parts that do not matter are unknown.
void part_differences_judge(struct part_difference parts[PART_COUNT], const struct tolerances *by);

// ---------------------------------------------------------------- limb times

// One joint's difference between two aligned movements, at the limb's own time.
//
// A joint's part is looked at against what carries it: head and upper arms against the chest (the trunk's direction and
// the shoulders' line), thighs against the hips, forearms and shins against upper arms and thighs. A's direction is
// turned as A's carrier has to be turned onto B's; what remains is the joint's own difference. The trunk is looked at
// twice: where it points, and by the shoulders' line how it is turned against the hips.

enum carrier { CARRIER_NONE, CARRIER_TRUNK, CARRIER_PART };

struct body_joint {
    enum part part;
    enum carrier carrier;
    enum part carried_by; // where CARRIER_PART
    enum body_angle angle;
    int limb; // 0..3: left arm, right arm, left leg, right leg; -1: none
};
enum { BODY_JOINTS = 11, LIMBS = 4 };
extern const struct body_joint body_joints[BODY_JOINTS];

// Difference of the part's directions, B - A, upright frame. sigma: of its length, rad. False: a part is unknown.
bool joint_difference(const struct movement_frame *a, const struct movement_frame *b, const struct body_joint *joint,
                      double difference[3], double *sigma);

// The rotation from the upright frame into the chest's: across (to the left), ahead, along the trunk. False: the trunk
// or the shoulders are unknown.
bool chest_from_upright(const struct movement_frame *frame, struct quat *rotation);

struct limb_shift {
    int8_t frames; // of A, to be added to the timeline
    bool late;
};
// out: of each limb [count of the timeline]: the shift with which over a second before and after the limb fits best; up
// to 4 frames always, up to 15 (0.5 s) where that explains nearly half of a difference: then `late`. Of attempts above
// ten minutes not every frame is looked at. ignored: parts that have no say, as bits. ERR_MEMORY.
MUST_CHECK enum status limb_shifts(const struct movement *a, const struct movement *b, const struct timeline *t,
                                   uint16_t ignored, struct limb_shift *out[LIMBS]);
