// Conversion of camera images to RGB, 8 bits a channel, rows without padding. Integer arithmetic only: the same bytes
// give the same pixels on every machine. Pure functions, safe from any thread.
#pragma once
#include "base/status.h"

#include <stdint.h>

// ---------------------------------------------------------------- image shrink

// Smaller copies of images, for thumbnails. Pure; safe from any thread.

// RGB, 8 bits a channel, rows without padding: `in` of width x height into `out` of w x h, each pixel the mean of those
// it covers. w and h: at least 1, not larger than width and height.
void image_shrink(const uint8_t *in, int width, int height, uint8_t *out, int w, int h);

// ---------------------------------------------------------------- pixels

#ifdef __cplusplus
extern "C" {
#endif

// The largest image that is read: what one frame costs in memory is bounded by it, whatever a file says.
enum { IMAGE_SIDE_MAX = 16384, IMAGE_PIXELS_MAX = 1 << 25 };
static inline bool image_size_is_usable(int64_t width, int64_t height)
{
    return width > 0 && height > 0 && width <= IMAGE_SIDE_MAX && height <= IMAGE_SIDE_MAX &&
           width * height <= IMAGE_PIXELS_MAX;
}

// The matrix from Y, Cb, Cr to R, G, B (ITU-R BT.601-7, BT.709-6).
enum yuv_matrix { YUV_BT601, YUV_BT709 };
struct yuv_encoding {
    enum yuv_matrix matrix;
    bool full_range; // Y 0..255; otherwise Y 16..235, Cb and Cr 16..240
};

// Its coefficients times 2^16, except y_zero. With y_zero subtracted from Y, 128 from Cb and Cr:
// R = y Y + r_cr Cr, G = y Y - g_cb Cb - g_cr Cr, B = y Y + b_cb Cb, each rounded half up, then clamped to 0..255.
struct yuv_coefficients {
    int32_t y, r_cr, g_cb, g_cr, b_cb, y_zero;
};
struct yuv_coefficients yuv_coefficients_of(struct yuv_encoding encoding);

// Order of the channels in a pixel's bytes, first to last.
enum packed_order { PACKED_RGB, PACKED_BGR, PACKED_RGBX, PACKED_BGRX };

struct yuv_layout {
    struct yuv_encoding encoding;
    int width, height; // even where chroma is subsampled along that axis
};

// rgb: width * height * 3 bytes, here and below. stride: bytes from one row of `in` to the next.
void pixels_from_packed(const uint8_t *in, size_t stride, enum packed_order order, int width, int height, uint8_t *rgb);

// Two pixels in four bytes; luma_first: Y0 Cb Y1 Cr (YUYV), otherwise Cb Y0 Cr Y1 (UYVY).
void pixels_from_yuv422(const uint8_t *in, size_t stride, bool luma_first, const struct yuv_layout *layout,
                        uint8_t *rgb);

// A plane of Y and a half-size plane of Cb Cr pairs (NV12).
void pixels_from_nv12(const uint8_t *luma, size_t luma_stride, const uint8_t *chroma, size_t chroma_stride,
                      const struct yuv_layout *layout, uint8_t *rgb);

#ifdef __cplusplus
}
#endif
