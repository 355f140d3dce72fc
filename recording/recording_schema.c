// Table definitions, checksums and encoding of every blob of a recording.
#include "recording/recording_schema.h"

#include "base/text.h"
#include "platform/files/file.h"
#include "recording/little_endian.h"
#include "recording/recording_reader.h"

#include <ctype.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool recording_column_is_optional(const char *table, const char *column);

// ---------------------------------------------------------------- exact schema

// Part of an SQL text.
struct span {
    const char *at;
    size_t count;
};

// All that there is to make, in the words in which it is made.
static const char *schema_text(int i)
{
    const char *const texts[] = {recording_tables,  PREPARED_TABLE, VERDICT_TABLE,
                                 EXPECTATION_TABLE, THING_TABLES,   DRIVE_TABLE};
    return i < (int)COUNT_OF(texts) ? texts[i] : NULL;
}

static bool is_blank(char c) { return isspace((unsigned char)c) != 0; }

static struct span trim_span(struct span span)
{
    while (span.count && is_blank(span.at[0])) {
        span.at++;
        span.count--;
    }
    while (span.count && is_blank(span.at[span.count - 1]))
        span.count--;
    return span;
}

// The same words, however far apart.
static bool same_words(struct span one, struct span other)
{
    size_t i = 0, k = 0;
    while (i < one.count && k < other.count) {
        const bool blank = is_blank(one.at[i]);
        if (blank != is_blank(other.at[k]) || (!blank && one.at[i] != other.at[k]))
            return false;
        i++;
        k++;
        while (blank && i < one.count && is_blank(one.at[i]))
            i++;
        while (blank && k < other.count && is_blank(other.at[k]))
            k++;
    }
    return i == one.count && k == other.count;
}

// Takes the next column off the list. False: there is none.
static bool next_column(struct span *list, struct span *column)
{
    if (!list->count)
        return false;
    const char *comma = memchr(list->at, ',', list->count);
    const size_t count = comma ? (size_t)(comma - list->at) : list->count;
    *column = trim_span((struct span){list->at, count});
    list->at += count + (comma != NULL);
    list->count -= count + (comma != NULL);
    return true;
}

static bool has_column(struct span list, struct span wanted)
{
    struct span column;
    while (next_column(&list, &column))
        if (same_words(column, wanted))
            return true;
    return false;
}

static int count_columns(struct span list)
{
    struct span column;
    int count = 0;
    while (next_column(&list, &column))
        count++;
    return count;
}

static bool may_lack(const char *table, struct span column)
{
    char name[64];
    size_t count = 0;
    while (count < column.count && !is_blank(column.at[count]))
        count++;
    snprintf(name, sizeof name, "%.*s", (int)count, column.at);
    return recording_column_is_optional(table, name);
}

// Both begin with the same column; each of the file's is one that is made, and once; what it lacks is optional.
static bool same_columns(const char *table, struct span given, struct span wanted)
{
    struct span first_given = {0}, first_wanted = {0}, column, rest = wanted;
    struct span g = given, w = wanted;
    if (!next_column(&g, &first_given) || !next_column(&w, &first_wanted) || !same_words(first_given, first_wanted))
        return false;
    int found = 0;
    while (next_column(&rest, &column)) {
        const bool there = has_column(given, column);
        if (!there && !may_lack(table, column))
            return false;
        found += there;
    }
    return found == count_columns(given); // a name that is there twice is refused by SQLite
}

// What stands in the outer parentheses of "CREATE TABLE name(...)", where that is all.
static bool columns_of(const char *sql, const char *begin, const char *name, struct span *out)
{
    const size_t length = strlen(begin), name_length = strlen(name), count = strlen(sql);
    if (count < length + name_length + 2 || strncmp(sql, begin, length) || strncmp(sql + length, name, name_length) ||
        sql[length + name_length] != '(' || sql[count - 1] != ')')
        return false;
    out->at = sql + length + name_length + 1;
    out->count = count - length - name_length - 2;
    return true;
}

