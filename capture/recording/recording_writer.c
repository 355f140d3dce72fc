// Writing a recording. Frames gather in one transaction, committed every half
// second by the sensor's clock (by whoever adds the next frame) and by the wall
// clock (by the keeper, a thread of the writer's own, when no frame comes). The
// keeper also moves every commit from the log into the file and waits for the
// disk there, so that the thread that adds frames never does.
#include "capture/recording/depth_codec.h"
#include "capture/recording/recording_schema.h"

#include "platform/clock.h"
#include "platform/jpeg.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { BATCH_NS = 500000000 };

struct recording_writer {
    struct database *db;
    struct statement *add_frame, *add_picture, *put_take;
    struct depth_coder *coder, *mask_coder; // each lends its bytes until its next call

    // The open take; its row is rewritten whole.
    bool taking;
    int64_t take_id, frames, last_time_ns;
    char name[TAKE_NAME_BYTES + 1];
    struct calibration calibration;
    struct body body;
    int64_t dropped;
    bool complete;

    // The batch, and what the keeper shares.
    pthread_mutex_t lock; // over everything above and below while a call is at work
    pthread_cond_t wake;
    pthread_t keeper;
    bool has_keeper, stop, unsynced; // unsynced: committed, not yet moved into the file
    struct database *keeper_db;
    int64_t batch_began_ns; // wall clock
    int64_t batch_time_ns;  // the sensor's, of the batch's first frame; INT64_MIN: none yet

    enum status broken; // the first error of the file itself; from then on nothing is written
    char sentence[512];
};

// ------------------------------------------------------------- batches

// The caller holds the lock, in all of this section.
static enum status broke(struct recording_writer *w, enum status status)
{
    if (w->broken == OK) {
        w->broken = status;
        snprintf(w->sentence, sizeof w->sentence, "%s", status_sentence());
        // Whatever this says, the file is as the last commit left it.
        enum status rolled_back = database_in_transaction(w->db) ? database_run(w->db, "ROLLBACK") : OK;
        (void)rolled_back;
    }
    return fail(w->broken, "%s", w->sentence);
}

static enum status begin_batch(struct recording_writer *w)
{
    if (w->broken != OK)
        return fail(w->broken, "%s", w->sentence);
    if (database_in_transaction(w->db))
        return OK;
    w->batch_began_ns = clock_now_ns();
    w->batch_time_ns = INT64_MIN;
    enum status status = database_run(w->db, "BEGIN IMMEDIATE");
    return status == OK ? OK : broke(w, status);
}

static enum status commit(struct recording_writer *w)
{
    if (w->broken != OK)
        return fail(w->broken, "%s", w->sentence);
    if (!database_in_transaction(w->db))
        return OK;
    enum status status = database_run(w->db, "COMMIT");
    if (status != OK)
        return broke(w, status);
    w->unsynced = true;
    pthread_cond_signal(&w->wake);
    return OK;
}

static void *keep(void *argument)
{
    struct recording_writer *w = argument;
    pthread_mutex_lock(&w->lock);
    while (!w->stop) {
        int64_t now = clock_now_ns(), due = now + BATCH_NS;
        if (w->broken == OK && database_in_transaction(w->db)) {
            due = w->batch_began_ns + BATCH_NS;
            if (now >= due && commit(w) != OK)
                continue; // kept in w->broken
        }
        if (w->unsynced && w->broken == OK) {
            w->unsynced = false;
            pthread_mutex_unlock(&w->lock);
            int64_t left;
            enum status status = database_checkpoint(w->keeper_db, &left);
            pthread_mutex_lock(&w->lock);
            if (status != OK)
                broke(w, status);
            continue;
        }
        struct timespec until = {.tv_sec = due / 1000000000, .tv_nsec = due % 1000000000};
        pthread_cond_timedwait(&w->wake, &w->lock, &until);
    }
    pthread_mutex_unlock(&w->lock);
    return NULL;
}

static enum status start_keeper(struct recording_writer *w)
{
    enum status status = database_open(&w->keeper_db, database_path(w->db), DATABASE_WRITE);
    if (status == OK)
        status = database_run(w->keeper_db, "PRAGMA synchronous = NORMAL; PRAGMA wal_autocheckpoint = 0");
    if (status != OK)
        return status;
    if (pthread_create(&w->keeper, NULL, keep, w))
        return fail(ERR_MEMORY, "no thread to write %s", database_path(w->db));
    w->has_keeper = true;
    return OK;
}

// ------------------------------------------------------------- opening and closing

