// Changes takes of a recording: names, notes, deleting, trimming, copying.
#include "recording/recording_takes.h"

#include "base/text.h"
#include "platform/files/file.h"
#include "recording/frame_copier.h"
#include "recording/recording_reader.h"
#include "recording/recording_schema.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- erasure

// Where the request lies in the table `prepared`, whose other rows belong to takes, from 1 on (docs/format.md).
#define REQUEST_ROW "1"

static uint32_t number_of(const struct erasure_request *request)
{
    const int64_t numbers[] = {request->numbers[0], request->numbers[1], request->seal};
    const uint32_t crc =
        crc32_of(crc32_of(0, request->what, strlen(request->what) + 1), request->take, strlen(request->take) + 1);
    return crc32_of(crc, numbers, sizeof numbers);
}

static enum status has_table(struct database *db, bool *out)
{
    int64_t tables = 0;
    const enum status status = database_number(db, COUNT_TABLES("'prepared'"), &tables);
    *out = tables > 0;
    return status;
}

// A commit that changes nothing, and the log emptied behind it: only a program that reads just now can hinder that.
static enum status check_readers(struct database *db)
{
    enum status status = database_begin(db);
    if (status == OK)
        status = database_run(db, "COMMIT");
    return status == OK ? database_empty_log(db) : status;
}

enum status erasure_begin(struct database *db, const struct erasure_request *request)
{
    int64_t noted = -1;
    bool there;
    enum status status = check_readers(db);
    if (status == NOTHING)
        return fail(ERR_IO,
                    "another program is reading %s, so that what is deleted could not be overwritten, and nothing is "
                    "changed: close the other program, then run it again",
                    database_path(db));
    if (status == OK)
        status = has_table(db, &there);
    if (status != OK || !there)
        return status;
    status = database_number(db, "SELECT index_crc FROM prepared WHERE rowid = " REQUEST_ROW, &noted);
    if (status != OK)
        return status == NOTHING ? OK : status;
    return noted == (int64_t)number_of(request) ? NOTHING : OK;
}

enum status erasure_note(struct database *db, const struct erasure_request *request)
{
    char sql[200];
    enum status status =
        database_run(db, PREPARED_TABLE "DELETE FROM prepared WHERE (rowid >> 32) NOT IN (SELECT rowid FROM take)");
    snprintf(sql, sizeof sql,
             "INSERT INTO prepared(id, version, index_crc, data, crc) VALUES(" REQUEST_ROW ", 1, %" PRIu32 ", NULL, 0)",
             number_of(request));
    return status == OK ? database_run(db, sql) : status;
}

// The note, and the table where nothing else is in it: it takes a page of 64 KiB.
static enum status delete_request(struct database *db)
{
    int64_t rows = 0;
    enum status status = database_begin(db);
    if (status == OK)
        status = database_run(db, "DELETE FROM prepared WHERE rowid = " REQUEST_ROW);
    if (status == OK)
        status = database_number(db, "SELECT count(*) FROM prepared", &rows);
    if (status == OK && !rows)
        status = database_run(db, "DROP TABLE prepared");
    return status == OK ? database_run(db, "COMMIT") : status;
}

enum status erasure_finish(struct database *db, const char *done)
{
    const enum status status = database_empty_log(db);
    if (status == NOTHING)
        return fail(ERR_IO,
                    "%s, but its bytes are not overwritten yet, because another program reads %s: close the other "
                    "program, then run it again",
                    done, database_path(db));
    // The pending request holds no picture or joint: its own removal needs no proof of being overwritten.
    return status == OK ? delete_request(db) : status;
}

// ---------------------------------------------------------------- recording takes

// ------------------------------------------------------------- the file while it is changed

