#include "capture/coaching/raised_hand.h"

#include "capture/coaching/coverage.h"

// All chosen by hand.
static const double ABOVE_HEAD_M =
    0.12; // the hand over the head's joint: over the crown of a child, at an adult's brow
static const double HAND_SPEED = 0.6, TRUNK_SPEED = 0.3; // metres a second
static const double FACING_RAD = 1.05, GAP_S = 0.15;
static const double UPRIGHT_COSINE = 0.87; // against the camera's vertical, which a stand keeps within some degrees

static double height_above(const struct surface_pose *pose, struct vec3 p, struct vec3 from)
{
    return v3_dot(v3_sub(p, from), pose->up);
}

// Whether this side's hand is up and the other one is down.
static bool hand_is_up(const struct skeleton *skeleton, const struct surface_pose *pose, bool left)
{
    const enum joint hand = left ? JOINT_LEFT_HAND : JOINT_RIGHT_HAND,
                     elbow = left ? JOINT_LEFT_ELBOW : JOINT_RIGHT_ELBOW,
                     shoulder = left ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER,
                     other = left ? JOINT_RIGHT_HAND : JOINT_LEFT_HAND,
                     other_shoulder = left ? JOINT_RIGHT_SHOULDER : JOINT_LEFT_SHOULDER;
    // An inferred hand will do: above the head the tracker calls a good one inferred every other frame.
    if (skeleton->confidence[hand] <= 0 || skeleton->confidence[JOINT_HEAD] <= 0 ||
        skeleton->confidence[shoulder] <= 0 || skeleton->confidence[elbow] <= 0 || skeleton->confidence[other] <= 0)
        return false;
    return height_above(pose, skeleton->joint[hand], skeleton->joint[JOINT_HEAD]) > ABOVE_HEAD_M * pose->scale &&
           height_above(pose, skeleton->joint[hand], skeleton->joint[elbow]) > 0 &&
           height_above(pose, skeleton->joint[elbow], skeleton->joint[shoulder]) > -0.05 &&
           height_above(pose, skeleton->joint[other], skeleton->joint[other_shoulder]) < -0.25 * pose->scale;
}

bool raised_hand_next(struct raised_hand *hand, int64_t time_ns, const struct skeleton *skeleton)
{
    struct surface_pose pose;
    const double passed_s = (double)(time_ns - hand->last_ns) * 1e-9;
    bool up = false;
    if (skeleton && surface_pose_of(skeleton, &pose)) {
        const struct vec3 hands[2] = {skeleton->joint[JOINT_RIGHT_HAND], skeleton->joint[JOINT_LEFT_HAND]},
                          trunk = skeleton->joint[JOINT_WAIST];
        const bool steady = hand->any && passed_s > 0 && v3_distance(trunk, hand->last_trunk) < TRUNK_SPEED * passed_s;
        const bool ready = steady && -pose.up.y > UPRIGHT_COSINE && fabs(coverage_facing(&pose)) < FACING_RAD;
        for (int left = 0; left < 2 && ready; left++)
            up |= hand_is_up(skeleton, &pose, left) &&
                  v3_distance(hands[left], hand->last_hand[left]) < HAND_SPEED * passed_s;
        for (int k = 0; k < 2; k++)
            hand->last_hand[k] = hands[k];
        hand->last_trunk = trunk;
        hand->any = true;
    } else {
        hand->any = false;
    }
    hand->last_ns = time_ns;
    if (up)
        hand->up_ns = time_ns;
    if (!up) { // a single frame in which the tracker errs interrupts nothing
        if (!hand->since_ns || (double)(time_ns - hand->up_ns) * 1e-9 > GAP_S) {
            hand->since_ns = 0;
            hand->given = false;
        }
        return false;
    }
    if (!hand->since_ns)
        hand->since_ns = time_ns;
    if (hand->given || (double)(time_ns - hand->since_ns) * 1e-9 < RAISED_HAND_S)
        return false;
    hand->given = true;
    return true;
}
