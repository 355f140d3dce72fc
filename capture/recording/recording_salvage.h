// Copies what can be read of a damaged recording into a new one. For recording_repair.
#pragma once
#include "capture/recording/recording_schema.h"

// Makes `to`, which must not exist. Fills *report except its bytes: damaged_frames counts frames that lost an image
// and frames missing between others; how many a truncation took from the end is unknown. Takes become complete.
// ERR_CORRUPT: not even the tables can be read. ERR_IO, ERR_MEMORY. On failure `to` may exist and be incomplete.
MUST_CHECK enum status recording_salvage(const char *path, const char *to, struct recording_report *report);

// Marks every take of an undamaged recording, locked for writing, as complete. ERR_IO, ERR_CORRUPT.
MUST_CHECK enum status recording_complete_takes(struct database *db);
