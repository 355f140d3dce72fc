#include "capture/body_steady.h"

#include <string.h>

#define DRIFT_S 0.08    // over this time drift is averaged
#define SPEED_S 0.25    // and speed over this
#define HOLD_S 2.0      // a limb that is held comes to the mean of its fits in this time
#define FOLLOW_M 0.04   // this far away nothing is held any more
#define FOLLOW_M_S 0.30 // nor when the fits move as fast as this
#define FASTEST_M_S 6.5 // of a thrown punch (McGill et al. 2010 have 6 to 10 m/s)

// What moves together: the trunk and four limbs.
enum { TRUNK, GROUPS = 5 };

static int group_of(int segment)
{
    return segment >= SEG_LEFT_UPPER_ARM && segment <= SEG_LEFT_HAND     ? 1
           : segment >= SEG_RIGHT_UPPER_ARM && segment <= SEG_RIGHT_HAND ? 2
           : segment >= SEG_LEFT_THIGH && segment <= SEG_LEFT_FOOT       ? 3
           : segment >= SEG_RIGHT_THIGH                                  ? 4
                                                                         : TRUNK;
}

static const struct { enum segment first, middle, end; enum joint bend, tip; } limb[GROUPS] = {
    {0},
    {SEG_LEFT_UPPER_ARM, SEG_LEFT_FOREARM, SEG_LEFT_HAND, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
    {SEG_RIGHT_UPPER_ARM, SEG_RIGHT_FOREARM, SEG_RIGHT_HAND, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
    {SEG_LEFT_THIGH, SEG_LEFT_SHIN, SEG_LEFT_FOOT, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
    {SEG_RIGHT_THIGH, SEG_RIGHT_SHIN, SEG_RIGHT_FOOT, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
};

void body_steady_start(struct body_steady *s, const struct body_pose *pose)
{
    *s = (struct body_steady){.pose = *pose};
    for (int j = 0; j < JOINT_COUNT; j++)
        s->fit[j].x = NAN;
}

// How much of the way to the fit each group goes.
static void find_gains(struct body_steady *s, const struct body_build *was, const struct body_build *is, double passed_s,
                       double gain[GROUPS])
{
    double share[GROUPS] = {0}, least = 1 - exp(-passed_s / HOLD_S);
    int group[JOINT_COUNT] = {0};
    for (int g = 1; g < GROUPS; g++)
        group[limb[g].bend] = group[limb[g].tip] = g;
    for (int j = 0; j < JOINT_COUNT; j++) {
        s->drift[j] = v3_mix(s->drift[j], v3_sub(is->joint[j], was->joint[j]), 1 - exp(-passed_s / DRIFT_S));
        if (!isnan(s->fit[j].x))
            s->speed[j] = v3_mix(s->speed[j], v3_scale(v3_sub(is->joint[j], s->fit[j]), 1 / passed_s),
                                 1 - exp(-passed_s / SPEED_S));
        s->fit[j] = is->joint[j];
        share[group[j]] = fmax(share[group[j]], v3_length(s->drift[j]) / FOLLOW_M + v3_length(s->speed[j]) / FOLLOW_M_S);
    }
    for (int g = 0; g < GROUPS; g++) {
        share[g] = fmin(1, share[g]);
        gain[g] = least + (1 - least) * share[g] * share[g];
    }
    for (int j = 0; j < JOINT_COUNT; j++)
        s->drift[j] = v3_scale(s->drift[j], 1 - gain[group[j]]);
}

// Segment by segment as the camera sees them: a trunk that trembles one way and limbs that
// tremble the other against it cancel out.
static void mix(const struct body_pose *from, const struct body_pose *to, const double gain[GROUPS],
                struct body_pose *out)
{
    struct quat a[SEG_COUNT], b[SEG_COUNT], mixed[SEG_COUNT];
    for (int i = 0; i < SEG_COUNT; i++) {
        int parent = body_parent((enum segment)i);
        a[i] = parent < 0 ? from->turn[i] : quat_multiply(a[parent], from->turn[i]);
        b[i] = parent < 0 ? to->turn[i] : quat_multiply(b[parent], to->turn[i]);
        mixed[i] = quat_slerp(a[i], b[i], gain[group_of(i)]);
        out->turn[i] = parent < 0 ? mixed[i] : quat_unit(quat_multiply(quat_conjugate(mixed[parent]), mixed[i]));
    }
    out->root = v3_mix(from->root, to->root, gain[TRUNK]);
}

// A limb found again elsewhere is told on its way there, not faster than a body moves.
static void keep_speed(const struct body_pose *was_pose, const struct body_build *was, const struct body_shape *shape,
                       const struct body_pose *wanted, double passed_s, struct body_pose *out)
{
    struct body_build is;
    double limit = FASTEST_M_S * passed_s, share[GROUPS] = {1, 1, 1, 1, 1};
    *out = *wanted;
    for (int round = 0; round < 4; round++) { // turns and distances are not quite proportional
        body_build(shape, out, &is);
        for (int g = 1; g < GROUPS; g++) {
            double far = fmax(v3_distance(was->origin[limb[g].middle], is.origin[limb[g].middle]),
                              v3_distance(was->origin[limb[g].end], is.origin[limb[g].end]));
            if (far <= limit)
                continue;
            share[g] *= 0.97 * limit / far;
            for (int i = (int)limb[g].first; i <= (int)limb[g].end; i++)
                out->turn[i] = quat_slerp(was_pose->turn[i], wanted->turn[i], share[g]);
        }
    }
}

void body_steady_next(struct body_steady *s, const struct body_shape *shape, const struct body_pose *pose,
                      double passed_s)
{
    struct body_build was, is;
    struct body_pose before = s->pose, wanted;
    double gain[GROUPS];
    body_build(shape, &before, &was);
    body_build(shape, pose, &is);
    find_gains(s, &was, &is, passed_s, gain);
    mix(&before, pose, gain, &wanted);
    keep_speed(&before, &was, shape, &wanted, passed_s, &s->pose);
}
