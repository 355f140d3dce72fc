// PNG pictures (libpng). Rows without padding, top row first. Safe from any thread.
#pragma once
#include "base/status.h"

// 16-bit samples are in the machine's order.
enum png_kind { PNG_GRAY8 = 1, PNG_GRAY16 = 2, PNG_RGB8 = 3, PNG_RGBA8 = 4 }; // bytes a pixel

// Reads a file as `kind`: palettes are expanded, alpha dropped or made opaque.
// Asking for gray 16 of an 8-bit picture, or for 8 bit of a 16-bit one, is ERR_INPUT:
// the numbers would change. *pixels is malloc'ed, the caller frees it.
// ERR_MISSING, ERR_CORRUPT, ERR_MEMORY.
MUST_CHECK enum status png_read(const char *path, enum png_kind kind, void **pixels, int *width, int *height);

// The same from memory; `name` is for the sentence.
MUST_CHECK enum status png_decode(const uint8_t *bytes, size_t count, const char *name, enum png_kind kind,
                                  void **pixels, int *width, int *height);

// Writes through a temporary name, so that a picture is there whole or not at all. ERR_IO.
MUST_CHECK enum status png_write(const char *path, enum png_kind kind, const void *pixels, int width, int height);

// *bytes is malloc'ed, the caller frees it. level: zlib's, 0..9. ERR_MEMORY.
MUST_CHECK enum status png_encode(enum png_kind kind, const void *pixels, int width, int height, int level,
                                  uint8_t **bytes, size_t *count);
