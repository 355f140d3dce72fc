// Any bytes as a file beside a small database: its journal or its log. Reading changes neither; whatever is read,
// SQLite finds no way past its ends; writing ends in a status, too.
#pragma once
#include "platform/files/database.h"
#include "platform/files/file.h"
#include "tests/fuzz/fuzz.h"

#include <stdio.h>
#include <string.h>

struct fuzz_bytes {
    uint8_t *at;
    size_t count;
};

static inline struct fuzz_bytes fuzz_read(const char *path)
{
    struct fuzz_bytes b;
    FUZZ_CHECK(file_read(path, &b.at, &b.count) == OK);
    return b;
}

static inline bool fuzz_same(const char *path, const void *bytes, size_t count)
{
    const struct fuzz_bytes now = fuzz_read(path);
    const bool same = now.count == count && !memcmp(now.at, bytes, count);
    free(now.at);
    return same;
}

// The file as it lies on the disk after `begin` and in the midst of `change`, as if the program were killed then. The
// same bytes in every run.
static inline struct fuzz_bytes fuzz_killed(const char *begin, const char *change)
{
    struct database *db;
    fuzz_remove("killed");
    FUZZ_CHECK(database_open(&db, fuzz_path("killed"), DATABASE_CREATE) == OK);
    FUZZ_CHECK(database_run(db, "PRAGMA page_size = 512; CREATE TABLE t(id INTEGER PRIMARY KEY, b BLOB);"
                                "CREATE VIEW identity AS SELECT '0123456789abcdef0123456789abcdef';"
                                "WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c WHERE i < 40) "
                                "INSERT INTO t SELECT i, zeroblob(100) || i FROM c") == OK);
    FUZZ_CHECK(database_run(db, begin) == OK && database_run(db, change) == OK);
    const struct fuzz_bytes file = fuzz_read(fuzz_path("killed"));
    database_close(&db);
    fuzz_remove("killed");
    return file;
}

static inline void fuzz_use(const char *path, enum database_access access, const char *sql)
{
    struct database *db;
    if (fuzz_said(database_open(&db, path, access)) == OK) {
        fuzz_said(database_check(db));
        fuzz_said(database_run(db, sql));
    }
    database_close(&db);
}

static inline void fuzz_beside(const struct fuzz_bytes *file, const char *ending, const uint8_t *data, size_t size)
{
    char name[32], path[300], beside[300];
    snprintf(name, sizeof name, "input%s", ending);
    snprintf(path, sizeof path, "%s", fuzz_file("input", file->at, file->count));
    snprintf(beside, sizeof beside, "%s", fuzz_file(name, data, size));
    fuzz_use(path, DATABASE_READ, "SELECT sum(length(b)) FROM t");
    fuzz_use(path, DATABASE_SALVAGE, "SELECT sum(length(b)) FROM t");
    FUZZ_CHECK(fuzz_same(path, file->at, file->count) && fuzz_same(beside, data, size));
    fuzz_use(path, DATABASE_WRITE, "INSERT INTO t(b) VALUES(zeroblob(2000)); DELETE FROM t WHERE id < 5");
    fuzz_remove("input");
}
