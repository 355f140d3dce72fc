// What source.c knows of the kinds of source behind it; for platform's own
// files only. Users of pictures include platform/source.h.
#pragma once
#include "platform/source.h"

#ifdef __cplusplus
extern "C" {
#endif

// What a kind tells about itself. source.c owns it, at a fixed address for the
// source's life; the kind fills it on opening and keeps `remaining` and
// `dropped` current from within next(); `dmabuf_enabled` is source.c's.
struct source_facts {
    struct calibration calibration;
    bool live;
    int64_t remaining; // -1: unknown
    int64_t dropped;
    bool dmabuf_enabled; // source_enable_dmabuf was called
    char camera_id[256]; // by which what is known of a tablet's camera is kept; "" of all else
};

// Each opens one kind. On OK *self is what `kind` wants as its first argument;
// on error *self is NULL and nothing is held.
typedef enum status source_opener(void **self, const char *where, enum source_wanted wanted,
                                  struct source_facts *facts);

source_opener folder_open; // where: the folder
extern const struct source_kind folder_kind;

source_opener openni_open;                   // where: "" or the number of the device
source_opener oni_open;                      // where: the file
extern const struct source_kind openni_kind; // of both

source_opener libcamera_open; // where: "" or the number of the camera
extern const struct source_kind libcamera_kind;

// As source_devices, for one kind.
MUST_CHECK enum status openni_devices(struct source_device *out, int capacity, int *count);
MUST_CHECK enum status libcamera_devices(struct source_device *out, int capacity, int *count);

// calibration_read(), and the length of one unit of the depth pictures in
// metres (`unit_m`, 0.001 where the file does not say).
MUST_CHECK enum status calibration_read_with_unit(const char *path, struct calibration *out, double *unit_m);

// What is known of the camera with that id: "color" of the calibration.json
// named reenact/cameras/ID.json in $XDG_CONFIG_HOME (else ~/.config), where /
// and other letters that no file name should have are written as _.
// NOTHING: there is no such file, *out is untouched. ERR_INPUT: it is wrong.
MUST_CHECK enum status camera_lens_read(const char *id, struct lens *out);

// Writes it there for the next time, with how unsure it still is. ERR_IO.
MUST_CHECK enum status camera_lens_save(const char *id, const struct lens *lens);

// The same lens for pictures of another size. ERR_INPUT unless they have the
// same proportions: nobody could tell what was cut off.
MUST_CHECK enum status camera_lens_scale(struct lens *lens, int width, int height, const char *id);

// A lens that sees 60 degrees from left to right, for a camera of which nothing
// is known. Most see between 50 and 75, so what is placed by it may be off by a
// quarter: good to begin with, not to stay with.
struct lens camera_lens_guess(int width, int height);

#ifdef __cplusplus
}
#endif
