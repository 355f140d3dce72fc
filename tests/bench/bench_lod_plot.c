// Draws two panels: measured error against time; and, by distance, predicted next to measured error.
#include "tests/bench/bench_lod_plot.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { WIDE = 920, HIGH = 470, TOP = 40, BOTTOM = 350 };

// Maps [low, high] to [from, to], logarithmically if asked for.
struct lod_plot_axis {
    double low, high, from, to;
    bool powers;
};

static double place_on(const struct lod_plot_axis *a, double value)
{
    double share = a->powers ? log(value / a->low) / log(a->high / a->low) : (value - a->low) / (a->high - a->low);
    return a->from + share * (a->to - a->from);
}

static void put_x_axis(FILE *file, const struct lod_plot_axis *x, double step, const char *title)
{
    for (int i = 0; x->low + i * step <= x->high + 1e-9; i++) {
        double value = x->low + i * step, at = place_on(x, value);
        fprintf(file,
                "<path d=\"M%.1f %dV%d\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%g</text>\n",
                at, TOP, BOTTOM, at, BOTTOM + 18, value);
    }
    fprintf(file, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%s</text>\n", (x->from + x->to) / 2, BOTTOM + 40,
            title);
}

// Grid lines at 1, 2 and 5 times the powers of ten.
static void put_y_axis(FILE *file, const struct lod_plot_axis *y, const struct lod_plot_axis *x, const char *title)
{
    static const double steps[] = {1, 2, 5};
    for (int power = (int)floor(log10(y->low)); power <= (int)ceil(log10(y->high)); power++)
        for (size_t i = 0; i < COUNT_OF(steps); i++) {
            double value = steps[i] * pow(10, power), at = place_on(y, value);
            if (value < y->low * 0.999 || value > y->high * 1.001)
                continue;
            fprintf(file,
                    "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%.1f\" "
                    "text-anchor=\"end\">%g</text>\n",
                    x->from, at, x->to, x->from - 6, at + 4, value);
        }
    fprintf(file, "<text transform=\"translate(%.1f %d) rotate(-90)\" text-anchor=\"middle\">%s</text>\n", x->from - 38,
            (TOP + BOTTOM) / 2, title);
}

static void put_mark(FILE *file, const struct lod_plot_line *line, double x, double y)
{
    fprintf(file, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%d\" ", x, y, line->ring ? 8 : 4);
    if (line->ring)
        fprintf(file, "fill=\"none\" stroke-width=\"1.5\" stroke=\"%s\"/>\n", line->colour);
    else
        fprintf(file, "fill=\"%s\"/>\n", line->colour);
}

// Labels stand to the right of the marks; with `left` to the left, where no ring is beside them.
static void put_time(FILE *file, const struct lod_plot_line *line, bool left, const struct lod_plot_axis *x,
                     const struct lod_plot_axis *y)
{
    for (int d = 0; d < LOD_PLOT_DISTANCES; d++) {
        const struct lod_plot_mark *m = &line->mark[d];
        double at = place_on(x, m->time_ratio), up = place_on(y, m->error_px);
        put_mark(file, line, at, up);
        if (!line->ring)
            fprintf(file, "<text x=\"%.1f\" y=\"%.1f\" font-size=\"11\" text-anchor=\"%s\" fill=\"%s\">%g m</text>\n",
                    at + (left ? -16 : 16), up + 4, left ? "end" : "start", line->colour, m->away_m);
    }
}

static void put_prediction(FILE *file, const struct lod_plot_line *line, const struct lod_plot_axis *x,
                           const struct lod_plot_axis *y)
{
    if (!line->ring) {
        fprintf(file, "<path fill=\"none\" stroke-dasharray=\"5 4\" stroke=\"%s\" d=\"", line->colour);
        for (int d = 0; d < LOD_PLOT_DISTANCES; d++)
            fprintf(file, "%c%.1f %.1f", d ? 'L' : 'M', place_on(x, line->mark[d].away_m),
                    place_on(y, line->mark[d].predicted_px));
        fputs("\"/>\n", file);
    }
    for (int d = 0; d < LOD_PLOT_DISTANCES; d++)
        put_mark(file, line, place_on(x, line->mark[d].away_m), place_on(y, line->mark[d].error_px));
}

static void put_legend(FILE *file, const struct lod_plot_line *lines, int count)
{
    enum { LETTER = 8, MARK = 52 }; // approximate widths
    int at = 70;
    for (int i = 0; i < count; i++) {
        put_mark(file, &lines[i], at, HIGH - 32);
        fprintf(file, "<text x=\"%d\" y=\"%d\">%s</text>\n", at + 14, HIGH - 28, lines[i].name);
        at += MARK + LETTER * (int)strlen(lines[i].name);
    }
    fprintf(
        file,
        "<path d=\"M%d %dh30\" stroke=\"#333\" stroke-dasharray=\"5 4\"/><text x=\"%d\" y=\"%d\">predicted</text>\n",
        at - 8, HIGH - 32, at + 28, HIGH - 28);
}

enum status lod_plot(const char *path, const struct lod_plot_line *lines, int count)
{
    double slowest = 1, best_px = INFINITY, worst_px = 0, min_px = INFINITY, max_px = 0;
    for (int i = 0; i < count; i++)
        for (int d = 0; d < LOD_PLOT_DISTANCES; d++) {
            const struct lod_plot_mark *m = &lines[i].mark[d];
            slowest = fmax(slowest, m->time_ratio);
            best_px = fmin(best_px, m->error_px);
            worst_px = fmax(worst_px, m->error_px);
            min_px = fmin(min_px, m->predicted_px);
            max_px = fmax(max_px, m->predicted_px);
        }
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(ERR_IO, "%s cannot be written", path);
    const struct lod_plot_axis error = {0.8 * best_px, 1.25 * worst_px, BOTTOM, TOP, true};
    const struct lod_plot_axis either = {0.8 * fmin(best_px, min_px), 1.25 * fmax(worst_px, max_px), BOTTOM, TOP, true};
    const struct lod_plot_axis time = {0, 0.25 * ceil(4 * slowest + 0.5), 70, 460, false};
    const struct lod_plot_axis away = {0, LOD_PLOT_DISTANCES + 1, 540, WIDE - 20, false};
    fprintf(file,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" viewBox=\"0 0 %d %d\">\n"
            "<style>text{font-family:sans-serif}</style><g font-size=\"13\" fill=\"#333\">"
            "<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n",
            WIDE, HIGH, WIDE, HIGH, WIDE, HIGH);
    fprintf(file,
            "<text x=\"70\" y=\"24\">Error against time</text><text x=\"540\" y=\"24\">Error by distance</text>\n");
    put_x_axis(file, &time, 0.25, "drawing time, relative to paper from the same distance");
    put_x_axis(file, &away, 1, "from the person, metres");
    put_y_axis(file, &error, &time, "silhouette error, pixels");
    put_y_axis(file, &either, &away, "error, pixels");
    for (int i = 0; i < count; i++) {
        put_time(file, &lines[i], i == 0, &time, &error); // the baseline first, which others may be as slow as
        put_prediction(file, &lines[i], &away, &either);
    }
    put_legend(file, lines, count);
    fputs("</g></svg>\n", file);
    bool written = !ferror(file);
    return fclose(file) == 0 && written ? OK : fail(ERR_IO, "%s could not be written", path);
}
