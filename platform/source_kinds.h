// What source.c knows of the kinds of source behind it; for platform's own
// files only. Users of pictures include platform/source.h.
#pragma once
#include "platform/source.h"

#ifdef __cplusplus
extern "C" {
#endif

// What a kind tells about itself. source.c owns it, at a fixed address for the
// source's life; the kind fills it on opening and keeps `remaining` and
// `dropped` current from within next().
struct source_facts {
    struct calibration calibration;
    bool live;
    int64_t remaining; // -1: unknown
    int64_t dropped;
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

// As source_devices, for one kind.
MUST_CHECK enum status openni_devices(struct source_device *out, int capacity, int *count);

// calibration_read(), and the length of one unit of the depth pictures in
// metres (`unit_m`, 0.001 where the file does not say).
MUST_CHECK enum status calibration_read_with_unit(const char *path, struct calibration *out, double *unit_m);

#ifdef __cplusplus
}
#endif
