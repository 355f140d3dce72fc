// Pictures as cameras deliver them, turned into RGB with 8 bits and rows
// without padding. Integer arithmetic only: the same bytes give the same
// pixels on every machine. Pure functions, safe from any thread.
#pragma once
#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// How Y, Cb and Cr become R, G and B.
enum yuv_matrix { YUV_BT601, YUV_BT709 };
struct yuv_encoding {
    enum yuv_matrix matrix;
    bool full_range; // Y 0..255; else Y 16..235, Cb and Cr 16..240
};

// The same in numbers, times 2^16 but for y_zero. With Y less y_zero, Cb and Cr less 128:
// R = y Y + r_cr Cr, G = y Y - g_cb Cb - g_cr Cr, B = y Y + b_cb Cb, each rounded half up, then clamped to 0..255.
struct yuv_coefficients {
    int32_t y, r_cr, g_cb, g_cr, b_cb, y_zero;
};
struct yuv_coefficients yuv_coefficients_of(struct yuv_encoding encoding);

// Where a pixel's parts are within its bytes, first to last.
enum packed_order { PACKED_RGB, PACKED_BGR, PACKED_RGBX, PACKED_BGRX };

// stride: bytes from one row to the next in `in`.
void pixels_from_packed(const uint8_t *in, size_t stride, enum packed_order order, int width, int height, uint8_t *rgb);

// Two pixels in four bytes; luma_first: Y0 Cb Y1 Cr (YUYV), else Cb Y0 Cr Y1 (UYVY). width is even.
void pixels_from_yuv422(const uint8_t *in, size_t stride, bool luma_first, struct yuv_encoding encoding, int width,
                        int height, uint8_t *rgb);

// A plane of Y and a half-size plane of Cb Cr pairs (NV12). width and height are even.
void pixels_from_nv12(const uint8_t *luma, size_t luma_stride, const uint8_t *chroma, size_t chroma_stride,
                      struct yuv_encoding encoding, int width, int height, uint8_t *rgb);

#ifdef __cplusplus
}
#endif
