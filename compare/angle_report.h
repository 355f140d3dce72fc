// The body's angles in one movement (movement.h): their definitions, ranges and courses, as text for other programs and
// for people. Each function that returns a text returns a malloc'ed one, which the caller frees, or NULL if memory ran
// out. Pure.
#pragma once
#include "compare/movement.h"

// How an angle is measured, "between upper arm and forearm; 0 straight".
const char *body_angle_definition(enum body_angle angle);

struct angle_summary {
    struct angle_range range[BODY_ANGLES]; // as body_angle_ranges, of the whole movement
    double known[BODY_ANGLES];             // share of the frames that know it
};
// ERR_MEMORY.
MUST_CHECK enum status angle_summary_of(const struct movement *movement, struct angle_summary *out);

// What is shown of a movement: whose it is, and its summary.
struct angle_report {
    const struct movement *movement;
    const struct angle_summary *summary;
    const char *name;
};

// A table for a terminal: degrees.
char *angle_report_text(const struct angle_report *report);

// "seconds", and of each angle "low_deg", "high_deg", "known" and "definition".
char *angle_report_json(const struct angle_report *report);

// One row a frame: time_s, and of every angle degrees and their standard deviation; empty where unknown.
char *angle_report_csv(const struct angle_report *report);

// A motion of OpenSim's: time and every angle in degrees; NaN where unknown.
char *angle_report_mot(const struct angle_report *report);

// One self-contained page without scripts: the table, and each angle over time. Light and dark; printed, it is one
// sheet of A4. The name is shown as given.
char *angle_report_html(const struct angle_report *report);
