#include "compare/comparison.h"

#include "base/threads.h"
#include "compare/findings.h"

#include <stdlib.h>

// Prices of alignment.h as mean squared chords of a part's direction. A frame is left out at an end where it is more
// than 32 degrees off in every part; cheaper, and what is wrong would be left out instead of judged (chosen
// on UI-PRMD and KIMORE as score.h's constants). Getting into position is taken out afterwards (repetitions.h). A step
// that only one movement takes costs what 8 degrees do; by hand.
static const double SKIP = 0.3, STEP = 0.02;
// By hand: B is taken for a mirror image if that fits to 0.75 of the price, and B itself is worse than 8 degrees off.
static const double MIRROR_GAIN = 0.75, MIRROR_MIN = 0.02;

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
                                   const double *scale, struct alignment *alignment, struct timeline *timeline)
{
    struct feature_frame *fa = NULL, *fb = NULL;
    const struct alignment_prices prices = prices_for(parts, scale);
    enum status status = movement_features(a, parts, scale, &fa);
    if (status == OK)
        status = movement_features(b, parts, scale, &fb);
    const struct features features_a = {fa, a->count}, features_b = {fb, b->count};
    if (status == OK)
        status = align(&features_a, &features_b, &prices, alignment);
    if (status == OK && timeline)
        status = timeline_from_alignment(alignment, &features_a, &features_b, timeline);
    free(fa);
    free(fb);
    return status;
}

static bool mean_direction(const struct movement *movement, int p, double mean[3])
{
    double count = 0;
    mean[0] = mean[1] = mean[2] = 0;
    for (int32_t f = 0; f < movement->count; f++) {
        if (!(movement->frames[f].known >> p & 1))
            continue;
        for (int k = 0; k < 3; k++)
            mean[k] += movement->frames[f].direction[p][k];
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

static enum status align_both(struct comparison *comparison)
{
    struct both_alignments both = {.c = comparison,
                                   .parts = telling_parts(&comparison->a, &comparison->judged, comparison->parts)};
    movement_equal_say(&comparison->a, both.scale);
    parallel_for(2, 2, align_one, &both);
    alignment_free(&both.equal);
    return failure_restore(&both.failure[both.failure[0].status == OK]);
}

enum { COARSE = 4 }; // every so manieth frame decides about mirroring

static int32_t thin_frames(struct feature_frame *frame, int32_t count)
{
    int32_t kept = 0;
    for (int32_t i = 0; i < count; i += COARSE)
        frame[kept++] = frame[i];
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
        const struct features features_a = {fa, thin_frames(fa, a->count)},
                              features_b = {fb, thin_frames(fb, b->count)};
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
static enum status choose_side(struct comparison *comparison)
{
    struct movement mirror = {0};
    double plain = 0, mirrored = 0;
    // Parts that are known on both sides of both: a missing limb must not decide.
    const uint16_t both = comparison->parts & mirrored_parts(comparison->parts);
    enum status status = movement_mirror(&comparison->b, &mirror);
    if (status == OK && both) {
        const uint16_t telling =
            telling_parts(&comparison->a, &comparison->b, both) & telling_parts(&comparison->a, &mirror, both);
        status = coarse_price(&comparison->a, &comparison->b, telling ? telling : both, &plain);
        if (status == OK)
            status = coarse_price(&comparison->a, &mirror, telling ? telling : both, &mirrored);
    }
    if (status == OK && plain > MIRROR_MIN && mirrored < MIRROR_GAIN * plain) {
        comparison->mirrored = true;
        comparison->judged = mirror;
        comparison->parts = comparison->a.ever_known & mirror.ever_known;
        return OK;
    }
    movement_free(&mirror);
    if (status == OK)
        comparison->judged = comparison->b;
    return status;
}

static enum status judge_attempt(struct comparison *comparison)
{
    enum status status = align_both(comparison);
    if (status == OK)
        status = pace_measure(&comparison->a, &comparison->judged, comparison->parts, &comparison->timeline,
                              &comparison->pace);
    if (status == OK)
        status =
            body_angle_ranges(&comparison->a, comparison->pace.a_first, comparison->pace.a_end, comparison->range_a);
    if (status == OK)
        status = body_angle_ranges(&comparison->judged, comparison->pace.b_first, comparison->pace.b_end,
                                   comparison->range_b);
    const struct alignment_prices prices = prices_for(comparison->parts, NULL);
    if (status == OK)
        status = judge_repetitions(&comparison->a, &comparison->judged, comparison->parts, &prices,
                                   &comparison->repetitions);
    const struct score_scope scope = {0, comparison->judged.count,
                                      comparison->repetitions.reference_count >= 2 ? comparison->repetitions.moved
                                                                                   : NULL};
    if (status == OK)
        status = score_posture(&comparison->a, &comparison->judged, &comparison->alignment, &scope, &comparison->terms);
    if (status != OK)
        return status;
    // Of repetitions there may be more or fewer, with rests between them: they say nothing of one performance's time.
    // Each is judged against the one that it resembles most. That may be worse than the whole, where the cycles of the
    // two begin at different places.
    if (comparison->repetitions.count >= 2 && comparison->repetitions.reference_count >= 2) {
        double mean = 0;
        for (int32_t k = 0; k < comparison->repetitions.count; k++)
            mean += comparison->repetitions.at[k].terms.posture_rad / comparison->repetitions.count;
        comparison->terms.posture_rad = fmin(comparison->terms.posture_rad, mean);
        comparison->score = score_from_terms(&comparison->terms);
        return findings_make(comparison);
    }
    const double a = comparison->pace.a_end - comparison->pace.a_first + comparison->pace.missing,
                 b = comparison->pace.b_end - comparison->pace.b_first;
    comparison->terms.missing_share = fmin(1, comparison->pace.missing / fmax(1, a));
    comparison->terms.extra_share = fmin(1, comparison->pace.extra / fmax(1, b));
    comparison->terms.timing_s = comparison->pace.uneven_s;
    comparison->score = score_from_terms(&comparison->terms);
    return findings_make(comparison);
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
        status = judge_attempt(out);
    if (status != OK)
        comparison_free(out);
    return status;
}

void comparison_free(struct comparison *comparison)
{
    movement_free(&comparison->a);
    movement_free(&comparison->b);
    if (comparison->mirrored)
        movement_free(&comparison->judged);
    alignment_free(&comparison->alignment);
    timeline_free(&comparison->timeline);
    pace_free(&comparison->pace);
    judged_repetitions_free(&comparison->repetitions);
    free(comparison->findings);
    *comparison = (struct comparison){0};
}
