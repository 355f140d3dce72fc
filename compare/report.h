// A comparison as text for other programs and for people. Each function returns a malloc'ed text, which the caller
// frees, or NULL if memory ran out. Pure.
#pragma once
#include "compare/comparison.h"

// The JSON object of `reenact compare --json`: score, frames, findings, repetitions; and beside them mirrored,
// not_judged (parts that are not known in both, and a sentence of the joints that lack), ranges.
char *report_json(const struct comparison *comparison);

// One row a frame of B: time_s,reference_s, and of every body angle degrees in the attempt, the reference and the
// standard deviation of their difference. Empty where unknown.
char *report_csv(const struct comparison *comparison);

// One of several attempts at the same reference, `a`'s movement in all.
struct report_attempt {
    const struct comparison *c;
    const char *name;
    const struct report_moment *moments; // what is shown of it in pictures
    int moment_count;
};

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

// An instant of a finding, to be shown side by side. An azimuth is where a person is looked at from in their own
// upright frame, rad: 0 from the front, positive from the person's left. The reference of a mirrored attempt is looked
// at from the other side, so that the two resemble each other.
struct report_moment {
    int32_t finding;
    int part; // of the attempt; -1: the whole body
    double attempt_s, reference_s, attempt_azimuth_rad, reference_azimuth_rad;
    struct report_picture reference, attempt; // zeroed by report_moments
};
enum { REPORT_MOMENTS = 6 };
int report_moments(const struct comparison *comparison, struct report_moment moments[REPORT_MOMENTS]); // how many
void report_moments_free(struct report_moment *moments, int count);                                    // their pictures

// One self-contained page: score, findings, a strip over time for each part, pictures of the worst moments side by
// side; of several attempts their scores over the attempts, and each attempt to be opened, the last one open. Light and
// dark, wide and narrow. Names are shown as given.
char *report_html(const struct report_attempt *attempts, int32_t count, const char *reference_name);

// A few lines for a terminal.
char *report_text(const struct comparison *comparison);
