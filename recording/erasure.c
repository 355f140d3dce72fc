#include "recording/erasure.h"

#include "recording/recording_schema.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

// Where the request lies in the table `prepared`, whose other rows belong to takes, from 1 on (docs/format.md).
#define REQUEST_ROW "1"

static uint32_t number_of(const struct erasure_request *r)
{
    const int64_t numbers[] = {r->numbers[0], r->numbers[1], r->seal};
    const uint32_t crc = crc32_of(crc32_of(0, r->what, strlen(r->what) + 1), r->take, strlen(r->take) + 1);
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
static enum status forget(struct database *db)
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
    return status == OK ? forget(db) : status;
}
