// A comparison as one self-contained page, and the pictures of its moments.
#include "base/portable_math.h"
#include "base/text.h"
#include "compare/findings.h"
#include "compare/good_parts.h"
#include "compare/report.h"

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

// The attempt's frame at which the parts together differ most; -1: none is aligned.
static int32_t most_different_frame(const struct comparison *comparison)
{
    double most = -1;
    int32_t at = -1;
    for (int32_t f = 0; f < comparison->b.count; f++) {
        struct part_difference parts[PART_COUNT];
        double sum = 0;
        if (isnan(comparison->timeline.reference[f]))
            continue;
        comparison_differences(comparison, &comparison->judged, f, parts);
        for (int p = 0; p < PART_COUNT; p++)
            sum += isnan(parts[p].angle_rad) ? 0 : (double)parts[p].angle_rad * parts[p].angle_rad;
        if (sum > most) {
            most = sum;
            at = f;
        }
    }
    return at;
}

static struct report_moment moment_at(const struct comparison *comparison, int32_t frame, int32_t finding, int part)
{
    const double azimuth_rad = azimuth_of(comparison, frame, part);
    return (struct report_moment){
        .finding = finding,
        .part = part,
        .attempt_s = frame / MOVEMENT_RATE_HZ,
        .reference_s = comparison->timeline.reference[frame] / MOVEMENT_RATE_HZ,
        .attempt_azimuth_rad = azimuth_rad,
        .reference_azimuth_rad = part >= 0 && comparison->mirrored ? -azimuth_rad : azimuth_rad,
    };
}

