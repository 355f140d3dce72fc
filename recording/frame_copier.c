#include "recording/frame_copier.h"

#include "platform/files/jpeg.h"
#include "recording/depth_codec.h"
#include "recording/little_endian.h"
#include "recording/recorded_things.h"
#include "recording/recording_reader.h"

#include <stdlib.h>
#include <string.h>

// The source is only read, row by row by key: if the B-tree path to one row crosses a damaged page, the next row may
// still be readable.

enum { LOST_ROWS_MAX = 20000, STRAYS_MAX = 10000 }; // consecutive unreadable keys that end the search; by hand

// A frame whose row has a damaged id.
struct stray {
    int64_t key, stored_key;
};

struct frame_copier {
    struct database *from;
    struct async_writer *to;
    enum copier_reads reads;
    struct statement *frame, *joint_error, *images, *frame_exists, *images_exist; // joint_error NULL: an older file
    struct depth_coder *coder;
    struct stray *strays; // by key
    int64_t stray_count;
    void *pixels; // for decoding
    size_t pixel_bytes;
};

// What ends a copy. A row that cannot be read does not, but where everything must be copied a disk that fails does.
static bool is_fatal_to_copier(const struct frame_copier *copier, enum status status)
{
    return status == ERR_MEMORY || (copier->reads == COPIER_READS_ALL && status == ERR_IO);
}

enum status frame_copier_open(struct frame_copier **out, struct database *from, struct async_writer *to,
                              enum copier_reads reads)
{
    struct frame_copier *c = *out = calloc(1, sizeof *c);
    bool has_errors = false;
    if (!c)
        return fail(ERR_MEMORY, "no memory to copy frames of %s", database_path(from));
    c->from = from;
    c->to = to;
    c->reads = reads;
    enum status status =
        select_open(&c->frame, from, TABLE_FRAME, "WHERE rowid BETWEEN ? AND ? ORDER BY rowid LIMIT 1");
    if (status == OK)
        status = recording_has_joint_errors(from, &has_errors);
    if (status == OK && has_errors)
        status = select_open(&c->joint_error, from, TABLE_JOINT_ERROR, "WHERE rowid = ?");
    if (status == OK)
        status = select_open(&c->images, from, TABLE_IMAGE, "WHERE rowid = ?");
    if (status == OK)
        status = statement_open(&c->frame_exists, from, "SELECT rowid FROM frame WHERE rowid = ?");
    if (status == OK) // without reading the images
        status = statement_open(&c->images_exist, from, "SELECT rowid FROM picture WHERE rowid = ?");
    if (status == OK)
        status = depth_coder_open(&c->coder);
    if (status != OK)
        frame_copier_close(out);
    return status;
}

void frame_copier_close(struct frame_copier **copier)
{
    struct frame_copier *c = *copier;
    if (!c)
        return;
    statement_close(&c->frame);
    statement_close(&c->joint_error);
    statement_close(&c->images);
    statement_close(&c->frame_exists);
    statement_close(&c->images_exist);
    depth_coder_close(&c->coder);
    free(c->strays);
    free(c->pixels);
    free(c);
    *copier = NULL;
}

// ------------------------------------------------------------- rows with damaged ids

static bool row_exists(struct statement *statement, int64_t key)
{
    statement_bind_number(statement, 1, key);
    const bool exists = statement_step(statement) == OK;
    statement_reset(statement);
    return exists;
}

static bool key_is_possible(int64_t key)
{
    return take_id_is_valid(key >> 32) && (key & 0xffffffff) <= FRAME_NUMBER_MAX;
}

// A frame beside which another one lies has its own id; it is then its images' id that is damaged.
static bool has_neighbour(struct frame_copier *copier, int64_t key)
{
    return row_exists(copier->frame_exists, key & 0xffffffff ? key - 1 : key + 1);
}

// The id that the row of copier->frame was written with; its own where nothing speaks against that.
static int64_t true_key(struct frame_copier *copier)
{
    const int64_t key = statement_number(copier->frame, 0), crc = statement_number(copier->frame, 6);
    const bool sealed = !statement_is_null(copier->frame, FRAME_SEAL),
               has_images = statement_number(copier->frame, 5) != 0;
    if (sealed ? seal_matches(copier->frame, FRAME_SEAL, row_seal(key, (uint32_t)crc))
               : !has_images || row_exists(copier->images_exist, key) || has_neighbour(copier, key))
        return key;
    for (int bit = 0; bit < 63; bit++) {
        const int64_t other = key ^ (int64_t)1 << bit;
        if (!key_is_possible(other))
            continue;
        if (sealed ? seal_matches(copier->frame, FRAME_SEAL, row_seal(other, (uint32_t)crc))
                   : row_exists(copier->images_exist, other) && !row_exists(copier->frame_exists, other))
            return other;
    }
    return key;
}

