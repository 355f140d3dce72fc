// Stage "attempts": what a comparison says of an attempt that differs from its reference in a known way; error alone.
//
// Without --dice every motion (some of the world's own, or the BVH files of --motions) with every edit; with --dice
// random motions, stretches and edits, of --motions too.
#include "tests/bench/bench_attempts.h"

#include "base/threads.h"
#include "tests/bench/bench.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char *const columns[] = {
    "films",     "time_s",        "time_p95_s",   "angle_deg",        "angle_p95_deg", "caught_%", "false_%",
    "unknown_%", "first_right_%", "no_posture_%", "mirrored_right_%", "kind_found_%",  "score",    "score_sigma",
};

struct trial {
    struct bench *b;
    const struct bench_dice *dice;
    struct dice_motions motions;
    int count;
    struct attempt {
        struct attempt_plan plan;
        struct attempt_score score;
        struct failure failure;
        bool made; // false: no film with that edit can be made of that motion
    } * attempts;
};

static bool is_performed(const char *motion, bool files_only)
{
    // Those in which a person moves most of the time and stays in the image.
    static const char *const own[] = {"kata", "bend", "pirouette", "exercise"};
    bool is = strchr(motion, '/') != NULL;
    for (size_t k = 0; k < COUNT_OF(own) && !files_only; k++)
        is = is || !strcmp(motion, own[k]);
    return is;
}

static enum status open_motions(struct trial *t, const char *folder)
{
    enum status status = dice_motions_open(&t->motions, folder);
    int kept = 0;
    for (int k = 0; k < t->motions.count && status == OK; k++) {
        char *name = t->motions.name[k];
        if (is_performed(name, folder && !t->dice->films))
            t->motions.name[kept++] = name;
        else
            free(name);
    }
    t->motions.count = kept;
    return status;
}

static enum status make_attempt(const struct trial *t, int i, struct attempt *a)
{
    const int index = t->dice->only >= 0 ? t->dice->only : i;
    struct dice_motions one = {.name = &t->motions.name[index / EDIT_KINDS % t->motions.count], .count = 1};
    const struct attempt_wish wish = {t->dice->seed, t->dice->seconds, t->dice->films ? &t->motions : &one};
    enum status status = attempt_plan_draw(&a->plan, &wish, index);
    a->made = status == OK;
    if (status == NOTHING)
        return OK;
    return status == OK ? attempt_film(&a->plan, t->dice->dump, &a->score) : status;
}

static void make_one(void *context, int i)
{
    struct trial *t = context;
    failure_keep(&t->attempts[i].failure, make_attempt(t, i, &t->attempts[i]));
    if (isatty(STDERR_FILENO))
        fprintf(stderr, "\rattempts: film %d of %d ", i + 1, t->count);
}

// ---------------------------------------------------------------- the table

static bool is_any(enum world_edit_kind kind) { return kind < EDIT_KINDS; }

// Means over the films of such edits.
static enum status add_row(struct trial *t, const char *name, bool (*has)(enum world_edit_kind))
{
    double sum[COUNT_OF(columns)] = {0};
    int count[COUNT_OF(columns)] = {0}, films = 0;
    for (int i = 0; i < t->count; i++) {
        const struct attempt *a = &t->attempts[i];
        if (!a->made || !has(a->plan.edit.kind))
            continue;
        const struct attempt_score *s = &a->score;
        const double value[COUNT_OF(columns)] = {
            NAN,
            s->time_median_s,
            s->time_p95_s,
            s->angle_median,
            s->angle_p95,
            100 * s->caught,
            100 * s->false_alarms,
            100 * s->unknown,
            100 * s->first_right,
            100 * s->no_posture,
            100 * s->mirrored_right,
            100 * s->kind_found,
            s->score,
            s->score_sigma,
        };
        films++;
        for (size_t k = 1; k < COUNT_OF(columns); k++)
            if (!isnan(value[k])) {
                sum[k] += value[k];
                count[k]++;
            }
    }
    if (!films)
        return OK;
    for (size_t k = 1; k < COUNT_OF(columns); k++)
        sum[k] = count[k] ? sum[k] / count[k] : NAN;
    sum[0] = films;
    return bench_add_row(t->b, name, sum);
}

static void print_film(const struct trial *t, const struct attempt *a, const char *folder)
{
    const struct attempt_plan *p = &a->plan;
    const char *slash = strrchr(p->motion, '/');
    const struct attempt_score *s = &a->score;
    const char *mark = s->first_right < 1 || s->no_posture < 1 || s->mirrored_right < 1 || s->kind_found < 1
                           ? "WRONG"
                           : "right"; // NaN: right
    printf("%4d %-12.12s %-11s %4.2f  %4.1f to %4.1f s  %-5s by %-5s score %3.0f ± %.0f  %s  %s\n", p->index,
           slash ? slash + 1 : p->motion, world_edit_name(p->edit.kind), p->edit.amount, p->edit.from_s, p->edit.to_s,
           p->actor[0].figure, p->actor[1].figure, s->score, s->score_sigma, mark, s->first);
    if (strcmp(mark, "WRONG"))
        return;
    printf("     reenact-bench attempts --seed %llu --only %d", (unsigned long long)t->dice->seed, p->index);
    if (t->dice->films)
        printf(" --dice 1");
    if (folder)
        printf(" --motions %s", folder);
    printf("\n");
}

static enum status show(struct trial *t, const char *folder)
{
    const bool silent = bench_inputs(t->b)->json || bench_inputs(t->b)->brief;
    if (!silent)
        printf(
            "attempts: seed %llu; index, motion, edit and by how much, where, reference's figure and attempt's, first "
            "finding\n",
            (unsigned long long)t->dice->seed);
    for (int i = 0; i < t->count && !silent; i++)
        if (t->attempts[i].made)
            print_film(t, &t->attempts[i], folder);
        else
            printf("%4d none of the motions can be filmed with this edit so that it shows\n", i);
    bench_columns(t->b, columns, COUNT_OF(columns));
    enum status status = add_row(t, "all", is_any);
    if (status == OK)
        status = add_row(t, "postures", edit_is_posture);
    return status == OK ? add_row(t, "tempo, pause, late arm", edit_is_timing) : status;
}

static enum status run(struct bench *b)
{
    const struct bench_inputs *in = bench_inputs(b);
    struct trial t = {.b = b, .dice = &in->dice};
    enum status status = open_motions(&t, in->motions);
    t.count = in->dice.only >= 0 ? 1 : in->dice.films ? in->dice.films : t.motions.count * EDIT_KINDS;
    t.attempts = calloc((size_t)t.count + 1, sizeof *t.attempts);
    if (status == OK && !t.attempts)
        status = fail(ERR_MEMORY, "no memory for the bench");
    if (status == OK)
        parallel_for(in->dice.threads, t.count, make_one, &t);
    for (int i = 0; i < t.count && status == OK; i++)
        if (t.attempts[i].failure.status != OK)
            status = fail(t.attempts[i].failure.status, "film %d: %s", i, t.attempts[i].failure.sentence);
    if (status == OK)
        status = show(&t, in->motions);
    free(t.attempts);
    dice_motions_close(&t.motions);
    return status;
}

const struct bench_stage bench_stage_attempts = {
    .name = "attempts",
    .about = "comparing films of attempts that differ from a reference in a known way, next to the truth",
    .run = run,
};