int report_moments(const struct comparison *comparison, struct report_moment moments[REPORT_MOMENTS])
{
    int count = 0;
    if (comparison->relation != RELATION_SAME)
        return 0;
    for (int32_t k = 0; k < comparison->finding_count && count < REPORT_MOMENTS; k++) {
        const struct finding *f = &comparison->findings[k];
        const int part = part_by_name(f->part);
        const int32_t at = (int32_t)lround(finding_worst_s(comparison, f) * MOVEMENT_RATE_HZ);
        if ((f->kind != FINDING_POSTURE && f->kind != FINDING_RANGE && f->kind != FINDING_MIRRORED) ||
            at >= comparison->b.count || isnan(comparison->timeline.reference[at]))
            continue;
        moments[count++] = moment_at(comparison, at, k, part);
    }
    const int32_t at = count ? -1 : most_different_frame(comparison);
    if (at >= 0)
        moments[count++] = moment_at(comparison, at, -1, -1);
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

// Both people, the reference at the left.
static void write_moment(FILE *to, const struct comparison *c, const struct report_moment *m)
{
    const struct stand at_left = stand_of(50, m->reference_azimuth_rad),
                       at_right = stand_of(150, m->attempt_azimuth_rad);
    const struct movement_frame reference = movement_at(&c->a, m->reference_s * MOVEMENT_RATE_HZ),
                                attempt = movement_at(&c->b, m->attempt_s * MOVEMENT_RATE_HZ);
    fputs("<figure><svg viewBox=\"0 0 200 120\">", to);
    if (m->reference.png)
        write_picture(to, &m->reference, 6);
    else
        write_figure(to, &reference, "a", -1, &at_left);
    if (m->attempt.png)
        write_picture(to, &m->attempt, 106);
    else
        write_figure(to, &attempt, "b", m->part, &at_right);
    fprintf(to,
            "</svg><div class=\"pair\"><span>reference, %.1f s</span><span>attempt, %.1f s</span></div>"
            "<figcaption>%s</figcaption></figure>",
            m->reference_s, m->attempt_s,
            m->finding < 0 ? "Where the two differ most" : c->findings[m->finding].sentence);
}

// ---------------------------------------------------------------- report html

// A comparison as one self-contained page.

static const double RAD = 180 / 3.14159265358979323846;
enum { CELLS = 240 };

// One column on a telephone; on a screen and on paper two, as long as a finding's people and its numbers stand side by
// side. Paper has no dark, and nothing that is to be opened.
static const char head[] =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">"
    "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><style>"
    ":root{color-scheme:light dark;--back:#fff;--ink:#1b1f24;--dim:#59636e;--line:#d8dee4;--a:#1769aa;--b:#c2410c;"
    "--same:#d7e8d4;--different:#d9480f;--unknown:#e3e5e8;--pause:#8250df}"
    "@media screen and (prefers-color-scheme:dark){:root{--back:#14171a;--ink:#e6e8ea;--dim:#98a1ab;--line:#30363d;"
    "--a:#6cb6ff;--b:#ff9b5e;--same:#24402a;--different:#f0703c;--unknown:#2b3036;--pause:#b48aff}}"
    "body{background:var(--back);color:var(--ink);font:16px/1.5 system-ui,sans-serif;max-width:64rem;margin:0 auto;"
    "padding:1rem;overflow-wrap:anywhere}h1{font-size:1.25rem;line-height:1.3;margin:0}"
    "h2{font-size:1rem;margin:1rem 0 .4rem}.two>*>h2:first-child{margin-top:0}p{margin:.4rem 0}"
    ".score{font-size:3.5rem;font-weight:700;line-height:1}.dim{color:var(--dim);font-size:.875rem}"
    ".two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,21rem),1fr));gap:1.5rem 2.5rem;"
    "margin-top:1.5rem}.two>*{min-width:0}"
    "ol{padding-left:1.5rem;margin:.4rem 0}li{margin:.3rem 0}svg{display:block;width:100%;height:auto}"
    "summary{font-weight:600;padding:.4rem 0;cursor:pointer}.printed{display:none}"
    "figure{margin:0 0 1rem;border:1px solid var(--line);border-radius:.5rem;padding:.5rem;max-width:30rem}"
    "figcaption{font-size:.9375rem}.pair{display:flex;font-size:.875rem;color:var(--dim)}"
    ".pair>*{flex:1;text-align:center}.a{stroke:var(--a)}.b{stroke:var(--b)}"
    ".bone{stroke-width:3;stroke-linecap:round;fill:none}.bad{stroke:var(--different);stroke-width:5}"
    ".strip{display:grid;grid-template-columns:8.5rem minmax(0,1fr);align-items:center;font-size:.875rem;"
    "line-height:1.35}.strip svg{height:.9rem}.times{position:relative;height:1.4rem;color:var(--dim)}"
    ".times span{position:absolute;transform:translateX(-50%);white-space:nowrap}"
    ".times span:first-child{transform:none}"
    ".plot{max-width:26rem}.plot text{font:16px system-ui,sans-serif;fill:var(--dim)}.key{display:inline-block;"
    "width:.8em;height:.8em;margin-right:.35em}.keys span{margin-right:1rem;white-space:nowrap}"
    "table{border-collapse:collapse;width:100%;font-size:.875rem;line-height:1.35}td,th{text-align:right;"
    "overflow-wrap:normal;padding:.15rem 0 .15rem .5rem;border-bottom:1px solid var(--line);vertical-align:top}"
    ".range{white-space:nowrap}td:first-child,th:first-child{text-align:left;padding-left:0}"
    "@page{size:A4;margin:10mm}@media print{:root{color-scheme:light}body{font-size:9pt;line-height:1.3;padding:0;"
    "max-width:none;print-color-adjust:exact;-webkit-print-color-adjust:exact}h1{font-size:12pt}h2{font-size:9.5pt;"
    "margin-top:2mm}"
    ".score{font-size:26pt}.dim,table,.strip,.pair,figcaption{font-size:8pt}.two{grid-template-columns:1fr 1fr;"
    "gap:3mm 7mm;margin-top:3mm}.two>*,figure,table{break-inside:avoid}.screen{display:none}"
    ".printed{display:block}figure{max-width:78mm;padding:1.5mm;margin:0}.plot{max-width:82mm}.strip svg{height:8pt}"
    ".times{height:10pt}li{margin:1pt 0}td,th{padding:.5pt 0 .5pt 4pt}}</style>";

static void put_words(FILE *to, const char *name)
{
    for (; *name; name++)
        fputc(*name == '_' ? ' ' : *name, to);
}

// ------------------------------------------------------------- names and dates

static void write_name(FILE *to, const char *role, const char *name, int64_t began_ns)
{
    char date[DATE_TEXT_BYTES];
    fprintf(to, "%s <b>", role);
    html_put_text(to, name);
    if (*date_text(began_ns, date))
        fprintf(to, "</b>, %.10s, %.5s UTC. ", date, date + 11);
    else
        fputs("</b>, date not recorded. ", to);
}

static void write_names(FILE *to, const struct report_attempt *attempt, const char *reference_name)
{
    fputs("<p class=\"dim\">", to);
    write_name(to, "Attempt:", attempt->name, attempt->began_ns);
    write_name(to, "Reference:", reference_name, attempt->reference_began_ns);
    fputs("</p>", to);
}

// ------------------------------------------------------------- findings

static void write_finding_list(FILE *to, const struct comparison *comparison, int32_t first, int32_t end)
{
    fprintf(to, "<ol start=\"%d\">", (int)first + 1);
    for (int32_t k = first; k < end; k++) {
        const struct finding *f = &comparison->findings[k];
        fprintf(to, "<li>%s", f->sentence);
        if (f->loss >= 0.5)
            fprintf(to, " <span class=\"dim\">−%.0f</span>", f->loss);
        fputs("</li>", to);
    }
    fputs("</ol>", to);
}

static void write_findings(FILE *to, const struct comparison *comparison)
{
    const int32_t count = comparison->finding_count, shown = count < SHOWN_FINDINGS ? count : SHOWN_FINDINGS;
    char good[GOOD_TEXT_BYTES], not_judged[NOT_JUDGED_BYTES], sigma[SIGMA_TEXT_BYTES];
    if (comparison->relation != RELATION_SAME) {
        fprintf(to, "<h2>%s</h2><p>So there is no score.</p>", comparison->relation_sentence);
    } else {
        fprintf(to, "<div class=\"score\">%.0f</div><div class=\"dim\">of 100%s</div><h2>What differs</h2>",
                comparison->score, score_sigma_text(comparison, sigma));
        if (!count)
            fputs("<p>Nothing was found.</p>", to);
    }
    if (count)
        write_finding_list(to, comparison, 0, shown);
    if (count > shown) {
        fprintf(to, "<details class=\"screen\"><summary>%d more</summary>", (int)(count - shown));
        write_finding_list(to, comparison, shown, count);
        fputs("</details><div class=\"printed\">", to);
        write_finding_list(to, comparison, shown, count);
        fputs("</div>", to);
    }
    if (count)
        fputs("<p class=\"dim\">Behind each: the points of 100 that it costs.</p>", to);
    if (*good_text(comparison, good))
        fprintf(to, "<p><b>Good:</b> %s.</p>", good);
    if (*not_judged_text(comparison, not_judged))
        fprintf(to, "<p>%c%s.</p>", toupper((unsigned char)*not_judged), not_judged + 1);
}

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
        comparison_differences(comparison, &comparison->judged, f, parts);
        const int at = (int)((int64_t)f * CELLS / comparison->b.count);
        for (int p = 0; p < PART_COUNT; p++) {
            uint8_t *v = &cell[p * CELLS + at];
            *v = parts[p].verdict > *v ? (uint8_t)parts[p].verdict : *v;
        }
    }
    return OK;
}

