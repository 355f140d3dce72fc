// Verifies a recording: its structure, counts, checksums, images, order of times and ranges.
#include "recording/recorded_drive.h"
#include "recording/recorded_things.h"
#include "recording/recorded_verdict.h"
#include "recording/recording_reader.h"

#include "base/text.h"

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
static void note(struct verification *v, enum status status)
{
    if (status == ERR_CORRUPT || status == ERR_INPUT || status == ERR_FORMAT)
        add_finding(v->report);
    else if (status < 0 && v->first_error.status == OK)
        failure_keep(&v->first_error, status);
}

static const char *path_of(const struct verification *v) { return recording_path(v->r); }

static bool may_go_on(const struct verification *v) { return v->first_error.status == OK; }

// ------------------------------------------------------------- the place

static void check_place(struct verification *v)
{
    struct place place;
    enum status status = recording_read_place(v->r, &place);
    note(v, status);
    v->report->lost_place = status == ERR_CORRUPT;
    if (status != OK)
        return;
    int32_t undecodable = 0;
    v->report->lost_views = place.views_lost;
    v->report->lost_map_covariances = place.errors_lost;
    if (place.views_lost)
        note(v, fail(ERR_CORRUPT, "%s: %d of %d views of the place are damaged or missing", path_of(v),
                     (int)place.views_lost, (int)(place.views_lost + place.view_count)));
    if (place.errors_lost)
        note(v, fail(ERR_CORRUPT, "%s: covariances or viewing directions of the place's points and tags are damaged",
                     path_of(v)));
    note(v, place_drop_undecodable_views(&place, &undecodable));
    v->report->lost_views += undecodable;
    if (undecodable)
        note(v, fail(ERR_CORRUPT, "%s: the images of %d views of the place cannot be decoded", path_of(v),
                     (int)undecodable));
    place_free(&place);
}

// ------------------------------------------------------------- the takes

static void check_frames(struct verification *v, struct take *t, const char *name)
{
    for (int64_t i = 0; i < take_frame_count(t) && may_go_on(v); i++) {
        struct take_images images;
        const struct take_entry *e = take_entry(t, i);
        enum status status = take_read(t, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
        if (status == OK && e->has_skeleton && !skeleton_is_in_range(&e->skeleton))
            status = fail(ERR_CORRUPT, "%s: take '%s', frame %d: a confidence is not between 0 and 1", path_of(v), name,
                          (int)e->row_number);
        note(v, status);
        v->report->frames++;
        v->report->damaged_frames += status != OK;
    }
}

static void check_take(struct verification *v, int index)
{
    const char *name = recording_take_name(v->r, index);
    struct take *t;
    if (recording_find_take(v->r, name) != index) { // take_open would open the first again
        note(v, fail(ERR_CORRUPT, "%s has two takes '%s'", path_of(v), name));
        return;
    }
    v->report->takes++;
    enum status status = take_open(&t, v->r, name);
    note(v, status);
    v->report->lost_takes += status == ERR_CORRUPT;
    if (status != OK)
        return;
    if (!*name)
        note(v, fail(ERR_CORRUPT, "%s has a take without a name", path_of(v)));
    else if (!recording_take_name_is_valid(v->r, index))
        note(v, fail(ERR_CORRUPT, "%s: the name of take '%s' is too long, or holds what is no UTF-8 or not shown",
                     path_of(v), name));
    if (take_is_out_of_range(t))
        note(v, fail(ERR_CORRUPT,
                     "%s: the body, the calibration or a note of take '%s' holds what is out of range or not shown",
                     path_of(v), name));
    if (take_uncounted(t))
        note(v, fail(ERR_CORRUPT, "%s: take '%s' holds %lld frames more than it is said to have", path_of(v), name,
                     (long long)take_uncounted(t)));
    v->report->interrupted_takes += !take_is_complete(t);
    const int64_t lost = take_lost_now(t);
    v->report->lost_frames += lost;
    if (lost)
        note(v, fail(ERR_CORRUPT, "%s: %lld frames of take '%s' are damaged or missing", path_of(v), (long long)lost,
                     name));
    v->report->lost_covariances += take_errors_lost(t);
    if (take_errors_lost(t))
        note(v, fail(ERR_CORRUPT, "%s: the joints' covariances of %lld frames of take '%s' are damaged", path_of(v),
                     (long long)take_errors_lost(t), name));
    if (take_dropped(t) < 0 || take_lost(t) < 0)
        note(v, fail(ERR_CORRUPT, "%s: take '%s' counts less than no dropped or lost frames", path_of(v), name));
    check_frames(v, t, name);
    take_close(&t);
}

// ------------------------------------------------------------- rows that belong to nothing

// The id of a row is what ties it to others. A damaged one leaves rows behind that belong to nothing.
static void check_orphans(struct verification *v)
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
    for (size_t i = 0; i < COUNT_OF(checks) && may_go_on(v); i++) {
        int64_t count = 0;
        bool there = true;
        enum status status = i == 2 ? recording_has_joint_errors(recording_database(v->r), &there) : OK;
        if (status == OK && there)
            status = database_number(recording_database(v->r), checks[i].sql, &count);
        if (status == OK && count)
            status = fail(ERR_CORRUPT, "%s: %lld %s", path_of(v), (long long)count, checks[i].what);
        note(v, status);
        v->report->lost_frames += i == 0 ? count : 0;
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

static void check_things(struct verification *v)
{
    struct recorded_thing *things;
    struct things_lost lost;
    int count;
    note(v, recording_salvage_things(v->r, &things, &count, &lost));
    v->report->lost_things = lost.things + lost.contents;
    if (lost.things)
        note(v, fail(ERR_CORRUPT, "%s: %d of the place's things are damaged", path_of(v), lost.things));
    if (lost.contents)
        note(v, fail(ERR_CORRUPT, "%s: %d pictures or models of the place's things are damaged", path_of(v),
                     lost.contents));
    recorded_things_free(&things, count);
}

static void check_drive(struct verification *v)
{
    struct recorded_drive drive;
    note(v, recording_read_drive(v->r, &drive));
}

static void check_verdicts(struct verification *v)
{
    int64_t damaged;
    note(v, recorded_verdict_check(v->r, &damaged));
    if (damaged)
        note(v, fail(ERR_CORRUPT, "%s: the verdicts on %lld takes are damaged", path_of(v), (long long)damaged));
}

static enum status verify(struct recording *r, struct recording_report *out)
{
    struct verification v = {.r = r, .report = out};
    out->bytes = recording_bytes(recording_path(r));
    note(&v, database_check(recording_database(r)));
    if (may_go_on(&v))
        check_place(&v);
    if (may_go_on(&v))
        check_things(&v);
    check_drive(&v);
    check_verdicts(&v);
    for (int i = 0; i < recording_take_count(r) && may_go_on(&v); i++)
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
        status = verify(r, out);
    struct failure first;
    failure_keep(&first, status);
    if (database_in_transaction(recording_database(r)))
        status = database_run(recording_database(r), "COMMIT");
    recording_free(&r);
    return first.status == OK ? status : failure_restore(&first);
}
