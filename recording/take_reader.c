// Reading a take: handles on its index, its images one frame at a time.
#include "base/text.h"
#include "platform/files/jpeg.h"
#include "recording/depth_codec.h"
#include "recording/depth_picture.h"
#include "recording/place.h"
#include "recording/recording_reader.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// What all handles on a take share. Immutable once it is read, but for the two counters; the last handle that closes
// frees it.
struct take_index {
    atomic_int handles;
    atomic_llong decoded; // frames; for take_frames_decoded
    int64_t id;
    struct calibration calibration;
    struct body body;
    bool complete;
    bool located;          // take_is_located
    bool drawn_from_depth; // its colour images: it has none of its own (take_open_drawn)
    int64_t dropped;
    int64_t lost_now;      // frames that this file once had
    int64_t lost;          // and those that it never had because a repair could not save them
    int64_t errors_lost;   // covariances of frames
    int64_t count_written; // that the take had when it ended; -1: not known
    int64_t uncounted;     // frames that are there beyond those
    bool out_of_range;     // the take's row holds what is not as the format says
    char note[TAKE_NOTE_BYTES + 1], alias[TAKE_NAME_BYTES + 1];
    struct take_entry *entries;
    int64_t count;
};

_Static_assert(sizeof(struct take_entry) <= 712, "recording.h states the memory of an hour");

// ---------------------------------------------------------------- take index

// Reading a take's row and the index of its frames.

enum status take_from_row(struct statement *statement, struct take_row *out, bool *usable)
{
    const uint8_t *calibration = recording_blob(statement, 2, CALIBRATION_BYTES),
                  *body = recording_blob(statement, 5, BODY_BYTES);
    *out = (struct take_row){
        .id = statement_number(statement, 0),
        .complete = statement_number(statement, 3) == 1,
        .dropped = frame_count_of(statement_number(statement, 4)),
        .body.representative_frame = -1,
        .frames =
            statement_is_null(statement, TAKE_FRAMES) ? -1 : frame_count_of(statement_number(statement, TAKE_FRAMES)),
        .lost = frame_count_of(statement_number(statement, TAKE_LOST)),
    };
    bool whole = snprintf(out->name, sizeof out->name, "%s", statement_text(statement, 1)) < (int)sizeof out->name;
    whole &= snprintf(out->note, sizeof out->note, "%s", statement_text(statement, TAKE_NOTE)) < (int)sizeof out->note;
    whole &=
        snprintf(out->alias, sizeof out->alias, "%s", statement_text(statement, TAKE_ALIAS)) < (int)sizeof out->alias;
    *usable = false;
    enum status status = statement_check(statement);
    if (status != OK)
        return status;
    if (calibration) {
        get_calibration(calibration, &out->calibration);
        *usable = calibration_check(&out->calibration) == OK;
    }
    if (body) {
        get_body(body, &out->body);
        if (!body_is_valid(&out->body)) {
            out->body = (struct body){.representative_frame = -1};
            out->out_of_range = true;
        }
    }
    if (calibration && calibration[CALIBRATION_REGISTERED] > 1)
        out->out_of_range = true;
    const int64_t crc = statement_number(statement, 6);
    if (*usable && body && whole && take_id_is_valid(out->id) &&
        take_crc(out->name, calibration, out->complete, out->dropped, body) == crc &&
        seal_matches(statement, TAKE_SEAL, take_seal(out, (uint32_t)crc)))
        return OK;
    return fail(ERR_CORRUPT, "a take cannot be read");
}

static enum status read_take_row(struct take_index *index, struct recording *recording)
{
    struct statement *s;
    enum status status = recording_statement(recording, TABLE_TAKE, &s);
    if (status == OK) {
        statement_bind_number(s, 1, index->id);
        status = statement_step(s);
    }
    if (status == OK || status == NOTHING) {
        struct take_row row;
        bool usable;
        if (status == NOTHING || take_from_row(s, &row, &usable) != OK) {
            status = recording_damaged(recording, "a take cannot be read");
        } else {
            index->calibration = row.calibration;
            index->body = row.body;
            index->complete = row.complete;
            index->dropped = row.dropped;
            index->lost = row.lost;
            index->count_written = row.frames;
            index->out_of_range = row.out_of_range || !text_is_printable(row.note) || !text_is_printable(row.alias);
            memcpy(index->note, row.note, sizeof index->note);
            memcpy(index->alias, row.alias, sizeof index->alias);
            text_make_printable(index->note);
            text_make_printable(index->alias);
        }
    }
    if (s)
        statement_reset(s);
    return status;
}