// Seconds between two marks of the time, of which there are at most six.
static int time_step_s(double seconds)
{
    static const int steps[] = {1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200};
    size_t k = 0;
    while (k + 1 < COUNT_OF(steps) && seconds > 5 * steps[k])
        k++;
    return steps[k];
}

static void write_strip_row(FILE *to, const uint8_t *row, int cells)
{
    fprintf(to, "<svg viewBox=\"0 0 %d 1\" preserveAspectRatio=\"none\">", cells);
    for (int first = 0, end; first < cells; first = end) {
        const int at = (int)((int64_t)first * CELLS / cells);
        for (end = first + 1; end < cells && row[(int64_t)end * CELLS / cells] == row[at];)
            end++;
        fprintf(to, "<rect x=\"%d\" width=\"%.1f\" height=\"1\" fill=\"var(--%s)\"/>", first, end - first + 0.2,
                verdict_class((enum verdict)row[at]));
    }
    fputs("</svg>", to);
}

static void write_strip(FILE *to, const struct comparison *comparison, const uint8_t *cell)
{
    const double seconds = comparison->b.count / MOVEMENT_RATE_HZ;
    // Of short movements there are fewer frames than cells: a cell without a frame continues the one before.
    const int cells = comparison->b.count < CELLS ? comparison->b.count : CELLS;
    fputs("<div><h2>Over time</h2><div class=\"strip\">", to);
    for (int p = 0; p < PART_COUNT; p++) {
        fputs("<span>", to);
        put_words(to, part_name(comparison->mirrored ? mirrored_part((enum part)p) : (enum part)p));
        fputs("</span>", to);
        if (comparison->by.ignored >> p & 1)
            fputs("<span class=\"dim\">does not matter</span>", to);
        else
            write_strip_row(to, &cell[p * CELLS], cells);
    }
    fputs("<span></span><div class=\"times\">", to);
    const int step = time_step_s(seconds);
    for (int s = 0; s <= (int)(0.95 * seconds); s += step)
        fprintf(to, "<span style=\"left:%.1f%%\">%d s</span>", 100 * s / seconds, s);
    fprintf(to,
            "</div></div><p class=\"dim keys\"><span><i class=\"key\" style=\"background:var(--different)\"></i>"
            "more than %s different</span><span><i class=\"key\" style=\"background:var(--same)\"></i>the same</span>"
            "<span><i class=\"key\" style=\"background:var(--unknown)\"></i>cannot tell</span></p></div>",
            expectation_is_empty(&comparison->expected) ? "10°" : "what is expected here, or 10°,");
}

