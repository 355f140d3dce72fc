// The page: one self-contained HTML file about all stages.
#include "tests/bench/bench_page.h"

#include "base/clock.h"
#include "base/text.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

static const char style[] =
    ":root{color-scheme:light dark;--paper:#fff;--ink:#1c2430;--soft:#5b6675;--line:#dfe4ea;--ours:#0b62c4;"
    "--theirs:#b35a00;--good:#0a7f45;--bad:#c2222d}\n"
    "@media(prefers-color-scheme:dark){:root{--paper:#12161c;--ink:#e6ebf2;--soft:#9aa7b8;--line:#2a323d;"
    "--ours:#6db1ff;--theirs:#ffab5e;--good:#4fd08a;--bad:#ff7a80}}\n"
    "*{box-sizing:border-box}body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);"
    "margin:0 auto;max-width:62rem;padding:1rem}\n"
    "h1{line-height:1.2;margin:.5rem 0}h2{margin:2.5rem 0 .5rem;border-top:1px solid var(--line);padding-top:1rem}"
    "a{color:var(--ours)}p{max-width:46rem}.soft,figcaption,small{color:var(--soft)}nav a{margin-right:.9em;"
    "white-space:nowrap}\n"
    ".scroll{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}"
    "td,th{padding:.2rem .7rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}"
    "td:first-child,th:first-child{text-align:left}.theirs-row{font-style:italic}.usual td:first-child"
    "{font-weight:600}.bad "
    "td{color:var(--bad)}td.why{white-space:normal;text-align:left;min-width:12rem}details{margin:.4rem "
    "0}summary{cursor:pointer}\n"
    "svg.plot{width:100%;height:auto;max-width:45rem;display:block}svg text{font:12px system-ui,sans-serif;"
    "fill:var(--ink);paint-order:stroke;stroke:var(--paper);stroke-width:3px}.grid{stroke:var(--line);fill:none}."
    "frontier{stroke:var(--good);stroke-width:2;fill:none;"
    "stroke-dasharray:5 4}.ours{fill:var(--ours)}.theirs{fill:var(--theirs)}.ring{fill:none;stroke:var(--ours);"
    "stroke-width:1.5}.line{fill:none;stroke:var(--c);stroke-width:2}.dot{fill:var(--c)}.key{display:inline-block;"
    "width:.8em;height:.8em;border-radius:50%;background:var(--c);margin:0 .35em 0 .2em}\n"
    ".c0{--c:var(--ours)}.c1{--c:var(--theirs)}.c2{--c:var(--good)}.c3{--c:#a05ad6}.c4{--c:var(--bad)}"
    ".c5{--c:var(--soft)}figure{margin:.5rem 0}.shots{display:flex;flex-wrap:wrap;gap:.8rem}.shots figure"
    "{flex:1 1 14rem;max-width:22rem}.shots img{width:100%;height:auto;border:1px solid var(--line)}\n"
    ".bar{display:flex;height:2.2rem;width:100%;border-radius:4px;overflow:hidden;background:var(--line)}"
    ".bar span{background:var(--c);color:var(--paper);font-size:.75rem;display:flex;align-items:center;"
    "justify-content:center;overflow:hidden;white-space:nowrap}\n"
    "code{font-size:.9em;overflow-wrap:anywhere}@media(max-width:34rem){svg "
    "text{font-size:19px}body{padding:.6rem}h2{margin-top:1.6rem}}\n"
    "@media print{:root{--paper:#fff;--ink:#000;--soft:#444;--line:#ccc;--ours:#0b62c4;--theirs:#b35a00;"
    "--good:#0a7f45;--bad:#c2222d}body{max-width:none;font-size:10pt}nav{display:none}section,figure,table"
    "{break-inside:avoid}h2{break-after:avoid}.scroll{overflow:visible}}\n";

const struct bench_result *bench_find_result(const struct bench_whole *w, const char *stage)
{
    for (int i = 0; i < w->count; i++)
        if (!strcmp(w->results[i].stage->name, stage))
            return &w->results[i];
    return NULL;
}

