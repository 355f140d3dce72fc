// What verify and repair say of a recording.
#pragma once
#include "capture/recording/recording.h"

// One JSON object on stdout: the report and how it went, with the sentence where it
// went wrong.
void recording_report_print_json(const char *path, enum status status, const struct recording_report *r);
