// The report that verify and repair print.
#pragma once
#include "recording/recording.h"

// On stdout, as the end of a list of what is lost: covariances of joints; the place, or its views; and things.
void recording_report_print_rest(const struct recording_report *report);

// One JSON object on stdout: the report and the status, with the error sentence where it is not OK. ERR_MEMORY.
MUST_CHECK enum status recording_report_print_json(const char *path, enum status status,
                                                   const struct recording_report *r);
