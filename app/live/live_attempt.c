#include "app/live/live_attempt.h"

#include "base/threads.h"
#include "compare/expected_take.h"
#include "compare/findings.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct attempt_judge {
    char *paths[2], *names[2]; // of takes: the reference's recording and name, and the attempt's; NULL: of an attempt
    void (*notify)(void *self);
    void *notify_self;
    struct movement part;        // of the reference
    struct expectation expected; // of the part, in its own time
    bool counts;                 // some of the stretch that counts is in the part
    struct live_attempt attempt;
    struct worker_thread worker;
    bool taken;
    atomic_bool finished;
};

void live_attempt_free(struct live_attempt *attempt)
{
    comparison_free(&attempt->comparison);
    joint_samples_free(&attempt->samples);
    *attempt = (struct live_attempt){0};
}

bool live_attempt_skeleton(const struct live_attempt *attempt, int64_t time_ns, struct skeleton *out)
{
    const struct joint_samples *s = &attempt->samples;
    int64_t low = 0, high = s->count; // the first that is not before time_ns
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (s->at[middle].time_ns < time_ns)
            low = middle + 1;
        else
            high = middle;
    }
    if (low > 0 && (low == s->count || time_ns - s->at[low - 1].time_ns < s->at[low].time_ns - time_ns))
        low--;
    if (!s->count || llabs(s->at[low].time_ns - time_ns) > 500000000)
        return false;
    *out = s->at[low].skeleton;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = out->joint[j];
        out->joint[j] = v3(p.x, p.z, -p.y);
    }
    return true;
}

double live_attempt_reference(const struct live_attempt *attempt, int64_t time_ns)
{
    const struct timeline *t = &attempt->comparison.timeline;
    const int32_t frame = (int32_t)lround((double)time_ns * 1e-9 * MOVEMENT_RATE_HZ);
    return attempt->compared && frame >= 0 && frame < t->count ? (double)attempt->first + t->reference[frame] : NAN;
}

static void fill_strip(struct live_attempt *attempt)
{
    const struct comparison *c = &attempt->comparison;
    memset(attempt->strip, ATTEMPT_NOT_ALIGNED, sizeof attempt->strip);
    for (int32_t f = 0; f < c->timeline.count; f++) {
        struct part_difference parts[PART_COUNT];
        if (isnan(c->timeline.reference[f]))
            continue;
        comparison_differences(c, &c->judged, f, parts);
        const int first = (int)((int64_t)f * ATTEMPT_CELLS / c->timeline.count),
                  end = (int)((int64_t)(f + 1) * ATTEMPT_CELLS / c->timeline.count);
        for (int cell = first; cell < end || cell == first; cell++)
            for (int p = 0; p < PART_COUNT; p++) {
                const enum verdict v = parts[judged_part(c, p)].verdict;
                if (attempt->strip[cell][p] == ATTEMPT_NOT_ALIGNED || v > attempt->strip[cell][p])
                    attempt->strip[cell][p] = (uint8_t)v;
            }
    }
}

// What is expected of the part of the reference that was done.
static void expect_of_part(struct attempt_judge *judge, const struct attempt_task *task)
{
    judge->counts = true;
    if (!task->expected)
        return;
    struct expectation *e = &judge->expected;
    *e = *task->expected;
    if (!(e->to_s > 0))
        return;
    e->from_s = fmax(0, e->from_s - task->first / MOVEMENT_RATE_HZ);
    e->to_s = fmin((task->end - task->first) / MOVEMENT_RATE_HZ, e->to_s - task->first / MOVEMENT_RATE_HZ);
    judge->counts = e->to_s > e->from_s;
}

static enum status read_takes(struct attempt_judge *judge)
{
    struct movement_source source;
    struct joint_notes notes = {.count = 0};
    enum status status = movement_read(judge->paths[0], judge->names[0], &judge->part, &source);
    judge->counts = true;
    if (status == OK)
        status = expectation_of_take(judge->paths[0], judge->names[0], &judge->part, &judge->expected, &notes);
    if (notes.count)
        snprintf(judge->attempt.note, sizeof judge->attempt.note, "%.199s", notes.line[0]);
    return status == OK ? joint_samples_read_take(judge->paths[1], judge->names[1], &judge->attempt.samples) : status;
}

