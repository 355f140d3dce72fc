// The hand that writes: frames gather in memory and a thread of the async_writer's
// own puts them into the file, at most BATCH_NS of the sensor's clock or the
// wall clock at a time, so that whoever adds frames never waits for the file.
// A second thread, the checkpointer, moves every commit from the log into the file
// and waits for the disk there.
//
// kill -9 loses what is in memory, at most BATCH_NS and the time of one write; a
// lost machine what the checkpointer had not yet synced, about as much again.
#pragma once
#include "capture/recording/recording_schema.h"

enum { BATCH_NS = 400000000 };

struct async_writer;

struct frame_row {
    int64_t key, time_ns;
    bool located;
    struct pose world_from_camera;
    const struct skeleton *skeleton;     // NULL: none
    const uint8_t *color, *depth, *mask; // as they go into the file; NULL: none
    size_t color_bytes, depth_bytes, mask_bytes;
};

// Uses `db`, claimed for writing, which stays the caller's and must outlive it;
// the caller touches it only between async_writer_pause and async_writer_resume. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status async_writer_open(struct async_writer **out, struct database *db);

// Both copy what they are given, and both may report an earlier batch's error:
// from the first on, nothing is written. A later row of the take replaces an earlier one.
MUST_CHECK enum status async_writer_add_frame(struct async_writer *s, const struct frame_row *row);
MUST_CHECK enum status async_writer_put_take(struct async_writer *s, const struct take_row *row);

// Commits everything given so far and keeps the threads off the database until async_writer_resume.
MUST_CHECK enum status
async_writer_pause(struct async_writer *s); // also to be followed by async_writer_resume when it fails
// `status` is how the caller's own writing went; an error is then the async_writer's. Returns it.
enum status async_writer_resume(struct async_writer *s, enum status status);

// Commits what is there and frees; returns the first error ever met. NULL is fine; sets *s = NULL.
enum status async_writer_close(struct async_writer **s);
