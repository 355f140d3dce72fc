// reenact-capture take: renames, deletes, trims and copies takes, and keeps notes on them and what is expected of them.
#include "app/commands/commands.h"
#include "base/status.h"
#include "base/text.h"
#include "capture/take_verdict.h"
#include "compare/expected_take.h"
#include "platform/files/file.h"
#include "recording/recording.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

// ---------------------------------------------------------------- take expect

// reenact-capture take expect: what counts when a take is the reference of a comparison.

enum { EXPECT_OPTIONS_MAX = 32 };

struct expect_arguments {
    const char *file, *take;
    const char *tolerance[EXPECT_OPTIONS_MAX], *ignore[EXPECT_OPTIONS_MAX], *reference[EXPECT_OPTIONS_MAX];
    int tolerances, ignores, references;
    double from_s, to_s; // < 0: not given
    bool clear;          // forget what was expected before
};

static enum status set_options(const struct expect_arguments *arguments, struct expected_take *take)
{
    enum status status = OK;
    for (int i = 0; i < arguments->tolerances && status == OK; i++)
        status = expectation_set_tolerance(&take->expected, arguments->tolerance[i]);
    for (int i = 0; i < arguments->ignores && status == OK; i++)
        status = expectation_ignore(&take->expected, arguments->ignore[i]);
    if (status == OK && (arguments->from_s >= 0 || arguments->to_s >= 0)) {
        const double to_s = take->expected.to_s > 0 ? take->expected.to_s : -1;
        status =
            expectation_set_stretch(&take->expected, arguments->from_s >= 0 ? arguments->from_s : take->expected.from_s,
                                    arguments->to_s >= 0 ? arguments->to_s : to_s, take->seconds);
    }
    return status;
}

// The file's take of that name, as one more reference. NOTHING: it is one already.
static enum status find_reference(const struct expect_arguments *arguments, const char *name,
                                  const struct expected_take *take, int64_t *number)
{
    struct recording *r = NULL;
    enum status status = recording_open(&r, arguments->file);
    *number = status == OK ? recording_take_number(r, name) : -1;
    recording_free(&r);
    if (status == OK && *number < 0)
        status =
            fail(ERR_MISSING, "%s has no take '%s'; reenact-capture info lists those it has", arguments->file, name);
    if (status == OK && *number == take->number)
        status = fail(ERR_INPUT, "take '%s' is the reference itself; a further one is another take", name);
    for (int i = 0; i < take->kept.reference_count && status == OK; i++)
        if (take->kept.reference[i] == *number)
            status = NOTHING;
    if (status == OK && take->kept.reference_count == EXPECTATION_REFERENCES_MAX)
        status = fail(ERR_INPUT, "a take has at most %d further references", EXPECTATION_REFERENCES_MAX);
    return status;
}

// Each is compared with the take, so that another movement is refused here and not when it is used.
static enum status add_references(const struct expect_arguments *arguments, const struct movement *movement,
                                  struct expected_take *take)
{
    enum status status = OK;
    for (int i = 0; i < arguments->references && status == OK; i++) {
        struct movement further = {0};
        struct movement_source source;
        struct reference_spread spread = {.references = 0};
        char quoted[TEXT_SHOWN_BYTES];
        int64_t number;
        status = find_reference(arguments, arguments->reference[i], take, &number);
        if (status == NOTHING) {
            status = OK;
            continue;
        }
        if (status == OK)
            status = movement_read(arguments->file, arguments->reference[i], &further, &source);
        snprintf(quoted, sizeof quoted, "take '%s'", arguments->reference[i]);
        if (status == OK)
            status = reference_spread_add(&spread, movement, &further, &take->expected, quoted);
        if (status == OK)
            take->kept.reference[take->kept.reference_count++] = number;
    }
    return status;
}

static enum status print_expected(const struct expect_arguments *arguments, const struct movement *movement)
{
    struct expectation e;
    struct joint_notes notes;
    char text[EXPECTATION_TEXT_BYTES], shown[TEXT_SHOWN_BYTES];
    const enum status status = expectation_of_take(arguments->file, arguments->take, movement, &e, &notes);
    if (status != OK)
        return status;
    for (int i = 0; i < notes.count; i++)
        fprintf(stderr, "reenact-capture take: warning: %s\n", notes.line[i]);
    text_shown(arguments->take, shown);
    if (expectation_is_empty(&e))
        printf("take '%s': everything counts, as closely as people who do the same exercise right agree\n", shown);
    else
        printf("take '%s': %s\n", shown, expectation_text(&e, text));
    return OK;
}

