// Plots for the page as inline SVG: error against time with the frontier, and curves over sizes.
#include "base/text.h"
#include "tests/bench/bench_page.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDE = 720, HIGH = 380, LEFT = 64, RIGHT = 700, TOP = 16, BOTTOM = 330 };

// A logarithmic axis over the values, with a margin, in pixels.
struct plot_axis {
    double low, high, from_px, to_px; // low, high: decimal logarithms
};

static void axis_add(struct plot_axis *a, double value)
{
    if (value > 0 && isfinite(value)) {
        a->low = fmin(a->low, log10(value));
        a->high = fmax(a->high, log10(value));
    }
}

static void axis_close(struct plot_axis *a)
{
    if (!(a->low <= a->high))
        a->low = a->high = 0;
    const double margin = 0.1 * (a->high - a->low) + 0.08;
    a->low -= margin;
    a->high += margin;
}

static double place_on(const struct plot_axis *a, double value)
{
    const double at = value > 0 ? log10(value) : a->low; // zero and less lie on the edge
    return a->from_px + (at - a->low) / (a->high - a->low) * (a->to_px - a->from_px);
}

static void put_tick(FILE *f, bool upright, double at, double value)
{
    if (upright)
        fprintf(f,
                "<path class=\"grid\" d=\"M%.1f %dV%d\"/><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%g</text>\n",
                at, BOTTOM, TOP, at, BOTTOM + 16, value);
    else
        fprintf(f, "<path class=\"grid\" d=\"M%d %.1fH%d\"/><text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%g</text>\n",
                LEFT, at, RIGHT, LEFT - 6, at + 4, value);
}

// Lines at 1, 2 and 5 times the powers of ten; over more than three powers at those alone.
static void put_grid(FILE *f, const struct plot_axis *a, bool upright)
{
    static const double steps[] = {1, 2, 5};
    const size_t count = a->high - a->low > 3 ? 1 : COUNT_OF(steps);
    for (int power = (int)floor(a->low); power <= (int)ceil(a->high); power++)
        for (size_t i = 0; i < count; i++) {
            const double value = steps[i] * pow(10, power);
            if (log10(value) >= a->low && log10(value) <= a->high)
                put_tick(f, upright, place_on(a, value), value);
        }
}

static void put_frame(FILE *f, const struct plot_axis *x, const struct plot_axis *y, const char *x_text,
                      const char *y_text)
{
    fprintf(f, "<svg class=\"plot\" viewBox=\"0 0 %d %d\" role=\"img\">\n", WIDE, HIGH);
    put_grid(f, x, true);
    put_grid(f, y, false);
    fprintf(f, "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">", (LEFT + RIGHT) / 2, HIGH - 12);
    html_put_text(f, x_text);
    fprintf(f, "</text><text transform=\"translate(14 %d) rotate(-90)\" text-anchor=\"middle\">", (TOP + BOTTOM) / 2);
    html_put_text(f, y_text);
    fputs("</text>\n", f);
}

// ------------------------------------------------------------- error against time

static bool is_drawn(const struct bench_row *row) { return !isnan(row->error) && !row->group && row->time_ms > 0; }

// No other row is better in one and not worse in the other.
static bool is_frontier(const struct bench_result *r, const struct bench_row *row)
{
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *o = &r->rows[i];
        if (is_drawn(o) && o->error <= row->error && o->time_ms <= row->time_ms &&
            (o->error < row->error || o->time_ms < row->time_ms))
            return false;
    }
    return true;
}

static int by_time(const void *a, const void *b)
{
    const struct bench_row *x = *(const struct bench_row *const *)a, *y = *(const struct bench_row *const *)b;
    return (x->time_ms > y->time_ms) - (x->time_ms < y->time_ms);
}

static void put_frontier(FILE *f, const struct bench_result *r, const struct plot_axis *x, const struct plot_axis *y)
{
    enum { MOST = 64 };
    const struct bench_row *on[MOST];
    size_t count = 0;
    for (size_t i = 0; i < r->count && count < MOST; i++)
        if (is_drawn(&r->rows[i]) && is_frontier(r, &r->rows[i]))
            on[count++] = &r->rows[i];
    qsort(on, count, sizeof *on, by_time);
    if (!count)
        return;
    fprintf(f, "<path class=\"frontier\" d=\"M%.1f %d", place_on(x, on[0]->time_ms), TOP);
    for (size_t i = 0; i < count; i++) // what is attained with at most this time: steps
        fprintf(f, "V%.1fH%.1f", place_on(y, on[i]->error),
                i + 1 < count ? place_on(x, on[i + 1]->time_ms) : (double)RIGHT);
    fputs("\"/>\n", f);
}