const struct bench_plain *bench_find_plain(const struct bench_whole *w, const char *stage)
{
    for (int i = 0; i < w->plain_count; i++)
        if (!strcmp(w->plain[i].stage->name, stage))
            return &w->plain[i];
    return NULL;
}

const struct bench_row *bench_find_usual(const struct bench_result *r)
{
    for (size_t i = 0; r && i < r->count; i++)
        if (r->rows[i].usual)
            return &r->rows[i];
    return NULL;
}

// ------------------------------------------------------------- machine

static void read_processor(char *out, size_t bytes)
{
    char line[512];
    FILE *file = fopen("/proc/cpuinfo", "r");
    snprintf(out, bytes, "unknown processor");
    while (file && fgets(line, sizeof line, file))
        if (!strncmp(line, "model name", 10) && strchr(line, ':')) {
            snprintf(out, bytes, "%.120s", strchr(line, ':') + 2);
            out[strcspn(out, "\n")] = 0;
            break;
        }
    if (file)
        fclose(file);
}

static void put_machine(const struct bench_page *page, const struct bench_whole *w)
{
    struct utsname name = {0};
    char processor[128], command[1024] = "";
    double load[3] = {0};
    uname(&name);
    read_processor(processor, sizeof processor);
    (void)getloadavg(load, 3);
    for (int i = 0; i < w->argc; i++)
        snprintf(command + strlen(command), sizeof command - strlen(command), "%s%s", i ? " " : "", w->argv[i]);
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    if (page->html) {
        fputs("<p class=\"soft\">", page->html);
        html_put_text(page->html, processor);
        fprintf(page->html, ", %ld cores, %s %s; compiler ", cores, name.sysname, name.machine);
        html_put_text(page->html, __VERSION__);
        fprintf(page->html, "; load %.1f; made in %.0f s by <code>", load[0], w->took_s);
        html_put_text(page->html, command);
        fputs("</code></p>\n", page->html);
    }
    struct json *o = page->stages ? json_add_object(page->stages, NULL) : NULL;
    if (o) {
        json_add_string(o, "name", "machine");
        json_add_string(o, "processor", processor);
        json_add_number(o, "cores", (double)cores);
        json_add_string(o, "compiler", __VERSION__);
        json_add_string(o, "command", command);
        json_add_number(o, "load", load[0]);
        json_add_number(o, "took_s", w->took_s);
    }
}

// ------------------------------------------------------------- stages

static void put_cell(FILE *f, double value)
{
    if (isnan(value))
        fputs("<td>–</td>", f);
    else
        fprintf(f, "<td>%.4g</td>", value);
}

static void put_table(FILE *f, const struct bench_result *r)
{
    const struct bench_row *baseline = bench_baseline(r);
    fprintf(f,
            "<div class=\"scroll\"><table><tr><th></th><th>%s</th><th>95 %%</th><th>×</th><th>%s</th><th>95 %%</th>"
            "<th>×</th>",
            r->stage->error_name, r->stage->time_name);
    for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
        fprintf(f, "<th>%s</th>", r->stage->extra_names[k]);
    fputs("<th>missed</th></tr>\n", f);
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        if (row->group)
            continue;
        fprintf(f, "<tr class=\"%s%s\"><td>", row->baseline ? "theirs-row" : "", row->usual ? "usual" : "");
        html_put_text(f, row->name);
        fputs(row->usual ? " (default)</td>" : "</td>", f);
        put_cell(f, row->error);
        put_cell(f, row->error_p95);
        put_cell(f, row->error / baseline->error);
        put_cell(f, row->time_ms);
        put_cell(f, row->time_p95_ms);
        if (bench_row_unsteady(row))
            fprintf(f, "<td>%.3g to %.3g</td>", fmin(row->ratio[0], row->ratio[1]), fmax(row->ratio[0], row->ratio[1]));
        else
            put_cell(f, row->time_ms / baseline->time_ms);
        for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
            put_cell(f, row->extra[k]);
        fprintf(f, "<td>%d</td></tr>\n", row->missed);
    }
    fputs("</table></div>\n", f);
}

