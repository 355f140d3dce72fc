// What the files of the page share.
#pragma once
#include "compare/report.h"

#include <stdio.h>

void report_escaped(FILE *to, const char *text); // text from outside: file and take names
void report_figures(FILE *to, const struct report_attempt *a);
