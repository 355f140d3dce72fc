// The pixels of depth images with levels of 16 bits.
#include "recording/depth_pixels.h"

#define LEVEL        int16_t
#define LEVEL_MASK   (DEPTH_NARROW_LEVELS - 1)
#define DEPTH_ENCODE depth_encode_narrow
#define DEPTH_DECODE depth_decode_narrow
// Rows are what both others call.
// clang-format off
#include "recording/depth_rows.inl"
#include "recording/depth_encode.inl"
#include "recording/depth_decode.inl"
// clang-format on
