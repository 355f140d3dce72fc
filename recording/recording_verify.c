// Verifies a recording: its structure, counts, checksums, images, order of times and ranges.
#include "base/text.h"
#include "recording/recorded_things.h"
#include "recording/recorded_verdict.h"
#include "recording/recording_reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

struct verification {
    struct recording *r;
    struct recording_report *report;
    enum status status; // the first that is no damage: memory, disk
    struct failure first_error;
};

// Adds this thread's sentence to the findings; verification continues.
static void add_finding(struct recording_report *out)
{
    if (out->findings < RECORDING_FINDINGS_MAX)
        snprintf(out->finding[out->findings], sizeof out->finding[0], "%.199s", status_message());
    out->findings++;
}

// Notes what went wrong. Damage is a finding; lack of memory and the like end the verification.
static void note_status(struct verification *verification, enum status status)
{
    if (status == ERR_CORRUPT || status == ERR_INPUT || status == ERR_FORMAT)
        add_finding(verification->report);
    else if (status < 0 && verification->first_error.status == OK)
        failure_keep(&verification->first_error, status);
}

static const char *path_of(const struct verification *verification) { return recording_path(verification->r); }

static bool may_go_on(const struct verification *verification) { return verification->first_error.status == OK; }

// ------------------------------------------------------------- the place

static void check_place(struct verification *verification)
{
    struct place place;
    enum status status = recording_read_place(verification->r, &place);
    note_status(verification, status);
    verification->report->lost_place = status == ERR_CORRUPT;
    if (status != OK)
        return;
    int32_t undecodable = 0;
    verification->report->lost_views = place.views_lost;
    verification->report->lost_map_covariances = place.errors_lost;
    if (place.views_lost)
        note_status(verification,
                    fail(ERR_CORRUPT, "%s: %d of %d views of the place are damaged or missing", path_of(verification),
                         (int)place.views_lost, (int)(place.views_lost + place.view_count)));
    if (place.errors_lost)
        note_status(verification,
                    fail(ERR_CORRUPT,
                         "%s: covariances or viewing directions of the place's points and tags are damaged",
                         path_of(verification)));
    note_status(verification, place_drop_undecodable_views(&place, &undecodable));
    verification->report->lost_views += undecodable;
    if (undecodable)
        note_status(verification, fail(ERR_CORRUPT, "%s: the images of %d views of the place cannot be decoded",
                                       path_of(verification), (int)undecodable));
    place_free(&place);
}

// ------------------------------------------------------------- the takes

static void check_frames(struct verification *verification, struct take *take, const char *name)
{
    for (int64_t i = 0; i < take_frame_count(take) && may_go_on(verification); i++) {
        struct take_images images;
        const struct take_entry *e = take_entry(take, i);
        enum status status = take_read(take, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
        if (status == OK && e->has_skeleton && !skeleton_is_in_range(&e->skeleton))
            status = fail(ERR_CORRUPT, "%s: take '%s', frame %d: a confidence is not between 0 and 1",
                          path_of(verification), name, (int)e->row_number);
        note_status(verification, status);
        verification->report->frames++;
        verification->report->damaged_frames += status != OK;
    }
}

static void check_take(struct verification *verification, int index)
{
    const char *name = recording_take_name(verification->r, index);
    struct take *t;
    if (recording_find_take(verification->r, name) != index) { // take_open would open the first again
        note_status(verification, fail(ERR_CORRUPT, "%s has two takes '%s'", path_of(verification), name));
        return;
    }
    verification->report->takes++;
    enum status status = take_open(&t, verification->r, name);
    note_status(verification, status);
    verification->report->lost_takes += status == ERR_CORRUPT;
    if (status != OK)
        return;
    if (!*name)
        note_status(verification, fail(ERR_CORRUPT, "%s has a take without a name", path_of(verification)));
    else if (!recording_take_name_is_valid(verification->r, index))
        note_status(verification,
                    fail(ERR_CORRUPT, "%s: the name of take '%s' is too long, or holds what is no UTF-8 or not shown",
                         path_of(verification), name));
    if (take_is_out_of_range(t))
        note_status(verification,
                    fail(ERR_CORRUPT,
                         "%s: the body, the calibration or a note of take '%s' holds what is out of range or not shown",
                         path_of(verification), name));
    if (take_uncounted(t))
        note_status(verification, fail(ERR_CORRUPT, "%s: take '%s' holds %lld frames more than it is said to have",
                                       path_of(verification), name, (long long)take_uncounted(t)));
    verification->report->interrupted_takes += !take_is_complete(t);
    const int64_t lost = take_lost_now(t);
    verification->report->lost_frames += lost;
    if (lost)
        note_status(verification, fail(ERR_CORRUPT, "%s: %lld frames of take '%s' are damaged or missing",
                                       path_of(verification), (long long)lost, name));
    verification->report->lost_covariances += take_errors_lost(t);
    if (take_errors_lost(t))
        note_status(verification,
                    fail(ERR_CORRUPT, "%s: the joints' covariances of %lld frames of take '%s' are damaged",
                         path_of(verification), (long long)take_errors_lost(t), name));
    if (take_dropped(t) < 0 || take_lost(t) < 0)
        note_status(verification, fail(ERR_CORRUPT, "%s: take '%s' counts less than no dropped or lost frames",
                                       path_of(verification), name));
    check_frames(verification, t, name);
    take_close(&t);
}

// ------------------------------------------------------------- rows that belong to nothing

// The id of a row is what ties it to others. A damaged one leaves rows behind that belong to nothing.
static void check_orphans(struct verification *verification)
{
    static const struct {
        const char *sql, *what;
    } checks[] = {
        {"SELECT count(*) FROM frame WHERE (rowid >> 32) NOT IN (SELECT rowid FROM take)",
         "frames belong to no take: a take's or a frame's number is damaged"},
        {"SELECT count(*) FROM picture WHERE rowid NOT IN (SELECT rowid FROM frame WHERE pictures <> 0)",
         "frames' images belong to no frame: a frame's number is damaged, or rows are missing"},
        {"SELECT count(*) FROM joint_error WHERE rowid NOT IN (SELECT rowid FROM frame)",
         "frames' covariances belong to no frame"},
    };
    for (size_t i = 0; i < COUNT_OF(checks) && may_go_on(verification); i++) {
        int64_t count = 0;
        bool there = true;
        enum status status = i == 2 ? recording_has_joint_errors(recording_database(verification->r), &there) : OK;
        if (status == OK && there)
            status = database_number(recording_database(verification->r), checks[i].sql, &count);
        if (status == OK && count)
            status = fail(ERR_CORRUPT, "%s: %lld %s", path_of(verification), (long long)count, checks[i].what);
        note_status(verification, status);
        verification->report->lost_frames += i == 0 ? count : 0;
    }
}

// ------------------------------------------------------------- the file

int64_t recording_bytes(const char *path)
{
    static const char *const endings[] = {"", "-wal"};
    int64_t bytes = 0;
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char *name = database_beside(path, endings[i]);
        struct stat info;
        if (name && !stat(name, &info))
            bytes += info.st_size;
        free(name);
    }
    return bytes;
}

