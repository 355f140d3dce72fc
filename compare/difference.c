#include "compare/difference.h"

#include "base/portable_math.h"

#include <stdlib.h>

const char *verdict_name(enum verdict v)
{
    switch (v) {
    case VERDICT_SAME: return "same";
    case VERDICT_DIFFERENT: return "different";
    case VERDICT_UNKNOWN: break;
    }
    return "unknown";
}

enum verdict verdict_of(double angle_rad, double sigma_rad)
{
    const double quantile = 0.706; // of the normal distribution, for VERDICT_LEVEL
    const double most_sigma = 1.5 * DIFFERENT_RAD;
    if (!(sigma_rad >= 0 && sigma_rad <= most_sigma) || !isfinite(angle_rad))
        return VERDICT_UNKNOWN;
    if (angle_rad - quantile * sigma_rad >= DIFFERENT_RAD)
        return VERDICT_DIFFERENT;
    return angle_rad + quantile * sigma_rad < DIFFERENT_RAD ? VERDICT_SAME : VERDICT_UNKNOWN;
}

void timeline_free(struct timeline *t)
{
    free(t->reference);
    *t = (struct timeline){0};
}

// The frame of A for the pairs first .. end - 1, which share one frame of B.
static float reference_of(const struct alignment *x, int32_t first, int32_t end, const struct features *a,
                          const struct features *b)
{
    enum { SHORT = 6 };
    if (end - first <= SHORT)
        return 0.5f * (float)(x->pairs[first].a + x->pairs[end - 1].a);
    int32_t best = first, least = INT32_MAX;
    for (int32_t k = first; k < end; k++) {
        const int32_t c = feature_cost(&a->frames[x->pairs[k].a], &b->frames[x->pairs[k].b]);
        if (c < least) {
            least = c;
            best = k;
        }
    }
    return (float)x->pairs[best].a;
}

// A mean over 5 frames, except where the path jumps.
static void smooth(struct timeline *t, const float *raw)
{
    for (int32_t j = 0; j < t->count; j++) {
        float sum = 0;
        int used = 0;
        for (int k = 1; k <= 2; k++) {
            if (j - k < 0 || j + k >= t->count || isnan(raw[j - k]) || isnan(raw[j + k]))
                break;
            if (raw[j + k] - raw[j - k] > 6 * k + 4)
                break;
            sum += raw[j - k] + raw[j + k];
            used += 2;
        }
        t->reference[j] = (sum + raw[j]) / (float)(used + 1);
    }
}

enum status timeline_from_alignment(const struct alignment *x, const struct features *a, const struct features *b,
                                    struct timeline *out)
{
    out->count = b->count;
    out->reference = malloc((size_t)b->count * sizeof *out->reference);
    float *raw = malloc((size_t)b->count * sizeof *raw);
    if (!out->reference || !raw) {
        free(raw);
        timeline_free(out);
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    }
    for (int32_t j = 0; j < b->count; j++)
        raw[j] = NAN;
    for (int32_t first = 0, end; first < x->count; first = end) {
        for (end = first + 1; end < x->count && x->pairs[end].b == x->pairs[first].b;)
            end++;
        raw[x->pairs[first].b] = reference_of(x, first, end, a, b);
    }
    smooth(out, raw);
    free(raw);
    return OK;
}

struct movement_frame movement_at(const struct movement *m, double frame)
{
    frame = fmax(0, fmin(m->count - 1, frame));
    const int32_t i = (int32_t)frame, k = i + 1 < m->count ? i + 1 : i;
    const float t = (float)(frame - i);
    const struct movement_frame *a = &m->frames[i], *b = &m->frames[k];
    struct movement_frame out = *a;
    if (t == 0)
        return out;
    out.known = a->known & b->known;
    out.heading = a->heading + t * (b->heading - a->heading);
    for (int p = 0; p <= PART_COUNT; p++) {
        const float *x = p < PART_COUNT ? a->direction[p] : a->shoulders,
                    *y = p < PART_COUNT ? b->direction[p] : b->shoulders;
        float *to = p < PART_COUNT ? out.direction[p] : out.shoulders;
        float length2 = 0;
        for (int k2 = 0; k2 < 3; k2++) {
            to[k2] = x[k2] + t * (y[k2] - x[k2]);
            length2 += to[k2] * to[k2];
        }
        for (int k2 = 0; k2 < 3 && length2 > 1e-12f; k2++)
            to[k2] /= sqrtf(length2);
        if (p < PART_COUNT)
            out.sigma[p] = a->sigma[p] > b->sigma[p] ? a->sigma[p] : b->sigma[p];
    }
    return out;
}

enum { AVERAGE_HALF = 2 };

void part_differences(const struct movement *a, const struct movement *b, const struct timeline *t, int32_t frame,
                      struct part_difference out[PART_COUNT])
{
    double sum[PART_COUNT][3] = {{0}};
    int used[PART_COUNT] = {0};
    for (int p = 0; p < PART_COUNT; p++)
        out[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
    if (isnan(t->reference[frame]))
        return;
    for (int32_t f = frame - AVERAGE_HALF; f <= frame + AVERAGE_HALF; f++) {
        if (f < 0 || f >= t->count || isnan(t->reference[f]))
            continue;
        const struct movement_frame x = movement_at(a, t->reference[f]), *y = &b->frames[f];
        for (int p = 0; p < PART_COUNT; p++) {
            if (!(x.known & y->known & 1u << p))
                continue;
            for (int k = 0; k < 3; k++)
                sum[p][k] += (double)y->direction[p][k] - x.direction[p][k];
            used[p]++;
            if (f == frame)
                out[p].sigma_rad = (float)sqrt((double)x.sigma[p] * x.sigma[p] + (double)y->sigma[p] * y->sigma[p]);
        }
    }
    for (int p = 0; p < PART_COUNT; p++) {
        if (isnan(out[p].sigma_rad))
            continue;
        const double chord = sqrt(sum[p][0] * sum[p][0] + sum[p][1] * sum[p][1] + sum[p][2] * sum[p][2]) / used[p];
        const double angle = 2 * portable_asin(fmin(1, 0.5 * chord)), sigma = out[p].sigma_rad;
        out[p].angle_rad = (float)sqrt(fmax(0, angle * angle - sigma * sigma));
        out[p].verdict = verdict_of(out[p].angle_rad, out[p].sigma_rad);
    }
}
