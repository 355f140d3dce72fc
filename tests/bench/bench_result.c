#include "tests/bench/bench_result.h"

#include <math.h>

static const struct bench_row *baseline_of(const struct bench_result *r)
{
    const struct bench_row *found = NULL;
    for (size_t i = 0; i < r->count; i++)
        if (r->rows[i].baseline) {
            assert(!found && "one baseline");
            found = &r->rows[i];
        }
    assert(found && "a baseline");
    return found;
}

// ------------------------------------------------------------- the table

static void print_cell(double value)
{
    if (isnan(value))
        printf(" %10s", "-");
    else
        printf(" %10.*f",
               fabs(value) >= 100                 ? 1
               : fabs(value) >= 10                ? 2
               : fabs(value) >= 0.1 || value == 0 ? 3
                                                  : 5,
               value);
}

void bench_print_table(const struct bench_result *r)
{
    const struct bench_row *baseline = baseline_of(r);
    printf("%s: %s\n%d items, %d rounds; %s and %s are medians over the items; x: of the baseline (*)\n\n",
           r->stage->name, r->stage->about, r->items, r->rounds, r->stage->error_name, r->stage->time_name);
    printf("  %-22s %16.16s %10s %8s %14.14s %10s %8s", "", r->stage->error_name, "p95", "x", r->stage->time_name,
           "p95", "x");
    for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
        printf(" %14.14s", r->stage->extra_names[k]);
    printf(" %7s\n", "missed");
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        printf("%c %s%-*.22s      ", row->baseline ? '*' : ' ', row->group ? "  " : "", row->group ? 20 : 22,
               row->group ? row->group : row->name);
        print_cell(row->error);
        print_cell(row->error_p95);
        printf(" %8.2f    ", row->error / baseline->error);
        print_cell(row->time_ms);
        print_cell(row->time_p95_ms);
        printf(" %8.2f", row->time_ms / baseline->time_ms);
        for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++) {
            printf("    ");
            print_cell(row->extra[k]);
        }
        printf(" %7d\n", row->missed);
    }
    printf("\n");
}

// ------------------------------------------------------------- JSON

void bench_add_json(struct json *stages, const struct bench_result *r)
{
    const struct bench_row *baseline = baseline_of(r);
    struct json *stage = json_add_object(stages, NULL);
    json_add_string(stage, "name", r->stage->name);
    json_add_string(stage, "about", r->stage->about);
    json_add_string(stage, "error", r->stage->error_name);
    json_add_string(stage, "time", r->stage->time_name);
    json_add_string(stage, "baseline", baseline->name);
    json_add_number(stage, "items", r->items);
    json_add_number(stage, "rounds", r->rounds);
    struct json *rows = json_add_array(stage, "contenders");
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        struct json *object = json_add_object(rows, NULL);
        json_add_string(object, "name", row->name);
        if (row->group)
            json_add_string(object, "group", row->group);
        json_add_number(object, "error", row->error);
        json_add_number(object, "error_p95", row->error_p95);
        json_add_number(object, "error_of_baseline", row->error / baseline->error);
        json_add_number(object, "time", row->time_ms);
        json_add_number(object, "time_p95", row->time_p95_ms);
        json_add_number(object, "time_of_baseline", row->time_ms / baseline->time_ms);
        json_add_number(object, "missed", row->missed);
        for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
            json_add_number(object, r->stage->extra_names[k], row->extra[k]);
    }
}

// ------------------------------------------------------------- plain tables

// A few columns of all rows.
static void print_block(const struct bench_plain *p, size_t from, size_t to)
{
    printf("  %-26s", "");
    for (size_t k = from; k < to; k++)
        printf(" %10s", p->column[k]);
    printf("\n");
    for (size_t i = 0; i < p->count; i++) {
        printf("  %-26.26s", p->rows[i].name);
        for (size_t k = from; k < to; k++)
            print_cell(p->rows[i].value[k]);
        printf("\n");
    }
    printf("\n");
}

void bench_print_plain(const struct bench_plain *p)
{
    enum { BLOCK = 11 }; // columns side by side on a usual screen
    printf("%s: %s\n\n", p->stage->name, p->stage->about);
    for (size_t k = 0; k < p->columns; k += BLOCK)
        print_block(p, k, k + BLOCK < p->columns ? k + BLOCK : p->columns);
}

void bench_add_plain_json(struct json *stages, const struct bench_plain *p)
{
    struct json *stage = json_add_object(stages, NULL);
    json_add_string(stage, "name", p->stage->name);
    json_add_string(stage, "about", p->stage->about);
    struct json *rows = json_add_array(stage, "rows");
    for (size_t i = 0; i < p->count; i++) {
        struct json *object = json_add_object(rows, NULL);
        json_add_string(object, "name", p->rows[i].name);
        for (size_t k = 0; k < p->columns; k++)
            json_add_number(object, p->column[k], p->rows[i].value[k]);
    }
}

// ------------------------------------------------------------- the page

// Text as HTML shows it literally.
static void put_text(FILE *file, const char *text)
{
    for (; *text; text++)
        switch (*text) {
        case '<': fputs("&lt;", file); break;
        case '>': fputs("&gt;", file); break;
        case '&': fputs("&amp;", file); break;
        default: fputc(*text, file);
        }
}

