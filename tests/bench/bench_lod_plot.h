// Error against time of several levels of drawing, each from several distances, as an SVG.
#pragma once
#include "base/status.h"

enum { LEVELS_DISTANCES = 6 };

struct levels_mark {
    double away_m;       // from the person
    double time_ratio;   // to the plain path's from there
    double error_px;     // measured
    double predicted_px; // by the program itself
};

struct levels_line {
    const char *name, *colour; // "#rrggbb"; neither needs escaping
    bool ring;                 // open marks, larger, for what lies upon another line
    struct levels_mark mark[LEVELS_DISTANCES];
};

// ERR_IO.
MUST_CHECK enum status levels_plot(const char *path, const struct levels_line *lines, int count);
