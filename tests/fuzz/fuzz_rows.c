// Rows with any content and right checksums, which random bytes never get: a writer's bug, or an attack. They are read,
// verified and repaired; what repair makes is sound. The input is a sequence of rows: a byte for the kind, then fields.
#include "recording/recording_schema.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

struct input {
    const uint8_t *at;
    size_t left;
};

static void take_bytes(struct input *in, void *to, size_t count)
{
    const size_t have = count < in->left ? count : in->left;
    memset(to, 0, count);
    memcpy(to, in->at, have);
    in->at += have;
    in->left -= have;
}

static uint8_t take_byte(struct input *in)
{
    uint8_t byte;
    take_bytes(in, &byte, 1);
    return byte;
}

static int64_t take_number(struct input *in)
{
    int64_t number = 0;
    const uint8_t kind = take_byte(in);
    if (kind < 0xf0)
        return kind; // small numbers are the usual ones
    take_bytes(in, &number, sizeof number);
    return number;
}

// Of a frame: the take's number and its own.
static int64_t take_key(struct input *in)
{
    const uint64_t take = (uint64_t)take_number(in), number = (uint64_t)take_number(in);
    return (int64_t)((take << 32 & INT64_MAX) | (number & UINT32_MAX));
}

// Up to `most` bytes.
static size_t take_blob(struct input *in, uint8_t *to, size_t most)
{
    size_t count = take_byte(in);
    count = count < most ? count : most;
    take_bytes(in, to, count);
    return count;
}

static void put_take(struct database *db, struct input *in)
{
    struct statement *s;
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    struct take_row t = {.id = take_number(in), .complete = take_byte(in) & 1, .dropped = take_number(in)};
    t.calibration.color = t.calibration.depth =
        (struct lens){.width = 16, .height = 12, .fx = 14, .fy = 14, .cx = 7.5, .cy = 5.5};
    t.calibration.registered = true;
    t.calibration.color_from_depth = POSE_IDENTITY;
    if (take_byte(in) > 200)
        take_bytes(in, &t.calibration.color, sizeof t.calibration.color);
    t.body.representative_frame = take_number(in);
    t.frames = take_number(in);
    t.lost = take_number(in);
    take_blob(in, (uint8_t *)t.name, TAKE_NAME_BYTES);
    take_blob(in, (uint8_t *)t.note, 20);
    if (insert_open(&s, db, TABLE_TAKE, true) != OK)
        return;
    take_bind(s, &t, calibration, body);
    status_ignore(statement_run(s));
    statement_close(&s);
}

static void put_frame(struct database *db, struct input *in)
{
    struct statement *s;
    uint8_t pose[POSE_BYTES], skeleton[SKELETON_BYTES];
    const int64_t key = take_key(in), time_ns = take_number(in);
    const uint8_t flags = take_byte(in);
    struct skeleton joints = {0};
    put_pose(pose, &POSE_IDENTITY);
    put_skeleton(skeleton, &joints);
    if (flags & 64)
        take_bytes(in, pose, sizeof pose);
    if (flags & 128)
        take_bytes(in, skeleton, sizeof skeleton);
    const size_t bytes = flags & 32 ? sizeof skeleton : 0;
    const uint32_t crc = frame_crc(time_ns, flags & 16, pose, skeleton, bytes, flags & 7);
    if (insert_open(&s, db, TABLE_FRAME, true) != OK)
        return;
    statement_bind_number(s, 1, key);
    statement_bind_number(s, 2, time_ns);
    statement_bind_number(s, 3, (flags & 16) != 0);
    statement_bind_blob(s, 4, pose, sizeof pose);
    statement_bind_blob(s, 5, bytes ? skeleton : NULL, bytes);
    statement_bind_number(s, 6, flags & 7);
    statement_bind_number(s, 7, crc);
    if (flags & 8)
        statement_bind_number(s, FRAME_SEAL + 1, row_seal(key, crc));
    status_ignore(statement_run(s));
    statement_close(&s);
}