void bench_print_html_head(FILE *file)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Error against time</title>\n"
          "<style>body{font:15px sans-serif;margin:2em auto;max-width:60em}td,th{padding:.2em .8em;text-align:right}"
          "td:first-child{text-align:left}.b{font-style:italic}svg text{font:12px sans-serif}</style>\n"
          "<h1>Error against time</h1>\n<p>Lower left is better. Italic: what a user would take instead.</p>\n",
          file);
}

// A logarithmic axis over the values, with a margin, in pixels.
struct result_axis {
    double low, high, from_px, to_px;
};

static struct result_axis axis_over(const struct bench_result *r, bool time, double from_px, double to_px)
{
    struct result_axis a = {INFINITY, -INFINITY, from_px, to_px};
    for (size_t i = 0; i < r->count; i++) {
        double value = time ? r->rows[i].time_ms : r->rows[i].error;
        if (value > 0) {
            a.low = fmin(a.low, log10(value));
            a.high = fmax(a.high, log10(value));
        }
    }
    if (!(a.low <= a.high))
        a.low = a.high = 0;
    double margin = 0.1 * (a.high - a.low) + 0.05;
    a.low -= margin;
    a.high += margin;
    return a;
}

static double place_on(const struct result_axis *a, double value)
{
    double at = value > 0 ? log10(value) : a->low; // zero and less lie on the edge
    return a->from_px + (at - a->low) / (a->high - a->low) * (a->to_px - a->from_px);
}

// Lines at 1, 2 and 5 times the powers of ten.
static void put_grid(FILE *file, const struct result_axis *a, bool upright, double from_px, double to_px)
{
    static const double steps[] = {1, 2, 5};
    for (int power = (int)floor(a->low); power <= (int)ceil(a->high); power++)
        for (size_t i = 0; i < COUNT_OF(steps); i++) {
            double value = steps[i] * pow(10, power), at = place_on(a, value);
            if (log10(value) < a->low || log10(value) > a->high)
                continue;
            if (upright)
                fprintf(file,
                        "<path d=\"M%.1f %.1fV%.1f\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%.1f\" "
                        "text-anchor=\"middle\">%g</text>\n",
                        at, from_px, to_px, at, from_px + 16, value);
            else
                fprintf(file,
                        "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%.1f\" "
                        "text-anchor=\"end\">%g</text>\n",
                        from_px, at, to_px, from_px - 6, at + 4, value);
        }
}

static void put_plot(FILE *file, const struct bench_result *r)
{
    struct result_axis time = axis_over(r, true, 70, 760), error = axis_over(r, false, 340, 20);
    fprintf(file, "<svg width=\"900\" height=\"390\" viewBox=\"0 0 900 390\">\n");
    put_grid(file, &time, true, 340, 20);
    put_grid(file, &error, false, 70, 760);
    fprintf(file, "<text x=\"415\" y=\"380\" text-anchor=\"middle\">");
    put_text(file, r->stage->time_name);
    fprintf(file, "</text><text transform=\"translate(16 180) rotate(-90)\" text-anchor=\"middle\">");
    put_text(file, r->stage->error_name);
    fprintf(file, "</text>\n");
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        if (isnan(row->error) || row->group)
            continue;
        double x = place_on(&time, row->time_ms), y = place_on(&error, row->error);
        fprintf(file, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" fill=\"%s\"/><text x=\"%.1f\" y=\"%.1f\"%s>", x, y,
                row->baseline ? "#c60" : "#06c", x + 9, y + 4, row->baseline ? " font-style=\"italic\"" : "");
        put_text(file, row->name);
        fprintf(file, "</text>\n");
    }
    fprintf(file, "</svg>\n");
}

void bench_print_html(FILE *file, const struct bench_result *r)
{
    const struct bench_row *baseline = baseline_of(r);
    fprintf(file, "<h2>");
    put_text(file, r->stage->name);
    fprintf(file, "</h2>\n<p>");
    put_text(file, r->stage->about);
    fprintf(file, ". %d items, %d rounds, medians.</p>\n", r->items, r->rounds);
    put_plot(file, r);
    fprintf(file, "<table><tr><th></th><th>%s</th><th>p95</th><th>×</th><th>%s</th><th>p95</th><th>×</th>",
            r->stage->error_name, r->stage->time_name);
    for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
        fprintf(file, "<th>%s</th>", r->stage->extra_names[k]);
    fprintf(file, "<th>missed</th></tr>\n");
    for (size_t i = 0; i < r->count; i++) {
        const struct bench_row *row = &r->rows[i];
        fprintf(file, "<tr%s><td>", row->baseline ? " class=\"b\"" : "");
        put_text(file, row->group ? row->group : row->name);
        fprintf(file, "</td><td>%.4g</td><td>%.4g</td><td>%.2f</td><td>%.4g</td><td>%.4g</td><td>%.2f</td>", row->error,
                row->error_p95, row->error / baseline->error, row->time_ms, row->time_p95_ms,
                row->time_ms / baseline->time_ms);
        for (int k = 0; k < BENCH_EXTRAS && r->stage->extra_names[k]; k++)
            fprintf(file, "<td>%.4g</td>", row->extra[k]);
        fprintf(file, "<td>%d</td></tr>\n", row->missed);
    }
    fprintf(file, "</table>\n");
}

void bench_print_html_foot(FILE *file) { fputs("</html>\n", file); }
