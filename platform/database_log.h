// Whether a write-ahead log that lies beside an SQLite file is that file's.
#pragma once
#include "base/status.h"

// False where the log holds nothing that the file lacks, or the file says that it is in write-ahead mode: SQLite writes
// that into the file before it writes a log, and takes it out when the log is gone. So a file that was closed in good
// order has a log only where the power failed before its removal was on the disk, and then all of the log is in the
// file, too; or where it is a copy that was put in the place of a file whose log this is. Any thread may ask; other
// connections of this process keep their locks.
bool database_log_is_foreign(const char *path, const char *log);
