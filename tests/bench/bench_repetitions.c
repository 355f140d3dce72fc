// Stage "repetitions": how many repetitions a movement has, where neither their length nor the ends are known: ours,
// and the movement's length divided by the lag at which it resembles itself most. The error is how many are counted too
// many or too few.
//
// With --data: exercises 1 and 2 of KIMORE (Capecci et al. 2019), DIR/es1/PERSON.csv and DIR/es2/PERSON.csv, counted by
// eye on plots of both arms' elevation and the trunk's inclination: every seventh file, and "hard" ones, which are
// those that were counted wrong or doubtfully by an earlier version. A repetition of exercise 1 counts if the arms
// reach the top; of exercise 2 if both sides were leaned to, or one fully and the other begun. Without: a person of
// exact joints.
#include "compare/movement.h"
#include "compare/repetitions.h"
#include "tests/bench/bench.h"
#include "tests/support/exercise.h"

#include <stdio.h>
#include <stdlib.h>

static const struct counted {
    const char *file;
    int32_t count;
    bool hard;
} counted[] = {
    {"es1/CG_Expert_E_ID12", 6, false},     {"es1/CG_Expert_E_ID4", 6, false},
    {"es1/CG_NotExpert_NE_ID10", 5, false}, {"es1/CG_NotExpert_NE_ID17", 6, false},
    {"es1/CG_NotExpert_NE_ID23", 6, false}, {"es1/CG_NotExpert_NE_ID6", 6, false},
    {"es1/GPP_BackPain_B_ID4", 4, false},   {"es1/GPP_Parkinson_P_ID11", 5, false},
    {"es1/GPP_Parkinson_P_ID4", 5, false},  {"es1/GPP_Stroke_S_ID10", 7, false},
    {"es1/GPP_Stroke_S_ID9", 5, false},     {"es2/CG_Expert_E_ID12", 5, false},
    {"es2/CG_Expert_E_ID4", 5, false},      {"es2/CG_NotExpert_NE_ID11", 5, false},
    {"es2/CG_NotExpert_NE_ID19", 6, false}, {"es2/CG_NotExpert_NE_ID26", 5, false},
    {"es2/CG_NotExpert_NE_ID9", 5, false},  {"es2/GPP_BackPain_B_ID7", 4, false},
    {"es2/GPP_Parkinson_P_ID14", 3, false}, {"es2/GPP_Parkinson_P_ID6", 5, false},
    {"es2/GPP_Stroke_S_ID3", 5, false},     {"es1/CG_Expert_E_ID3", 6, true},
    {"es1/CG_Expert_E_ID8", 6, true},       {"es1/CG_NotExpert_NE_ID11", 5, true},
    {"es1/CG_NotExpert_NE_ID24", 6, true},  {"es1/GPP_Parkinson_P_ID5", 5, true},
    {"es1/GPP_Parkinson_P_ID8", 5, true},   {"es1/GPP_Stroke_S_ID1", 4, true},
    {"es1/GPP_Stroke_S_ID3", 5, true},      {"es1/GPP_Stroke_S_ID6", 4, true},
    {"es1/GPP_Stroke_S_ID8", 6, true},      {"es2/CG_Expert_E_ID15", 3, true},
    {"es2/CG_NotExpert_NE_ID15", 9, true},  {"es2/CG_NotExpert_NE_ID17", 5, true},
    {"es2/CG_NotExpert_NE_ID2", 3, true},   {"es2/CG_NotExpert_NE_ID4", 3, true},
    {"es2/GPP_BackPain_B_ID4", 3, true},    {"es2/GPP_Stroke_S_ID10", 3, true},
    {"es2/GPP_Stroke_S_ID9", 3, true},
};
enum { COUNTED = COUNT_OF(counted), MADE = 24 };
static const uint64_t SEED = 5;

struct item {
    struct feature_frame *frames;
    struct features all;
    int32_t count;
};

static enum status item_of(struct movement *m, int32_t count, struct item *out)
{
    const enum status status = movement_features(m, m->ever_known, NULL, &out->frames);
    out->all = (struct features){out->frames, m->count};
    out->count = count;
    movement_free(m);
    return status;
}

static enum status read_item(const char *folder, const struct counted *c, struct item *out)
{
    char path[4096];
    struct movement m;
    struct movement_source source;
    snprintf(path, sizeof path, "%s/%s.csv", folder, c->file);
    const enum status status = movement_read(path, NULL, &m, &source);
    return status == OK ? item_of(&m, c->count, out) : status;
}

