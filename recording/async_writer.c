#include "recording/async_writer.h"

#include "base/clock.h"
#include "base/threads.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { PENDING_BYTES_MAX = 256 << 20 }; // a disk slower than the sensor then blocks recording instead of filling memory

struct pending {
    struct pending *next;
    struct frame_row row;
    struct skeleton skeleton;
    uint8_t bytes[]; // the encoded images
};

struct batch {
    struct pending *first, **last; // last: where the next one is linked
    struct take_row take;
    bool has_take;
    size_t bytes;
    int64_t since_ns; // wall clock of the first addition; INT64_MAX: empty
};

struct async_writer {
    struct database *db, *checkpoint_db, *guard_db;
    struct statement *add_frame, *add_joint_error, *add_image, *put_take;

    pthread_mutex_t lock; // guards all below
    pthread_cond_t wake;  // there may be something to do
    pthread_cond_t done;  // `writing` has ended
    pthread_t writer, checkpointer;
    bool has_writer, has_checkpointer, stop;
    struct batch batch;
    bool due;                   // the batch is full by the sensor's clock
    bool writing;               // the writer thread uses the database, without the lock
    bool unsynced;              // committed, not yet checkpointed
    struct failure first_error; // from then on nothing is written
    struct recording_counters counters;
};

// ------------------------------------------------------------- rows

static enum status insert_joint_error(struct async_writer *writer, const struct frame_row *row)
{
    uint8_t covariances[JOINT_ERROR_BYTES];
    put_joint_error(covariances, row->skeleton);
    const uint32_t crc = crc32_of(0, covariances, sizeof covariances);
    statement_bind_number(writer->add_joint_error, 1, row->key);
    statement_bind_blob(writer->add_joint_error, 2, covariances, sizeof covariances);
    statement_bind_number(writer->add_joint_error, 3, crc);
    statement_bind_number(writer->add_joint_error, JOINT_ERROR_SEAL + 1, row_seal(row->key, crc));
    return statement_run(writer->add_joint_error);
}

static enum status insert_images(struct async_writer *writer, const struct frame_row *frame_row)
{
    const struct {
        const uint8_t *bytes;
        size_t count;
    } images[] = {{frame_row->mask, frame_row->mask_bytes},
                  {frame_row->depth, frame_row->depth_bytes},
                  {frame_row->color, frame_row->color_bytes}};
    struct statement *row = writer->add_image;
    int64_t crcs[3] = {0};
    statement_bind_number(row, 1, frame_row->key);
    for (int i = 0; i < 3; i++) {
        if (images[i].bytes)
            statement_bind_number(row, 2 + i, crcs[i] = crc32_of(0, images[i].bytes, images[i].count));
        statement_bind_blob(row, 5 + i, images[i].bytes, images[i].count);
    }
    statement_bind_number(row, IMAGE_SEAL + 1, image_seal(frame_row->key, crcs));
    return statement_run(row);
}

static enum status insert_frame(struct async_writer *writer, const struct frame_row *frame_row)
{
    uint8_t pose[POSE_BYTES], skeleton[SKELETON_BYTES];
    size_t skeleton_bytes = frame_row->skeleton ? sizeof skeleton : 0;
    unsigned images = (frame_row->color ? TAKE_COLOR : 0u) | (frame_row->depth ? TAKE_DEPTH : 0u) |
                      (frame_row->mask ? TAKE_MASK : 0u);
    put_pose(pose, &frame_row->world_from_camera);
    if (frame_row->skeleton)
        put_skeleton(skeleton, frame_row->skeleton);
    const uint32_t crc = frame_crc(frame_row->time_ns, frame_row->located, pose, skeleton, skeleton_bytes, images);
    struct statement *row = writer->add_frame;
    statement_bind_number(row, 1, frame_row->key);
    statement_bind_number(row, 2, frame_row->time_ns);
    statement_bind_number(row, 3, frame_row->located);
    statement_bind_blob(row, 4, pose, sizeof pose);
    statement_bind_blob(row, 5, frame_row->skeleton ? skeleton : NULL, skeleton_bytes);
    statement_bind_number(row, 6, images);
    statement_bind_number(row, 7, crc);
    statement_bind_number(row, FRAME_SEAL + 1, row_seal(frame_row->key, crc));
    enum status status = statement_run(row);
    if (status == OK && frame_row->skeleton && skeleton_has_covariance(frame_row->skeleton))
        status = insert_joint_error(writer, frame_row);
    return status == OK && images ? insert_images(writer, frame_row) : status;
}