// The columns as these programs make the table. False: they make none of that name.
static bool find_made(const char *name, struct span *out)
{
    static const char create[] = "CREATE TABLE ", if_none[] = "IF NOT EXISTS ";
    const size_t name_length = strlen(name);
    for (int i = 0; schema_text(i); i++)
        for (const char *at = schema_text(i); (at = strstr(at, create)) != NULL;) {
            at += sizeof create - 1;
            at += strncmp(at, if_none, sizeof if_none - 1) ? 0 : sizeof if_none - 1;
            if (strncmp(at, name, name_length) || at[name_length] != '(')
                continue;
            const char *end = strstr(at, ");");
            *out = (struct span){at + name_length + 1, end ? (size_t)(end - at) - name_length - 1 : 0};
            return end != NULL;
        }
    return false;
}

static bool is_made_table(const char *name, const char *sql)
{
    struct span given, wanted;
    return find_made(name, &wanted) && columns_of(sql, "CREATE TABLE ", name, &given) &&
           same_columns(name, given, wanted);
}

enum status exact_schema_check(struct database *db)
{
    struct statement *s;
    char name[80] = "";
    bool exact = true;
    enum status status = statement_open(&s, db, "SELECT type, name, sql FROM sqlite_schema ORDER BY rowid");
    while (status == OK && exact && (status = statement_step(s)) == OK) {
        const char *type = statement_text(s, 0);
        snprintf(name, sizeof name, "%s", statement_text(s, 1));
        const char *sql = statement_text(s, 2);
        exact = (!strcmp(type, "table") && is_made_table(name, sql)) ||
                (!strcmp(type, "view") && database_is_mark(name, sql));
        if (!exact && statement_check(s) != OK)
            status = statement_check(s);
    }
    statement_close(&s);
    text_make_printable(name);
    if (exact || status < OK)
        return status == NOTHING ? OK : status;
    return fail(ERR_CORRUPT,
                "%s is not as this program makes recordings ('%s' is of another program, a newer one or damaged), so "
                "it is only read: reenact-capture repair copies what is in it into a new file",
                database_path(db), name);
}

enum status recording_check_tables(struct database *db)
{
    int64_t application = 0, schema = 0, tables = 0;
    enum status status = database_number(db, "PRAGMA application_id", &application);
    if (status == OK)
        status = database_number(db, "PRAGMA user_version", &schema);
    if (status != OK)
        return status;
    struct stat about;
    if (application != RECORDING_APPLICATION)
        return fail(ERR_FORMAT, "%s is not a recording: it is %s", database_path(db),
                    !stat(database_path(db), &about) && !about.st_size ? "empty" : "another program's database");
    if (schema > RECORDING_SCHEMA)
        return fail(ERR_FORMAT, "%s has schema %lld and this program knows schemas up to %d; use a newer program",
                    database_path(db), (long long)schema, RECORDING_SCHEMA);
    if (schema < 1)
        return fail(ERR_CORRUPT, "%s has no valid schema number (%lld)", database_path(db), (long long)schema);
    status = database_number(db, COUNT_TABLES("'place', 'place_view', 'take', 'frame', 'picture'"), &tables);
    if (status == OK && tables != 5)
        status = fail(ERR_CORRUPT, "%s is damaged: %lld of the 5 tables of a recording are there", database_path(db),
                      (long long)tables);
    return status == OK && database_may_write(db) ? exact_schema_check(db) : status;
}

// ---------------------------------------------------------------- recording schema

const char *const recording_tables =
    "CREATE TABLE place(id INTEGER PRIMARY KEY, calibration BLOB, residuals BLOB, tags BLOB, points BLOB,"
    " crc INTEGER, views INTEGER, seal INTEGER);"
    "CREATE TABLE place_view(id INTEGER PRIMARY KEY, world_from_camera BLOB, depth BLOB, color BLOB, crc INTEGER,"
    " seal INTEGER);"
    "CREATE TABLE take(id INTEGER PRIMARY KEY, name TEXT, calibration BLOB, complete INTEGER, dropped INTEGER,"
    " body BLOB, crc INTEGER, frames INTEGER, lost INTEGER, note TEXT, alias TEXT, seal INTEGER);"
    "CREATE TABLE frame(id INTEGER PRIMARY KEY, time_ns INTEGER, located INTEGER, world_from_camera BLOB,"
    " skeleton BLOB, pictures INTEGER, crc INTEGER, seal INTEGER);"
    "CREATE TABLE picture(id INTEGER PRIMARY KEY, mask_crc INTEGER, depth_crc INTEGER, color_crc INTEGER,"
    " mask BLOB, depth BLOB, color BLOB, seal INTEGER);" OPTIONAL_TABLES JOINT_ERROR_TABLE;

// ------------------------------------------------------------- checksums

