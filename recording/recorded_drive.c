#include "recording/recorded_drive.h"

#include "recording/little_endian.h"
#include "recording/recording_reader.h"
#include "recording/recording_takes.h"

enum { NUMBERS_BYTES = 3 * 8 + POSE_BYTES, PATH_POINT_BYTES = 3 * 8 };

static bool is_good(const struct recorded_drive *drive)
{
    bool good =
        pose_is_valid(drive->world_from_body) && drive->path_count >= 0 && drive->path_count <= RECORDED_DRIVE_POINTS;
    for (int i = 0; i < 3; i++)
        good = good && drive->size_m[i] >= 0 && drive->size_m[i] < RECORDING_METRES_MAX;
    for (int i = 0; good && i < drive->path_count; i++)
        good = position_is_valid(drive->path[i]);
    return good;
}

static enum status from_row(struct recording *recording, struct statement *statement, struct recorded_drive *out)
{
    size_t bytes;
    const uint8_t *numbers = recording_blob(statement, 0, NUMBERS_BYTES), *path = statement_blob(statement, 1, &bytes);
    struct recorded_drive d = {.path_count = (int)(bytes / PATH_POINT_BYTES)};
    if (!numbers || bytes > RECORDED_DRIVE_POINTS * PATH_POINT_BYTES || bytes % PATH_POINT_BYTES ||
        crc32_of(crc32_of(0, numbers, NUMBERS_BYTES), path, bytes) != (uint32_t)statement_number(statement, 2))
        return recording_damaged(recording, "a robot's path cannot be read");
    for (int i = 0; i < 3; i++)
        d.size_m[i] = get_f64(&numbers);
    get_pose(numbers, &d.world_from_body);
    for (int i = 0; i < d.path_count; i++) {
        d.path[i].x = get_f64(&path);
        d.path[i].y = get_f64(&path);
        d.path[i].z = get_f64(&path);
    }
    if (!is_good(&d))
        return recording_damaged(recording, "a robot's path cannot be read");
    *out = d;
    return OK;
}

enum status recording_read_drive(struct recording *r, struct recorded_drive *out)
{
    struct database *db = recording_database(r);
    struct statement *s = NULL;
    int64_t tables = 0;
    enum status status = database_number(db, COUNT_TABLES("'drive'"), &tables);
    if (status == OK && !tables)
        return NOTHING;
    if (status == OK)
        status = statement_open(&s, db, "SELECT numbers, path, crc FROM drive WHERE id = 1");
    if (status == OK)
        status = statement_step(s);
    if (status == OK)
        status = from_row(r, s, out);
    statement_close(&s);
    return status;
}

static enum status insert_drive(struct database *db, const void *what)
{
    const struct recorded_drive *d = what;
    uint8_t numbers[NUMBERS_BYTES], path[RECORDED_DRIVE_POINTS * PATH_POINT_BYTES], *at = numbers;
    struct statement *s;
    for (int i = 0; i < 3; i++)
        at = put_f64(at, d->size_m[i]);
    put_pose(at, &d->world_from_body);
    at = path;
    for (int i = 0; i < d->path_count; i++)
        at = put_f64(put_f64(put_f64(at, d->path[i].x), d->path[i].y), d->path[i].z);
    const size_t bytes = (size_t)d->path_count * PATH_POINT_BYTES;
    enum status status = statement_open(&s, db, "INSERT INTO drive(id, numbers, path, crc) VALUES(1,?,?,?)");
    if (status == OK) {
        statement_bind_blob(s, 1, numbers, sizeof numbers);
        statement_bind_blob(s, 2, path, bytes);
        statement_bind_number(s, 3, crc32_of(crc32_of(0, numbers, sizeof numbers), path, bytes));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum status recording_write_drive(const char *path, const struct recorded_drive *drive)
{
    if (!is_good(drive))
        return fail(ERR_INPUT, "a number of a robot's path is not finite");
    return recording_change(path, DRIVE_TABLE "DELETE FROM drive", insert_drive, drive);
}
