// A weighed quantile over a window that slides along a series: values are kept sorted, those of equal value in the
// order of their frames, so that the result has the bits of sorting each window anew by a stable sort.
#pragma once
#include <stdint.h>

enum { SLIDING_MOST = 61 };

struct sliding_quantile {
    struct sliding_value {
        float value, weight;
        int32_t frame;
    } at[SLIDING_MOST];
    int32_t count; // 0: empty
};

// At most SLIDING_MOST values; no NaN; a frame once.
void sliding_add(struct sliding_quantile *s, int32_t frame, float value, float weight);
void sliding_remove(struct sliding_quantile *s, int32_t frame); // one that is not in it is fine

// The value below which `share` of the weight is. sum: of the weights, added in the order of the frames. NaN: empty.
double sliding_quantile_of(const struct sliding_quantile *s, double sum, double share);