enum status frame_from_row(struct statement *statement, struct take_entry *out)
{
    return frame_from_row_as(statement, statement_number(statement, 0), out);
}

enum status frame_from_row_as(struct statement *statement, int64_t key, struct take_entry *out)
{
    size_t skeleton_bytes;
    const uint8_t *pose = recording_blob(statement, 3, POSE_BYTES),
                  *skeleton = statement_blob(statement, 4, &skeleton_bytes);
    int64_t time_ns = statement_number(statement, 1), images = statement_number(statement, 5);
    bool located = statement_number(statement, 2) == 1;
    const int64_t crc = statement_number(statement, 6);
    if (!pose || (skeleton_bytes && skeleton_bytes != SKELETON_BYTES) || images < 0 || images > 7 ||
        time_ns < -TAKE_TIME_MAX_NS || time_ns > TAKE_TIME_MAX_NS ||
        frame_crc(time_ns, located, pose, skeleton, skeleton_bytes, (unsigned)images) != crc ||
        !seal_matches(statement, FRAME_SEAL, row_seal(key, (uint32_t)crc)))
        return fail(ERR_CORRUPT, "frame %lld is damaged", (long long)(key & FRAME_NUMBER_MAX));
    *out = (struct take_entry){
        .time_ns = time_ns,
        .located = located,
        .row_number = (int32_t)(key & FRAME_NUMBER_MAX),
        .has_color = images & TAKE_COLOR,
        .has_depth = images & TAKE_DEPTH,
        .has_mask = images & TAKE_MASK,
        .has_skeleton = skeleton_bytes > 0,
    };
    get_pose(pose, &out->world_from_camera);
    if (skeleton_bytes)
        get_skeleton(skeleton, &out->skeleton);
    if (!pose_is_valid(out->world_from_camera) || (out->has_skeleton && !skeleton_is_valid(&out->skeleton)))
        return fail(ERR_CORRUPT, "frame %lld holds a number that is not finite or out of range",
                    (long long)(key & FRAME_NUMBER_MAX));
    return OK;
}

enum status joint_error_from_row(struct statement *statement, struct skeleton *out)
{
    const uint8_t *covariances = recording_blob(statement, 1, JOINT_ERROR_BYTES);
    const int64_t crc = statement_number(statement, 2);
    bool good = covariances && crc32_of(0, covariances, JOINT_ERROR_BYTES) == crc &&
                seal_matches(statement, JOINT_ERROR_SEAL, row_seal(statement_number(statement, 0), (uint32_t)crc));
    if (good)
        get_joint_error(covariances, out);
    for (int j = 0; j < JOINT_COUNT && good; j++)
        good = covariance_is_finite(out->covariance[j]);
    if (good)
        return OK;
    memset(out->covariance, 0, sizeof out->covariance);
    return fail(ERR_CORRUPT, "the joints' covariances of frame %lld are damaged",
                (long long)(statement_number(statement, 0) & FRAME_NUMBER_MAX));
}

// Resizes the entries. False: out of memory, and they are as before.
static bool resize_entries(struct take_index *index, int64_t capacity)
{
    struct take_entry *entries = realloc(index->entries, sizeof *entries * (size_t)capacity);
    if (entries)
        index->entries = entries;
    return entries != NULL;
}

// A damaged page hides some rows: how many keys are tried beyond it, one by one, before the rest is given up.
enum { HIDDEN_ROWS_MAX = 20000 };

// The rows of the take with keys in order. A row that cannot be read is left out. NOTHING: no more.
struct row_scan {
    struct statement *s;
    int64_t next_key, last_key;
    int hidden;
};