uint32_t crc32_of_number(uint32_t crc, int64_t value)
{
    uint8_t bytes[8];
    put_u64(bytes, (uint64_t)value);
    return crc32_of(crc, bytes, sizeof bytes);
}

uint32_t view_crc(const uint8_t *pose, const uint8_t *depth, size_t depth_bytes, const uint8_t *color,
                  size_t color_bytes)
{
    return crc32_of(crc32_of(crc32_of(0, pose, POSE_BYTES), depth, depth_bytes), color, color_bytes);
}

uint32_t take_crc(const char *name, const uint8_t calibration[CALIBRATION_BYTES], bool complete, int64_t dropped,
                  const uint8_t body[BODY_BYTES])
{
    uint32_t crc = crc32_of(crc32_of(0, name, strlen(name)), calibration, CALIBRATION_BYTES);
    return crc32_of(crc32_of_number(crc32_of_number(crc, complete), dropped), body, BODY_BYTES);
}

uint32_t frame_crc(int64_t time_ns, bool located, const uint8_t pose[POSE_BYTES], const uint8_t *skeleton,
                   size_t skeleton_bytes, unsigned images)
{
    uint32_t crc = crc32_of(crc32_of_number(crc32_of_number(0, time_ns), located), pose, POSE_BYTES);
    return crc32_of_number(crc32_of(crc, skeleton, skeleton_bytes), images);
}

uint32_t row_seal(int64_t id, uint32_t crc) { return crc32_of_number(crc32_of_number(0, id), crc); }

uint32_t place_seal(uint32_t crc, int64_t views) { return crc32_of_number(crc32_of_number(0, crc), views); }

uint32_t take_seal(const struct take_row *row, uint32_t crc)
{
    uint32_t seal = crc32_of_number(crc32_of_number(row_seal(row->id, crc), row->frames), row->lost);
    seal = crc32_of(seal, row->note, strlen(row->note) + 1);
    return crc32_of(seal, row->alias, strlen(row->alias) + 1);
}

uint32_t image_seal(int64_t id, const int64_t crcs[3])
{
    uint32_t seal = crc32_of_number(0, id);
    for (int i = 0; i < 3; i++)
        seal = crc32_of_number(seal, crcs[i]);
    return seal;
}

bool seal_matches(struct statement *statement, int column, uint32_t seal)
{
    return statement_is_null(statement, column) || statement_number(statement, column) == seal;
}

// ------------------------------------------------------------- columns

// The tables' columns: those that every file has and those that older ones lack.
static const struct table_columns {
    const char *name, *columns;
    struct optional_column {
        const char *name, *type;
    } optional[6];
} table_columns[TABLE_COUNT] = {
    [TABLE_PLACE] = {"place", PLACE_COLUMNS, {{"views", "INTEGER"}, {"seal", "INTEGER"}}},
    [TABLE_VIEW] = {"place_view", VIEW_COLUMNS, {{"seal", "INTEGER"}}},
    [TABLE_TAKE] =
        {"take",
         TAKE_COLUMNS,
         {{"frames", "INTEGER"}, {"lost", "INTEGER"}, {"note", "TEXT"}, {"alias", "TEXT"}, {"seal", "INTEGER"}}},
    [TABLE_FRAME] = {"frame", FRAME_COLUMNS, {{"seal", "INTEGER"}}},
    [TABLE_JOINT_ERROR] = {"joint_error", JOINT_ERROR_COLUMNS, {{"seal", "INTEGER"}}},
    [TABLE_IMAGE] = {"picture", IMAGE_COLUMNS, {{"seal", "INTEGER"}}},
};

// Whether files may lack the column.
static bool recording_column_is_optional(const char *table, const char *column)
{
    for (int t = 0; t < TABLE_COUNT; t++)
        for (const struct optional_column *c = table_columns[t].optional; c->name; c++)
            if (!strcmp(table_columns[t].name, table) && !strcmp(c->name, column))
                return true;
    return false;
}

enum status recording_add_columns(struct database *db)
{
    enum status status = database_run(db, JOINT_ERROR_TABLE); // older files lack it
    for (int t = 0; t < TABLE_COUNT; t++)
        for (const struct optional_column *c = table_columns[t].optional; c->name && status == OK; c++) {
            char sql[200];
            bool there;
            status = database_has_column(db, table_columns[t].name, c->name, &there);
            snprintf(sql, sizeof sql, "ALTER TABLE %s ADD COLUMN %s %s", table_columns[t].name, c->name, c->type);
            if (status == OK && !there)
                status = database_run(db, sql);
        }
    return status;
}

