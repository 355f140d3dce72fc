// Where pictures come from: a depth sensor (OpenNI2, an .oni file, a folder) or
// a tablet's camera (libcamera, a folder). All are opened by URI and read the
// same way, so that nothing behind this line knows which one it has.
//
//   sensors   openni  openni:N  oni:FILE  folder:DIR
//   cameras   libcamera  libcamera:N  folder:DIR
//
// A folder is the TUM RGB-D layout (rgb.txt, depth.txt: seconds and file) with
// a calibration.json beside it; colour and depth are paired by time, at most
// half a frame apart. One handle belongs to one thread.
#pragma once
#include "base/lens.h"
#include "platform/dmabuf_image.h"

// One instant. A picture that is not there has NULL pixels.
struct frame {
    int64_t time_ns;      // the source's own clock, strictly increasing
    char name[32];        // "0007": the picture's file name without ending, or its running number
    const uint8_t *color; // RGB, 8 bit, width * height * 3 of calibration.color
    const uint8_t *jpeg;  // the same picture as the source coded it, where it did; else NULL
    size_t jpeg_bytes;
    const uint16_t *depth; // millimetres, 0 = no reading, of calibration.depth
    struct dmabuf_image
        *dmabuf; // the colour picture where it lies, after source_enable_dmabuf; who fetched the frame returns it
};

struct source;

// What every kind of source implements; `self` is the kind's own state.
struct source_kind {
    enum status (*next)(void *self, struct frame *out);
    void (*close)(void *self);
};

enum source_wanted { SOURCE_SENSOR, SOURCE_CAMERA };

// ERR_INPUT: not such a URI, bad calibration, pictures of the wrong size.
// ERR_MISSING: no such device or folder. ERR_DEVICE: it would not start.
// On error *out is NULL.
MUST_CHECK enum status source_open(struct source **out, const char *uri, enum source_wanted wanted);

// Valid until source_close.
const struct calibration *source_calibration(const struct source *s);

// A live source drops what is not fetched in time; a recorded one waits.
bool source_is_live(const struct source *s);

// How many pictures are still to come; -1 when nobody knows.
int64_t source_remaining(const struct source *s);

// OK: *out is filled; its pixels are borrowed until the next call on `s`.
// NOTHING: the end. ERR_DEVICE: unplugged. ERR_INPUT: a damaged picture, with
// its name; the next call goes on behind it.
MUST_CHECK enum status source_next(struct source *s, struct frame *out);

// The focal length that was learnt of a camera's lens, kept for the next time it is opened. NOTHING: it is no surer
// than before, of pictures of another size, or the lens is written beside the pictures, as a folder's is. ERR_IO.
MUST_CHECK enum status source_save_lens(const struct source *s, const struct lens *lens);

// From now on frames come with loans, where the source has such and not too many are out.
void source_enable_dmabuf(struct source *s);

// Frames that the source itself saw go by without handing them out.
int64_t source_dropped(const struct source *s);

void source_close(struct source **s); // NULL is fine; sets *s = NULL

// One line for each device that could be opened, for `reenact-capture devices`.
struct source_device {
    char uri[256];
    char name[128];
};
// Fills at most `capacity`; *count is how many there are. No device is OK with 0.
MUST_CHECK enum status source_devices(struct source_device *out, int capacity, int *count);

// calibration.json of a folder. ERR_MISSING, ERR_INPUT with the number's name.
MUST_CHECK enum status calibration_read(const char *path, struct calibration *out);
