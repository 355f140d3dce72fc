#include "reenact/skeleton/skeleton_track.h"

#include <stdlib.h>

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
static int64_t time_at(const struct skeleton_track *m, int64_t i)
{
    return take_entry(m->take, m->frames[i])->time_ns - take_entry(m->take, 0)->time_ns;
}

static struct pose world_from_camera_at(const struct skeleton_track *m, int64_t i)
{
    return m->has_place ? take_entry(m->take, m->frames[i])->world_from_camera : level_world_from_camera;
}

static struct skeleton recorded_at(const struct skeleton_track *m, int64_t i)
{
    return skeleton_transform(world_from_camera_at(m, i), &take_entry(m->take, m->frames[i])->skeleton);
}

static struct skeleton inpainted_at(const struct skeleton_track *m, int64_t i)
{
    return skeleton_transform(world_from_camera_at(m, i), take_skeletons_at(m->skeletons, m->frames[i]));
}

static enum status check_finite(const struct skeleton_track *m, int64_t i)
{
    const struct skeleton *s = &take_entry(m->take, m->frames[i])->skeleton; // moved alone, without its covariances
    const struct pose world_from_camera = world_from_camera_at(m, i);
    for (int j = 0; j < JOINT_COUNT; j++)
        if (s->confidence[j] > 0 && !v3_finite(pose_apply(world_from_camera, s->joint[j])))
            return fail(ERR_INPUT, "frame %lld of the take holds a %s that is nowhere; repair the file",
                        (long long)m->frames[i], joint_name((enum joint)j));
    return OK;
}

enum status skeleton_track_open(struct skeleton_track **out, const struct take *take,
                                const struct take_skeletons *skeletons)
{
    const int64_t frames = take_frame_count(take);
    struct skeleton_track *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "out of memory");
    m->take = take;
    m->skeletons = skeletons;
    m->has_place = take_is_located(take);
    m->frames = malloc(sizeof *m->frames * (size_t)(frames + 1));
    enum status status = m->frames ? OK : fail(ERR_MEMORY, "out of memory");
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

void skeleton_track_close(struct skeleton_track **m)
{
    if (!*m)
        return;
    free((*m)->frames);
    free(*m);
    *m = NULL;
}

// The first usable frame after time_ns; m->count: there is none.
static int64_t first_after(const struct skeleton_track *m, int64_t time_ns)
{
    int64_t low = 0, high = m->count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (time_at(m, middle) > time_ns)
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
static void mix_covariances(const struct skeleton *a, const struct skeleton *b, enum joint j, double t,
                            struct skeleton *out)
{
    struct covariance3 before = joint_covariance(a, j), after = joint_covariance(b, j);
    before = covariance3_scale(&before, 1 - t);
    after = covariance3_scale(&after, t);
    before = covariance3_add(&before, &after);
    if (covariance_is_known(a->covariance[j]) && covariance_is_known(b->covariance[j]))
        joint_set_covariance(out, j, &before);
    else
        out->covariance[j] = (struct covariance_root){{0}};
}

// Joints between frames a and b; what one of the two does not know stays as in *out.
static void interpolate(const struct skeleton_track *m, int64_t before, int64_t after, double t, struct skeleton *out)
{
    const struct skeleton a = inpainted_at(m, before), b = inpainted_at(m, after);
    for (int j = 0; j < JOINT_COUNT; j++)
        if (a.confidence[j] > 0 && b.confidence[j] > 0) {
            out->joint[j] = v3_mix(a.joint[j], b.joint[j], t);
            out->confidence[j] = fminf(a.confidence[j], b.confidence[j]);
            mix_covariances(&a, &b, (enum joint)j, t, out);
        }
}

enum status skeleton_track_at(const struct skeleton_track *m, int64_t time_ns, bool smooth, struct track_sample *out)
{
    const int64_t next = first_after(m, time_ns);
    const int64_t after = next < m->count ? next : m->count - 1, before = next > 0 ? next - 1 : 0;
    const int64_t before_ns = time_at(m, before), after_ns = time_at(m, after);
    const int64_t nearest = llabs(time_ns - before_ns) <= llabs(after_ns - time_ns) ? before : after;
    if (llabs(time_ns - time_at(m, nearest)) > MAX_GAP_NS)
        return NOTHING;
    *out = (struct track_sample){
        .frame = m->frames[nearest],
        .skeleton = smooth ? inpainted_at(m, nearest) : recorded_at(m, nearest),
        .world_from_camera = world_from_camera_at(m, nearest),
    };
    if (smooth && before != after && time_ns > before_ns && after_ns - before_ns <= MAX_GAP_NS)
        interpolate(m, before, after, (double)(time_ns - before_ns) / (double)(after_ns - before_ns), &out->skeleton);
    return OK;
}