static enum status scan_open(struct row_scan *scan, struct recording *recording, enum recording_table table,
                             int64_t take)
{
    *scan = (struct row_scan){.next_key = frame_key(take, 0), .last_key = frame_key(take, FRAME_NUMBER_MAX)};
    enum status status = recording_statement(recording, table, &scan->s);
    if (status == OK) {
        statement_bind_number(scan->s, 1, scan->next_key);
        statement_bind_number(scan->s, 2, scan->last_key);
    }
    return status;
}

static void scan_close(struct row_scan *scan)
{
    if (scan->s)
        statement_reset(scan->s);
}

static enum status scan_next(struct row_scan *scan)
{
    for (;;) {
        enum status status = statement_step(scan->s);
        if (status == OK) {
            scan->next_key = statement_number(scan->s, 0) + 1;
            scan->hidden = 0;
            return OK;
        }
        if (status != ERR_CORRUPT)
            return status;
        if (scan->next_key > scan->last_key || scan->hidden++ > HIDDEN_ROWS_MAX)
            return NOTHING;
        statement_reset(scan->s);
        statement_bind_number(scan->s, 1, ++scan->next_key);
        statement_bind_number(scan->s, 2, scan->last_key);
    }
}

// The frame of those that are there which shows the body best, where the one that was chosen while it was recorded is
// lost: it was damaged, or trimmed off. -1: no frame has a person.
static int64_t best_frame(const struct take_index *index)
{
    int64_t best = -1;
    double max = -1;
    for (int64_t i = 0; i < index->count; i++) {
        const struct take_entry *e = &index->entries[i];
        const double score = e->has_skeleton && e->has_depth ? pose_score(&e->skeleton) : -1;
        if (score > max) {
            max = score;
            best = i;
        }
    }
    return best;
}

static bool has_body(const struct body *body)
{
    bool measured = body->representative_frame >= 0;
    for (int p = 0; p < PART_COUNT; p++)
        measured = measured || body->radius_rate[p] > 0;
    return measured;
}

// One damaged frame costs itself alone: it is left out and counted.
static enum status read_entries(struct take_index *index, struct recording *recording)
{
    struct row_scan scan = {0};
    int64_t capacity = 0, representative = -1, rows = 0;
    enum status status = scan_open(&scan, recording, TABLE_FRAME, index->id);
    while (status == OK && (status = scan_next(&scan)) == OK) {
        if (index->count == capacity) {
            capacity = capacity ? capacity * 2 : 256;
            if (!resize_entries(index, capacity)) {
                status = fail(ERR_MEMORY, "no memory for the frames of %s", recording_path(recording));
                break;
            }
        }
        struct take_entry *entry = &index->entries[index->count];
        rows = (statement_number(scan.s, 0) & FRAME_NUMBER_MAX) + 1;
        if (frame_from_row(scan.s, entry) != OK || (index->count && entry->time_ns <= entry[-1].time_ns))
            continue;
        if (entry->row_number == index->body.representative_frame)
            representative = index->count;
        index->count++;
    }
    scan_close(&scan);
    if (index->count &&
        !resize_entries(index, index->count)) // gives back what doubling allocated beyond the last frame
        status = fail(ERR_MEMORY, "no memory for the frames of %s", recording_path(recording));
    // Row numbers have gaps where frames were lost; callers count the frames that are there.
    index->body.representative_frame =
        representative < 0 && has_body(&index->body) ? best_frame(index) : representative;
    index->uncounted = index->count_written >= 0 && rows > index->count_written ? rows - index->count_written : 0;
    const int64_t all = index->count_written > rows ? index->count_written : rows;
    index->lost_now = all - index->count;
    index->lost += index->lost_now;
    return status == NOTHING ? OK : status;
}

// The covariances of the frames that are there. Damaged ones count as unknown.
static enum status read_joint_errors(struct take_index *index, struct recording *recording)
{
    struct row_scan scan = {0};
    bool there = false;
    int64_t i = 0;
    enum status status = index->count ? recording_has_joint_errors(recording_database(recording), &there) : NOTHING;
    if (status != OK || !there)
        return status == NOTHING ? OK : status;
    status = scan_open(&scan, recording, TABLE_JOINT_ERROR, index->id);
    while (status == OK && (status = scan_next(&scan)) == OK) {
        const int64_t number = statement_number(scan.s, 0) & FRAME_NUMBER_MAX;
        while (i < index->count && index->entries[i].row_number < number)
            i++;
        if (i < index->count && index->entries[i].row_number == number && index->entries[i].has_skeleton &&
            joint_error_from_row(scan.s, &index->entries[i].skeleton) != OK)
            index->errors_lost++;
    }
    scan_close(&scan);
    return status == NOTHING ? OK : status;
}

