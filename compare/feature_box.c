#include "compare/feature_box.h"

#include <string.h>

struct feature_box feature_box_of(const struct features *features, int32_t first, int32_t end)
{
    struct feature_box box;
    memcpy(box.low, features->frames[first].number, sizeof box.low);
    memcpy(box.high, features->frames[first].number, sizeof box.high);
    for (int32_t i = first + 1; i < end; i++)
        for (int n = 0; n < FEATURE_NUMBERS; n++) {
            const int16_t x = features->frames[i].number[n];
            box.low[n] = x < box.low[n] ? x : box.low[n];
            box.high[n] = x > box.high[n] ? x : box.high[n];
        }
    return box;
}

int32_t feature_box_cost(const struct feature_box *a, const struct feature_box *b)
{
    int32_t sum = 0;
    for (int n = 0; n < FEATURE_NUMBERS; n++) {
        const int16_t below = (int16_t)(a->low[n] - b->high[n]), above = (int16_t)(b->low[n] - a->high[n]);
        int16_t d = below > above ? below : above;
        d = d > 0 ? d : 0;
        sum += d * d;
    }
    return sum;
}
