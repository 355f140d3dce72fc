// Deleting what shows a person from a recording: it is done when its bytes are overwritten in the file, and in the log
// beside it, which keeps them as long as another program reads the file. A deletion whose bytes could not be
// overwritten is remembered in the file, so that asking for it again finishes it, though what is to be deleted is no
// longer there. Inside recording only. The connection is the file's only writer.
#pragma once
#include "platform/files/database.h"

// ---------------------------------------------------------------- erasure

// What was asked for, as a number: what is done, to which take, with which numbers; and how the take is once it is done
// (`seal` of its row; 0: there is none), so that another take of that name is not taken for it.
struct erasure_request {
    const char *what, *take;
    int64_t numbers[2], seal;
};

// Before anything is deleted. NOTHING: this very request was carried out before, and only its bytes are still to be
// overwritten: erasure_finish is next. ERR_IO: another program reads the file just now, and nothing is changed.
// ERR_CORRUPT, ERR_MEMORY.
MUST_CHECK enum status erasure_begin(struct database *db, const struct erasure_request *request);

// In the transaction that deletes, behind the deletions: also removes what is kept beside takes that are not there.
MUST_CHECK enum status erasure_note(struct database *db, const struct erasure_request *request);

// After its commit: the log is moved into the file and cut to nothing. ERR_IO: another program reads the file; the
// sentence begins with `done` ("take 'kata' is deleted").
MUST_CHECK enum status erasure_finish(struct database *db, const char *done);
