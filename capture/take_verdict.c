#include "capture/take_verdict.h"

#include "capture/depth_cause.h"
#include "capture/sensor_tilt.h"
#include "capture/take_facts.h"

#include <stdlib.h>
#include <string.h>

// ------------------------------------------------------------- the frames

// Like the recorder's count: by how much a sensor's pose must change to have been moved.
static bool has_moved(const struct take_entry *before, const struct take_entry *now)
{
    const double shift_m = 0.02, turn_rad = 0.0175;
    if (!before || !before->located || !now->located)
        return false;
    const struct pose moved = pose_multiply(pose_inverse(before->world_from_camera), now->world_from_camera);
    return v3_length(moved.translation) > shift_m ||
           pose_angle(before->world_from_camera, now->world_from_camera) > turn_rad;
}

struct viewing {
    struct take *take;
    struct coach *coach;
    const struct take_facts *facts;
    int64_t time_ns; // of the frame shown last, by a clock without absurd jumps
    int moves;
};

// Shows the coach one frame. A damaged one is left out.
static enum status show_frame(struct viewing *v, int64_t i, int64_t stride)
{
    const struct take_entry *e = take_entry(v->take, i), *before = i >= stride ? take_entry(v->take, i - stride) : NULL;
    struct take_images images;
    const enum status status = take_read(v->take, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
    if (before)
        v->time_ns += take_facts_step_ns(v->facts, before->time_ns, e->time_ns, stride);
    v->moves += has_moved(before, e);
    if (status == ERR_CORRUPT)
        return OK;
    if (status != OK)
        return status;
    const bool person = e->has_skeleton && images.mask;
    const struct coach_frame frame = {
        .time_ns = v->time_ns,
        .color = images.color,
        .depth = images.depth,
        .mask = person ? images.mask : NULL,
        .skeleton = person ? &e->skeleton : NULL,
        .sensor_moves = v->moves,
        .step_s =
            i ? 1e-9 * (double)take_facts_step_ns(v->facts, take_entry(v->take, i - 1)->time_ns, e->time_ns, 1) : 0};
    coach_next(v->coach, &frame);
    return OK;
}

static enum status show_frames(struct take *take, const struct take_facts *facts, struct coach *coach)
{
    struct viewing v = {.take = take, .coach = coach, .facts = facts, .time_ns = 1};
    const int64_t count = take_frame_count(take), stride = (count + VERDICT_FRAMES_MOST - 1) / VERDICT_FRAMES_MOST;
    enum status status = OK;
    for (int64_t i = 0; i < count && status == OK; i += stride)
        status = show_frame(&v, i, stride);
    return status;
}

// ------------------------------------------------------------- the verdict

static void add_lines(struct take_verdict *v, const struct take_verdict *more, bool filming_only)
{
    for (int i = 0; i < more->count; i++)
        if ((more->line[i].filming || !filming_only) && v->count < VERDICT_LINES)
            v->line[v->count++] = more->line[i];
}

// What was seen while filming and is not in the frames.
static void add_filming(struct take_verdict *v, const struct take_verdict *before, const struct coach *coach)
{
    struct take_verdict watched;
    if (coach) {
        coach_verdict(coach, &watched);
        before = &watched;
    }
    for (int i = 0; i < before->count; i++)
        if (before->line[i].filming)
            v->spoilt |= before->line[i].spoils;
    add_lines(v, before, true);
}

// before: an earlier verdict, whose purpose stays.
static enum status judge(struct take *take, const struct take_verdict *before, const struct coach *filmed_by,
                         struct take_judgement *judgement)
{
    struct take_verdict *out = &judgement->verdict;
    struct take_facts facts;
    struct take_verdict watched;
    struct depth_finding finding;
    struct sensor_tilt tilt;
    struct coach *coach = malloc(sizeof *coach);
    if (!coach)
        return fail(ERR_MEMORY, "no memory to judge a take");
    coach_start(coach, take_calibration(take), before->purpose);
    enum status status = take_facts_read(take, &facts);
    if (status == OK)
        status = show_frames(take, &facts, coach);
    if (status == OK)
        status = depth_cause_find(take, &finding);
    if (status == OK)
        status = sensor_tilt_find(take, &tilt);
    if (status == OK) {
        coach_verdict(coach, &watched);
        *out = (struct take_verdict){.purpose = before->purpose, .seen = watched.seen};
        depth_cause_say(&finding, out);
        take_facts_say(&facts, out);
        sensor_tilt_say(&tilt, out);
        out->spoilt |= watched.spoilt;
        add_filming(out, before, filmed_by);
        add_lines(out, &watched, false);
        if (!out->count)
            verdict_say(out, 0, "there is nothing to watch and nothing to compare");
        judgement->seen = coach->coverage;
        judgement->frames = facts.frames;
    }
    free(coach);
    return status;
}

enum status take_verdict_keep(const char *path, const char *name, const struct take_filming *filming,
                              struct take_judgement *out)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct take_verdict before = {.purpose = PURPOSE_BOTH};
    struct verdict_key key = {0};
    bool fits;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = take_open(&take, r, name);
    if (status == OK && !filming)
        status = recorded_verdict_read(take, &before, &fits);
    if (status == NOTHING)
        status = OK;
    if (filming)
        before.purpose = filming->purpose;
    if (status == OK)
        status = judge(take, &before, filming ? filming->coach : NULL, out);
    if (status == OK)
        key = verdict_key_of(take);
    take_close(&take);
    recording_free(&r);
    if (status != OK)
        return status;
    status = recorded_verdict_write(path, &key, &out->verdict);
    return status == ERR_MEMORY ? status : OK;
}

enum status take_verdict_get(struct recording *r, const char *name, struct take_verdict *out)
{
    struct take *take = NULL;
    struct take_verdict before = {.purpose = PURPOSE_BOTH};
    bool fits = false;
    enum status status = take_open(&take, r, name);
    if (status == OK)
        status = recorded_verdict_read(take, &before, &fits);
    if (status == OK && fits) {
        *out = before;
    } else if (status == OK || status == NOTHING) {
        struct take_judgement judgement;
        status = judge(take, &before, NULL, &judgement);
        *out = judgement.verdict;
    }
    take_close(&take);
    return status;
}