static int by_key(const void *left, const void *right)
{
    const struct stray *a = left, *b = right;
    return (a->key > b->key) - (a->key < b->key);
}

static enum status add_stray(struct frame_copier *copier, int64_t key, int64_t stored_key)
{
    if (copier->stray_count >= STRAYS_MAX)
        return OK;
    struct stray *grown = realloc(copier->strays, sizeof *grown * ((size_t)copier->stray_count + 1));
    if (!grown)
        return fail(ERR_MEMORY, "no memory to repair %s", database_path(copier->from));
    copier->strays = grown;
    grown[copier->stray_count++] = (struct stray){key, stored_key};
    return OK;
}

enum status frame_copier_find_strays(struct frame_copier *copier)
{
    int64_t next = INT64_MIN;
    enum status status = OK;
    for (int lost = 0; status == OK && lost < LOST_ROWS_MAX && next < INT64_MAX;) {
        statement_bind_number(copier->frame, 1, next);
        statement_bind_number(copier->frame, 2, INT64_MAX);
        status = statement_step(copier->frame);
        if (status == OK) {
            const int64_t stored = statement_number(copier->frame, 0), key = true_key(copier);
            next = stored < INT64_MAX ? stored + 1 : stored;
            lost = 0;
            if (key != stored)
                status = add_stray(copier, key, stored);
        } else if (status != NOTHING && !is_fatal_to_copier(copier, status)) {
            lost++;
            next++;
            status = OK;
        }
        statement_reset(copier->frame);
    }
    if (copier->stray_count)
        qsort(copier->strays, (size_t)copier->stray_count, sizeof *copier->strays, by_key);
    return status == NOTHING ? OK : status;
}

// ------------------------------------------------------------- images

static void *pixels_of(struct frame_copier *copier, size_t bytes)
{
    if (bytes > copier->pixel_bytes) {
        free(copier->pixels);
        copier->pixels = malloc(bytes);
        copier->pixel_bytes = copier->pixels ? bytes : 0;
    }
    return copier->pixels;
}

enum image { IMAGE_MASK, IMAGE_DEPTH, IMAGE_COLOR };

// Whether the code gives a picture: its checksum says only that it is as it was written.
static enum status decode_image(struct frame_copier *copier, enum image image, const uint8_t *bytes, size_t count,
                                const struct calibration *calibration)
{
    const struct lens *lens = image == IMAGE_COLOR ? &calibration->color : &calibration->depth;
    if (!lens->width)
        return fail(ERR_CORRUPT, "there is no such camera");
    void *pixels = pixels_of(copier, (size_t)lens->width * (size_t)lens->height * 3);
    if (!pixels)
        return fail(ERR_MEMORY, "no memory for a frame's images");
    switch (image) {
    case IMAGE_MASK: return mask_decode(copier->coder, bytes, count, pixels, lens->width, lens->height);
    case IMAGE_DEPTH: return depth_decode(copier->coder, bytes, count, pixels, lens->width, lens->height);
    default: return jpeg_decode(bytes, count, pixels, lens->width, lens->height);
    }
}

// One image's bytes if they are as written; else NULL.
static const uint8_t *intact_blob(struct statement *statement, enum image image, size_t *count)
{
    const uint8_t *bytes = statement_blob(statement, 4 + (int)image, count);
    if (bytes && crc32_of(0, bytes, *count) == statement_number(statement, 1 + (int)image))
        return bytes;
    *count = 0;
    return NULL;
}

