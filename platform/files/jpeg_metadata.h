// What a JPEG file holds beside its picture: Exif with the orientation, which other programs obey, the place where it
// was taken and a thumbnail; XMP, comments, further pictures after the first. Any thread.
#pragma once
#include "base/status.h"

// The same picture, its coded pixels byte for byte, with nothing beside it but what decoding needs: JFIF without its
// thumbnail, a colour profile, Adobe's transform. Without an orientation all programs show the pixels as they are
// stored. A file that is cut short stays so. *out is malloc'ed, the caller frees it. ERR_CORRUPT: it is no JPEG file.
// ERR_MEMORY.
MUST_CHECK enum status jpeg_without_metadata(const uint8_t *bytes, size_t count, uint8_t **out, size_t *out_count);
