// Opening a recording, and reading its place. take_reader.c reads its takes.
#include "recording/recording_reader.h"

#include "base/text.h"
#include "recording/depth_codec.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct recorded_take {
    int64_t id;
    bool name_is_valid;
    char name[TAKE_NAME_BYTES + 1];
};

struct recording {
    struct database *db;
    struct recorded_take *takes;
    int take_count;
    int *by_name; // the takes' indices, sorted by name, those of the same name by index
    // What every take is opened with, kept from one to the next for as long as the file's tables are the same.
    struct statement *read_schema, *kept[TABLE_COUNT];
    int64_t schema; // PRAGMA schema_version that they were made for
};

const uint8_t *recording_blob(struct statement *statement, int column, size_t bytes)
{
    size_t count;
    const uint8_t *blob = statement_blob(statement, column, &count);
    return count == bytes ? blob : NULL;
}

enum status recording_damaged(const struct recording *recording, const char *what)
{
    return fail(ERR_CORRUPT, "%s is damaged: %s; try reenact-capture repair", database_path(recording->db), what);
}

// ------------------------------------------------------------- the file

static enum status no_memory(const struct recording *recording)
{
    return fail(ERR_MEMORY, "no memory to read %s", database_path(recording->db));
}

static void read_name(struct statement *statement, struct recorded_take *out)
{
    const char *name = statement_text(statement, 1);
    const int bytes = snprintf(out->name, sizeof out->name, "%s", name);
    out->name_is_valid = bytes > 0 && bytes < (int)sizeof out->name && text_is_printable(name);
    text_make_printable(out->name);
}

static int compare_names(const void *a, const void *b, void *takes)
{
    const int left = *(const int *)a, right = *(const int *)b;
    const int order = strcmp(((struct recorded_take *)takes)[left].name, ((struct recorded_take *)takes)[right].name);
    return order ? order : (left > right) - (left < right);
}

static enum status sort_takes(struct recording *recording)
{
    recording->by_name = malloc(sizeof *recording->by_name * ((size_t)recording->take_count + 1));
    if (!recording->by_name)
        return no_memory(recording);
    for (int i = 0; i < recording->take_count; i++)
        recording->by_name[i] = i;
    qsort_r(recording->by_name, (size_t)recording->take_count, sizeof *recording->by_name, compare_names,
            recording->takes);
    return OK;
}

static enum status list_takes(struct recording *recording)
{
    struct statement *s;
    int capacity = 0;
    enum status status = statement_open(&s, recording->db, "SELECT rowid, name FROM take ORDER BY rowid");
    while (status == OK && (status = statement_step(s)) == OK) {
        if (recording->take_count == capacity) {
            capacity = capacity ? 2 * capacity : 16;
            struct recorded_take *grown = realloc(recording->takes, sizeof *grown * (size_t)capacity);
            if (!grown) {
                status = no_memory(recording);
                break;
            }
            recording->takes = grown;
        }
        struct recorded_take *take = &recording->takes[recording->take_count++];
        take->id = statement_number(s, 0);
        read_name(s, take);
        if ((status = statement_check(s)) != OK)
            break;
    }
    statement_close(&s);
    return status == NOTHING ? sort_takes(recording) : status;
}

