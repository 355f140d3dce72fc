// The hand that writes: frames gather in memory and a thread of the scribe's
// own puts them into the file, at most BATCH_NS of the sensor's clock or the
// wall clock at a time, so that whoever adds frames never waits for the file.
// A second thread, the keeper, moves every commit from the log into the file
// and waits for the disk there.
//
// kill -9 loses what is in memory, at most BATCH_NS and the time of one write; a
// lost machine what the keeper had not yet synced, about as much again.
#pragma once
#include "capture/recording/recording_schema.h"

enum { BATCH_NS = 400000000 };

struct scribe;

struct frame_row {
    int64_t key, time_ns;
    bool located;
    struct pose world_from_camera;
    const struct skeleton *skeleton;     // NULL: none
    const uint8_t *color, *depth, *mask; // as they go into the file; NULL: none
    size_t color_bytes, depth_bytes, mask_bytes;
};

// Uses `db`, claimed for writing, which stays the caller's and must outlive it;
// the caller touches it only between scribe_stop and scribe_go. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status scribe_open(struct scribe **out, struct database *db);

// Both copy what they are given, and both may report an earlier batch's error:
// from the first on, nothing is written. A later row of the take replaces an earlier one.
MUST_CHECK enum status scribe_add_frame(struct scribe *s, const struct frame_row *row);
MUST_CHECK enum status scribe_put_take(struct scribe *s, const struct take_row *row);

// Commits everything given so far and keeps the threads off the database until scribe_go.
MUST_CHECK enum status scribe_stop(struct scribe *s); // also to be followed by scribe_go when it fails
// `status` is how the caller's own writing went; an error is then the scribe's. Returns it.
enum status scribe_go(struct scribe *s, enum status status);

// Commits what is there and frees; returns the first error ever met. NULL is fine; sets *s = NULL.
enum status scribe_close(struct scribe **s);
