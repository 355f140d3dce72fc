// A comparison as JSON, CSV and plain text.
#include "compare/report.h"

#include "compare/findings.h"
#include "compare/not_judged.h"

#include "base/text.h"

#include <stdio.h>
#include <stdlib.h>

static const double RAD = 180 / 3.14159265358979323846;

struct text {
    FILE *to;
    char *bytes;
    size_t size;
};

static FILE *begin(struct text *t)
{
    *t = (struct text){0};
    return t->to = open_memstream(&t->bytes, &t->size);
}

static char *end(struct text *t)
{
    if (!t->to)
        return NULL;
    const bool broken = ferror(t->to);
    if (!fclose(t->to) && !broken)
        return t->bytes;
    free(t->bytes);
    return NULL;
}

static void number(FILE *to, double value, int digits)
{
    if (isfinite(value))
        fprintf(to, "%.*f", digits, value);
    else
        fputs("null", to);
}

static double seconds(double frame) { return frame / MOVEMENT_RATE_HZ; }

// ------------------------------------------------------------- JSON

static void json_frame(FILE *to, const struct comparison *c, int32_t f)
{
    struct part_difference parts[PART_COUNT];
    part_differences(&c->a, &c->b, &c->timeline, f, parts);
    fprintf(to, "    {\"time_s\": %.3f, \"reference_s\": ", seconds(f));
    number(to, seconds(c->timeline.reference[f]), 3);
    fputs(", \"parts\": {", to);
    for (int p = 0; p < PART_COUNT && !isnan(c->timeline.reference[f]); p++) {
        fprintf(to, "%s\"%s\": {\"angle_deg\": ", p ? ", " : "", part_name((enum part)p));
        number(to, parts[p].angle_rad * RAD, 1);
        fputs(", \"sigma_deg\": ", to);
        number(to, parts[p].sigma_rad * RAD, 1);
        fprintf(to, ", \"verdict\": \"%s\"}", verdict_name(parts[p].verdict));
    }
    fputs("}}", to);
}

static void json_findings(FILE *to, const struct comparison *c)
{
    fputs("  \"findings\": [", to);
    for (int32_t k = 0; k < c->finding_count; k++) {
        const struct finding *f = &c->findings[k];
        fprintf(to,
                "%s\n    {\"part\": \"%s\", \"kind\": \"%s\", \"from_s\": %.2f, \"to_s\": %.2f, \"amount\": %.2f, "
                "\"unit\": \"%s\", \"sentence\": \"%s\"}",
                k ? "," : "", f->part, finding_kind_name(f->kind), f->from_s, f->to_s, f->amount, f->unit, f->sentence);
    }
    fputs("],\n", to);
}

static void json_repetitions(FILE *to, const struct comparison *c)
{
    fputs("  \"repetitions\": [", to);
    for (int32_t k = 0; k < c->repetitions.count; k++) {
        const struct judged_repetition *r = &c->repetitions.at[k];
        fprintf(to,
                "%s\n    {\"from_s\": %.2f, \"to_s\": %.2f, \"reference_from_s\": %.2f, \"reference_to_s\": %.2f, "
                "\"score\": %.1f}",
                k ? "," : "", seconds(r->attempt.first), seconds(r->attempt.end), seconds(r->reference.first),
                seconds(r->reference.end), r->score);
    }
    fputs("],\n", to);
}

static void json_ranges(FILE *to, const struct comparison *c)
{
    fputs("  \"ranges\": {", to);
    for (int k = 0; k < BODY_ANGLES; k++) {
        const double values[4] = {c->range_a[k].low, c->range_a[k].high, c->range_b[k].low, c->range_b[k].high};
        fprintf(to, "%s\n    \"%s\": {\"reference_deg\": [", k ? "," : "", body_angle_name((enum body_angle)k));
        number(to, values[0] * RAD, 1);
        fputs(", ", to);
        number(to, values[1] * RAD, 1);
        fputs("], \"attempt_deg\": [", to);
        number(to, values[2] * RAD, 1);
        fputs(", ", to);
        number(to, values[3] * RAD, 1);
        fputs("]}", to);
    }
    fputs("}\n", to);
}