// ------------------------------------------------------------- time alignment

enum { PLOT_LEFT = 48, PLOT_RIGHT = 330, PLOT_TOP = 10, PLOT_BOTTOM = 200 };

// Frames of the attempt to the right, of the reference upwards.
struct plot {
    FILE *to;
    const struct comparison *c;
};

static double plot_x(const struct plot *plot, double frame)
{
    return PLOT_LEFT + (PLOT_RIGHT - PLOT_LEFT) * frame / plot->c->b.count;
}

static double plot_y(const struct plot *plot, double frame)
{
    return PLOT_BOTTOM - (PLOT_BOTTOM - PLOT_TOP) * frame / plot->c->a.count;
}

// A rectangle from frame to frame of both.
static void plot_area(const struct plot *plot, const int32_t b[2], const int32_t a[2], const char *style)
{
    if (b[1] > b[0] && a[1] > a[0])
        fprintf(plot->to, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" %s/>", plot_x(plot, b[0]),
                plot_y(plot, a[1]), plot_x(plot, b[1]) - plot_x(plot, b[0]), plot_y(plot, a[0]) - plot_y(plot, a[1]),
                style);
}

static void plot_axes(const struct plot *plot)
{
    const double seconds_b = plot->c->b.count / MOVEMENT_RATE_HZ, seconds_a = plot->c->a.count / MOVEMENT_RATE_HZ;
    const int step_b = time_step_s(seconds_b), step_a = time_step_s(seconds_a);
    for (int s = 0; s <= (int)seconds_b; s += step_b) {
        const double x = plot_x(plot, s * MOVEMENT_RATE_HZ);
        fprintf(plot->to,
                "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%d\" stroke=\"var(--line)\"/>"
                "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%d</text>",
                x, x, PLOT_TOP, PLOT_BOTTOM, x, PLOT_BOTTOM + 18, s);
    }
    for (int s = 0; s <= (int)seconds_a; s += step_a) {
        const double y = plot_y(plot, s * MOVEMENT_RATE_HZ);
        fprintf(plot->to,
                "<line x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"var(--line)\"/>"
                "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%d</text>",
                PLOT_LEFT, PLOT_RIGHT, y, y, PLOT_LEFT - 6, y + 5, s);
    }
    fprintf(plot->to,
            "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">time of the attempt, s</text>"
            "<text transform=\"translate(14 %d) rotate(-90)\" text-anchor=\"middle\">of the reference, s</text>",
            (PLOT_LEFT + PLOT_RIGHT) / 2, PLOT_BOTTOM + 38, (PLOT_TOP + PLOT_BOTTOM) / 2);
}