// Fills an index whose id is set. ERR_CORRUPT, ERR_IO, ERR_MEMORY; take_index_release is needed also then.
static enum status take_index_read(struct take_index *index, struct recording *recording)
{
    // One transaction, so that a concurrent writer's commit does not come in between; the caller may have begun one.
    struct database *db = recording_database(recording);
    const bool begins = !database_in_transaction(db);
    enum status status = begins ? database_run(db, "BEGIN") : OK;
    if (status == OK)
        status = recording_keep_statements(recording);
    if (status == OK)
        status = read_take_row(index, recording);
    if (status == OK)
        status = read_entries(index, recording);
    if (status == OK)
        status = read_joint_errors(index, recording);
    for (int64_t i = 0; i < index->count && !index->located; i++)
        index->located = index->entries[i].has_skeleton && index->entries[i].located;
    if (begins && database_in_transaction(db)) {
        struct failure first;
        failure_keep(&first, status);
        enum status ended = database_run(db, "COMMIT");
        status = status != OK ? failure_restore(&first) : ended;
    }
    return status;
}

// One handle less; the last one frees it.
static void take_index_release(struct take_index *index)
{
    if (!index || atomic_fetch_sub(&index->handles, 1) > 1)
        return;
    free(index->entries);
    free(index);
}

// ---------------------------------------------------------------- take sizes

// How much of the file each part of a take's frames takes. A row's page is 64 KiB: of long takes some rows are asked.

enum { ASKED_MAX = 300 };

enum status take_read_sizes(struct take *take, struct take_sizes *out)
{
    const int64_t frames = take_frame_count(take), asked = frames < ASKED_MAX ? frames : ASKED_MAX;
    double sums[3] = {0};
    struct statement *s;
    *out = (struct take_sizes){.exact = asked == frames};
    if (!frames)
        return OK;
    // SQLite knows a blob's length without reading it.
    enum status status =
        statement_open(&s, recording_database(take_recording(take)),
                       "SELECT length(color), length(depth), length(mask) FROM picture WHERE rowid = ?");
    for (int64_t i = 0; i < asked && status == OK; i++) {
        const struct take_entry *e = take_entry(take, i * frames / asked);
        statement_bind_number(s, 1, frame_key(take_id(take), e->row_number));
        status = statement_step(s);
        for (int k = 0; k < 3 && status == OK; k++)
            sums[k] += (double)statement_number(s, k);
        if (status == NOTHING) // a frame without images
            status = OK;
        statement_reset(s);
    }
    statement_close(&s);
    if (status != OK)
        return status;
    const double scale = asked ? (double)frames / (double)asked : 0;
    out->color = (int64_t)(sums[0] * scale);
    out->depth = (int64_t)(sums[1] * scale);
    out->mask = (int64_t)(sums[2] * scale);
    for (int64_t i = 0; i < frames; i++)
        out->joints += POSE_BYTES + (take_entry(take, i)->has_skeleton ? SKELETON_BYTES + JOINT_ERROR_BYTES : 0);
    return OK;
}

// ---------------------------------------------------------------- take reader

// One handle: its own connection, statement and decode buffers.
struct take {
    struct recording *recording;
    struct take_index *index;
    struct statement *read_images, *read_version;
    int64_t version; // of the file (PRAGMA data_version), as which the index is known to be right; 0: not yet
    struct depth_coder *coder;
    uint8_t *color, *mask; // allocated when first wanted, as is depth
    uint16_t *depth;
};

// ------------------------------------------------------------- opening

