#include "objects/thing_matches.h"

// Farther apart than this is chance: unrelated SIFT descriptors (of length 512) are about 500 apart. Chosen by hand.
enum { FARTHEST2 = 400 * 400 };

// Where most of the time goes. Compilers have one instruction for eight such products and their sums, but not between
// a sanitizer's checks of each.
__attribute__((no_sanitize("address", "undefined"))) static int32_t distance2(const int16_t *a, const int16_t *b)
{
    int32_t sum = 0;
    for (int i = 0; i < SCALE_FEATURE_DIMENSIONS; i++) {
        const int16_t d = (int16_t)(a[i] - b[i]);
        sum += d * d;
    }
    return sum;
}

int thing_matches(const struct thing_model *m, const struct thing_view *v, struct thing_match *out, int capacity)
{
    int count = 0;
    for (int c = 0; c < MODEL_CHANNELS; c++)
        for (int i = 0; i < m->feature_count[c]; i++) {
            struct thing_match best[2] = {{NULL, NULL, FARTHEST2}, {NULL, NULL, FARTHEST2}};
            for (int k = 0; k < v->feature_count[c]; k++) {
                const int32_t d = distance2(m->features[c][i].descriptor, v->features[c][k].descriptor);
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
