#include "compare/angle_report.h"

#include "base/text.h"
#include "base/text_stream.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double DEGREES = 180 / 3.14159265358979323846;

const char *body_angle_definition(enum body_angle angle)
{
    static const char *const definitions[BODY_ANGLES] = {
        [ANGLE_LEFT_ELBOW] = "between upper arm and forearm; 0 straight, bent more",
        [ANGLE_RIGHT_ELBOW] = "between upper arm and forearm; 0 straight, bent more",
        [ANGLE_LEFT_KNEE] = "between thigh and shin; 0 straight, bent more",
        [ANGLE_RIGHT_KNEE] = "between thigh and shin; 0 straight, bent more",
        [ANGLE_LEFT_HIP] = "between thigh and trunk, any direction; 0 in line",
        [ANGLE_RIGHT_HIP] = "between thigh and trunk, any direction; 0 in line",
        [ANGLE_LEFT_SHOULDER] = "between upper arm and trunk, any direction; 0 hanging along it",
        [ANGLE_RIGHT_SHOULDER] = "between upper arm and trunk, any direction; 0 hanging along it",
        [ANGLE_LEAN] = "trunk against the vertical; forwards positive",
        [ANGLE_SIDE_LEAN] = "trunk against the vertical; to the own left positive",
        [ANGLE_TWIST] = "shoulders against hips about the vertical; to the own left positive",
        [ANGLE_HEAD] = "neck to head against the trunk, any direction; 0 in line",
    };
    return definitions[angle];
}

enum status angle_summary_of(const struct movement *movement, struct angle_summary *out)
{
    bool *left_out = calloc((size_t)(movement->count ? movement->count : 1), sizeof *left_out);
    *out = (struct angle_summary){0};
    if (!left_out)
        return fail(ERR_MEMORY, "no memory for the ranges of angles");
    const enum status status = body_angle_ranges(movement, 0, movement->count, left_out, out->range);
    free(left_out);
    for (int32_t f = 0; f < movement->count; f++) {
        const struct body_angles at = body_angles_of(&movement->frames[f]);
        for (int a = 0; a < BODY_ANGLES; a++)
            out->known[a] += isnan(at.rad[a]) ? 0 : 1.0 / movement->count;
    }
    return status;
}

// ---------------------------------------------------------------- text

// "left elbow"
static void write_name(FILE *to, enum body_angle angle)
{
    for (const char *name = body_angle_name(angle); *name; name++)
        fputc(*name == '_' ? ' ' : *name, to);
}

static double seconds_of(const struct movement *movement)
{
    return movement->count > 1 ? (movement->count - 1) / MOVEMENT_RATE_HZ : 0;
}

static bool is_in_range(struct angle_range range) { return !isnan(range.low); }

// As shown to people: whole degrees, so that the range is what the reader subtracts.
struct shown_range {
    long low, high, range;
};

static struct shown_range shown_range_of(struct angle_range range)
{
    const long low = lround((double)range.low * DEGREES), high = lround((double)range.high * DEGREES);
    return (struct shown_range){low, high, high - low};
}

char *angle_report_text(const struct angle_report *report)
{
    struct text_stream text;
    if (!text_begin(&text))
        return NULL;
    fprintf(text.to, "%s, %.1f s; degrees, without the lowest and highest 3 %% of the frames\n\n", report->name,
            seconds_of(report->movement));
    fprintf(text.to, "%-16s %7s %7s %7s %7s\n", "angle", "lowest", "highest", "range", "known");
    for (int a = 0; a < BODY_ANGLES; a++) {
        const struct angle_range range = report->summary->range[a];
        const int written = (int)strlen(body_angle_name((enum body_angle)a));
        write_name(text.to, (enum body_angle)a);
        fprintf(text.to, "%*s", 16 - written, "");
        const struct shown_range shown = is_in_range(range) ? shown_range_of(range) : (struct shown_range){0, 0, 0};
        if (is_in_range(range))
            fprintf(text.to, " %7ld %7ld %7ld", shown.low, shown.high, shown.range);
        else
            fprintf(text.to, " %7s %7s %7s", "-", "-", "-");
        fprintf(text.to, " %5.0f %%  %s\n", 100 * report->summary->known[a], body_angle_definition((enum body_angle)a));
    }
    return text_end(&text);
}