// Stops, closes and frees everything; returns the first error the writer met,
// with its sentence.
static enum status release(struct recording_writer **w)
{
    struct recording_writer *gone = *w;
    *w = NULL;
    if (gone->has_keeper) {
        pthread_mutex_lock(&gone->lock);
        gone->stop = true;
        pthread_cond_signal(&gone->wake);
        pthread_mutex_unlock(&gone->lock);
        pthread_join(gone->keeper, NULL);
    }
    database_close(&gone->keeper_db);
    statement_close(&gone->add_frame);
    statement_close(&gone->add_picture);
    statement_close(&gone->put_take);
    if (gone->broken == OK) {
        enum status settled = database_settle(gone->db);
        if (settled != OK)
            broke(gone, settled);
    }
    database_close(&gone->db);
    depth_coder_close(&gone->coder);
    depth_coder_close(&gone->mask_coder);
    pthread_cond_destroy(&gone->wake);
    pthread_mutex_destroy(&gone->lock);
    enum status status = gone->broken == OK ? OK : fail(gone->broken, "%s", gone->sentence);
    free(gone);
    return status;
}

static enum status prepare(struct recording_writer *w)
{
    enum status status = depth_coder_open(&w->coder);
    if (status == OK)
        status = depth_coder_open(&w->mask_coder);
    if (status == OK)
        status = statement_open(&w->add_frame, w->db, "INSERT INTO frame(" FRAME_COLUMNS ") VALUES(?,?,?,?,?,?,?)");
    if (status == OK)
        status =
            statement_open(&w->add_picture, w->db, "INSERT INTO picture(" PICTURE_COLUMNS ") VALUES(?,?,?,?,?,?,?)");
    if (status == OK)
        status = statement_open(&w->put_take, w->db,
                                "INSERT OR REPLACE INTO take(" TAKE_COLUMNS ") VALUES(?,?,?,?,?,?,?)");
    return status == OK ? start_keeper(w) : status;
}

static enum status new_writer(struct recording_writer **out)
{
    struct recording_writer *w = calloc(1, sizeof *w);
    *out = w;
    if (!w)
        return fail(ERR_MEMORY, "no memory to write a recording");
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&w->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    pthread_mutex_init(&w->lock, NULL);
    return OK;
}

// The writer could not be made: frees what there is of it, says why again.
static enum status give_up(struct recording_writer **w, enum status status)
{
    (*w)->broken = status;
    snprintf((*w)->sentence, sizeof (*w)->sentence, "%s", status_sentence());
    return release(w);
}

enum status recording_create(struct recording_writer **out, const char *path)
{
    enum status status = new_writer(out);
    if (status != OK)
        return status;
    struct recording_writer *w = *out;
    status = database_open(&w->db, path, DATABASE_CREATE);
    if (status != OK)
        return give_up(out, status); // and leave alone what was there before
    status = database_run(w->db, "PRAGMA page_size = 65536");
    if (status == OK)
        status = database_claim(w->db);
    if (status == OK)
        status = recording_make_tables(w->db);
    if (status == OK)
        status = prepare(w);
    if (status == OK)
        return OK;
    status = give_up(out, status);
    static const char *const endings[] = {"", "-wal", "-shm"};
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char name[4200];
        if (snprintf(name, sizeof name, "%s%s", path, endings[i]) < (int)sizeof name)
            unlink(name);
    }
    return status;
}

