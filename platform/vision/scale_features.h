// Features with a scale and an orientation, invariant to both: SIFT (Lowe 2004; OpenCV). Pure; any thread may call.
#pragma once
#include "base/lens.h"

#ifdef __cplusplus
extern "C" {
#endif

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
