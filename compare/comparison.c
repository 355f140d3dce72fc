#include "compare/comparison.h"

#include "compare/findings.h"

#include "base/threads.h"

#include <stdlib.h>

// Prices of alignment.h as mean squared chords of a part's direction. A frame is left out at an end where it is more
// than 32 degrees off in every part; cheaper, and what is wrong would be left out instead of judged (chosen
// on UI-PRMD and KIMORE as score.h's constants). Getting into position is taken out afterwards (repetitions.h). A step
// that only one movement takes costs what 8 degrees do; by hand.
static const double SKIP = 0.3, STEP = 0.02;
// By hand: B is taken for a mirror image if that fits to 0.75 of the price, and B itself is worse than 8 degrees off.
static const double MIRROR_GAIN = 0.75, MIRROR_LEAST = 0.02;

// scale: of each part's numbers; NULL: 1.
static double price_unit(uint16_t parts, const double *scale)
{
    double count = 0;
    for (int p = 0; p < PART_COUNT; p++)
        count += (parts >> p & 1) * (scale ? scale[p] * scale[p] : 1);
    return count * FEATURE_UNIT * FEATURE_UNIT;
}

static struct alignment_prices prices_for(uint16_t parts, const double *scale)
{
    const double unit = price_unit(parts, scale);
    return (struct alignment_prices){(int32_t)(SKIP * unit), (int32_t)(SKIP * unit), (int32_t)(STEP * unit)};
}

static enum status align_movements(const struct movement *a, const struct movement *b, uint16_t parts,
                                   const double *scale, struct alignment *x, struct timeline *timeline)
{
    struct feature_frame *fa = NULL, *fb = NULL;
    const struct alignment_prices prices = prices_for(parts, scale);
    enum status status = movement_features(a, parts, scale, &fa);
    if (status == OK)
        status = movement_features(b, parts, scale, &fb);
    const struct features features_a = {fa, a->count}, features_b = {fb, b->count};
    if (status == OK)
        status = align(&features_a, &features_b, &prices, x);
    if (status == OK && timeline)
        status = timeline_from_alignment(x, &features_a, &features_b, timeline);
    free(fa);
    free(fb);
    return status;
}

static bool mean_direction(const struct movement *m, int p, double mean[3])
{
    double count = 0;
    mean[0] = mean[1] = mean[2] = 0;
    for (int32_t f = 0; f < m->count; f++) {
        if (!(m->frames[f].known >> p & 1))
            continue;
        for (int k = 0; k < 3; k++)
            mean[k] += m->frames[f].direction[p][k];
        count++;
    }
    for (int k = 0; k < 3 && count > 0; k++)
        mean[k] /= count;
    return count > 0;
}

// Parts that say something of the time: not those that point elsewhere all along (on average more than 90 degrees off),
// such as a head that a tracker has upside down. All of them where few would remain.
static uint16_t telling_parts(const struct movement *a, const struct movement *b, uint16_t parts)
{
    enum { FEW = 4, MOST = 2 }; // MOST: a squared chord
    uint16_t telling = 0;
    int count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        double x[3], y[3], sum = 0;
        if (!(parts >> p & 1) || !mean_direction(a, p, x) || !mean_direction(b, p, y))
            continue;
        for (int k = 0; k < 3; k++)
            sum += (x[k] - y[k]) * (x[k] - y[k]);
        telling |= (uint16_t)((sum <= MOST) << p);
        count += sum <= MOST;
    }
    return count >= FEW ? telling : parts;
}

// Once with all parts at their full size, for the score; once with an equal say for each part that moves, for the
// times.
// One alignment for the score, one, in which each part has an equal say, for the timeline.
struct both_alignments {
    struct comparison *c;
    uint16_t parts;
    double scale[PART_COUNT];
    struct alignment equal;
    struct failure failure[2];
};

static void align_one(void *context, int which)
{
    struct both_alignments *both = context;
    struct comparison *c = both->c;
    failure_keep(&both->failure[which],
                 which == 0 ? align_movements(&c->a, &c->judged, both->parts, NULL, &c->alignment, NULL)
                            : align_movements(&c->a, &c->judged, both->parts, both->scale, &both->equal, &c->timeline));
}

static enum status align_both(struct comparison *c)
{
    struct both_alignments both = {.c = c, .parts = telling_parts(&c->a, &c->judged, c->parts)};
    movement_equal_say(&c->a, both.scale);
    parallel_for(2, 2, align_one, &both);
    alignment_free(&both.equal);
    return failure_restore(&both.failure[both.failure[0].status == OK]);
}

enum { COARSE = 4 }; // every so manieth frame decides about mirroring

static int32_t thin(struct feature_frame *f, int32_t count)
{
    int32_t kept = 0;
    for (int32_t i = 0; i < count; i += COARSE)
        f[kept++] = f[i];
    return kept;
}

