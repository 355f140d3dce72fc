// Reading a take's row and the index of its frames.
#include "recording/take_index.h"

#include "base/text.h"
#include "recording/pose_score.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum status take_from_row(struct statement *s, struct take_row *out, bool *usable)
{
    const uint8_t *calibration = recording_blob(s, 2, CALIBRATION_BYTES), *body = recording_blob(s, 5, BODY_BYTES);
    *out = (struct take_row){
        .id = statement_number(s, 0),
        .complete = statement_number(s, 3) == 1,
        .dropped = frame_count_of(statement_number(s, 4)),
        .body.representative_frame = -1,
        .frames = statement_is_null(s, TAKE_FRAMES) ? -1 : frame_count_of(statement_number(s, TAKE_FRAMES)),
        .lost = frame_count_of(statement_number(s, TAKE_LOST)),
    };
    bool whole = snprintf(out->name, sizeof out->name, "%s", statement_text(s, 1)) < (int)sizeof out->name;
    whole &= snprintf(out->note, sizeof out->note, "%s", statement_text(s, TAKE_NOTE)) < (int)sizeof out->note;
    whole &= snprintf(out->alias, sizeof out->alias, "%s", statement_text(s, TAKE_ALIAS)) < (int)sizeof out->alias;
    *usable = false;
    enum status status = statement_check(s);
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
    const int64_t crc = statement_number(s, 6);
    if (*usable && body && whole && take_id_is_valid(out->id) &&
        take_crc(out->name, calibration, out->complete, out->dropped, body) == crc &&
        seal_matches(s, TAKE_SEAL, take_seal(out, (uint32_t)crc)))
        return OK;
    return fail(ERR_CORRUPT, "a take cannot be read");
}

static enum status read_take_row(struct take_index *t, struct recording *r)
{
    struct statement *s;
    enum status status = recording_statement(r, TABLE_TAKE, &s);
    if (status == OK) {
        statement_bind_number(s, 1, t->id);
        status = statement_step(s);
    }
    if (status == OK || status == NOTHING) {
        struct take_row row;
        bool usable;
        if (status == NOTHING || take_from_row(s, &row, &usable) != OK) {
            status = recording_damaged(r, "a take cannot be read");
        } else {
            t->calibration = row.calibration;
            t->body = row.body;
            t->complete = row.complete;
            t->dropped = row.dropped;
            t->lost = row.lost;
            t->count_written = row.frames;
            t->out_of_range = row.out_of_range || !text_is_printable(row.note) || !text_is_printable(row.alias);
            memcpy(t->note, row.note, sizeof t->note);
            memcpy(t->alias, row.alias, sizeof t->alias);
            text_make_printable(t->note);
            text_make_printable(t->alias);
        }
    }
    if (s)
        statement_reset(s);
    return status;
}

enum status frame_from_row(struct statement *s, struct take_entry *out)
{
    return frame_from_row_as(s, statement_number(s, 0), out);
}

