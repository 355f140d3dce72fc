// Features of a grey image: FAST corners with ORB descriptors (Rublee et al. 2011; OpenCV), spread over the image.
// Deterministic. Pure; any thread may call.
#pragma once
#include "base/lens.h"

#ifdef __cplusplus
extern "C" {
#endif

struct feature {
    struct pixel at; // centre of the top-left pixel is (0, 0)
    float scale;     // of its pyramid level: 1 at full size, 1.2, 1.44 ...
    // Structure tensor at that level: weighted mean of the gradient's xx, xy, yy, grey levels squared. Where it has one
    // small eigenvalue (an edge), the position is uncertain along the edge.
    float slope[3];
    uint8_t descriptor[32];
};

// gray: width * height bytes. Writes at most `capacity` features, the strongest of each cell of about 40 pixels; *count
// is their number. ERR_MEMORY; ERR_SOLVER: OpenCV failed.
MUST_CHECK enum status features_detect(const uint8_t *gray, int width, int height, struct feature *out, int capacity,
                                       int *count);

struct image_region {
    int left, top, width, height; // pixels
};

// The same in a region of an image with rows `stride` bytes apart, at half as many pyramid levels, in half the time
// that this region takes in features_detect. `at` is in pixels of the whole image.
MUST_CHECK enum status features_detect_region(const uint8_t *gray, int stride, const struct image_region *region,
                                              struct feature *out, int capacity, int *count);

// Hamming distance of two descriptors, 0..256 bits: parallel bit count in ever wider fields (Warren, Hacker's Delight),
// because not every target processor has a population-count instruction.
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

// ---------------------------------------------------------------- features with a scale

// Features with a scale and an orientation, invariant to both: SIFT (Lowe 2004; OpenCV). Pure; any thread may call.

enum { SCALE_FEATURE_DIMENSIONS = 128 };

struct scale_feature {
    struct pixel at;                              // centre of the top-left pixel is (0, 0)
    float size_px;                                // diameter of what it describes
    float angle;                                  // radians, clockwise in the image
    int16_t descriptor[SCALE_FEATURE_DIMENSIONS]; // whole numbers 0..255, signed so that they can be subtracted
};

// plane: width * height bytes, one channel of an image. Writes at most `capacity` features, the strongest; *count is
// their number. ERR_MEMORY; ERR_SOLVER: OpenCV failed.
MUST_CHECK enum status scale_features_detect(const uint8_t *plane, int width, int height, struct scale_feature *out,
                                             int capacity, int *count);

#ifdef __cplusplus
}
#endif