int recording_find_take(const struct recording *recording, const char *name)
{
    int low = 0, high = recording->take_count; // the first that is not before the name
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (strcmp(recording->takes[recording->by_name[middle]].name, name) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    const int found = low < recording->take_count ? recording->by_name[low] : -1;
    return found >= 0 && !strcmp(recording->takes[found].name, name) ? found : -1;
}

bool recording_take_name_is_valid(const struct recording *recording, int index)
{
    assert(index >= 0 && index < recording->take_count);
    return recording->takes[index].name_is_valid;
}

enum status recording_open_as(struct recording **out, const char *path, enum database_access access)
{
    *out = NULL;
    struct recording *r = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory to read %s", path);
    enum status status = database_open(&r->db, path, access);
    if (status == OK)
        status = recording_check_tables(r->db);
    if (status == OK)
        status = list_takes(r);
    if (status == OK)
        *out = r;
    else
        recording_free(&r);
    return status;
}

enum status recording_open(struct recording **out, const char *path)
{
    return recording_open_as(out, path, DATABASE_READ);
}

static void forget_statements(struct recording *recording)
{
    for (int i = 0; i < TABLE_COUNT; i++)
        statement_close(&recording->kept[i]);
}

enum status recording_keep_statements(struct recording *recording)
{
    int64_t schema = 0;
    enum status status =
        recording->read_schema ? OK : statement_open(&recording->read_schema, recording->db, "PRAGMA schema_version");
    if (status == OK)
        status = statement_step(recording->read_schema);
    if (status == OK)
        schema = statement_number(recording->read_schema, 0);
    if (recording->read_schema)
        statement_reset(recording->read_schema);
    if (schema != recording->schema)
        forget_statements(recording);
    recording->schema = schema;
    return status;
}

enum status recording_statement(struct recording *recording, enum recording_table table, struct statement **out)
{
    *out = recording->kept[table];
    if (*out)
        return OK;
    const enum status status =
        select_open(&recording->kept[table], recording->db, table,
                    table == TABLE_TAKE ? "WHERE rowid = ?" : "WHERE rowid BETWEEN ? AND ? ORDER BY rowid");
    *out = recording->kept[table];
    return status;
}

void recording_free(struct recording **recording)
{
    if (!*recording)
        return;
    forget_statements(*recording);
    statement_close(&(*recording)->read_schema);
    database_close(&(*recording)->db);
    free((*recording)->takes);
    free((*recording)->by_name);
    free(*recording);
    *recording = NULL;
}

int recording_take_count(const struct recording *recording) { return recording->take_count; }

int64_t recording_take_id(const struct recording *recording, int index)
{
    assert(index >= 0 && index < recording->take_count);
    return recording->takes[index].id;
}

const char *recording_take_name(const struct recording *recording, int index)
{
    assert(index >= 0 && index < recording->take_count);
    return recording->takes[index].name;
}

struct database *recording_database(struct recording *recording) { return recording->db; }

const char *recording_path(const struct recording *recording) { return database_path(recording->db); }

enum status recording_has_joint_errors(struct database *db, bool *out)
{
    int64_t tables = 0;
    enum status status = database_number(db, COUNT_TABLES("'joint_error'"), &tables);
    *out = tables > 0;
    return status;
}

// ------------------------------------------------------------- the place

// Decodes tags and points from their blobs. False: out of memory.
static bool unpack_items(struct place *place, const uint8_t *tags, size_t tag_bytes, const uint8_t *points,
                         size_t point_bytes)
{
    place->tag_count = (int32_t)(tag_bytes / TAG_BYTES);
    place->point_count = (int32_t)(point_bytes / POINT_BYTES);
    place->tags = calloc((size_t)place->tag_count + 1, sizeof *place->tags);
    place->points = calloc((size_t)place->point_count + 1, sizeof *place->points);
    if (!place->tags || !place->points) {
        place->tag_count = place->point_count = 0;
        return false;
    }
    for (int32_t i = 0; i < place->tag_count; i++)
        get_tag(tags + (size_t)i * TAG_BYTES, &place->tags[i]);
    for (int32_t i = 0; i < place->point_count; i++)
        get_point(points + (size_t)i * POINT_BYTES, &place->points[i]);
    return true;
}

static enum status read_place_row(struct recording *recording, struct place *place)
{
    struct statement *s;
    enum status status = select_open(&s, recording->db, TABLE_PLACE, "");
    if (status == OK)
        status = statement_step(s);
    if (status == OK) {
        size_t tag_bytes, point_bytes;
        const uint8_t *calibration = recording_blob(s, 0, CALIBRATION_BYTES),
                      *residuals = recording_blob(s, 1, RESIDUAL_BYTES);
        const uint8_t *tags = statement_blob(s, 2, &tag_bytes), *points = statement_blob(s, 3, &point_bytes);
        uint32_t crc = calibration ? crc32_of(0, calibration, CALIBRATION_BYTES) : 0;
        crc = residuals ? crc32_of(crc, residuals, RESIDUAL_BYTES) : 0;
        crc = crc32_of(crc32_of(crc, tags, tag_bytes), points, point_bytes);
        const int64_t views = statement_number(s, PLACE_VIEWS);
        if (!calibration || !residuals || tag_bytes % TAG_BYTES || point_bytes % POINT_BYTES ||
            crc != statement_number(s, 4) || !seal_matches(s, PLACE_SEAL, place_seal(crc, views))) {
            status = recording_damaged(recording, "the place cannot be read");
        } else {
            get_calibration(calibration, &place->calibration);
            get_residuals(residuals, &place->rms_px, &place->rms_m);
            place->views_lost = views > 0 && views <= PLACE_ITEMS_MAX ? (int32_t)views : 0; // all, until they are read
            if (calibration_check(&place->calibration) != OK)
                status = recording_damaged(recording, status_message());
            else if (!unpack_items(place, tags, tag_bytes, points, point_bytes))
                status = fail(ERR_MEMORY, "no memory for the place of %s", database_path(recording->db));
        }
    }
    statement_close(&s);
    return status;
}

static const size_t optional_bytes[OPTIONAL_TABLE_COUNT] = {POINT_ERROR_BYTES, TAG_ERROR_BYTES, POINT_SIDE_BYTES};

static void get_optional(enum optional_table which, const uint8_t *known, struct place *place, int32_t i)
{
    switch (which) {
    case OPTIONAL_TAG_ERROR: get_tag_error(known, &place->tags[i]); break;
    case OPTIONAL_POINT_ERROR: get_point_error(known, &place->points[i]); break;
    default: get_point_side(known, &place->points[i]); break;
    }
}

// What the tables of points or tags hold for all of them; `known` NULL: nothing is known. False: a number is not
// finite.
static bool unpack_optional(enum optional_table which, const uint8_t *known, struct place *place)
{
    static const uint8_t nothing[TAG_ERROR_BYTES] = {0};
    const bool tags = which == OPTIONAL_TAG_ERROR;
    const int32_t items = tags ? place->tag_count : place->point_count;
    bool finite = true;
    for (int32_t i = 0; i < items && finite; i++) {
        get_optional(which, known ? known + (size_t)i * optional_bytes[which] : nothing, place, i);
        finite = tags ? tag_is_finite(&place->tags[i]) : point_is_finite(&place->points[i]);
    }
    return finite;
}

// Reads one optional table of points or tags into *place. Older files lack some of them. A damaged one costs itself
// alone.
static enum status read_optional(struct recording *recording, enum optional_table which, struct place *place)
{
    static const char *const count[OPTIONAL_TABLE_COUNT] = {COUNT_TABLES("'point_error'"), COUNT_TABLES("'tag_error'"),
                                                            COUNT_TABLES("'point_side'")};
    static const char *const select[OPTIONAL_TABLE_COUNT] = {"SELECT covariances, crc FROM point_error",
                                                             "SELECT covariances, crc FROM tag_error",
                                                             "SELECT directions, crc FROM point_side"};
    const int32_t items = which == OPTIONAL_TAG_ERROR ? place->tag_count : place->point_count;
    struct statement *s = NULL;
    int64_t tables = 0;
    enum status status = database_number(recording->db, count[which], &tables);
    if (status == OK && tables)
        status = statement_open(&s, recording->db, select[which]);
    if (status == OK && tables && (status = statement_step(s)) == OK) {
        size_t bytes;
        const uint8_t *known = statement_blob(s, 0, &bytes);
        if (bytes != (size_t)items * optional_bytes[which] || crc32_of(0, known, bytes) != statement_number(s, 1) ||
            !unpack_optional(which, known, place)) {
            place->errors_lost = true;
            unpack_optional(which, NULL, place); // they are then not known
        }
    }
    statement_close(&s);
    if (status == ERR_CORRUPT)
        place->errors_lost = true;
    return status == NOTHING || status == ERR_CORRUPT ? OK : status;
}

static enum status read_view(struct recording *recording, struct statement *statement, struct depth_coder *coder,
                             struct place *place)
{
    size_t depth_bytes, color_bytes;
    const uint8_t *pose = recording_blob(statement, 1, POSE_BYTES), *depth = statement_blob(statement, 2, &depth_bytes),
                  *color = statement_blob(statement, 3, &color_bytes);
    const int64_t crc = statement_number(statement, 4);
    if (!pose || view_crc(pose, depth, depth_bytes, color, color_bytes) != crc ||
        !seal_matches(statement, VIEW_SEAL, row_seal(statement_number(statement, 0), (uint32_t)crc)))
        return recording_damaged(recording, "a view of the place cannot be read");
    struct place_view *grown = realloc(place->views, sizeof *grown * ((size_t)place->view_count + 1));
    if (!grown)
        return fail(ERR_MEMORY, "no memory for the views of %s", database_path(recording->db));
    place->views = grown;
    struct place_view *view = &grown[place->view_count++];
    *view = (struct place_view){0};
    get_pose(pose, &view->world_from_camera);
    if (!pose_is_valid(view->world_from_camera))
        return recording_damaged(recording, "a view of the place holds a number that is not finite or out of range");
    if (color_bytes) {
        if (!(view->jpeg = malloc(color_bytes)))
            return fail(ERR_MEMORY, "no memory for the views of %s", database_path(recording->db));
        memcpy(view->jpeg, color, color_bytes);
        view->jpeg_bytes = color_bytes;
    }
    if (!depth_bytes)
        return OK;
    const struct lens *lens = &place->calibration.depth;
    if (!depth_pixels(&place->calibration))
        return recording_damaged(recording, "a view of the place has depth but no depth camera");
    if (!(view->depth = malloc(depth_pixels(&place->calibration) * sizeof *view->depth)))
        return fail(ERR_MEMORY, "no memory for the views of %s", database_path(recording->db));
    enum status status = depth_decode(coder, depth, depth_bytes, view->depth, lens->width, lens->height);
    return status == ERR_CORRUPT ? recording_damaged(recording, status_message()) : status;
}

// A damaged view costs itself alone.
static enum status read_views(struct recording *recording, struct statement *statement, struct depth_coder *coder,
                              struct place *place)
{
    int32_t expected = place->views_lost, rows = 0;
    enum status status;
    while ((status = statement_step(statement)) == OK) {
        const int32_t before = place->view_count;
        status = read_view(recording, statement, coder, place);
        rows++;
        if (status == ERR_CORRUPT && place->view_count > before) {
            struct place_view *view = &place->views[--place->view_count];
            free(view->jpeg);
            free(view->depth);
        } else if (status != OK && status != ERR_CORRUPT) {
            return status;
        }
    }
    if (status != NOTHING && status != ERR_CORRUPT) // a damaged page ends the table
        return status;
    const int32_t all = rows > expected ? rows : expected;
    place->views_lost = all - place->view_count + (status == ERR_CORRUPT && all == place->view_count);
    return OK;
}

static enum status read_place(struct recording *recording, bool views, struct place *out)
{
    struct place place = {0};
    struct statement *s = NULL;
    struct depth_coder *coder = NULL;
    enum status status = read_place_row(recording, &place);
    if (status == OK)
        status = read_optional(recording, OPTIONAL_POINT_ERROR, &place);
    if (status == OK)
        status = read_optional(recording, OPTIONAL_TAG_ERROR, &place);
    if (status == OK)
        status = read_optional(recording, OPTIONAL_POINT_SIDE, &place);
    if (status == OK)
        status = depth_coder_open(&coder);
    if (status == OK && views)
        status = select_open(&s, recording->db, TABLE_VIEW, "ORDER BY rowid");
    bool has_place = status == OK;
    if (status == OK && views)
        status = read_views(recording, s, coder, &place);
    statement_close(&s);
    depth_coder_close(&coder);
    if (has_place && status == OK && !place_is_finite(&place))
        status = recording_damaged(recording, "the place holds a number that is not finite or out of range");
    if (has_place && status == OK) {
        *out = place;
        return OK;
    }
    place_free(&place);
    return status;
}

enum status recording_read_place(struct recording *recording, struct place *out)
{
    return read_place(recording, true, out);
}

enum status recording_read_map(struct recording *recording, struct place *out)
{
    return read_place(recording, false, out);
}
