#include "reenact/skeleton/skeleton_track.h"

#include "reenact/skeleton/joint_inpainting.h"

#include <stdlib.h>

static const int64_t MAX_GAP_NS = 500000000;

struct track_frame {
    int64_t time_ns; // since the take's first frame
    int64_t frame;
    struct pose world_from_camera;
    struct skeleton world, inpainted; // as recorded; and with the limbs that were lost for a moment
};

struct skeleton_track {
    struct track_frame *steps; // times rising
    int64_t count;
};

// For a take without a place: a world with z up for a camera held level.
static const struct pose level_world_from_camera = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, 0, 0}};

static bool located_anywhere(const struct take *take)
{
    for (int64_t i = 0; i < take_frame_count(take); i++)
        if (take_entry(take, i)->has_skeleton && take_entry(take, i)->located)
            return true;
    return false;
}

enum status skeleton_track_open(struct skeleton_track **out, const struct take *take)
{
    *out = NULL;
    bool anywhere = located_anywhere(take);
    int64_t frames = take_frame_count(take);
    struct skeleton_track *m = calloc(1, sizeof *m);
    struct track_frame *steps = calloc(frames > 0 ? (size_t)frames : 1, sizeof *steps);
    if (!m || !steps) {
        free(m);
        free(steps);
        return fail(ERR_MEMORY, "out of memory");
    }
    m->steps = steps;
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || (anywhere && !e->located))
            continue;
        struct track_frame *s = &steps[m->count++];
        s->time_ns = e->time_ns - take_entry(take, 0)->time_ns;
        s->frame = i;
        s->world_from_camera = anywhere ? e->world_from_camera : level_world_from_camera;
        s->world = skeleton_transform(s->world_from_camera, &e->skeleton);
        const struct skeleton inpainted = inpaint_skeleton(take, i);
        s->inpainted = skeleton_transform(s->world_from_camera, &inpainted);
        for (int j = 0; j < JOINT_COUNT; j++)
            if (s->world.confidence[j] > 0 && !v3_finite(s->world.joint[j])) {
                skeleton_track_close(&m);
                return fail(ERR_INPUT, "frame %lld of the take holds a %s that is nowhere; repair the file",
                            (long long)i, joint_name((enum joint)j));
            }
    }
    if (!m->count) {
        skeleton_track_close(&m);
        return fail(ERR_INPUT, "the take has no skeleton, so there is nobody to show");
    }
    *out = m;
    return OK;
}

void skeleton_track_close(struct skeleton_track **m)
{
    if (!*m)
        return;
    free((*m)->steps);
    free(*m);
    *m = NULL;
}

enum status skeleton_track_at(const struct skeleton_track *m, int64_t time_ns, bool smooth, struct track_sample *out)
{
    // The first step behind time_ns.
    int64_t low = 0, high = m->count;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (m->steps[middle].time_ns > time_ns)
            high = middle;
        else
            low = middle + 1;
    }
    const struct track_frame *after = low < m->count ? &m->steps[low] : &m->steps[m->count - 1];
    const struct track_frame *before = low > 0 ? &m->steps[low - 1] : &m->steps[0];
    int64_t to_before = llabs(time_ns - before->time_ns), to_after = llabs(after->time_ns - time_ns);
    const struct track_frame *nearest = to_before <= to_after ? before : after;
    if (llabs(time_ns - nearest->time_ns) > MAX_GAP_NS)
        return NOTHING;
    *out = (struct track_sample){
        .frame = nearest->frame,
        .skeleton = smooth ? nearest->inpainted : nearest->world,
        .world_from_camera = nearest->world_from_camera,
    };
    if (!smooth || before == after || time_ns <= before->time_ns || after->time_ns - before->time_ns > MAX_GAP_NS)
        return OK;
    double t = (double)(time_ns - before->time_ns) / (double)(after->time_ns - before->time_ns);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct skeleton *a = &before->inpainted, *b = &after->inpainted;
        if (a->confidence[j] > 0 && b->confidence[j] > 0) { // else it stays as the nearest frame has it
            out->skeleton.joint[j] = v3_mix(a->joint[j], b->joint[j], t);
            out->skeleton.confidence[j] = fminf(a->confidence[j], b->confidence[j]);
        }
    }
    return OK;
}