// Steps copier->images to the row of the frame `key`, also where its id is damaged. NOTHING: it is lost.
static enum status find_images(struct frame_copier *copier, int64_t key)
{
    for (int bit = -1; bit < 63; bit++) {
        const int64_t stored = bit < 0 ? key : key ^ (int64_t)1 << bit;
        statement_bind_number(copier->images, 1, stored);
        enum status status = statement_step(copier->images);
        const int64_t crcs[3] = {statement_number(copier->images, 1), statement_number(copier->images, 2),
                                 statement_number(copier->images, 3)};
        if (is_fatal_to_copier(copier, status))
            return status;
        const bool sealed = !statement_is_null(copier->images, IMAGE_SEAL);
        if (status == OK && seal_matches(copier->images, IMAGE_SEAL, image_seal(key, crcs)) &&
            (bit < 0 || sealed || !row_exists(copier->frame_exists, stored)))
            return OK;
        statement_reset(copier->images);
        if (status < 0) // the page is damaged, not the id
            return NOTHING;
    }
    return NOTHING;
}

// ------------------------------------------------------------- frames

// The frame's joints' covariances, where they can be read: a frame can be shown without them.
static enum status read_joint_error(struct frame_copier *copier, int64_t key, struct take_entry *entry, bool *lost)
{
    *lost = false;
    if (!copier->joint_error || !entry->has_skeleton)
        return OK;
    statement_bind_number(copier->joint_error, 1, key);
    enum status status = statement_step(copier->joint_error);
    if (status == OK)
        status = joint_error_from_row(copier->joint_error, &entry->skeleton);
    statement_reset(copier->joint_error);
    *lost = status != OK && status != NOTHING;
    return is_fatal_to_copier(copier, status) ? status : OK;
}

// Copies one frame with what of its images can be used. NOTHING: there is nothing worth keeping.
static enum status copy_frame(struct frame_copier *copier, int64_t key, int64_t new_key, const struct take_entry *entry,
                              const struct calibration *calibration, bool *damaged)
{
    const bool possible = !entry->has_skeleton || skeleton_is_in_range(&entry->skeleton);
    struct frame_row row = {.key = new_key,
                            .time_ns = entry->time_ns,
                            .located = entry->located,
                            .world_from_camera = entry->world_from_camera,
                            .skeleton = entry->has_skeleton && possible ? &entry->skeleton : NULL};
    const uint8_t **images[] = {&row.mask, &row.depth, &row.color};
    size_t *counts[] = {&row.mask_bytes, &row.depth_bytes, &row.color_bytes};
    const bool had[] = {entry->has_mask, entry->has_depth, entry->has_color};
    enum status status = had[0] || had[1] || had[2] ? find_images(copier, key) : NOTHING;
    const bool found = status == OK;
    *damaged = !possible;
    for (int i = 0; i < 3 && !is_fatal_to_copier(copier, status); i++) {
        if (found && had[i] && (*images[i] = intact_blob(copier->images, (enum image)i, counts[i]))) {
            status = decode_image(copier, (enum image)i, *images[i], *counts[i], calibration);
            if (status != OK)
                *images[i] = NULL, *counts[i] = 0;
        } else if (found && had[i]) {
            status = statement_check(copier->images); // of memory, not of the image's
        }
        *damaged = *damaged || (had[i] && !*images[i]);
    }
    if (!is_fatal_to_copier(copier, status))
        status = *damaged && !row.mask && !row.depth && !row.color && !row.skeleton
                     ? NOTHING
                     : async_writer_add_frame(copier->to, &row);
    statement_reset(copier->images);
    return status;
}

// The next readable frame with its own id from *key on. NOTHING: there is none.
static enum status next_frame(struct frame_copier *copier, int64_t *key, int64_t last, struct take_entry *entry)
{
    for (int64_t lost = 0; lost < LOST_ROWS_MAX && *key <= last; lost++, ++*key) {
        statement_bind_number(copier->frame, 1, *key);
        statement_bind_number(copier->frame, 2, last);
        enum status status = statement_step(copier->frame);
        if (status == OK) {
            *key = statement_number(copier->frame, 0);
            status = frame_from_row(copier->frame, entry);
        }
        statement_reset(copier->frame);
        if (status == OK || status == NOTHING || is_fatal_to_copier(copier, status))
            return status;
    }
    return NOTHING;
}

// The row with the damaged id, read as if it had its own.
static enum status read_stray(struct frame_copier *copier, const struct stray *stray, struct take_entry *entry)
{
    statement_bind_number(copier->frame, 1, stray->stored_key);
    statement_bind_number(copier->frame, 2, stray->stored_key);
    enum status status = statement_step(copier->frame);
    if (status == OK)
        status = frame_from_row_as(copier->frame, stray->key, entry);
    statement_reset(copier->frame);
    return status;
}

