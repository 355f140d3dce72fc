// A recording: one SQLite file with one place and any number of takes; the only interface between capture and reenact.
// docs/format.md specifies it to the byte.
//
// Frames are stored as the sensor gave them: colour as JPEG (the sensor's own bytes where it has them), depth bit-exact
// in millimetres. Derived data (mask, skeleton, body) is stored beside them. The writer commits at least every half
// second, so that kill -9, a full disk or power loss costs at most the last second. Readers open the file read-only,
// also while it is written. One handle, one thread at a time; different handles may be used in parallel.
#pragma once
#include "recording/place.h"
#include "recording/skeleton.h"

enum { RECORDING_SCHEMA = 3 };

struct recording_writer;
struct recording;
struct take;

// ---------------------------------------------------------------- writing

// Makes `path`, which must not exist. ERR_EXISTS, ERR_IO, ERR_MEMORY. On failure no file remains and *out is NULL.
MUST_CHECK enum status recording_create(struct recording_writer **out, const char *path);

// Whether it could be, before long work. ERR_EXISTS, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status recording_check_new(const char *path);

// Opens an existing recording to add to it. ERR_MISSING, ERR_IO, ERR_FORMAT, ERR_CORRUPT, ERR_MEMORY. On failure *out
// is NULL.
MUST_CHECK enum status recording_append(struct recording_writer **out, const char *path);

// Whether what it holds beside its takes could be changed, before long work: errors as recording_append.
MUST_CHECK enum status recording_check_change(const char *path);

// Stores a copy of `place` in one transaction, replacing an earlier one. ERR_INPUT: a number is not finite or the
// calibration is invalid; nothing is written. ERR_IO, ERR_MEMORY: as recording_add_frame.
MUST_CHECK enum status recording_put_place(struct recording_writer *writer, const struct place *place);

// Begins a take. At most one is open. ERR_EXISTS: the name is in use. ERR_INPUT: the name is empty, longer than 200
// bytes or holds control characters; or the calibration is invalid (a registered one must have the identity as
// color_from_depth). After these two no take is open and the writer can go on. ERR_IO, ERR_MEMORY: as
// recording_add_frame.
MUST_CHECK enum status recording_begin_take(struct recording_writer *writer, const char *name,
                                            const struct calibration *calibration);

// What is written for one instant. Everything is copied.
// A frame's time lies between minus this and this, so that the time between any two frames is an int64_t, too.
#define TAKE_TIME_MAX_NS (INT64_MAX / 2)

struct take_frame {
    int64_t time_ns; // strictly increasing within the take
    // Of the colour camera. Without a place the identity or, where the sensor itself knows gravity, a rotation after
    // which z is up.
    struct pose world_from_camera;
    bool located;        // world_from_camera is measured, not assumed
    const uint8_t *jpeg; // NULL: no colour
    size_t jpeg_bytes;
    const uint16_t *depth; // NULL: no depth; else width * height of calibration.depth
    const uint8_t *mask;   // NULL: none; else one byte a depth pixel, not 0: the actor
    bool has_skeleton;
    struct skeleton skeleton; // in the colour camera's axes of this instant
};

// Copies the frame into the current batch (async_writer.h). ERR_ORDER: not later than the last one, ERR_INPUT: it does
// not fit the calibration, or holds a number that is not finite or a time beyond TAKE_TIME_MAX_NS; nothing is written
// and the writer can go on. ERR_IO: disk full or gone; what was committed stays readable, only recording_close is
// allowed from here on. ERR_MEMORY.
MUST_CHECK enum status recording_add_frame(struct recording_writer *writer, const struct take_frame *frame);

// Stores the body as far as it is measured; may be called repeatedly during the take, and for the take that was ended
// last. ERR_INPUT, ERR_IO.
MUST_CHECK enum status recording_put_body(struct recording_writer *writer, const struct body *body);

