#include "reenact/skeleton/joint_inpainting.h"

#include "reenact/skeleton/bone_frame.h"

#include <stdlib.h>

static const float CONFIDENCE = 0.5F; // of an inpainted joint
// Of a random walk of a lost joint against the one it hangs on, per axis: 20 cm after a second. Chosen by hand.
static const double WALK_M2_S = 0.04;

// From the trunk outwards, so that a forearm can follow an inpainted elbow.
static const struct bone_ends {
    enum joint from, to;
} bones[] = {
    {JOINT_NECK, JOINT_HEAD},
    {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
    {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
    {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
    {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
    {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
    {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
    {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
    {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
};

// The bone in the local axes of the frame's upper torso. False: one of the two is unknown.
static bool bone_in_trunk(const struct take *take, int64_t frame, const struct bone_ends *bone, struct vec3 *out)
{
    const struct take_entry *e = take_entry(take, frame);
    const struct skeleton *s = &e->skeleton;
    struct bone_frame trunk;
    if (!e->has_skeleton || !(s->confidence[bone->from] > 0) || !(s->confidence[bone->to] > 0) ||
        !bone_frame_body_aligned(s, PART_UPPER_TORSO, &trunk))
        return false;
    *out = bone_frame_local_direction(&trunk, v3_sub(s->joint[bone->to], s->joint[bone->from]));
    return true;
}

// The nearest frame before (step -1) or after (1) that knows the bone, and its distance in time. False: none within
// INPAINT_MAX_GAP_NS.
static bool nearest_known(const struct take *take, int64_t frame, int step, const struct bone_ends *bone,
                          struct vec3 *out, int64_t *gap_ns)
{
    for (int64_t i = frame + step; i >= 0 && i < take_frame_count(take); i += step) {
        *gap_ns = llabs(take_entry(take, i)->time_ns - take_entry(take, frame)->time_ns);
        if (*gap_ns > INPAINT_MAX_GAP_NS)
            return false;
        if (bone_in_trunk(take, i, bone, out))
            return true;
    }
    return false;
}

// The bone in the upper torso's axes, interpolated, and the variance of its far end per axis: of a random walk from the
// frame that knows it, or of a Brownian bridge between two. False: unknown on both sides.
static bool inpaint_bone(const struct take *take, int64_t frame, const struct bone_ends *bone, struct vec3 *out,
                         double *variance_m2)
{
    struct vec3 before, after;
    int64_t since_ns, until_ns;
    const bool has_before = nearest_known(take, frame, -1, bone, &before, &since_ns);
    const bool has_after = nearest_known(take, frame, 1, bone, &after, &until_ns);
    if (!has_before && !has_after)
        return false;
    double t = has_before ? 0 : 1;
    if (has_before && has_after)
        t = (double)since_ns / (double)(since_ns + until_ns);
    const double gap_ns = (has_before ? (1 - t) * (double)since_ns : 0) + (has_after ? t * (double)until_ns : 0);
    *variance_m2 = WALK_M2_S * gap_ns * 1e-9 * (has_before && has_after ? 0.5 : 1);
    if (!has_before)
        before = after;
    if (!has_after)
        after = before;
    const struct vec3 mixed = v3_mix(before, after, t);
    const double length = (1 - t) * v3_length(before) + t * v3_length(after);
    const struct vec3 nearer = t < 0.5 ? before : after;
    *out = v3_length(mixed) > 0.1 * length ? v3_scale(v3_unit(mixed), length) : nearer;
    return true;
}

// A joint at the end of an inpainted bone: its error is that of the joint it hangs on and the bone's. Where the first
// is not known, neither is the sum.
static void set_inpainted_covariance(struct skeleton *s, const struct bone_ends *bone, double variance_m2)
{
    const struct covariance3 from = joint_covariance(s, bone->from), walk = covariance3_isotropic(variance_m2),
                             sum = covariance3_add(&from, &walk);
    s->covariance[bone->to] = s->covariance[bone->from];
    if (covariance_is_known(s->covariance[bone->from]))
        joint_set_covariance(s, bone->to, &sum);
}

struct skeleton inpaint_skeleton(const struct take *take, int64_t frame)
{
    struct skeleton s = take_entry(take, frame)->skeleton;
    struct bone_frame trunk;
    if (!bone_frame_body_aligned(&s, PART_UPPER_TORSO, &trunk))
        return s;
    for (size_t i = 0; i < COUNT_OF(bones); i++) {
        struct vec3 b;
        double variance_m2;
        if (s.confidence[bones[i].to] > 0 || !(s.confidence[bones[i].from] > 0) ||
            !inpaint_bone(take, frame, &bones[i], &b, &variance_m2))
            continue;
        const struct vec3 bone = v3_add(v3_add(v3_scale(trunk.x, b.x), v3_scale(trunk.y, b.y)), v3_scale(trunk.z, b.z));
        s.joint[bones[i].to] = v3_add(s.joint[bones[i].from], bone);
        s.confidence[bones[i].to] = CONFIDENCE;
        set_inpainted_covariance(&s, &bones[i], variance_m2);
    }
    return s;
}
