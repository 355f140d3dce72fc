#include "tests/bench/bench_result.h"

#include <math.h>
#include <stdlib.h>

const struct bench_row *bench_baseline(const struct bench_result *r)
{
    const struct bench_row *found = NULL;
    for (size_t i = 0; i < r->count; i++)
        if (r->rows[i].baseline) {
            assert(!found && "one baseline");
            found = &r->rows[i];
        }
    assert(found && "a baseline");
    return found;
}

bool bench_row_unsteady(const struct bench_row *row)
{
    const double a = row->ratio[0], b = row->ratio[1];
    return a > 0 && b > 0 && fabs(log(a / b)) > log(1 + BENCH_UNSTEADY);
}

static void free_shots(struct bench_shots *s)
{
    for (int i = 0; i < s->count; i++)
        free(s->at[i].jpeg);
}

void bench_result_free(struct bench_result *r)
{
    free_shots(&r->shots);
    free(r->rows);
    *r = (struct bench_result){0};
}

void bench_plain_free(struct bench_plain *p)
{
    free_shots(&p->shots);
    free(p->rows);
    *p = (struct bench_plain){0};
}

// ------------------------------------------------------------- the table

static void print_cell(double value)
{
    if (isnan(value))
        printf(" %10s", "-");
    else
        printf(" %10.*f",
               fabs(value) >= 100                 ? 1
               : fabs(value) >= 10                ? 2
               : fabs(value) >= 0.1 || value == 0 ? 3
                                                  : 5,
               value);
}

// Of 0 and 0, or of what is not known, there is none.
static void print_ratio(double value)
{
    if (isfinite(value))
        printf(" %8.2f", value);
    else
        printf(" %8s", "-");
}

void bench_print_table(const struct bench_result *r)
{
    const struct bench_row *baseline = bench_baseline(r);
    printf("%s: %s\n%d items, %d rounds; %s and %s are medians over the items; x: of the baseline (*)\n\n",
           r->stage->name, r->stage->about, r->items, r->rounds, r->stage->error_name, r->stage->time_name);
    printf("  %-22s %16.16s %10s %8s %14.14s %10s %8s", "", r->stage->error_name, "p95", "x", r->stage->time_name,
           "p95", "x");
    for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
        printf(" %14.14s", r->stage->extra_names[k]);
    printf(" %7s\n", "missed");
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        printf("%c %s%-*.22s      ", row->baseline ? '*' : ' ', row->group ? "  " : "", row->group ? 20 : 22,
               row->group ? row->group : row->name);
        print_cell(row->error);
        print_cell(row->error_p95);
        print_ratio(row->error / baseline->error);
        printf("    ");
        print_cell(row->time_ms);
        print_cell(row->time_p95_ms);
        print_ratio(row->time_ms / baseline->time_ms);
        for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++) {
            printf("    ");
            print_cell(row->extra[k]);
        }
        printf(" %7d\n", row->missed);
    }
    printf("\n");
}

// ------------------------------------------------------------- JSON

void bench_add_json(struct json *stages, const struct bench_result *r)
{
    const struct bench_row *baseline = bench_baseline(r);
    struct json *stage = json_add_object(stages, NULL);
    json_add_string(stage, "name", r->stage->name);
    json_add_string(stage, "about", r->stage->about);
    json_add_string(stage, "error", r->stage->error_name);
    json_add_string(stage, "time", r->stage->time_name);
    json_add_string(stage, "baseline", baseline->name);
    json_add_number(stage, "items", r->items);
    json_add_number(stage, "rounds", r->rounds);
    struct json *rows = json_add_array(stage, "contenders");
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        struct json *object = json_add_object(rows, NULL);
        json_add_string(object, "name", row->name);
        if (row->group)
            json_add_string(object, "group", row->group);
        json_add_number(object, "error", row->error);
        json_add_number(object, "error_p95", row->error_p95);
        json_add_number(object, "error_of_baseline", row->error / baseline->error);
        json_add_number(object, "time", row->time_ms);
        json_add_number(object, "time_p95", row->time_p95_ms);
        json_add_number(object, "time_of_baseline", row->time_ms / baseline->time_ms);
        json_add_number(object, "missed", row->missed);
        json_add_bool(object, "default", row->usual);
        json_add_bool(object, "unsteady", bench_row_unsteady(row));
        for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
            json_add_number(object, r->stage->extra_names[k], row->extra[k]);
    }
}

// ------------------------------------------------------------- plain tables

// A few columns of all rows.
static void print_block(const struct bench_plain *p, size_t from, size_t to)
{
    printf("  %-26s", "");
    for (size_t k = from; k < to; k++)
        printf(" %10s", p->column[k]);
    printf("\n");
    for (size_t i = 0; i < p->count; i++) {
        printf("  %-26.26s", p->rows[i].name);
        for (size_t k = from; k < to; k++)
            print_cell(p->rows[i].value[k]);
        printf("\n");
    }
    printf("\n");
}

void bench_print_plain(const struct bench_plain *p)
{
    enum { BLOCK = 11 }; // columns side by side on a usual screen
    printf("%s: %s\n\n", p->stage->name, p->stage->about);
    for (size_t k = 0; k < p->columns; k += BLOCK)
        print_block(p, k, k + BLOCK < p->columns ? k + BLOCK : p->columns);
}

void bench_add_plain_json(struct json *stages, const struct bench_plain *p)
{
    struct json *stage = json_add_object(stages, NULL);
    json_add_string(stage, "name", p->stage->name);
    json_add_string(stage, "about", p->stage->about);
    struct json *rows = json_add_array(stage, "rows");
    for (size_t i = 0; i < p->count; i++) {
        struct json *object = json_add_object(rows, NULL);
        json_add_string(object, "name", p->rows[i].name);
        for (size_t k = 0; k < p->columns; k++)
            json_add_number(object, p->column[k], p->rows[i].value[k]);
    }
}
