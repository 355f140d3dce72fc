// Frame sources: a depth sensor (OpenNI2, Video4Linux, an .oni file, an Azure Kinect's .mkv, a telephone's recording, a
// folder) or a tablet's camera (libcamera, a folder). All are opened by URI and read the same way.
//
//   sensors   openni  openni:N  v4l2  v4l2:N  oni:FILE  mkv:FILE  r3d:FILE  stray:DIR  folder:DIR
//   cameras   libcamera  libcamera:N  folder:DIR
//
// A folder is the TUM RGB-D layout (rgb.txt, depth.txt: seconds and file) with
// a calibration.json beside it; colour and depth are paired by time, at most
// half a frame apart. A telephone's recordings are Record3D's .r3d and Stray Scanner's folders (telephone.h). One
// handle belongs to one thread.
#pragma once
#include "base/lens.h"
#include "base/pixels.h"
#include "base/threads.h"
#include "platform/sensors/stream_clocks.h"

// ---------------------------------------------------------------- image in the driver's memory

// A camera image in the camera driver's own memory (dma-buf), which a graphics driver may be able to read without a
// copy. The camera does not write into it until it is released. Any thread may release it, also after the camera was
// closed.

enum dmabuf_layout {
    DMABUF_YUYV, // two pixels in four bytes: Y0 Cb Y1 Cr
    DMABUF_UYVY, // Cb Y0 Cr Y1
    DMABUF_NV12, // a plane of Y and a half-size plane of Cb Cr pairs
    DMABUF_RGBX, // four bytes a pixel
    DMABUF_BGRX,
    DMABUF_LAYOUTS
};

struct dmabuf_plane {
    int file;                // descriptor of the dma-buf; owned by the dmabuf_image
    uint32_t offset, stride; // bytes
};

struct dmabuf_image {
    enum dmabuf_layout layout;
    int width, height;                       // pixels; even where chroma is subsampled
    struct yuv_encoding encoding;            // of YUYV, UYVY, NV12
    struct dmabuf_plane planes[2];           // the second for NV12 only
    void (*release)(struct dmabuf_image *l); // frees it; call dmabuf_image_release()
};

// NULL is fine; sets *image = NULL. Where a GPU reads it, wait for that to end first (gpu.h).
static inline void dmabuf_image_release(struct dmabuf_image **image)
{
    if (*image)
        (*image)->release(*image);
    *image = NULL;
}

// ---------------------------------------------------------------- source

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
    // Where the source itself has the colour camera (a telephone's odometry): in axes of its own that stand upright, z
    // against gravity, and drift.
    bool has_odometry;
    struct pose odometry_from_camera;
};

struct source;

// What every kind of source implements; `self` is the kind's own state.
struct source_kind {
    enum status (*next)(void *self, struct frame *out);
    void (*close)(void *self);
};

enum source_wanted { SOURCE_SENSOR, SOURCE_CAMERA };

// What a sensor's URI may be, for sentences and helps.
#define SOURCE_SENSOR_URIS "openni, openni:N, v4l2, v4l2:N, oni:FILE, mkv:FILE, r3d:FILE, stray:DIR or folder:DIR"

// ERR_INPUT: no URI of that kind, invalid calibration, images of the wrong size.
// ERR_MISSING: no such device or folder. ERR_DEVICE: it does not start.
// On error *out is NULL.
MUST_CHECK enum status source_open(struct source **out, const char *uri, enum source_wanted wanted);

// Whether it can only be a sensor's, whether or not that is there.
bool source_uri_is_sensor(const char *uri);

// Valid until source_close.
const struct calibration *source_calibration(const struct source *source);

// A live source drops frames that are not fetched in time; a recorded one waits.
bool source_is_live(const struct source *source);

// Frames still to come; -1: unknown.
int64_t source_remaining(const struct source *source);

