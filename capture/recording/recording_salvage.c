// The damaged file is only read, row by row by key: if the B-tree path to one row crosses a damaged page, the next row
// may still be readable.
#include "capture/recording/recorded_things.h"
#include "capture/recording/recording_salvage.h"

#include "capture/recording/little_endian.h"
#include "capture/recording/recording_reader.h"
#include "capture/recording/async_writer.h"
#include "platform/jpeg.h"

#include <stdio.h>
#include <string.h>

enum {
    LOST_ROWS_MAX = 20000, // after so many consecutive unreadable keys the search ends; chosen by hand
    LOST_TAKES_MAX = 100,
};

struct salvage {
    struct database *from, *to;
    struct async_writer *async_writer;
    struct statement *frame, *joint_error, *images, *takes; // of `from`; joint_error NULL: older
    struct recording_report *report;
};

// Only lack of memory ends a salvage; a row that cannot be read does not.
static bool is_fatal(enum status status) { return status == ERR_MEMORY; }

// ------------------------------------------------------------- frames

// One image's bytes if they are as written; else NULL and *damaged.
static const uint8_t *intact_blob(struct statement *s, int column, int crc_column, size_t *count, bool *damaged)
{
    const uint8_t *bytes = statement_blob(s, column, count);
    if (!bytes || crc32_of(0, bytes, *count) == statement_number(s, crc_column))
        return bytes;
    *damaged = true;
    *count = 0;
    return NULL;
}

static enum status copy_frame(struct salvage *v, int64_t key, int64_t new_key, const struct take_entry *entry)
{
    struct frame_row row = {
        .key = new_key,
        .time_ns = entry->time_ns,
        .located = entry->located,
        .world_from_camera = entry->world_from_camera,
        .skeleton = entry->has_skeleton ? &entry->skeleton : NULL,
    };
    bool damaged = false;
    statement_bind_number(v->images, 1, key);
    enum status status = statement_step(v->images);
    if (status == OK) {
        row.mask = intact_blob(v->images, 4, 1, &row.mask_bytes, &damaged);
        row.depth = intact_blob(v->images, 5, 2, &row.depth_bytes, &damaged);
        row.color = intact_blob(v->images, 6, 3, &row.color_bytes, &damaged);
    }
    damaged =
        damaged || !row.color != !entry->has_color || !row.depth != !entry->has_depth || !row.mask != !entry->has_mask;
    v->report->frames++;
    v->report->damaged_frames += damaged;
    status = is_fatal(status) ? status : async_writer_add_frame(v->async_writer, &row);
    statement_reset(v->images);
    return status;
}

// The frame's joints' covariances, where they can be read.
static void read_joint_error(struct salvage *v, int64_t key, struct take_entry *entry)
{
    if (!v->joint_error || !entry->has_skeleton)
        return;
    statement_bind_number(v->joint_error, 1, key);
    enum status status = statement_step(v->joint_error);
    if (status == OK)
        status = joint_error_from_row(v->joint_error, &entry->skeleton);
    (void)status; // a frame can be shown without them
    statement_reset(v->joint_error);
}

// The next readable frame from *key on. NOTHING: there is none.
static enum status next_frame(struct salvage *v, int64_t *key, int64_t last, struct take_entry *entry)
{
    for (int64_t lost = 0; lost < LOST_ROWS_MAX && *key <= last; lost++, ++*key) {
        statement_bind_number(v->frame, 1, *key);
        statement_bind_number(v->frame, 2, last);
        enum status status = statement_step(v->frame);
        if (status == OK) {
            *key = statement_number(v->frame, 0);
            status = frame_from_row(v->frame, entry);
        }
        statement_reset(v->frame);
        if (status == OK || status == NOTHING || is_fatal(status))
            return status;
    }
    return NOTHING;
}

