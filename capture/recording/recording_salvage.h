// Copying what can be read of a damaged recording. For recording_repair.
#pragma once
#include "capture/recording/recording_schema.h"

// Makes `to`, which must not exist. Fills *report but for its bytes:
// damaged_frames are those that lost a picture and those missing between others;
// how many a cut took from the end nobody can know. Takes come out complete.
// ERR_CORRUPT: not even the tables can be read.
MUST_CHECK enum status recording_salvage(const char *path, const char *to, struct recording_report *report);

// Marks every take of a healthy recording, open for writing, as complete.
MUST_CHECK enum status recording_complete_takes(struct database *db);