static void *run_judge(void *self)
{
    struct attempt_judge *j = self;
    struct live_attempt *a = &j->attempt;
    struct movement attempt = {0};
    thread_lower_priority();
    enum status status = j->paths[0] ? read_takes(j) : OK;
    if (status == OK && !a->samples.count)
        status = fail(ERR_INPUT, "Nothing of the person was seen");
    if (status == OK) {
        (void)joint_samples_mend_sides(&a->samples);
        status = movement_from_samples(&a->samples, &attempt);
    }
    if (status == OK && !j->counts)
        status = fail(ERR_INPUT, "Nothing was done of what counts here");
    if (status == OK)
        status = comparison_make(&j->part, &attempt, &j->expected, &a->comparison);
    a->compared = status == OK;
    if (a->compared)
        fill_strip(a);
    if (status != OK)
        snprintf(a->why, sizeof a->why, "%.199s", status_message());
    movement_free(&attempt);
    movement_free(&j->part);
    atomic_store(&j->finished, true);
    if (j->notify)
        j->notify(j->notify_self);
    return NULL;
}

// status: of what was prepared; unless OK, the judge is freed and *out NULL.
static enum status start_thread(struct attempt_judge **out, struct attempt_judge *judge, enum status status)
{
    worker_thread_open(&judge->worker);
    if (status == OK)
        status = worker_thread_start(&judge->worker, run_judge, judge, "to judge the attempt");
    *out = judge;
    if (status != OK)
        attempt_judge_close(out);
    return status;
}

enum status attempt_judge_start(struct attempt_judge **out, const struct attempt_task *task,
                                struct joint_samples *samples)
{
    *out = NULL;
    struct attempt_judge *j = calloc(1, sizeof *j);
    if (!j) {
        joint_samples_free(samples);
        return fail(ERR_MEMORY, "no memory to judge the attempt");
    }
    j->notify = task->notify;
    j->notify_self = task->notify_self;
    j->attempt = (struct live_attempt){
        .number = task->number, .mirrored = task->mirrored, .samples = *samples, .first = task->first};
    *samples = (struct joint_samples){0};
    expect_of_part(j, task);
    enum status status = movement_copy(task->reference, task->first, task->end, &j->part);
    return start_thread(out, j, status);
}

enum status attempt_judge_start_takes(struct attempt_judge **out, const struct takes_task *task)
{
    *out = NULL;
    struct attempt_judge *j = calloc(1, sizeof *j);
    if (!j)
        return fail(ERR_MEMORY, "no memory to compare takes");
    j->notify = task->notify;
    j->notify_self = task->notify_self;
    j->attempt = (struct live_attempt){.number = task->number};
    j->paths[0] = strdup(task->path);
    j->paths[1] = strdup(task->attempt_path);
    j->names[0] = strdup(task->reference);
    j->names[1] = strdup(task->attempt);
    const bool copied = j->paths[0] && j->paths[1] && j->names[0] && j->names[1];
    return start_thread(out, j, copied ? OK : fail(ERR_MEMORY, "no memory to compare takes"));
}

void attempt_judge_close(struct attempt_judge **out)
{
    struct attempt_judge *j = *out;
    if (!j)
        return;
    worker_thread_close(&j->worker);
    if (!j->taken)
        live_attempt_free(&j->attempt);
    movement_free(&j->part);
    free(j->paths[0]);
    free(j->paths[1]);
    free(j->names[0]);
    free(j->names[1]);
    free(j);
    *out = NULL;
}

bool attempt_judge_finished(struct attempt_judge *judge, struct live_attempt *out)
{
    if (judge->taken || !atomic_load(&judge->finished))
        return false;
    *out = judge->attempt;
    judge->taken = true;
    return true;
}