// Changes what is expected as the arguments say, or nothing where they say nothing, and prints what is expected then.
// On failure the file is as it was. ERR_INPUT: a value cannot be; otherwise as recorded_expectation_write and
// movement_read.
static enum status take_expect(const struct expect_arguments *arguments)
{
    struct movement movement = {0};
    struct movement_source source;
    struct expected_take e = {.number = -1};
    const bool changes = arguments->tolerances || arguments->ignores || arguments->references || arguments->clear ||
                         arguments->from_s >= 0 || arguments->to_s >= 0;
    enum status status = movement_read(arguments->file, arguments->take, &movement, &source);
    if (status == OK)
        status = expected_take_read(arguments->file, arguments->take, &movement, &e);
    const bool had = !take_expectation_is_empty(&e.kept) || e.notes.count;
    if (arguments->clear) {
        e.kept = (struct take_expectation){.ignored = 0};
        e.expected = (struct expectation){.ignored = 0};
    }
    if (status == OK)
        status = set_options(arguments, &e);
    if (status == OK)
        status = add_references(arguments, &movement, &e);
    if (status == OK)
        expectation_to_take(&e.expected, e.first_ns, e.seconds, &e.kept);
    if (status == OK && changes && (had || !take_expectation_is_empty(&e.kept)))
        status = recorded_expectation_write(arguments->file, e.number, &e.kept);
    if (status == OK)
        status = print_expected(arguments, &movement);
    movement_free(&movement);
    return status;
}

// ---------------------------------------------------------------- take

struct take_arguments {
    const char *action, *file, *take, *name, *into, *note, *alias;
    double from_s, to_s;
    bool has_from, has_to, yes;
    struct expect_arguments expect;
};

enum {
    KEY_TAKE = COMMAND_KEY,
    KEY_NAME,
    KEY_INTO,
    KEY_NOTE,
    KEY_ALIAS,
    KEY_FROM,
    KEY_TO,
    KEY_YES,
    KEY_TOLERANCE,
    KEY_IGNORE,
    KEY_REFERENCE,
    KEY_CLEAR
};

