#include "tests/support/dice_score.h"

#include "base/linear_algebra.h"
#include "tests/support/body_axes.h"

#include <math.h>

bool dice_has_person(const struct skeleton *s)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (s->confidence[j] > 0)
            return true;
    return false;
}

bool dice_is_swapped(const struct skeleton *got, const struct skeleton *truth, enum dice_swap swap)
{
    static const enum joint pair[DICE_SWAPS][2][2] = {
        [DICE_SWAP_ARMS] = {{JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW}, {JOINT_LEFT_HAND, JOINT_RIGHT_HAND}},
        [DICE_SWAP_LEGS] = {{JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE}, {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT}},
        [DICE_SWAP_BODY] = {{JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER}, {JOINT_LEFT_HIP, JOINT_RIGHT_HIP}},
    };
    double kept = 0, crossed = 0, apart = 0;
    for (int i = 0; i < 2; i++) {
        const enum joint l = pair[swap][i][0], r = pair[swap][i][1];
        if (!(got->confidence[l] > 0 && got->confidence[r] > 0))
            return false;
        kept += v3_distance(got->joint[l], truth->joint[l]) + v3_distance(got->joint[r], truth->joint[r]);
        crossed += v3_distance(got->joint[l], truth->joint[r]) + v3_distance(got->joint[r], truth->joint[l]);
        apart += 0.5 * v3_distance(truth->joint[l], truth->joint[r]);
    }
    return apart > DICE_WRONG_M && crossed < 0.5 * kept;
}

static double mahalanobis2(const struct skeleton *got, enum joint j, struct vec3 off)
{
    const struct covariance3 c = joint_covariance(got, j);
    const double m[9] = {c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz}, d[3] = {off.x, off.y, off.z};
    double inverse[9], square = 0;
    if (!invert_symmetric(m, 3, inverse))
        return INFINITY;
    for (int i = 0; i < 9; i++)
        square += d[i / 3] * inverse[i] * d[i % 3];
    return square;
}

struct dice_joint dice_joint_of(const struct dice_frame *frame, enum dice_mode mode, enum joint j,
                                const struct dice_rig *rig)
{
    const struct skeleton *got = &frame->track[mode];
    struct dice_joint out = {.confidence = got->confidence[j]};
    if (!covariance_is_known(got->covariance[j]))
        return out;
    out.off_m = v3_sub(got->joint[j], frame->truth.joint[j]);
    out.error_m = v3_length(out.off_m);
    out.less_off_m = v3_sub(out.off_m, from_body_axes(&frame->truth, j, rig->constant[j]));
    out.less_m = v3_length(out.less_off_m);
    out.mahalanobis2 = mahalanobis2(got, j, out.less_off_m);
    return out;
}

struct dice_rig dice_rig_of(const struct dice_film *films, int count, enum dice_mode mode)
{
    struct dice_rig rig = {0};
    int used[JOINT_COUNT] = {0};
    for (int i = 0; i < count; i++)
        for (int k = 0; films[i].frame && k < films[i].plan.frames; k++)
            for (int j = 0; j < JOINT_COUNT; j++) {
                const struct dice_frame *f = &films[i].frame[k];
                const struct vec3 off = v3_sub(f->track[mode].joint[j], f->truth.joint[j]);
                if (f->sight[j] != DICE_VISIBLE || !(f->track[mode].confidence[j] > 0) ||
                    !(v3_length(off) < DICE_WRONG_M))
                    continue;
                rig.constant[j] = v3_add(rig.constant[j], in_body_axes(&f->truth, (enum joint)j, off));
                used[j]++;
            }
    for (int j = 0; j < JOINT_COUNT; j++)
        rig.constant[j] = v3_scale(rig.constant[j], used[j] ? 1.0 / used[j] : 0);
    return rig;
}

// ---------------------------------------------------------------- sums

struct count {
    long of, all;
};

static void add(struct count *c, bool is)
{
    c->of += is;
    c->all++;
}

static double percent(struct count c) { return c.all ? 100.0 * (double)c.of / (double)c.all : NAN; }

struct sums {
    struct count lost, ghosts, followed_other, within_seen, within_hidden, within_all;
    struct count swapped[DICE_SWAPS], swapped_any, sure_wrong, guessed_wrong, sure, guessed, unknown, sure_inside,
        guessed_inside;
    double angle_rad;
    long angles;
    // Of the film at hand.
    double error_m, less_m;
    int claimed;
};

static bool follows_other(const struct dice_frame *f, const struct skeleton *got)
{
    double own = 0, other = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (got->confidence[j] > 0) {
            own += v3_distance(got->joint[j], f->truth.joint[j]);
            other += v3_distance(got->joint[j], f->passerby.joint[j]);
        }
    return other < own;
}

