// What the files of the page share.
#pragma once
#include "compare/report.h"

#include <stdio.h>

void report_figures(FILE *to, const struct report_attempt *a);
