// Reading a film in MP4 or QuickTime, image by image, through FFmpeg's libraries; an optional part of the build:
// without the libraries video_reader_open says so. One handle, one thread.
#pragma once
#include "base/status.h"

#include <stdint.h>

struct video_reader;

// ERR_MISSING: there is no file. ERR_INPUT: no such film, no images in it, images of an odd or unusable size, a codec
// that the libraries lack; built without FFmpeg, or it is not installed. ERR_MEMORY. On failure *out is NULL.
MUST_CHECK enum status video_reader_open(struct video_reader **out, const char *path);
void video_reader_close(struct video_reader **reader); // NULL is fine; sets *reader = NULL

// As stored: a note that the film is to be turned is not obeyed.
void video_reader_size(const struct video_reader *reader, int *width, int *height);

// Goes on to the next image; *time_ns: since the film's beginning. NOTHING: the end. ERR_INPUT: a damaged image, or one
// of another size; the next call goes on after it.
MUST_CHECK enum status video_reader_next(struct video_reader *reader, int64_t *time_ns);

// The image that it went on to: rgb has width * height * 3 bytes. ERR_MEMORY.
MUST_CHECK enum status video_reader_image(struct video_reader *reader, uint8_t *rgb);
