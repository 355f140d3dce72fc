// Writing a recording: checks and encodes what is given; async_writer.h stores it.
#include "base/text.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "recording/async_writer.h"
#include "recording/depth_codec.h"
#include "recording/recording_reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct recording_writer {
    struct database *db; // used here only between async_writer_pause and async_writer_resume
    struct async_writer *async_writer;
    struct depth_coder *coder, *mask_coder; // two, since each owns the bytes of its last call
    bool in_take;
    struct take_row take; // the one that is open, or was last
    int64_t frames, last_time_ns;
};

// ------------------------------------------------------------- opening and closing

// Frees everything; returns the first error the writer met, with its sentence. The log is checkpointed and removed only
// if there was no error.
static enum status release_writer(struct recording_writer **writer, enum status status)
{
    struct failure first;
    failure_keep(&first, status);
    struct recording_writer *closing = *writer;
    *writer = NULL;
    enum status written = async_writer_close(&closing->async_writer);
    if (written == OK && status == OK)
        written = database_close_wal(closing->db);
    database_close(&closing->db);
    depth_coder_close(&closing->coder);
    depth_coder_close(&closing->mask_coder);
    free(closing);
    return status == OK ? written : failure_restore(&first);
}

static enum status prepare_writer(struct recording_writer *writer)
{
    enum status status = depth_coder_open(&writer->coder);
    if (status == OK)
        status = depth_coder_open(&writer->mask_coder);
    return status == OK ? async_writer_open(&writer->async_writer, writer->db) : status;
}

// An empty recording, made under another name and renamed, so that a kill leaves either none or a whole one.
static enum status make_empty(const char *path)
{
    char part[FILE_PATH_BYTES];
    struct database *db = NULL;
    if (file_exists(path))
        return fail(ERR_EXISTS, "%s is there already; choose another name or remove it first", path);
    enum status status = database_check_name(path);
    if (status == OK)
        status = file_begin(path, part);
    if (status != OK)
        return status;
    status = database_open(&db, part, DATABASE_WRITE);
    if (status == OK)
        status = database_run(db, "PRAGMA page_size = 65536");
    if (status == OK)
        status = recording_make_tables(db);
    if (status == OK)
        return database_rename(&db, path);
    database_close(&db);
    recording_remove_files(part);
    return status;
}

enum status recording_check_new(const char *path)
{
    const enum status status = file_check_output(path, false);
    return status == OK ? database_check_name(path) : status;
}

enum status recording_create(struct recording_writer **out, const char *path)
{
    *out = NULL;
    enum status status = make_empty(path);
    if (status != OK)
        return status;
    status = recording_append(out, path);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        recording_remove_files(path);
        return failure_restore(&first);
    }
    return OK;
}

