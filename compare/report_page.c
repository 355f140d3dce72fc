// A comparison as one self-contained page, and the pictures of its moments.
#include "compare/report.h"

#include "base/portable_math.h"
#include "base/text.h"
#include "compare/findings.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- report figures

// The page's pictures of the worst moments: people where they were given, else stick figures.

// ------------------------------------------------------------- which moments

// From the front and a little from the part's own side; nearly from the side where the part is too far forwards or
// back.
static double azimuth_of(const struct comparison *comparison, int32_t frame, int part)
{
    if (part < 0)
        return -0.35;
    const int judged = judged_part(comparison, part);
    const struct movement_frame a = movement_at(&comparison->a, comparison->timeline.reference[frame]),
                                *b = &comparison->judged.frames[frame];
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = fabs((double)b->direction[judged][k] - a.direction[judged][k]);
    const double turned = d[1] > d[0] && d[1] > 0.7 * d[2] ? 1.1 : 0.35;
    return strncmp(part_name((enum part)part), "left", 4) ? -turned : turned;
}

int report_moments(const struct comparison *comparison, struct report_moment moments[REPORT_MOMENTS])
{
    int count = 0;
    for (int32_t k = 0; k < comparison->finding_count && count < REPORT_MOMENTS; k++) {
        const struct finding *f = &comparison->findings[k];
        const int part = part_by_name(f->part);
        const int32_t at = (int32_t)lround(finding_worst_s(comparison, f) * MOVEMENT_RATE_HZ);
        if ((f->kind != FINDING_POSTURE && f->kind != FINDING_RANGE && f->kind != FINDING_MIRRORED) ||
            at >= comparison->b.count || isnan(comparison->timeline.reference[at]))
            continue;
        const double azimuth_rad = azimuth_of(comparison, at, part);
        moments[count++] = (struct report_moment){
            .finding = k,
            .part = part,
            .attempt_s = at / MOVEMENT_RATE_HZ,
            .reference_s = comparison->timeline.reference[at] / MOVEMENT_RATE_HZ,
            .attempt_azimuth_rad = azimuth_rad,
            .reference_azimuth_rad = part >= 0 && comparison->mirrored ? -azimuth_rad : azimuth_rad,
        };
    }
    return count;
}

void report_moments_free(struct report_moment *moments, int count)
{
    for (int k = 0; k < count; k++) {
        free(moments[k].attempt.png);
        free(moments[k].reference.png);
    }
}

// ------------------------------------------------------------- stick figures

// Unit bones of an average build, in the person's own frame, 100 units high.
struct point {
    double x, y, z;
};

static struct point point_along(struct point from, const float d[3], double length)
{
    return (struct point){from.x + length * d[0], from.y + length * d[1], from.z + length * d[2]};
}

// Where and from which side a figure is drawn. From the front the person's left is on the viewer's right.
struct stand {
    double centre, right_x, right_y;
};

static struct stand stand_of(double centre, double azimuth_rad)
{
    return (struct stand){centre, portable_cos(azimuth_rad), -portable_sin(azimuth_rad)};
}

static void write_bone(FILE *to, struct point a, struct point b, const char *class, const struct stand *stand)
{
    fprintf(to, "<line class=\"bone %s\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", class,
            stand->centre + stand->right_x * a.x + stand->right_y * a.y, 62 - a.z,
            stand->centre + stand->right_x * b.x + stand->right_y * b.y, 62 - b.z);
}

static void write_figure(FILE *to, const struct movement_frame *frame, const char *class, int bad,
                         const struct stand *stand)
{
    static const double length[PART_COUNT] = {
        [PART_HEAD] = 11,         [PART_UPPER_TORSO] = 15,     [PART_LOWER_TORSO] = 12,   [PART_LEFT_UPPER_ARM] = 17,
        [PART_LEFT_FOREARM] = 15, [PART_RIGHT_UPPER_ARM] = 17, [PART_RIGHT_FOREARM] = 15, [PART_LEFT_THIGH] = 24,
        [PART_LEFT_SHIN] = 23,    [PART_RIGHT_THIGH] = 24,     [PART_RIGHT_SHIN] = 23,
    };
    const struct point waist = {0, 0, 0};
    struct point torso = point_along(waist, frame->direction[PART_LOWER_TORSO], length[PART_LOWER_TORSO]);
    struct point neck = point_along(torso, frame->direction[PART_UPPER_TORSO], length[PART_UPPER_TORSO]);
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
            from = point_along(neck, frame->shoulders, aside * 9);
        else if (p == PART_LEFT_FOREARM || p == PART_LEFT_SHIN || p == PART_RIGHT_FOREARM || p == PART_RIGHT_SHIN)
            from = ends[p - 1];
        else if (p == PART_LEFT_THIGH || p == PART_RIGHT_THIGH)
            from = (struct point){aside * 5, 0, -2};
        ends[p] = point_along(from, frame->direction[p], length[p]);
        if (frame->known >> p & 1)
            write_bone(to, from, ends[p], p == bad ? "bad" : class, stand);
    }
}

