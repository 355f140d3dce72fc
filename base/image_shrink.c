#include "base/image_shrink.h"

#include <stddef.h>

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