// Stores how many frames were dropped so far, by the sensor or by capture. ERR_IO.
MUST_CHECK enum status recording_put_dropped(struct recording_writer *writer, int64_t dropped);

// Commits and marks the take as complete; a take without frames is removed. ERR_IO: it stays marked as interrupted, as
// recording_add_frame.
MUST_CHECK enum status recording_end_take(struct recording_writer *writer);

// Replaces skeletons of the take that was ended last, in its first `count` frames: NULL keeps a frame's skeleton, one
// without a known joint removes it, and a frame without a skeleton remains without. One transaction: all of them or, on
// any error, none. ERR_INPUT: a number is not finite. ERR_IO.
MUST_CHECK enum status recording_put_skeletons(struct recording_writer *writer, const struct skeleton *const *skeleton,
                                               int64_t count);

// How the writing goes. Any thread may ask.
struct recording_counters {
    int64_t waiting_frames, waiting_bytes;   // given, not yet committed
    int64_t waiting_frames_max;              // ever
    int64_t committed_frames, synced_frames; // in the file: a kill does not cost them; nor a power cut
    int64_t committed_ns, synced_ns;         // times of the last of them; INT64_MIN: none
    int64_t written_bytes;                   // of all frames committed so far
    bool failed;                             // nothing more is written; the next frame that is added says why
};
struct recording_counters recording_writer_count(const struct recording_writer *writer);

const char *recording_writer_path(const struct recording_writer *writer); // valid until recording_close

// Commits what was added, closes, frees, sets *writer = NULL (NULL is fine). Returns the first error the writer ever
// met. A take that is still open is kept and marked as interrupted; one without frames is removed.
enum status recording_close(struct recording_writer **writer);

// Removes a recording that was made in vain, with its log.
void recording_discard(const char *path);

// ---------------------------------------------------------------- reading

// Read-only. ERR_MISSING, ERR_IO, ERR_FORMAT (another file type or a newer schema), ERR_CORRUPT, ERR_MEMORY. On failure
// *out is NULL.
MUST_CHECK enum status recording_open(struct recording **out, const char *path);
void recording_free(struct recording **recording); // NULL is fine; sets *recording = NULL

// NOTHING: the file holds no place. ERR_CORRUPT: its calibration, tags or points cannot be read; damaged views are left
// out (place.h). ERR_IO, ERR_MEMORY. On OK the caller owns *out (place_free); otherwise
// it is unchanged.
MUST_CHECK enum status recording_read_place(struct recording *recording, struct place *out);

// The same without its views, which take a thousand times longer to read: what a camera is located by.
MUST_CHECK enum status recording_read_map(struct recording *recording, struct place *out);

const char *recording_path(const struct recording *recording); // valid until recording_free
int recording_take_count(const struct recording *recording);
// 0 <= index < count, in the order they were recorded. Valid until recording_free.
const char *recording_take_name(const struct recording *recording, int index);

// Opens a take and reads its index: calibration, body and one take_entry a frame, no images. Frames that cannot be
// read are left out (take_lost). The handle uses `recording`, which must outlive it. ERR_MISSING: no such take; the
// sentence lists the takes there are. ERR_CORRUPT: its row cannot be read. ERR_IO, ERR_MEMORY. On failure *out is NULL.
MUST_CHECK enum status take_open(struct take **out, struct recording *recording, const char *name);

// The same for those who look at the take: where the sensor had no colour camera, or one that gave no image and whose
// axes are the depth camera's, each frame's colour image is drawn from its depth (depth_picture.h), and
// take_calibration and the entries say so: it has the depth camera's lens.
MUST_CHECK enum status take_open_drawn(struct take **out, struct recording *recording, const char *name);