// The mean price of a frame in coarse steps, as a mean squared chord.
static enum status coarse_price(const struct movement *a, const struct movement *b, uint16_t parts, double *price)
{
    struct feature_frame *fa = NULL, *fb = NULL;
    struct alignment x = {0};
    const struct alignment_prices prices = prices_for(parts, NULL);
    enum status status = movement_features(a, parts, NULL, &fa);
    if (status == OK)
        status = movement_features(b, parts, NULL, &fb);
    if (status == OK) {
        const struct features features_a = {fa, thin(fa, a->count)}, features_b = {fb, thin(fb, b->count)};
        status = align(&features_a, &features_b, &prices, &x);
        *price = (double)x.price / price_unit(parts, NULL) / (features_a.count + features_b.count);
    }
    alignment_free(&x);
    free(fa);
    free(fb);
    return status;
}

static uint16_t mirrored_parts(uint16_t parts)
{
    uint16_t out = 0;
    for (int p = 0; p < PART_COUNT; p++)
        out |= (uint16_t)((parts >> p & 1) << mirrored_part((enum part)p));
    return out;
}

// Judged as B or as its mirror image, whichever resembles A.
static enum status choose_side(struct comparison *c)
{
    struct movement mirror = {0};
    double plain = 0, mirrored = 0;
    // Parts that are known on both sides of both: a missing limb must not decide.
    const uint16_t both = c->parts & mirrored_parts(c->parts);
    enum status status = movement_mirror(&c->b, &mirror);
    if (status == OK && both) {
        const uint16_t telling = telling_parts(&c->a, &c->b, both) & telling_parts(&c->a, &mirror, both);
        status = coarse_price(&c->a, &c->b, telling ? telling : both, &plain);
        if (status == OK)
            status = coarse_price(&c->a, &mirror, telling ? telling : both, &mirrored);
    }
    if (status == OK && plain > MIRROR_LEAST && mirrored < MIRROR_GAIN * plain) {
        c->mirrored = true;
        c->judged = mirror;
        c->parts = c->a.ever_known & mirror.ever_known;
        return OK;
    }
    movement_free(&mirror);
    if (status == OK)
        c->judged = c->b;
    return status;
}

static enum status judge(struct comparison *c)
{
    enum status status = align_both(c);
    if (status == OK)
        status = pace_measure(&c->a, &c->judged, c->parts, &c->timeline, &c->pace);
    if (status == OK)
        status = body_angle_ranges(&c->a, c->pace.a_first, c->pace.a_end, c->range_a);
    if (status == OK)
        status = body_angle_ranges(&c->judged, c->pace.b_first, c->pace.b_end, c->range_b);
    const struct alignment_prices prices = prices_for(c->parts, NULL);
    if (status == OK)
        status = judge_repetitions(&c->a, &c->judged, c->parts, &prices, &c->repetitions);
    const struct score_scope scope = {0, c->judged.count,
                                      c->repetitions.reference_count >= 2 ? c->repetitions.moved : NULL};
    if (status == OK)
        status = score_posture(&c->a, &c->judged, &c->alignment, &scope, &c->terms);
    if (status != OK)
        return status;
    // Of repetitions there may be more or fewer, with rests between them: they say nothing of one performance's time.
    // Each is judged against the one that it resembles most. That may be worse than the whole, where the cycles of the
    // two begin at different places.
    if (c->repetitions.count >= 2 && c->repetitions.reference_count >= 2) {
        double mean = 0;
        for (int32_t k = 0; k < c->repetitions.count; k++)
            mean += c->repetitions.at[k].terms.posture_rad / c->repetitions.count;
        c->terms.posture_rad = fmin(c->terms.posture_rad, mean);
        c->score = score_from_terms(&c->terms);
        return findings_make(c);
    }
    const double a = c->pace.a_end - c->pace.a_first + c->pace.missing, b = c->pace.b_end - c->pace.b_first;
    c->terms.missing_share = fmin(1, c->pace.missing / fmax(1, a));
    c->terms.extra_share = fmin(1, c->pace.extra / fmax(1, b));
    c->terms.timing_s = c->pace.uneven_s;
    c->score = score_from_terms(&c->terms);
    return findings_make(c);
}

enum status comparison_make(struct movement *a, struct movement *b, struct comparison *out)
{
    *out = (struct comparison){.a = *a, .b = *b, .parts = a->ever_known & b->ever_known};
    *a = *b = (struct movement){0};
    enum status status = OK;
    if (!out->parts)
        status = fail(ERR_INPUT, "no part of the body is known in both movements, so there is nothing to compare");
    if (status == OK)
        status = choose_side(out);
    if (status == OK)
        status = judge(out);
    if (status != OK)
        comparison_free(out);
    return status;
}

void comparison_free(struct comparison *c)
{
    movement_free(&c->a);
    movement_free(&c->b);
    if (c->mirrored)
        movement_free(&c->judged);
    alignment_free(&c->alignment);
    timeline_free(&c->timeline);
    pace_free(&c->pace);
    judged_repetitions_free(&c->repetitions);
    free(c->findings);
    *c = (struct comparison){0};
}