static const char *const piece_styles[] = {
    [PIECE_MISSING] = "fill=\"var(--different)\" opacity=\".35\"",
    [PIECE_EXTRA] = "fill=\"var(--b)\" opacity=\".35\"",
    [PIECE_PAUSE] = "fill=\"var(--pause)\" opacity=\".35\"",
    [PIECE_PAUSE_SKIPPED] = "fill=\"var(--pause)\" opacity=\".35\"",
};

// What only one of both has is a band across the plot, along the other's time.
static void plot_pieces(const struct plot *plot)
{
    const struct pace *pace = &plot->c->pace;
    const int32_t all_b[2] = {0, plot->c->b.count}, all_a[2] = {0, plot->c->a.count};
    static const char outside[] = "fill=\"var(--unknown)\"";
    plot_area(plot, (int32_t[2]){0, pace->b_first}, all_a, outside);
    plot_area(plot, (int32_t[2]){pace->b_end, all_b[1]}, all_a, outside);
    plot_area(plot, all_b, (int32_t[2]){0, pace->a_first}, outside);
    plot_area(plot, all_b, (int32_t[2]){pace->a_end, all_a[1]}, outside);
    for (int32_t k = 0; k < pace->piece_count; k++) {
        const struct piece *p = &pace->pieces[k];
        const bool of_a = p->kind == PIECE_MISSING || p->kind == PIECE_PAUSE_SKIPPED;
        const int32_t b[2] = {p->b_first, p->b_end}, a[2] = {p->a_first, p->a_end};
        plot_area(plot, of_a ? all_b : b, of_a ? a : all_a, piece_styles[p->kind]);
    }
}

static void plot_repetitions(const struct plot *plot)
{
    enum { NUMBERED = 12 };
    const struct performances *r = &plot->c->repetitions;
    for (int32_t k = 0; k < r->count; k++) {
        const struct performance *p = &r->at[k];
        const int32_t b[2] = {p->attempt.first, p->attempt.end}, a[2] = {p->reference.first, p->reference.end};
        plot_area(plot, b, a, "fill=\"var(--same)\" stroke=\"var(--dim)\" stroke-dasharray=\"3 3\"");
        if (r->count <= NUMBERED)
            fprintf(plot->to, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%d</text>",
                    plot_x(plot, 0.5 * (b[0] + b[1])), plot_y(plot, a[1]) + 15, (int)k + 1);
    }
}

// The timeline, broken where a frame shows nothing or another repetition begins.
static void plot_timeline(const struct plot *plot)
{
    enum { POINTS = 500, BACK = 6 }; // frames
    const struct timeline *t = &plot->c->timeline;
    const int32_t step = 1 + t->count / POINTS;
    double last = NAN;
    fputs("<path fill=\"none\" stroke=\"var(--a)\" stroke-width=\"2.5\" stroke-linejoin=\"round\" d=\"", plot->to);
    for (int32_t f = 0; f < t->count; f += step) {
        const double reference = t->reference[f];
        if (!isnan(reference))
            fprintf(plot->to, "%s%.1f %.1f", isnan(last) || reference < last - BACK ? "M" : "L", plot_x(plot, f),
                    plot_y(plot, reference));
        last = reference;
    }
    fputs("\"/>", plot->to);
}

static bool has_piece(const struct pace *pace, enum piece_kind kind)
{
    for (int32_t k = 0; k < pace->piece_count; k++)
        if (pace->pieces[k].kind == kind)
            return true;
    return false;
}

static void plot_key(FILE *to, const char *color, const char *words)
{
    fprintf(to, "<span><i class=\"key\" style=\"background:var(--%s);opacity:.6\"></i>%s</span>", color, words);
}