static void put_mark(FILE *f, const struct bench_row *row, double x, double y, double label_y)
{
    const bool left = x > LEFT + 0.62 * (RIGHT - LEFT);
    fprintf(f, "<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"5\"/>", row->baseline ? "theirs" : "ours", x, y);
    if (row->usual)
        fprintf(f, "<circle class=\"ring\" cx=\"%.1f\" cy=\"%.1f\" r=\"9\"/>", x, y);
    fprintf(f, "<text x=\"%.1f\" y=\"%.1f\"%s%s>", x + (left ? -12 : 12), label_y, left ? " text-anchor=\"end\"" : "",
            row->baseline ? " font-style=\"italic\"" : "");
    html_put_text(f, row->name);
    fputs("</text>\n", f);
}

void bench_put_plot(FILE *f, const struct bench_result *r, const struct bench_section *section)
{
    enum { MOST = 64, LINE_PX = 13 };
    struct plot_axis x = {INFINITY, -INFINITY, LEFT, RIGHT}, y = {INFINITY, -INFINITY, BOTTOM, TOP};
    double taken[MOST];
    int labels = 0;
    for (size_t i = 0; i < r->count; i++)
        if (is_drawn(&r->rows[i])) {
            axis_add(&x, r->rows[i].time_ms);
            axis_add(&y, r->rows[i].error);
        }
    axis_close(&x);
    axis_close(&y);
    put_frame(f, &x, &y, section->time_text, section->error_text);
    put_frontier(f, r, &x, &y);
    for (size_t i = 0; i < r->count && labels < MOST; i++) {
        const struct bench_row *row = &r->rows[i];
        if (!is_drawn(row))
            continue;
        const double at = place_on(&y, row->error);
        double label = at + (is_frontier(r, row) ? -7 : 4); // off the frontier
        for (bool moved = true; moved;) {                   // labels do not lie on each other
            moved = false;
            for (int k = 0; k < labels && !moved; k++)
                if (fabs(taken[k] - label) < LINE_PX - 1) {
                    label = taken[k] + LINE_PX;
                    moved = true;
                }
        }
        taken[labels++] = label;
        put_mark(f, row, place_on(&x, row->time_ms), at, label);
    }
    fputs("</svg>\n", f);
}

// ------------------------------------------------------------- curves over sizes

void bench_fit_curve(struct bench_curve *c)
{
    double x = 0, y = 0, xx = 0, xy = 0, n = 0;
    for (int i = 0; i < c->count; i++)
        if (c->size[i] > 0 && c->value[i] > 0) {
            const double u = log(c->size[i]), v = log(c->value[i]);
            x += u, y += v, xx += u * u, xy += u * v, n++;
        }
    c->exponent = n > 1 ? (n * xy - x * y) / (n * xx - x * x) : NAN;
}

void bench_put_curves(FILE *f, const struct bench_curves *c)
{
    struct plot_axis x = {INFINITY, -INFINITY, LEFT, RIGHT}, y = {INFINITY, -INFINITY, BOTTOM, TOP};
    for (int k = 0; k < c->count; k++)
        for (int i = 0; i < c->curve[k].count; i++) {
            axis_add(&x, c->curve[k].size[i]);
            axis_add(&y, c->curve[k].value[i]);
        }
    axis_close(&x);
    axis_close(&y);
    fputs("<figure>", f);
    put_frame(f, &x, &y, c->size_text, c->value_text);
    for (int k = 0; k < c->count; k++) {
        const struct bench_curve *v = &c->curve[k];
        fprintf(f, "<path class=\"line c%d\" d=\"", k % 6);
        for (int i = 0; i < v->count; i++)
            fprintf(f, "%c%.1f %.1f", i ? 'L' : 'M', place_on(&x, v->size[i]), place_on(&y, v->value[i]));
        fputs("\"/>\n", f);
        for (int i = 0; i < v->count; i++)
            fprintf(f, "<circle class=\"dot c%d\" cx=\"%.1f\" cy=\"%.1f\" r=\"3.5\"/>", k % 6, place_on(&x, v->size[i]),
                    place_on(&y, v->value[i]));
    }
    fputs("</svg><figcaption>", f);
    for (int k = 0; k < c->count; k++) {
        fprintf(f, "<span class=\"key c%d\"></span>", k % 6);
        html_put_text(f, c->curve[k].name);
        if (!isnan(c->curve[k].exponent))
            fprintf(f, " ∝ n<sup>%.2f</sup>", c->curve[k].exponent);
        fputs(k + 1 < c->count ? " · " : "", f);
    }
    fputs("</figcaption></figure>\n", f);
}