static bool is_stray(const struct frame_copier *copier, int64_t stored_key)
{
    for (int64_t i = 0; i < copier->stray_count; i++)
        if (copier->strays[i].stored_key == stored_key)
            return true;
    return false;
}

// The frames of a take in the order of their keys: those with their own id, merged with the strays.
struct frame_order {
    int64_t key, last;
    int64_t stray; // the next one
    bool has_frame;
    struct take_entry frame;
};

// *key: whose frame *entry is. NOTHING: no more.
static enum status next_in_order(struct frame_copier *copier, struct frame_order *order, int64_t *key,
                                 struct take_entry *entry)
{
    for (;;) {
        if (!order->has_frame && order->key <= order->last) {
            enum status status = next_frame(copier, &order->key, order->last, &order->frame);
            if (is_fatal_to_copier(copier, status))
                return status;
            order->has_frame = status == OK;
            if (!order->has_frame)
                order->key = order->last + 1;
            if (order->has_frame && is_stray(copier, order->key)) {
                order->has_frame = false;
                order->key++;
                continue;
            }
        }
        const struct stray *stray = order->stray < copier->stray_count ? &copier->strays[order->stray] : NULL;
        if (stray && stray->key <= order->last && (!order->has_frame || stray->key < order->key)) {
            order->stray++;
            *key = stray->key;
            enum status status = read_stray(copier, stray, entry);
            if (status == OK || is_fatal_to_copier(copier, status))
                return status;
            continue;
        }
        if (!order->has_frame)
            return NOTHING;
        *key = order->key++;
        *entry = order->frame;
        order->has_frame = false;
        return OK;
    }
}

static struct frame_order frames_of(const struct frame_copier *copier, int64_t take)
{
    struct frame_order order = {.key = frame_key(take, 0), .last = frame_key(take, FRAME_NUMBER_MAX)};
    while (order.stray < copier->stray_count && copier->strays[order.stray].key < order.key)
        order.stray++;
    return order;
}

enum status frame_copier_copy(struct frame_copier *copier, const struct take_row *take, int64_t new_id, bool located,
                              struct frame_copy_counts *out)
{
    struct frame_order order = frames_of(copier, take->id);
    const int64_t first = order.key;
    int64_t key, rows = 0, last_time_ns = 0;
    struct take_entry entry;
    enum status status;
    *out = (struct frame_copy_counts){.representative = -1};
    while ((status = next_in_order(copier, &order, &key, &entry)) == OK) {
        rows = key - first + 1;
        if (out->saved && entry.time_ns <= last_time_ns)
            continue;
        bool damaged, without_covariances;
        if (!located) {
            entry.located = false;
            entry.world_from_camera = POSE_IDENTITY;
        }
        status = read_joint_error(copier, key, &entry, &without_covariances);
        if (status == OK)
            status = copy_frame(copier, key, frame_key(new_id, out->saved), &entry, &take->calibration, &damaged);
        if (status == NOTHING)
            continue;
        if (status != OK)
            return status;
        if (rows - 1 == take->body.representative_frame)
            out->representative = out->saved;
        out->saved++;
        out->damaged += damaged;
        out->covariances_lost += without_covariances;
        last_time_ns = entry.time_ns;
    }
    const int64_t all = take->frames > rows ? take->frames : rows;
    out->lost = all - out->saved;
    return status == NOTHING ? OK : status;
}

// The size that the code of a mask or of a depth image states; both begin alike (docs/format.md).
static void coded_size(const uint8_t *bytes, size_t count, struct lens *lens)
{
    if (!bytes || count < 1 + 2 + 2)
        return;
    const uint8_t *at = bytes + 1;
    lens->width = get_u16(&at);
    lens->height = get_u16(&at);
}