// Opens another handle on the same take: it shares the index, which is immutable and reference-counted, and has its
// own statement and decode buffers. `recording` is another handle on the same file, used by the same thread as *out.
// `same` is only read and must be open during the call; afterwards the handles may be closed in any order, by any
// threads. ERR_IO, ERR_CORRUPT, ERR_MEMORY; on failure *out is NULL.
//
// Memory: the index has 712 bytes a frame, once for all handles: 77 MB for an hour at 30 Hz, of which 21 MB are
// the joints' covariances as half floats. A handle adds one decoded frame: colour 3, depth 2, mask 1 bytes a pixel.
MUST_CHECK enum status take_open_shared(struct take **out, struct recording *recording, const struct take *same);
void take_close(struct take **take); // NULL is fine; sets *take = NULL

// One frame of the index. No bigger than it must be: an hour has 108000.
struct take_entry {
    int64_t time_ns;
    struct pose world_from_camera;
    int32_t row_number; // of the frame's row in its take; has gaps where frames were lost
    bool located : 1, has_color : 1, has_depth : 1, has_mask : 1, has_skeleton : 1;
    struct skeleton skeleton; // colour camera's axes; zeroed without has_skeleton
};

// Bytes of all its frames.
struct take_sizes {
    int64_t color, depth, mask, joints; // joints: with their covariances, and the frame's pose
    bool exact;                         // false: reckoned from some of the frames
};
// Reads the parts' lengths of at most 300 frames, not the parts. ERR_IO, ERR_CORRUPT, ERR_MEMORY.
MUST_CHECK enum status take_read_sizes(struct take *take, struct take_sizes *out);

const struct calibration *take_calibration(const struct take *take);
int64_t take_frame_count(const struct take *take);
// Asserts the range. Valid until the last handle on the take is closed.
const struct take_entry *take_entry(const struct take *take, int64_t index);
const struct body *take_body(const struct take *take);
// The sensor's pose in the place was measured in a frame with a person: frames in which it was not are then in no
// world.
bool take_is_located(const struct take *take);
bool take_is_drawn_from_depth(const struct take *take); // its colour images are: see take_open_drawn
bool take_is_complete(const struct take *take);         // false: interrupted, still readable
int64_t take_dropped(const struct take *take);
int64_t take_lost(const struct take *take);        // frames that damage cost, before a repair too; they are left out
int64_t take_errors_lost(const struct take *take); // frames whose joints' covariances damage cost
const char *take_note(const struct take *take);    // "" where there is none; valid until the last handle is closed
const char *take_alias(const struct take *take); // who performs: a name that need not be the person's own; "" likewise

// Decoded images of one frame. Pixels belong to the handle and are valid until its next take_read; images that were not
// wanted, or that the frame lacks, are NULL.
struct take_images {
    const uint8_t *color;  // RGB, 8 bits a channel, of calibration.color
    const uint16_t *depth; // millimetres, 0 = no reading, of calibration.depth
    const uint8_t *mask;   // one byte a depth pixel, 1: the actor
};
enum take_want { TAKE_COLOR = 1, TAKE_DEPTH = 2, TAKE_MASK = 4 };
// Reads and decodes the wanted images (a sum of take_want) of frame `index`. ERR_CORRUPT: the frame is damaged; others
// can still be read. ERR_IO: also where another program trimmed or deleted the take since it was
// opened. ERR_MEMORY. On failure all images in *out are NULL.
MUST_CHECK enum status take_read(struct take *take, int64_t index, unsigned want, struct take_images *out);
// How many frames all handles on the take have decoded so far, for tests of what reads too much. Any thread may ask.
int64_t take_frames_decoded(const struct take *take);

// The bytes of a frame's colour image, a JPEG as the sensor made it where it did; valid until the handle's next
// take_read or take_read_jpeg. NOTHING: it has no colour of its own. Errors as take_read; unless OK, *bytes is NULL.
MUST_CHECK enum status take_read_jpeg(struct take *take, int64_t index, const uint8_t **bytes, size_t *count);

// ---------------------------------------------------------------- verify and repair

