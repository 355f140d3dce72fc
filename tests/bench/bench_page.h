// The page: all stages' results in one self-contained HTML file, and the same as JSON. Used by bench*.c only.
#pragma once
#include "platform/files/json.h"
#include "tests/bench/bench_result.h"

#include <stdio.h>

// Where a stage's report goes: to either, or, where both are NULL, to standard output as text.
struct bench_page {
    FILE *html;
    struct json *stages; // an array
};

// How the page shows a stage.
struct bench_section {
    const struct bench_stage *stage;
    const char *title;
    const char *usual;                  // the contender that the product takes by itself; NULL: none
    const char *error_text, *time_text; // what the plot's axes say
};

void bench_put_plain_table(FILE *html, const struct bench_plain *p);

// The stability table; `answers`: a file to store them in, or NULL. *wrong: cases that are wrong, or right without
// guard.
MUST_CHECK enum status bench_put_stability(const struct bench_page *page, const char *answers, int *wrong);

enum { BENCH_PLAINS = 8 };

// What all stages together gave.
struct bench_whole {
    const struct bench_result *results;
    const struct bench_section *const *sections; // of each
    int count;
    struct bench_plain plain[BENCH_PLAINS];                  // tables without a baseline
    const struct bench_section *plain_section[BENCH_PLAINS]; // of each
    int plain_count;
    double took_s; // of the stages
    int argc;      // the command that made it
    char **argv;
};
const struct bench_result *bench_find_result(const struct bench_whole *w, const char *stage); // NULL: it did not run
const struct bench_plain *bench_find_plain(const struct bench_whole *w, const char *stage);   // NULL: it did not run
const struct bench_row *bench_find_usual(const struct bench_result *r);                       // NULL: none is

// The whole page, and as JSON what no stage has: machine, budget, questions, growth, stability. begun_s: of the
// monotonic clock. Errors: of what is measured for it.
MUST_CHECK enum status bench_put_whole(const struct bench_page *page, const struct bench_whole *whole, double begun_s);

// ---- bench_plot.c: inline SVG in the page's own colours, so that it follows light and dark
void bench_put_plot(FILE *html, const struct bench_result *r, const struct bench_section *section);

// A curve over sizes on logarithmic axes.
enum { BENCH_SIZES = 8, BENCH_CURVES = 6 };
struct bench_curve {
    const char *name;
    double size[BENCH_SIZES], value[BENCH_SIZES];
    int count;
    double exponent; // of value ~ size^exponent, by least squares of the logarithms
};
void bench_fit_curve(struct bench_curve *c);
struct bench_curves {
    const char *title, *size_text, *value_text;
    struct bench_curve *curve;
    int count;
};
void bench_put_curves(FILE *html, const struct bench_curves *c);

// ---- sections, each in a file of its own; errors: of what is measured for it
MUST_CHECK enum status bench_put_budget(const struct bench_page *page, const struct bench_whole *whole);
MUST_CHECK enum status bench_put_levels(const struct bench_page *page, const struct bench_whole *whole);
MUST_CHECK enum status bench_put_questions(const struct bench_page *page, const struct bench_whole *whole);
MUST_CHECK enum status bench_put_growth(const struct bench_page *page, const struct bench_whole *whole);
