// Plots error against time of several levels of detail, each from several distances, as an SVG file.
#pragma once
#include "base/status.h"

enum { LOD_PLOT_DISTANCES = 6 };

struct lod_plot_mark {
    double away_m;       // from the person
    double time_ratio;   // relative to DETAIL_PAPER from there
    double error_px;     // measured
    double predicted_px; // by the program itself
};

struct lod_plot_line {
    const char *name, *colour; // "#rrggbb"; neither needs escaping
    bool ring;                 // open marks, larger, for lines that coincide with another
    struct lod_plot_mark mark[LOD_PLOT_DISTANCES];
};

// ERR_IO.
MUST_CHECK enum status lod_plot(const char *path, const struct lod_plot_line *lines, int count);