enum { RECORDING_FINDINGS_MAX = 12 };
struct recording_report {
    int takes, interrupted_takes;
    int64_t frames;            // that are there
    int64_t damaged_frames;    // of them: images, or one of them, cannot be read
    int64_t lost_frames;       // that are not there, or cannot be read
    int64_t lost_covariances;  // of the joints: of how many frames they cannot be read
    int lost_takes;            // whose row cannot be read
    int32_t lost_views;        // of the place
    bool lost_place;           // it is there and cannot be read; its views are then not counted
    bool lost_map_covariances; // of the place; or its points' viewing directions
    int lost_things;           // of the place; things, and pictures or models of things
    int64_t bytes;
    int findings; // how many things are wrong; the sentences of the first of them:
    char finding[RECORDING_FINDINGS_MAX][200];
};
// Reads every byte: SQLite's own check; that rows belong together and none is missing; checksums; every image decoded;
// every number finite and in its range; times rising. OK; ERR_CORRUPT with the first finding; else as recording_open.
MUST_CHECK enum status recording_verify(const char *path, struct recording_report *out);

// Saves every frame that can be read of a damaged file into `to`, which must not exist; `path` is only read. Rows whose
// ids were damaged are put where they belong as far as that can be known. *out: what was saved and lost. Takes that
// lost frames say so (take_lost) and are not complete. NOTHING: `path` is sound, and nothing was made. ERR_EXISTS,
// ERR_IO, ERR_MEMORY; ERR_CORRUPT: not even the tables can be read. On failure there is no `to`.
MUST_CHECK enum status recording_repair(const char *path, const char *to, struct recording_report *out);

// ---------------------------------------------------------------- changing takes
// Each in one transaction: all of it or, on any error, nothing. ERR_MISSING: no such take. ERR_EXISTS: the new name is
// in use. ERR_CORRUPT: repair the file first. ERR_IO: also where another program writes the file. ERR_INPUT,
// ERR_MEMORY.

MUST_CHECK enum status recording_rename_take(const char *path, const char *name, const char *new_name);
// NULL keeps what there is, "" removes it.
MUST_CHECK enum status recording_annotate_take(const char *path, const char *name, const char *note, const char *alias);
// Its bytes are overwritten with zeros, in the file and in the log beside it, and the file is made smaller, which takes
// as long as copying what remains; *freed: by how many bytes, 0 where the disk has no room for that (the bytes are
// zeros nevertheless, and used by the next take). freed NULL: for somebody who waits; the next take uses the space, and
// the file is made smaller only once more of it is free than used. ERR_IO: another program is reading the file; the
// sentence says whether nothing has changed, or the take is gone and its bytes are still to be overwritten: the same
// call does that later.
MUST_CHECK enum status recording_delete_take(const char *path, const char *name, int64_t *freed);
// Keeps the frames from `from_ns` to `to_ns` after the first one, both included; the others are overwritten likewise.
// ERR_INPUT: none would remain.
MUST_CHECK enum status recording_trim_take(const char *path, const char *name, int64_t from_ns, int64_t to_ns,
                                           int64_t *freed);
// What a copy of a take left out, because it is damaged in the file that it was copied from.
struct take_copy_report {
    bool place_differs;        // `to` has another place, so that the copy does not know where it was filmed
    int64_t lost_frames;       // as take_lost of the copy
    int64_t damaged_frames;    // of the copy's frames, those that lost an image
    int64_t lost_covariances;  // of the copy's frames, those without their joints' covariances
    int32_t lost_views;        // of the place, where `to` was made
    bool lost_map_covariances; // of the place, where `to` was made; or its points' viewing directions
    int lost_things;           // things in the place, their pictures and models, where `to` was made
};

// Adds the take as `new_name` to `to`, which is made, with the place and its things, where it does not exist; it may be
// the same file. Damaged frames, views and things are left out. *out is valid with OK. After a failure a file that was
// made is removed; one that was there may hold the part of the take that was copied, as an interrupted one.
MUST_CHECK enum status recording_copy_take(const char *path, const char *name, const char *to, const char *new_name,
                                           struct take_copy_report *out);
