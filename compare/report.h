// A comparison as text for other programs and for people. Each function returns a malloc'ed text, which the caller
// frees, or NULL if memory ran out. Pure.
#pragma once
#include "compare/comparison.h"

// " (± 4)", what the score may be off by for the joints' errors; "" where these are unknown.
enum { SIGMA_TEXT_BYTES = 24 };
const char *score_sigma_text(const struct comparison *comparison, char out[SIGMA_TEXT_BYTES]);

// One row a frame of B: time_s,reference_s, and of every body angle degrees in the attempt, the reference and the
// standard deviation of their difference. Empty where unknown.
char *report_csv(const struct comparison *comparison);

// One of several attempts at the same reference, `a`'s movement in all.
struct report_attempt {
    const struct comparison *c;
    const char *name;
    const struct report_moment *moments; // what is shown of it in pictures
    int moment_count;
    int64_t began_ns, reference_began_ns; // of each source's clock at time 0: a date, where date_text says so
};

// The JSON object of `reenact compare --json`: score, frames, findings, repetitions; and beside them mirrored, expected
// (where something is: a sentence, parts that are ignored, tolerances in degrees, the stretch), good
// (the attempt's parts, good_parts.h), not_judged (parts that are not known in both, and a sentence of the joints that
// lack), ranges, date and reference_date (ISO 8601, or null).
char *report_json(const struct report_attempt *attempt);

// All attempts as one JSON object: "attempts", in their order, each with "name" and report_json's "report".
char *report_json_attempts(const struct report_attempt *attempts, int32_t count);

// A person at an instant, as the caller drew it; png NULL: a stick figure is drawn instead.
struct report_picture {
    uint8_t *png; // malloc'ed
    size_t png_size;
    int width_px, height_px;
    bool marked; // a line from from_px to to_px says which part is meant
    double from_px[2], to_px[2];
};

// An instant to be shown side by side, of a finding; finding -1: where the two differ most, of all the body. An azimuth
// is where a person is looked at from in their own upright frame, rad: 0 from the front, positive from the person's
// left. The reference of a mirrored attempt is looked at from the other side, so that the two resemble each other.
struct report_moment {
    int32_t finding;
    int part; // of the attempt; -1: the whole body
    double attempt_s, reference_s, attempt_azimuth_rad, reference_azimuth_rad;
    struct report_picture reference, attempt; // zeroed by report_moments
};
enum { REPORT_MOMENTS = 6 };
// The worst finding's comes first. Returns how many; 0 where the relation is not RELATION_SAME.
int report_moments(const struct comparison *comparison, struct report_moment moments[REPORT_MOMENTS]);
void report_moments_free(struct report_moment *moments, int count); // their pictures

// One self-contained page without scripts: names and dates, score, findings and what is good, both people at the worst
// moment with their joint angles, each part over time, how the two were aligned, ranges of motion. Of several attempts
// their scores over the attempts, and each attempt to be opened, the last one open. Light and dark, from 360 px wide;
// printed, one attempt is one sheet of A4. Names are shown as given.
char *report_html(const struct report_attempt *attempts, int32_t count, const char *reference_name);

// A few lines for a terminal, with the SHOWN_FINDINGS worst findings or all of them.
enum { SHOWN_FINDINGS = 3 };
char *report_text(const struct comparison *comparison, bool all);