// Each repetition at a pace of its own, within a fifth; standing still before and after.
static enum status make_item(struct rng *rng, struct item *out)
{
    struct exercise e = exercise_default();
    struct joint_samples samples = {0};
    const int32_t count = 3 + (int32_t)(rng_uniform(rng) * 6);
    const double wait_s = rng_between(rng, 0, 3), shortest_s = rng_between(rng, 2, 4);
    double time_s = 0;
    enum status status = OK;
    e.noise_m = 0.015;
    for (int32_t k = -1; k <= count; k++) {
        const bool still = k < 0 || k == count;
        const double seconds = still ? wait_s : shortest_s * rng_between(rng, 1, 1.4);
        for (double t = 0; t < seconds && status == OK; t += 1 / MOVEMENT_RATE_HZ, time_s += 1 / MOVEMENT_RATE_HZ) {
            struct joint_sample s = {.time_ns = (int64_t)(time_s * 1e9),
                                     .skeleton = exercise_at(&e, still ? 0 : 3 * t / seconds, rng)};
            for (int j = 0; j < JOINT_COUNT; j++)
                s.sigma_m[j] = default_sigma_m(1);
            status = joint_samples_add(&samples, &s);
        }
    }
    struct movement m = {0};
    if (status == OK)
        status = movement_from_samples(&samples, &m);
    joint_samples_free(&samples);
    return status == OK ? item_of(&m, count, out) : status;
}

static enum status measure_ours(void *self, int at, struct bench_measure *out)
{
    const struct item *item = (const struct item *)self + at;
    struct repetition_list found;
    const double started_ms = bench_clock_ms();
    const enum status status = repetitions_find(&item->all, &found);
    out->time_ms = bench_clock_ms() - started_ms;
    out->error = abs(found.count - item->count);
    out->extra[0] = found.count == item->count;
    repetition_list_free(&found);
    return status;
}

// What a user writes: the first lag that is a minimum of the mean difference and nearly the lowest.
static enum status measure_lag(void *self, int at, struct bench_measure *out)
{
    enum { LEAST = 24, MOST = 4096 };
    static double cost[MOST];
    const struct item *item = (const struct item *)self + at;
    const struct features *f = &item->all;
    const double started_ms = bench_clock_ms();
    const int32_t most = f->count / 2 < MOST - 1 ? f->count / 2 : MOST - 1;
    double least = INFINITY;
    for (int32_t lag = LEAST - 1; lag <= most; lag++) {
        cost[lag] = 0;
        for (int32_t i = 0; i + lag < f->count; i++)
            cost[lag] += (double)feature_cost(&f->frames[i], &f->frames[i + lag]) / (f->count - lag);
        least = lag >= LEAST ? fmin(least, cost[lag]) : least;
    }
    int32_t best = 0;
    for (int32_t lag = LEAST; lag < most && !best; lag++)
        if (cost[lag] <= cost[lag - 1] && cost[lag] <= cost[lag + 1] && cost[lag] < 1.3 * least)
            best = lag;
    const int32_t found = best ? (f->count + best / 2) / best : 0;
    out->time_ms = bench_clock_ms() - started_ms;
    out->error = abs(found - item->count);
    out->extra[0] = found == item->count;
    return OK;
}

static enum status run(struct bench *b)
{
    static struct item items[COUNTED > MADE ? COUNTED : MADE];
    static const char *const names[] = {"every seventh", "hard"};
    int group[COUNTED] = {0};
    const char *data = bench_inputs(b)->data;
    const int count = data ? COUNTED : MADE;
    struct rng rng = {SEED};
    enum status status = OK;
    if (!data && !bench_inputs(b)->json)
        printf("repetitions: seed %llu\n", (unsigned long long)SEED);
    for (int i = 0; i < count && status == OK; i++) {
        status = data ? read_item(data, &counted[i], &items[i]) : make_item(&rng, &items[i]);
        group[i] = data ? counted[i].hard : 0;
    }
    const struct bench_contender contenders[] = {{"ours", measure_ours, items, false},
                                                 {"length by best lag", measure_lag, items, true}};
    const struct bench_groups groups = {names, COUNT_OF(names), group};
    if (status == OK && data)
        status = bench_run_grouped(b, contenders, COUNT_OF(contenders), count, &groups);
    else if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), count);
    for (int i = 0; i < count; i++)
        free(items[i].frames);
    return status;
}

const struct bench_stage bench_stage_repetitions = {
    "repetitions", "repetitions counted; with --data: exercises that were counted by eye",
    "count_error", "time_ms",
    {"right"},     run};