char *angle_report_json(const struct angle_report *report)
{
    struct text_stream text;
    if (!text_begin(&text))
        return NULL;
    fprintf(text.to, "{\"seconds\": %.3f, \"angles\": {", seconds_of(report->movement));
    for (int a = 0; a < BODY_ANGLES; a++) {
        const struct angle_range range = report->summary->range[a];
        fprintf(text.to, "%s\n  \"%s\": {", a ? "," : "", body_angle_name((enum body_angle)a));
        if (is_in_range(range))
            fprintf(text.to, "\"low_deg\": %.1f, \"high_deg\": %.1f", (double)range.low * DEGREES,
                    (double)range.high * DEGREES);
        else
            fputs("\"low_deg\": null, \"high_deg\": null", text.to);
        fprintf(text.to, ", \"known\": %.3f, \"definition\": \"%s\"}", report->summary->known[a],
                body_angle_definition((enum body_angle)a));
    }
    fputs("}}\n", text.to);
    return text_end(&text);
}

char *angle_report_csv(const struct angle_report *report)
{
    struct text_stream text;
    if (!text_begin(&text))
        return NULL;
    fputs("time_s", text.to);
    for (int a = 0; a < BODY_ANGLES; a++) {
        const char *name = body_angle_name((enum body_angle)a);
        fprintf(text.to, ",%s_deg,%s_sigma_deg", name, name);
    }
    fputc('\n', text.to);
    for (int32_t f = 0; f < report->movement->count; f++) {
        const struct body_angles at = body_angles_of(&report->movement->frames[f]);
        fprintf(text.to, "%.3f", f / MOVEMENT_RATE_HZ);
        for (int a = 0; a < BODY_ANGLES; a++)
            if (isnan(at.rad[a]))
                fputs(",,", text.to);
            else
                fprintf(text.to, ",%.2f,%.2f", (double)at.rad[a] * DEGREES, (double)at.sigma[a] * DEGREES);
        fputc('\n', text.to);
    }
    return text_end(&text);
}

char *angle_report_mot(const struct angle_report *report)
{
    struct text_stream text;
    if (!text_begin(&text))
        return NULL;
    fprintf(text.to, "%s\nversion=1\nnRows=%d\nnColumns=%d\ninDegrees=yes\nendheader\ntime", report->name,
            report->movement->count, 1 + BODY_ANGLES);
    for (int a = 0; a < BODY_ANGLES; a++)
        fprintf(text.to, "\t%s", body_angle_name((enum body_angle)a));
    fputc('\n', text.to);
    for (int32_t f = 0; f < report->movement->count; f++) {
        const struct body_angles at = body_angles_of(&report->movement->frames[f]);
        fprintf(text.to, "%.6f", f / MOVEMENT_RATE_HZ);
        for (int a = 0; a < BODY_ANGLES; a++)
            if (isnan(at.rad[a]))
                fputs("\tNaN", text.to);
            else
                fprintf(text.to, "\t%.4f", (double)at.rad[a] * DEGREES);
        fputc('\n', text.to);
    }
    return text_end(&text);
}

// ---------------------------------------------------------------- page

