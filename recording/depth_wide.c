// The pixels of depth images with levels of 32 bits.
#include "recording/depth_pixels.h"

#define LEVEL        int32_t
#define LEVEL_MASK   UINT16_MAX
#define DEPTH_ENCODE depth_encode_wide
#define DEPTH_DECODE depth_decode_wide
// Rows are what both others call.
// clang-format off
#include "recording/depth_rows.inl"
#include "recording/depth_encode.inl"
#include "recording/depth_decode.inl"
// clang-format on
