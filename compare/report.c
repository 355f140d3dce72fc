// A comparison as JSON, CSV and plain text.
#include "compare/report.h"

#include "base/text.h"
#include "base/text_stream.h"
#include "compare/findings.h"
#include "compare/good_parts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double RAD = 180 / 3.14159265358979323846;

static void write_number(FILE *to, double value, int digits)
{
    if (isfinite(value))
        fprintf(to, "%.*f", digits, value);
    else
        fputs("null", to);
}

static double frame_seconds(double frame) { return frame / MOVEMENT_RATE_HZ; }

// ------------------------------------------------------------- JSON

static void json_frame(FILE *to, const struct comparison *comparison, int32_t f)
{
    struct part_difference parts[PART_COUNT];
    comparison_differences(comparison, &comparison->b, f, parts);
    fprintf(to, "    {\"time_s\": %.3f, \"reference_s\": ", frame_seconds(f));
    write_number(to, frame_seconds(comparison->timeline.reference[f]), 3);
    fputs(", \"parts\": {", to);
    for (int p = 0; p < PART_COUNT && !isnan(comparison->timeline.reference[f]); p++) {
        fprintf(to, "%s\"%s\": {\"angle_deg\": ", p ? ", " : "", part_name((enum part)p));
        write_number(to, parts[p].angle_rad * RAD, 1);
        fputs(", \"sigma_deg\": ", to);
        write_number(to, parts[p].sigma_rad * RAD, 1);
        fprintf(to, ", \"verdict\": \"%s\"}", verdict_name(parts[p].verdict));
    }
    fputs("}}", to);
}

static void json_findings(FILE *to, const struct comparison *comparison)
{
    fputs("  \"findings\": [", to);
    for (int32_t k = 0; k < comparison->finding_count; k++) {
        const struct finding *f = &comparison->findings[k];
        fprintf(to,
                "%s\n    {\"part\": \"%s\", \"kind\": \"%s\", \"from_s\": %.2f, \"to_s\": %.2f, \"amount\": %.2f, "
                "\"unit\": \"%s\", \"loss\": %.1f, \"sentence\": \"%s\"}",
                k ? "," : "", f->part, finding_kind_name(f->kind), f->from_s, f->to_s, f->amount, f->unit, f->loss,
                f->sentence);
    }
    fputs("],\n", to);
}

static void json_repetitions(FILE *to, const struct comparison *comparison)
{
    fputs("  \"repetitions\": [", to);
    for (int32_t k = 0; k < comparison->repetitions.count; k++) {
        const struct performance *r = &comparison->repetitions.at[k];
        fprintf(to,
                "%s\n    {\"from_s\": %.2f, \"to_s\": %.2f, \"reference_from_s\": %.2f, \"reference_to_s\": %.2f, "
                "\"score\": %.1f}",
                k ? "," : "", frame_seconds(r->attempt.first), frame_seconds(r->attempt.end),
                frame_seconds(r->reference.first), frame_seconds(r->reference.end), r->score);
    }
    fputs("],\n", to);
}

static void json_ranges(FILE *to, const struct comparison *comparison)
{
    fputs("  \"ranges\": {", to);
    for (int k = 0; k < BODY_ANGLES; k++) {
        const double values[4] = {comparison->range_a[k].low, comparison->range_a[k].high, comparison->range_b[k].low,
                                  comparison->range_b[k].high};
        fprintf(to, "%s\n    \"%s\": {\"reference_deg\": [", k ? "," : "", body_angle_name((enum body_angle)k));
        write_number(to, values[0] * RAD, 1);
        fputs(", ", to);
        write_number(to, values[1] * RAD, 1);
        fputs("], \"attempt_deg\": [", to);
        write_number(to, values[2] * RAD, 1);
        fputs(", ", to);
        write_number(to, values[3] * RAD, 1);
        fputs("]}", to);
    }
    fputs("}\n", to);
}

static void json_not_judged(FILE *to, const struct comparison *comparison)
{
    char sentence[NOT_JUDGED_BYTES];
    fputs("  \"not_judged\": {\"parts\": [", to);
    for (int p = 0, count = 0; p < PART_COUNT; p++)
        if (!((comparison->parts | comparison->by.ignored) >> p & 1))
            fprintf(to, "%s\"%s\"", count++ ? ", " : "", part_name((enum part)p));
    fprintf(to, "], \"sentence\": \"%s\"},\n", not_judged_text(comparison, sentence));
}