// Which instant of the reference each instant of the attempt shows.
static void write_alignment(FILE *to, const struct comparison *comparison)
{
    const struct plot plot = {to, comparison};
    const struct pace *pace = &comparison->pace;
    const bool ends = pace->b_first > 0 || pace->b_end < comparison->b.count || pace->a_first > 0 ||
                      pace->a_end < comparison->a.count;
    fputs(
        "<div><h2>Time alignment</h2><svg class=\"plot\" viewBox=\"0 0 340 244\" role=\"img\" aria-label=\"Which time "
        "of the reference each time of the attempt shows\">",
        to);
    plot_pieces(&plot);
    plot_axes(&plot);
    plot_repetitions(&plot);
    plot_timeline(&plot);
    fputs("</svg><p class=\"dim keys\">", to);
    if (has_piece(pace, PIECE_MISSING))
        plot_key(to, "different", "only in the reference");
    if (has_piece(pace, PIECE_EXTRA))
        plot_key(to, "b", "only in the attempt");
    if (has_piece(pace, PIECE_PAUSE) || has_piece(pace, PIECE_PAUSE_SKIPPED))
        plot_key(to, "pause", "one of them pauses");
    if (comparison->repetitions.count)
        plot_key(to, "same", "a repetition");
    if (ends)
        plot_key(to, "unknown", "before and after, not compared");
    fputs("</p></div>", to);
}

// ------------------------------------------------------------- tables

#define PLUS_MINUS "&nbsp;±&nbsp;" // its two numbers stay on one line

static int whole_degrees(double rad) { return (int)lround(rad * RAD); } // -0.3 is 0, not -0

static void begin_table(FILE *to, const char *title)
{
    fprintf(
        to,
        "<div><h2>%s, degrees</h2><table><tr><th>joint</th><th>reference</th><th>attempt</th><th>difference</th></tr>",
        title);
}

static void write_joint(FILE *to, int angle)
{
    fputs("<tr><td>", to);
    put_words(to, body_angle_name((enum body_angle)angle));
    fputs("</td>", to);
}

// What differs by more than its error and more than what counts as the same stands out.
static void write_difference(FILE *to, double rad, double sigma_rad)
{
    const bool sure = fabs(rad) > DIFFERENT_RAD && fabs(rad) > 2 * sigma_rad;
    const int degrees = whole_degrees(rad);
    const char *sign = degrees < 0 ? "−" : "";
    fprintf(to, "<td>%s%s%d%s%s%d</td></tr>", sure ? "<b>" : "", degrees > 0 ? "+" : sign, abs(degrees),
            sure ? "</b>" : "", PLUS_MINUS, whole_degrees(sigma_rad));
}

static void write_degrees(FILE *to, double rad)
{
    const int degrees = whole_degrees(rad);
    fprintf(to, "%s%d", degrees < 0 ? "−" : "", abs(degrees));
}

static void write_angles(FILE *to, const struct comparison *comparison, const struct report_moment *moment)
{
    const struct movement_frame in_a = movement_at(&comparison->a, moment->reference_s * MOVEMENT_RATE_HZ),
                                in_b = movement_at(&comparison->judged, moment->attempt_s * MOVEMENT_RATE_HZ);
    const struct body_angles a = body_angles_of(&in_a), b = body_angles_of(&in_b);
    begin_table(to, "Joint angles at the worst moment");
    for (int k = 0; k < BODY_ANGLES; k++) {
        if (isnan(a.rad[k]) || isnan(b.rad[k]))
            continue;
        write_joint(to, k);
        fputs("<td>", to);
        write_degrees(to, a.rad[k]);
        fprintf(to, "%s%d</td><td>", PLUS_MINUS, whole_degrees(a.sigma[k]));
        write_degrees(to, b.rad[k]);
        fprintf(to, "%s%d</td>", PLUS_MINUS, whole_degrees(b.sigma[k]));
        write_difference(to, (double)b.rad[k] - a.rad[k],
                         sqrt((double)a.sigma[k] * a.sigma[k] + (double)b.sigma[k] * b.sigma[k]));
    }
    fputs("</table></div>", to);
}