static enum status copy_frames(struct salvage *v, struct take_row *take)
{
    int64_t first = frame_key(take->id, 0), last = frame_key(take->id, FRAME_NUMBER_MAX), key = first;
    int64_t saved = 0, last_saved = first, last_time_ns = 0, representative = -1;
    struct take_entry entry;
    enum status status;
    while ((status = next_frame(v, &key, last, &entry)) == OK) {
        if (!saved || entry.time_ns > last_time_ns) {
            read_joint_error(v, key, &entry);
            status = copy_frame(v, key, frame_key(take->id, saved), &entry);
            if (status != OK)
                return status;
            if (key == frame_key(take->id, take->body.representative_frame))
                representative = saved;
            last_time_ns = entry.time_ns;
            last_saved = key;
            saved++;
        }
        key++;
    }
    if (saved) // frames that are missing between saved ones
        v->report->damaged_frames += last_saved - first + 1 - saved;
    take->body.representative_frame = representative;
    return status == NOTHING ? OK : status;
}

// ------------------------------------------------------------- takes

// The size that the code of a mask or of a depth image states; both begin alike (docs/format.md).
static void coded_size(const uint8_t *bytes, size_t count, struct lens *lens)
{
    if (!bytes || count < 1 + 2 + 2)
        return;
    const uint8_t *at = bytes + 1;
    lens->width = get_u16(&at);
    lens->height = get_u16(&at);
}

// A damaged take row may state a wrong image size. The images state their own: the first undamaged one is used.
static enum status infer_sizes(struct salvage *v, struct take_row *take)
{
    int64_t key = frame_key(take->id, 0), last = frame_key(take->id, FRAME_NUMBER_MAX);
    struct take_entry entry;
    enum status status;
    for (bool found = false; !found && (status = next_frame(v, &key, last, &entry)) == OK; key++) {
        statement_bind_number(v->images, 1, key);
        if ((status = statement_step(v->images)) == OK) {
            struct lens *color = &take->calibration.color, *depth = &take->calibration.depth;
            size_t mask_bytes = 0, depth_bytes = 0, color_bytes = 0;
            bool damaged = false;
            const uint8_t *mask = intact_blob(v->images, 4, 1, &mask_bytes, &damaged);
            const uint8_t *depths = intact_blob(v->images, 5, 2, &depth_bytes, &damaged);
            const uint8_t *colors = intact_blob(v->images, 6, 3, &color_bytes, &damaged);
            found = !damaged && (mask || depths || colors);
            if (found) {
                coded_size(mask, mask_bytes, depth);
                coded_size(depths, depth_bytes, depth);
            }
            int width, height;
            if (found && colors && jpeg_size(colors, color_bytes, &width, &height) == OK)
                color->width = width, color->height = height;
        }
        statement_reset(v->images);
        if (is_fatal(status))
            return status;
    }
    return OK;
}

static enum status copy_take(struct salvage *v, struct take_row *take)
{
    // A lost name is replaced.
    if (!take->name[0])
        snprintf(take->name, sizeof take->name, "take %lld", (long long)take->id);
    v->report->takes++;
    v->report->interrupted_takes += !take->complete;
    enum status status = copy_frames(v, take);
    take->complete = true;
    if (take->dropped < 0)
        take->dropped = 0;
    return status == OK ? async_writer_put_take(v->async_writer, take) : status;
}

static enum status copy_takes(struct salvage *v)
{
    int64_t id = 1;
    for (int lost = 0; lost < LOST_TAKES_MAX; id++) {
        struct take_row take;
        bool usable = false;
        enum status row_status = OK;
        statement_bind_number(v->takes, 1, id);
        enum status status = statement_step(v->takes);
        if (status == OK) {
            row_status = take_from_row(v->takes, &take, &usable);
            id = statement_number(v->takes, 0);
        }
        statement_reset(v->takes);
        if (status == NOTHING)
            return OK;
        if (is_fatal(status))
            return status;
        lost = usable ? 0 : lost + 1;
        if (usable) {
            status = row_status == OK ? OK : infer_sizes(v, &take);
            if (status == OK)
                status = copy_take(v, &take);
            if (status == OK)
                status =
                    async_writer_resume(v->async_writer,
                                        async_writer_pause(v->async_writer)); // the writer holds one take row at a time
            if (status != OK)
                return status;
        }
    }
    return OK;
}

// ------------------------------------------------------------- the file

static enum status copy_place(const char *path, const char *to)
{
    struct recording *r;
    struct place place;
    enum status status = recording_open_as(&r, path, DATABASE_SALVAGE);
    if (status == OK)
        status = recording_read_place(r, &place);
    recording_free(&r);
    if (status != OK) // a take can be shown without its place
        return is_fatal(status) ? status : OK;
    struct recording_writer *w;
    status = recording_append(&w, to);
    if (status == OK)
        status = recording_put_place(w, &place);
    enum status closed = recording_close(&w);
    place_free(&place);
    return status == OK ? closed : status;
}

