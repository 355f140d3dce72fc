// Reading a take: handles on its index, its images one frame at a time.
#include "recording/take_index.h"

#include "recording/depth_codec.h"
#include "recording/depth_picture.h"
#include "platform/files/jpeg.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static enum status no_such_take(struct recording *r, const char *name)
{
    char list[300] = "";
    size_t used = 0;
    for (int i = 0; i < recording_take_count(r) && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s'%s'", i ? ", " : "", recording_take_name(r, i));
    if (!recording_take_count(r))
        return fail(ERR_MISSING, "%s holds no take yet, so none called '%s'", recording_path(r), name);
    return fail(ERR_MISSING, "%s has no take '%s'; it has %s%s", recording_path(r), name, list,
                used >= sizeof list ? "…" : "");
}

// Opens a handle on `index`, whose reference it takes over, on failure too. index NULL: out of memory.
static enum status open_handle(struct take **out, struct recording *r, struct take_index *index)
{
    struct take *t = *out = calloc(1, sizeof *t);
    if (!t || !index) {
        take_index_release(index);
        free(t);
        *out = NULL;
        return fail(ERR_MEMORY, "no memory for a take of %s", recording_path(r));
    }
    t->recording = r;
    t->index = index;
    return OK;
}

// Before images are read: many open a take for its index alone.
static enum status need_decoders(struct take *t)
{
    enum status status = OK;
    if (!t->read_images)
        status = select_open(&t->read_images, recording_database(t->recording), TABLE_IMAGE, "WHERE rowid = ?");
    if (status == OK && !t->read_version)
        status = statement_open(&t->read_version, recording_database(t->recording), "PRAGMA data_version");
    return status == OK && !t->coder ? depth_coder_open(&t->coder) : status;
}

enum status take_open(struct take **out, struct recording *r, const char *name)
{
    *out = NULL;
    const int i = recording_find_take(r, name);
    if (i < 0)
        return no_such_take(r, name);
    struct take_index *index = calloc(1, sizeof *index);
    if (index) {
        atomic_init(&index->handles, 1);
        atomic_init(&index->decoded, 0);
        index->id = recording_take_id(r, i);
    }
    if (index && !take_id_is_valid(index->id)) {
        free(index);
        return recording_damaged(r, "a take cannot be read");
    }
    enum status status = open_handle(out, r, index);
    if (status == OK)
        status = take_index_read(index, r);
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

enum status take_open_drawn(struct take **out, struct recording *r, const char *name)
{
    enum status status = take_open(out, r, name);
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

enum status take_open_shared(struct take **out, struct recording *r, const struct take *same)
{
    atomic_fetch_add(&same->index->handles, 1);
    return open_handle(out, r, same->index);
}

void take_close(struct take **t)
{
    if (!*t)
        return;
    statement_close(&(*t)->read_images);
    statement_close(&(*t)->read_version);
    depth_coder_close(&(*t)->coder);
    take_index_release((*t)->index);
    free((*t)->color);
    free((*t)->depth);
    free((*t)->mask);
    free(*t);
    *t = NULL;
}

const struct calibration *take_calibration(const struct take *t) { return &t->index->calibration; }

struct recording *take_recording(const struct take *t) { return t->recording; }

int64_t take_id(const struct take *t) { return t->index->id; }

int64_t take_frame_count(const struct take *t) { return t->index->count; }

const struct take_entry *take_entry(const struct take *t, int64_t index)
{
    assert(index >= 0 && index < t->index->count);
    return &t->index->entries[index];
}

const struct body *take_body(const struct take *t) { return &t->index->body; }

bool take_is_located(const struct take *t) { return t->index->located; }

bool take_is_drawn_from_depth(const struct take *t) { return t->index->drawn_from_depth; }

bool take_is_complete(const struct take *t) { return t->index->complete; }

int64_t take_frames_decoded(const struct take *t) { return atomic_load(&t->index->decoded); }

int64_t take_lost(const struct take *t) { return t->index->lost; }

int64_t take_lost_now(const struct take *t) { return t->index->lost_now; }

int64_t take_uncounted(const struct take *t) { return t->index->uncounted; }

bool take_is_out_of_range(const struct take *t) { return t->index->out_of_range; }

int64_t take_errors_lost(const struct take *t) { return t->index->errors_lost; }

const char *take_note(const struct take *t) { return t->index->note; }

const char *take_alias(const struct take *t) { return t->index->alias; }

int64_t take_dropped(const struct take *t) { return t->index->dropped; }

size_t take_index_bytes(const struct take *t)
{
    return sizeof *t->index + sizeof *t->index->entries * (size_t)t->index->count;
}

// ------------------------------------------------------------- images

static enum status no_memory(void) { return fail(ERR_MEMORY, "no memory for a frame's images"); }

// One image's bytes, checked. NULL with a sentence when they are not as written.
static const uint8_t *checked_blob(struct statement *s, int column, int crc_column, size_t *count)
{
    const uint8_t *bytes = statement_blob(s, column, count);
    if (bytes && crc32_of(0, bytes, *count) == statement_number(s, crc_column))
        return bytes;
    fail(ERR_CORRUPT, "its checksum is wrong");
    return NULL;
}

static enum status decode_mask(struct take *t)
{
    const struct lens *lens = &t->index->calibration.depth;
    size_t count;
    if (!t->mask && !(t->mask = malloc(depth_pixels(&t->index->calibration))))
        return no_memory();
    const uint8_t *bytes = checked_blob(t->read_images, 4, 1, &count);
    return bytes ? mask_decode(t->coder, bytes, count, t->mask, lens->width, lens->height) : ERR_CORRUPT;
}

static enum status decode_depth(struct take *t)
{
    const struct lens *lens = &t->index->calibration.depth;
    size_t count;
    if (!t->depth && !(t->depth = malloc(depth_pixels(&t->index->calibration) * sizeof *t->depth)))
        return no_memory();
    const uint8_t *bytes = checked_blob(t->read_images, 5, 2, &count);
    return bytes ? depth_decode(t->coder, bytes, count, t->depth, lens->width, lens->height) : ERR_CORRUPT;
}

static enum status decode_color(struct take *t)
{
    const struct lens *lens = &t->index->calibration.color;
    size_t count;
    if (!t->color && !(t->color = malloc((size_t)lens->width * (size_t)lens->height * 3)))
        return no_memory();
    const uint8_t *bytes = checked_blob(t->read_images, 6, 3, &count);
    return bytes ? jpeg_decode(bytes, count, t->color, lens->width, lens->height) : ERR_CORRUPT;
}

// From the depth and the mask, which were decoded just now; has_mask: there is one.
static enum status draw_color(struct take *t, bool has_mask)
{
    const struct lens *lens = &t->index->calibration.depth;
    if (!t->color && !(t->color = malloc(3 * lens_pixels(lens))))
        return no_memory();
    depth_picture_draw(lens, t->depth, has_mask ? t->mask : NULL, t->color);
    return OK;
}

static enum status decode_wanted(struct take *t, bool has_mask, unsigned want, struct take_images *out)
{
    const struct calibration *c = &t->index->calibration;
    const bool draws = t->index->drawn_from_depth && (want & TAKE_COLOR);
    enum status status = OK;
    if (((want & (TAKE_DEPTH | TAKE_MASK)) && !depth_pixels(c)) || ((want & TAKE_COLOR) && !c->color.width))
        return fail(ERR_CORRUPT, "it has an image of a camera that is not there");
    if ((want & TAKE_MASK) || (draws && has_mask))
        status = decode_mask(t);
    if (status == OK && ((want & TAKE_DEPTH) || draws))
        status = decode_depth(t);
    if (status == OK && (want & TAKE_COLOR))
        status = draws ? draw_color(t, has_mask) : decode_color(t);
    if (status == OK)
        *out = (struct take_images){.color = want & TAKE_COLOR ? t->color : NULL,
                                    .depth = want & TAKE_DEPTH ? t->depth : NULL,
                                    .mask = want & TAKE_MASK ? t->mask : NULL};
    return status;
}

// Whether the row holds the images of the frame that its id says.
static enum status check_image_seal(struct statement *s)
{
    const int64_t crcs[3] = {statement_number(s, 1), statement_number(s, 2), statement_number(s, 3)};
    return seal_matches(s, IMAGE_SEAL, image_seal(statement_number(s, 0), crcs))
               ? OK
               : fail(ERR_CORRUPT, "its images are another frame's");
}

// Whether the row that the index has for the entry is still that frame's.
static enum status check_entry(const struct take *t, const struct take_entry *entry)
{
    struct statement *s;
    struct take_entry now = {0};
    enum status status = select_open(&s, recording_database(t->recording), TABLE_FRAME, "WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, frame_key(t->index->id, entry->row_number));
        status = statement_step(s);
    }
    if (status == OK)
        status = frame_from_row(s, &now);
    statement_close(&s);
    if (status == NOTHING || (status == OK && now.time_ns != entry->time_ns))
        return fail(ERR_IO, "%s: the take was changed by another program since it was opened; open it again",
                    recording_path(t->recording));
    return status == ERR_CORRUPT ? OK : status; // a damaged row says nothing about the others
}

// Another program may trim or delete the take: then other frames have the numbers that the index has, or none. The
// caller's statement holds the file's state.
static enum status check_unchanged(struct take *t)
{
    enum status status = statement_step(t->read_version);
    const int64_t version = statement_number(t->read_version, 0);
    statement_reset(t->read_version);
    if (status != OK || version == t->version)
        return status;
    status = check_entry(t, &t->index->entries[0]);
    if (status == OK)
        status = check_entry(t, &t->index->entries[t->index->count - 1]);
    if (status == OK)
        t->version = version;
    return status;
}

// Steps to the row of a frame's images.
static enum status find_images(struct take *t, const struct take_entry *entry)
{
    statement_bind_number(t->read_images, 1, frame_key(t->index->id, entry->row_number));
    enum status found = statement_step(t->read_images), status = found < 0 ? found : check_unchanged(t);
    if (status != OK)
        return status;
    return found == OK ? check_image_seal(t->read_images) : fail(ERR_CORRUPT, "its images are lost");
}

static enum status name_frame(const struct take *t, int64_t index, enum status status)
{
    return status == ERR_CORRUPT ? fail(status, "%s: frame %lld is damaged: %s; try reenact-capture repair",
                                        recording_path(t->recording), (long long)index, status_message())
                                 : status;
}

enum status take_read(struct take *t, int64_t index, unsigned want, struct take_images *out)
{
    const struct take_entry *entry = take_entry(t, index);
    *out = (struct take_images){0};
    want &= (entry->has_color ? TAKE_COLOR : 0u) | (entry->has_depth ? TAKE_DEPTH : 0u) |
            (entry->has_mask ? TAKE_MASK : 0u);
    if (!want)
        return OK;
    atomic_fetch_add(&t->index->decoded, 1);
    enum status status = need_decoders(t);
    if (status != OK)
        return status;
    statement_reset(t->read_images); // take_read_jpeg leaves it open
    status = find_images(t, entry);
    if (status == OK)
        status = decode_wanted(t, entry->has_mask, want, out);
    status = name_frame(t, index, status);
    statement_reset(t->read_images);
    return status;
}

enum status take_read_jpeg(struct take *t, int64_t index, const uint8_t **bytes, size_t *count)
{
    const struct take_entry *entry = take_entry(t, index);
    *bytes = NULL;
    *count = 0;
    if (!entry->has_color || t->index->drawn_from_depth)
        return NOTHING;
    enum status status = need_decoders(t);
    if (status != OK)
        return status;
    statement_reset(t->read_images);
    status = find_images(t, entry);
    if (status == OK && !(*bytes = checked_blob(t->read_images, 6, 3, count)))
        status = ERR_CORRUPT;
    return name_frame(t, index, status); // the statement is reset when it is used next
}
