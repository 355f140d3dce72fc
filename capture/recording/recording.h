// A recording: one SQLite file with one place and any number of takes, and the
// only thing that capture and reenact share. docs/format.md has it to the byte.
//
// Frames are kept as they came: colour as JPEG (the sensor's own bytes where it
// had them), depth bit-exact. What is derived (mask, skeleton, body) lies
// beside them. A writer commits at least every half second, so that kill -9,
// a full disk or a pulled plug costs at most the last second. Readers open the
// file read-only and may do so while it is written. One handle, one thread.
#pragma once
#include "capture/recording/place.h"
#include "capture/recording/skeleton.h"

enum { RECORDING_SCHEMA = 1 };

struct recording_writer;
struct recording;
struct take;

// ---------------------------------------------------------------- writing

// Makes `path`, which must not exist. ERR_EXISTS, ERR_IO. On error no file stays
// and *out is NULL.
MUST_CHECK enum status recording_create(struct recording_writer **out, const char *path);

// Opens an existing recording to add to it. ERR_MISSING, ERR_IO, ERR_FORMAT, ERR_CORRUPT.
MUST_CHECK enum status recording_append(struct recording_writer **out, const char *path);

// Keeps a copy of `place`, replacing an earlier one. ERR_IO.
MUST_CHECK enum status recording_put_place(struct recording_writer *w, const struct place *place);

// Begins a take. At most one is open. ERR_EXISTS: that name is taken.
// ERR_INPUT: a name that is empty, longer than 200 bytes or holds control characters.
MUST_CHECK enum status recording_begin_take(struct recording_writer *w, const char *name,
                                            const struct calibration *calibration);

// What is written for one instant. The caller keeps everything.
struct take_frame {
    int64_t time_ns;               // strictly increasing within the take
    struct pose world_from_camera; // of the colour camera; identity without a place
    bool located;                  // world_from_camera is measured, not assumed
    const uint8_t *jpeg;           // NULL: no colour
    size_t jpeg_bytes;
    const uint16_t *depth; // NULL: no depth; else width * height of calibration.depth
    const uint8_t *mask;   // NULL: none; else one byte a depth pixel, not 0: the person
    bool has_skeleton;
    struct skeleton skeleton; // in the colour camera's axes of this instant
};

// Copies the frame into the file's current batch. ERR_ORDER: not after the last
// one, nothing written. ERR_IO: disk full or gone; what was committed stays
// readable, only recording_close is allowed from here on.
MUST_CHECK enum status recording_add_frame(struct recording_writer *w, const struct take_frame *frame);

// The body as far as it is known; may be called again and again during the take.
MUST_CHECK enum status recording_put_body(struct recording_writer *w, const struct body *body);

// How many frames the sensor or we ourselves let go by; kept with the take.
MUST_CHECK enum status recording_put_dropped(struct recording_writer *w, int64_t dropped);

// Commits and marks the take as complete.
MUST_CHECK enum status recording_end_take(struct recording_writer *w);

// Of the take that was ended last: puts other skeletons in place of those that its first `count` frames
// have; NULL leaves one as it is, one that knows no joint takes it out, and a frame without stays without. All of them
// or, on any error, none. ERR_INPUT: a number is not finite. ERR_IO.
MUST_CHECK enum status recording_put_skeletons(struct recording_writer *w, const struct skeleton *const *skeleton,
                                               int64_t count);

const char *recording_writer_path(const struct recording_writer *w); // valid until recording_close

// Commits what is there, closes, frees, sets *w = NULL (NULL is fine). Returns
// the first error the writer ever met. A take still open stays, as interrupted.
enum status recording_close(struct recording_writer **w);

// ---------------------------------------------------------------- reading

// Read-only. ERR_MISSING, ERR_IO, ERR_FORMAT (not ours; of a newer schema), ERR_CORRUPT.
MUST_CHECK enum status recording_open(struct recording **out, const char *path);
void recording_free(struct recording **r); // NULL is fine; sets *r = NULL

// NOTHING: the file holds no place. On OK the caller owns *out: place_free.
MUST_CHECK enum status recording_read_place(struct recording *r, struct place *out);

int recording_take_count(const struct recording *r);
// 0 <= index < count, in the order they were recorded. Valid until recording_free.
const char *recording_take_name(const struct recording *r, int index);

// Loads all of a take but its pictures. ERR_MISSING: the sentence lists the takes there are.
// The take uses `r`, which must outlive it.
MUST_CHECK enum status take_open(struct take **out, struct recording *r, const char *name);
void take_close(struct take **t);

struct take_entry {
    int64_t time_ns;
    struct pose world_from_camera;
    bool located;
    bool has_color, has_depth, has_mask, has_skeleton;
    struct skeleton skeleton; // colour camera's axes
};

const struct calibration *take_calibration(const struct take *t);
int64_t take_frame_count(const struct take *t);
const struct take_entry *take_entry(const struct take *t, int64_t index); // asserts the range
const struct body *take_body(const struct take *t);
bool take_is_complete(const struct take *t); // false: interrupted, still readable
int64_t take_dropped(const struct take *t);

// Pictures of frame `index`, decoded. Pixels belong to the take and are borrowed
// until the next call on it; those not wanted or not there are NULL.
struct take_images {
    const uint8_t *color; // RGB
    const uint16_t *depth;
    const uint8_t *mask; // one byte a depth pixel, 1: the person
};
enum take_want { TAKE_COLOR = 1, TAKE_DEPTH = 2, TAKE_MASK = 4 };
// ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status take_read(struct take *t, int64_t index, unsigned want, struct take_images *out);

// ---------------------------------------------------------------- care

struct recording_report {
    int takes;
    int64_t frames, damaged_frames;
    int interrupted_takes;
    int64_t bytes;
};
// Reads every byte: SQLite's own check, every picture decoded, every number finite,
// times rising. OK; ERR_CORRUPT with the first thing found; else as recording_open.
MUST_CHECK enum status recording_verify(const char *path, struct recording_report *out);

// Saves what can be read of a damaged file into `path` itself, the original kept
// as `path`.damaged; a healthy file is left as it is. Marks interrupted takes as
// complete. *out says what was saved and lost.
MUST_CHECK enum status recording_repair(const char *path, struct recording_report *out);