static enum status no_such_take(struct recording *recording, const char *name)
{
    char list[300] = "";
    size_t used = 0;
    for (int i = 0; i < recording_take_count(recording) && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s'%s'", i ? ", " : "",
                                 recording_take_name(recording, i));
    if (!recording_take_count(recording))
        return fail(ERR_MISSING, "%s holds no take yet, so none called '%s'", recording_path(recording), name);
    return fail(ERR_MISSING, "%s has no take '%s'; it has %s%s", recording_path(recording), name, list,
                used >= sizeof list ? "…" : "");
}

// Opens a handle on `index`, whose reference it takes over, on failure too. index NULL: out of memory.
static enum status open_handle(struct take **out, struct recording *recording, struct take_index *index)
{
    struct take *t = *out = calloc(1, sizeof *t);
    if (!t || !index) {
        take_index_release(index);
        free(t);
        *out = NULL;
        return fail(ERR_MEMORY, "no memory for a take of %s", recording_path(recording));
    }
    t->recording = recording;
    t->index = index;
    return OK;
}

// Before images are read: many open a take for its index alone.
static enum status need_decoders(struct take *take)
{
    enum status status = OK;
    if (!take->read_images)
        status = select_open(&take->read_images, recording_database(take->recording), TABLE_IMAGE, "WHERE rowid = ?");
    if (status == OK && !take->read_version)
        status = statement_open(&take->read_version, recording_database(take->recording), "PRAGMA data_version");
    return status == OK && !take->coder ? depth_coder_open(&take->coder) : status;
}

enum status take_open(struct take **out, struct recording *recording, const char *name)
{
    *out = NULL;
    const int i = recording_find_take(recording, name);
    if (i < 0)
        return no_such_take(recording, name);
    struct take_index *index = calloc(1, sizeof *index);
    if (index) {
        atomic_init(&index->handles, 1);
        atomic_init(&index->decoded, 0);
        index->id = recording_take_id(recording, i);
    }
    if (index && !take_id_is_valid(index->id)) {
        free(index);
        return recording_damaged(recording, "a take cannot be read");
    }
    enum status status = open_handle(out, recording, index);
    if (status == OK)
        status = take_index_read(index, recording);
    if (status != OK)
        take_close(out);
    return status;
}

// There was a colour camera, whose axes are the depth camera's, and no frame has an image of it.
static bool lacks_color(const struct take_index *index)
{
    bool lacks = index->calibration.registered && index->calibration.depth.width;
    for (int64_t i = 0; i < index->count && lacks; i++)
        lacks = !index->entries[i].has_color;
    return lacks;
}

enum status take_open_drawn(struct take **out, struct recording *recording, const char *name)
{
    enum status status = take_open(out, recording, name);
    struct take_index *index = status == OK ? (*out)->index : NULL; // no other handle shares it yet
    if (index && lacks_color(index))
        index->calibration.color = (struct lens){0};
    if (!index || !depth_picture_replaces_color(&index->calibration))
        return status;
    index->drawn_from_depth = true;
    for (int64_t i = 0; i < index->count; i++)
        index->entries[i].has_color = index->entries[i].has_depth;
    return OK;
}

enum status take_open_shared(struct take **out, struct recording *recording, const struct take *same)
{
    atomic_fetch_add(&same->index->handles, 1);
    return open_handle(out, recording, same->index);
}

void take_close(struct take **take)
{
    if (!*take)
        return;
    statement_close(&(*take)->read_images);
    statement_close(&(*take)->read_version);
    depth_coder_close(&(*take)->coder);
    take_index_release((*take)->index);
    free((*take)->color);
    free((*take)->depth);
    free((*take)->mask);
    free(*take);
    *take = NULL;
}

const struct calibration *take_calibration(const struct take *take) { return &take->index->calibration; }

struct recording *take_recording(const struct take *take) { return take->recording; }

int64_t take_id(const struct take *take) { return take->index->id; }

int64_t take_frame_count(const struct take *take) { return take->index->count; }

const struct take_entry *take_entry(const struct take *take, int64_t index)
{
    assert(index >= 0 && index < take->index->count);
    return &take->index->entries[index];
}

const struct body *take_body(const struct take *take) { return &take->index->body; }

bool take_is_located(const struct take *take) { return take->index->located; }

