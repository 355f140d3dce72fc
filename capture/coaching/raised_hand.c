#include "capture/coaching/raised_hand.h"

#include "capture/coaching/coverage.h"

// All chosen by hand.
static const double ABOVE_HEAD_M =
    0.12; // the hand over the head's joint: over the crown of a child, at an adult's brow
static const double HAND_SPEED = 0.6, TRUNK_SPEED = 0.3; // metres a second
static const double FACING_RAD = 1.05, GAP_S = 0.15;
static const double UPRIGHT_COSINE = 0.87; // against the camera's vertical, which a stand keeps within some degrees

static double height(const struct surface_pose *pose, struct vec3 p, struct vec3 from)
{
    return v3_dot(v3_sub(p, from), pose->up);
}

// Whether this side's hand is up and the other one is down.
static bool hand_is_up(const struct skeleton *s, const struct surface_pose *pose, bool left)
{
    const enum joint hand = left ? JOINT_LEFT_HAND : JOINT_RIGHT_HAND,
                     elbow = left ? JOINT_LEFT_ELBOW : JOINT_RIGHT_ELBOW,
                     shoulder = left ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER,
                     other = left ? JOINT_RIGHT_HAND : JOINT_LEFT_HAND,
                     other_shoulder = left ? JOINT_RIGHT_SHOULDER : JOINT_LEFT_SHOULDER;
    // An inferred hand will do: above the head the tracker calls a good one inferred every other frame.
    if (s->confidence[hand] <= 0 || s->confidence[JOINT_HEAD] <= 0 || s->confidence[shoulder] <= 0 ||
        s->confidence[elbow] <= 0 || s->confidence[other] <= 0)
        return false;
    return height(pose, s->joint[hand], s->joint[JOINT_HEAD]) > ABOVE_HEAD_M * pose->scale &&
           height(pose, s->joint[hand], s->joint[elbow]) > 0 &&
           height(pose, s->joint[elbow], s->joint[shoulder]) > -0.05 &&
           height(pose, s->joint[other], s->joint[other_shoulder]) < -0.25 * pose->scale;
}

bool raised_hand_next(struct raised_hand *g, int64_t time_ns, const struct skeleton *s)
{
    struct surface_pose pose;
    const double passed_s = (double)(time_ns - g->last_ns) * 1e-9;
    bool up = false;
    if (s && surface_pose_of(s, &pose)) {
        const struct vec3 hands[2] = {s->joint[JOINT_RIGHT_HAND], s->joint[JOINT_LEFT_HAND]},
                          trunk = s->joint[JOINT_WAIST];
        const bool steady = g->any && passed_s > 0 && v3_distance(trunk, g->last_trunk) < TRUNK_SPEED * passed_s;
        const bool ready = steady && -pose.up.y > UPRIGHT_COSINE && fabs(coverage_facing(&pose)) < FACING_RAD;
        for (int left = 0; left < 2 && ready; left++)
            up |= hand_is_up(s, &pose, left) && v3_distance(hands[left], g->last_hand[left]) < HAND_SPEED * passed_s;
        for (int k = 0; k < 2; k++)
            g->last_hand[k] = hands[k];
        g->last_trunk = trunk;
        g->any = true;
    } else {
        g->any = false;
    }
    g->last_ns = time_ns;
    if (up)
        g->up_ns = time_ns;
    if (!up) { // a single frame in which the tracker errs interrupts nothing
        if (!g->since_ns || (double)(time_ns - g->up_ns) * 1e-9 > GAP_S) {
            g->since_ns = 0;
            g->given = false;
        }
        return false;
    }
    if (!g->since_ns)
        g->since_ns = time_ns;
    if (g->given || (double)(time_ns - g->since_ns) * 1e-9 < RAISED_HAND_S)
        return false;
    g->given = true;
    return true;
}
