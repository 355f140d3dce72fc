#include "compare/score.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

static const double DEGREE = 3.14159265358979323846 / 180;

// Chosen as score.h says.
static const double OFFSET_SHARE = 0.5, UPPER_QUANTILE = 0.75, UPPER_SHARE = 0.8, MIN_WEIGHT_DEGREES = 3;
static const double HALF_SCORE_DEGREES = 20, STEEPNESS = 1.5;
// By hand: a movement of which a third is missing has the score of one that is 20 degrees off.
static const double MISSING_DEGREES = 60, EXTRA_DEGREES = 40, TIMING_DEGREES_PER_S = 8;

double score_from_terms(const struct score_terms *terms)
{
    bool any = false;
    for (int p = 0; p < PART_COUNT; p++)
        any = any || terms->weight[p] > 0;
    if (!any)
        return 0;
    const double degrees = terms->posture_rad / DEGREE + MISSING_DEGREES * terms->missing_share +
                           EXTRA_DEGREES * terms->extra_share + TIMING_DEGREES_PER_S * fmin(terms->timing_s, 2);
    return 100 / (1 + portable_pow(degrees / HALF_SCORE_DEGREES, STEEPNESS));
}

enum { BINS = 1024 }; // of a chord from 0 to 2

struct part_sums {
    int64_t count;
    double difference[3], direction[3], square; // of B - A; of A
    double mean;                                // chord without the offset's share
    int32_t bin[BINS];
};

static void add_difference(struct part_sums *sums, const struct movement_frame *x, const struct movement_frame *y,
                           int p)
{
    sums->count++;
    for (int k = 0; k < 3; k++) {
        sums->difference[k] += (double)y->direction[p][k] - x->direction[p][k];
        sums->direction[k] += x->direction[p][k];
    }
}

static void measure_chord(struct part_sums *sums, const struct movement_frame *x, const struct movement_frame *y, int p)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double d =
            (double)y->direction[p][k] - x->direction[p][k] - OFFSET_SHARE * sums->difference[k] / (double)sums->count;
        sum += d * d;
    }
    const double chord = sqrt(sum);
    sums->mean += chord / (double)sums->count;
    sums->bin[(int)fmin(BINS - 1, chord * 0.5 * BINS)]++;
}

// Linear within the bin; of nothing but bin 0 the mean, so that equal movements have exactly 0.
static double chord_quantile(const struct part_sums *sums)
{
    const double wanted = UPPER_QUANTILE * (double)sums->count;
    double before = 0;
    for (int i = 0; i < BINS; i++) {
        if (before + sums->bin[i] >= wanted)
            return i ? (i + (wanted - before) / sums->bin[i]) * 2 / BINS : fmin(sums->mean, 2.0 / BINS);
        before += sums->bin[i];
    }
    return 2;
}

static void weigh_parts(const struct part_sums *sums, const double *reference_moved, struct score_terms *out)
{
    double weight_sum = 0, sum = 0;
    int64_t max = 0;
    for (int p = 0; p < PART_COUNT; p++)
        max = sums[p].count > max ? sums[p].count : max;
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_sums *s = &sums[p];
        out->part_rad[p] = NAN;
        if (!s->count || 10 * s->count < max)
            continue;
        double mean2 = 0;
        for (int k = 0; k < 3; k++)
            mean2 += s->direction[k] * s->direction[k] / ((double)s->count * (double)s->count);
        // Directions are unit vectors: their variance is one less the square of their mean.
        const double moved = reference_moved ? reference_moved[p] : sqrt(fmax(0, 1 - mean2));
        out->part_rad[p] = (1 - UPPER_SHARE) * s->mean + UPPER_SHARE * chord_quantile(s);
        out->weight[p] = moved + MIN_WEIGHT_DEGREES * DEGREE;
        weight_sum += out->weight[p];
        sum += out->weight[p] * out->part_rad[p];
    }
    out->posture_rad = weight_sum > 0 ? sum / weight_sum : 0;
    for (int p = 0; p < PART_COUNT && weight_sum > 0; p++)
        out->weight[p] /= weight_sum;
}

enum status score_posture(const struct movement *a, const struct movement *b, const struct alignment *x,
                          const struct score_scope *scope, struct score_terms *out)
{
    struct part_sums *sums = calloc(PART_COUNT, sizeof *sums);
    *out = (struct score_terms){0};
    if (!sums)
        return fail(ERR_MEMORY, "no memory to score a movement");
    for (int pass = 0; pass < 2; pass++)
        for (int32_t k = 0; k < x->count; k++) {
            if (x->pairs[k].b < scope->first || x->pairs[k].b >= scope->end)
                continue;
            const struct movement_frame *in_a = &a->frames[x->pairs[k].a], *in_b = &b->frames[x->pairs[k].b];
            for (int p = 0; p < PART_COUNT; p++)
                if (in_a->known & in_b->known & 1u << p)
                    (pass ? measure_chord : add_difference)(&sums[p], in_a, in_b, p);
        }
    weigh_parts(sums, scope->moved, out);
    free(sums);
    return OK;
}