// OK: *out is filled; its pixels are borrowed until the next call on `source`.
// NOTHING: the end. ERR_DEVICE: unplugged. ERR_INPUT: a damaged image, with its
// name; the next call continues after it. *out is zeroed unless OK.
MUST_CHECK enum status source_next(struct source *source, struct frame *out);

// Saves a focal length found by self-calibration for the next time this camera is opened. NOTHING: its focal_sigma is
// no smaller than before, it is for another image size, or the source has its calibration in a file (a folder). ERR_IO.
MUST_CHECK enum status source_save_lens(const struct source *source, const struct lens *lens);

// Keeps what was measured of this very device, for the next time it is opened. NOTHING: the source has its calibration
// in a file (a folder, a recording). ERR_IO, ERR_INPUT, ERR_MEMORY.
MUST_CHECK enum status source_save_calibration(const struct source *source, const struct calibration *calibration);

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
    uint16_t usb_vendor, usb_product; // 0: not known
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

// ---------------------------------------------------------------- source player

// Plays a source on a thread of its owner's: opens it by URI, again a second after it failed; gives its frames, those
// of a film (a recorded source) at the times at which they were taken; plays a film again from its start; and closes
// the source while its owner is suspended. The owner's struct holds one, and its thread is the player's worker:
//
//     while (source_player_wait_to_play(p)) {
//         enum status status = source_player_open_source(p);
//         while (status == OK && !source_player_must_stop(p)) {
//             status = source_player_next(p, &frame);
//             ...                            // ERR_INPUT: a damaged image; NOTHING: a film is over
//             source_player_wait_for_frame(p);
//         }
//         source_player_close_source(p);
//         if (status != OK)
//             source_player_wait_to_retry(p);
//     }
//
// Times are those of clock_now_ns(), ns. Threads: what is marked so is for the worker's thread alone.

struct source_player {
    struct worker_thread worker; // the lock guards `suspended`, and what else the owner's threads share
    bool suspended;

    // Of the worker's thread:
    char *uri;
    enum source_wanted wanted;
    struct source *source; // NULL: closed
    bool film;             // the source is recorded
    int64_t first_ns;      // of a film: the source's time of the frame that was due at began_ns
    int64_t began_ns;      // 0: none yet
    int64_t due_ns;        // when the last frame is to be shown; 0: none yet
    int64_t interval_ns;   // from the frame before to the last one; 0: that was the first
};

// Copies the URI. ERR_MEMORY. Once opened, also with an error, it must be closed. The thread is worker_thread_start's.
MUST_CHECK enum status source_player_open(struct source_player *player, const char *uri, enum source_wanted wanted);
void source_player_close(struct source_player *player); // waits for the thread's end

// From any thread. true: the source is to be closed, and is opened again after the call with false.
void source_player_suspend(struct source_player *player, bool suspend);

// ------------------------------------------------------------ the worker's thread

// While it is suspended, waits. False: the thread must end.
bool source_player_wait_to_play(struct source_player *player);

bool source_player_must_stop(struct source_player *player); // it is suspended, or the thread must end

// The source from its start; one that is open is closed before. A film goes on where it was over: its first frame is
// due one interval after the last one. As source_open.
MUST_CHECK enum status source_player_open_source(struct source_player *player);
void source_player_close_source(struct source_player *player); // one that is closed is fine

// As source_next. NOTHING: a film is over; a live source that ends is ERR_DEVICE.
MUST_CHECK enum status source_player_next(struct source_player *player, struct frame *out);

// Until the last frame is due, or it must stop. Of a live source frames are due at once.
void source_player_wait_for_frame(struct source_player *player);
void source_player_wait_until_ns(struct source_player *player, int64_t when_ns); // or until it must stop
void source_player_wait_to_retry(struct source_player *player);                  // a second, or until it must stop

// The film stood still at its first frame until now.
void source_player_begin(struct source_player *player);
// The film is from here on that much later.
void source_player_delay(struct source_player *player, int64_t delay_ns);
// Others have read the source: its next frame is due at once.
void source_player_resume(struct source_player *player);
