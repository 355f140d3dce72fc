// A comparison as text for other programs and for people. Each function returns a malloc'ed text, which the caller
// frees, or NULL if memory ran out. Pure.
#pragma once
#include "compare/comparison.h"

// The JSON object of `reenact compare --json`: score, frames, findings, repetitions; and beside them mirrored, parts,
// ranges.
char *report_json(const struct comparison *c);

// One row a frame of B: time_s,reference_s, and of every body angle degrees in the attempt, the reference and the
// standard deviation of their difference. Empty where unknown.
char *report_csv(const struct comparison *c);

// One self-contained page: score, findings, a strip over time for each part, stick figures of the worst moments side by
// side; light and dark, wide and narrow. Names are shown as given.
char *report_html(const struct comparison *c, const char *reference_name, const char *attempt_name);

// A few lines for a terminal.
char *report_text(const struct comparison *c);