static enum status insert_take(struct async_writer *writer, const struct take_row *row)
{
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    take_bind(writer->put_take, row, calibration, body);
    return statement_run(writer->put_take);
}

// ------------------------------------------------------------- batches

static void empty_batch(struct batch *batch)
{
    while (batch->first) {
        struct pending *next = batch->first->next;
        free(batch->first);
        batch->first = next;
    }
    batch->has_take = false;
    batch->bytes = 0;
    batch->since_ns = INT64_MAX;
}

// One transaction: on any error the file remains as the last commit left it.
static enum status write_batch(struct async_writer *writer, const struct batch *batch)
{
    enum status status = database_begin(writer->db);
    for (const struct pending *p = batch->first; status == OK && p; p = p->next)
        status = insert_frame(writer, &p->row);
    if (status == OK && batch->has_take)
        status = insert_take(writer, &batch->take);
    if (status == OK)
        status = database_run(writer->db, "COMMIT");
    return status;
}

// The functions from here to the threads are called with the lock held.

// Keeps the first error, rolls back and drops the batch. Returns the first error with its sentence.
static enum status set_error(struct async_writer *writer, enum status status)
{
    if (writer->first_error.status == OK) {
        failure_keep(&writer->first_error, status);
        enum status back = database_in_transaction(writer->db) ? database_run(writer->db, "ROLLBACK") : OK;
        (void)back;
    }
    empty_batch(&writer->batch);
    pthread_cond_broadcast(&writer->done); // wakes those who wait for this batch
    return failure_restore(&writer->first_error);
}

// Detaches the batch and writes it. unlocked: the lock is released meanwhile.
static enum status write_pending(struct async_writer *writer, bool unlocked)
{
    if (writer->first_error.status != OK)
        return failure_restore(&writer->first_error);
    if (writer->batch.since_ns == INT64_MAX)
        return OK;
    struct batch b = writer->batch;
    const int64_t bytes = (int64_t)b.bytes;
    int64_t frames = 0, last_ns = 0;
    for (const struct pending *p = b.first; p; p = p->next, frames++)
        last_ns = p->row.time_ns;
    writer->batch = (struct batch){.since_ns = INT64_MAX};
    writer->due = false;
    writer->writing = true;
    if (unlocked)
        pthread_mutex_unlock(&writer->lock);
    enum status status = write_batch(writer, &b);
    empty_batch(&b);
    if (unlocked)
        pthread_mutex_lock(&writer->lock);
    writer->writing = false;
    pthread_cond_broadcast(&writer->done);
    if (status != OK)
        return set_error(writer, status);
    writer->counters.waiting_bytes -= bytes;
    writer->counters.written_bytes += bytes;
    writer->counters.waiting_frames -= frames;
    writer->counters.committed_frames += frames;
    if (frames)
        writer->counters.committed_ns = last_ns;
    writer->unsynced = true;
    pthread_cond_broadcast(&writer->wake);
    return OK;
}

// ------------------------------------------------------------- the two threads

static void *run_writer(void *argument)
{
    struct async_writer *writer = argument;
    thread_wake_without_preempting();
    pthread_mutex_lock(&writer->lock);
    while (!writer->stop) {
        int64_t since = writer->batch.since_ns;
        bool waiting = since != INT64_MAX && writer->first_error.status == OK;
        if (waiting && (writer->due || clock_now_ns() - since >= BATCH_NS)) {
            enum status status = write_pending(writer, true);
            (void)status; // kept in writer->first_error
        } else if (waiting) {
            condition_wait_until_ns(&writer->wake, &writer->lock, since + BATCH_NS);
        } else {
            pthread_cond_wait(&writer->wake, &writer->lock);
        }
    }
    pthread_mutex_unlock(&writer->lock);
    return NULL;
}

