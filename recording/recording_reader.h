// What the readers share and what verify and repair need of them beyond recording.h.
#pragma once
#include "recording/recording_schema.h"

MUST_CHECK enum status recording_open_as(struct recording **out, const char *path, enum database_access access);
struct database *recording_database(struct recording *recording);             // borrowed
int64_t recording_take_id(const struct recording *recording, int index);      // of recording_take_name(r, index)
int recording_find_take(const struct recording *recording, const char *name); // the first of that name, shown; -1: none
// Whether the name is as the format says, not only what of it is shown (recording_take_name).
bool recording_take_name_is_valid(const struct recording *recording, int index);

// Statements that stay with the recording: for TABLE_TAKE a row by its id, for others the rows between two ids.
// recording_keep_statements comes first, in the transaction that reads: another program may have changed the tables.
// Borrowed; the user resets it.
MUST_CHECK enum status recording_keep_statements(struct recording *recording);
MUST_CHECK enum status recording_statement(struct recording *recording, enum recording_table table,
                                           struct statement **out);

struct recording *take_recording(const struct take *take); // that it was opened with
int64_t take_id(const struct take *take);                  // likewise, of an open take

// Of take_lost, those that are missing in this file.
int64_t take_lost_now(const struct take *take);
int64_t take_uncounted(const struct take *take);    // frames beyond the number that the take is said to have
bool take_is_out_of_range(const struct take *take); // its row holds what is not as the format says; it was replaced
int64_t recording_bytes(const char *path);          // of the file and its log

// ERR_CORRUPT with the file's path, `what` and the advice to repair it.
enum status recording_damaged(const struct recording *recording, const char *what);

// A column as a blob of exactly `bytes`; NULL when it is not. Borrowed as statement_blob.
const uint8_t *recording_blob(struct statement *statement, int column, size_t bytes);

// How many takes' verdicts are not as they were written. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status recorded_verdict_check(struct recording *recording, int64_t *damaged);
// Gives a copy of the take the same verdict; one that cannot be read is left out. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status recorded_verdict_copy(struct database *from, int64_t take, struct database *to, int64_t copy);

// The same of what is expected of takes (recorded_expectation.h). Further takes are named in the copy only where it is
// in the same file, or in one in which all takes have their numbers: same_file.
MUST_CHECK enum status recorded_expectation_check(struct recording *recording, int64_t *damaged);
MUST_CHECK enum status recorded_expectation_copy(struct database *from, int64_t take, struct database *to, int64_t copy,
                                                 bool same_file);
// When the take is deleted: what is expected of it, and what names it as a further reference. ERR_IO, ERR_MEMORY,
// ERR_CORRUPT.
MUST_CHECK enum status recorded_expectation_forget(struct database *db, int64_t take);

// Decodes one row of FRAME_COLUMNS. ERR_CORRUPT with the frame's number; *out is then undefined.
MUST_CHECK enum status frame_from_row(struct statement *statement, struct take_entry *out);
// The same, as if its id were `key`.
MUST_CHECK enum status frame_from_row_as(struct statement *statement, int64_t key, struct take_entry *out);

// Decodes one row of JOINT_ERROR_COLUMNS: the joints' covariances. ERR_CORRUPT with the frame's number; they are then
// not known.
MUST_CHECK enum status joint_error_from_row(struct statement *statement, struct skeleton *out);
// Whether the file has the table joint_error; older files lack it.
MUST_CHECK enum status recording_has_joint_errors(struct database *db, bool *out);

// Decodes one row of TAKE_COLUMNS. ERR_CORRUPT: the row is not as written; *out then holds what of it is valid, and
// *usable says whether that is enough to read the frames.
MUST_CHECK enum status take_from_row(struct statement *statement, struct take_row *out, bool *usable);
