#include "reenact/skeleton/skeleton_track.h"

#include "reenact/skeleton/bind_pose.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- joint noise

// Estimates joint noise from registrations.

// Chosen by hand.
static const double PRIOR_M = 0.06, PRIOR_RAD = 0.5;
static const double PRIOR_END_RAD = 1.2; // joints do not determine the rotation of skull, hands and feet
static const double MIN_M = 0.003, MIN_RAD = 0.03;

struct joint_noise joint_noise_prior(void)
{
    struct joint_noise e;
    for (int b = 0; b < BONE_COUNT; b++) {
        e.m[b] = PRIOR_M;
        e.rad[b] = b < PART_COUNT ? PRIOR_RAD : PRIOR_END_RAD;
    }
    return e;
}

void joint_noise_add(struct joint_noise_sum *sum, const struct bind_pose *bind,
                     const struct pose correction[BONE_COUNT], const struct joint_noise *uncertainty)
{
    for (int b = 0; b < BONE_COUNT; b++) {
        const struct vec3 middle = bone_frame_midpoint(&bind->frame[b]);
        const struct vec3 moved = v3_sub(pose_apply(correction[b], middle), middle);
        const struct vec3 rotated = quat_to_rotation_vector(correction[b].rotation);
        sum->m2[b] += v3_dot(moved, moved) / 3 + uncertainty->m[b] * uncertainty->m[b];
        sum->rad2[b] += v3_dot(rotated, rotated) / 3 + uncertainty->rad[b] * uncertainty->rad[b];
    }
    sum->frames++;
}

struct joint_noise joint_noise_estimate(const struct joint_noise_sum *sum)
{
    struct joint_noise e = joint_noise_prior();
    for (int b = 0; b < BONE_COUNT && sum->frames > 0; b++) {
        e.m[b] = fmax(MIN_M, fmin(e.m[b], sqrt(sum->m2[b] / sum->frames)));
        e.rad[b] = fmax(MIN_RAD, fmin(e.rad[b], sqrt(sum->rad2[b] / sum->frames)));
    }
    return e;
}

// ---------------------------------------------------------------- joint inpainting

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
static void set_inpainted_covariance(struct skeleton *skeleton, const struct bone_ends *bone, double variance_m2)
{
    const struct covariance3 from = joint_covariance(skeleton, bone->from), walk = covariance3_isotropic(variance_m2),
                             sum = covariance3_add(&from, &walk);
    skeleton->covariance[bone->to] = skeleton->covariance[bone->from];
    if (covariance_is_known(skeleton->covariance[bone->from]))
        joint_set_covariance(skeleton, bone->to, &sum);
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

// ---------------------------------------------------------------- take skeletons

struct take_skeletons {
    const struct take *take;
    struct skeleton **inpainted; // of each frame; NULL: nothing was inpainted there
};

// Keeps a copy only where inpainting changed a joint.
static enum status keep_if_changed(struct take_skeletons *skeletons, int64_t frame)
{
    const struct take_entry *e = take_entry(skeletons->take, frame);
    if (!e->has_skeleton)
        return OK;
    const struct skeleton inpainted = inpaint_skeleton(skeletons->take, frame);
    if (!memcmp(inpainted.confidence, e->skeleton.confidence, sizeof inpainted.confidence))
        return OK;
    skeletons->inpainted[frame] = malloc(sizeof inpainted);
    if (!skeletons->inpainted[frame])
        return fail(ERR_MEMORY, "no memory for the take's skeletons");
    *skeletons->inpainted[frame] = inpainted;
    return OK;
}

enum status take_skeletons_open(struct take_skeletons **out, const struct take *take)
{
    const int64_t frames = take_frame_count(take);
    struct take_skeletons *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the take's skeletons");
    s->take = take;
    s->inpainted = calloc((size_t)frames + 1, sizeof *s->inpainted);
    enum status status = s->inpainted ? OK : fail(ERR_MEMORY, "no memory for the take's skeletons");
    for (int64_t i = 0; i < frames && status == OK; i++)
        status = keep_if_changed(s, i);
    if (status != OK)
        take_skeletons_close(out);
    return status;
}

void take_skeletons_close(struct take_skeletons **out)
{
    struct take_skeletons *s = *out;
    if (!s)
        return;
    for (int64_t i = 0; s->inpainted && i < take_frame_count(s->take); i++)
        free(s->inpainted[i]);
    free(s->inpainted);
    free(s);
    *out = NULL;
}

const struct skeleton *take_skeletons_at(const struct take_skeletons *skeletons, int64_t frame)
{
    const struct skeleton *recorded = &take_entry(skeletons->take, frame)->skeleton;
    return skeletons->inpainted[frame] ? skeletons->inpainted[frame] : recorded;
}

// ---------------------------------------------------------------- skeleton track

static const int64_t MAX_GAP_NS = 500000000; // chosen by hand

struct skeleton_track {
    const struct take *take;
    const struct take_skeletons *skeletons;
    int32_t *frames; // of the take, those with a usable skeleton
    int64_t count;
    bool has_place; // some frame has a measured camera pose
};

// Without a place: a world with z up for a camera held level.
static const struct pose level_world_from_camera = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, 0, 0}};

// The i-th usable frame's time since the take's first frame.
static int64_t time_at(const struct skeleton_track *track, int64_t i)
{
    return take_entry(track->take, track->frames[i])->time_ns - take_entry(track->take, 0)->time_ns;
}

