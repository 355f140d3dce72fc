#include "recording/prepared.h"

#include "platform/files/compress.h"
#include "recording/recording_reader.h"

#include <stdlib.h>
#include <string.h>

enum { LEVEL = 1, BYTES_MAX = 1 << 30 };

uint32_t take_index_crc(const struct take *take)
{
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES], pose[POSE_BYTES], skeleton[SKELETON_BYTES];
    put_calibration(calibration, take_calibration(take));
    put_body(body, take_body(take));
    uint32_t crc = crc32_of(crc32_of(0, calibration, sizeof calibration), body, sizeof body);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        const unsigned images =
            (e->has_color ? TAKE_COLOR : 0u) | (e->has_depth ? TAKE_DEPTH : 0u) | (e->has_mask ? TAKE_MASK : 0u);
        put_pose(pose, &e->world_from_camera);
        put_skeleton(skeleton, &e->skeleton);
        const uint32_t row =
            frame_crc(e->time_ns, e->located, pose, skeleton, e->has_skeleton ? sizeof skeleton : 0, images);
        crc = crc32_of(crc, &row, sizeof row);
    }
    return crc;
}

static int64_t row_id(const struct take *take, enum prepared_kind kind) { return frame_key(take_id(take), kind); }

static enum status has_table(struct database *db, bool *out)
{
    int64_t tables = 0;
    enum status status = database_number(db, COUNT_TABLES("'prepared'"), &tables);
    *out = tables > 0;
    return status;
}

// Unpacks `packed`, whose first eight bytes are the plain size. NOTHING: damaged.
static enum status unpack_bytes(const uint8_t *packed, size_t packed_count, uint8_t **bytes, size_t *count)
{
    uint64_t plain = 0;
    struct compressor *compressor;
    if (packed_count < sizeof plain)
        return NOTHING;
    for (size_t i = 0; i < sizeof plain; i++)
        plain |= (uint64_t)packed[i] << 8 * i;
    if (!plain || plain > BYTES_MAX)
        return NOTHING;
    enum status status = compressor_open(&compressor);
    if (status != OK)
        return status;
    uint8_t *out = malloc((size_t)plain);
    status = out ? decompress_bytes(compressor, packed + sizeof plain, packed_count - sizeof plain, out, (size_t)plain)
                 : fail(ERR_MEMORY, "no memory for what a take has prepared");
    compressor_close(&compressor);
    if (status != OK) {
        free(out);
        return status == ERR_CORRUPT ? NOTHING : status;
    }
    *bytes = out;
    *count = (size_t)plain;
    return OK;
}

enum status prepared_read(const struct take *take, enum prepared_kind kind, int version, uint8_t **bytes, size_t *count)
{
    struct database *db = recording_database(take_recording(take));
    struct statement *s = NULL;
    bool there;
    enum status status = has_table(db, &there);
    if (status != OK || !there)
        return status == OK || status == ERR_CORRUPT ? NOTHING : status;
    status = statement_open(&s, db, "SELECT version, index_crc, data, crc FROM prepared WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, row_id(take, kind));
        status = statement_step(s);
    }
    if (status == OK) {
        size_t packed_count;
        const uint8_t *packed = statement_blob(s, 2, &packed_count);
        if (statement_number(s, 0) != version || statement_number(s, 1) != take_index_crc(take) ||
            statement_number(s, 3) != crc32_of(0, packed, packed_count))
            status = NOTHING;
        else
            status = unpack_bytes(packed, packed_count, bytes, count);
    }
    statement_close(&s);
    return status == ERR_CORRUPT || status == ERR_FORMAT ? NOTHING : status;
}

static enum status pack_bytes(const void *bytes, size_t count, uint8_t **packed, size_t *packed_count)
{
    struct compressor *compressor;
    enum status status = compressor_open(&compressor);
    if (status != OK)
        return status;
    uint8_t *out = malloc(8 + compress_bound(count));
    status = out ? compress_bytes(compressor, LEVEL, bytes, count, out + 8, packed_count)
                 : fail(ERR_MEMORY, "no memory to keep what a take has prepared");
    compressor_close(&compressor);
    if (status != OK) {
        free(out);
        return status;
    }
    for (size_t i = 0; i < 8; i++)
        out[i] = (uint8_t)((uint64_t)count >> 8 * i);
    *packed = out;
    *packed_count += 8;
    return OK;
}

// NOTHING: a recorder is writing the file: it is in write-ahead mode.
static enum status check_idle(struct database *db)
{
    struct statement *s;
    enum status status = statement_open(&s, db, "PRAGMA journal_mode");
    if (status == OK)
        status = statement_step(s);
    if (status == OK && !strcmp(statement_text(s, 0), "wal"))
        status = NOTHING;
    statement_close(&s);
    return status;
}

static enum status insert_prepared(struct database *db, const struct take *take, int64_t id, int version,
                                   const uint8_t *packed, size_t packed_count)
{
    struct statement *s = NULL;
    enum status status = statement_open(&s, db,
                                        "INSERT INTO prepared(id, version, index_crc, data, crc) VALUES(?,?,?,?,?) "
                                        "ON CONFLICT(id) DO UPDATE SET version = excluded.version, "
                                        "index_crc = excluded.index_crc, data = excluded.data, crc = excluded.crc "
                                        "WHERE version <= excluded.version");
    if (status == OK) {
        statement_bind_number(s, 1, id);
        statement_bind_number(s, 2, version);
        statement_bind_number(s, 3, take_index_crc(take));
        statement_bind_blob(s, 4, packed, packed_count);
        statement_bind_number(s, 5, crc32_of(0, packed, packed_count));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

// NOTHING: what lies at the path now has no such take: it was replaced, or the take was deleted or trimmed, since it
// was opened. The one person's body must not come into the other's file, nor be left where it was deleted.
static enum status check_same(struct recording *recording, const struct take *take)
{
    const char *name = NULL;
    struct take *now = NULL;
    for (int i = 0; i < recording_take_count(recording) && !name; i++)
        name = recording_take_id(recording, i) == take_id(take) ? recording_take_name(recording, i) : NULL;
    if (!name)
        return NOTHING;
    enum status status =
        take_is_drawn_from_depth(take) ? take_open_drawn(&now, recording, name) : take_open(&now, recording, name);
    if (status == OK)
        status = take_id(now) == take_id(take) && take_index_crc(now) == take_index_crc(take) ? OK : NOTHING;
    take_close(&now);
    return status;
}

enum status prepared_write(const char *path, const struct take *take, enum prepared_kind kind, int version,
                           const void *bytes, size_t count)
{
    struct recording *r = NULL;
    struct database *db = NULL;
    uint8_t *packed = NULL;
    size_t packed_count = 0;
    enum status status = recording_open_as(&r, path, DATABASE_WRITE);
    if (status == OK) {
        db = recording_database(r);
        status = check_idle(db);
    }
    if (status == OK)
        status = pack_bytes(bytes, count, &packed, &packed_count);
    if (status == OK)
        status = database_begin(db);
    if (status == OK)
        status = database_run(db, PREPARED_TABLE);
    if (status == OK)
        status = check_same(r, take);
    if (status == OK)
        status = insert_prepared(db, take, row_id(take, kind), version, packed, packed_count);
    if (status == OK)
        status = database_run(db, "COMMIT");
    if (db && database_in_transaction(db) && database_run(db, "ROLLBACK") != OK)
        status = NOTHING; // closing rolls back
    recording_free(&r);
    free(packed);
    return status == OK || status == ERR_MEMORY ? status : NOTHING;
}
