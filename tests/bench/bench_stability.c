// The stability stage: the table of hard cases (tests/stability), as text, as JSON, or as a section of the page.
#include "base/text.h"
#include "tests/bench/bench_page.h"
#include "tests/bench/bench_stages.h"
#include "tests/stability/stability.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ANSWER_BYTES = 256 };

// Two digits, or a dash.
static const char *short_number(char out[32], double value)
{
    if (isnan(value))
        snprintf(out, 32, "-");
    else
        snprintf(out, 32, "%.2g", value);
    return out;
}

static const char *judged(const struct stability_result *r)
{
    return r->right ? "right" : r->silent ? "WRONG, IN SILENCE" : "wrong";
}

static void print_case(const struct stability_result *r)
{
    char answer[ANSWER_BYTES], unguarded[ANSWER_BYTES], n[4][32];
    stability_print_answer(answer, sizeof answer, &r->shipped, 5);
    stability_print_answer(unguarded, sizeof unguarded, &r->unguarded, 3);
    printf("  %-52.52s %-24.24s %-7s %8s %8s %8s %8s  %s: %.24s%s\n", r->of->asked, answer, judged(r),
           short_number(n[0], r->float_error), short_number(n[1], r->double_error), short_number(n[2], r->error),
           short_number(n[3], r->condition), r->of->guard, unguarded, r->guard_seen ? "" : " (RIGHT WITHOUT IT)");
}

static void add_case(struct json *cases, const struct stability_result *r)
{
    char answer[ANSWER_BYTES], unguarded[ANSWER_BYTES];
    struct json *o = json_add_object(cases, NULL);
    stability_print_answer(answer, sizeof answer, &r->shipped, 17);
    stability_print_answer(unguarded, sizeof unguarded, &r->unguarded, 17);
    json_add_string(o, "stage", r->stage->name);
    json_add_string(o, "asked", r->of->asked);
    json_add_string(o, "expected", answer_kind_names[r->of->expected]);
    json_add_string(o, "answer", answer);
    json_add_bool(o, "right", r->right);
    json_add_bool(o, "silently_wrong", r->silent);
    json_add_number(o, "float_error", r->float_error);
    json_add_number(o, "double_error", r->double_error);
    json_add_number(o, "error", r->error);
    json_add_number(o, "tolerance", r->of->tolerance);
    json_add_string(o, "unit", r->of->unit ? r->of->unit : "");
    json_add_number(o, "condition", r->condition);
    json_add_string(o, "guard", r->of->guard);
    json_add_string(o, "without_guard", unguarded);
    json_add_bool(o, "wrong_without_guard", r->guard_seen);
}

static void put_case(FILE *html, const struct stability_result *r)
{
    char answer[ANSWER_BYTES], unguarded[ANSWER_BYTES], n[4][32];
    stability_print_answer(answer, sizeof answer, &r->shipped, 5);
    stability_print_answer(unguarded, sizeof unguarded, &r->unguarded, 3);
    fprintf(html, "<tr%s><td>", r->right && r->guard_seen ? "" : " class=\"bad\"");
    html_put_text(html, r->of->asked);
    fputs("</td><td>", html);
    html_put_text(html, answer);
    fprintf(html, "</td><td>%s</td><td>%s</td><td>%s</td><td>%s</td><td>%s</td><td>", judged(r),
            short_number(n[0], r->float_error), short_number(n[1], r->double_error), short_number(n[2], r->error),
            short_number(n[3], r->condition));
    html_put_text(html, r->of->guard);
    fputs("</td><td>", html);
    html_put_text(html, unguarded);
    fputs("</td></tr>\n", html);
}

static enum status store_answers(const char *path, const struct stability_result *results, int count)
{
    char line[512];
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(ERR_IO, "%s cannot be written", path);
    for (int i = 0; i < count; i++) {
        stability_print_stored(line, sizeof line, &results[i]);
        fprintf(file, "%s\n", line);
    }
    return fclose(file) ? fail(ERR_IO, "%s could not be written", path) : OK;
}

static void put_head(FILE *html, int count, int wrong, int silent, int guarded)
{
    fprintf(html,
            "<p>%d cases, %d wrong, %d of them in silence; %d judged wrong once their guard is taken out. Errors are "
            "the largest over an answer's values, against the same formula in quadruple precision (113 bits): of the "
            "textbook formula in "
            "<code>float</code> and <code>double</code>, and of the code as it ships; κ is the relative condition "
            "number.</p>\n",
            count, wrong, silent, guarded);
}

static void put_stage_begin(FILE *html, const char *name)
{
    fprintf(html,
            "<details><summary>%s</summary><div class=\"scroll\"><table><tr><th>asked</th><th>answer</th><th></th>"
            "<th>float</th><th>double</th><th>ours</th><th>κ</th><th>guard</th><th>without it</th></tr>\n",
            name);
}

static void show(const struct stability_result *results, int count, const struct bench_page *page, struct json *cases)
{
    const struct stability_stage *stage = NULL;
    for (int i = 0; i < count; i++) {
        const struct stability_result *r = &results[i];
        if (r->stage != stage) {
            if (page->html && stage)
                fputs("</table></div></details>\n", page->html);
            if (page->html)
                put_stage_begin(page->html, r->stage->name);
            else if (!cases)
                printf("%s%s\n", stage ? "\n" : "", r->stage->name);
            stage = r->stage;
        }
        if (page->html)
            put_case(page->html, r);
        else if (!cases)
            print_case(r);
        if (cases)
            add_case(cases, r);
    }
    if (page->html)
        fputs("</table></div></details>\n", page->html);
}

enum status bench_put_stability(const struct bench_page *page, const char *answers, int *wrong_cases)
{
    const int count = stability_case_count();
    int wrong = 0, silent = 0, guarded = 0;
    struct stability_result *results = calloc((size_t)count, sizeof *results);
    if (!results)
        return fail(ERR_MEMORY, "no memory for %d cases", count);
    for (int i = 0; i < count; i++) {
        results[i] = stability_run(i);
        wrong += !results[i].right;
        silent += results[i].silent;
        guarded += results[i].guard_seen;
    }
    struct json *stage = page->stages ? json_add_object(page->stages, NULL) : NULL;
    if (stage) {
        json_add_string(stage, "name", "stability");
        json_add_number(stage, "count", count);
        json_add_number(stage, "wrong", wrong);
        json_add_number(stage, "silently_wrong", silent);
        json_add_number(stage, "wrong_without_guard", guarded);
    } else if (!page->html) {
        printf("  %-52s %-24s %-7s %8s %8s %8s %8s  %s\n", "asked", "answer", "", "float", "double", "ours", "kappa",
               "guard: the answer without it");
    }
    if (page->html)
        put_head(page->html, count, wrong, silent, guarded);
    show(results, count, page, stage ? json_add_array(stage, "cases") : NULL);
    if (!page->html && !stage)
        printf("\n%d cases, %d wrong, %d of them in silence; %d judged wrong without their guard\n", count, wrong,
               silent, guarded);
    const enum status status = answers ? store_answers(answers, results, count) : OK;
    free(results);
    *wrong_cases = wrong + count - guarded;
    return status;
}

static enum status run(struct bench *b)
{
    int wrong = 0;
    enum status status = bench_put_stability(bench_report_to(b), bench_inputs(b)->answers, &wrong);
    return status == OK && wrong ? fail(ERR_SOLVER, "%d answers are wrong, or right without their guard", wrong)
                                 : status;
}

const struct bench_stage bench_stage_stability = {
    .name = "stability", .about = "hard cases of every stage, against quadruple precision", .run = run};