static struct pose world_from_camera_at(const struct skeleton_track *track, int64_t i)
{
    return track->has_place ? take_entry(track->take, track->frames[i])->world_from_camera : level_world_from_camera;
}

static struct skeleton recorded_at(const struct skeleton_track *track, int64_t i)
{
    return skeleton_transform(world_from_camera_at(track, i), &take_entry(track->take, track->frames[i])->skeleton);
}

static struct skeleton inpainted_at(const struct skeleton_track *track, int64_t i)
{
    return skeleton_transform(world_from_camera_at(track, i), take_skeletons_at(track->skeletons, track->frames[i]));
}

static enum status check_finite(const struct skeleton_track *track, int64_t i)
{
    const struct skeleton *s =
        &take_entry(track->take, track->frames[i])->skeleton; // moved alone, without its covariances
    const struct pose world_from_camera = world_from_camera_at(track, i);
    for (int j = 0; j < JOINT_COUNT; j++)
        if (s->confidence[j] > 0 && !v3_finite(pose_apply(world_from_camera, s->joint[j])))
            return fail(ERR_INPUT, "frame %lld of the take holds a %s that is nowhere; repair the file",
                        (long long)track->frames[i], joint_name((enum joint)j));
    return OK;
}

enum status skeleton_track_open(struct skeleton_track **out, const struct take *take,
                                const struct take_skeletons *skeletons)
{
    const int64_t frames = take_frame_count(take);
    struct skeleton_track *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "no memory for the take's skeletons");
    m->take = take;
    m->skeletons = skeletons;
    m->has_place = take_is_located(take);
    m->frames = malloc(sizeof *m->frames * (size_t)(frames + 1));
    enum status status = m->frames ? OK : fail(ERR_MEMORY, "no memory for the take's skeletons");
    for (int64_t i = 0; i < frames && status == OK; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || (m->has_place && !e->located))
            continue;
        m->frames[m->count] = (int32_t)i;
        status = check_finite(m, m->count++);
    }
    if (status == OK && !m->count)
        status = fail(ERR_INPUT, "the take has no skeleton, so there is no actor to show");
    if (status != OK)
        skeleton_track_close(out);
    return status;
}

void skeleton_track_close(struct skeleton_track **track)
{
    if (!*track)
        return;
    free((*track)->frames);
    free(*track);
    *track = NULL;
}

// The first usable frame after time_ns; track->count: there is none.
static int64_t first_after(const struct skeleton_track *track, int64_t time_ns)
{
    int64_t low = 0, high = track->count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (time_at(track, middle) > time_ns)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

// Between two frames the covariance is mixed as the position is: (1 - t) A + t B bounds the true one whatever the
// correlation of the two errors is, and is it where they are equal. Squared weights would take the errors as
// independent, but neighbouring frames share most of theirs (a hidden limb's guess, cloth, the model): a joint would
// seem to be known better between two frames than in either. Not known in one: not known.
static void mix_covariances(const struct skeleton *a, const struct skeleton *b, enum joint joint, double t,
                            struct skeleton *out)
{
    struct covariance3 before = joint_covariance(a, joint), after = joint_covariance(b, joint);
    before = covariance3_scale(&before, 1 - t);
    after = covariance3_scale(&after, t);
    before = covariance3_add(&before, &after);
    if (covariance_is_known(a->covariance[joint]) && covariance_is_known(b->covariance[joint]))
        joint_set_covariance(out, joint, &before);
    else
        out->covariance[joint] = (struct covariance_root){{0}};
}

// Joints between frames a and b; what one of the two does not know stays as in *out.
static void interpolate_joints(const struct skeleton_track *track, int64_t before, int64_t after, double t,
                               struct skeleton *out)
{
    const struct skeleton a = inpainted_at(track, before), b = inpainted_at(track, after);
    for (int j = 0; j < JOINT_COUNT; j++)
        if (a.confidence[j] > 0 && b.confidence[j] > 0) {
            out->joint[j] = v3_mix(a.joint[j], b.joint[j], t);
            out->confidence[j] = fminf(a.confidence[j], b.confidence[j]);
            mix_covariances(&a, &b, (enum joint)j, t, out);
        }
}

enum status skeleton_track_at(const struct skeleton_track *track, int64_t time_ns, bool smooth,
                              struct track_sample *out)
{
    const int64_t next = first_after(track, time_ns);
    const int64_t after = next < track->count ? next : track->count - 1, before = next > 0 ? next - 1 : 0;
    const int64_t before_ns = time_at(track, before), after_ns = time_at(track, after);
    const int64_t nearest = llabs(time_ns - before_ns) <= llabs(after_ns - time_ns) ? before : after;
    if (llabs(time_ns - time_at(track, nearest)) > MAX_GAP_NS)
        return NOTHING;
    *out = (struct track_sample){
        .frame = track->frames[nearest],
        .skeleton = smooth ? inpainted_at(track, nearest) : recorded_at(track, nearest),
        .world_from_camera = world_from_camera_at(track, nearest),
    };
    if (smooth && before != after && time_ns > before_ns && after_ns - before_ns <= MAX_GAP_NS)
        interpolate_joints(track, before, after, (double)(time_ns - before_ns) / (double)(after_ns - before_ns),
                           &out->skeleton);
    return OK;
}
