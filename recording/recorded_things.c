#include "recording/recorded_things.h"

#include "base/text.h"
#include "platform/network/http_client.h"
#include "recording/little_endian.h"
#include "recording/recording_reader.h"
#include "recording/recording_schema.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- recorded drive

enum { DRIVE_BYTES = 3 * 8 + POSE_BYTES, PATH_POINT_BYTES = 3 * 8 };

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
    const uint8_t *numbers = recording_blob(statement, 0, DRIVE_BYTES), *path = statement_blob(statement, 1, &bytes);
    struct recorded_drive d = {.path_count = (int)(bytes / PATH_POINT_BYTES)};
    if (!numbers || bytes > RECORDED_DRIVE_POINTS * PATH_POINT_BYTES || bytes % PATH_POINT_BYTES ||
        crc32_of(crc32_of(0, numbers, DRIVE_BYTES), path, bytes) != (uint32_t)statement_number(statement, 2))
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

enum status recording_read_drive(struct recording *recording, struct recorded_drive *out)
{
    struct database *db = recording_database(recording);
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
        status = from_row(recording, s, out);
    statement_close(&s);
    return status;
}

static enum status insert_drive(struct database *db, const void *what)
{
    const struct recorded_drive *d = what;
    uint8_t numbers[DRIVE_BYTES], path[RECORDED_DRIVE_POINTS * PATH_POINT_BYTES], *at = numbers;
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

// ---------------------------------------------------------------- recorded things

// numbers: pose, then 6 x f64 covariance, f64 width, height; i32 sightings, u8 gone are columns
enum { COVARIANCE_BYTES = 6 * 8, NUMBERS_BYTES = POSE_BYTES + COVARIANCE_BYTES + 2 * 8, THINGS_MAX = 10000 };
#define THING_COLUMNS "rowid, name, url, etag, note, knowledge, numbers, sightings, gone, crc"

static void put_numbers(uint8_t out[NUMBERS_BYTES], const struct recorded_thing *thing)
{
    const struct covariance3 *c = &thing->covariance;
    const double values[8] = {c->xx, c->xy, c->xz, c->yy, c->yz, c->zz, thing->width_m, thing->height_m};
    put_pose(out, &thing->world_from_thing);
    out += POSE_BYTES;
    for (int i = 0; i < 8; i++)
        out = put_f64(out, values[i]);
}

static void get_numbers(const uint8_t in[NUMBERS_BYTES], struct recorded_thing *thing)
{
    double v[8];
    get_pose(in, &thing->world_from_thing);
    in += POSE_BYTES;
    for (int i = 0; i < 8; i++)
        v[i] = get_f64(&in);
    thing->covariance = (struct covariance3){v[0], v[1], v[2], v[3], v[4], v[5]};
    thing->width_m = v[6];
    thing->height_m = v[7];
}

static bool is_finite(const struct recorded_thing *thing)
{
    const struct covariance3 *c = &thing->covariance;
    return pose_is_valid(thing->world_from_thing) && isfinite(c->xx + c->xy + c->xz + c->yy + c->yz + c->zz) &&
           c->xx >= 0 && c->yy >= 0 && c->zz >= 0 && isfinite(thing->width_m) && isfinite(thing->height_m) &&
           thing->width_m >= 0 && thing->height_m >= 0;
}

static uint32_t thing_crc(const struct recorded_thing *thing, const uint8_t numbers[NUMBERS_BYTES])
{
    uint8_t whole[16] = {0};
    uint32_t crc = 0;
    const char *const texts[5] = {thing->name, thing->url, thing->etag, thing->note,
                                  thing->knowledge ? thing->knowledge : ""};
    for (int i = 0; i < 5; i++)
        crc = crc32_of(crc, texts[i], strlen(texts[i]));
    crc = crc32_of(crc, numbers, NUMBERS_BYTES);
    for (int i = 0; i < 4; i++)
        whole[i] = (uint8_t)((uint32_t)thing->sightings >> (8 * i));
    whole[8] = thing->gone;
    return crc32_of(crc, whole, sizeof whole);
}

static bool copy_text(struct statement *statement, int column, char *out, size_t bytes)
{
    const char *text = statement_text(statement, column);
    return (size_t)snprintf(out, bytes, "%s", text) < bytes;
}

// Its texts may be a stranger's, and are shown on terminals and sent to servers.
static void make_printable(struct recorded_thing *thing)
{
    char *const texts[] = {thing->name, thing->url, thing->etag, thing->note};
    for (size_t i = 0; i < COUNT_OF(texts); i++)
        text_make_printable(texts[i]);
    address_hide_user(thing->url);
}

static enum status thing_from_row(struct statement *statement, struct recorded_thing *out)
{
    const uint8_t *numbers = recording_blob(statement, 6, NUMBERS_BYTES);
    const int64_t sightings = statement_number(statement, 7);
    *out = (struct recorded_thing){.sightings = (int32_t)sightings, .gone = statement_number(statement, 8) != 0};
    bool good = numbers && sightings >= 0 && sightings <= INT32_MAX;
    good = good && copy_text(statement, 1, out->name, sizeof out->name) &&
           copy_text(statement, 2, out->url, sizeof out->url) && copy_text(statement, 3, out->etag, sizeof out->etag) &&
           copy_text(statement, 4, out->note, sizeof out->note);
    const char *knowledge = statement_text(statement, 5);
    enum status status = statement_check(statement);
    if (status != OK)
        return status;
    if (good && knowledge[0] && !(out->knowledge = strdup(knowledge)))
        return fail(ERR_MEMORY, "no memory for what is known of a thing");
    if (good) {
        get_numbers(numbers, out);
        good = is_finite(out) && thing_crc(out, numbers) == (uint32_t)statement_number(statement, 9);
    }
    if (good)
        make_printable(out);
    return good ? OK : fail(ERR_CORRUPT, "a thing cannot be read");
}

static struct thing_content *content_of(struct recorded_thing *thing, const char *kind)
{
    if (!strcmp(kind, "image"))
        return &thing->image;
    return !strcmp(kind, "model") ? &thing->model : NULL;
}

struct reading {
    struct recording *r;
    struct recorded_thing *things;
    int64_t *ids; // of their rows
    int count;
    struct things_lost lost;
};

// One that could not be written: a name is empty, or another's.
static bool has_usable_name(const struct reading *from, const struct recorded_thing *thing)
{
    bool usable = thing->name[0];
    for (int i = 0; i < from->count && usable; i++)
        usable = strcmp(from->things[i].name, thing->name) != 0;
    return usable;
}

static enum status add_thing(struct reading *to, const struct recorded_thing *thing, int64_t id)
{
    const size_t count = (size_t)to->count + 1;
    struct recorded_thing *things = realloc(to->things, sizeof *things * count);
    to->things = things ? things : to->things;
    int64_t *ids = realloc(to->ids, sizeof *ids * count);
    to->ids = ids ? ids : to->ids;
    if (!things || !ids)
        return fail(ERR_MEMORY, "no memory for the things of %s", recording_path(to->r));
    things[to->count] = *thing;
    ids[to->count++] = id;
    return OK;
}

static enum status read_thing(struct reading *to, struct statement *statement)
{
    struct recorded_thing thing;
    enum status status = thing_from_row(statement, &thing);
    if (status == OK)
        status = to->count < THINGS_MAX && has_usable_name(to, &thing)
                     ? add_thing(to, &thing, statement_number(statement, 0))
                     : ERR_CORRUPT;
    if (status == OK)
        return OK;
    free(thing.knowledge);
    to->lost.things += status == ERR_CORRUPT;
    return status == ERR_CORRUPT ? OK : status;
}

static enum status read_content(struct reading *to, struct statement *statement)
{
    const int64_t id = statement_number(statement, 0);
    const char *kind = statement_text(statement, 1);
    int i = 0;
    while (i < to->count && to->ids[i] != id)
        i++;
    struct thing_content *content = i < to->count ? content_of(&to->things[i], kind) : NULL;
    size_t bytes;
    const uint8_t *blob = statement_blob(statement, 2, &bytes);
    if (!content || content->bytes || !blob || !bytes || bytes > THING_CONTENT_MAX ||
        crc32_of(crc32_of(0, kind, strlen(kind)), blob, bytes) != (uint32_t)statement_number(statement, 3)) {
        to->lost.contents++;
        return statement_check(statement);
    }
    if (!(content->bytes = malloc(bytes)))
        return fail(ERR_MEMORY, "no memory for a thing's %s", kind);
    memcpy(content->bytes, blob, bytes);
    content->count = bytes;
    return OK;
}

// Gives each row of the table, where there is one, to `read`. A damaged page ends it: *rest_lost.
static enum status read_rows(struct reading *to, const char *count_tables, const char *select,
                             enum status (*read)(struct reading *to, struct statement *s), int *rest_lost)
{
    struct database *db = recording_database(to->r);
    struct statement *s = NULL;
    int64_t tables = 0;
    enum status status = database_number(db, count_tables, &tables);
    if (status != OK || !tables)
        return status;
    status = statement_open(&s, db, select);
    while (status == OK && (status = statement_step(s)) == OK)
        status = read(to, s);
    statement_close(&s);
    *rest_lost += status == ERR_CORRUPT;
    return status == NOTHING || status == ERR_CORRUPT ? OK : status;
}

enum status recording_salvage_things(struct recording *recording, struct recorded_thing **things, int *count,
                                     struct things_lost *lost)
{
    struct reading from = {.r = recording};
    enum status status = read_rows(&from, COUNT_TABLES("'thing'"), "SELECT " THING_COLUMNS " FROM thing ORDER BY rowid",
                                   read_thing, &from.lost.things);
    if (status == OK)
        status = read_rows(&from, COUNT_TABLES("'thing_content'"),
                           "SELECT thing, kind, bytes, crc FROM thing_content ORDER BY rowid", read_content,
                           &from.lost.contents);
    free(from.ids);
    if (status != OK) {
        recorded_things_free(&from.things, from.count);
        from = (struct reading){0};
    }
    *things = from.things;
    *count = from.count;
    *lost = from.lost;
    return status;
}

enum status recording_read_things(struct recording *recording, struct recorded_thing **things, int *count)
{
    struct things_lost lost;
    enum status status = recording_salvage_things(recording, things, count, &lost);
    if (status != OK || !lost.things) // text is worth more than pictures: a thing is shown without them
        return status;
    recorded_things_free(things, *count);
    *count = 0;
    return recording_damaged(recording, "a thing cannot be read");
}

static bool copy_bytes(struct thing_content *to, const struct thing_content *from)
{
    *to = (struct thing_content){0};
    if (!from->bytes)
        return true;
    if (!(to->bytes = malloc(from->count)))
        return false;
    memcpy(to->bytes, from->bytes, from->count);
    to->count = from->count;
    return true;
}

enum status recorded_thing_copy(struct recorded_thing *to, const struct recorded_thing *from)
{
    *to = *from;
    to->knowledge = from->knowledge ? strdup(from->knowledge) : NULL;
    bool good = copy_bytes(&to->image, &from->image);
    good = copy_bytes(&to->model, &from->model) && good && (to->knowledge || !from->knowledge);
    return good ? OK : fail(ERR_MEMORY, "no memory for what is known of a thing");
}

void recorded_things_free(struct recorded_thing **things, int count)
{
    for (int i = 0; i < count && *things; i++) {
        free((*things)[i].knowledge);
        free((*things)[i].image.bytes);
        free((*things)[i].model.bytes);
    }
    free(*things);
    *things = NULL;
}

static enum status check_things(const struct recorded_thing *things, int count)
{
    for (int i = 0; i < count; i++) {
        if (!things[i].name[0])
            return fail(ERR_INPUT, "a thing without a name");
        if (!is_finite(&things[i]) || things[i].sightings < 0)
            return fail(ERR_INPUT, "'%s': a number is not finite", things[i].name);
        if (things[i].image.count > THING_CONTENT_MAX || things[i].model.count > THING_CONTENT_MAX)
            return fail(ERR_INPUT, "'%s': a picture or model is larger than %d bytes", things[i].name,
                        (int)THING_CONTENT_MAX);
        for (int k = 0; k < i; k++)
            if (!strcmp(things[i].name, things[k].name))
                return fail(ERR_INPUT, "two things have the name '%s'", things[i].name);
    }
    return OK;
}

static enum status insert_things(struct database *db, const struct recorded_thing *things, int count)
{
    struct statement *s;
    enum status status = statement_open(&s, db, "INSERT INTO thing(" THING_COLUMNS ") VALUES(?,?,?,?,?,?,?,?,?,?)");
    for (int i = 0; i < count && status == OK; i++) {
        const struct recorded_thing *t = &things[i];
        uint8_t numbers[NUMBERS_BYTES];
        put_numbers(numbers, t);
        statement_bind_number(s, 1, i);
        statement_bind_text(s, 2, t->name);
        statement_bind_text(s, 3, t->url);
        statement_bind_text(s, 4, t->etag);
        statement_bind_text(s, 5, t->note);
        if (t->knowledge)
            statement_bind_text(s, 6, t->knowledge);
        statement_bind_blob(s, 7, numbers, sizeof numbers);
        statement_bind_number(s, 8, t->sightings);
        statement_bind_number(s, 9, t->gone);
        statement_bind_number(s, 10, thing_crc(t, numbers));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

static enum status insert_content(struct statement *statement, int thing, const char *kind,
                                  const struct thing_content *content)
{
    statement_bind_number(statement, 1, thing);
    statement_bind_text(statement, 2, kind);
    statement_bind_blob(statement, 3, content->bytes, content->count);
    statement_bind_number(statement, 4, crc32_of(crc32_of(0, kind, strlen(kind)), content->bytes, content->count));
    return statement_run(statement);
}

static enum status insert_contents(struct database *db, const struct recorded_thing *things, int count)
{
    struct statement *s;
    enum status status = statement_open(&s, db, "INSERT INTO thing_content(thing, kind, bytes, crc) VALUES(?,?,?,?)");
    for (int i = 0; i < count && status == OK; i++) {
        if (things[i].image.bytes)
            status = insert_content(s, i, "image", &things[i].image);
        if (status == OK && things[i].model.bytes)
            status = insert_content(s, i, "model", &things[i].model);
    }
    statement_close(&s);
    return status;
}

struct things {
    const struct recorded_thing *things;
    int count;
};

static enum status insert_all_things(struct database *db, const void *what)
{
    const struct things *all = what;
    const enum status status = insert_things(db, all->things, all->count);
    return status == OK ? insert_contents(db, all->things, all->count) : status;
}

enum status recording_write_things(const char *path, const struct recorded_thing *things, int count)
{
    const struct things all = {things, count};
    const enum status status = check_things(things, count);
    return status != OK ? status
                        : recording_change(path, THING_TABLES "DELETE FROM thing; DELETE FROM thing_content",
                                           insert_all_things, &all);
}