enum status recording_append(struct recording_writer **out, const char *path)
{
    struct recording_writer *w = *out = calloc(1, sizeof *w);
    if (!w)
        return fail(ERR_MEMORY, "no memory to write %s", path);
    enum status status = database_open(&w->db, path, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(w->db);
    if (status == OK)
        status = database_lock_writer(w->db);
    if (status == OK)
        status = database_run(w->db, JOINT_ERROR_TABLE); // older files lack it
    if (status == OK)
        status = recording_raise_schema(w->db);
    if (status == OK)
        status = recording_add_columns(w->db);
    if (status == OK)
        status = prepare_writer(w);
    return status == OK ? OK : release_writer(out, status);
}

enum status recording_check_change(const char *path)
{
    struct database *db;
    enum status status = database_open(&db, path, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(db);
    if (status == OK)
        status = database_check_change(db);
    database_close(&db);
    return status;
}

enum status recording_close(struct recording_writer **writer)
{
    if (!*writer)
        return OK;
    return release_writer(writer, (*writer)->in_take && !(*writer)->frames ? recording_end_take(*writer) : OK);
}

// ------------------------------------------------------------- the place

static enum status check_place(const struct place *place)
{
    enum status status = calibration_check(&place->calibration);
    if (status != OK)
        return status;
    if (place->tag_count < 0 || place->tag_count > PLACE_ITEMS_MAX || place->point_count < 0 ||
        place->point_count > PLACE_ITEMS_MAX || place->view_count < 0 || place->view_count > PLACE_ITEMS_MAX)
        return fail(ERR_INPUT, "the place has more tags, points or views than a recording can hold");
    return place_is_finite(place) ? OK : fail(ERR_INPUT, "the place holds a number that is not finite or out of range");
}

static enum status put_place_row(struct database *db, const struct place *place)
{
    size_t tag_bytes = (size_t)place->tag_count * TAG_BYTES, point_bytes = (size_t)place->point_count * POINT_BYTES;
    uint8_t calibration[CALIBRATION_BYTES], residuals[RESIDUAL_BYTES];
    uint8_t *tags = malloc(tag_bytes + 1), *points = malloc(point_bytes + 1); // + 1: malloc(0) may be NULL
    struct statement *s = NULL;
    enum status status = OK;
    if (!tags || !points)
        status = fail(ERR_MEMORY, "no memory to write the place");
    if (status == OK)
        status = insert_open(&s, db, TABLE_PLACE, false);
    if (status == OK) {
        put_calibration(calibration, &place->calibration);
        put_residuals(residuals, place->rms_px, place->rms_m);
        for (int32_t i = 0; i < place->tag_count; i++)
            put_tag(tags + (size_t)i * TAG_BYTES, &place->tags[i]);
        for (int32_t i = 0; i < place->point_count; i++)
            put_point(points + (size_t)i * POINT_BYTES, &place->points[i]);
        uint32_t crc = crc32_of(crc32_of(0, calibration, sizeof calibration), residuals, sizeof residuals);
        statement_bind_blob(s, 1, calibration, sizeof calibration);
        statement_bind_blob(s, 2, residuals, sizeof residuals);
        statement_bind_blob(s, 3, tags, tag_bytes);
        statement_bind_blob(s, 4, points, point_bytes);
        crc = crc32_of(crc32_of(crc, tags, tag_bytes), points, point_bytes);
        statement_bind_number(s, 5, crc);
        statement_bind_number(s, PLACE_VIEWS + 1, place->view_count);
        statement_bind_number(s, PLACE_SEAL + 1, place_seal(crc, place->view_count));
        status = statement_run(s);
    }
    statement_close(&s);
    free(tags);
    free(points);
    return status;
}

// Writes the optional tables of landmarks and tags.
static enum status put_optional(struct database *db, const struct place *place)
{
    static const char *const insert[OPTIONAL_TABLE_COUNT] = {
        "INSERT INTO point_error(id, covariances, crc) VALUES(1,?,?)",
        "INSERT INTO tag_error(id, covariances, crc) VALUES(1,?,?)",
        "INSERT INTO point_side(id, directions, crc) VALUES(1,?,?)"};
    const size_t points = (size_t)place->point_count, tags = (size_t)place->tag_count;
    const size_t bytes[OPTIONAL_TABLE_COUNT] = {points * POINT_ERROR_BYTES, tags * TAG_ERROR_BYTES,
                                                points * POINT_SIDE_BYTES};
    uint8_t *known = malloc(bytes[0] + bytes[1] + bytes[2] + 1);
    if (!known)
        return fail(ERR_MEMORY, "no memory to write the place");
    uint8_t *tag = known + bytes[0], *side = tag + bytes[1];
    for (size_t i = 0; i < points; i++) {
        put_point_error(known + i * POINT_ERROR_BYTES, &place->points[i]);
        put_point_side(side + i * POINT_SIDE_BYTES, &place->points[i]);
    }
    for (size_t i = 0; i < tags; i++)
        put_tag_error(tag + i * TAG_ERROR_BYTES, &place->tags[i]);
    enum status status = OK;
    const uint8_t *first = known;
    for (int k = 0; k < OPTIONAL_TABLE_COUNT && status == OK; first += bytes[k++]) {
        struct statement *s;
        status = statement_open(&s, db, insert[k]);
        if (status == OK) {
            statement_bind_blob(s, 1, first, bytes[k]);
            statement_bind_number(s, 2, crc32_of(0, first, bytes[k]));
            status = statement_run(s);
        }
        statement_close(&s);
    }
    free(known);
    return status;
}

static enum status put_views(struct database *db, struct depth_coder *coder, const struct place *place)
{
    struct statement *s;
    enum status status = insert_open(&s, db, TABLE_VIEW, false);
    for (int32_t i = 0; status == OK && i < place->view_count; i++) {
        const struct place_view *view = &place->views[i];
        const uint8_t *depth = NULL;
        size_t depth_bytes = 0, jpeg_bytes = view->jpeg ? view->jpeg_bytes : 0;
        uint8_t pose[POSE_BYTES];
        put_pose(pose, &view->world_from_camera);
        if (view->depth && depth_pixels(&place->calibration))
            status = depth_encode(coder, view->depth, place->calibration.depth.width, place->calibration.depth.height,
                                  &depth, &depth_bytes);
        if (status != OK)
            break;
        statement_bind_number(s, 1, i);
        statement_bind_blob(s, 2, pose, sizeof pose);
        statement_bind_blob(s, 3, depth, depth_bytes);
        statement_bind_blob(s, 4, view->jpeg, jpeg_bytes);
        const uint32_t crc = view_crc(pose, depth, depth_bytes, view->jpeg, jpeg_bytes);
        statement_bind_number(s, 5, crc);
        statement_bind_number(s, VIEW_SEAL + 1, row_seal(i, crc));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum status recording_put_place(struct recording_writer *writer, const struct place *place)
{
    enum status status = check_place(place);
    if (status != OK)
        return status;
    status = async_writer_pause(writer->async_writer);
    if (status == OK)
        status = database_begin(writer->db);
    if (status == OK)
        status = database_run(writer->db, "DELETE FROM place; DELETE FROM place_view;" OPTIONAL_TABLES
                                          "DELETE FROM point_error; DELETE FROM tag_error; DELETE FROM point_side");
    if (status == OK)
        status = put_place_row(writer->db, place);
    if (status == OK)
        status = put_optional(writer->db, place);
    if (status == OK)
        status = put_views(writer->db, writer->coder, place);
    if (status == OK)
        status = database_run(writer->db, "COMMIT");
    return async_writer_resume(writer->async_writer, status);
}

// ------------------------------------------------------------- takes

enum status take_name_check(const char *name)
{
    size_t length = strlen(name);
    if (!length || length > TAKE_NAME_BYTES)
        return fail(ERR_INPUT, "a take's name has 1 to %d bytes, not %zu", TAKE_NAME_BYTES, length);
    return text_is_printable(name) ? OK
                                   : fail(ERR_INPUT,
                                          "a take's name is UTF-8 text without control characters, and '%s' "
                                          "is not",
                                          name);
}

// NOTHING: there is no take of that name.
static enum status find_take(struct recording_writer *writer, const char *name)
{
    struct statement *s;
    enum status status = statement_open(&s, writer->db, "SELECT rowid FROM take WHERE name = ?");
    if (status == OK) {
        statement_bind_text(s, 1, name);
        status = statement_step(s);
    }
    statement_close(&s);
    return status;
}

// The database part of recording_begin_take, which only reads. Sets writer->take.id. ERR_EXISTS: the name is in use.
static enum status new_take_id(struct recording_writer *writer, const char *name)
{
    enum status status = find_take(writer, name);
    if (status == OK)
        return ERR_EXISTS;
    return status == NOTHING
               ? database_number(writer->db, "SELECT coalesce(max(rowid), 0) + 1 FROM take", &writer->take.id)
               : status;
}

enum status recording_begin_take(struct recording_writer *writer, const char *name,
                                 const struct calibration *calibration)
{
    assert(!writer->in_take);
    enum status status = take_name_check(name);
    if (status == OK)
        status = calibration_check(calibration);
    if (status != OK)
        return status;
    status = async_writer_pause(writer->async_writer);
    if (status == OK)
        status = new_take_id(writer, name);
    if (status == ERR_EXISTS) {
        async_writer_resume(writer->async_writer, OK); // the writer can go on
        return fail(ERR_EXISTS, "%s has a take '%s' already; choose another name", database_path(writer->db), name);
    }
    status = async_writer_resume(writer->async_writer, status);
    if (status != OK)
        return status;
    writer->frames = 0;
    writer->take = (struct take_row){
        .id = writer->take.id, .calibration = *calibration, .body = {.representative_frame = -1}, .frames = -1};
    snprintf(writer->take.name, sizeof writer->take.name, "%s", name);
    status = async_writer_put_take(writer->async_writer, &writer->take);
    if (status == OK)
        status =
            async_writer_resume(writer->async_writer,
                                async_writer_pause(writer->async_writer)); // committed, so that readers see the take
    writer->in_take = status == OK;
    return status;
}

enum status recording_put_body(struct recording_writer *writer, const struct body *body)
{
    assert(writer->take.id);
    if (!body_is_valid(body))
        return fail(ERR_INPUT, "a body's radius is not finite or out of range");
    writer->take.body = *body;
    return async_writer_put_take(writer->async_writer, &writer->take);
}

enum status recording_put_dropped(struct recording_writer *writer, int64_t dropped)
{
    assert(writer->in_take && dropped >= 0);
    writer->take.dropped = dropped;
    return async_writer_put_take(writer->async_writer, &writer->take);
}

// An empty take would only keep its name from being used.
static enum status remove_take(struct recording_writer *writer)
{
    struct statement *s = NULL;
    enum status status = async_writer_pause(writer->async_writer);
    if (status == OK)
        status = database_begin(writer->db);
    if (status == OK)
        status = statement_open(&s, writer->db, "DELETE FROM take WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, writer->take.id);
        status = statement_run(s);
    }
    statement_close(&s);
    if (status == OK)
        status = database_run(writer->db, "COMMIT");
    return async_writer_resume(writer->async_writer, status);
}

enum status recording_end_take(struct recording_writer *writer)
{
    assert(writer->in_take);
    writer->in_take = false;
    if (!writer->frames)
        return remove_take(writer);
    writer->take.complete = true;
    writer->take.frames = writer->frames;
    enum status status = async_writer_put_take(writer->async_writer, &writer->take);
    return status == OK ? async_writer_resume(writer->async_writer, async_writer_pause(writer->async_writer)) : status;
}

struct recording_counters recording_writer_count(const struct recording_writer *writer)
{
    struct recording_counters counters;
    async_writer_count(writer->async_writer, &counters);
    return counters;
}

const char *recording_writer_path(const struct recording_writer *writer) { return database_path(writer->db); }

// ------------------------------------------------------------- replacing skeletons

// read: selects a frame; write: updates its skeleton; forget, keep: delete and insert its covariances.
struct skeleton_statements {
    struct statement *read, *write, *forget, *keep;
};

static enum status open_skeleton_statements(struct skeleton_statements *statements, struct database *db)
{
    enum status status = select_open(&statements->read, db, TABLE_FRAME, "WHERE rowid = ?");
    if (status == OK)
        status =
            statement_open(&statements->write, db, "UPDATE frame SET skeleton = ?, crc = ?, seal = ? WHERE rowid = ?");
    if (status == OK)
        status = statement_open(&statements->forget, db, "DELETE FROM joint_error WHERE rowid = ?");
    return status == OK ? insert_open(&statements->keep, db, TABLE_JOINT_ERROR, false) : status;
}

static void close_skeleton_statements(struct skeleton_statements *statements)
{
    statement_close(&statements->read);
    statement_close(&statements->write);
    statement_close(&statements->forget);
    statement_close(&statements->keep);
}

static enum status replace_covariances(const struct skeleton_statements *statements, int64_t key,
                                       const struct skeleton *skeleton)
{
    uint8_t bytes[JOINT_ERROR_BYTES];
    statement_bind_number(statements->forget, 1, key);
    enum status status = statement_run(statements->forget);
    if (status != OK || !skeleton_has_known_joint(skeleton) || !skeleton_has_covariance(skeleton))
        return status;
    put_joint_error(bytes, skeleton);
    statement_bind_number(statements->keep, 1, key);
    statement_bind_blob(statements->keep, 2, bytes, sizeof bytes);
    const uint32_t crc = crc32_of(0, bytes, sizeof bytes);
    statement_bind_number(statements->keep, 3, crc);
    statement_bind_number(statements->keep, JOINT_ERROR_SEAL + 1, row_seal(key, crc));
    return statement_run(statements->keep);
}

// A key without a row is skipped.
static enum status replace_skeleton(const struct skeleton_statements *statements, int64_t key,
                                    const struct skeleton *skeleton)
{
    struct take_entry entry;
    uint8_t pose[POSE_BYTES], bytes[SKELETON_BYTES];
    statement_bind_number(statements->read, 1, key);
    enum status status = statement_step(statements->read);
    if (status == OK)
        status = frame_from_row(statements->read, &entry);
    unsigned images = status == OK ? (unsigned)statement_number(statements->read, 5) : 0;
    statement_reset(statements->read);
    if (status != OK || !entry.has_skeleton)
        return status == NOTHING ? OK : status;
    put_pose(pose, &entry.world_from_camera);
    put_skeleton(bytes, skeleton);
    size_t count = skeleton_has_known_joint(skeleton) ? sizeof bytes : 0;
    const uint8_t *blob = count ? bytes : NULL;
    statement_bind_blob(statements->write, 1, blob, count);
    const uint32_t crc = frame_crc(entry.time_ns, entry.located, pose, blob, count, images);
    statement_bind_number(statements->write, 2, crc);
    statement_bind_number(statements->write, 3, row_seal(key, crc));
    statement_bind_number(statements->write, 4, key);
    status = statement_run(statements->write);
    return status == OK ? replace_covariances(statements, key, skeleton) : status;
}

enum status recording_put_skeletons(struct recording_writer *writer, const struct skeleton *const *skeleton,
                                    int64_t count)
{
    assert(!writer->in_take && writer->take.id && count <= writer->frames);
    struct skeleton_statements statements = {0};
    for (int64_t i = 0; i < count; i++)
        if (skeleton[i] && !skeleton_is_valid(skeleton[i]))
            return fail(ERR_INPUT, "a skeleton holds a number that is not finite or out of range");
    enum status status = async_writer_pause(writer->async_writer);
    if (status == OK)
        status = database_begin(writer->db);
    if (status == OK)
        status = open_skeleton_statements(&statements, writer->db);
    for (int64_t i = 0; status == OK && i < count; i++)
        if (skeleton[i])
            status = replace_skeleton(&statements, frame_key(writer->take.id, i), skeleton[i]);
    close_skeleton_statements(&statements);
    if (status == OK)
        status = database_run(writer->db, "COMMIT");
    return async_writer_resume(writer->async_writer, status);
}

// ------------------------------------------------------------- frames

static enum status check_frame(const struct recording_writer *writer, const struct take_frame *frame)
{
    const struct calibration *c = &writer->take.calibration;
    if (writer->frames && frame->time_ns <= writer->last_time_ns)
        return fail(ERR_ORDER, "a frame of %lld ns came after one of %lld ns", (long long)frame->time_ns,
                    (long long)writer->last_time_ns);
    if (frame->time_ns < -TAKE_TIME_MAX_NS || frame->time_ns > TAKE_TIME_MAX_NS)
        return fail(ERR_INPUT, "a frame's time, %lld ns, is of no clock", (long long)frame->time_ns);
    if (writer->frames > FRAME_NUMBER_MAX)
        return fail(ERR_INPUT, "the take '%s' is full", writer->take.name);
    if (!pose_is_valid(frame->world_from_camera) || (frame->has_skeleton && !skeleton_is_valid(&frame->skeleton)))
        return fail(ERR_INPUT, "a frame's pose or skeleton holds a number that is not finite or out of range");
    if ((frame->depth || frame->mask) && !depth_pixels(c))
        return fail(ERR_INPUT, "a frame has depth but the take's calibration has no depth camera");
    if (frame->jpeg) {
        int width, height;
        enum status status = jpeg_size(frame->jpeg, frame->jpeg_bytes, &width, &height);
        if (status != OK)
            return fail(ERR_INPUT, "a frame's colour cannot be kept: %s", status_message());
        if (width != c->color.width || height != c->color.height)
            return fail(ERR_INPUT, "a frame's colour has %d x %d pixels where the calibration says %d x %d", width,
                        height, c->color.width, c->color.height);
    }
    return OK;
}

enum status recording_add_frame(struct recording_writer *writer, const struct take_frame *frame)
{
    assert(writer->in_take);
    enum status status = check_frame(writer, frame);
    if (status != OK)
        return status;
    const struct lens *lens = &writer->take.calibration.depth;
    struct frame_row row = {
        .key = frame_key(writer->take.id, writer->frames),
        .time_ns = frame->time_ns,
        .located = frame->located,
        .world_from_camera = frame->world_from_camera,
        .skeleton = frame->has_skeleton ? &frame->skeleton : NULL,
        .color = frame->jpeg,
        .color_bytes = frame->jpeg ? frame->jpeg_bytes : 0,
    };
    if (frame->mask)
        status = mask_encode(writer->mask_coder, frame->mask, lens->width, lens->height, &row.mask, &row.mask_bytes);
    if (status == OK && frame->depth)
        status = depth_encode(writer->coder, frame->depth, lens->width, lens->height, &row.depth, &row.depth_bytes);
    if (status == OK)
        status = async_writer_add_frame(writer->async_writer, &row);
    if (status == OK) {
        writer->last_time_ns = frame->time_ns;
        writer->frames++;
    }
    return status;
}
