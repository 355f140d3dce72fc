// Reading a picture file of either kind, PNG or JPEG, by its first bytes. Any thread may call.
#pragma once
#include "base/status.h"

struct image {
    int width, height;
    uint8_t *rgb; // width * height * 3 bytes, malloc'ed
};

// The caller frees out->rgb. ERR_MISSING, ERR_IO, ERR_MEMORY, ERR_CORRUPT; ERR_INPUT: neither PNG nor JPEG. On error
// *out is all 0.
MUST_CHECK enum status image_read(const char *path, struct image *out);

// The same from memory; `name` is for the sentence.
MUST_CHECK enum status image_decode(const uint8_t *bytes, size_t count, const char *name, struct image *out);

// ERR_INPUT: `name` is of another kind than `wanted` ("PNG or JPEG"); the sentence says of which.
enum status image_refuse(const uint8_t *bytes, size_t count, const char *name, const char *wanted);

// Luma of ITU-R BT.601 by integers, rounded: gray has `pixels` bytes, rgb three times as many.
void image_gray(const uint8_t *rgb, size_t pixels, uint8_t *gray);
