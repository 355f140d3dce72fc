// PNG images (libpng). Rows without padding, top row first. Any thread may call.
#pragma once
#include "base/status.h"

// The value is the bytes a pixel. 16-bit samples have the machine's byte order.
enum png_kind { PNG_GRAY8 = 1, PNG_GRAY16 = 2, PNG_RGB8 = 3, PNG_RGBA8 = 4 };

struct png_layout {
    enum png_kind kind;
    int width, height;
};

// Reads a file as `kind`: palettes are expanded, alpha is dropped or set to opaque.
// PNG_GRAY16 for an 8-bit image, or an 8-bit kind for a 16-bit image, is ERR_INPUT:
// the values would change; so is a picture larger than base/pixels.h allows. *pixels is malloc'ed, the caller frees it.
// ERR_MISSING, ERR_CORRUPT, ERR_MEMORY. On error *pixels is untouched.
MUST_CHECK enum status png_read(const char *path, enum png_kind kind, void **pixels, int *width, int *height);

// The same from memory. layout: kind in, size out. `name` is for the sentence.
MUST_CHECK enum status png_decode(const uint8_t *bytes, size_t count, const char *name, struct png_layout *layout,
                                  void **pixels);

// Size of a PNG by its first bytes, without decoding it. ERR_CORRUPT.
MUST_CHECK enum status png_size(const uint8_t *bytes, size_t count, const char *name, int *width, int *height);

// Writes under a temporary name and renames: there is never a partial file. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status png_write(const char *path, enum png_kind kind, const void *pixels, int width, int height);

// *bytes is malloc'ed, the caller frees it. level: zlib's, 0..9. ERR_MEMORY.
MUST_CHECK enum status png_encode(const struct png_layout *layout, const void *pixels, int level, uint8_t **bytes,
                                  size_t *count);