// Absent where nothing is expected. Tolerances of the parts that have one, given or measured.
static void json_expected(FILE *to, const struct comparison *comparison)
{
    const struct expectation *e = &comparison->expected;
    char sentence[EXPECTATION_TEXT_BYTES];
    if (expectation_is_empty(e))
        return;
    fprintf(to, "  \"expected\": {\"sentence\": \"%s\", \"ignored\": [", expectation_text(e, sentence));
    for (int p = 0, count = 0; p < PART_COUNT; p++)
        if (e->ignored >> p & 1)
            fprintf(to, "%s\"%s\"", count++ ? ", " : "", part_name((enum part)p));
    fputs("], \"tolerance_deg\": {", to);
    for (int p = 0, count = 0; p < PART_COUNT; p++)
        if ((e->tolerance_rad[p] > 0 || e->spread[p][DEVIATION_OFFSET] > 0) && !(e->ignored >> p & 1))
            fprintf(to, "%s\"%s\": %.1f", count++ ? ", " : "", part_name((enum part)p),
                    comparison->by.threshold[p] * DIFFERENT_RAD * RAD);
    fputs("}, \"from_s\": ", to);
    write_number(to, e->to_s > 0 ? e->from_s : NAN, 3);
    fputs(", \"to_s\": ", to);
    write_number(to, e->to_s > 0 ? e->to_s : NAN, 3);
    fprintf(to, ", \"further_references\": %d},\n", e->spread_references);
}

static void json_good(FILE *to, const struct comparison *comparison)
{
    const uint16_t good = good_parts(comparison);
    fputs("  \"good\": [", to);
    for (int p = 0, count = 0; p < PART_COUNT; p++)
        if (good >> p & 1)
            fprintf(to, "%s\"%s\"", count++ ? ", " : "", part_name((enum part)p));
    fputs("],\n", to);
}

static void json_date(FILE *to, const char *key, int64_t began_ns)
{
    char date[DATE_TEXT_BYTES];
    if (*date_text(began_ns, date))
        fprintf(to, "  \"%s\": \"%s\",\n", key, date);
    else
        fprintf(to, "  \"%s\": null,\n", key);
}

char *report_json(const struct report_attempt *attempt)
{
    const struct comparison *comparison = attempt->c;
    struct text_stream t;
    FILE *to = text_begin(&t);
    if (!to)
        return NULL;
    fputs("{\n  \"score\": ", to);
    if (comparison->relation == RELATION_SAME)
        fprintf(to, "%.4f", comparison->score);
    else
        fputs("null", to);
    fputs(",\n  \"score_sigma\": ", to);
    write_number(to, comparison->relation == RELATION_SAME ? comparison->score_sigma : NAN, 1);
    fprintf(to, ",\n  \"relation\": \"%s\",\n  \"relation_sentence\": \"%s\",\n  \"mirrored\": %s,\n",
            relation_name(comparison->relation), comparison->relation_sentence,
            comparison->mirrored ? "true" : "false");
    json_expected(to, comparison);
    fprintf(to, "  \"judged_share\": [%.3f, %.3f],\n  \"level\": %.2f,\n  \"frames\": [\n", comparison->judged_share[0],
            comparison->judged_share[1], VERDICT_LEVEL);
    for (int32_t f = 0; f < comparison->b.count; f++) {
        json_frame(to, comparison, f);
        fputs(f + 1 < comparison->b.count ? ",\n" : "],\n", to);
    }
    json_findings(to, comparison);
    json_repetitions(to, comparison);
    json_good(to, comparison);
    json_not_judged(to, comparison);
    json_date(to, "date", attempt->began_ns);
    json_date(to, "reference_date", attempt->reference_began_ns);
    json_expected(to, comparison);
    json_ranges(to, comparison);
    fputs("}\n", to);
    return text_end(&t);
}

static void json_text(FILE *to, const char *text)
{
    fputc('"', to);
    while (*text) {
        const size_t bytes = text_character_bytes(text); // 0: not UTF-8, as a file's name need not be
        if (*text == '"' || *text == '\\')
            fputc('\\', to);
        if (!bytes)
            fputc('?', to);
        else if ((unsigned char)*text < 32)
            fprintf(to, "\\u%04x", (unsigned char)*text);
        else
            fwrite(text, 1, bytes, to);
        text += bytes ? bytes : 1;
    }
    fputc('"', to);
}