static void check_things(struct verification *verification)
{
    struct recorded_thing *things;
    struct things_lost lost;
    int count;
    note_status(verification, recording_salvage_things(verification->r, &things, &count, &lost));
    verification->report->lost_things = lost.things + lost.contents;
    if (lost.things)
        note_status(verification,
                    fail(ERR_CORRUPT, "%s: %d of the place's things are damaged", path_of(verification), lost.things));
    if (lost.contents)
        note_status(verification, fail(ERR_CORRUPT, "%s: %d pictures or models of the place's things are damaged",
                                       path_of(verification), lost.contents));
    recorded_things_free(&things, count);
}

static void check_drive(struct verification *verification)
{
    struct recorded_drive drive;
    note_status(verification, recording_read_drive(verification->r, &drive));
}

static void check_verdicts(struct verification *verification)
{
    int64_t damaged;
    note_status(verification, recorded_verdict_check(verification->r, &damaged));
    if (damaged)
        note_status(verification, fail(ERR_CORRUPT, "%s: the verdicts on %lld takes are damaged", path_of(verification),
                                       (long long)damaged));
}

static void check_expectations(struct verification *verification)
{
    int64_t damaged;
    note_status(verification, recorded_expectation_check(verification->r, &damaged));
    if (damaged)
        note_status(verification, fail(ERR_CORRUPT, "%s: what is expected of %lld takes is damaged",
                                       path_of(verification), (long long)damaged));
}

static enum status verify_recording(struct recording *recording, struct recording_report *out)
{
    struct verification v = {.r = recording, .report = out};
    out->bytes = recording_bytes(recording_path(recording));
    note_status(&v, database_check(recording_database(recording)));
    if (may_go_on(&v))
        check_place(&v);
    if (may_go_on(&v))
        check_things(&v);
    check_drive(&v);
    check_verdicts(&v);
    check_expectations(&v);
    for (int i = 0; i < recording_take_count(recording) && may_go_on(&v); i++)
        check_take(&v, i);
    if (may_go_on(&v))
        check_orphans(&v);
    if (!may_go_on(&v))
        return failure_restore(&v.first_error);
    return out->findings ? fail(ERR_CORRUPT, "%s", out->finding[0]) : OK;
}

enum status recording_verify(const char *path, struct recording_report *out)
{
    *out = (struct recording_report){0};
    struct recording *r;
    enum status status = recording_open(&r, path);
    if (status != OK)
        return status;
    // One transaction: what is counted must not change meanwhile because a writer commits.
    status = database_run(recording_database(r), "BEGIN");
    if (status == OK)
        status = verify_recording(r, out);
    struct failure first;
    failure_keep(&first, status);
    if (database_in_transaction(recording_database(r)))
        status = database_run(recording_database(r), "COMMIT");
    recording_free(&r);
    return first.status == OK ? status : failure_restore(&first);
}