enum status recording_append(struct recording_writer **out, const char *path)
{
    enum status status = new_writer(out);
    if (status != OK)
        return status;
    struct recording_writer *w = *out;
    status = database_open(&w->db, path, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(w->db);
    if (status == OK)
        status = database_claim(w->db);
    if (status == OK)
        status = prepare(w);
    return status == OK ? OK : give_up(out, status);
}

enum status recording_close(struct recording_writer **w)
{
    if (!*w)
        return OK;
    pthread_mutex_lock(&(*w)->lock);
    enum status committed = commit(*w); // a failure is kept, and told by release()
    (void)committed;
    pthread_mutex_unlock(&(*w)->lock);
    return release(w);
}

// ------------------------------------------------------------- the place

static enum status check_place(const struct place *p)
{
    enum status status = calibration_check(&p->calibration);
    if (status != OK)
        return status;
    if (p->tag_count < 0 || p->tag_count > PLACE_ITEMS_MOST || p->point_count < 0 ||
        p->point_count > PLACE_ITEMS_MOST || p->view_count < 0 || p->view_count > PLACE_ITEMS_MOST)
        return fail(ERR_INPUT, "the place has more tags, points or views than a recording can hold");
    bool finite = isfinite(p->rms_px) && isfinite(p->rms_m);
    for (int32_t i = 0; i < p->tag_count; i++)
        finite = finite && pose_finite(p->tags[i].world_from_tag) && isfinite(p->tags[i].side_m) &&
                 isfinite(p->tags[i].rms_px);
    for (int32_t i = 0; i < p->point_count; i++)
        finite = finite && v3_finite(p->points[i].world);
    for (int32_t i = 0; i < p->view_count; i++)
        finite = finite && pose_finite(p->views[i].world_from_camera);
    return finite ? OK : fail(ERR_INPUT, "the place holds a number that is not finite");
}

static enum status put_place_row(struct recording_writer *w, const struct place *p)
{
    size_t tag_bytes = (size_t)p->tag_count * TAG_BYTES, point_bytes = (size_t)p->point_count * POINT_BYTES;
    uint8_t calibration[CALIBRATION_BYTES], residuals[RESIDUAL_BYTES];
    uint8_t *tags = malloc(tag_bytes + 1), *points = malloc(point_bytes + 1); // never of no bytes: that is NULL
    struct statement *s = NULL;
    enum status status = OK;
    if (!tags || !points)
        status = fail(ERR_MEMORY, "no memory to write the place");
    if (status == OK)
        status = statement_open(&s, w->db, "INSERT INTO place(id, " PLACE_COLUMNS ") VALUES(1,?,?,?,?,?)");
    if (status == OK) {
        put_calibration(calibration, &p->calibration);
        put_residuals(residuals, p->rms_px, p->rms_m);
        for (int32_t i = 0; i < p->tag_count; i++)
            put_tag(tags + (size_t)i * TAG_BYTES, &p->tags[i]);
        for (int32_t i = 0; i < p->point_count; i++)
            put_point(points + (size_t)i * POINT_BYTES, &p->points[i]);
        uint32_t crc = crc32_of(crc32_of(0, calibration, sizeof calibration), residuals, sizeof residuals);
        statement_bind_blob(s, 1, calibration, sizeof calibration);
        statement_bind_blob(s, 2, residuals, sizeof residuals);
        statement_bind_blob(s, 3, tags, tag_bytes);
        statement_bind_blob(s, 4, points, point_bytes);
        statement_bind_number(s, 5, crc32_of(crc32_of(crc, tags, tag_bytes), points, point_bytes));
        status = statement_run(s);
    }
    statement_close(&s);
    free(tags);
    free(points);
    return status;
}

static enum status put_views(struct recording_writer *w, const struct place *p)
{
    struct statement *s;
    enum status status = statement_open(&s, w->db, "INSERT INTO place_view(" VIEW_COLUMNS ") VALUES(?,?,?,?,?)");
    for (int32_t i = 0; status == OK && i < p->view_count; i++) {
        const struct place_view *view = &p->views[i];
        const uint8_t *depth = NULL;
        size_t depth_bytes = 0, jpeg_bytes = view->jpeg ? view->jpeg_bytes : 0;
        uint8_t pose[POSE_BYTES];
        put_pose(pose, &view->world_from_camera);
        if (view->depth && depth_pixels(&p->calibration))
            status = depth_encode(w->coder, view->depth, p->calibration.depth.width, p->calibration.depth.height,
                                  &depth, &depth_bytes);
        if (status != OK)
            break;
        statement_bind_number(s, 1, i);
        statement_bind_blob(s, 2, pose, sizeof pose);
        statement_bind_blob(s, 3, depth, depth_bytes);
        statement_bind_blob(s, 4, view->jpeg, jpeg_bytes);
        statement_bind_number(s, 5, view_crc(pose, depth, depth_bytes, view->jpeg, jpeg_bytes));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum status recording_put_place(struct recording_writer *w, const struct place *place)
{
    enum status status = check_place(place);
    if (status != OK)
        return status;
    pthread_mutex_lock(&w->lock);
    status = commit(w); // so that an error here takes no frame along
    if (status == OK)
        status = begin_batch(w);
    if (status == OK) {
        status = database_run(w->db, "DELETE FROM place; DELETE FROM place_view");
        if (status == OK)
            status = put_place_row(w, place);
        if (status == OK)
            status = put_views(w, place);
        status = status == OK ? commit(w) : broke(w, status);
    }
    pthread_mutex_unlock(&w->lock);
    return status;
}

// ------------------------------------------------------------- takes

static enum status put_take(struct recording_writer *w)
{
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    put_calibration(calibration, &w->calibration);
    put_body(body, &w->body);
    struct statement *s = w->put_take;
    statement_bind_number(s, 1, w->take_id);
    statement_bind_text(s, 2, w->name);
    statement_bind_blob(s, 3, calibration, sizeof calibration);
    statement_bind_number(s, 4, w->complete);
    statement_bind_number(s, 5, w->dropped);
    statement_bind_blob(s, 6, body, sizeof body);
    statement_bind_number(s, 7, take_crc(w->name, calibration, w->complete, w->dropped, body));
    enum status status = statement_run(s);
    return status == OK ? OK : broke(w, status);
}

static enum status check_name(const char *name)
{
    size_t length = strlen(name);
    if (!length || length > TAKE_NAME_BYTES)
        return fail(ERR_INPUT, "a take's name has 1 to %d bytes, not %zu", TAKE_NAME_BYTES, length);
    for (const char *c = name; *c; c++)
        if ((unsigned char)*c < 32 || *c == 127)
            return fail(ERR_INPUT, "a take's name cannot hold control characters");
    return OK;
}

// NOTHING: no take of that name yet.
static enum status find_take(struct recording_writer *w, const char *name)
{
    struct statement *s;
    enum status status = statement_open(&s, w->db, "SELECT id FROM take WHERE name = ?");
    if (status == OK) {
        statement_bind_text(s, 1, name);
        status = statement_step(s);
    }
    statement_close(&s);
    return status;
}

enum status recording_begin_take(struct recording_writer *w, const char *name, const struct calibration *calibration)
{
    assert(!w->taking);
    enum status status = check_name(name);
    if (status == OK)
        status = calibration_check(calibration);
    if (status != OK)
        return status;
    pthread_mutex_lock(&w->lock);
    status = begin_batch(w);
    if (status == OK) {
        status = find_take(w, name);
        if (status == OK)
            status = fail(ERR_EXISTS, "%s has a take '%s' already; choose another name", database_path(w->db), name);
        else if (status == NOTHING)
            status = database_number(w->db, "SELECT coalesce(max(id), 0) + 1 FROM take", &w->take_id);
        if (status != OK && status != ERR_EXISTS)
            status = broke(w, status);
    }
    if (status == OK) {
        w->frames = 0;
        w->dropped = 0;
        w->complete = false;
        w->calibration = *calibration;
        w->body = (struct body){.representative_frame = -1};
        snprintf(w->name, sizeof w->name, "%s", name);
        status = put_take(w);
    }
    if (status == OK)
        w->taking = true;
    enum status committed = commit(w);
    if (status == OK)
        status = committed;
    pthread_mutex_unlock(&w->lock);
    return status;
}

enum status recording_put_body(struct recording_writer *w, const struct body *body)
{
    assert(w->taking);
    if (!body_is_finite(body))
        return fail(ERR_INPUT, "a body's radius is not finite");
    pthread_mutex_lock(&w->lock);
    enum status status = begin_batch(w);
    if (status == OK) {
        w->body = *body;
        status = put_take(w);
    }
    pthread_mutex_unlock(&w->lock);
    return status;
}

enum status recording_put_dropped(struct recording_writer *w, int64_t dropped)
{
    assert(w->taking && dropped >= 0);
    pthread_mutex_lock(&w->lock);
    enum status status = begin_batch(w);
    if (status == OK) {
        w->dropped = dropped;
        status = put_take(w);
    }
    pthread_mutex_unlock(&w->lock);
    return status;
}

enum status recording_end_take(struct recording_writer *w)
{
    assert(w->taking);
    pthread_mutex_lock(&w->lock);
    enum status status = begin_batch(w);
    if (status == OK) {
        w->complete = true;
        status = put_take(w);
    }
    if (status == OK)
        status = commit(w);
    w->taking = false;
    pthread_mutex_unlock(&w->lock);
    return status;
}

// ------------------------------------------------------------- frames

// A frame's pictures as they go into the file; NULL: not there.
struct coded {
    const uint8_t *color, *depth, *mask;
    size_t color_bytes, depth_bytes, mask_bytes;
};

static enum status check_frame(const struct recording_writer *w, const struct take_frame *f)
{
    const struct calibration *c = &w->calibration;
    if (w->frames && f->time_ns <= w->last_time_ns)
        return fail(ERR_ORDER, "a frame of %lld ns came after one of %lld ns", (long long)f->time_ns,
                    (long long)w->last_time_ns);
    if (w->frames > FRAME_NUMBER_MOST)
        return fail(ERR_INPUT, "the take '%s' is full", w->name);
    if (!pose_finite(f->world_from_camera) || (f->has_skeleton && !skeleton_is_finite(&f->skeleton)))
        return fail(ERR_INPUT, "a frame's pose or skeleton holds a number that is not finite");
    if ((f->depth || f->mask) && !depth_pixels(c))
        return fail(ERR_INPUT, "a frame has depth but the take's calibration has no depth camera");
    if (f->jpeg) {
        int width, height;
        enum status status = jpeg_size(f->jpeg, f->jpeg_bytes, &width, &height);
        if (status != OK)
            return fail(ERR_INPUT, "a frame's colour cannot be kept: %s", status_sentence());
        if (width != c->color.width || height != c->color.height)
            return fail(ERR_INPUT, "a frame's colour has %d x %d pixels where the calibration says %d x %d", width,
                        height, c->color.width, c->color.height);
    }
    return OK;
}

static enum status code_pictures(struct recording_writer *w, const struct take_frame *f, struct coded *out)
{
    const struct lens *lens = &w->calibration.depth;
    *out = (struct coded){.color = f->jpeg, .color_bytes = f->jpeg ? f->jpeg_bytes : 0};
    enum status status = OK;
    if (f->mask)
        status = mask_encode(w->mask_coder, f->mask, lens->width, lens->height, &out->mask, &out->mask_bytes);
    if (status == OK && f->depth)
        status = depth_encode(w->coder, f->depth, lens->width, lens->height, &out->depth, &out->depth_bytes);
    return status;
}

static enum status add_rows(struct recording_writer *w, const struct take_frame *f, const struct coded *p)
{
    uint8_t pose[POSE_BYTES], skeleton[SKELETON_BYTES];
    size_t skeleton_bytes = f->has_skeleton ? sizeof skeleton : 0;
    int64_t key = frame_key(w->take_id, w->frames);
    unsigned pictures = (p->color ? TAKE_COLOR : 0u) | (p->depth ? TAKE_DEPTH : 0u) | (p->mask ? TAKE_MASK : 0u);
    put_pose(pose, &f->world_from_camera);
    if (f->has_skeleton)
        put_skeleton(skeleton, &f->skeleton);
    struct statement *s = w->add_frame;
    statement_bind_number(s, 1, key);
    statement_bind_number(s, 2, f->time_ns);
    statement_bind_number(s, 3, f->located);
    statement_bind_blob(s, 4, pose, sizeof pose);
    statement_bind_blob(s, 5, f->has_skeleton ? skeleton : NULL, skeleton_bytes);
    statement_bind_number(s, 6, pictures);
    statement_bind_number(s, 7, frame_crc(f->time_ns, f->located, pose, skeleton, skeleton_bytes, pictures));
    enum status status = statement_run(s);
    if (status != OK || !pictures)
        return status;
    s = w->add_picture;
    statement_bind_number(s, 1, key);
    if (p->mask)
        statement_bind_number(s, 2, crc32_of(0, p->mask, p->mask_bytes));
    if (p->depth)
        statement_bind_number(s, 3, crc32_of(0, p->depth, p->depth_bytes));
    if (p->color)
        statement_bind_number(s, 4, crc32_of(0, p->color, p->color_bytes));
    statement_bind_blob(s, 5, p->mask, p->mask_bytes);
    statement_bind_blob(s, 6, p->depth, p->depth_bytes);
    statement_bind_blob(s, 7, p->color, p->color_bytes);
    return statement_run(s);
}

enum status recording_add_frame(struct recording_writer *w, const struct take_frame *frame)
{
    assert(w->taking);
    struct coded coded;
    enum status status = check_frame(w, frame);
    if (status == OK)
        status = code_pictures(w, frame, &coded);
    if (status != OK)
        return status;
    pthread_mutex_lock(&w->lock);
    bool due = database_in_transaction(w->db) &&
               (clock_now_ns() - w->batch_began_ns >= BATCH_NS ||
                (w->batch_time_ns != INT64_MIN && frame->time_ns - w->batch_time_ns >= BATCH_NS));
    status = due ? commit(w) : OK;
    if (status == OK)
        status = begin_batch(w);
    if (status == OK) {
        if (w->batch_time_ns == INT64_MIN)
            w->batch_time_ns = frame->time_ns;
        status = add_rows(w, frame, &coded);
        if (status != OK)
            status = broke(w, status);
    }
    if (status == OK) {
        w->last_time_ns = frame->time_ns;
        w->frames++;
    }
    pthread_mutex_unlock(&w->lock);
    return status;
}