enum status select_open(struct statement **out, struct database *db, enum recording_table table, const char *tail)
{
    const struct table_columns *t = &table_columns[table];
    char sql[700];
    size_t used = (size_t)snprintf(sql, sizeof sql, "SELECT %s", t->columns);
    enum status status = OK;
    *out = NULL;
    for (const struct optional_column *c = t->optional; c->name && status == OK; c++) {
        bool there = false;
        status = database_has_column(db, t->name, c->name, &there);
        used += (size_t)snprintf(sql + used, sizeof sql - used, ", %s", there ? c->name : "NULL");
    }
    if (status != OK)
        return status;
    used += (size_t)snprintf(sql + used, sizeof sql - used, " FROM %s %s", t->name, tail);
    assert(used < sizeof sql);
    return statement_open(out, db, sql);
}

enum status insert_open(struct statement **out, struct database *db, enum recording_table table, bool or_replace)
{
    const struct table_columns *t = &table_columns[table];
    char sql[700];
    size_t used =
        (size_t)snprintf(sql, sizeof sql, "INSERT %sINTO %s(%s", or_replace ? "OR REPLACE " : "", t->name, t->columns);
    int count = 1;
    for (const char *c = t->columns; *c; c++)
        count += *c == ',';
    for (const struct optional_column *c = t->optional; c->name; c++, count++)
        used += (size_t)snprintf(sql + used, sizeof sql - used, ", %s", c->name);
    used += (size_t)snprintf(sql + used, sizeof sql - used, ") VALUES(");
    for (int i = 0; i < count; i++)
        used += (size_t)snprintf(sql + used, sizeof sql - used, "%s?", i ? "," : "");
    used += (size_t)snprintf(sql + used, sizeof sql - used, ")");
    assert(used < sizeof sql);
    return statement_open(out, db, sql);
}

void take_bind(struct statement *row, const struct take_row *take_row, uint8_t calibration[CALIBRATION_BYTES],
               uint8_t body[BODY_BYTES])
{
    put_calibration(calibration, &take_row->calibration);
    put_body(body, &take_row->body);
    const uint32_t crc = take_crc(take_row->name, calibration, take_row->complete, take_row->dropped, body);
    statement_bind_number(row, 1, take_row->id);
    statement_bind_text(row, 2, take_row->name);
    statement_bind_blob(row, 3, calibration, CALIBRATION_BYTES);
    statement_bind_number(row, 4, take_row->complete);
    statement_bind_number(row, 5, take_row->dropped);
    statement_bind_blob(row, 6, body, BODY_BYTES);
    statement_bind_number(row, 7, crc);
    statement_bind_number(row, TAKE_FRAMES + 1, take_row->frames);
    statement_bind_number(row, TAKE_LOST + 1, take_row->lost);
    statement_bind_text(row, TAKE_NOTE + 1, take_row->note);
    statement_bind_text(row, TAKE_ALIAS + 1, take_row->alias);
    statement_bind_number(row, TAKE_SEAL + 1, take_seal(take_row, crc));
}

// ------------------------------------------------------------- layouts

static uint8_t *put_vec3(uint8_t *at, struct vec3 v) { return put_f64(put_f64(put_f64(at, v.x), v.y), v.z); }

static struct vec3 get_vec3(const uint8_t **at)
{
    struct vec3 v;
    v.x = get_f64(at);
    v.y = get_f64(at);
    v.z = get_f64(at);
    return v;
}

void put_pose(uint8_t out[POSE_BYTES], const struct pose *pose)
{
    uint8_t *at = put_vec3(out, pose->translation);
    at = put_f64(at, pose->rotation.x);
    at = put_f64(at, pose->rotation.y);
    at = put_f64(at, pose->rotation.z);
    put_f64(at, pose->rotation.w);
}

void get_pose(const uint8_t in[POSE_BYTES], struct pose *out)
{
    out->translation = get_vec3(&in);
    out->rotation.x = get_f64(&in);
    out->rotation.y = get_f64(&in);
    out->rotation.z = get_f64(&in);
    out->rotation.w = get_f64(&in);
}