// ------------------------------------------------------------- pictures

static void write_picture(FILE *to, const struct report_picture *picture, double left)
{
    const double width = 88, height = width * picture->height_px / picture->width_px, scale = width / picture->width_px;
    fprintf(to, "<image x=\"%.1f\" y=\"0\" width=\"%.1f\" height=\"%.1f\" href=\"data:image/png;base64,", left, width,
            height);
    html_put_base64(to, picture->png, picture->png_size);
    fputs("\"/>", to);
    if (picture->marked)
        fprintf(to, "<line class=\"bone bad\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>",
                left + scale * picture->from_px[0], scale * picture->from_px[1], left + scale * picture->to_px[0],
                scale * picture->to_px[1]);
}

static void report_figures(FILE *to, const struct report_attempt *attempt)
{
    for (int k = 0; k < attempt->moment_count; k++) {
        const struct report_moment *m = &attempt->moments[k];
        const struct comparison *c = attempt->c;
        const struct stand at_left = stand_of(50, m->reference_azimuth_rad),
                           at_right = stand_of(150, m->attempt_azimuth_rad);
        const struct movement_frame reference = movement_at(&c->a, m->reference_s * MOVEMENT_RATE_HZ),
                                    write_attempt = movement_at(&c->b, m->attempt_s * MOVEMENT_RATE_HZ);
        fputs("<figure><svg viewBox=\"0 0 200 130\"><style>.a{stroke:var(--a)}.b{stroke:var(--b)}</style>", to);
        if (m->reference.png)
            write_picture(to, &m->reference, 6);
        else
            write_figure(to, &reference, "a", -1, &at_left);
        if (m->attempt.png)
            write_picture(to, &m->attempt, 106);
        else
            write_figure(to, &write_attempt, "b", m->part, &at_right);
        fprintf(to,
                "<text x=\"50\" y=\"127\" text-anchor=\"middle\">reference, %.1f s</text>"
                "<text x=\"150\" y=\"127\" text-anchor=\"middle\">attempt, %.1f s</text></svg>"
                "<figcaption>%s</figcaption></figure>",
                m->reference_s, m->attempt_s, c->findings[m->finding].sentence);
    }
}

// ---------------------------------------------------------------- report html

// A comparison as one self-contained page.

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

static const char *verdict_class(enum verdict verdict)
{
    if (verdict == VERDICT_DIFFERENT)
        return "different";
    return verdict == VERDICT_SAME ? "same" : "unknown";
}

// The worst verdict within each cell of time, cells of equal verdict joined.
static enum status verdicts_of(const struct comparison *comparison, uint8_t **out)
{
    uint8_t *cell = *out = calloc((size_t)CELLS * PART_COUNT, 1);
    if (!cell)
        return ERR_MEMORY;
    for (int32_t f = 0; f < comparison->b.count; f++) {
        struct part_difference parts[PART_COUNT];
        part_differences(&comparison->a, &comparison->judged, &comparison->timeline, f, parts);
        const int at = (int)((int64_t)f * CELLS / comparison->b.count);
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

static void write_strip(FILE *to, const struct comparison *comparison, const uint8_t *cell)
{
    enum { ROW = 16, LEFT = 110, WIDTH = 720 };
    const double seconds = comparison->b.count / MOVEMENT_RATE_HZ;
    // Of short movements there are fewer frames than cells: a cell without a frame continues the one before.
    const int cells = comparison->b.count < CELLS ? comparison->b.count : CELLS;
    fprintf(to, "<svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"Parts that differ, over time\">", LEFT + WIDTH,
            ROW * PART_COUNT + 20);
    for (int p = 0; p < PART_COUNT; p++) {
        const enum part own = comparison->mirrored ? mirrored_part((enum part)p) : (enum part)p;
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
                    ROW - 2, verdict_class((enum verdict)row[at]));
        }
    }
    const int step = time_step_s(seconds);
    for (int s = 0; s <= (int)seconds; s += step)
        fprintf(to, "<text x=\"%.1f\" y=\"%d\">%d s</text>", LEFT + s * WIDTH / seconds, ROW * PART_COUNT + 15, s);
    fputs("</svg>", to);
}

// ------------------------------------------------------------- tables

// Whole ones: -0.3 is 0, not -0.
static int whole_degrees(float rad) { return (int)lround(rad * RAD); }