static void *run_checkpointer(void *argument)
{
    struct async_writer *writer = argument;
    thread_wake_without_preempting();
    pthread_mutex_lock(&writer->lock);
    while (!writer->stop) {
        if (!writer->unsynced || writer->first_error.status != OK) {
            pthread_cond_wait(&writer->wake, &writer->lock);
            continue;
        }
        writer->unsynced = false;
        const struct recording_counters before = writer->counters;
        pthread_mutex_unlock(&writer->lock);
        int64_t left;
        enum status status = database_checkpoint_beside_writer(writer->checkpoint_db, writer->guard_db, &left);
        pthread_mutex_lock(&writer->lock);
        if (status != OK) {
            while (writer->writing) // the writer thread uses the connection that set_error() rolls back
                pthread_cond_wait(&writer->done, &writer->lock);
            set_error(writer, status);
        } else {
            writer->counters.synced_frames = before.committed_frames;
            writer->counters.synced_ns = before.committed_ns;
        }
    }
    pthread_mutex_unlock(&writer->lock);
    return NULL;
}

// ------------------------------------------------------------- the interface

static enum status start_writer(struct async_writer *writer)
{
    enum status status = insert_open(&writer->add_frame, writer->db, TABLE_FRAME, false);
    if (status == OK)
        status = insert_open(&writer->add_joint_error, writer->db, TABLE_JOINT_ERROR, true);
    if (status == OK)
        status = insert_open(&writer->add_image, writer->db, TABLE_IMAGE, false);
    if (status == OK)
        status = insert_open(&writer->put_take, writer->db, TABLE_TAKE, true);
    if (status == OK)
        status = database_open(&writer->checkpoint_db, database_path(writer->db), DATABASE_WRITE);
    if (status == OK)
        status = database_open(&writer->guard_db, database_path(writer->db), DATABASE_READ);
    if (status == OK)
        status = database_run(writer->checkpoint_db, "PRAGMA synchronous = NORMAL; PRAGMA wal_autocheckpoint = 0");
    if (status != OK)
        return status;
    writer->has_writer = !pthread_create(&writer->writer, NULL, run_writer, writer);
    writer->has_checkpointer =
        writer->has_writer && !pthread_create(&writer->checkpointer, NULL, run_checkpointer, writer);
    return writer->has_checkpointer ? OK : fail(ERR_MEMORY, "no thread to write %s", database_path(writer->db));
}

enum status async_writer_open(struct async_writer **out, struct database *db)
{
    struct async_writer *s = calloc(1, sizeof *s);
    *out = NULL;
    if (!s)
        return fail(ERR_MEMORY, "no memory to write %s", database_path(db));
    s->db = db;
    s->batch.since_ns = INT64_MAX;
    s->counters.committed_ns = s->counters.synced_ns = INT64_MIN;
    condition_open(&s->wake);
    pthread_cond_init(&s->done, NULL);
    pthread_mutex_init(&s->lock, NULL);
    enum status status = start_writer(s);
    if (status == OK) {
        *out = s;
        return OK;
    }
    failure_keep(&s->first_error, status);
    return async_writer_close(&s);
}

static struct pending *copy_row(const struct frame_row *row)
{
    struct pending *p = malloc(sizeof *p + row->color_bytes + row->depth_bytes + row->mask_bytes);
    if (!p)
        return NULL;
    p->next = NULL;
    p->row = *row;
    if (row->skeleton) {
        p->skeleton = *row->skeleton;
        p->row.skeleton = &p->skeleton;
    }
    uint8_t *at = p->bytes;
    const uint8_t **images[] = {&p->row.color, &p->row.depth, &p->row.mask};
    const size_t counts[] = {row->color_bytes, row->depth_bytes, row->mask_bytes};
    for (size_t i = 0; i < COUNT_OF(images); i++)
        if (*images[i]) {
            memcpy(at, *images[i], counts[i]);
            *images[i] = at;
            at += counts[i];
        }
    return p;
}

