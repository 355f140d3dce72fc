// Video files through FFmpeg's libraries: writes H.264 (MPEG-4 part 2 where the libraries have no encoder for it) in
// MP4. An optional part of the build: without the libraries video_open says so. One handle, one thread; the encoder
// starts threads of its own.
#pragma once
#include "base/status.h"

#include <stdio.h>

struct video_writer;

struct video_layout {
    int width, height; // an odd last column or row is left out
    bool seekable;     // the stream can be rewound; else the film is fragmented, which not every player can wind
};

// `out` must be at its beginning and outlive the writer. ERR_INPUT: built without FFmpeg, or it has no encoder; smaller
// than 2 x 2 pixels. ERR_MEMORY. On failure *w is NULL.
MUST_CHECK enum status video_open(struct video_writer **w, FILE *out, const struct video_layout *layout);

// rgb: 8 bits a channel, rows without padding. time_ns: strictly increasing; the film begins with the first, and the
// last one is shown for the shortest time between two, or for 1/30 s if there are no two.
// ERR_ORDER, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status video_add(struct video_writer *writer, const uint8_t *rgb, int64_t time_ns);

// Writes what is left, unless `status` is an error, and frees. Returns the first error. NULL is fine; sets *w = NULL.
enum status video_close(struct video_writer **w, enum status status);
