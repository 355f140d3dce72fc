// A comparison as one self-contained page.
#include "compare/report.h"

#include "compare/findings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double RAD = 180 / 3.14159265358979323846;
enum { WORST = 6, CELLS = 240 };

// Text from outside: file and take names.
static void escaped(FILE *to, const char *text)
{
    for (; *text; text++)
        switch (*text) {
        case '<': fputs("&lt;", to); break;
        case '>': fputs("&gt;", to); break;
        case '&': fputs("&amp;", to); break;
        case '"': fputs("&quot;", to); break;
        default: fputc(*text, to);
        }
}

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
    "figure{margin:0;border:1px solid var(--line);border-radius:.5rem;padding:.5rem}figcaption{font-size:.85rem}"
    ".bone{stroke-width:3;stroke-linecap:round;fill:none}.bad{stroke:var(--different);stroke-width:5}"
    "text{font:11px system-ui,sans-serif;fill:var(--dim)}table{border-collapse:collapse;width:100%}"
    "td,th{text-align:left;padding:.2rem .6rem .2rem 0;border-bottom:1px solid var(--line)}</style>";

// ------------------------------------------------------------- the strip

static const char *colour(enum verdict v)
{
    return v == VERDICT_DIFFERENT ? "different" : v == VERDICT_SAME ? "same" : "unknown";
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
    const int step = seconds > 120 ? 60 : seconds > 30 ? 10 : seconds > 8 ? 2 : 1;
    for (int s = 0; s <= (int)seconds; s += step)
        fprintf(to, "<text x=\"%.1f\" y=\"%d\">%d s</text>", LEFT + s * WIDTH / seconds, ROW * PART_COUNT + 15, s);
    fputs("</svg>", to);
}

// ------------------------------------------------------------- stick figures

// Unit bones of an average build, in the person's own frame; x, y: from the front, 100 units high.
struct point {
    double x, y, z;
};

static struct point along(struct point from, const float d[3], double length)
{
    return (struct point){from.x + length * d[0], from.y + length * d[1], from.z + length * d[2]};
}

// View from the front and a little from the side, the person's left on the viewer's right.
static void bone(FILE *to, struct point a, struct point b, const char *class, double centre)
{
    const double side = 0.35;
    fprintf(to, "<line class=\"bone %s\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", class,
            centre + a.x + side * a.y, 62 - a.z, centre + b.x + side * b.y, 62 - b.z);
}

static void figure(FILE *to, const struct movement_frame *f, const char *class, int bad, double centre)
{
    static const double length[PART_COUNT] = {
        [PART_HEAD] = 11,         [PART_UPPER_TORSO] = 15,     [PART_LOWER_TORSO] = 12,   [PART_LEFT_UPPER_ARM] = 17,
        [PART_LEFT_FOREARM] = 15, [PART_RIGHT_UPPER_ARM] = 17, [PART_RIGHT_FOREARM] = 15, [PART_LEFT_THIGH] = 24,
        [PART_LEFT_SHIN] = 23,    [PART_RIGHT_THIGH] = 24,     [PART_RIGHT_SHIN] = 23,
    };
    const struct point waist = {0, 0, 0};
    struct point torso = along(waist, f->direction[PART_LOWER_TORSO], length[PART_LOWER_TORSO]);
    struct point neck = along(torso, f->direction[PART_UPPER_TORSO], length[PART_UPPER_TORSO]);
    struct point ends[PART_COUNT];
    for (int p = 0; p < PART_COUNT; p++) {
        struct point from = waist;
        const bool left = !strncmp(part_name((enum part)p), "left", 4);
        const double aside = left ? 1 : -1;
        if (p == PART_UPPER_TORSO)
            from = torso;
        else if (p == PART_HEAD)
            from = neck;
        else if (p == PART_LEFT_UPPER_ARM || p == PART_RIGHT_UPPER_ARM)
            from = along(neck, f->shoulders, aside * 9);
        else if (p == PART_LEFT_FOREARM || p == PART_LEFT_SHIN || p == PART_RIGHT_FOREARM || p == PART_RIGHT_SHIN)
            from = ends[p - 1];
        else if (p == PART_LEFT_THIGH || p == PART_RIGHT_THIGH)
            from = (struct point){aside * 5, 0, -2};
        ends[p] = along(from, f->direction[p], length[p]);
        if (f->known >> p & 1)
            bone(to, from, ends[p], p == bad ? "bad" : class, centre);
    }
}

