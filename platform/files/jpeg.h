// JPEG images in memory (libjpeg-turbo). RGB, 8 bit, rows without padding. Any
// thread may call. Decoding and encoding use the accurate integer DCT, so the same
// bytes give the same pixels on every machine.
#pragma once
#include "base/status.h"

// ---------------------------------------------------------------- jpeg metadata

// What a JPEG file holds beside its picture: Exif with the orientation, which other programs obey, the place where it
// was taken and a thumbnail; XMP, comments, further pictures after the first. Any thread.

// The same picture, its coded pixels byte for byte, with nothing beside it but what decoding needs: JFIF without its
// thumbnail, a colour profile, Adobe's transform. Without an orientation all programs show the pixels as they are
// stored. A file that is cut short stays so. *out is malloc'ed, the caller frees it. ERR_CORRUPT: it is no JPEG file.
// ERR_MEMORY.
MUST_CHECK enum status jpeg_without_metadata(const uint8_t *bytes, size_t count, uint8_t **out, size_t *out_count);

// ---------------------------------------------------------------- jpeg

// Size of a JPEG without decoding it. ERR_CORRUPT; ERR_INPUT: larger than base/pixels.h allows, or CMYK; ERR_MEMORY.
MUST_CHECK enum status jpeg_size(const uint8_t *bytes, size_t count, int *width, int *height);

// Decodes into rgb[width * height * 3]. ERR_CORRUPT: damaged, cut short or of
// another size; rgb is then undefined. ERR_INPUT: CMYK. ERR_MEMORY. Pixels are as they are stored: an orientation
// (Exif) is not obeyed, since depth and calibration lie on them so.
MUST_CHECK enum status jpeg_decode(const uint8_t *bytes, size_t count, uint8_t *rgb, int width, int height);

// Chroma is subsampled 4:2:0. quality 1..100. *bytes is malloc'ed, the caller frees it. ERR_MEMORY.
MUST_CHECK enum status jpeg_encode(const uint8_t *rgb, int width, int height, int quality, uint8_t **bytes,
                                   size_t *count);
