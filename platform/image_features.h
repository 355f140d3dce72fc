// Natural features of a picture: FAST corners with ORB descriptors (OpenCV),
// spread over the whole picture. Deterministic.
#pragma once
#include "base/lens.h"

#ifdef __cplusplus
extern "C" {
#endif

struct feature {
    struct pixel at; // centre of the top-left pixel is (0, 0)
    float scale;     // 1 at full size, 1.2, 1.44 ... in smaller copies of the picture
    // How brightness slopes around it, as coarse as the copy: mean of the slope's xx, xy, yy. Along an edge it does
    // not, and there the feature may slide.
    float slope[3];
    uint8_t descriptor[32];
};

// gray: width * height bytes. Writes at most `capacity` features, best first in
// each part of the picture; *count is how many. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status features_detect(const uint8_t *gray, int width, int height, struct feature *out, int capacity,
                                       int *count);

// The same in one part of the picture, of width x height pixels from (left, top), by itself, at half
// as many scales: half of the time that the same part of the whole picture takes. `at` is of the whole
// picture, whose rows are `stride` bytes apart.
MUST_CHECK enum status features_detect_region(const uint8_t *gray, int stride, int left, int top, int width, int height,
                                              struct feature *out, int capacity, int *count);

// How many of the 256 bits differ. Counted side by side in ever wider fields (Warren, Hacker's Delight):
// not every processor that this is built for has an instruction for it.
static inline int feature_distance(const uint8_t a[32], const uint8_t b[32])
{
    const uint64_t ones = 0x5555555555555555u, twos = 0x3333333333333333u, fours = 0x0f0f0f0f0f0f0f0fu;
    uint64_t bytes = 0; // at most 32 in each
    for (int i = 0; i < 32; i += 8) {
        uint64_t x, y;
        __builtin_memcpy(&x, a + i, 8);
        __builtin_memcpy(&y, b + i, 8);
        x ^= y;
        x -= x >> 1 & ones;
        x = (x & twos) + (x >> 2 & twos);
        bytes += (x + (x >> 4)) & fours;
    }
    bytes = (bytes & 0x00ff00ff00ff00ffu) + (bytes >> 8 & 0x00ff00ff00ff00ffu);
    return (int)(bytes * 0x0001000100010001u >> 48);
}

#ifdef __cplusplus
}
#endif