char *report_json_attempts(const struct report_attempt *attempts, int32_t count)
{
    struct text_stream t;
    FILE *to = text_begin(&t);
    bool whole = to;
    if (!to)
        return NULL;
    fputs("{\"attempts\": [", to);
    for (int32_t k = 0; k < count; k++) {
        char *report = report_json(&attempts[k]);
        fprintf(to, "%s\n{\"name\": ", k ? "," : "");
        json_text(to, attempts[k].name);
        fprintf(to, ", \"report\": %s}", report ? report : "null");
        whole = whole && report;
        free(report);
    }
    fputs("]}\n", to);
    char *bytes = text_end(&t);
    if (whole)
        return bytes;
    free(bytes);
    return NULL;
}

// ------------------------------------------------------------- CSV

static void csv_number(FILE *to, double value, int digits)
{
    fputc(',', to);
    if (isfinite(value))
        fprintf(to, "%.*f", digits, value);
}

char *report_csv(const struct comparison *comparison)
{
    struct text_stream t;
    FILE *to = text_begin(&t);
    if (!to)
        return NULL;
    fputs("time_s,reference_s", to);
    for (int k = 0; k < BODY_ANGLES; k++) {
        const char *name = body_angle_name((enum body_angle)k);
        fprintf(to, ",%s_deg,%s_reference_deg,%s_sigma_deg", name, name, name);
    }
    fputc('\n', to);
    for (int32_t f = 0; f < comparison->b.count; f++) {
        const double reference = comparison->timeline.reference[f];
        const struct body_angles b = body_angles_of(&comparison->b.frames[f]);
        struct body_angles a;
        for (int k = 0; k < BODY_ANGLES; k++)
            a.rad[k] = a.sigma[k] = NAN;
        if (!isnan(reference)) {
            const struct movement_frame x = movement_at(&comparison->a, reference);
            a = body_angles_of(&x);
        }
        fprintf(to, "%.3f", frame_seconds(f));
        csv_number(to, frame_seconds(reference), 3);
        for (int k = 0; k < BODY_ANGLES; k++) {
            csv_number(to, b.rad[k] * RAD, 1);
            csv_number(to, a.rad[k] * RAD, 1);
            csv_number(to, sqrt((double)a.sigma[k] * a.sigma[k] + (double)b.sigma[k] * b.sigma[k]) * RAD, 1);
        }
        fputc('\n', to);
    }
    return text_end(&t);
}

// ------------------------------------------------------------- plain text

const char *score_sigma_text(const struct comparison *comparison, char out[SIGMA_TEXT_BYTES])
{
    *out = 0;
    if (isfinite(comparison->score_sigma))
        snprintf(out, SIGMA_TEXT_BYTES, " (\u00b1 %.0f)", comparison->score_sigma);
    return out;
}

char *report_text(const struct comparison *comparison, bool all)
{
    struct text_stream t;
    char good[GOOD_TEXT_BYTES], sigma[SIGMA_TEXT_BYTES];
    FILE *to = text_begin(&t);
    if (!to)
        return NULL;
    if (comparison->relation == RELATION_SAME)
        fprintf(to, "score %.0f of 100%s\n", comparison->score, score_sigma_text(comparison, sigma));
    else
        fprintf(to, "no score: %s\n", comparison->relation_sentence);
    char expected[EXPECTATION_TEXT_BYTES];
    if (*expectation_text(&comparison->expected, expected))
        fprintf(to, "expected: %s\n", expected);
    double rest = 100 - comparison->score;
    for (int32_t k = 0; k < comparison->finding_count; k++) {
        const struct finding *f = &comparison->findings[k];
        rest -= f->loss;
        if (all || k < SHOWN_FINDINGS)
            fprintf(to, "%-9s %s (%.0f points)\n", finding_kind_name(f->kind), f->sentence, f->loss);
    }
    if (!all && comparison->finding_count > SHOWN_FINDINGS)
        fprintf(to, "and %d more (--all)\n", (int)comparison->finding_count - SHOWN_FINDINGS);
    if (comparison->relation == RELATION_SAME && !comparison->finding_count)
        fputs("no difference found\n", to);
    if (comparison->relation == RELATION_SAME && rest >= 0.5)
        fprintf(to, "small differences, none of them worth a sentence (%.0f points)\n", rest);
    if (*good_text(comparison, good))
        fprintf(to, "Good: %s\n", good);
    char not_judged[NOT_JUDGED_BYTES];
    if (*not_judged_text(comparison, not_judged))
        fprintf(to, "%s\n", not_judged);
    for (int32_t k = 0; k < comparison->repetitions.count; k++) {
        const struct performance *r = &comparison->repetitions.at[k];
        fprintf(to, "repetition %d, from %.1f s to %.1f s: %.0f\n", (int)k + 1, frame_seconds(r->attempt.first),
                frame_seconds(r->attempt.end), r->score);
    }
    return text_end(&t);
}
