// Saves what can be read of a damaged recording into a new one.
#include "base/text.h"
#include "platform/files/file.h"
#include "recording/frame_copier.h"
#include "recording/recorded_things.h"
#include "recording/recording_reader.h"
#include "recording/recording_schema.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { LOST_TAKES_MAX = 100, TAKES_MAX = 100000 }; // consecutive unreadable take rows that end the search; by hand

// Ids of takes.
struct id_list {
    int64_t *ids;
    int count;
};

struct repair {
    struct database *from, *to;
    struct async_writer *writer;
    struct frame_copier *copier;
    struct statement *takes;
    struct id_list rows;   // that have a row in the table take
    struct id_list filmed; // that have frames
    struct id_list used;   // whose frames are saved
    struct id_list names;  // count: takes written so far
    char (*written)[TAKE_NAME_BYTES + 1];
    struct calibration calibration; // of a take that was sound, or of the place; for takes that lost theirs
    bool has_calibration;
    struct recording_report *report;
};

static bool is_fatal(enum status status) { return status == ERR_MEMORY; }

static bool has_id(const struct id_list *list, int64_t id)
{
    for (int i = 0; i < list->count; i++)
        if (list->ids[i] == id)
            return true;
    return false;
}

static enum status add_id(struct id_list *list, int64_t id)
{
    if (has_id(list, id) || list->count >= TAKES_MAX)
        return OK;
    int64_t *grown = realloc(list->ids, sizeof *grown * ((size_t)list->count + 1));
    if (!grown)
        return fail(ERR_MEMORY, "no memory to repair a recording");
    list->ids = grown;
    grown[list->count++] = id;
    return OK;
}

// Adds the numbers that the statement selects, as far as they can be read.
static enum status list_ids(struct database *db, const char *sql, struct id_list *out)
{
    struct statement *s;
    enum status status = statement_open(&s, db, sql);
    while (status == OK && (status = statement_step(s)) == OK)
        if (take_id_is_valid(statement_number(s, 0)))
            status = add_id(out, statement_number(s, 0));
    statement_close(&s);
    return is_fatal(status) ? status : OK;
}

// ------------------------------------------------------------- one take

// The id of a take whose row is damaged: one that differs in one bit and fits the seal, or, in an older file, that has
// frames but no row.
static int64_t true_id(struct repair *repair, const struct take_row *row, int64_t crc, bool sealed, int64_t seal)
{
    if (sealed ? take_seal(row, (uint32_t)crc) == seal : has_id(&repair->filmed, row->id))
        return row->id;
    struct take_row other = *row;
    for (int bit = 0; bit < 31; bit++) {
        other.id = row->id ^ (int64_t)1 << bit;
        if (take_id_is_valid(other.id) &&
            (sealed ? take_seal(&other, (uint32_t)crc) == seal
                    : has_id(&repair->filmed, other.id) && !has_id(&repair->rows, other.id)))
            return other.id;
    }
    return row->id;
}

// Another name where it is lost or in use: a damaged bit can make one name another's.
static void choose_name(const struct repair *repair, struct take_row *take)
{
    char wanted[TAKE_NAME_BYTES + 1];
    text_make_printable(take->name);
    if (!*take->name)
        snprintf(take->name, sizeof take->name, "take %lld", (long long)take->id);
    memcpy(wanted, take->name, sizeof wanted);
    for (int n = 2, i = 0; i < repair->names.count; i++)
        if (!strcmp(repair->written[i], take->name)) {
            snprintf(take->name, sizeof take->name, "%.180s (%d)", wanted, n++);
            text_make_printable(take->name); // the cut may have split a character
            i = -1;
        }
}

static enum status keep_name(struct repair *repair, const char *name)
{
    char(*grown)[TAKE_NAME_BYTES + 1] = realloc(repair->written, sizeof *grown * ((size_t)repair->names.count + 1));
    if (!grown)
        return fail(ERR_MEMORY, "no memory to repair %s", database_path(repair->from));
    repair->written = grown;
    snprintf(grown[repair->names.count++], sizeof *grown, "%s", name);
    return OK;
}