bool take_is_drawn_from_depth(const struct take *take) { return take->index->drawn_from_depth; }

bool take_is_complete(const struct take *take) { return take->index->complete; }

int64_t take_frames_decoded(const struct take *take) { return atomic_load(&take->index->decoded); }

int64_t take_lost(const struct take *take) { return take->index->lost; }

int64_t take_lost_now(const struct take *take) { return take->index->lost_now; }

int64_t take_uncounted(const struct take *take) { return take->index->uncounted; }

bool take_is_out_of_range(const struct take *take) { return take->index->out_of_range; }

int64_t take_errors_lost(const struct take *take) { return take->index->errors_lost; }

const char *take_note(const struct take *take) { return take->index->note; }

const char *take_alias(const struct take *take) { return take->index->alias; }

int64_t take_dropped(const struct take *take) { return take->index->dropped; }

// ------------------------------------------------------------- images

static enum status no_memory(void) { return fail(ERR_MEMORY, "no memory for a frame's images"); }

// One image's bytes, checked. NULL with a sentence when they are not as written.
static const uint8_t *checked_blob(struct statement *statement, int column, int crc_column, size_t *count)
{
    const uint8_t *bytes = statement_blob(statement, column, count);
    if (bytes && crc32_of(0, bytes, *count) == statement_number(statement, crc_column))
        return bytes;
    fail(ERR_CORRUPT, "its checksum is wrong");
    return NULL;
}

static enum status decode_mask(struct take *take)
{
    const struct lens *lens = &take->index->calibration.depth;
    size_t count;
    if (!take->mask && !(take->mask = malloc(depth_pixels(&take->index->calibration))))
        return no_memory();
    const uint8_t *bytes = checked_blob(take->read_images, 4, 1, &count);
    return bytes ? mask_decode(take->coder, bytes, count, take->mask, lens->width, lens->height) : ERR_CORRUPT;
}

static enum status decode_depth(struct take *take)
{
    const struct lens *lens = &take->index->calibration.depth;
    size_t count;
    if (!take->depth && !(take->depth = malloc(depth_pixels(&take->index->calibration) * sizeof *take->depth)))
        return no_memory();
    const uint8_t *bytes = checked_blob(take->read_images, 5, 2, &count);
    return bytes ? depth_decode(take->coder, bytes, count, take->depth, lens->width, lens->height) : ERR_CORRUPT;
}

static enum status decode_color(struct take *take)
{
    const struct lens *lens = &take->index->calibration.color;
    size_t count;
    if (!take->color && !(take->color = malloc((size_t)lens->width * (size_t)lens->height * 3)))
        return no_memory();
    const uint8_t *bytes = checked_blob(take->read_images, 6, 3, &count);
    return bytes ? jpeg_decode(bytes, count, take->color, lens->width, lens->height) : ERR_CORRUPT;
}

// From the depth and the mask, which were decoded just now; has_mask: there is one.
static enum status draw_color(struct take *take, bool has_mask)
{
    const struct lens *lens = &take->index->calibration.depth;
    if (!take->color && !(take->color = malloc(3 * lens_pixels(lens))))
        return no_memory();
    depth_picture_draw(lens, take->depth, has_mask ? take->mask : NULL, take->color);
    return OK;
}

static enum status decode_wanted(struct take *take, bool has_mask, unsigned want, struct take_images *out)
{
    const struct calibration *c = &take->index->calibration;
    const bool draws = take->index->drawn_from_depth && (want & TAKE_COLOR);
    enum status status = OK;
    if (((want & (TAKE_DEPTH | TAKE_MASK)) && !depth_pixels(c)) || ((want & TAKE_COLOR) && !c->color.width))
        return fail(ERR_CORRUPT, "it has an image of a camera that is not there");
    if ((want & TAKE_MASK) || (draws && has_mask))
        status = decode_mask(take);
    if (status == OK && ((want & TAKE_DEPTH) || draws))
        status = decode_depth(take);
    if (status == OK && (want & TAKE_COLOR))
        status = draws ? draw_color(take, has_mask) : decode_color(take);
    if (status == OK)
        *out = (struct take_images){.color = want & TAKE_COLOR ? take->color : NULL,
                                    .depth = want & TAKE_DEPTH ? take->depth : NULL,
                                    .mask = want & TAKE_MASK ? take->mask : NULL};
    return status;
}

