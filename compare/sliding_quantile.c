#include "compare/sliding_quantile.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

static bool is_before(const struct sliding_value *a, const struct sliding_value *b)
{
    return a->value < b->value || (!(a->value > b->value) && a->frame < b->frame);
}

void sliding_add(struct sliding_quantile *s, int32_t frame, float value, float weight)
{
    const struct sliding_value added = {value, weight, frame};
    assert(s->count < SLIDING_MOST);
    int32_t at = s->count++;
    for (; at > 0 && is_before(&added, &s->at[at - 1]); at--)
        s->at[at] = s->at[at - 1];
    s->at[at] = added;
}

void sliding_remove(struct sliding_quantile *s, int32_t frame)
{
    for (int32_t k = 0; k < s->count; k++)
        if (s->at[k].frame == frame) {
            memmove(&s->at[k], &s->at[k + 1], (size_t)(s->count - k - 1) * sizeof s->at[k]);
            s->count--;
            return;
        }
}

double sliding_quantile_of(const struct sliding_quantile *s, double sum, double share)
{
    double before = 0;
    for (int32_t k = 0; k < s->count; k++) {
        before += s->at[k].weight;
        if (before >= share * sum)
            return s->at[k].value;
    }
    return NAN;
}