// Of each angle the mean standard deviation, rad, over the frames that know it.
static void mean_sigmas(const struct movement *movement, double out[BODY_ANGLES])
{
    int32_t count[BODY_ANGLES] = {0};
    memset(out, 0, BODY_ANGLES * sizeof *out);
    for (int32_t f = 0; f < movement->count; f++) {
        const struct body_angles angles = body_angles_of(&movement->frames[f]);
        for (int k = 0; k < BODY_ANGLES; k++)
            if (!isnan(angles.sigma[k])) {
                out[k] += angles.sigma[k];
                count[k]++;
            }
    }
    for (int k = 0; k < BODY_ANGLES; k++)
        out[k] /= count[k] ? count[k] : 1;
}

static void write_range(FILE *to, struct angle_range range, double sigma_rad)
{
    fputs("<td><span class=\"range\">", to);
    write_degrees(to, range.low);
    fputs(" to ", to);
    write_degrees(to, range.high);
    fprintf(to, "</span> ±&nbsp;%d</td>", whole_degrees(sigma_rad));
}

// The difference is that of how far the two go; each of its four ends has the error of an angle at an instant.
static void write_ranges(FILE *to, const struct comparison *comparison)
{
    double a_rad[BODY_ANGLES], b_rad[BODY_ANGLES];
    mean_sigmas(&comparison->a, a_rad);
    mean_sigmas(&comparison->judged, b_rad);
    begin_table(to, "Ranges of motion");
    for (int k = 0; k < BODY_ANGLES; k++) {
        const struct angle_range a = comparison->range_a[k], b = comparison->range_b[k];
        if (isnan(a.low) || isnan(b.low))
            continue;
        write_joint(to, k);
        write_range(to, a, a_rad[k]);
        write_range(to, b, b_rad[k]);
        write_difference(to, ((double)b.high - b.low) - ((double)a.high - a.low),
                         sqrt(2 * (a_rad[k] * a_rad[k] + b_rad[k] * b_rad[k])));
    }
    fputs("</table></div>", to);
}

static void write_repetitions(FILE *to, const struct comparison *comparison)
{
    if (!comparison->repetitions.count)
        return;
    fputs("<h2>Repetitions</h2><p class=\"dim keys\">", to);
    for (int32_t k = 0; k < comparison->repetitions.count; k++) {
        const struct performance *r = &comparison->repetitions.at[k];
        fprintf(to, "<span>%d, %.1f s to %.1f s: <b>%.0f</b></span> ", (int)k + 1, r->attempt.first / MOVEMENT_RATE_HZ,
                r->attempt.end / MOVEMENT_RATE_HZ, r->score);
    }
    fputs("</p>", to);
}

// ------------------------------------------------------------- progress