static void put_shots(FILE *f, const struct bench_shots *shots)
{
    if (!shots->count)
        return;
    fputs("<div class=\"shots\">", f);
    for (int i = 0; i < shots->count; i++) {
        const struct bench_shot *s = &shots->at[i];
        fprintf(f, "<figure><img width=\"%d\" height=\"%d\" alt=\"", s->width, s->height);
        html_put_text(f, s->caption);
        fputs("\" src=\"data:image/jpeg;base64,", f);
        html_put_base64(f, s->jpeg, s->bytes);
        fputs("\"><figcaption>", f);
        html_put_text(f, s->caption);
        fputs("</figcaption></figure>", f);
    }
    fputs("</div>\n", f);
}

static void put_about(FILE *f, const struct bench_stage *stage, const char *title)
{
    fprintf(f, "<section id=\"%s\"><h2>", stage->name);
    html_put_text(f, title);
    fputs("</h2>\n<p>", f);
    fputc(toupper((unsigned char)stage->about[0]), f);
    html_put_text(f, stage->about + 1);
}

static void put_stage(FILE *f, const struct bench_result *r, const struct bench_section *section)
{
    put_about(f, r->stage, section->title);
    fprintf(f,
            ". <span class=\"soft\">%d items, %d rounds, interleaved; medians, and the 95th percentile of the items. "
            "Alone: <code>reenact-bench %s</code></span></p>\n",
            r->items, r->rounds, r->stage->name);
    bench_put_plot(f, r, section);
    put_table(f, r);
    put_shots(f, &r->shots);
    fputs("</section>\n", f);
}

void bench_put_plain_table(FILE *f, const struct bench_plain *p)
{
    fputs("<div class=\"scroll\"><table><tr><th></th>", f);
    for (size_t k = 0; k < p->columns; k++)
        fprintf(f, "<th>%s</th>", p->column[k]);
    fputs("</tr>\n", f);
    for (size_t i = 0; i < p->count; i++) {
        fputs("<tr><td>", f);
        html_put_text(f, p->rows[i].name);
        fputs("</td>", f);
        for (size_t k = 0; k < p->columns; k++)
            put_cell(f, p->rows[i].value[k]);
        fputs("</tr>\n", f);
    }
    fputs("</table></div>\n", f);
    put_shots(f, &p->shots);
}

// A stage without a baseline: its table.
static void put_plain_stage(FILE *f, const struct bench_plain *p, const struct bench_section *section)
{
    put_about(f, p->stage, section->title);
    fprintf(f, ". <span class=\"soft\">Alone: <code>reenact-bench %s</code></span></p>\n", p->stage->name);
    bench_put_plain_table(f, p);
    fputs("</section>\n", f);
}

// Which ratios two halves of the rounds do not agree on.
static void put_unsteady(FILE *f, const struct bench_whole *w)
{
    int count = 0;
    for (int i = 0; i < w->count; i++)
        for (size_t k = 0; k < w->results[i].count; k++)
            count += bench_row_unsteady(&w->results[i].rows[k]);
    fprintf(f, "<p>Odd and even rounds agree within %.0f %% on every ratio of times", 100 * BENCH_UNSTEADY);
    if (count)
        fputs(" but these: ", f);
    for (int i = 0; i < w->count; i++)
        for (size_t k = 0; k < w->results[i].count; k++)
            if (bench_row_unsteady(&w->results[i].rows[k])) {
                fprintf(f, "%s, ", w->results[i].stage->name);
                html_put_text(f, w->results[i].rows[k].name);
                fputs(--count ? "; " : "", f);
            }
    fputs(".</p>\n", f);
}

// Whether the stages ran that the sections beyond them are made of.
static bool has_all(const struct bench_whole *w)
{
    return bench_find_result(w, "draw") && bench_find_result(w, "place");
}

