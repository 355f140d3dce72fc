// A comparison as one self-contained page.
#include "compare/report_internal.h"

#include "compare/findings.h"
#include "compare/not_judged.h"

#include "base/html.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double RAD = 180 / 3.14159265358979323846;
enum { CELLS = 240 };

static const char head[] =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">"
    "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>Comparison</title><style>"
    ":root{color-scheme:light dark;--back:#fff;--ink:#1b1f24;--dim:#6a737d;--line:#d8dee4;--a:#1769aa;--b:#c2410c;"
    "--same:#d7e8d4;--different:#d9480f;--unknown:#e3e5e8}"
    "@media(prefers-color-scheme:dark){:root{--back:#14171a;--ink:#e6e8ea;--dim:#98a1ab;--line:#30363d;--a:#6cb6ff;"
    "--b:#ff9b5e;--same:#24402a;--different:#f0703c;--unknown:#2b3036}}"
    "body{background:var(--back);color:var(--ink);font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:0 auto;"
    "padding:1rem}h1{font-size:1.2rem;font-weight:600}h2{font-size:1rem;margin:2rem 0 .5rem}"
    ".score{font-size:3.5rem;font-weight:700;line-height:1}.dim{color:var(--dim)}"
    "ol{padding-left:1.5rem}li{margin:.3rem 0}svg{display:block;width:100%;height:auto}"
    ".pairs{display:grid;grid-template-columns:repeat(auto-fill,minmax(15rem,1fr));gap:1rem}"
    "summary{font-weight:600;padding:.4rem 0;cursor:pointer}"
    "figure{margin:0;border:1px solid var(--line);border-radius:.5rem;padding:.5rem}figcaption{font-size:.85rem}"
    ".bone{stroke-width:3;stroke-linecap:round;fill:none}.bad{stroke:var(--different);stroke-width:5}"
    "text{font:11px system-ui,sans-serif;fill:var(--dim)}table{border-collapse:collapse;width:100%}"
    "td,th{text-align:left;padding:.2rem .6rem .2rem 0;border-bottom:1px solid var(--line)}</style>";

// ------------------------------------------------------------- the strip

static const char *colour(enum verdict v)
{
    if (v == VERDICT_DIFFERENT)
        return "different";
    return v == VERDICT_SAME ? "same" : "unknown";
}

// The worst verdict within each cell of time, cells of equal verdict joined.
static enum status verdicts_of(const struct comparison *c, uint8_t **out)
{
    uint8_t *cell = *out = calloc((size_t)CELLS * PART_COUNT, 1);
    if (!cell)
        return ERR_MEMORY;
    for (int32_t f = 0; f < c->b.count; f++) {
        struct part_difference parts[PART_COUNT];
        part_differences(&c->a, &c->judged, &c->timeline, f, parts);
        const int at = (int)((int64_t)f * CELLS / c->b.count);
        for (int p = 0; p < PART_COUNT; p++) {
            uint8_t *v = &cell[p * CELLS + at];
            *v = parts[p].verdict > *v ? (uint8_t)parts[p].verdict : *v;
        }
    }
    return OK;
}

// Seconds between two marks of the time.
static int time_step_s(double seconds)
{
    if (seconds > 120)
        return 60;
    if (seconds > 30)
        return 10;
    return seconds > 8 ? 2 : 1;
}

