// Changes a recording behind the reader's back.
#pragma once
#include "tests/support/test.h"

#include "platform/files/database.h"

static inline void run_sql(const char *path, const char *sql)
{
    struct database *db;
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, sql), OK);
    database_close(&db);
}