static const char page_head[] =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">"
    "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><style>"
    ":root{--back:#fff;--ink:#1c2024;--dim:#5d6670;--line:#d5dade;--curve:#0b66c3;color-scheme:light dark}"
    "@media screen and (prefers-color-scheme:dark){:root{--back:#14171a;--ink:#e6e8ea;--dim:#98a1ab;--line:#30363d;"
    "--curve:#6db3f2}}"
    "body{background:var(--back);color:var(--ink);font:15px/1.4 system-ui,sans-serif;max-width:60em;margin:0 auto;"
    "padding:1em}h1{font-size:1.3em}table{border-collapse:collapse;width:100%}td,th{text-align:right;padding:.2em .5em;"
    "border-bottom:1px solid var(--line);vertical-align:middle}td:first-child,th:first-child,td:last-child,"
    "th:last-child{text-align:left}.dim{color:var(--dim);font-size:.85em}svg{display:block;width:15em;height:2.6em}"
    "polyline{fill:none;stroke:var(--curve);stroke-width:1.5;vector-effect:non-scaling-stroke}"
    "@page{size:A4;margin:10mm}@media print{body{font-size:9pt;padding:0}}</style>";

enum { PLOT_WIDTH = 600, PLOT_HEIGHT = 100 };
static const double SPAN_MIN_RAD = 0.52; // 30 degrees

static double at_rad(const struct movement *movement, int32_t frame, enum body_angle angle)
{
    return (double)body_angle_of(&movement->frames[frame], angle);
}

// One line for each stretch that is known, over the range and a little beyond, SPAN_MIN_RAD at least: what hardly moves
// is to look like it.
static void write_curve(FILE *to, const struct movement *movement, enum body_angle angle, struct angle_range range)
{
    const double middle = 0.5 * (double)(range.low + range.high),
                 span = fmax(SPAN_MIN_RAD, 1.2 * (double)(range.high - range.low)), low = middle - 0.5 * span,
                 high = middle + 0.5 * span;
    const int32_t step = 1 + movement->count / (2 * PLOT_WIDTH);
    bool open = false;
    fprintf(to, "<svg viewBox=\"0 0 %d %d\" preserveAspectRatio=\"none\" role=\"img\" aria-label=\"over time\">",
            PLOT_WIDTH, PLOT_HEIGHT);
    for (int32_t f = 0; f < movement->count; f += step) {
        const double rad = at_rad(movement, f, angle);
        if (isnan(rad) && open)
            fputs("\"/>", to);
        else if (!isnan(rad))
            fprintf(to, "%s%.1f,%.1f ", open ? "" : "<polyline points=\"",
                    (double)f / (movement->count > 1 ? movement->count - 1 : 1) * PLOT_WIDTH,
                    (1 - fmax(0, fmin(1, (rad - low) / (high - low)))) * PLOT_HEIGHT);
        open = !isnan(rad);
    }
    fputs(open ? "\"/></svg>" : "</svg>", to);
}

char *angle_report_html(const struct angle_report *report)
{
    struct text_stream text;
    if (!text_begin(&text))
        return NULL;
    FILE *to = text.to;
    fprintf(to, "%s<title>", page_head);
    html_put_text(to, report->name);
    fputs("</title><h1>", to);
    html_put_text(to, report->name);
    fprintf(to,
            "</h1><p class=\"dim\">Angles over %.1f s, in degrees; lowest and highest without 3 %% of the frames each; "
            "the height of a curve is its range, 30 degrees at "
            "least.</p><table><tr><th>angle<th>lowest<th>highest<th>range<th>known<th>over time</tr>",
            seconds_of(report->movement));
    for (int a = 0; a < BODY_ANGLES; a++) {
        const struct angle_range range = report->summary->range[a];
        fputs("<tr><td>", to);
        write_name(to, (enum body_angle)a);
        fprintf(to, "<br><span class=\"dim\">%s</span>", body_angle_definition((enum body_angle)a));
        const struct shown_range shown = is_in_range(range) ? shown_range_of(range) : (struct shown_range){0, 0, 0};
        if (is_in_range(range))
            fprintf(to, "<td>%ld<td>%ld<td><b>%ld</b>", shown.low, shown.high, shown.range);
        else
            fputs("<td>-<td>-<td>-", to);
        fprintf(to, "<td>%.0f&nbsp;%%<td>", 100 * report->summary->known[a]);
        if (is_in_range(range))
            write_curve(to, report->movement, (enum body_angle)a, range);
        fputs("</tr>", to);
    }
    fputs("</table>\n", to);
    return text_end(&text);
}
