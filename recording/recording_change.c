#include "recording/recording_change.h"

#include "recording/recording_reader.h"

enum status recording_change(const char *path, const char *statements,
                             enum status (*insert)(struct database *db, const void *what), const void *what)
{
    struct database *db;
    enum status status = database_open(&db, path, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(db);
    if (status == OK)
        status = database_lock_writer(db);
    const bool locked = status == OK;
    if (status == OK)
        status = database_begin(db);
    if (status == OK)
        status = database_run(db, statements);
    if (status == OK)
        status = insert(db, what);
    if (status == OK)
        status = database_run(db, "COMMIT");
    struct failure first;
    failure_keep(&first, status);
    if (db && database_in_transaction(db) && database_run(db, "ROLLBACK") != OK)
        status = first.status;
    if (locked && status == OK)
        status = database_close_wal(db);
    database_close(&db);
    return first.status == OK ? status : failure_restore(&first);
}
