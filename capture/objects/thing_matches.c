#include "capture/objects/thing_matches.h"

// Farther apart than this is chance: unrelated SIFT descriptors (of length 512) are about 500 apart. Chosen by hand.
#define FARTHEST2 (400.0F * 400.0F)

typedef float four __attribute__((vector_size(16), aligned(4), may_alias));

// The sums are of whole numbers below 2^24 and so exact in any order and vector width.
static float distance2(const float *a, const float *b)
{
    four sum[4] = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < SCALE_FEATURE_DIMENSIONS; i += 16)
        for (int k = 0; k < 4; k++) {
            const four d = *(const four *)(const void *)(a + i + 4 * k) - *(const four *)(const void *)(b + i + 4 * k);
            sum[k] += d * d;
        }
    const four s = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    return (s[0] + s[1]) + (s[2] + s[3]);
}

int thing_matches(const struct thing_model *m, const struct thing_view *v, struct thing_match *out, int capacity)
{
    int count = 0;
    for (int c = 0; c < MODEL_CHANNELS; c++)
        for (int i = 0; i < m->feature_count[c]; i++) {
            struct thing_match best[2] = {{NULL, NULL, FARTHEST2}, {NULL, NULL, FARTHEST2}};
            for (int k = 0; k < v->feature_count[c]; k++) {
                const float d = distance2(m->features[c][i].descriptor, v->features[c][k].descriptor);
                if (d >= best[1].distance2)
                    continue;
                const struct thing_match now = {&m->features[c][i], &v->features[c][k], d};
                if (d < best[0].distance2) {
                    best[1] = best[0];
                    best[0] = now;
                } else {
                    best[1] = now;
                }
            }
            for (int k = 0; k < 2 && count < capacity; k++)
                if (best[k].scene)
                    out[count++] = best[k];
        }
    return count;
}
