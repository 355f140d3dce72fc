#include "app/commands/capture_take_expect.h"

#include "base/text.h"
#include "compare/expected_take.h"

#include <stdio.h>
#include <string.h>

static enum status set_options(const struct expect_arguments *arguments, struct expected_take *e)
{
    enum status status = OK;
    for (int i = 0; i < arguments->tolerances && status == OK; i++)
        status = expectation_set_tolerance(&e->expected, arguments->tolerance[i]);
    for (int i = 0; i < arguments->ignores && status == OK; i++)
        status = expectation_ignore(&e->expected, arguments->ignore[i]);
    if (status == OK && (arguments->from_s >= 0 || arguments->to_s >= 0)) {
        const double to_s = e->expected.to_s > 0 ? e->expected.to_s : -1;
        status = expectation_set_stretch(&e->expected, arguments->from_s >= 0 ? arguments->from_s : e->expected.from_s,
                                         arguments->to_s >= 0 ? arguments->to_s : to_s, e->seconds);
    }
    return status;
}

// The file's take of that name, as one more reference. NOTHING: it is one already.
static enum status find_reference(const struct expect_arguments *arguments, const char *name,
                                  const struct expected_take *e, int64_t *number)
{
    struct recording *r = NULL;
    enum status status = recording_open(&r, arguments->file);
    *number = status == OK ? recording_take_number(r, name) : -1;
    recording_free(&r);
    if (status == OK && *number < 0)
        status =
            fail(ERR_MISSING, "%s has no take '%s'; reenact-capture info lists those it has", arguments->file, name);
    if (status == OK && *number == e->number)
        status = fail(ERR_INPUT, "take '%s' is the reference itself; a further one is another take", name);
    for (int i = 0; i < e->kept.reference_count && status == OK; i++)
        if (e->kept.reference[i] == *number)
            status = NOTHING;
    if (status == OK && e->kept.reference_count == EXPECTATION_REFERENCES_MAX)
        status = fail(ERR_INPUT, "a take has at most %d further references", EXPECTATION_REFERENCES_MAX);
    return status;
}

// Each is compared with the take, so that another movement is refused here and not when it is used.
static enum status add_references(const struct expect_arguments *arguments, const struct movement *movement,
                                  struct expected_take *e)
{
    enum status status = OK;
    for (int i = 0; i < arguments->references && status == OK; i++) {
        struct movement further = {0};
        struct movement_source source;
        struct reference_spread spread = {.references = 0};
        char quoted[TEXT_SHOWN_BYTES];
        int64_t number;
        status = find_reference(arguments, arguments->reference[i], e, &number);
        if (status == NOTHING) {
            status = OK;
            continue;
        }
        if (status == OK)
            status = movement_read(arguments->file, arguments->reference[i], &further, &source);
        snprintf(quoted, sizeof quoted, "take '%s'", arguments->reference[i]);
        if (status == OK)
            status = reference_spread_add(&spread, movement, &further, &e->expected, quoted);
        if (status == OK)
            e->kept.reference[e->kept.reference_count++] = number;
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

enum status take_expect(const struct expect_arguments *arguments)
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