static uint8_t *put_lens(uint8_t *at, const struct lens *lens)
{
    const double numbers[9] = {lens->fx, lens->fy, lens->cx, lens->cy, lens->k1,
                               lens->k2, lens->p1, lens->p2, lens->k3};
    at = put_u32(put_u32(at, (uint32_t)lens->width), (uint32_t)lens->height);
    for (int i = 0; i < 9; i++)
        at = put_f64(at, numbers[i]);
    return at;
}

static void get_lens(const uint8_t **at, struct lens *lens)
{
    double *numbers[9] = {&lens->fx, &lens->fy, &lens->cx, &lens->cy, &lens->k1,
                          &lens->k2, &lens->p1, &lens->p2, &lens->k3};
    lens->width = (int32_t)get_u32(at);
    lens->height = (int32_t)get_u32(at);
    for (int i = 0; i < 9; i++)
        *numbers[i] = get_f64(at);
}

void put_calibration(uint8_t out[CALIBRATION_BYTES], const struct calibration *calibration)
{
    uint8_t *at = put_lens(put_lens(out, &calibration->color), &calibration->depth);
    put_pose(put_u8(at, calibration->registered), &calibration->color_from_depth);
}

void get_calibration(const uint8_t in[CALIBRATION_BYTES], struct calibration *out)
{
    get_lens(&in, &out->color);
    get_lens(&in, &out->depth);
    out->registered = *in++ != 0;
    get_pose(in, &out->color_from_depth);
    if (out->registered) // files of earlier versions may hold another; see struct calibration
        out->color_from_depth = POSE_IDENTITY;
}

void put_skeleton(uint8_t out[SKELETON_BYTES], const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        // An unknown joint's position is meaningless and must not make the file invalid.
        bool is_undefined = skeleton->confidence[j] == 0 && !position_is_valid(skeleton->joint[j]);
        out = put_vec3(out, is_undefined ? v3(0, 0, 0) : skeleton->joint[j]);
        out = put_f32(out, skeleton->confidence[j]);
    }
}

void get_skeleton(const uint8_t in[SKELETON_BYTES], struct skeleton *out)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        out->joint[j] = get_vec3(&in);
        out->confidence[j] = get_f32(&in);
        if (out->confidence[j] == 0 && !position_is_valid(out->joint[j]))
            out->joint[j] = v3(0, 0, 0);
    }
}

void put_joint_error(uint8_t out[JOINT_ERROR_BYTES], const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        for (int i = 0; i < 6; i++)
            out = put_u16(out, skeleton->covariance[j].half[i]);
}

void get_joint_error(const uint8_t in[JOINT_ERROR_BYTES], struct skeleton *out)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        for (int i = 0; i < 6; i++)
            out->covariance[j].half[i] = get_u16(&in);
}

void put_body(uint8_t out[BODY_BYTES], const struct body *body)
{
    out = put_u64(out, (uint64_t)body->representative_frame);
    for (int p = 0; p < PART_COUNT; p++)
        out = put_f64(out, body->radius_rate[p]);
}

void get_body(const uint8_t in[BODY_BYTES], struct body *out)
{
    out->representative_frame = (int64_t)get_u64(&in);
    for (int p = 0; p < PART_COUNT; p++)
        out->radius_rate[p] = get_f64(&in);
}

void put_residuals(uint8_t out[RESIDUAL_BYTES], double rms_px, double rms_m) { put_f64(put_f64(out, rms_px), rms_m); }

void get_residuals(const uint8_t in[RESIDUAL_BYTES], double *rms_px, double *rms_m)
{
    *rms_px = get_f64(&in);
    *rms_m = get_f64(&in);
}

void put_tag(uint8_t out[TAG_BYTES], const struct place_tag *tag)
{
    out = put_f64(put_u32(out, (uint32_t)tag->id), tag->side_m);
    put_pose(out, &tag->world_from_tag);
    put_u32(put_f64(out + POSE_BYTES, tag->rms_px), (uint32_t)tag->observations);
}

void get_tag(const uint8_t in[TAG_BYTES], struct place_tag *out)
{
    out->id = (int32_t)get_u32(&in);
    out->side_m = get_f64(&in);
    get_pose(in, &out->world_from_tag);
    in += POSE_BYTES;
    out->rms_px = get_f64(&in);
    out->observations = (int32_t)get_u32(&in);
}

void put_point(uint8_t out[POINT_BYTES], const struct place_landmark *point)
{
    memcpy(put_vec3(out, point->world), point->descriptor, sizeof point->descriptor);
}