enum status frame_from_row_as(struct statement *s, int64_t key, struct take_entry *out)
{
    size_t skeleton_bytes;
    const uint8_t *pose = recording_blob(s, 3, POSE_BYTES), *skeleton = statement_blob(s, 4, &skeleton_bytes);
    int64_t time_ns = statement_number(s, 1), images = statement_number(s, 5);
    bool located = statement_number(s, 2) == 1;
    const int64_t crc = statement_number(s, 6);
    if (!pose || (skeleton_bytes && skeleton_bytes != SKELETON_BYTES) || images < 0 || images > 7 ||
        time_ns < -TAKE_TIME_MOST_NS || time_ns > TAKE_TIME_MOST_NS ||
        frame_crc(time_ns, located, pose, skeleton, skeleton_bytes, (unsigned)images) != crc ||
        !seal_matches(s, FRAME_SEAL, row_seal(key, (uint32_t)crc)))
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

enum status joint_error_from_row(struct statement *s, struct skeleton *out)
{
    const uint8_t *covariances = recording_blob(s, 1, JOINT_ERROR_BYTES);
    const int64_t crc = statement_number(s, 2);
    bool good = covariances && crc32_of(0, covariances, JOINT_ERROR_BYTES) == crc &&
                seal_matches(s, JOINT_ERROR_SEAL, row_seal(statement_number(s, 0), (uint32_t)crc));
    if (good)
        get_joint_error(covariances, out);
    for (int j = 0; j < JOINT_COUNT && good; j++)
        good = covariance_is_finite(out->covariance[j]);
    if (good)
        return OK;
    memset(out->covariance, 0, sizeof out->covariance);
    return fail(ERR_CORRUPT, "the joints' covariances of frame %lld are damaged",
                (long long)(statement_number(s, 0) & FRAME_NUMBER_MAX));
}

// Resizes the entries. False: out of memory, and they are as before.
static bool resize_entries(struct take_index *t, int64_t capacity)
{
    struct take_entry *entries = realloc(t->entries, sizeof *entries * (size_t)capacity);
    if (entries)
        t->entries = entries;
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

static enum status scan_open(struct row_scan *scan, struct recording *r, enum recording_table table, int64_t take)
{
    *scan = (struct row_scan){.next_key = frame_key(take, 0), .last_key = frame_key(take, FRAME_NUMBER_MAX)};
    enum status status = recording_statement(r, table, &scan->s);
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
static int64_t best_frame(const struct take_index *t)
{
    int64_t best = -1;
    double most = -1;
    for (int64_t i = 0; i < t->count; i++) {
        const struct take_entry *e = &t->entries[i];
        const double score = e->has_skeleton && e->has_depth ? pose_score(&e->skeleton) : -1;
        if (score > most) {
            most = score;
            best = i;
        }
    }
    return best;
}

static bool has_body(const struct body *b)
{
    bool measured = b->representative_frame >= 0;
    for (int p = 0; p < PART_COUNT; p++)
        measured = measured || b->radius_rate[p] > 0;
    return measured;
}

// One damaged frame costs itself alone: it is left out and counted.
static enum status read_entries(struct take_index *t, struct recording *r)
{
    struct row_scan scan = {0};
    int64_t capacity = 0, representative = -1, rows = 0;
    enum status status = scan_open(&scan, r, TABLE_FRAME, t->id);
    while (status == OK && (status = scan_next(&scan)) == OK) {
        if (t->count == capacity) {
            capacity = capacity ? capacity * 2 : 256;
            if (!resize_entries(t, capacity)) {
                status = fail(ERR_MEMORY, "no memory for the frames of %s", recording_path(r));
                break;
            }
        }
        struct take_entry *entry = &t->entries[t->count];
        rows = (statement_number(scan.s, 0) & FRAME_NUMBER_MAX) + 1;
        if (frame_from_row(scan.s, entry) != OK || (t->count && entry->time_ns <= entry[-1].time_ns))
            continue;
        if (entry->row_number == t->body.representative_frame)
            representative = t->count;
        t->count++;
    }
    scan_close(&scan);
    if (t->count && !resize_entries(t, t->count)) // gives back what doubling allocated beyond the last frame
        status = fail(ERR_MEMORY, "no memory for the frames of %s", recording_path(r));
    // Row numbers have gaps where frames were lost; callers count the frames that are there.
    t->body.representative_frame = representative < 0 && has_body(&t->body) ? best_frame(t) : representative;
    t->uncounted = t->count_written >= 0 && rows > t->count_written ? rows - t->count_written : 0;
    const int64_t all = t->count_written > rows ? t->count_written : rows;
    t->lost_now = all - t->count;
    t->lost += t->lost_now;
    return status == NOTHING ? OK : status;
}

// The covariances of the frames that are there. Damaged ones count as unknown.
static enum status read_joint_errors(struct take_index *t, struct recording *r)
{
    struct row_scan scan = {0};
    bool there = false;
    int64_t i = 0;
    enum status status = t->count ? recording_has_joint_errors(recording_database(r), &there) : NOTHING;
    if (status != OK || !there)
        return status == NOTHING ? OK : status;
    status = scan_open(&scan, r, TABLE_JOINT_ERROR, t->id);
    while (status == OK && (status = scan_next(&scan)) == OK) {
        const int64_t number = statement_number(scan.s, 0) & FRAME_NUMBER_MAX;
        while (i < t->count && t->entries[i].row_number < number)
            i++;
        if (i < t->count && t->entries[i].row_number == number && t->entries[i].has_skeleton &&
            joint_error_from_row(scan.s, &t->entries[i].skeleton) != OK)
            t->errors_lost++;
    }
    scan_close(&scan);
    return status == NOTHING ? OK : status;
}

enum status take_index_read(struct take_index *t, struct recording *r)
{
    // One transaction, so that a concurrent writer's commit does not come in between; the caller may have begun one.
    struct database *db = recording_database(r);
    const bool begins = !database_in_transaction(db);
    enum status status = begins ? database_run(db, "BEGIN") : OK;
    if (status == OK)
        status = recording_keep_statements(r);
    if (status == OK)
        status = read_take_row(t, r);
    if (status == OK)
        status = read_entries(t, r);
    if (status == OK)
        status = read_joint_errors(t, r);
    for (int64_t i = 0; i < t->count && !t->located; i++)
        t->located = t->entries[i].has_skeleton && t->entries[i].located;
    if (begins && database_in_transaction(db)) {
        struct failure first;
        failure_keep(&first, status);
        enum status ended = database_run(db, "COMMIT");
        status = status != OK ? failure_restore(&first) : ended;
    }
    return status;
}

void take_index_release(struct take_index *t)
{
    if (!t || atomic_fetch_sub(&t->handles, 1) > 1)
        return;
    free(t->entries);
    free(t);
}
