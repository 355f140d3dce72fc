// A checkpoint beside a connection that commits: a commit that resets the write-ahead log just after the checkpoint has
// read the log's header is not lost (SQLite's "WAL-Reset Bug", sqlite.org/wal.html, in Debian 12's version). A VFS
// meets the instant: xUnfetch is the only call of it between the two.
#include "tests/support/test.h"

#include "platform/files/database.h"
#include "tests/support/scratch.h"

#include <sqlite3.h>
#include <stdio.h>

enum { MANY = 60, PAGE = 4000 }; // rows of about a page

static struct scratch scratch;
static struct database *writer, *checkpointer, *guard;
static sqlite3_vfs *real, layer;
static sqlite3_io_methods methods;
static bool armed;
static int met;

static void insert(int rows)
{
    char sql[200];
    snprintf(sql, sizeof sql,
             "WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c WHERE i < %d) "
             "INSERT INTO t(b) SELECT randomblob(%d) FROM c",
             rows, PAGE);
    EXPECT_STATUS(database_run(writer, sql), OK);
}

// Called by a checkpoint when it has read the header.
static int unfetch(sqlite3_file *file, sqlite3_int64 at, void *page)
{
    if (armed) {
        armed = false;
        met++;
        insert(3);
    }
    (void)file, (void)at, (void)page; // nothing is mapped
    return SQLITE_OK;
}

static int open_file(sqlite3_vfs *vfs, const char *path, sqlite3_file *file, int flags, int *out_flags)
{
    (void)vfs;
    const int code = real->xOpen(real, path, file, flags, out_flags);
    if (code == SQLITE_OK && flags & SQLITE_OPEN_MAIN_DB) {
        methods = *file->pMethods;
        methods.iVersion = 3;
        methods.xUnfetch = unfetch;
        file->pMethods = &methods;
    }
    return code;
}

static int install(void **state)
{
    (void)state;
    real = sqlite3_vfs_find(NULL);
    layer = *real;
    layer.zName = "between";
    layer.xOpen = open_file;
    scratch = scratch_make();
    return sqlite3_vfs_register(&layer, 1);
}

static int tidy(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

static void test_a_commit_that_resets_the_log_is_kept(void **state)
{
    (void)state;
    char path[300];
    int64_t left, rows;
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "log.reenact"));
    EXPECT_STATUS(database_open(&writer, path, DATABASE_CREATE), OK);
    EXPECT_STATUS(database_run(writer, "CREATE TABLE t(id INTEGER PRIMARY KEY, b BLOB)"), OK);
    EXPECT_STATUS(database_lock_writer(writer), OK);
    EXPECT_STATUS(database_open(&checkpointer, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_open(&guard, path, DATABASE_READ), OK);
    insert(MANY);
    EXPECT_STATUS(database_checkpoint(writer, &left), OK); // the whole log
    EXPECT_INT(left, 0);
    armed = true;
    EXPECT_STATUS(database_checkpoint_beside_writer(checkpointer, guard, &left), OK);
    EXPECT_INT(met, 1);
    insert(2); // resets the log, if its frames are marked as checkpointed
    EXPECT_STATUS(database_checkpoint_beside_writer(checkpointer, guard, &left), OK);
    database_close(&guard);
    database_close(&checkpointer);
    EXPECT_STATUS(database_close_wal(writer), OK);
    database_close(&writer);
    EXPECT_STATUS(database_open(&writer, path, DATABASE_READ), OK);
    EXPECT_STATUS(database_check(writer), OK);
    EXPECT_STATUS(database_number(writer, "SELECT count(*) FROM t", &rows), OK);
    EXPECT_INT(rows, MANY + 5);
    database_close(&writer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_a_commit_that_resets_the_log_is_kept)};
    return cmocka_run_group_tests(tests, install, tidy);
}