// whole: its row is as it was written.
static enum status save_take(struct repair *repair, struct take_row *take, bool whole)
{
    struct frame_copy_counts counts;
    choose_name(repair, take);
    enum status status = whole ? OK : frame_copier_infer_sizes(repair->copier, take);
    if (status == OK)
        status = frame_copier_copy(repair->copier, take, take->id, true, &counts);
    if (status != OK)
        return status;
    struct recording_report *r = repair->report;
    if (!counts.saved) { // an empty take is of no use
        r->lost_frames += counts.lost;
        r->lost_takes += take->frames != 0 && counts.lost;
        return add_id(&repair->used, take->id);
    }
    r->takes++;
    r->frames += counts.saved;
    r->damaged_frames += counts.damaged;
    r->lost_frames += counts.lost;
    r->lost_covariances += counts.covariances_lost;
    take->body.representative_frame = counts.representative;
    take->complete = take->complete && whole && !counts.lost && !counts.damaged;
    take->frames = counts.saved;
    take->lost = frame_count_of((take->lost > 0 ? take->lost : 0) + counts.lost);
    take->dropped = take->dropped > 0 ? take->dropped : 0;
    r->interrupted_takes += !take->complete;
    text_make_printable(take->note);
    text_make_printable(take->alias);
    if (!whole && !*take->note)
        snprintf(take->note, sizeof take->note,
                 "repaired: its row was damaged, so its name, lenses or body may not be what they were");
    status = add_id(&repair->used, take->id);
    if (status == OK)
        status = keep_name(repair, take->name);
    if (status == OK)
        status = async_writer_put_take(repair->writer, take);
    return status == OK ? async_writer_resume(repair->writer,
                                              async_writer_pause(repair->writer)) // it holds one take row at a time
                        : status;
}

static struct take_row borrowed_take(const struct repair *repair, int64_t id)
{
    struct take_row take = {
        .id = id, .calibration = repair->calibration, .body = {.representative_frame = -1}, .frames = -1};
    return take;
}

// ------------------------------------------------------------- all takes

// The row of repair->takes. status: of take_from_row.
static enum status save_row(struct repair *repair, struct take_row *take, enum status status, bool usable)
{
    if (status == OK) {
        if (!repair->has_calibration) {
            repair->calibration = take->calibration;
            repair->has_calibration = true;
        }
        if (has_id(&repair->used, take->id)) { // by a row with a damaged id that says it was this one's
            repair->report->lost_takes++;
            return OK;
        }
        if (take->frames > 0 || has_id(&repair->filmed, take->id) || !repair->filmed.count)
            return save_take(repair, take, true);
        // A sound row without frames, in a file of an older version whose seal is missing: perhaps under another id.
    }
    const int64_t crc = statement_number(repair->takes, 6), seal = statement_number(repair->takes, TAKE_SEAL);
    const int64_t id = true_id(repair, take, crc, !statement_is_null(repair->takes, TAKE_SEAL), seal);
    const bool id_was_wrong = id != take->id;
    take->id = id;
    if (has_id(&repair->used, id) || !take_id_is_valid(id)) {
        repair->report->lost_takes++;
        return OK;
    }
    if (status != OK && !usable) {
        if (!repair->has_calibration) {
            repair->report->lost_takes++;
            return OK;
        }
        take->calibration = repair->calibration;
    }
    return save_take(repair, take, status == OK || (id_was_wrong && usable));
}

static enum status save_rows(struct repair *repair)
{
    int64_t id = 0;
    for (int lost = 0; lost < LOST_TAKES_MAX && id <= TAKE_ID_MAX; id += id <= TAKE_ID_MAX) {
        struct take_row take = {0};
        bool usable = false;
        statement_bind_number(repair->takes, 1, id);
        enum status status = statement_step(repair->takes), row_status;
        if (status == OK) {
            row_status = take_from_row(repair->takes, &take, &usable);
            id = statement_number(repair->takes, 0);
            status = is_fatal(row_status) ? row_status : save_row(repair, &take, row_status, usable);
            lost = 0;
        } else if (status != NOTHING && !is_fatal(status)) {
            lost++;
            status = OK;
        }
        statement_reset(repair->takes);
        if (status != OK)
            return status == NOTHING ? OK : status;
    }
    return OK;
}

// Frames of takes whose rows are lost.
static enum status save_orphans(struct repair *repair)
{
    enum status status = OK;
    for (int i = 0; i < repair->filmed.count && status == OK; i++) {
        const int64_t id = repair->filmed.ids[i];
        if (has_id(&repair->used, id))
            continue;
        struct take_row take = borrowed_take(repair, id);
        if (!repair->has_calibration) {
            repair->report->lost_takes++;
            continue;
        }
        status = save_take(repair, &take, false);
    }
    return status;
}

// ------------------------------------------------------------- the file