// Scores of several attempts, in their order.
static void write_progress(FILE *to, const struct report_attempt *attempts, int32_t count)
{
    enum { LEFT = 34, WIDTH = 290, HEIGHT = 110, NUMBERS = 10 };
    const double step = count > 1 ? (double)WIDTH / (count - 1) : 0;
    fprintf(to,
            "<h2>Progress</h2><svg class=\"plot\" viewBox=\"0 0 340 %d\" role=\"img\" aria-label=\"Score over "
            "attempts\">",
            HEIGHT + 34);
    for (int score = 0; score <= 100; score += 50)
        fprintf(to,
                "<line x1=\"%d\" x2=\"%d\" y1=\"%d\" y2=\"%d\" stroke=\"var(--line)\"/>"
                "<text x=\"0\" y=\"%d\">%d</text>",
                LEFT, LEFT + WIDTH, HEIGHT + 10 - score * HEIGHT / 100, HEIGHT + 10 - score * HEIGHT / 100,
                HEIGHT + 15 - score * HEIGHT / 100, score);
    fputs("<polyline fill=\"none\" stroke=\"var(--a)\" stroke-width=\"2\" points=\"", to);
    for (int32_t k = 0; k < count; k++)
        fprintf(to, "%.1f,%.1f ", LEFT + k * step, HEIGHT + 10 - attempts[k].c->score * HEIGHT / 100);
    fputs("\"/>", to);
    for (int32_t k = 0; k < count; k++) {
        const double x = LEFT + k * step, y = HEIGHT + 10 - attempts[k].c->score * HEIGHT / 100;
        fprintf(to, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"var(--a)\"><title>", x, y);
        html_put_text(to, attempts[k].name);
        fprintf(to, ": %.0f</title></circle>", attempts[k].c->score);
        if (k % (1 + (count - 1) / NUMBERS) == 0)
            fprintf(to, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%d</text>", x, HEIGHT + 30, (int)k + 1);
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

static void write_expected(FILE *to, const struct comparison *comparison)
{
    char text[EXPECTATION_TEXT_BYTES];
    if (*expectation_text(&comparison->expected, text))
        fprintf(to, "<p>Expected here: %s.</p>", text);
}

static bool write_attempt(FILE *to, const struct report_attempt *attempt, const char *reference_name)
{
    const struct comparison *c = attempt->c;
    uint8_t *cell = NULL;
    const bool whole = verdicts_of(c, &cell) == OK;
    const int more = attempt->moment_count - 1;
    write_names(to, attempt, reference_name);
    write_expected(to, c);
    fputs("<div class=\"two\"><div>", to);
    write_findings(to, c);
    write_repetitions(to, c);
    fputs("</div>", to);
    if (attempt->moment_count) {
        fputs("<div><h2>The worst moment</h2>", to);
        write_moment(to, c, &attempt->moments[0]);
        if (more > 0)
            fprintf(to, "<details class=\"screen\"><summary>%d more moment%s</summary>", more, more > 1 ? "s" : "");
        for (int k = 1; k <= more; k++)
            write_moment(to, c, &attempt->moments[k]);
        fputs(more > 0 ? "</details></div>" : "</div>", to);
    }
    fputs("</div><div class=\"two\">", to);
    if (whole)
        write_strip(to, c, cell);
    write_alignment(to, c);
    fputs("</div><div class=\"two\">", to);
    if (attempt->moment_count)
        write_angles(to, c, &attempt->moments[0]);
    write_ranges(to, c);
    fprintf(to, "</div><p class=\"dim\">±: one standard deviation, by the joints' own errors.%s</p>",
            c->mirrored ? " Left and right of the joints are the reference's: the attempt is its mirror image." : "");
    free(cell);
    return whole;
}

static void write_title(FILE *to, const struct report_attempt *attempts, int32_t count, const char *reference_name)
{
    if (count == 1)
        html_put_text(to, attempts[0].name);
    else
        fprintf(to, "%d attempts", (int)count);
    fputs(" compared with ", to);
    html_put_text(to, reference_name);
}

char *report_html(const struct report_attempt *attempts, int32_t count, const char *reference_name)
{
    char *bytes = NULL;
    size_t size = 0;
    FILE *to = open_memstream(&bytes, &size);
    if (!to)
        return NULL;
    fputs(head, to);
    fputs("<title>", to);
    write_title(to, attempts, count, reference_name);
    fputs("</title><h1>", to);
    write_title(to, attempts, count, reference_name);
    fputs("</h1>", to);
    bool broken = false;
    if (count > 1)
        write_progress(to, attempts, count);
    for (int32_t k = 0; k < count; k++) {
        // Of several the last is open.
        if (count > 1) {
            fprintf(to, "<details%s><summary>", k + 1 < count ? " class=\"screen\"" : " open");
            html_put_text(to, attempts[k].name);
            if (attempts[k].c->relation == RELATION_SAME)
                fprintf(to, ": %.0f</summary>", attempts[k].c->score);
            else
                fputs(": no score</summary>", to);
        }
        broken = !write_attempt(to, &attempts[k], reference_name) || broken;
        fputs(count > 1 ? "</details>" : "", to);
    }
    fputs("</html>\n", to);
    broken = ferror(to) || broken;
    if (!fclose(to) && !broken)
        return bytes;
    free(bytes);
    return NULL;
}
