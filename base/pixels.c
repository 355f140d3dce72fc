#include "base/pixels.h"

#include "base/clamp.h"

#include <stddef.h>

// ---------------------------------------------------------------- image shrink

void image_shrink(const uint8_t *in, int width, int height, uint8_t *out, int w, int h)
{
    for (int y = 0; y < h; y++) {
        const int top = (int)((int64_t)y * height / h), bottom = (int)((int64_t)(y + 1) * height / h);
        for (int x = 0; x < w; x++) {
            const int left = (int)((int64_t)x * width / w), right = (int)((int64_t)(x + 1) * width / w);
            uint64_t sum[3] = {0};
            for (int v = top; v < bottom; v++)
                for (int u = left; u < right; u++)
                    for (int c = 0; c < 3; c++)
                        sum[c] += in[3 * ((size_t)v * (size_t)width + (size_t)u) + (size_t)c];
            const uint64_t count = (uint64_t)(bottom - top) * (uint64_t)(right - left);
            for (int c = 0; c < 3; c++)
                out[3 * ((size_t)y * (size_t)w + (size_t)x) + (size_t)c] = (uint8_t)(sum[c] / count);
        }
    }
}

// ---------------------------------------------------------------- pixels

// ITU-R BT.601 and BT.709; those of the narrow range include the factors 255/219 and 255/224.
struct yuv_coefficients yuv_coefficients_of(struct yuv_encoding encoding)
{
    static const struct yuv_coefficients table[2][2] = {
        {{76309, 104597, 25675, 53279, 132201, 16}, {65536, 91881, 22554, 46802, 116130, 0}},
        {{76309, 117489, 13975, 34925, 138438, 16}, {65536, 103206, 12276, 30679, 121609, 0}},
    };
    return table[encoding.matrix == YUV_BT709][encoding.full_range];
}

static uint8_t clamp(int32_t value) // 16.16 fixed point, rounded half up
{
    return (uint8_t)clamp_int((value + 32768) >> 16, 0, 255);
}

static void store_rgb(const struct yuv_coefficients *coefficients, int y, int cb, int cr, uint8_t rgb[3])
{
    int32_t luma = coefficients->y * (y - coefficients->y_zero);
    rgb[0] = clamp(luma + coefficients->r_cr * (cr - 128));
    rgb[1] = clamp(luma - coefficients->g_cb * (cb - 128) - coefficients->g_cr * (cr - 128));
    rgb[2] = clamp(luma + coefficients->b_cb * (cb - 128));
}

void pixels_from_packed(const uint8_t *in, size_t stride, enum packed_order order, int width, int height, uint8_t *rgb)
{
    int step = order == PACKED_RGBX || order == PACKED_BGRX ? 4 : 3;
    int red = order == PACKED_BGR || order == PACKED_BGRX ? 2 : 0;
    for (int y = 0; y < height; y++, in += stride)
        for (int x = 0; x < width; x++, rgb += 3) {
            const uint8_t *pixel = in + x * step;
            rgb[0] = pixel[red];
            rgb[1] = pixel[1];
            rgb[2] = pixel[2 - red];
        }
}

void pixels_from_yuv422(const uint8_t *in, size_t stride, bool luma_first, const struct yuv_layout *layout,
                        uint8_t *rgb)
{
    const int width = layout->width, height = layout->height;
    assert(width % 2 == 0);
    struct yuv_coefficients c = yuv_coefficients_of(layout->encoding);
    int luma = luma_first ? 0 : 1, chroma = 1 - luma;
    for (int y = 0; y < height; y++, in += stride)
        for (int x = 0; x < width; x += 2, rgb += 6) {
            const uint8_t *pair = in + 2 * x;
            store_rgb(&c, pair[luma], pair[chroma], pair[chroma + 2], rgb);
            store_rgb(&c, pair[luma + 2], pair[chroma], pair[chroma + 2], rgb + 3);
        }
}

void pixels_from_nv12(const uint8_t *luma, size_t luma_stride, const uint8_t *chroma, size_t chroma_stride,
                      const struct yuv_layout *layout, uint8_t *rgb)
{
    const int width = layout->width, height = layout->height;
    assert(width % 2 == 0 && height % 2 == 0);
    struct yuv_coefficients c = yuv_coefficients_of(layout->encoding);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++, rgb += 3) {
            const uint8_t *pair = chroma + (size_t)(y / 2) * chroma_stride + x / 2 * 2;
            store_rgb(&c, luma[(size_t)y * luma_stride + (size_t)x], pair[0], pair[1], rgb);
        }
}
