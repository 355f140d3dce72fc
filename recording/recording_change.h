// Changing what a recording holds beside its takes, in one transaction: all of it or nothing.
#pragma once
#include "platform/files/database.h"

// Runs `statements` and then insert(db, what). ERR_MISSING, ERR_FORMAT, ERR_IO, ERR_CORRUPT, and what insert returns;
// on error the file is as it was.
MUST_CHECK enum status recording_change(const char *path, const char *statements,
                                        enum status (*insert)(struct database *db, const void *what), const void *what);
