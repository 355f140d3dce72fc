// reenact compare: where two movements differ.
#include "app/commands/commands.h"

#include "compare/findings.h"
#include "compare/report.h"
#include "platform/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct compare_arguments {
    const char *reference, *take, *with, *with_take, *html, *csv;
    bool json, force;
};

enum { KEY_TAKE = COMMAND_KEY, KEY_WITH, KEY_WITH_TAKE, KEY_JSON, KEY_HTML, KEY_CSV, KEY_FORCE };

static const struct argp_option options[] = {
    {"take", KEY_TAKE, "NAME", 0, "the reference's take; needed where A holds several", 0},
    {"with", KEY_WITH, "B", 0, "the attempt: a recording or a joints-csv file", 0},
    {"with-take", KEY_WITH_TAKE, "NAME", 0, "the attempt's take", 0},
    {"html", KEY_HTML, "FILE", 0, "also write a page with pictures", 0},
    {"csv", KEY_CSV, "FILE", 0, "also write the joints' angles over time", 0},
    COMMAND_OPTION_FORCE(KEY_FORCE),
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct compare_arguments *a = state->input;
    switch (key) {
    case KEY_TAKE: a->take = value; return 0;
    case KEY_WITH: a->with = value; return 0;
    case KEY_WITH_TAKE: a->with_take = value; return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_HTML: a->html = value; return 0;
    case KEY_CSV: a->csv = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->reference, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->reference, "A");
        command_require(state, a->with, "--with");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// Before the work, so that it is not done in vain.
static enum status check_output(const struct compare_arguments *a, const char *path)
{
    if (!path)
        return OK;
    if (file_is_same(path, a->reference) || file_is_same(path, a->with))
        return fail(ERR_INPUT, "%s is what is compared; give the report another name", path);
    if (a->html && a->csv && !strcmp(a->html, a->csv))
        return fail(ERR_INPUT, "--html and --csv both name %s", path);
    return file_check_output(path, a->force);
}

static enum status write_text(const char *path, char *text)
{
    if (!text)
        return fail(ERR_MEMORY, "no memory for the report");
    enum status status = OK;
    if (path)
        status = file_write(path, text, strlen(text));
    else
        fputs(text, stdout);
    free(text);
    return status;
}

static const char *name_of(const char *path, const char *take)
{
    const char *slash = strrchr(path, '/');
    return take ? take : slash ? slash + 1 : path;
}

static void warn(const char *program, const char *path, const struct movement_source *s)
{
    if (s->tilt_rad > 0)
        fprintf(stderr, "%s: %s: the camera was tilted by %.0f degrees, as the person's standing says; corrected\n",
                program, path, s->tilt_rad * 180 / 3.14159265358979323846);
    if (s->clock_jumps)
        fprintf(stderr, "%s: warning: %s: the clock jumps %lld times; the jumps were closed up\n", program, path,
                (long long)s->clock_jumps);
    if (s->frames_side_mended)
        fprintf(stderr, "%s: warning: %s: left and right were confused in %lld frames; exchanged\n", program, path,
                (long long)s->frames_side_mended);
    if (s->frames_dropped)
        fprintf(stderr, "%s: warning: %s: %lld rows or frames were left out: no number, or no later time\n", program,
                path, (long long)s->frames_dropped);
}

static enum status read_both(const char *program, const struct compare_arguments *a, struct movement *reference,
                             struct movement *attempt)
{
    struct movement_source source;
    enum status status = movement_read(a->reference, a->take, reference, &source);
    if (status != OK)
        return status;
    warn(program, a->reference, &source);
    status = movement_read(a->with, a->with_take, attempt, &source);
    if (status == OK)
        warn(program, a->with, &source);
    return status;
}

int reenact_compare(int argc, char **argv)
{
    struct compare_arguments a = {0};
    const struct argp argp = {
        options,
        parse,
        "A --with B",
        "Compare the attempt B with the reference A: where they differ, in words and numbers. Both "
        "are recordings or joints-csv files.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &a);
    struct movement reference = {0}, attempt = {0};
    struct comparison c = {0};
    enum status status = check_output(&a, a.html);
    if (status == OK)
        status = check_output(&a, a.csv);
    if (status == OK)
        status = read_both(argv[0], &a, &reference, &attempt);
    if (status == OK)
        status = comparison_make(&reference, &attempt, &c);
    if (status == OK && a.html)
        status = write_text(a.html, report_html(&c, name_of(a.reference, a.take), name_of(a.with, a.with_take)));
    if (status == OK && a.csv)
        status = write_text(a.csv, report_csv(&c));
    if (status == OK)
        status = write_text(NULL, a.json ? report_json(&c) : report_text(&c));
    movement_free(&reference);
    movement_free(&attempt);
    comparison_free(&c);
    return status == OK ? 0 : command_failed(argv[0]);
}