static void put_images(struct database *db, struct input *in)
{
    struct statement *s;
    static uint8_t blobs[3][256];
    int64_t crcs[3] = {0};
    const int64_t key = take_key(in);
    if (insert_open(&s, db, TABLE_IMAGE, true) != OK)
        return;
    statement_bind_number(s, 1, key);
    for (int i = 0; i < 3; i++) {
        const size_t count = take_blob(in, blobs[i], sizeof blobs[i]);
        if (count) {
            statement_bind_number(s, 2 + i, crcs[i] = crc32_of(0, blobs[i], count));
            statement_bind_blob(s, 5 + i, blobs[i], count);
        }
    }
    if (take_byte(in) & 1)
        statement_bind_number(s, IMAGE_SEAL + 1, image_seal(key, crcs));
    status_ignore(statement_run(s));
    statement_close(&s);
}

static void put_joint_errors(struct database *db, struct input *in)
{
    struct statement *s;
    uint8_t covariances[JOINT_ERROR_BYTES] = {0};
    const int64_t key = take_key(in);
    const uint8_t flags = take_byte(in);
    take_bytes(in, covariances, (size_t)(flags & 127));
    const uint32_t crc = crc32_of(0, covariances, sizeof covariances);
    if (insert_open(&s, db, TABLE_JOINT_ERROR, true) != OK)
        return;
    statement_bind_number(s, 1, key);
    statement_bind_blob(s, 2, covariances, sizeof covariances);
    statement_bind_number(s, 3, crc);
    if (flags & 128)
        statement_bind_number(s, JOINT_ERROR_SEAL + 1, row_seal(key, crc));
    status_ignore(statement_run(s));
    statement_close(&s);
}

// A table with one row: a blob and its checksum.
static void put_blob(struct database *db, const char *insert, const uint8_t *blob, size_t bytes)
{
    struct statement *s;
    if (statement_open(&s, db, insert) != OK)
        return;
    statement_bind_blob(s, 1, blob, bytes);
    statement_bind_number(s, 2, crc32_of(0, blob, bytes));
    status_ignore(statement_run(s));
    statement_close(&s);
}

// With up to three tags and points, whose covariances and directions may be of fewer or more.
static void put_place(struct database *db, struct input *in)
{
    struct statement *s;
    struct calibration lenses = {.registered = true, .color_from_depth = POSE_IDENTITY};
    uint8_t calibration[CALIBRATION_BYTES], residuals[RESIDUAL_BYTES], items[3 * TAG_BYTES + 3 * TAG_ERROR_BYTES];
    const uint8_t counts = take_byte(in), flags = take_byte(in);
    const size_t tags = (size_t)(counts & 3) * TAG_BYTES, points = (size_t)(counts >> 2 & 3) * POINT_BYTES;
    const int64_t views = take_number(in);
    lenses.color = lenses.depth = (struct lens){.width = 16, .height = 12, .fx = 14, .fy = 14, .cx = 7.5, .cy = 5.5};
    if (flags & 1)
        take_bytes(in, &lenses.color, sizeof lenses.color);
    put_calibration(calibration, &lenses);
    take_bytes(in, residuals, flags & 2 ? sizeof residuals : 0);
    if (!(flags & 2))
        put_residuals(residuals, 1, 0);
    if (insert_open(&s, db, TABLE_PLACE, false) != OK)
        return;
    uint32_t crc = crc32_of(crc32_of(0, calibration, sizeof calibration), residuals, sizeof residuals);
    statement_bind_blob(s, 1, calibration, sizeof calibration);
    statement_bind_blob(s, 2, residuals, sizeof residuals);
    take_bytes(in, items, tags);
    crc = crc32_of(crc, items, tags);
    statement_bind_blob(s, 3, items, tags);
    take_bytes(in, items + tags, points);
    crc = crc32_of(crc, items + tags, points);
    statement_bind_blob(s, 4, items + tags, points);
    statement_bind_number(s, 5, crc);
    statement_bind_number(s, PLACE_VIEWS + 1, views);
    if (flags & 4)
        statement_bind_number(s, PLACE_SEAL + 1, place_seal(crc, views));
    status_ignore(statement_run(s));
    statement_close(&s);
    if (!(flags & 8))
        return;
    const size_t tag_errors = (size_t)(counts >> 4 & 3) * TAG_ERROR_BYTES, point_items = (size_t)(counts >> 6);
    take_bytes(in, items, tag_errors);
    put_blob(db, "INSERT INTO tag_error(covariances, crc) VALUES(?, ?)", items, tag_errors);
    take_bytes(in, items, point_items * POINT_ERROR_BYTES);
    put_blob(db, "INSERT INTO point_error(covariances, crc) VALUES(?, ?)", items, point_items * POINT_ERROR_BYTES);
    take_bytes(in, items, point_items * POINT_SIDE_BYTES);
    put_blob(db, "INSERT INTO point_side(directions, crc) VALUES(?, ?)", items, point_items * POINT_SIDE_BYTES);
}

