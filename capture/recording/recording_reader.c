// Reading a recording: the takes' names on opening, a take's entries on
// take_open, pictures one at a time.
#include "capture/recording/recording_reader.h"

#include "capture/recording/depth_codec.h"
#include "platform/jpeg.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct recording {
    struct database *db;
    struct recorded_take *takes;
    int take_count;
};

struct take {
    struct recording *recording;
    struct calibration calibration;
    struct body body;
    bool complete;
    int64_t dropped;
    struct take_entry *entries;
    int64_t *keys; // of each entry's rows
    int64_t count;
    struct statement *read_images;
    struct depth_coder *coder;
    uint8_t *color, *mask;
    uint16_t *depth;
};

// A column as a blob of exactly `bytes`; NULL when it is not.
static const uint8_t *blob_of(struct statement *s, int column, size_t bytes)
{
    size_t count;
    const uint8_t *blob = statement_blob(s, column, &count);
    return count == bytes ? blob : NULL;
}

static enum status damaged(const struct recording *r, const char *what)
{
    return fail(ERR_CORRUPT, "%s is damaged: %s; try reenact-capture repair", database_path(r->db), what);
}

// ------------------------------------------------------------- the file

static enum status list_takes(struct recording *r)
{
    struct statement *s;
    enum status status = statement_open(&s, r->db, "SELECT rowid, name FROM take ORDER BY rowid");
    while (status == OK && (status = statement_step(s)) == OK) {
        struct recorded_take *grown = realloc(r->takes, sizeof *grown * ((size_t)r->take_count + 1));
        if (!grown) {
            status = fail(ERR_MEMORY, "no memory to read %s", database_path(r->db));
            break;
        }
        r->takes = grown;
        struct recorded_take *take = &grown[r->take_count++];
        take->id = statement_number(s, 0);
        snprintf(take->name, sizeof take->name, "%s", statement_text(s, 1));
    }
    statement_close(&s);
    return status == NOTHING ? OK : status;
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

void recording_free(struct recording **r)
{
    if (!*r)
        return;
    database_close(&(*r)->db);
    free((*r)->takes);
    free(*r);
    *r = NULL;
}

int recording_take_count(const struct recording *r) { return r->take_count; }

const char *recording_take_name(const struct recording *r, int index)
{
    assert(index >= 0 && index < r->take_count);
    return r->takes[index].name;
}

struct database *recording_database(struct recording *r) { return r->db; }

// ------------------------------------------------------------- the place

// Tags and points from their blobs. False: no memory.
static bool unpack_items(struct place *p, const uint8_t *tags, size_t tag_bytes, const uint8_t *points,
                         size_t point_bytes)
{
    p->tag_count = (int32_t)(tag_bytes / TAG_BYTES);
    p->point_count = (int32_t)(point_bytes / POINT_BYTES);
    p->tags = calloc((size_t)p->tag_count + 1, sizeof *p->tags);
    p->points = calloc((size_t)p->point_count + 1, sizeof *p->points);
    if (!p->tags || !p->points) {
        p->tag_count = p->point_count = 0;
        return false;
    }
    for (int32_t i = 0; i < p->tag_count; i++)
        get_tag(tags + (size_t)i * TAG_BYTES, &p->tags[i]);
    for (int32_t i = 0; i < p->point_count; i++)
        get_point(points + (size_t)i * POINT_BYTES, &p->points[i]);
    return true;
}

static enum status read_place_row(struct recording *r, struct place *p)
{
    struct statement *s;
    enum status status = statement_open(&s, r->db, "SELECT " PLACE_COLUMNS " FROM place");
    if (status == OK)
        status = statement_step(s);
    if (status == OK) {
        size_t tag_bytes, point_bytes;
        const uint8_t *calibration = blob_of(s, 0, CALIBRATION_BYTES), *residuals = blob_of(s, 1, RESIDUAL_BYTES);
        const uint8_t *tags = statement_blob(s, 2, &tag_bytes), *points = statement_blob(s, 3, &point_bytes);
        uint32_t crc = calibration ? crc32_of(0, calibration, CALIBRATION_BYTES) : 0;
        crc = residuals ? crc32_of(crc, residuals, RESIDUAL_BYTES) : 0;
        crc = crc32_of(crc32_of(crc, tags, tag_bytes), points, point_bytes);
        if (!calibration || !residuals || tag_bytes % TAG_BYTES || point_bytes % POINT_BYTES ||
            crc != statement_number(s, 4)) {
            status = damaged(r, "the place cannot be read");
        } else {
            get_calibration(calibration, &p->calibration);
            get_residuals(residuals, &p->rms_px, &p->rms_m);
            if (calibration_check(&p->calibration) != OK)
                status = damaged(r, status_message());
            else if (!unpack_items(p, tags, tag_bytes, points, point_bytes))
                status = fail(ERR_MEMORY, "no memory for the place of %s", database_path(r->db));
        }
    }
    statement_close(&s);
    return status;
}

// What else is known of points, or tags. Older files do not have all of it.
static enum status read_optional(struct recording *r, enum optional_table which, struct place *p)
{
    static const char *const count[OPTIONAL_TABLE_COUNT] = {COUNT_TABLES("'point_error'"), COUNT_TABLES("'tag_error'"),
                                                            COUNT_TABLES("'point_side'")};
    static const char *const select[OPTIONAL_TABLE_COUNT] = {"SELECT covariances, crc FROM point_error",
                                                             "SELECT covariances, crc FROM tag_error",
                                                             "SELECT directions, crc FROM point_side"};
    static const size_t bytes_each[OPTIONAL_TABLE_COUNT] = {POINT_ERROR_BYTES, TAG_ERROR_BYTES, POINT_SIDE_BYTES};
    const int32_t items = which == OPTIONAL_TAG_ERROR ? p->tag_count : p->point_count;
    const size_t each = bytes_each[which];
    struct statement *s = NULL;
    int64_t tables = 0;
    enum status status = database_number(r->db, count[which], &tables);
    if (status == OK && tables)
        status = statement_open(&s, r->db, select[which]);
    if (status == OK && tables && (status = statement_step(s)) == OK) {
        size_t bytes;
        const uint8_t *known = statement_blob(s, 0, &bytes);
        if (bytes != (size_t)items * each || crc32_of(0, known, bytes) != statement_number(s, 1))
            status =
                damaged(r, "how sure the place is of its points and tags, or from where it saw them, cannot be read");
        for (int32_t i = 0; i < items && status == OK; i++, known += each) {
            if (which == OPTIONAL_TAG_ERROR)
                get_tag_error(known, &p->tags[i]);
            else if (which == OPTIONAL_POINT_ERROR)
                get_point_error(known, &p->points[i]);
            else
                get_point_side(known, &p->points[i]);
        }
    }
    statement_close(&s);
    return status == NOTHING ? OK : status;
}

static enum status read_view(struct recording *r, struct statement *s, struct depth_coder *coder, struct place *p)
{
    size_t depth_bytes, color_bytes;
    const uint8_t *pose = blob_of(s, 1, POSE_BYTES), *depth = statement_blob(s, 2, &depth_bytes),
                  *color = statement_blob(s, 3, &color_bytes);
    if (!pose || view_crc(pose, depth, depth_bytes, color, color_bytes) != statement_number(s, 4))
        return damaged(r, "a view of the place cannot be read");
    struct place_view *grown = realloc(p->views, sizeof *grown * ((size_t)p->view_count + 1));
    if (!grown)
        return fail(ERR_MEMORY, "no memory for the views of %s", database_path(r->db));
    p->views = grown;
    struct place_view *view = &grown[p->view_count++];
    *view = (struct place_view){0};
    get_pose(pose, &view->world_from_camera);
    if (color_bytes) {
        if (!(view->jpeg = malloc(color_bytes)))
            return fail(ERR_MEMORY, "no memory for the views of %s", database_path(r->db));
        memcpy(view->jpeg, color, color_bytes);
        view->jpeg_bytes = color_bytes;
    }
    if (!depth_bytes)
        return OK;
    const struct lens *lens = &p->calibration.depth;
    if (!depth_pixels(&p->calibration))
        return damaged(r, "a view of the place has depth but no depth camera");
    if (!(view->depth = malloc(depth_pixels(&p->calibration) * sizeof *view->depth)))
        return fail(ERR_MEMORY, "no memory for the views of %s", database_path(r->db));
    enum status status = depth_decode(coder, depth, depth_bytes, view->depth, lens->width, lens->height);
    return status == ERR_CORRUPT ? damaged(r, status_message()) : status;
}

enum status recording_read_place(struct recording *r, struct place *out)
{
    struct place place = {0};
    struct statement *s = NULL;
    struct depth_coder *coder = NULL;
    enum status status = read_place_row(r, &place);
    if (status == OK)
        status = read_optional(r, OPTIONAL_POINT_ERROR, &place);
    if (status == OK)
        status = read_optional(r, OPTIONAL_TAG_ERROR, &place);
    if (status == OK)
        status = read_optional(r, OPTIONAL_POINT_SIDE, &place);
    if (status == OK)
        status = depth_coder_open(&coder);
    if (status == OK)
        status = statement_open(&s, r->db, "SELECT " VIEW_COLUMNS " FROM place_view ORDER BY rowid");
    bool has_place = status == OK;
    while (status == OK && (status = statement_step(s)) == OK)
        status = read_view(r, s, coder, &place);
    statement_close(&s);
    depth_coder_close(&coder);
    if (has_place && status == NOTHING) {
        *out = place;
        return OK;
    }
    place_free(&place);
    return status;
}

// ------------------------------------------------------------- takes

static enum status no_such_take(const struct recording *r, const char *name)
{
    char list[300] = "";
    size_t used = 0;
    for (int i = 0; i < r->take_count && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s'%s'", i ? ", " : "", r->takes[i].name);
    if (!r->take_count)
        return fail(ERR_MISSING, "%s holds no take yet, so none called '%s'", database_path(r->db), name);
    return fail(ERR_MISSING, "%s has no take '%s'; it has %s%s", database_path(r->db), name, list,
                used >= sizeof list ? "…" : "");
}

enum status take_from_row(struct statement *s, struct take_row *out, bool *usable)
{
    const uint8_t *calibration = blob_of(s, 2, CALIBRATION_BYTES), *body = blob_of(s, 5, BODY_BYTES);
    *out = (struct take_row){
        .id = statement_number(s, 0),
        .complete = statement_number(s, 3) == 1,
        .dropped = statement_number(s, 4),
        .body.representative_frame = -1,
    };
    bool whole = snprintf(out->name, sizeof out->name, "%s", statement_text(s, 1)) < (int)sizeof out->name;
    *usable = false;
    if (calibration) {
        get_calibration(calibration, &out->calibration);
        *usable = calibration_check(&out->calibration) == OK;
    }
    if (body) {
        get_body(body, &out->body);
        if (!body_is_finite(&out->body))
            out->body = (struct body){.representative_frame = -1};
    }
    if (*usable && body && whole && body_is_finite(&out->body) &&
        take_crc(out->name, calibration, out->complete, out->dropped, body) == statement_number(s, 6))
        return OK;
    return fail(ERR_CORRUPT, "a take cannot be read");
}

static enum status read_take_row(struct take *t, int64_t id)
{
    struct recording *r = t->recording;
    struct statement *s;
    enum status status = statement_open(&s, r->db, "SELECT " TAKE_COLUMNS " FROM take WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, id);
        status = statement_step(s);
    }
    if (status == OK || status == NOTHING) {
        struct take_row row;
        bool usable;
        if (status == NOTHING || take_from_row(s, &row, &usable) != OK) {
            status = damaged(r, "a take cannot be read");
        } else {
            t->calibration = row.calibration;
            t->body = row.body;
            t->complete = row.complete;
            t->dropped = row.dropped;
        }
    }
    statement_close(&s);
    return status;
}

enum status frame_from_row(struct statement *s, struct take_entry *out)
{
    size_t skeleton_bytes;
    const uint8_t *pose = blob_of(s, 3, POSE_BYTES), *skeleton = statement_blob(s, 4, &skeleton_bytes);
    int64_t time_ns = statement_number(s, 1), pictures = statement_number(s, 5);
    bool located = statement_number(s, 2) == 1;
    if (!pose || (skeleton_bytes && skeleton_bytes != SKELETON_BYTES) || pictures < 0 || pictures > 7 ||
        frame_crc(time_ns, located, pose, skeleton, skeleton_bytes, (unsigned)pictures) != statement_number(s, 6))
        return fail(ERR_CORRUPT, "frame %lld is damaged", (long long)(statement_number(s, 0) & FRAME_NUMBER_MAX));
    *out = (struct take_entry){
        .time_ns = time_ns,
        .located = located,
        .has_color = pictures & TAKE_COLOR,
        .has_depth = pictures & TAKE_DEPTH,
        .has_mask = pictures & TAKE_MASK,
        .has_skeleton = skeleton_bytes > 0,
    };
    get_pose(pose, &out->world_from_camera);
    if (skeleton_bytes)
        get_skeleton(skeleton, &out->skeleton);
    if (!pose_finite(out->world_from_camera) || (out->has_skeleton && !skeleton_is_finite(&out->skeleton)))
        return fail(ERR_CORRUPT, "frame %lld holds a number that is not finite",
                    (long long)(statement_number(s, 0) & FRAME_NUMBER_MAX));
    return OK;
}

static enum status read_entries(struct take *t, int64_t id)
{
    struct recording *r = t->recording;
    struct statement *s;
    int64_t capacity = 0, representative = -1;
    enum status status =
        statement_open(&s, r->db, "SELECT " FRAME_COLUMNS " FROM frame WHERE rowid BETWEEN ? AND ? ORDER BY rowid");
    if (status == OK) {
        statement_bind_number(s, 1, frame_key(id, 0));
        statement_bind_number(s, 2, frame_key(id, FRAME_NUMBER_MAX));
    }
    while (status == OK && (status = statement_step(s)) == OK) {
        if (t->count == capacity) {
            capacity = capacity ? capacity * 2 : 256;
            struct take_entry *entries = realloc(t->entries, sizeof *entries * (size_t)capacity);
            if (entries)
                t->entries = entries;
            int64_t *keys = realloc(t->keys, sizeof *keys * (size_t)capacity);
            if (keys)
                t->keys = keys;
            if (!entries || !keys) {
                status = fail(ERR_MEMORY, "no memory for the frames of %s", database_path(r->db));
                break;
            }
        }
        status = frame_from_row(s, &t->entries[t->count]);
        if (status == OK && t->count && t->entries[t->count].time_ns <= t->entries[t->count - 1].time_ns)
            status = fail(ERR_CORRUPT, "its frames' times do not rise");
        if (status != OK) {
            status = damaged(r, status_message());
            break;
        }
        t->keys[t->count] = statement_number(s, 0);
        if (t->keys[t->count] == frame_key(id, t->body.representative_frame))
            representative = t->count;
        t->count++;
    }
    statement_close(&s);
    // Numbers have gaps where frames were lost; whoever reads counts what is there.
    t->body.representative_frame = representative;
    return status == NOTHING ? OK : status;
}

enum status take_open(struct take **out, struct recording *r, const char *name)
{
    *out = NULL;
    int index = 0;
    while (index < r->take_count && strcmp(r->takes[index].name, name))
        index++;
    if (index == r->take_count)
        return no_such_take(r, name);
    struct take *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for the take '%s'", name);
    t->recording = r;
    // One transaction, so that a writer at work does not come in between.
    enum status status = database_run(r->db, "BEGIN");
    if (status == OK)
        status = read_take_row(t, r->takes[index].id);
    if (status == OK)
        status = read_entries(t, r->takes[index].id);
    if (database_in_transaction(r->db)) {
        struct failure first;
        failure_keep(&first, status);
        enum status ended = database_run(r->db, "COMMIT");
        status = status != OK ? failure_restore(&first) : ended;
    }
    if (status == OK)
        status = statement_open(&t->read_images, r->db, "SELECT " IMAGE_COLUMNS " FROM picture WHERE rowid = ?");
    if (status == OK)
        status = depth_coder_open(&t->coder);
    if (status == OK)
        *out = t;
    else
        take_close(&t);
    return status;
}

void take_close(struct take **t)
{
    if (!*t)
        return;
    statement_close(&(*t)->read_images);
    depth_coder_close(&(*t)->coder);
    free((*t)->entries);
    free((*t)->keys);
    free((*t)->color);
    free((*t)->depth);
    free((*t)->mask);
    free(*t);
    *t = NULL;
}

const struct calibration *take_calibration(const struct take *t) { return &t->calibration; }

int64_t take_frame_count(const struct take *t) { return t->count; }

const struct take_entry *take_entry(const struct take *t, int64_t index)
{
    assert(index >= 0 && index < t->count);
    return &t->entries[index];
}

const struct body *take_body(const struct take *t) { return &t->body; }

bool take_is_complete(const struct take *t) { return t->complete; }

int64_t take_dropped(const struct take *t) { return t->dropped; }

// ------------------------------------------------------------- pictures

// Makes *pixels on first use.
static enum status ensure_capacity(void **pixels, size_t bytes)
{
    if (!*pixels && !(*pixels = malloc(bytes)))
        return fail(ERR_MEMORY, "no memory for a picture of %zu bytes", bytes);
    return OK;
}

// One picture's bytes, checked. NULL with a sentence when they are not as written.
static const uint8_t *checked_blob(struct statement *s, int column, int crc_column, size_t *count)
{
    const uint8_t *bytes = statement_blob(s, column, count);
    if (bytes && crc32_of(0, bytes, *count) == statement_number(s, crc_column))
        return bytes;
    fail(ERR_CORRUPT, "its checksum is wrong");
    return NULL;
}

static enum status decode_wanted(struct take *t, unsigned want, struct take_images *out)
{
    struct statement *s = t->read_images;
    const struct lens *color = &t->calibration.color, *depth = &t->calibration.depth;
    size_t pixels = depth_pixels(&t->calibration), count;
    const uint8_t *bytes;
    if (((want & (TAKE_DEPTH | TAKE_MASK)) && !pixels) || ((want & TAKE_COLOR) && !color->width))
        return fail(ERR_CORRUPT, "it has a picture of a camera that is not there");
    if (want & TAKE_MASK) {
        enum status status = ensure_capacity((void **)&t->mask, pixels);
        if (status == OK)
            status = (bytes = checked_blob(s, 4, 1, &count))
                         ? mask_decode(t->coder, bytes, count, t->mask, depth->width, depth->height)
                         : ERR_CORRUPT;
        if (status != OK)
            return status;
        out->mask = t->mask;
    }
    if (want & TAKE_DEPTH) {
        enum status status = ensure_capacity((void **)&t->depth, pixels * sizeof *t->depth);
        if (status == OK)
            status = (bytes = checked_blob(s, 5, 2, &count))
                         ? depth_decode(t->coder, bytes, count, t->depth, depth->width, depth->height)
                         : ERR_CORRUPT;
        if (status != OK)
            return status;
        out->depth = t->depth;
    }
    if (want & TAKE_COLOR) {
        enum status status = ensure_capacity((void **)&t->color, (size_t)color->width * (size_t)color->height * 3);
        if (status == OK)
            status = (bytes = checked_blob(s, 6, 3, &count))
                         ? jpeg_decode(bytes, count, t->color, color->width, color->height)
                         : ERR_CORRUPT;
        if (status != OK)
            return status;
        out->color = t->color;
    }
    return OK;
}

enum status take_read(struct take *t, int64_t index, unsigned want, struct take_images *out)
{
    const struct take_entry *entry = take_entry(t, index);
    *out = (struct take_images){0};
    want &= (entry->has_color ? TAKE_COLOR : 0u) | (entry->has_depth ? TAKE_DEPTH : 0u) |
            (entry->has_mask ? TAKE_MASK : 0u);
    if (!want)
        return OK;
    statement_bind_number(t->read_images, 1, t->keys[index]);
    enum status status = statement_step(t->read_images);
    if (status == OK)
        status = decode_wanted(t, want, out);
    else if (status == NOTHING)
        status = fail(ERR_CORRUPT, "its pictures are lost");
    if (status == ERR_CORRUPT)
        status = fail(status, "%s: frame %lld is damaged: %s", database_path(t->recording->db), (long long)index,
                      status_message());
    statement_reset(t->read_images);
    if (status != OK)
        *out = (struct take_images){0};
    return status;
}