static void add_value(struct argp_state *state, const char *option, const char **values, int *count, const char *value)
{
    if (*count == EXPECT_OPTIONS_MAX)
        argp_error(state, "%s is given more than %d times", option, EXPECT_OPTIONS_MAX);
    values[(*count)++] = value;
}

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct take_arguments *a = state->input;
    switch (key) {
    case KEY_TAKE: a->take = value; return 0;
    case KEY_NAME: a->name = value; return 0;
    case KEY_INTO: a->into = value; return 0;
    case KEY_NOTE: a->note = value; return 0;
    case KEY_ALIAS: a->alias = value; return 0;
    case KEY_FROM:
        a->from_s = command_parse_number(state, "--from", value, 0, 1e6);
        a->has_from = true;
        return 0;
    case KEY_TO:
        a->to_s = command_parse_number(state, "--to", value, 0, 1e6);
        a->has_to = true;
        return 0;
    case KEY_YES: a->yes = true; return 0;
    case KEY_TOLERANCE: add_value(state, "--tolerance", a->expect.tolerance, &a->expect.tolerances, value); return 0;
    case KEY_IGNORE: add_value(state, "--ignore", a->expect.ignore, &a->expect.ignores, value); return 0;
    case KEY_REFERENCE: add_value(state, "--reference", a->expect.reference, &a->expect.references, value); return 0;
    case KEY_CLEAR: a->expect.clear = true; return 0;
    case ARGP_KEY_ARG:
        if (!a->action)
            a->action = value;
        else if (a->file && !a->take)
            a->take = value;
        else
            command_take_file(state, &a->file, value);
        return 0;
    case ARGP_KEY_END:
        command_require(state, a->action, "rename, delete, trim, copy, note or expect");
        command_require(state, a->file, "FILE");
        command_require(state, a->take, "--take NAME");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// ------------------------------------------------------------- asking first

static bool has_take(const struct take_arguments *arguments)
{
    struct recording *r;
    bool has = false;
    if (recording_open(&r, arguments->file) != OK)
        return false;
    for (int i = 0; i < recording_take_count(r); i++)
        has |= !strcmp(recording_take_name(r, i), arguments->take);
    recording_free(&r);
    return has;
}

// Asked on a terminal only: a script cannot answer. What is not there is not asked for; the action says so.
static bool is_meant(const struct take_arguments *arguments, const char *what, const char *images)
{
    char take[TEXT_SHOWN_BYTES], file[TEXT_SHOWN_BYTES], answer[8] = "";
    if (arguments->yes || !isatty(STDIN_FILENO) || !isatty(STDERR_FILENO) || !has_take(arguments))
        return true;
    fprintf(stderr, "%s take '%s' of %s? %s overwritten and cannot be brought back. [y/N] ", what,
            text_shown(arguments->take, take), text_shown(arguments->file, file), images);
    if (!fgets(answer, sizeof answer, stdin))
        fputc('\n', stderr);
    return !strcasecmp(answer, "y\n") || !strcasecmp(answer, "yes\n");
}

// ------------------------------------------------------------- the actions

static enum status rename_take(const struct take_arguments *arguments)
{
    enum status status = recording_rename_take(arguments->file, arguments->take, arguments->name);
    if (status == OK)
        printf("take '%s' is now '%s'\n", arguments->take, arguments->name);
    return status;
}

static enum status delete_take(const struct take_arguments *arguments)
{
    int64_t freed;
    if (!is_meant(arguments, "Delete", "Its images are"))
        return NOTHING;
    enum status status = recording_delete_take(arguments->file, arguments->take, &freed);
    if (status == OK)
        printf("take '%s' is deleted, its bytes are overwritten; %.1f MB are free again\n", arguments->take,
               (double)freed / 1e6);
    return status;
}

// The take is changed already: what it is worth now is a matter of its own.
static enum status judge_anew(const char *file, const char *take, const struct take_filming *filming)
{
    char text[VERDICT_TEXT_BYTES];
    struct take_judgement judgement;
    const enum status status = take_verdict_keep(file, take, filming, &judgement);
    if (status == OK)
        printf("verdict: %s\n", verdict_text(&judgement.verdict, text));
    return status;
}

static enum status trim_take(const struct take_arguments *arguments)
{
    int64_t freed;
    if (!is_meant(arguments, "Trim", "The images that are cut off are"))
        return NOTHING;
    enum status status = recording_trim_take(arguments->file, arguments->take, (int64_t)(arguments->from_s * 1e9),
                                             arguments->has_to ? (int64_t)(arguments->to_s * 1e9) : INT64_MAX, &freed);
    if (status == OK)
        printf("take '%s' is trimmed, the other frames' bytes are overwritten; %.1f MB are free again\n",
               arguments->take, (double)freed / 1e6);
    return status == OK ? judge_anew(arguments->file, arguments->take, NULL) : status;
}

// Damage is no reason not to copy the rest, but one to say what it cost.
static void warn_of_lost(const struct take_copy_report *report)
{
    const struct {
        int64_t count;
        const char *what;
    } lost[] = {{report->lost_frames, "frames of the take"},
                {report->damaged_frames, "frames' images"},
                {report->lost_covariances, "frames' covariances of the joints"},
                {report->lost_views, "views of the place"},
                {report->lost_things, "things in the place or their pictures"}};
    for (size_t i = 0; i < COUNT_OF(lost); i++)
        if (lost[i].count)
            fprintf(stderr, "reenact-capture take: warning: %lld %s are lost to damage\n", (long long)lost[i].count,
                    lost[i].what);
    if (report->lost_map_covariances)
        fputs("reenact-capture take: warning: covariances or viewing directions of the place are lost to damage\n",
              stderr);
}

static enum status copy_take(const struct take_arguments *arguments)
{
    struct take_copy_report report;
    const char *to = arguments->into ? arguments->into : arguments->file,
               *name = arguments->name ? arguments->name : arguments->take;
    enum status status = file_exists(to) ? OK : recording_check_new(to);
    if (status == OK)
        status = recording_copy_take(arguments->file, arguments->take, to, name, &report);
    if (status == OK) {
        printf("%s: take '%s' is a copy of '%s'%s\n", to, name, arguments->take,
               report.place_differs ? "; the place there is another one, so the copy does not know where it was filmed"
                                    : "");
        warn_of_lost(&report);
    }
    return status;
}

static enum status annotate_take(const struct take_arguments *arguments)
{
    return recording_annotate_take(arguments->file, arguments->take, arguments->note, arguments->alias);
}

static enum status expect_of_take(const struct take_arguments *arguments)
{
    struct expect_arguments e = arguments->expect;
    e.file = arguments->file;
    e.take = arguments->take;
    e.from_s = arguments->has_from ? arguments->from_s : -1;
    e.to_s = arguments->has_to ? arguments->to_s : -1;
    return take_expect(&e);
}

// NOTHING: the user thought better of it.
static const struct action {
    const char *name;
    enum status (*run)(const struct take_arguments *a);
} actions[] = {{"rename", rename_take}, {"delete", delete_take}, {"trim", trim_take},
               {"copy", copy_take},     {"note", annotate_take}, {"expect", expect_of_take}};

static const char *wrong_usage(const struct take_arguments *arguments)
{
    if (!strcmp(arguments->action, "rename") && !arguments->name)
        return "--name NEW is needed";
    if (!strcmp(arguments->action, "trim") && !arguments->has_from && !arguments->has_to)
        return "--from S, --to S or both are needed";
    if (!strcmp(arguments->action, "copy") && !arguments->into && !arguments->name)
        return "--into FILE, --name NEW or both are needed";
    if (!strcmp(arguments->action, "note") && !arguments->note && !arguments->alias)
        return "--note TEXT, --alias NAME or both are needed";
    return NULL;
}

int capture_take(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"take", KEY_TAKE, "NAME", 0, "the take", 0},
        {"name", KEY_NAME, "NEW", 0, "rename, copy: the new name", 0},
        {"into", KEY_INTO, "FILE", 0, "copy: into this recording, which is made where there is none", 0},
        {"from", KEY_FROM, "S", 0, "trim: the first second that stays; expect: that counts", 0},
        {"to", KEY_TO, "S", 0, "trim, expect: the last one", 0},
        {"yes", KEY_YES, NULL, 0, "delete, trim: do not ask on a terminal whether it is meant", 0},
        {"note", KEY_NOTE, "TEXT", 0, "note: one line about the take; an empty one removes it", 0},
        {"alias", KEY_ALIAS, "NAME", 0, "note: who performs, under another name than the person's own", 0},
        {"tolerance", KEY_TOLERANCE, "PART=DEGREES", 0,
         "expect: how far off a part may be, like knees=20 or all=15; repeatable", 0},
        {"ignore", KEY_IGNORE, "PART", 0, "expect: a part of the body that does not matter, like head; repeatable", 0},
        {"reference", KEY_REFERENCE, "NAME", 0,
         "expect: a further take that is right, too: what they differ by is the tolerance; repeatable", 0},
        {"clear", KEY_CLEAR, NULL, 0, "expect: forget what was expected before", 0},
        {0},
    };
    static const struct argp argp = {
        options,
        parse_option,
        "rename|delete|trim|copy|note|expect FILE",
        "Changes the takes of a recording.\v"
        "Each is done whole or not at all, but for a copy into a file that was there: where that breaks off, the take "
        "is marked as interrupted. What delete and trim remove is overwritten with zeros and the file made "
        "smaller, which takes as much room on the disk again while it runs. On a terminal both ask first; where nobody "
        "can answer, as in a script, they do not.\n"
        "expect says what counts when the take is the reference of a comparison, added to what was expected before, "
        "and "
        "prints it; its seconds are those of a comparison, from the first frame with a person on.",
        0,
        0,
        0};
    struct take_arguments a = {0};
    command_parse(&argp, argc, argv, &a);
    for (size_t i = 0; i < COUNT_OF(actions); i++) {
        if (strcmp(a.action, actions[i].name))
            continue;
        const char *wrong = wrong_usage(&a);
        if (wrong) {
            fprintf(stderr, "%s %s: %s\n", argv[0], a.action, wrong);
            return 2;
        }
        const enum status status = actions[i].run(&a);
        if (status == NOTHING)
            fprintf(stderr, "%s: the take stays as it is\n", argv[0]);
        if (status == OK)
            return 0;
        return status == NOTHING ? 1 : command_failed(argv[0]);
    }
    const char *names[COUNT_OF(actions)];
    for (size_t i = 0; i < COUNT_OF(actions); i++)
        names[i] = actions[i].name;
    return command_unknown(argv[0], "action", a.action, names, COUNT_OF(actions));
}