// Opens the file as its only writer. Deleted content is overwritten with zeros.
static enum status open_to_change(struct database **db, const char *path)
{
    enum status status = database_open(db, path, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(*db);
    if (status == OK)
        status = database_lock_writer(*db);
    if (status == OK)
        status = database_run(*db, "PRAGMA secure_delete = ON; PRAGMA synchronous = FULL");
    return status == OK ? recording_add_columns(*db) : status;
}

// The same, and begins a transaction.
static enum status begin_change(struct database **db, const char *path)
{
    const enum status status = open_to_change(db, path);
    return status == OK ? database_begin(*db) : status;
}

// Ends the transaction, if one is open, and closes.
static enum status end_change(struct database **db, enum status status)
{
    struct failure first;
    if (status == OK && database_in_transaction(*db))
        status = database_run(*db, "COMMIT");
    failure_keep(&first, status);
    if (*db && database_in_transaction(*db)) {
        enum status back = database_run(*db, "ROLLBACK");
        (void)back; // the first error is reported
    }
    if (*db && first.status == OK)
        status = database_close_wal(*db);
    database_close(db);
    return first.status == OK ? status : failure_restore(&first);
}

// More is free in the file than used.
static enum status is_mostly_free(struct database *db, bool *out)
{
    int64_t pages = 0, unused = 0;
    enum status status = database_number(db, "PRAGMA page_count", &pages);
    if (status == OK)
        status = database_number(db, "PRAGMA freelist_count", &unused);
    *out = unused > pages - unused;
    return status;
}

// Gives the pages that nothing uses any more back to the disk. Where there is no room for the second copy that this
// takes, they stay in the file. freed NULL: they stay, too, but where that copy is smaller than they are.
static enum status shrink_file(const char *path, int64_t before, int64_t *freed)
{
    struct database *db;
    int64_t exact = 0;
    bool wanted = true;
    enum status status = database_open(&db, path, DATABASE_WRITE);
    if (status == OK && !freed)
        status = is_mostly_free(db, &wanted);
    // Where a damaged byte made a table's id a column like others, VACUUM would renumber its rows.
    if (status == OK)
        status = database_number(db,
                                 "SELECT count(*) FROM sqlite_schema WHERE name IN ('place', 'place_view', 'take', "
                                 "'frame', 'picture') AND sql LIKE '%(id INTEGER PRIMARY KEY,%'",
                                 &exact);
    if (status == OK && wanted && exact == 5)
        status = database_run(db, "VACUUM");
    if (status == OK) // beside a program that has the file open, the new copy lies in the log
        status = database_empty_log(db);
    database_close(&db);
    const int64_t after = recording_bytes(path);
    if (freed)
        *freed = before > after ? before - after : 0;
    return status == ERR_IO || status == NOTHING ? OK : status;
}

// A take of a file from outside, whose name holds what is not shown, by the name that is shown.
static enum status find_shown(struct database *db, const char *name, struct take_row *out)
{
    struct statement *s;
    bool usable, found = false;
    char shown[TAKE_NAME_BYTES + 1];
    enum status status = select_open(&s, db, TABLE_TAKE, "ORDER BY rowid");
    while (status == OK && !found && (status = statement_step(s)) == OK) {
        snprintf(shown, sizeof shown, "%s", statement_text(s, 1));
        text_make_printable(shown);
        found = !strcmp(shown, name);
    }
    if (status == OK)
        status = take_from_row(s, out, &usable);
    statement_close(&s);
    return status;
}

// NOTHING: no such take. ERR_CORRUPT: its row is damaged.
static enum status find_take(struct database *db, const char *name, struct take_row *out)
{
    struct statement *s;
    bool usable;
    enum status status = select_open(&s, db, TABLE_TAKE, "WHERE name = ?");
    if (status == OK) {
        statement_bind_text(s, 1, name);
        status = statement_step(s);
    }
    if (status == OK)
        status = take_from_row(s, out, &usable);
    statement_close(&s);
    return status == NOTHING ? find_shown(db, name, out) : status;
}

static enum status require_take(struct database *db, const char *name, struct take_row *out)
{
    enum status status = find_take(db, name, out);
    if (status == NOTHING)
        return fail(ERR_MISSING, "%s has no take '%s'; reenact-capture info lists those it has", database_path(db),
                    name);
    if (status == ERR_CORRUPT)
        return fail(status, "%s is damaged: the take '%s' cannot be read; try reenact-capture repair",
                    database_path(db), name);
    return status;
}

static enum status check_free(struct database *db, const char *name)
{
    struct take_row other;
    enum status status = take_name_check(name);
    if (status == OK)
        status = find_take(db, name, &other);
    if (status == OK || status == ERR_CORRUPT)
        return fail(ERR_EXISTS, "%s has a take '%s' already; choose another name", database_path(db), name);
    return status == NOTHING ? OK : status;
}

static enum status put_take(struct database *db, const struct take_row *take)
{
    struct statement *s;
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    enum status status = insert_open(&s, db, TABLE_TAKE, true);
    if (status == OK) {
        take_bind(s, take, calibration, body);
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

// ------------------------------------------------------------- names and notes

enum status recording_rename_take(const char *path, const char *name, const char *new_name)
{
    struct database *db;
    struct take_row take;
    enum status status = begin_change(&db, path);
    if (status == OK)
        status = require_take(db, name, &take);
    if (status == OK && strcmp(name, new_name))
        status = check_free(db, new_name);
    if (status == OK) {
        snprintf(take.name, sizeof take.name, "%s", new_name);
        status = put_take(db, &take);
    }
    return end_change(&db, status);
}

static enum status set_text(char *out, size_t size, const char *text, const char *what)
{
    if (!text)
        return OK;
    if (strlen(text) >= size)
        return fail(ERR_INPUT, "the %s has %zu bytes; at most %zu are kept", what, strlen(text), size - 1);
    if (!text_is_printable(text))
        return fail(ERR_INPUT, "the %s must be UTF-8 text of one line without control characters", what);
    snprintf(out, size, "%s", text);
    return OK;
}

enum status recording_annotate_take(const char *path, const char *name, const char *note, const char *alias)
{
    struct database *db;
    struct take_row take;
    enum status status = begin_change(&db, path);
    if (status == OK)
        status = require_take(db, name, &take);
    if (status == OK)
        status = set_text(take.note, sizeof take.note, note, "note");
    if (status == OK)
        status = set_text(take.alias, sizeof take.alias, alias, "alias");
    if (status == OK)
        status = put_take(db, &take);
    return end_change(&db, status);
}

// ------------------------------------------------------------- deleting and trimming

// Deletes the rows of frames with keys from `first` to `last`.
static enum status delete_frames(struct database *db, int64_t first, int64_t last)
{
    static const char *const sql[] = {"DELETE FROM frame WHERE rowid BETWEEN ? AND ?",
                                      "DELETE FROM picture WHERE rowid BETWEEN ? AND ?",
                                      "DELETE FROM joint_error WHERE rowid BETWEEN ? AND ?"};
    enum status status = database_run(db, JOINT_ERROR_TABLE); // older files lack it
    for (size_t i = 0; i < COUNT_OF(sql) && status == OK && first <= last; i++) {
        struct statement *s;
        status = statement_open(&s, db, sql[i]);
        if (status == OK) {
            statement_bind_number(s, 1, first);
            statement_bind_number(s, 2, last);
            status = statement_run(s);
        }
        statement_close(&s);
    }
    return status;
}

// A take's verdict goes with it.
static enum status delete_verdict(struct database *db, int64_t take)
{
    int64_t tables = 0;
    enum status status = database_number(db, COUNT_TABLES("'verdict'"), &tables); // older files lack it
    if (status != OK || !tables)
        return status;
    struct statement *s;
    status = statement_open(&s, db, "DELETE FROM verdict WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, take);
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

// Deletes what programs keep beside a take that is deleted or changed: it shows the person, too.
static enum status delete_prepared(struct database *db, int64_t take)
{
    int64_t tables = 0;
    enum status status = database_number(db, COUNT_TABLES("'prepared'"), &tables); // older files lack it
    if (status != OK || !tables)
        return status;
    struct statement *s;
    status = statement_open(&s, db, "DELETE FROM prepared WHERE rowid BETWEEN ? AND ?");
    if (status == OK) {
        statement_bind_number(s, 1, frame_key(take, 0));
        statement_bind_number(s, 2, frame_key(take, FRAME_NUMBER_MAX));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

// Where the disk has no room for the log of a deletion, there is another way.
static enum status explain_full(struct database *db, enum status status)
{
    if (status != ERR_IO || !db || !database_is_full(db))
        return status;
    char why[400];
    snprintf(why, sizeof why, "%s", status_message());
    return fail(ERR_IO,
                "%s, and what is deleted is overwritten, which needs as much room for a while: make room there, or "
                "copy the takes that stay to another disk (reenact-capture take copy --into) and remove this file",
                why);
}

// What recording_delete_take and recording_trim_take have in common: carries `change` out in a transaction, unless that
// was done before, and overwrites. `done` says what has happened then.
struct erasing {
    const char *path, *take, *what, *done;
    int64_t from_ns, to_ns;
    enum status (*change)(struct database *db, const struct erasing *e);
};

// The take's row as it is now.
static enum status find_seal(struct database *db, struct erasure_request *request)
{
    struct statement *s;
    request->seal = 0;
    enum status status = statement_open(&s, db, "SELECT seal FROM take WHERE name = ?");
    if (status == OK) {
        statement_bind_text(s, 1, request->take);
        status = statement_step(s);
    }
    if (status == OK)
        request->seal = statement_number(s, 0);
    statement_close(&s);
    return status == NOTHING ? OK : status;
}

static enum status change_and_note(struct database *db, const struct erasing *erasing, struct erasure_request *request)
{
    enum status status = database_begin(db);
    if (status == OK)
        status = erasing->change(db, erasing);
    if (status == OK)
        status = find_seal(db, request);
    if (status == OK)
        status = erasure_note(db, request);
    return status == OK ? database_run(db, "COMMIT") : status;
}

static enum status run_erasure(const struct erasing *erasing, int64_t *freed)
{
    struct database *db = NULL;
    const int64_t before = recording_bytes(erasing->path);
    struct erasure_request request = {
        .what = erasing->what, .take = erasing->take, .numbers = {erasing->from_ns, erasing->to_ns}};
    char done[TAKE_NAME_BYTES + 40];
    snprintf(done, sizeof done, "take '%s' is %s", erasing->take, erasing->done);
    if (freed)
        *freed = 0;
    enum status status = open_to_change(&db, erasing->path);
    if (status == OK)
        status = find_seal(db, &request);
    if (status == OK)
        status = erasure_begin(db, &request);
    if (status == OK)
        status = change_and_note(db, erasing, &request);
    if (status == OK || status == NOTHING)
        status = erasure_finish(db, done);
    status = end_change(&db, explain_full(db, status));
    return status == OK ? shrink_file(erasing->path, before, freed) : status;
}

static enum status delete_take(struct database *db, const struct erasing *erasing)
{
    struct take_row take;
    struct statement *s = NULL;
    enum status status = require_take(db, erasing->take, &take);
    if (status == OK)
        status = delete_frames(db, frame_key(take.id, 0), frame_key(take.id, FRAME_NUMBER_MAX));
    if (status == OK)
        status = delete_prepared(db, take.id);
    if (status == OK)
        status = delete_verdict(db, take.id);
    if (status == OK)
        status = recorded_expectation_forget(db, take.id);
    if (status == OK)
        status = statement_open(&s, db, "DELETE FROM take WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, take.id);
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum status recording_delete_take(const char *path, const char *name, int64_t *freed)
{
    return run_erasure(
        &(struct erasing){.path = path, .take = name, .what = "delete", .done = "deleted", .change = delete_take},
        freed);
}

// Numbers of the first and the last frame that stay. NOTHING: none; *end_ns is then when the last one is.
static enum status find_range(struct database *db, int64_t take, const struct erasing *erasing, int64_t range[2],
                              int64_t *end_ns)
{
    struct statement *s;
    int64_t start_ns = 0;
    *end_ns = 0;
    range[0] = range[1] = -1;
    enum status status = select_open(&s, db, TABLE_FRAME, "WHERE rowid BETWEEN ? AND ? ORDER BY rowid");
    if (status == OK) {
        statement_bind_number(s, 1, frame_key(take, 0));
        statement_bind_number(s, 2, frame_key(take, FRAME_NUMBER_MAX));
    }
    for (bool first = true; status == OK && (status = statement_step(s)) == OK; first = false) {
        struct take_entry entry;
        status = frame_from_row(s, &entry);
        if (status != OK)
            break;
        start_ns = first ? entry.time_ns : start_ns;
        // unsigned: the times of a foreign file may lie any distance apart
        const uint64_t at_ns = (uint64_t)entry.time_ns - (uint64_t)start_ns;
        *end_ns = at_ns < INT64_MAX ? (int64_t)at_ns : INT64_MAX;
        if (at_ns >= (uint64_t)erasing->from_ns && at_ns <= (uint64_t)erasing->to_ns) {
            range[0] = range[0] < 0 ? entry.row_number : range[0];
            range[1] = entry.row_number;
        }
    }
    statement_close(&s);
    return status == NOTHING && range[0] >= 0 ? OK : status;
}

// Gives the rows with keys from `first` on the keys from `to` on, and the seals that belong to them.
static enum status renumber_rows(struct database *db, int64_t first, int64_t last, int64_t to)
{
    static const struct {
        enum recording_table table;
        const char *update;
    } tables[] = {{TABLE_FRAME, "UPDATE frame SET id = ?, seal = ? WHERE rowid = ?"},
                  {TABLE_JOINT_ERROR, "UPDATE joint_error SET id = ?, seal = ? WHERE rowid = ?"},
                  {TABLE_IMAGE, "UPDATE picture SET id = ?, seal = ? WHERE rowid = ?"}};
    enum status status = OK;
    for (size_t i = 0; i < COUNT_OF(tables) && status == OK && first != to; i++) {
        struct statement *read, *write = NULL;
        int64_t next = first;
        status = select_open(&read, db, tables[i].table, "WHERE rowid BETWEEN ? AND ? ORDER BY rowid LIMIT 1");
        if (status == OK)
            status = statement_open(&write, db, tables[i].update);
        while (status == OK) {
            statement_bind_number(read, 1, next);
            statement_bind_number(read, 2, last);
            status = statement_step(read);
            const int64_t key = statement_number(read, 0), new_key = key - first + to;
            const int64_t numbers[] = {statement_number(read, 1), statement_number(read, 2), statement_number(read, 3)};
            const int64_t crc = statement_number(read, tables[i].table == TABLE_FRAME ? 6 : 2);
            statement_reset(read);
            if (status != OK)
                break;
            next = key + 1;
            statement_bind_number(write, 1, new_key);
            statement_bind_number(write, 2,
                                  tables[i].table == TABLE_IMAGE ? image_seal(new_key, numbers)
                                                                 : row_seal(new_key, (uint32_t)crc));
            statement_bind_number(write, 3, key);
            status = statement_run(write);
        }
        statement_close(&read);
        statement_close(&write);
        status = status == NOTHING ? OK : status;
    }
    return status;
}

static enum status nothing_between(const struct erasing *erasing, int64_t end_ns)
{
    char from[SECONDS_TEXT_BYTES], to[SECONDS_TEXT_BYTES], end_change[SECONDS_TEXT_BYTES];
    seconds_text(erasing->from_ns, 3, from);
    seconds_text(erasing->to_ns, 3, to);
    if (erasing->from_ns > end_ns)
        return fail(ERR_INPUT, "take '%s' ends at %s s, before %s s; it stays as it was", erasing->take,
                    seconds_text(end_ns, 3, end_change), from);
    return fail(ERR_INPUT, "no frame of take '%s' lies between %s s and %s s; it stays as it was", erasing->take, from,
                to);
}

static enum status trim_take(struct database *db, const struct erasing *erasing)
{
    struct take_row take;
    int64_t range[2] = {0, 0}, end_ns = 0;
    enum status status = require_take(db, erasing->take, &take);
    if (status == OK)
        status = find_range(db, take.id, erasing, range, &end_ns);
    if (status == NOTHING)
        status = nothing_between(erasing, end_ns);
    if (status == OK)
        status = delete_frames(db, frame_key(take.id, range[1]) + 1, frame_key(take.id, FRAME_NUMBER_MAX));
    if (status == OK)
        status = delete_frames(db, frame_key(take.id, 0), frame_key(take.id, range[0]) - 1);
    if (status == OK)
        status = delete_prepared(db, take.id);
    if (status == OK)
        status = renumber_rows(db, frame_key(take.id, range[0]), frame_key(take.id, range[1]), frame_key(take.id, 0));
    if (status != OK)
        return status;
    int64_t *shown = &take.body.representative_frame;
    *shown = *shown >= range[0] && *shown <= range[1] ? *shown - range[0] : -1;
    take.frames = take.frames < 0 ? -1 : range[1] - range[0] + 1;
    return put_take(db, &take);
}

enum status recording_trim_take(const char *path, const char *name, int64_t from_ns, int64_t to_ns, int64_t *freed)
{
    if (freed)
        *freed = 0;
    if (from_ns < 0 || to_ns < from_ns)
        return fail(ERR_INPUT, "a take is trimmed from a second to a later one, not from %.3f to %.3f",
                    (double)from_ns * 1e-9, (double)to_ns * 1e-9);
    return run_erasure(&(struct erasing){.path = path,
                                         .take = name,
                                         .what = "trim",
                                         .done = "trimmed",
                                         .from_ns = from_ns,
                                         .to_ns = to_ns,
                                         .change = trim_take},
                       freed);
}

// ------------------------------------------------------------- copying

// Whether both hold the same place, by its checksum; a file without one has -1.
static enum status place_crc(struct database *db, int64_t *crc)
{
    *crc = -1;
    enum status status = database_number(db, "SELECT crc FROM place", crc);
    return status == NOTHING ? OK : status;
}

static enum status new_id(struct database *db, const char *name, int64_t *id)
{
    enum status status = check_free(db, name);
    if (status == OK)
        status = database_number(db, "SELECT coalesce(max(rowid), 0) + 1 FROM take", id);
    return status == OK && !take_id_is_valid(*id) ? fail(ERR_INPUT, "%s is full", database_path(db)) : status;
}

// Copies the take, which is complete once its last batch is in the file; until then it is marked as interrupted.
static enum status copy_rows(struct database *from, struct database *to, struct take_row *take, const char *new_name,
                             bool located, struct take_copy_report *report)
{
    struct async_writer *writer = NULL;
    struct frame_copier *copier = NULL;
    struct frame_copy_counts counts = {0};
    const bool complete = take->complete;
    struct take_row copy = *take;
    enum status status = new_id(to, new_name, &copy.id);
    snprintf(copy.name, sizeof copy.name, "%s", new_name);
    copy.complete = false;
    copy.frames = -1;
    if (status == OK)
        status = async_writer_open(&writer, to);
    if (status == OK)
        status = frame_copier_open(&copier, from, writer, COPIER_READS_ALL);
    if (status == OK)
        status = async_writer_put_take(writer, &copy);
    if (status == OK)
        status = frame_copier_copy(copier, take, copy.id, located, &counts);
    if (status == OK) {
        copy.complete = complete && !counts.lost && !counts.damaged;
        copy.frames = counts.saved;
        copy.lost = frame_count_of(copy.lost + counts.lost);
        copy.body.representative_frame = counts.representative;
        report->lost_frames = copy.lost;
        report->damaged_frames = counts.damaged;
        report->lost_covariances = counts.covariances_lost;
        status = async_writer_put_take(writer, &copy);
    }
    struct failure first;
    failure_keep(&first, status);
    frame_copier_close(&copier);
    enum status written = async_writer_close(&writer);
    if (first.status == OK && written == OK)
        written = recorded_verdict_copy(from, take->id, to, copy.id);
    if (first.status == OK && written == OK)
        written = recorded_expectation_copy(from, take->id, to, copy.id,
                                            file_is_same(database_path(from), database_path(to)));
    return first.status == OK ? written : failure_restore(&first);
}

static enum status copy_into(const char *path, const char *name, const char *to, const char *new_name,
                             struct take_copy_report *report)
{
    struct database *from = NULL, *db = NULL;
    struct take_row take = {0};
    int64_t ours, theirs;
    enum status status = database_open(&from, path, DATABASE_READ);
    if (status == OK)
        status = recording_check_tables(from);
    if (status == OK)
        status = require_take(from, name, &take);
    if (status == OK)
        status = database_open(&db, to, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(db);
    if (status == OK)
        status = database_lock_writer(db);
    if (status == OK)
        status = database_run(db, JOINT_ERROR_TABLE);
    if (status == OK)
        status = recording_add_columns(db);
    if (status == OK)
        status = place_crc(from, &ours);
    if (status == OK)
        status = place_crc(db, &theirs);
    if (status == OK) {
        report->place_differs = ours != theirs && ours != -1;
        status = copy_rows(from, db, &take, new_name, ours == theirs, report);
    }
    struct failure first;
    failure_keep(&first, status);
    database_close(&from);
    if (db && first.status == OK)
        status = database_close_wal(db);
    database_close(&db);
    return first.status == OK ? status : failure_restore(&first);
}

enum status recording_copy_take(const char *path, const char *name, const char *to, const char *new_name,
                                struct take_copy_report *out)
{
    *out = (struct take_copy_report){0};
    enum status status = take_name_check(new_name);
    if (status != OK)
        return status;
    if (file_exists(to))
        return copy_into(path, name, to, new_name, out);
    // A new file: with the place, so that the take is still where it was filmed.
    struct place_copy_counts place;
    struct recording_writer *w;
    status = recording_create(&w, to);
    if (status != OK)
        return status;
    status = recording_close(&w);
    if (status == OK)
        status = place_copy(path, to, COPIER_READS_ALL, &place);
    if (status == OK) {
        out->lost_views = place.lost_views;
        out->lost_map_covariances = place.lost_map_covariances;
        out->lost_things = place.lost_things;
        status = copy_into(path, name, to, new_name, out);
    }
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        recording_remove_files(to);
        return failure_restore(&first);
    }
    return OK;
}
