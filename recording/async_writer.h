// Writes frames asynchronously: rows are copied into a batch in memory, and a writer thread commits the batch in one
// transaction, at most BATCH_NS of sensor or wall clock after its first row, so that adding a frame does not wait for
// the file. A second thread, the checkpointer, moves every commit from the write-ahead log into the file and syncs it.
//
// kill -9 loses what is in memory: at most BATCH_NS and the time of one write. Power loss also loses what the
// checkpointer had not yet synced, about as much again.
//
// Threads: all functions are for one calling thread. Memory: up to 256 MiB of pending rows; beyond that
// async_writer_add_frame waits for the batch that is being written.
#pragma once
#include "recording/recording_schema.h"

enum { BATCH_NS = 400000000 };

struct async_writer;

struct frame_row {
    int64_t key, time_ns;
    bool located;
    struct pose world_from_camera;
    const struct skeleton *skeleton;     // NULL: none
    const uint8_t *color, *depth, *mask; // encoded, as they are stored; NULL: none
    size_t color_bytes, depth_bytes, mask_bytes;
};

// Uses `db`, locked for writing (database_lock_writer); it remains the caller's, must outlive the writer, and the
// caller uses it only between async_writer_pause and async_writer_resume. ERR_IO, ERR_MEMORY: *out is then NULL.
MUST_CHECK enum status async_writer_open(struct async_writer **out, struct database *db);

// Both copy their row, and both may return the error of an earlier batch: after the first error nothing more is
// written, and every call returns that error. A later row of the take replaces an earlier one.
MUST_CHECK enum status async_writer_add_frame(struct async_writer *writer, const struct frame_row *row);
MUST_CHECK enum status async_writer_put_take(struct async_writer *writer, const struct take_row *row);

// Any thread may ask.
void async_writer_count(struct async_writer *writer, struct recording_counters *out);

// Commits everything added so far and keeps the threads off the database until async_writer_resume, which must follow
// even if this fails.
MUST_CHECK enum status async_writer_pause(struct async_writer *writer);
// status: of the caller's own writing between the two; an error becomes the writer's. Returns it.
enum status async_writer_resume(struct async_writer *writer, enum status status);

// Commits what was added, ends the threads and frees; returns the first error ever met. NULL is fine; sets *s = NULL.
enum status async_writer_close(struct async_writer **s);
