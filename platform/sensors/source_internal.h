// The interface between source.c and the kinds of source. For files of
// platform/ only; others include platform/sensors/source.h.
#pragma once
#include "platform/sensors/source.h"
#include "platform/sensors/stream_clocks.h"

#ifdef __cplusplus
extern "C" {
#endif

// Properties of an open source. source.c owns it, at a fixed address for the
// source's life. The kind fills it on opening and updates `remaining` and
// `dropped` in next(); source.c writes `dmabuf_enabled`.
struct source_facts {
    struct calibration calibration;
    bool live;
    int64_t remaining; // -1: unknown
    int64_t dropped;
    struct stream_times color_times, depth_times; // of a sensor, as far as they are known
    int64_t pairs;                                // depth images that have a colour image
    bool listed;                                  // those times are the lines of rgb.txt and depth.txt
    bool dmabuf_enabled;                          // source_enable_dmabuf was called
    char camera_id[256];                          // key of camera_lens_read(); "" for other sources
};

// Opens one kind. OK: *self is the first argument of the kind's functions.
// Error: *self is NULL and nothing is held.
typedef enum status source_opener(void **self, const char *where, enum source_wanted wanted,
                                  struct source_facts *facts);

source_opener folder_open; // where: the folder
extern const struct source_kind folder_kind;

source_opener openni_open; // where: "" or the number of the device
extern const struct source_kind openni_kind;

source_opener oni_open; // where: the file; in oni_player.c
extern const struct source_kind oni_kind;

source_opener mkv_open; // where: the file; in azure_kinect.c
extern const struct source_kind mkv_kind;

source_opener record3d_open; // where: the file; in record3d.c
extern const struct source_kind record3d_kind;

source_opener stray_open; // where: the folder; in stray_scanner.c
extern const struct source_kind stray_kind;

source_opener v4l2_open; // where: "" or the number of the node
extern const struct source_kind v4l2_kind;

source_opener libcamera_open; // where: "" or the number of the camera
extern const struct source_kind libcamera_kind;

// As source_devices, for one kind.
MUST_CHECK enum status openni_devices(struct source_device *out, int capacity, int *count);
MUST_CHECK enum status v4l2_devices(struct source_device *out, int capacity, int *count);
MUST_CHECK enum status libcamera_devices(struct source_device *out, int capacity, int *count);

// As calibration_read(), and the length of one unit of the depth images in
// metres (`unit_m`, by default 0.001).
MUST_CHECK enum status calibration_read_with_unit(const char *path, struct calibration *out, double *unit_m);

// The lens stored for the camera with that id: "color" of
// reenact/cameras/ID.json in $XDG_CONFIG_HOME (or ~/.config), in the format of
// calibration.json; characters of the id other than letters, digits, - and .
// are written as _. NOTHING: there is no such file. ERR_INPUT: it is invalid.
// *out is untouched unless OK.
MUST_CHECK enum status camera_lens_read(const char *id, struct lens *out);

// The name of that file. ERR_INPUT: there is no home folder, or the path is too long.
MUST_CHECK enum status camera_calibration_file(const char *id, char *path, size_t size);

// Writes that file, focal_sigma included. ERR_INPUT: no home folder. ERR_IO.
MUST_CHECK enum status camera_lens_save(const char *id, const struct lens *lens);

// The same file as a whole, of a camera or a depth sensor that was calibrated: what it says of *calibration, which the
// device's own statements have filled, replaces them. `color`; `depth`, where depth is not registered, else it is the
// colour camera's; `color_from_depth`, where both the file and *calibration say that depth is not registered. OK also
// without a file. ERR_INPUT: it is invalid, or for images of another shape.
MUST_CHECK enum status device_calibration_apply(const char *id, struct calibration *calibration);

// Writes it. ERR_INPUT: no home folder. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status device_calibration_save(const char *id, const struct calibration *calibration);

// Scales the lens to another image size. ERR_INPUT unless the aspect ratio is
// the same: otherwise the crop is unknown.
MUST_CHECK enum status camera_lens_scale(struct lens *lens, int width, int height, const char *id);

// A lens with a horizontal field of view of 60 degrees, for a camera without
// calibration. Most cameras have 50 to 75 degrees, so its focal length may be
// wrong by a quarter: an initial value for self-calibration.
struct lens camera_lens_guess(int width, int height);

#ifdef __cplusplus
}
#endif
