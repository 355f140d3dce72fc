// Frame sources: a depth sensor (OpenNI2, an .oni file, an Azure Kinect's .mkv, a folder) or a tablet's
// camera (libcamera, a folder). All are opened by URI and read the same way.
//
//   sensors   openni  openni:N  oni:FILE  mkv:FILE  folder:DIR
//   cameras   libcamera  libcamera:N  folder:DIR
//
// A folder is the TUM RGB-D layout (rgb.txt, depth.txt: seconds and file) with
// a calibration.json beside it; colour and depth are paired by time, at most
// half a frame apart. One handle belongs to one thread.
#pragma once
#include "base/lens.h"
#include "platform/sensors/dmabuf_image.h"
#include "platform/sensors/stream_clocks.h"

// One instant. A missing image is NULL.
struct frame {
    int64_t time_ns;      // the source's own clock, strictly increasing
    char name[32];        // "0007": the image's file name without extension, or its running number
    const uint8_t *color; // RGB, 8 bit, width * height * 3 of calibration.color
    const uint8_t *jpeg;  // the colour image as the source encoded it; NULL where it did not
    size_t jpeg_bytes;
    const uint16_t *depth; // millimetres, 0 = no reading, of calibration.depth
    // The colour image in the driver's memory, after source_enable_dmabuf; or NULL. The caller of source_next
    // releases it.
    struct dmabuf_image *dmabuf;
};

struct source;

// What every kind of source implements; `self` is the kind's own state.
struct source_kind {
    enum status (*next)(void *self, struct frame *out);
    void (*close)(void *self);
};

enum source_wanted { SOURCE_SENSOR, SOURCE_CAMERA };

// ERR_INPUT: no URI of that kind, invalid calibration, images of the wrong size.
// ERR_MISSING: no such device or folder. ERR_DEVICE: it does not start.
// On error *out is NULL.
MUST_CHECK enum status source_open(struct source **out, const char *uri, enum source_wanted wanted);

// Valid until source_close.
const struct calibration *source_calibration(const struct source *source);

// A live source drops frames that are not fetched in time; a recorded one waits.
bool source_is_live(const struct source *source);

// Frames still to come; -1: unknown.
int64_t source_remaining(const struct source *source);

// OK: *out is filled; its pixels are borrowed until the next call on `s`.
// NOTHING: the end. ERR_DEVICE: unplugged. ERR_INPUT: a damaged image, with its
// name; the next call continues after it. *out is zeroed unless OK.
MUST_CHECK enum status source_next(struct source *s, struct frame *out);

// Saves a focal length found by self-calibration for the next time this camera is opened. NOTHING: its focal_sigma is
// no smaller than before, it is for another image size, or the source has its calibration in a file (a folder). ERR_IO.
MUST_CHECK enum status source_save_lens(const struct source *s, const struct lens *lens);

// Keeps what was measured of this very device, for the next time it is opened. NOTHING: the source has its calibration
// in a file (a folder, a recording). ERR_IO, ERR_INPUT, ERR_MEMORY.
MUST_CHECK enum status source_save_calibration(const struct source *s, const struct calibration *calibration);

// From now on frames have `dmabuf` where the source can export it and not too many are unreleased.
void source_enable_dmabuf(struct source *source);

// Frames that the source received but did not return.
int64_t source_dropped(const struct source *source);

// Whether a sensor's two streams run by one clock: why colour is missing, or is that of other moments. In words as
// stream_clocks_text(); "": nothing is known against it. Of a folder, at once; of other sources, by the images so far.
const char *source_clocks(const struct source *source, char out[STREAM_CLOCKS_TEXT_BYTES]);

void source_close(struct source **source); // NULL is fine; sets *source = NULL

// One line for each device that could be opened, for `reenact-capture devices`.
struct source_device {
    char uri[256];
    char name[128];
};
// Fills at most `capacity`; *count is the number of devices. No device is OK with 0.
MUST_CHECK enum status source_devices(struct source_device *out, int capacity, int *count);

// Reads a folder's calibration.json. ERR_MISSING; ERR_INPUT with the member's name. *out is then untouched.
MUST_CHECK enum status calibration_read(const char *path, struct calibration *out);

// Writes what calibration_read reads. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status calibration_write(const char *path, const struct calibration *calibration);
// Adds the same members to an object (json.h).
struct json;
void calibration_add_json(struct json *object, const struct calibration *calibration);
