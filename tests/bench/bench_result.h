// The results of a stage's run, and how they are shown. Used by bench.c and bench_result.c only.
#pragma once
#include "platform/files/json.h"
#include "tests/bench/bench.h"

#include <stdio.h>

struct bench_row {
    const char *name;
    const char *group; // NULL: all items
    bool baseline, usual;
    int missed;                                    // items without an answer
    double error, error_p95, time_ms, time_p95_ms; // NaN: no item had an answer
    double extra[BENCH_EXTRAS];
    // Its time over the baseline's, from the odd rounds and from the even ones; NaN: one round only.
    double ratio[2];
};

struct bench_shot { // a picture
    char caption[120];
    uint8_t *jpeg;
    size_t bytes;
    int width, height;
};

struct bench_shots {
    struct bench_shot at[BENCH_PICTURES];
    int count;
};

struct bench_result {
    const struct bench_stage *stage;
    int items, rounds;
    size_t count;
    struct bench_row *rows;
    struct bench_shots shots;
    double took_s; // of the whole stage, its preparations included
};
void bench_result_free(struct bench_result *r);
// The rounds disagree on its ratio by more than this share.
#define BENCH_UNSTEADY 0.15
bool bench_row_unsteady(const struct bench_row *row);
const struct bench_row *bench_baseline(const struct bench_result *r);

// A table without a baseline.
struct bench_plain_row {
    char name[40];
    double value[BENCH_COLUMNS];
};

struct bench_plain {
    const struct bench_stage *stage;
    const char *column[BENCH_COLUMNS];
    size_t columns, count;
    struct bench_plain_row *rows;
    struct bench_shots shots;
};
void bench_plain_free(struct bench_plain *p);

void bench_print_plain(const struct bench_plain *p);
void bench_add_plain_json(struct json *stages, const struct bench_plain *p);

void bench_print_table(const struct bench_result *r);
void bench_add_json(struct json *stages, const struct bench_result *r);