static void json_not_judged(FILE *to, const struct comparison *c)
{
    char sentence[NOT_JUDGED_BYTES];
    fputs("  \"not_judged\": {\"parts\": [", to);
    for (int p = 0, count = 0; p < PART_COUNT; p++)
        if (!(c->parts >> p & 1))
            fprintf(to, "%s\"%s\"", count++ ? ", " : "", part_name((enum part)p));
    fprintf(to, "], \"sentence\": \"%s\"},\n", not_judged_text(c, sentence));
}

char *report_json(const struct comparison *c)
{
    struct text t;
    FILE *to = begin(&t);
    if (!to)
        return NULL;
    fprintf(to, "{\n  \"score\": %.4f,\n  \"mirrored\": %s,\n  \"level\": %.2f,\n  \"frames\": [\n", c->score,
            c->mirrored ? "true" : "false", VERDICT_LEVEL);
    for (int32_t f = 0; f < c->b.count; f++) {
        json_frame(to, c, f);
        fputs(f + 1 < c->b.count ? ",\n" : "],\n", to);
    }
    json_findings(to, c);
    json_repetitions(to, c);
    json_not_judged(to, c);
    json_ranges(to, c);
    fputs("}\n", to);
    return end(&t);
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
    struct text t;
    FILE *to = begin(&t);
    bool whole = to;
    if (!to)
        return NULL;
    fputs("{\"attempts\": [", to);
    for (int32_t k = 0; k < count; k++) {
        char *report = report_json(attempts[k].c);
        fprintf(to, "%s\n{\"name\": ", k ? "," : "");
        json_text(to, attempts[k].name);
        fprintf(to, ", \"report\": %s}", report ? report : "null");
        whole = whole && report;
        free(report);
    }
    fputs("]}\n", to);
    char *bytes = end(&t);
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

char *report_csv(const struct comparison *c)
{
    struct text t;
    FILE *to = begin(&t);
    if (!to)
        return NULL;
    fputs("time_s,reference_s", to);
    for (int k = 0; k < BODY_ANGLES; k++) {
        const char *name = body_angle_name((enum body_angle)k);
        fprintf(to, ",%s_deg,%s_reference_deg,%s_sigma_deg", name, name, name);
    }
    fputc('\n', to);
    for (int32_t f = 0; f < c->b.count; f++) {
        const double reference = c->timeline.reference[f];
        const struct body_angles b = body_angles_of(&c->b.frames[f]);
        struct body_angles a;
        for (int k = 0; k < BODY_ANGLES; k++)
            a.rad[k] = a.sigma[k] = NAN;
        if (!isnan(reference)) {
            const struct movement_frame x = movement_at(&c->a, reference);
            a = body_angles_of(&x);
        }
        fprintf(to, "%.3f", seconds(f));
        csv_number(to, seconds(reference), 3);
        for (int k = 0; k < BODY_ANGLES; k++) {
            csv_number(to, b.rad[k] * RAD, 1);
            csv_number(to, a.rad[k] * RAD, 1);
            csv_number(to, sqrt((double)a.sigma[k] * a.sigma[k] + (double)b.sigma[k] * b.sigma[k]) * RAD, 1);
        }
        fputc('\n', to);
    }
    return end(&t);
}

// ------------------------------------------------------------- plain text

char *report_text(const struct comparison *c)
{
    struct text t;
    FILE *to = begin(&t);
    if (!to)
        return NULL;
    fprintf(to, "score %.0f of 100\n", c->score);
    for (int32_t k = 0; k < c->finding_count; k++)
        fprintf(to, "%-9s %s\n", finding_kind_name(c->findings[k].kind), c->findings[k].sentence);
    if (!c->finding_count)
        fputs("no difference found\n", to);
    char not_judged[NOT_JUDGED_BYTES];
    if (*not_judged_text(c, not_judged))
        fprintf(to, "%s\n", not_judged);
    for (int32_t k = 0; k < c->repetitions.count; k++) {
        const struct judged_repetition *r = &c->repetitions.at[k];
        fprintf(to, "repetition %d, from %.1f s to %.1f s: %.0f\n", (int)k + 1, seconds(r->attempt.first),
                seconds(r->attempt.end), r->score);
    }
    return end(&t);
}