// Called with the lock held, before the batch gets a new row.
static void begin_batch(struct async_writer *writer)
{
    if (writer->batch.since_ns == INT64_MAX) {
        writer->batch.since_ns = clock_now_ns();
        pthread_cond_broadcast(&writer->wake); // starts the BATCH_NS timeout
    }
}

enum status async_writer_add_frame(struct async_writer *writer, const struct frame_row *row)
{
    struct pending *p = copy_row(row);
    if (!p)
        return fail(ERR_MEMORY, "no memory for a frame of %s", database_path(writer->db));
    pthread_mutex_lock(&writer->lock);
    while (writer->first_error.status == OK && writer->writing && writer->batch.bytes > PENDING_BYTES_MAX)
        pthread_cond_wait(&writer->done, &writer->lock);
    enum status status = failure_restore(&writer->first_error);
    if (status == OK) {
        begin_batch(writer);
        struct batch *b = &writer->batch;
        *(b->first ? b->last : &b->first) = p;
        b->last = &p->next;
        const size_t bytes = sizeof *p + row->color_bytes + row->depth_bytes + row->mask_bytes;
        b->bytes += bytes;
        struct recording_counters *c = &writer->counters;
        c->waiting_bytes += (int64_t)bytes;
        c->waiting_frames++;
        c->waiting_frames_max = c->waiting_frames > c->waiting_frames_max ? c->waiting_frames : c->waiting_frames_max;
        if (row->time_ns - b->first->row.time_ns >= BATCH_NS) {
            writer->due = true;
            pthread_cond_broadcast(&writer->wake);
        }
    } else {
        free(p);
    }
    pthread_mutex_unlock(&writer->lock);
    return status;
}

void async_writer_count(struct async_writer *writer, struct recording_counters *out)
{
    pthread_mutex_lock(&writer->lock);
    *out = writer->counters;
    out->failed = writer->first_error.status != OK;
    pthread_mutex_unlock(&writer->lock);
}

enum status async_writer_put_take(struct async_writer *writer, const struct take_row *row)
{
    pthread_mutex_lock(&writer->lock);
    enum status status = failure_restore(&writer->first_error);
    if (status == OK) {
        begin_batch(writer);
        writer->batch.take = *row;
        writer->batch.has_take = true;
    }
    pthread_mutex_unlock(&writer->lock);
    return status;
}

enum status async_writer_pause(struct async_writer *writer)
{
    pthread_mutex_lock(&writer->lock);
    while (writer->writing)
        pthread_cond_wait(&writer->done, &writer->lock);
    return write_pending(writer, false);
}

enum status async_writer_resume(struct async_writer *writer, enum status status)
{
    if (status < 0)
        status = set_error(writer, status);
    writer->unsynced = true;
    pthread_cond_broadcast(&writer->wake);
    pthread_mutex_unlock(&writer->lock);
    return status;
}

enum status async_writer_close(struct async_writer **async_writer)
{
    struct async_writer *s = *async_writer;
    if (!s)
        return OK;
    *async_writer = NULL;
    enum status written = async_writer_pause(s); // takes the lock; a failure is kept in s->first_error
    (void)written;
    s->stop = true;
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
    if (s->has_writer)
        pthread_join(s->writer, NULL);
    if (s->has_checkpointer)
        pthread_join(s->checkpointer, NULL);
    empty_batch(&s->batch);
    database_close(&s->guard_db);
    database_close(&s->checkpoint_db);
    statement_close(&s->add_frame);
    statement_close(&s->add_joint_error);
    statement_close(&s->add_image);
    statement_close(&s->put_take);
    pthread_cond_destroy(&s->wake);
    pthread_cond_destroy(&s->done);
    pthread_mutex_destroy(&s->lock);
    enum status status = failure_restore(&s->first_error);
    free(s);
    return status;
}