static void put_view(struct database *db, struct input *in)
{
    struct statement *s;
    static uint8_t blobs[2][256];
    uint8_t pose[POSE_BYTES];
    const int64_t id = take_number(in);
    const uint8_t flags = take_byte(in);
    put_pose(pose, &POSE_IDENTITY);
    if (flags & 1)
        take_bytes(in, pose, sizeof pose);
    const size_t depth = take_blob(in, blobs[0], sizeof blobs[0]), color = take_blob(in, blobs[1], sizeof blobs[1]);
    const uint32_t crc = view_crc(pose, blobs[0], depth, blobs[1], color);
    if (insert_open(&s, db, TABLE_VIEW, true) != OK)
        return;
    statement_bind_number(s, 1, id);
    statement_bind_blob(s, 2, pose, sizeof pose);
    statement_bind_blob(s, 3, blobs[0], depth);
    statement_bind_blob(s, 4, blobs[1], color);
    statement_bind_number(s, 5, crc);
    if (flags & 2)
        statement_bind_number(s, VIEW_SEAL + 1, row_seal(id, crc));
    status_ignore(statement_run(s));
    statement_close(&s);
}

// The takes of a sound file last as long as a number can say.
static void check_takes(const char *path)
{
    struct recording *r;
    FUZZ_CHECK(recording_open(&r, path) == OK);
    for (int i = 0; i < recording_take_count(r); i++) {
        struct take *t;
        FUZZ_CHECK(take_open(&t, r, recording_take_name(r, i)) == OK);
        const int64_t count = take_frame_count(t);
        FUZZ_CHECK(!count || (take_entry(t, 0)->time_ns >= -TAKE_TIME_MAX_NS &&
                              take_entry(t, count - 1)->time_ns <= TAKE_TIME_MAX_NS));
        take_close(&t);
    }
    recording_free(&r);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct input in = {data, size};
    struct database *db;
    struct recording_report found, report;
    fuzz_remove("rows");
    fuzz_remove("repaired");
    FUZZ_CHECK(database_open(&db, fuzz_path("rows"), DATABASE_CREATE) == OK);
    FUZZ_CHECK(database_run(db, "PRAGMA synchronous = OFF; PRAGMA page_size = 512") == OK);
    FUZZ_CHECK(recording_make_tables(db) == OK);
    for (int rows = 0; in.left && rows < 60; rows++) {
        const uint8_t kind = take_byte(&in);
        switch (kind < 0xc0 ? kind % 3 : 3 + kind % 3) {
        case 0: put_take(db, &in); break;
        case 1: put_frame(db, &in); break;
        case 2: put_images(db, &in); break;
        case 3: put_joint_errors(db, &in); break;
        case 4: put_place(db, &in); break;
        default: put_view(db, &in); break;
        }
    }
    database_close(&db);
    const enum status status = fuzz_said(recording_verify(fuzz_path("rows"), &found));
    const enum status repaired = fuzz_said(recording_repair(fuzz_path("rows"), fuzz_path("repaired"), &report));
    FUZZ_CHECK((status == OK) == (repaired == NOTHING));
    if (status == OK)
        check_takes(fuzz_path("rows"));
    if (repaired == OK)
        FUZZ_CHECK(recording_verify(fuzz_path("repaired"), &report) == OK);
    return 0;
}