static void strip(FILE *to, const struct comparison *c, const uint8_t *cell)
{
    enum { ROW = 16, LEFT = 110, WIDTH = 720 };
    const double seconds = c->b.count / MOVEMENT_RATE_HZ;
    // Of short movements there are fewer frames than cells: a cell without a frame continues the one before.
    const int cells = c->b.count < CELLS ? c->b.count : CELLS;
    fprintf(to, "<svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"Parts that differ, over time\">", LEFT + WIDTH,
            ROW * PART_COUNT + 20);
    for (int p = 0; p < PART_COUNT; p++) {
        const enum part own = c->mirrored ? mirrored_part((enum part)p) : (enum part)p;
        char name[32];
        snprintf(name, sizeof name, "%s", part_name(own));
        for (char *at = name; (at = strchr(at, '_'));)
            *at = ' ';
        fprintf(to, "<text x=\"0\" y=\"%d\">%s</text>", p * ROW + 12, name);
        const uint8_t *row = &cell[p * CELLS];
        for (int first = 0, end; first < cells; first = end) {
            const int at = (int)((int64_t)first * CELLS / cells);
            for (end = first + 1; end < cells && row[(int64_t)end * CELLS / cells] == row[at];)
                end++;
            fprintf(to, "<rect x=\"%.1f\" y=\"%d\" width=\"%.1f\" height=\"%d\" fill=\"var(--%s)\"/>",
                    LEFT + (double)first * WIDTH / cells, p * ROW + 1, (double)(end - first) * WIDTH / cells + 0.3,
                    ROW - 2, colour((enum verdict)row[at]));
        }
    }
    const int step = time_step_s(seconds);
    for (int s = 0; s <= (int)seconds; s += step)
        fprintf(to, "<text x=\"%.1f\" y=\"%d\">%d s</text>", LEFT + s * WIDTH / seconds, ROW * PART_COUNT + 15, s);
    fputs("</svg>", to);
}

// ------------------------------------------------------------- tables

// Whole ones: -0.3 is 0, not -0.
static int degrees(float rad) { return (int)lround(rad * RAD); }

static void ranges(FILE *to, const struct comparison *c)
{
    fputs("<h2>Ranges of motion</h2><table><tr><th>joint</th><th>reference</th><th>attempt</th></tr>", to);
    for (int k = 0; k < BODY_ANGLES; k++) {
        char name[32];
        snprintf(name, sizeof name, "%s", body_angle_name((enum body_angle)k));
        for (char *at = name; (at = strchr(at, '_'));)
            *at = ' ';
        if (isnan(c->range_a[k].low) || isnan(c->range_b[k].low))
            continue;
        fprintf(to, "<tr><td>%s</td><td>%d° to %d°</td><td>%d° to %d°</td></tr>", name, degrees(c->range_a[k].low),
                degrees(c->range_a[k].high), degrees(c->range_b[k].low), degrees(c->range_b[k].high));
    }
    fputs("</table>", to);
}

static void repetitions(FILE *to, const struct comparison *c)
{
    if (!c->repetitions.count)
        return;
    fputs("<h2>Repetitions</h2><table><tr><th></th><th>time</th><th>score</th></tr>", to);
    for (int32_t k = 0; k < c->repetitions.count; k++) {
        const struct judged_repetition *r = &c->repetitions.at[k];
        fprintf(to, "<tr><td>%d</td><td>%.1f s to %.1f s</td><td>%.0f</td></tr>", (int)k + 1,
                r->attempt.first / MOVEMENT_RATE_HZ, r->attempt.end / MOVEMENT_RATE_HZ, r->score);
    }
    fputs("</table>", to);
}

// ------------------------------------------------------------- progress