static enum status copy_place(struct repair *repair, const char *path, const char *to)
{
    struct place_copy_counts counts;
    enum status status = place_copy(path, to, COPIER_READS_WHAT_IT_CAN, &counts);
    repair->calibration = counts.calibration;
    repair->has_calibration = counts.has_calibration;
    repair->report->lost_place = counts.lost_place;
    repair->report->lost_views = counts.lost_views;
    repair->report->lost_map_covariances = counts.lost_map_covariances;
    repair->report->lost_things = counts.lost_things;
    return status;
}

static enum status open_both(struct repair *repair, const char *path, const char *to)
{
    enum status status = database_open(&repair->from, path, DATABASE_SALVAGE);
    if (status == OK)
        status = recording_check_tables(repair->from);
    if (status == OK)
        status = select_open(&repair->takes, repair->from, TABLE_TAKE, "WHERE rowid >= ? ORDER BY rowid LIMIT 1");
    if (status == OK)
        status = database_open(&repair->to, to, DATABASE_WRITE);
    if (status == OK)
        status = database_lock_writer(repair->to);
    if (status == OK)
        status = async_writer_open(&repair->writer, repair->to);
    if (status == OK)
        status = frame_copier_open(&repair->copier, repair->from, repair->writer, COPIER_READS_WHAT_IT_CAN);
    if (status == OK)
        status = list_ids(repair->from, "SELECT rowid FROM take", &repair->rows);
    if (status == OK)
        status = list_ids(repair->from, "SELECT DISTINCT rowid >> 32 FROM frame", &repair->filmed);
    return status == OK ? frame_copier_find_strays(repair->copier) : status;
}

// What was said of the takes and is expected of them. Of frames that are lost now a verdict is stale, which its key
// tells.
static enum status copy_verdicts_and_expectations(struct repair *repair)
{
    struct id_list saved = {0};
    enum status status = list_ids(repair->to, "SELECT rowid FROM take", &saved);
    for (int i = 0; i < saved.count && status == OK; i++) {
        status = recorded_verdict_copy(repair->from, saved.ids[i], repair->to, saved.ids[i]);
        if (status == OK)
            status = recorded_expectation_copy(repair->from, saved.ids[i], repair->to, saved.ids[i], true);
    }
    free(saved.ids);
    return status;
}

// Copies everything into `part`, an empty recording, and gives it the name `to`.
static enum status salvage_recording(const char *path, const char *part, const char *to,
                                     struct recording_report *report)
{
    struct repair v = {.report = report};
    enum status status = copy_place(&v, path, part);
    if (status == OK)
        status = open_both(&v, path, part);
    if (status == OK)
        status = save_rows(&v);
    if (status == OK)
        status = save_orphans(&v);
    struct failure first;
    failure_keep(&first, status);
    frame_copier_close(&v.copier);
    enum status written = async_writer_close(&v.writer);
    if (v.to && status == OK && written == OK)
        written = copy_verdicts_and_expectations(&v);
    statement_close(&v.takes);
    database_close(&v.from);
    if (v.to && status == OK && written == OK)
        written = database_close_wal(v.to);
    if (v.to && status == OK && written == OK)
        written = database_rename(&v.to, to);
    else
        database_close(&v.to);
    free(v.rows.ids);
    free(v.filmed.ids);
    free(v.used.ids);
    free(v.written);
    return first.status == OK ? written : failure_restore(&first);
}

// A sound file that is not as these programs make it is not written to: what is in it is copied.
static enum status check_exact(const char *path)
{
    struct database *db;
    enum status status = database_open(&db, path, DATABASE_READ);
    if (status == OK)
        status = exact_schema_check(db);
    database_close(&db);
    return status;
}

enum status recording_repair(const char *path, const char *to, struct recording_report *out)
{
    struct recording_report found;
    enum status status = recording_verify(path, &found);
    *out = found;
    if (status == OK)
        status = check_exact(path);
    if (status == OK)
        return NOTHING;
    if (status != ERR_CORRUPT)
        return status;
    char part[FILE_PATH_BYTES];
    if (file_exists(to))
        return fail(ERR_EXISTS, "%s is there already; choose another name", to);
    // Under another name until all is saved: a kill must leave nothing that looks like a whole recording.
    status = file_begin(to, part);
    if (status != OK)
        return status;
    unlink(part);
    struct recording_writer *w;
    status = recording_create(&w, part);
    if (status == OK)
        status = recording_close(&w);
    *out = (struct recording_report){.findings = found.findings, .bytes = found.bytes};
    memcpy(out->finding, found.finding, sizeof out->finding);
    if (status == OK)
        status = salvage_recording(path, part, to, out);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        recording_remove_files(part);
        return failure_restore(&first);
    }
    out->bytes = recording_bytes(to);
    return OK;
}