static int part_by_name(const char *name)
{
    for (int p = 0; p < PART_COUNT; p++)
        if (!strcmp(name, part_name((enum part)p)))
            return p;
    return -1;
}

static void pictures(FILE *to, const struct comparison *c)
{
    int shown = 0;
    for (int32_t k = 0; k < c->finding_count && shown < WORST; k++) {
        const struct finding *f = &c->findings[k];
        const int32_t at = (int32_t)((f->from_s + f->to_s) / 2 * MOVEMENT_RATE_HZ);
        if ((f->kind != FINDING_POSTURE && f->kind != FINDING_RANGE && f->kind != FINDING_MIRRORED) ||
            at >= c->b.count || isnan(c->timeline.reference[at]))
            continue;
        const struct movement_frame reference = movement_at(&c->a, c->timeline.reference[at]);
        fputs("<figure><svg viewBox=\"0 0 200 125\"><style>.a{stroke:var(--a)}.b{stroke:var(--b)}</style>", to);
        figure(to, &reference, "a", -1, 55);
        figure(to, &c->b.frames[at], "b", part_by_name(f->part), 145);
        fprintf(
            to,
            "<text x=\"55\" y=\"122\" text-anchor=\"middle\">reference, %.1f s</text>"
            "<text x=\"145\" y=\"122\" text-anchor=\"middle\">attempt, %.1f s</text></svg><figcaption>%s</figcaption>"
            "</figure>",
            (double)c->timeline.reference[at] / MOVEMENT_RATE_HZ, at / MOVEMENT_RATE_HZ, f->sentence);
        shown++;
    }
}

// ------------------------------------------------------------- tables

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
        fprintf(to, "<tr><td>%s</td><td>%.0f° to %.0f°</td><td>%.0f° to %.0f°</td></tr>", name, c->range_a[k].low * RAD,
                c->range_a[k].high * RAD, c->range_b[k].low * RAD, c->range_b[k].high * RAD);
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

char *report_html(const struct comparison *c, const char *reference_name, const char *attempt_name)
{
    char *bytes = NULL;
    size_t size = 0;
    uint8_t *cell = NULL;
    FILE *to = open_memstream(&bytes, &size);
    if (!to)
        return NULL;
    bool broken = verdicts_of(c, &cell) != OK;
    fputs(head, to);
    fputs("<h1>", to);
    escaped(to, attempt_name);
    fputs(" <span class=\"dim\">compared with</span> ", to);
    escaped(to, reference_name);
    fprintf(to, "</h1><div class=\"score\">%.0f</div><div class=\"dim\">of 100</div><h2>What differs</h2><ol>",
            c->score);
    for (int32_t k = 0; k < c->finding_count; k++)
        fprintf(to, "<li>%s <span class=\"dim\">%s</span></li>", c->findings[k].sentence,
                finding_kind_name(c->findings[k].kind));
    fputs(c->finding_count ? "</ol>" : "</ol><p>Nothing was found.</p>", to);
    fputs("<h2>Over time</h2>", to);
    if (!broken)
        strip(to, c, cell);
    fputs("<p class=\"dim\">Orange: more than 10° different. Green: the same. Grey: cannot tell.</p>"
          "<h2>Worst moments</h2><div class=\"pairs\">",
          to);
    pictures(to, c);
    fputs("</div>", to);
    repetitions(to, c);
    ranges(to, c);
    fputs("</html>\n", to);
    free(cell);
    broken = ferror(to) || broken;
    if (!fclose(to) && !broken)
        return bytes;
    free(bytes);
    return NULL;
}
