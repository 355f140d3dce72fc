// SQLite's write-ahead log (fileformat2.html, section 4), read beside the file whose last part it should hold.
#pragma once
#include "platform/files/database_sides.h"

// Where the file's header says that there is a log (SQLite writes that before it writes a log, and takes it out when
// the log is gone), it is proved to be the file's, BESIDE_OWN: no two marks differ, and the file's page 1 has the
// header of one in the log, or of the one before those. Where the header says that there is none, the log is
// BESIDE_EMPTY if the file has all of it: the power failed before its removal was on the disk; else BESIDE_FOREIGN: it
// is a copy that was put in the place of a file whose log this is. *out is freed by the caller in any case.
enum beside database_log_read(struct page_overlay *out, const struct byte_source *log, const struct byte_source *file);