static void write_ranges(FILE *to, const struct comparison *comparison)
{
    fputs("<h2>Ranges of motion</h2><table><tr><th>joint</th><th>reference</th><th>attempt</th></tr>", to);
    for (int k = 0; k < BODY_ANGLES; k++) {
        char name[32];
        snprintf(name, sizeof name, "%s", body_angle_name((enum body_angle)k));
        for (char *at = name; (at = strchr(at, '_'));)
            *at = ' ';
        if (isnan(comparison->range_a[k].low) || isnan(comparison->range_b[k].low))
            continue;
        fprintf(to, "<tr><td>%s</td><td>%d° to %d°</td><td>%d° to %d°</td></tr>", name,
                whole_degrees(comparison->range_a[k].low), whole_degrees(comparison->range_a[k].high),
                whole_degrees(comparison->range_b[k].low), whole_degrees(comparison->range_b[k].high));
    }
    fputs("</table>", to);
}

static void write_repetitions(FILE *to, const struct comparison *comparison)
{
    if (!comparison->repetitions.count)
        return;
    fputs("<h2>Repetitions</h2><table><tr><th></th><th>time</th><th>score</th></tr>", to);
    for (int32_t k = 0; k < comparison->repetitions.count; k++) {
        const struct performance *r = &comparison->repetitions.at[k];
        fprintf(to, "<tr><td>%d</td><td>%.1f s to %.1f s</td><td>%.0f</td></tr>", (int)k + 1,
                r->attempt.first / MOVEMENT_RATE_HZ, r->attempt.end / MOVEMENT_RATE_HZ, r->score);
    }
    fputs("</table>", to);
}

// ------------------------------------------------------------- progress

// Scores of several attempts, in their order.
static void write_progress(FILE *to, const struct report_attempt *attempts, int32_t count)
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
        if (c->relation == RELATION_SAME)
            fprintf(to, ": <b>%.0f</b> <span class=\"dim\">%s</span></li>", c->score,
                    c->finding_count ? c->findings[0].sentence : "nothing was found");
        else
            fprintf(to, ": <span class=\"dim\">%s</span></li>", c->relation_sentence);
    }
    fputs("</ol>", to);
}

// ------------------------------------------------------------- the page

static bool write_attempt(FILE *to, const struct report_attempt *attempt)
{
    const struct comparison *c = attempt->c;
    uint8_t *cell = NULL;
    const bool whole = verdicts_of(c, &cell) == OK;
    const bool same = c->relation == RELATION_SAME;
    if (same)
        fprintf(to, "<div class=\"score\">%.0f</div><div class=\"dim\">of 100</div><h2>What differs</h2><ol>",
                c->score);
    else
        fprintf(to, "<h2>%s</h2><p>So there is no score.</p><ol>", c->relation_sentence);
    for (int32_t k = 0; k < c->finding_count; k++)
        fprintf(to, "<li>%s <span class=\"dim\">−%.0f</span></li>", c->findings[k].sentence, c->findings[k].loss);
    fputs("</ol>", to);
    if (same && !c->finding_count)
        fputs("<p>Nothing was found.</p>", to);
    char not_judged[NOT_JUDGED_BYTES];
    if (*not_judged_text(c, not_judged))
        fprintf(to, "<p>%c%s.</p>", toupper((unsigned char)*not_judged), not_judged + 1);
    fputs("<h2>Over time</h2>", to);
    if (whole)
        write_strip(to, c, cell);
    fputs("<p class=\"dim\">Orange: more than 10° different. Green: the same. Grey: cannot tell.</p>", to);
    if (attempt->moment_count)
        fputs("<h2>Worst moments</h2>", to);
    fputs("<div class=\"pairs\">", to);
    report_figures(to, attempt);
    fputs("</div>", to);
    write_repetitions(to, c);
    write_ranges(to, c);
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
        write_progress(to, attempts, count);
    for (int32_t k = 0; k < count; k++) {
        // Of several the last is open.
        if (count > 1) {
            fprintf(to, "<details%s><summary>", k + 1 < count ? "" : " open");
            html_put_text(to, attempts[k].name);
            if (attempts[k].c->relation == RELATION_SAME)
                fprintf(to, ": %.0f</summary>", attempts[k].c->score);
            else
                fputs(": no score</summary>", to);
        }
        broken = !write_attempt(to, &attempts[k]) || broken;
        fputs(count > 1 ? "</details>" : "", to);
    }
    fputs("</html>\n", to);
    broken = ferror(to) || broken;
    if (!fclose(to) && !broken)
        return bytes;
    free(bytes);
    return NULL;
}
