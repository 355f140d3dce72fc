// Natural features of a picture: FAST corners with ORB descriptors (OpenCV),
// spread over the whole picture. Deterministic.
#pragma once
#include "platform/lens.h"

#ifdef __cplusplus
extern "C" {
#endif

struct feature {
    struct pixel at; // centre of the top-left pixel is (0, 0)
    float scale;     // 1 at full size, 1.2, 1.44 ... in smaller copies of the picture
    uint8_t descriptor[32];
};

// gray: width * height bytes. Writes at most `capacity` features, best first in
// each part of the picture; *count is how many. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status features_find(const uint8_t *gray, int width, int height, struct feature *out, int capacity,
                                     int *count);

// The same in one part of the picture, of width x height pixels from (left, top), by itself, at half
// as many scales: a third of the time that the same part of the whole picture takes. `at` is of the whole picture, whose rows are
// `stride` bytes apart.
MUST_CHECK enum status features_find_in(const uint8_t *gray, int stride, int left, int top, int width, int height,
                                        struct feature *out, int capacity, int *count);

// How many of the 256 bits differ.
static inline int feature_distance(const uint8_t a[32], const uint8_t b[32])
{
    int bits = 0;
    for (int i = 0; i < 32; i += 8) {
        uint64_t x, y;
        __builtin_memcpy(&x, a + i, 8);
        __builtin_memcpy(&y, b + i, 8);
        bits += __builtin_popcountll(x ^ y);
    }
    return bits;
}

#ifdef __cplusplus
}
#endif