// Whether the row holds the images of the frame that its id says.
static enum status check_image_seal(struct statement *statement)
{
    const int64_t crcs[3] = {statement_number(statement, 1), statement_number(statement, 2),
                             statement_number(statement, 3)};
    return seal_matches(statement, IMAGE_SEAL, image_seal(statement_number(statement, 0), crcs))
               ? OK
               : fail(ERR_CORRUPT, "its images are another frame's");
}

// Whether the row that the index has for the entry is still that frame's.
static enum status check_entry(const struct take *take, const struct take_entry *entry)
{
    struct statement *s;
    struct take_entry now = {0};
    enum status status = select_open(&s, recording_database(take->recording), TABLE_FRAME, "WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, frame_key(take->index->id, entry->row_number));
        status = statement_step(s);
    }
    if (status == OK)
        status = frame_from_row(s, &now);
    statement_close(&s);
    if (status == NOTHING || (status == OK && now.time_ns != entry->time_ns))
        return fail(ERR_IO, "%s: the take was changed by another program since it was opened; open it again",
                    recording_path(take->recording));
    return status == ERR_CORRUPT ? OK : status; // a damaged row says nothing about the others
}

// Another program may trim or delete the take: then other frames have the numbers that the index has, or none. The
// caller's statement holds the file's state.
static enum status check_unchanged(struct take *take)
{
    enum status status = statement_step(take->read_version);
    const int64_t version = statement_number(take->read_version, 0);
    statement_reset(take->read_version);
    if (status != OK || version == take->version)
        return status;
    status = check_entry(take, &take->index->entries[0]);
    if (status == OK)
        status = check_entry(take, &take->index->entries[take->index->count - 1]);
    if (status == OK)
        take->version = version;
    return status;
}

// Steps to the row of a frame's images.
static enum status find_images(struct take *take, const struct take_entry *entry)
{
    statement_bind_number(take->read_images, 1, frame_key(take->index->id, entry->row_number));
    enum status found = statement_step(take->read_images), status = found < 0 ? found : check_unchanged(take);
    if (status != OK)
        return status;
    return found == OK ? check_image_seal(take->read_images) : fail(ERR_CORRUPT, "its images are lost");
}

static enum status name_frame(const struct take *take, int64_t index, enum status status)
{
    return status == ERR_CORRUPT ? fail(status, "%s: frame %lld is damaged: %s; try reenact-capture repair",
                                        recording_path(take->recording), (long long)index, status_message())
                                 : status;
}

enum status take_read(struct take *take, int64_t index, unsigned want, struct take_images *out)
{
    const struct take_entry *entry = take_entry(take, index);
    *out = (struct take_images){0};
    want &= (entry->has_color ? TAKE_COLOR : 0u) | (entry->has_depth ? TAKE_DEPTH : 0u) |
            (entry->has_mask ? TAKE_MASK : 0u);
    if (!want)
        return OK;
    atomic_fetch_add(&take->index->decoded, 1);
    enum status status = need_decoders(take);
    if (status != OK)
        return status;
    statement_reset(take->read_images); // take_read_jpeg leaves it open
    status = find_images(take, entry);
    if (status == OK)
        status = decode_wanted(take, entry->has_mask, want, out);
    status = name_frame(take, index, status);
    statement_reset(take->read_images);
    return status;
}

enum status take_read_jpeg(struct take *take, int64_t index, const uint8_t **bytes, size_t *count)
{
    const struct take_entry *entry = take_entry(take, index);
    *bytes = NULL;
    *count = 0;
    if (!entry->has_color || take->index->drawn_from_depth)
        return NOTHING;
    enum status status = need_decoders(take);
    if (status != OK)
        return status;
    statement_reset(take->read_images);
    status = find_images(take, entry);
    if (status == OK && !(*bytes = checked_blob(take->read_images, 6, 3, count)))
        status = ERR_CORRUPT;
    return name_frame(take, index, status); // the statement is reset when it is used next
}