// Best effort: takes can be shown without what is known of things.
static enum status copy_things(const char *path, const char *to)
{
    struct recording *r;
    struct recorded_thing *things = NULL;
    int count = 0;
    enum status status = recording_open_as(&r, path, DATABASE_SALVAGE);
    if (status == OK)
        status = recording_read_things(r, &things, &count);
    recording_free(&r);
    if (status != OK)
        return is_fatal(status) ? status : OK;
    status = count ? recording_write_things(to, things, count) : OK;
    recorded_things_free(&things, count);
    return status;
}

static enum status open_joint_errors(struct salvage *v)
{
    bool there;
    enum status status = recording_has_joint_errors(v->from, &there);
    return status == OK && there ? statement_open(&v->joint_error, v->from,
                                                  "SELECT " JOINT_ERROR_COLUMNS " FROM joint_error WHERE rowid = ?")
                                 : status;
}

static enum status open_both(struct salvage *v, const char *path, const char *to)
{
    enum status status = database_open(&v->from, path, DATABASE_SALVAGE);
    if (status == OK)
        status = recording_check_tables(v->from);
    if (status == OK)
        status =
            statement_open(&v->frame, v->from,
                           "SELECT " FRAME_COLUMNS " FROM frame WHERE rowid BETWEEN ? AND ? ORDER BY rowid LIMIT 1");
    if (status == OK)
        status = open_joint_errors(v);
    if (status == OK)
        status = statement_open(&v->images, v->from, "SELECT " IMAGE_COLUMNS " FROM picture WHERE rowid = ?");
    if (status == OK)
        status = statement_open(&v->takes, v->from,
                                "SELECT " TAKE_COLUMNS " FROM take WHERE rowid >= ? ORDER BY rowid LIMIT 1");
    if (status == OK)
        status = database_open(&v->to, to, DATABASE_WRITE);
    if (status == OK)
        status = database_lock_writer(v->to);
    return status == OK ? async_writer_open(&v->async_writer, v->to) : status;
}

enum status recording_salvage(const char *path, const char *to, struct recording_report *report)
{
    *report = (struct recording_report){0};
    struct salvage v = {.report = report};
    struct recording_writer *w;
    enum status status = recording_create(&w, to);
    if (status == OK)
        status = recording_close(&w);
    if (status == OK)
        status = copy_place(path, to);
    if (status == OK)
        status = copy_things(path, to);
    if (status == OK)
        status = open_both(&v, path, to);
    if (status == OK)
        status = copy_takes(&v);
    struct failure first;
    failure_keep(&first, status);
    enum status written = async_writer_close(&v.async_writer);
    statement_close(&v.frame);
    statement_close(&v.joint_error);
    statement_close(&v.images);
    statement_close(&v.takes);
    database_close(&v.from);
    if (v.to && status == OK && written == OK)
        written = database_close_wal(v.to);
    database_close(&v.to);
    return status == OK ? written : failure_restore(&first);
}

enum status recording_complete_takes(struct database *db)
{
    struct statement *read, *write = NULL;
    enum status status = statement_open(&read, db, "SELECT " TAKE_COLUMNS " FROM take WHERE complete = 0 LIMIT 1");
    if (status == OK)
        status = statement_open(&write, db, "UPDATE take SET calibration = ?, complete = 1, crc = ? WHERE rowid = ?");
    while (status == OK && (status = statement_step(read)) == OK) {
        struct take_row take;
        bool usable;
        uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
        status = take_from_row(read, &take, &usable);
        statement_reset(read); // before the table is changed
        if (status != OK)
            break;
        put_calibration(calibration, &take.calibration);
        put_body(body, &take.body);
        statement_bind_blob(write, 1, calibration, sizeof calibration); // get_calibration may have corrected it
        statement_bind_number(write, 2, take_crc(take.name, calibration, true, take.dropped, body));
        statement_bind_number(write, 3, take.id);
        status = statement_run(write);
    }
    statement_close(&read);
    statement_close(&write);
    return status == NOTHING ? OK : status;
}