void get_point(const uint8_t in[POINT_BYTES], struct place_landmark *out)
{
    out->world = get_vec3(&in);
    memcpy(out->descriptor, in, sizeof out->descriptor);
}

static void put_floats(uint8_t *out, const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        out = put_f32(out, values[i]);
}

static void get_floats(const uint8_t *in, float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        values[i] = get_f32(&in);
}

void put_point_error(uint8_t out[POINT_ERROR_BYTES], const struct place_landmark *point)
{
    put_floats(out, point->covariance, COUNT_OF(point->covariance));
}

void get_point_error(const uint8_t in[POINT_ERROR_BYTES], struct place_landmark *out)
{
    get_floats(in, out->covariance, COUNT_OF(out->covariance));
}

void put_tag_error(uint8_t out[TAG_ERROR_BYTES], const struct place_tag *tag)
{
    put_floats(out, tag->covariance, COUNT_OF(tag->covariance));
}

void get_tag_error(const uint8_t in[TAG_ERROR_BYTES], struct place_tag *out)
{
    get_floats(in, out->covariance, COUNT_OF(out->covariance));
}

void put_point_side(uint8_t out[POINT_SIDE_BYTES], const struct place_landmark *point)
{
    put_floats(out, point->seen_from, COUNT_OF(point->seen_from));
}

void get_point_side(const uint8_t in[POINT_SIDE_BYTES], struct place_landmark *out)
{
    get_floats(in, out->seen_from, COUNT_OF(out->seen_from));
}

// ------------------------------------------------------------- checks

bool position_is_valid(struct vec3 p)
{
    return v3_finite(p) && fabs(p.x) < RECORDING_METRES_MAX && fabs(p.y) < RECORDING_METRES_MAX &&
           fabs(p.z) < RECORDING_METRES_MAX;
}

bool pose_is_valid(struct pose pose)
{
    static const double LENGTH_OFF_MAX = 1e-3; // who computes in single precision is off by a thousandth of that
    const struct quat q = pose.rotation;
    const double length = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w); // inf of large numbers, NaN of NaN
    return position_is_valid(pose.translation) && fabs(length - 1) < LENGTH_OFF_MAX;
}

bool tag_is_finite(const struct place_tag *tag)
{
    bool finite = isfinite(tag->side_m) && isfinite(tag->rms_px) && pose_is_valid(tag->world_from_tag);
    for (int row = 0, i = 0; row < 6; i += 6 - row++) // in the upper triangle each row begins with its diagonal element
        finite = finite && tag->covariance[i] >= 0;
    for (size_t i = 0; i < COUNT_OF(tag->covariance); i++)
        finite = finite && isfinite(tag->covariance[i]);
    return finite;
}

bool point_is_finite(const struct place_landmark *point)
{
    const float *c = point->covariance;
    bool finite = position_is_valid(point->world) && c[0] >= 0 && c[3] >= 0 && c[5] >= 0;
    for (size_t i = 0; i < COUNT_OF(point->covariance); i++)
        finite = finite && isfinite(c[i]);
    for (size_t i = 0; i < COUNT_OF(point->seen_from); i++)
        finite = finite && isfinite(point->seen_from[i]);
    return finite;
}

bool place_is_finite(const struct place *place)
{
    bool finite = isfinite(place->rms_px) && isfinite(place->rms_m);
    for (int32_t i = 0; i < place->tag_count; i++)
        finite = finite && tag_is_finite(&place->tags[i]);
    for (int32_t i = 0; i < place->point_count; i++)
        finite = finite && point_is_finite(&place->points[i]);
    for (int32_t i = 0; i < place->view_count; i++)
        finite = finite && pose_is_valid(place->views[i].world_from_camera);
    return finite;
}

static bool pose_is_identity(struct pose pose)
{
    return pose.rotation.x == 0 && pose.rotation.y == 0 && pose.rotation.z == 0 && fabs(pose.rotation.w) == 1 &&
           pose.translation.x == 0 && pose.translation.y == 0 && pose.translation.z == 0;
}