static void put_head(FILE *f, const struct bench_whole *w)
{
    static const char *const more[][2] = {{"budget", "One frame"},
                                          {"distance", "Level of detail"},
                                          {"questions", "Questions"},
                                          {"growth", "Growth"},
                                          {"stability", "Stability"}};
    fprintf(f,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
            "content=\"width=device-width, initial-scale=1\"><title>Speed against error</title><style>\n%s</style>"
            "</head><body>\n<h1>Speed against error</h1>\n<p>Each stage over its settings, next to what one would take "
            "instead, on the same input in the same run. Lower left is better; the dashed line is the frontier, the "
            "ring the default, italic what one would take instead. × is of that.</p>\n<nav>",
            style);
    for (int i = 0; i < w->count; i++) {
        fprintf(f, "<a href=\"#%s\">", w->results[i].stage->name);
        html_put_text(f, w->sections[i]->title);
        fputs("</a> ", f);
    }
    for (int i = 0; i < w->plain_count; i++)
        if (strcmp(w->plain[i].stage->name, "levels"))
            fprintf(f, "<a href=\"#%s\">%s</a> ", w->plain[i].stage->name, w->plain_section[i]->title);
    for (size_t i = 0; i < COUNT_OF(more) && has_all(w); i++)
        fprintf(f, "<a href=\"#%s\">%s</a> ", more[i][0], more[i][1]);
    fputs("</nav>\n", f);
}

static enum status put_section(const struct bench_page *page, const char *id, const char *title,
                               enum status (*put)(const struct bench_page *page, const struct bench_whole *whole),
                               const struct bench_whole *w)
{
    if (page->html)
        fprintf(page->html, "<section id=\"%s\"><h2>%s</h2>\n", id, title);
    const double from_s = (double)clock_now_ns() * 1e-9;
    const enum status status = put(page, w);
    if (page->html)
        fputs("</section>\n", page->html);
    fprintf(stderr, "reenact-bench: %-12s %6.1f s\n", id, (double)clock_now_ns() * 1e-9 - from_s);
    return status;
}

static enum status put_stability(const struct bench_page *page, const struct bench_whole *w)
{
    int wrong;
    (void)w;
    return bench_put_stability(page, NULL, &wrong);
}

enum status bench_put_whole(const struct bench_page *page, const struct bench_whole *w, double begun_s)
{
    struct bench_whole timed = *w;
    const bool all = has_all(w);
    enum status status = OK;
    if (page->html)
        put_head(page->html, w);
    for (int i = 0; i < w->count && page->html; i++)
        put_stage(page->html, &w->results[i], w->sections[i]);
    for (int i = 0; i < w->plain_count; i++) {
        if (!strcmp(w->plain[i].stage->name, "levels"))
            continue; // has a section of its own
        if (page->html)
            put_plain_stage(page->html, &w->plain[i], w->plain_section[i]);
        if (page->stages)
            bench_add_plain_json(page->stages, &w->plain[i]);
    }
    if (all) {
        status = put_section(page, "budget", "The budget of one displayed frame", bench_put_budget, w);
        if (status == OK)
            status =
                put_section(page, "distance", "What <code>auto</code> takes at each distance", bench_put_levels, w);
        if (status == OK)
            status = put_section(page, "questions", "The study's questions", bench_put_questions, w);
        if (status == OK)
            status = put_section(page, "growth", "Growth", bench_put_growth, w);
        if (status == OK)
            status = put_section(page, "stability", "Hard cases", put_stability, w);
    }
    if (page->html)
        fputs("<section id=\"machine\"><h2>How it was measured</h2>\n", page->html);
    timed.took_s = (double)clock_now_ns() * 1e-9 - begun_s;
    put_machine(page, &timed);
    if (page->html) {
        put_unsteady(page->html, w);
        fputs("</section></body></html>\n", page->html);
    }
    return status;
}