// Scores of several attempts, in their order.
static void progress(FILE *to, const struct report_attempt *attempts, int32_t count)
{
    enum { LEFT = 30, WIDTH = 780, HEIGHT = 120 };
    const double step = count > 1 ? (double)WIDTH / (count - 1) : 0;
    fprintf(to, "<h2>Progress</h2><svg viewBox=\"0 0 830 %d\" role=\"img\" aria-label=\"Score over attempts\">",
            HEIGHT + 30);
    for (int score = 0; score <= 100; score += 50)
        fprintf(to,
                "<line x1=\"%d\" x2=\"%d\" y1=\"%d\" y2=\"%d\" stroke=\"var(--line)\"/>"
                "<text x=\"0\" y=\"%d\">%d</text>",
                LEFT, LEFT + WIDTH + 20, HEIGHT + 10 - score * HEIGHT / 100, HEIGHT + 10 - score * HEIGHT / 100,
                HEIGHT + 14 - score * HEIGHT / 100, score);
    fputs("<polyline fill=\"none\" stroke=\"var(--a)\" stroke-width=\"2\" points=\"", to);
    for (int32_t k = 0; k < count; k++)
        fprintf(to, "%.1f,%.1f ", LEFT + 10 + k * step, HEIGHT + 10 - attempts[k].c->score * HEIGHT / 100);
    fputs("\"/>", to);
    for (int32_t k = 0; k < count; k++) {
        const double x = LEFT + 10 + k * step, y = HEIGHT + 10 - attempts[k].c->score * HEIGHT / 100;
        fprintf(to, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"var(--a)\"><title>", x, y);
        html_put_text(to, attempts[k].name);
        fprintf(to, ": %.0f</title></circle><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%d</text>",
                attempts[k].c->score, x, HEIGHT + 26, (int)k + 1);
    }
    fputs("</svg><ol>", to);
    for (int32_t k = 0; k < count; k++) {
        const struct comparison *c = attempts[k].c;
        fputs("<li>", to);
        html_put_text(to, attempts[k].name);
        fprintf(to, ": <b>%.0f</b> <span class=\"dim\">%s</span></li>", c->score,
                c->finding_count ? c->findings[0].sentence : "nothing was found");
    }
    fputs("</ol>", to);
}

// ------------------------------------------------------------- the page

static bool attempt(FILE *to, const struct report_attempt *a)
{
    const struct comparison *c = a->c;
    uint8_t *cell = NULL;
    const bool whole = verdicts_of(c, &cell) == OK;
    fprintf(to, "<div class=\"score\">%.0f</div><div class=\"dim\">of 100</div><h2>What differs</h2><ol>", c->score);
    for (int32_t k = 0; k < c->finding_count; k++)
        fprintf(to, "<li>%s <span class=\"dim\">%s</span></li>", c->findings[k].sentence,
                finding_kind_name(c->findings[k].kind));
    fputs(c->finding_count ? "</ol>" : "</ol><p>Nothing was found.</p>", to);
    char not_judged[NOT_JUDGED_BYTES];
    if (*not_judged_text(c, not_judged))
        fprintf(to, "<p>%c%s.</p>", toupper((unsigned char)*not_judged), not_judged + 1);
    fputs("<h2>Over time</h2>", to);
    if (whole)
        strip(to, c, cell);
    fputs("<p class=\"dim\">Orange: more than 10° different. Green: the same. Grey: cannot tell.</p>", to);
    if (a->moment_count)
        fputs("<h2>Worst moments</h2>", to);
    fputs("<div class=\"pairs\">", to);
    report_figures(to, a);
    fputs("</div>", to);
    repetitions(to, c);
    ranges(to, c);
    free(cell);
    return whole;
}

char *report_html(const struct report_attempt *attempts, int32_t count, const char *reference_name)
{
    char *bytes = NULL;
    size_t size = 0;
    FILE *to = open_memstream(&bytes, &size);
    if (!to)
        return NULL;
    fputs(head, to);
    fputs("<h1>", to);
    if (count == 1)
        html_put_text(to, attempts[0].name);
    else
        fprintf(to, "%d attempts", (int)count);
    fputs(" <span class=\"dim\">compared with</span> ", to);
    html_put_text(to, reference_name);
    fputs("</h1>", to);
    bool broken = false;
    if (count > 1)
        progress(to, attempts, count);
    for (int32_t k = 0; k < count; k++) {
        // Of several the last is open.
        if (count > 1) {
            fprintf(to, "<details%s><summary>", k + 1 < count ? "" : " open");
            html_put_text(to, attempts[k].name);
            fprintf(to, ": %.0f</summary>", attempts[k].c->score);
        }
        broken = !attempt(to, &attempts[k]) || broken;
        fputs(count > 1 ? "</details>" : "", to);
    }
    fputs("</html>\n", to);
    broken = ferror(to) || broken;
    if (!fclose(to) && !broken)
        return bytes;
    free(bytes);
    return NULL;
}