enum status calibration_check(const struct calibration *calibration)
{
    enum status status = OK;
    if (calibration->color.width)
        status = lens_check(&calibration->color, "color");
    if (status == OK && calibration->depth.width)
        status = lens_check(&calibration->depth, "depth");
    if (status == OK && !pose_is_valid(calibration->color_from_depth))
        status =
            fail(ERR_INPUT, "the calibration's color_from_depth holds a number that is not finite or out of range");
    if (status == OK && calibration->registered && !pose_is_identity(calibration->color_from_depth))
        status = fail(ERR_INPUT, "the calibration says that depth is registered to colour, and that the depth camera "
                                 "stands elsewhere; one of the two is wrong");
    return status;
}

bool skeleton_has_known_joint(const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (skeleton->confidence[j] > 0)
            return true;
    return false;
}

bool skeleton_has_covariance(const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (covariance_is_known(skeleton->covariance[j]))
            return true;
    return false;
}

bool skeleton_is_valid(const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (!isfinite(skeleton->confidence[j]) ||
            (skeleton->confidence[j] != 0 && !position_is_valid(skeleton->joint[j])) ||
            !covariance_is_finite(skeleton->covariance[j]))
            return false;
    return true;
}

bool body_is_valid(const struct body *body)
{
    for (int p = 0; p < PART_COUNT; p++)
        if (!(body->radius_rate[p] >= 0 && body->radius_rate[p] <= BODY_RADIUS_RATE_MAX))
            return false;
    return true;
}

// ------------------------------------------------------------- files and tables

void recording_discard(const char *path) { recording_remove_files(path); }

void recording_remove_files(const char *path)
{
    static const char *const endings[] = {"", "-wal", "-shm", "-journal"};
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char name[4200];
        if (snprintf(name, sizeof name, "%s%s", path, endings[i]) < (int)sizeof name)
            unlink(name);
    }
}

enum status recording_raise_schema(struct database *db)
{
    char sql[64];
    int64_t schema = 0;
    enum status status = database_number(db, "PRAGMA user_version", &schema);
    if (status != OK || schema >= RECORDING_SCHEMA)
        return status;
    snprintf(sql, sizeof sql, "PRAGMA user_version = %d", RECORDING_SCHEMA);
    return database_run(db, sql);
}

enum status recording_make_tables(struct database *db)
{
    char sql[200];
    snprintf(sql, sizeof sql, "PRAGMA application_id = %d; PRAGMA user_version = %d;", RECORDING_APPLICATION,
             RECORDING_SCHEMA);
    enum status status = database_begin(db);
    if (status == OK)
        status = database_run(db, recording_tables);
    if (status == OK)
        status = database_run(db, sql);
    return status == OK ? database_run(db, "COMMIT") : status;
}

// ------------------------------------------------------------- no other file in its place

// An SQLite file whose application_id is RECORDING_APPLICATION (docs/format.md). Read without SQLite, and never where a
// descriptor of this process may have locked it: closing it would drop the locks.
static bool is_recording(const char *path)
{
    enum { APPLICATION_AT = 68 };
    static const char head[16] = "SQLite format 3";
    uint8_t bytes[72];
    const int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0)
        return false;
    const bool read_all = read(file, bytes, sizeof bytes) == (ssize_t)sizeof bytes;
    close(file);
    uint32_t application = 0;
    for (int i = 0; i < 4 && read_all; i++)
        application = application << 8 | bytes[APPLICATION_AT + i];
    return read_all && !memcmp(bytes, head, sizeof head) && application == RECORDING_APPLICATION;
}

// In every program that can make or read a recording, so that none can forget it.
__attribute__((constructor)) static void protect_recordings(void) { file_protect(is_recording, "a recording"); }

// ---------------------------------------------------------------- a change beside the takes

enum status recording_change(const char *path, const char *statements,
                             enum status (*insert)(struct database *db, const void *what), const void *what)
{
    struct database *db;
    enum status status = database_open(&db, path, DATABASE_WRITE);
    if (status == OK)
        status = recording_check_tables(db);
    if (status == OK)
        status = database_lock_writer(db);
    const bool locked = status == OK;
    if (status == OK)
        status = database_begin(db);
    if (status == OK)
        status = database_run(db, statements);
    if (status == OK)
        status = insert(db, what);
    if (status == OK)
        status = database_run(db, "COMMIT");
    struct failure first;
    failure_keep(&first, status);
    if (db && database_in_transaction(db) && database_run(db, "ROLLBACK") != OK)
        status = first.status;
    if (locked && status == OK)
        status = database_close_wal(db);
    database_close(&db);
    return first.status == OK ? status : failure_restore(&first);
}