enum status frame_copier_infer_sizes(struct frame_copier *copier, struct take_row *take)
{
    struct frame_order order = frames_of(copier, take->id);
    int64_t key;
    struct take_entry entry;
    enum status status = OK;
    for (bool found = false; !found && (status = next_in_order(copier, &order, &key, &entry)) == OK;) {
        if ((status = find_images(copier, key)) == OK) {
            struct calibration stated = take->calibration;
            size_t mask_bytes, depth_bytes, color_bytes;
            const uint8_t *mask = intact_blob(copier->images, IMAGE_MASK, &mask_bytes);
            const uint8_t *depths = intact_blob(copier->images, IMAGE_DEPTH, &depth_bytes);
            const uint8_t *colors = intact_blob(copier->images, IMAGE_COLOR, &color_bytes);
            coded_size(mask, mask_bytes, &stated.depth);
            coded_size(depths, depth_bytes, &stated.depth);
            int width, height;
            if (colors && jpeg_size(colors, color_bytes, &width, &height) == OK)
                stated.color.width = width, stated.color.height = height;
            found = (!entry.has_mask || mask) && (!entry.has_depth || depths) && (!entry.has_color || colors) &&
                    calibration_check(&stated) == OK; // no camera has the size that a wrong code states
            if (found)
                take->calibration = stated;
        }
        statement_reset(copier->images);
        if (is_fatal_to_copier(copier, status))
            return status;
    }
    return is_fatal_to_copier(copier, status) ? status : OK;
}

// ---------------------------------------------------------------- place copier

static enum status open_source(struct recording **out, const char *path, enum copier_reads reads)
{
    return recording_open_as(out, path, reads == COPIER_READS_ALL ? DATABASE_READ : DATABASE_SALVAGE);
}

// What remains of an error in reading a part: a take can be shown without it, so only lack of memory ends a repair.
static enum status end_of_part(enum status status, enum copier_reads reads)
{
    return status == NOTHING || (status != ERR_MEMORY && reads == COPIER_READS_WHAT_IT_CAN) ? OK : status;
}

static enum status put_map(const char *to, const struct place *place, enum copier_reads reads,
                           struct place_copy_counts *out)
{
    struct recording_writer *w;
    enum status status = recording_append(&w, to);
    if (status == OK)
        status = recording_put_place(w, place);
    if (status == ERR_INPUT && reads == COPIER_READS_WHAT_IT_CAN) { // more views than a recording can hold
        out->lost_place = true;
        status = OK;
    }
    struct failure first;
    failure_keep(&first, status);
    const enum status closed = recording_close(&w);
    return first.status == OK ? closed : failure_restore(&first);
}

static enum status copy_map(const char *path, const char *to, enum copier_reads reads, struct place_copy_counts *out)
{
    struct recording *r;
    struct place place = {0};
    enum status status = open_source(&r, path, reads);
    if (status == OK)
        status = recording_read_place(r, &place);
    recording_free(&r);
    out->lost_place = status != OK && status != NOTHING;
    if (status != OK)
        return end_of_part(status, reads);
    int32_t undecodable = 0;
    status = place_drop_undecodable_views(&place, &undecodable);
    out->lost_views = place.views_lost + undecodable;
    out->lost_map_covariances = place.errors_lost;
    out->calibration = place.calibration;
    out->has_calibration = true;
    if (status == OK)
        status = put_map(to, &place, reads, out);
    place_free(&place);
    return status;
}

static enum status copy_things(const char *path, const char *to, enum copier_reads reads, struct place_copy_counts *out)
{
    struct recording *r;
    struct recorded_thing *things = NULL;
    struct things_lost lost = {0};
    int count = 0;
    enum status status = open_source(&r, path, reads);
    if (status == OK)
        status = recording_salvage_things(r, &things, &count, &lost);
    recording_free(&r);
    out->lost_things = lost.things + lost.contents + (status != OK); // at least one where a disk fails
    if (status != OK)
        return end_of_part(status, reads);
    status = count ? recording_write_things(to, things, count) : OK;
    recorded_things_free(&things, count);
    return status;
}

static enum status copy_drive(const char *path, const char *to, enum copier_reads reads)
{
    struct recording *r;
    struct recorded_drive drive;
    enum status status = open_source(&r, path, reads);
    if (status == OK)
        status = recording_read_drive(r, &drive);
    recording_free(&r);
    return status == OK ? recording_write_drive(to, &drive) : end_of_part(status, reads);
}

enum status place_copy(const char *path, const char *to, enum copier_reads reads, struct place_copy_counts *out)
{
    *out = (struct place_copy_counts){0};
    enum status status = copy_map(path, to, reads, out);
    if (status == OK)
        status = copy_things(path, to, reads, out);
    return status == OK ? copy_drive(path, to, reads) : status;
}
