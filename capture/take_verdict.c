#include "capture/take_verdict.h"

#include "capture/depth_cause.h"
#include "capture/sensor_tilt.h"
#include "capture/take_facts.h"

#include <stdlib.h>
#include <string.h>

// ------------------------------------------------------------- the frames

// A fault counts when it lasts for 0.4 s (coach.h). Colour says how bright it is, which changes slowly.
static const double LOOK_S = 0.1;
enum { COLOR_EVERY = 3 }; // looks

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

// Shows the coach one frame; of its images as many as are wanted. A damaged one is one that nobody looked at.
static enum status show_frame(struct viewing *v, int64_t i, enum coach_unread unread)
{
    static const unsigned want[] = {
        [UNREAD_NONE] = TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, [UNREAD_COLOR] = TAKE_DEPTH | TAKE_MASK};
    const struct take_entry *e = take_entry(v->take, i), *before = i ? take_entry(v->take, i - 1) : NULL;
    const int64_t step_ns = before ? take_facts_step_ns(v->facts, before->time_ns, e->time_ns, 1) : 0;
    struct take_images images = {0};
    const enum status status = unread == UNREAD_ALL ? OK : take_read(v->take, i, want[unread], &images);
    if (status != OK && status != ERR_CORRUPT)
        return status;
    v->time_ns += step_ns;
    v->moves += has_moved(before, e);
    const bool person = e->has_skeleton && e->has_mask;
    const struct coach_frame frame = {.time_ns = v->time_ns,
                                      .color = images.color,
                                      .depth = images.depth,
                                      .mask = person ? images.mask : NULL,
                                      .skeleton = person ? &e->skeleton : NULL,
                                      .sensor_moves = v->moves,
                                      .step_s = 1e-9 * (double)step_ns,
                                      .unread = status == OK ? unread : UNREAD_ALL};
    coach_next(v->coach, &frame);
    return OK;
}

// Of how many frames the images of one are looked at.
static int64_t look_every(const struct take_facts *f)
{
    const double step_s = 1e-9 * (double)take_facts_step_ns(f, 0, (int64_t)(f->step_s * 1e9), 1);
    const int64_t by_time = step_s > 0 ? (int64_t)fmin(LOOK_S / step_s + 0.5, 1e3) : 1,
                  by_least = f->frames / VERDICT_LOOKS_LEAST,
                  by_most = (f->frames + VERDICT_LOOKS_MOST - 1) / VERDICT_LOOKS_MOST;
    int64_t every = by_time < by_least ? by_time : by_least;
    every = every > by_most ? every : by_most;
    return every > 1 ? every : 1;
}

static enum status show_frames(struct take *take, const struct take_facts *facts,
                               const struct take_verdict_patience *patience, struct coach *coach)
{
    struct viewing v = {.take = take, .coach = coach, .facts = facts, .time_ns = 1};
    const int64_t every = look_every(facts);
    enum status status = OK;
    for (int64_t i = 0; i < facts->frames && status == OK; i++) {
        if (patience && !patience->goes_on(patience->self))
            return NOTHING;
        const enum coach_unread color = i / every % COLOR_EVERY ? UNREAD_COLOR : UNREAD_NONE;
        status = show_frame(&v, i, i % every ? UNREAD_ALL : color);
    }
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

// What is known before.
struct judging {
    struct take_verdict before;    // whose purpose stays
    const struct coach *filmed_by; // NULL: none
    const struct take_verdict_patience *patience;
};

static enum status judge(struct take *take, const struct judging *by, struct take_judgement *judgement)
{
    struct take_verdict *out = &judgement->verdict;
    struct take_facts facts;
    struct take_verdict watched;
    struct depth_finding finding;
    struct sensor_tilt tilt;
    struct coach *coach = malloc(sizeof *coach);
    if (!coach)
        return fail(ERR_MEMORY, "no memory to judge a take");
    coach_start(coach, take_calibration(take), by->before.purpose);
    enum status status = take_facts_read(take, &facts);
    if (status == OK)
        status = show_frames(take, &facts, by->patience, coach);
    if (status == OK)
        status = depth_cause_find(take, &finding);
    if (status == OK)
        status = sensor_tilt_find(take, &tilt);
    if (status == OK) {
        coach_verdict(coach, &watched);
        *out = (struct take_verdict){.purpose = by->before.purpose, .seen = watched.seen};
        depth_cause_say(&finding, out);
        take_facts_say(&facts, out);
        sensor_tilt_say(&tilt, out);
        out->spoilt |= watched.spoilt;
        add_filming(out, &by->before, by->filmed_by);
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
    struct judging by = {.before = {.purpose = PURPOSE_BOTH}, .filmed_by = filming ? filming->coach : NULL};
    struct verdict_key key = {0};
    bool fits;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = take_open(&take, r, name);
    if (status == OK && !filming)
        status = recorded_verdict_read(take, &by.before, &fits);
    if (status == NOTHING)
        status = OK;
    if (filming)
        by.before.purpose = filming->purpose;
    if (status == OK)
        status = judge(take, &by, out);
    if (status == OK)
        key = verdict_key_of(take);
    take_close(&take);
    recording_free(&r);
    if (status != OK)
        return status;
    status = recorded_verdict_write(path, &key, &out->verdict);
    return status == ERR_MEMORY ? status : OK;
}

// Whether the verdict that is kept was made from the frames as they are.
static enum status stands(struct recording *r, const char *name, bool *out)
{
    struct take *take = NULL;
    struct take_verdict kept;
    enum status status = take_open(&take, r, name);
    if (status == OK)
        status = recorded_verdict_read(take, &kept, out);
    take_close(&take);
    return status == NOTHING ? OK : status;
}

// *more: there is a take number `i`.
static enum status keep_one_missing(const char *path, int i, bool *more)
{
    struct recording *r;
    struct take_judgement judgement;
    bool stand = true;
    char *name = NULL;
    enum status status = recording_open(&r, path);
    if (status != OK)
        return status;
    *more = i < recording_take_count(r);
    if (*more)
        status = stands(r, recording_take_name(r, i), &stand);
    if (status == OK && !stand && !(name = strdup(recording_take_name(r, i))))
        status = fail(ERR_MEMORY, "no memory to judge a take");
    recording_free(&r); // a reader would hinder the writer
    if (name)
        status = take_verdict_keep(path, name, NULL, &judgement);
    free(name);
    return status;
}

enum status take_verdict_keep_missing(const char *path)
{
    enum status status = OK;
    bool more = true;
    for (int i = 0; more && status == OK; i++)
        status = keep_one_missing(path, i, &more);
    return status;
}

enum status take_verdict_get(struct recording *r, const char *name, const struct take_verdict_patience *patience,
                             struct take_verdict *out)
{
    struct take *take = NULL;
    struct judging by = {.before = {.purpose = PURPOSE_BOTH}, .patience = patience};
    bool fits = false;
    enum status status = take_open(&take, r, name);
    if (status == OK)
        status = recorded_verdict_read(take, &by.before, &fits);
    if (status == OK && fits) {
        *out = by.before;
    } else if (status == OK || status == NOTHING) {
        struct take_judgement judgement;
        status = judge(take, &by, &judgement);
        if (status == OK)
            *out = judgement.verdict;
    }
    take_close(&take);
    return status;
}