static void add_joint(struct sums *s, const struct dice_joint *joint, enum dice_sight sight)
{
    const bool claimed = joint->confidence > 0, sure = joint->confidence >= 1;
    const bool close = claimed && joint->error_m < DICE_WITHIN_M;
    add(&s->within_all, close);
    if (dice_can_be_seen(sight))
        add(&s->within_seen, close);
    if (sight == DICE_HIDDEN)
        add(&s->within_hidden, close);
    if (claimed) {
        add(sure ? &s->sure_wrong : &s->guessed_wrong, joint->error_m > DICE_WRONG_M);
        add(sure ? &s->sure_inside : &s->guessed_inside, joint->mahalanobis2 <= DICE_WITHIN_95);
    }
    if (claimed && dice_can_be_seen(sight)) {
        s->error_m += joint->error_m;
        s->less_m += joint->less_m;
        s->claimed++;
    }
}

static void add_person(struct sums *s, const struct dice_frame *f, const struct skeleton *got)
{
    bool any = false;
    for (int swap = 0; swap < DICE_SWAPS; swap++) {
        const bool is = dice_is_swapped(got, &f->truth, (enum dice_swap)swap);
        add(&s->swapped[swap], is);
        any = any || is;
    }
    add(&s->swapped_any, any);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const float c = got->confidence[j];
        add(&s->sure, c >= 1);
        add(&s->guessed, c > 0 && c < 1);
        add(&s->unknown, !(c > 0));
    }
    if (dice_has_person(&f->passerby))
        add(&s->followed_other, follows_other(f, got));
}

static double angle_rad(const struct skeleton *s, const enum joint at[3])
{
    const struct vec3 a = v3_unit(v3_sub(s->joint[at[0]], s->joint[at[1]])),
                      b = v3_unit(v3_sub(s->joint[at[2]], s->joint[at[1]]));
    return atan2(v3_length(v3_cross(a, b)), v3_dot(a, b));
}

static void add_angles(struct sums *s, const struct dice_frame *f, const struct skeleton *got)
{
    static const enum joint angles[][3] = {
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
        {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
        {JOINT_LEFT_HIP, JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
        {JOINT_RIGHT_HIP, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
        {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
        {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
        {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
    };
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i++) {
        bool known = true;
        for (int k = 0; k < 3; k++)
            known = known && got->confidence[angles[i][k]] > 0 && dice_can_be_seen(f->sight[angles[i][k]]);
        if (!known)
            continue;
        s->angle_rad += fabs(angle_rad(got, angles[i]) - angle_rad(&f->truth, angles[i]));
        s->angles++;
    }
}

// Returns whether the frame counts.
static bool add_frame(struct sums *s, const struct dice_frame *f, enum dice_mode mode, const struct dice_rig *rig)
{
    const struct skeleton *got = &f->track[mode];
    const bool person = dice_has_person(got);
    int seen = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        seen += dice_can_be_seen(f->sight[j]);
    if (!seen)
        add(&s->ghosts, person);
    if (2 * seen < JOINT_COUNT)
        return false;
    add(&s->lost, !person);
    if (person)
        add_person(s, f, got);
    add_angles(s, f, got);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct dice_joint joint = dice_joint_of(f, mode, (enum joint)j, rig);
        add_joint(s, &joint, f->sight[j]);
    }
    return true;
}

static void finish(struct dice_measure *m, const struct sums *s)
{
    m->lost = percent(s->lost);
    m->angle_degrees = s->angles ? s->angle_rad * 57.29577951308232 / (double)s->angles : NAN;
    m->ghosts = percent(s->ghosts);
    m->followed_other = percent(s->followed_other);
    m->within_seen = percent(s->within_seen);
    m->within_hidden = percent(s->within_hidden);
    m->within_all = percent(s->within_all);
    for (int i = 0; i < DICE_SWAPS; i++)
        m->swapped[i] = percent(s->swapped[i]);
    m->swapped_any = percent(s->swapped_any);
    m->sure_wrong = percent(s->sure_wrong);
    m->guessed_wrong = percent(s->guessed_wrong);
    m->sure = percent(s->sure);
    m->guessed = percent(s->guessed);
    m->unknown = percent(s->unknown);
    m->sure_inside = percent(s->sure_inside);
    m->guessed_inside = percent(s->guessed_inside);
}

struct dice_measure dice_measure_of(const struct dice_film *films, int count, enum dice_mode mode,
                                    const struct dice_rig *rig, struct dice_group group)
{
    struct dice_measure m = {0};
    struct sums s = {0};
    double mean = 0, logs = 0, less = 0;
    int with_mean = 0;
    for (int i = 0; i < count; i++) {
        const struct dice_film *film = &films[i];
        int frames = 0;
        s.error_m = s.less_m = s.claimed = 0;
        for (int k = 0; film->frame && k < film->plan.frames; k++)
            if (!group.has || group.has(film, &film->frame[k], group.value))
                frames += add_frame(&s, &film->frame[k], mode, rig);
        m.frames += frames;
        m.films += frames > 0;
        if (!s.claimed)
            continue;
        mean += s.error_m / s.claimed;
        less += s.less_m / s.claimed;
        logs += log(fmax(1e-6, s.error_m / s.claimed));
        with_mean++;
    }
    m.mean_mm = with_mean ? 1000 * mean / with_mean : NAN;
    m.less_mm = with_mean ? 1000 * less / with_mean : NAN;
    m.geometric_mm = with_mean ? 1000 * exp(logs / with_mean) : NAN;
    finish(&m, &s);
    return m;
}
