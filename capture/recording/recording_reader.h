// What care (verify, repair) needs of the reader beyond recording.h.
#pragma once
#include "capture/recording/recording_schema.h"

struct recorded_take {
    int64_t id;
    char name[TAKE_NAME_BYTES + 1];
};

MUST_CHECK enum status recording_open_as(struct recording **out, const char *path, enum database_access access);
struct database *recording_database(struct recording *r); // borrowed

// One row of FRAME_COLUMNS. ERR_CORRUPT with the frame's number.
MUST_CHECK enum status frame_from_row(struct statement *s, struct take_entry *out);

// The row of a take. `row` of TAKE_COLUMNS. ERR_CORRUPT: the row is not as written;
// *out then holds what of it makes sense, *usable whether that is enough to go on.
MUST_CHECK enum status take_from_row(struct statement *s, struct take_row *out, bool *usable);
