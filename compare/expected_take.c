#include "compare/expected_take.h"

#include "base/text.h"
#include "compare/movement.h"

#include <stdio.h>

enum { NAME_BYTES = 256 }; // longer than a take's name can be

static bool is_fatal(enum status status) { return status == ERR_MEMORY || status == ERR_IO; }

static enum status read_kept(const struct take *take, const struct movement *reference, struct expected_take *out)
{
    const int64_t first = take_first_sample(take);
    if (first < 0)
        return fail(ERR_INPUT, "no person was tracked in the take");
    out->number = take_number(take);
    out->first_ns = take_entry(take, first)->time_ns;
    out->seconds = reference->count / MOVEMENT_RATE_HZ;
    const enum status status = recorded_expectation_read(take, &out->kept);
    if (status == ERR_CORRUPT)
        joint_note(&out->notes,
                   "what is expected of the take is damaged and left out; reenact-capture take expect sets "
                   "it again");
    if (!expectation_from_take(&out->kept, out->first_ns, out->seconds, &out->expected))
        joint_note(&out->notes, "nothing is left of the stretch that counts, so all of the take does");
    return is_fatal(status) ? status : OK;
}

enum status expected_take_read(const char *path, const char *take, const struct movement *reference,
                               struct expected_take *out)
{
    struct recording *r = NULL;
    struct take *t = NULL;
    *out = (struct expected_take){.number = -1};
    enum status status = recording_open(&r, path);
    if (status == OK && !take && !recording_take_count(r))
        status = fail(ERR_INPUT, "%s holds no take", path);
    if (status == OK)
        status = take_open(&t, r, take ? take : recording_take_name(r, 0));
    if (status == OK)
        status = read_kept(t, reference, out);
    take_close(&t);
    recording_free(&r);
    if (status != OK)
        *out = (struct expected_take){.number = -1};
    return status;
}

// "": the file has no such take.
static enum status find_name(const char *path, int64_t number, char name[NAME_BYTES])
{
    struct recording *r = NULL;
    const enum status status = recording_open(&r, path);
    const char *found = status == OK ? recording_numbered_take(r, number) : NULL;
    snprintf(name, NAME_BYTES, "%s", found ? found : "");
    recording_free(&r);
    return status;
}

enum status expected_take_measure(const char *path, const struct movement *reference, struct expected_take *e,
                                  struct reference_spread *spread)
{
    enum status status = OK;
    for (int i = 0; i < e->kept.reference_count && !is_fatal(status); i++) {
        char name[NAME_BYTES], quoted[NAME_BYTES + 16];
        struct movement further = {0};
        struct movement_source source;
        status = find_name(path, e->kept.reference[i], name);
        if (status != OK || !*name)
            continue;
        snprintf(quoted, sizeof quoted, "take '%s'", name);
        status = movement_read(path, name, &further, &source);
        if (status == OK)
            status = reference_spread_add(spread, reference, &further, &e->expected, quoted);
        if (status != OK && !is_fatal(status))
            joint_note(&e->notes, "further reference '%s' is left out: %s", name, status_message());
    }
    return is_fatal(status) ? status : OK;
}

enum status expectation_of_take(const char *path, const char *take, const struct movement *reference,
                                struct expectation *out, struct joint_notes *notes)
{
    struct expected_take e;
    struct reference_spread spread = {.references = 0};
    *out = (struct expectation){.ignored = 0};
    *notes = (struct joint_notes){.count = 0};
    if (is_joints_file(path))
        return OK;
    enum status status = expected_take_read(path, take, reference, &e);
    if (status == OK)
        status = expected_take_measure(path, reference, &e, &spread);
    if (status != OK)
        return status;
    if (spread.references)
        reference_spread_put(&spread, &e.expected);
    *out = e.expected;
    *notes = e.notes;
    return OK;
}
