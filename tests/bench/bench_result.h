// The results of a stage's run, and how they are shown. Used by bench.c and bench_result.c only.
#pragma once
#include "tests/bench/bench.h"
#include "platform/json.h"

#include <stdio.h>

struct bench_row {
    const char *name;
    const char *group; // NULL: all items
    bool baseline;
    int missed;                                    // items without an answer
    double error, error_p95, time_ms, time_p95_ms; // NaN: no item had an answer
    double extra[BENCH_EXTRAS];
};

struct bench_result {
    const struct bench_stage *stage;
    int items, rounds;
    size_t count;
    struct bench_row *rows;
};

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
};

void bench_print_plain(const struct bench_plain *p);
void bench_add_plain_json(struct json *stages, const struct bench_plain *p);

void bench_print_table(const struct bench_result *r);
void bench_add_json(struct json *stages, const struct bench_result *r);
void bench_print_html_head(FILE *file);
void bench_print_html(FILE *file, const struct bench_result *r);
void bench_print_html_foot(FILE *file);
