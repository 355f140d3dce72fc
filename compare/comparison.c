#include "compare/comparison.h"

#include "compare/findings.h"

#include <stdio.h>
#include <stdlib.h>

// Prices of alignment.h as mean squared chords of a part's direction. A frame is left out at an end where it is more
// than 32 degrees off in every part, means aside; cheaper, and what is wrong would be left out instead of judged.
// Getting into position is taken out afterwards (pace.h). A step that only one movement takes costs what 8
// degrees do. By hand.
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

static struct alignment_prices prices_of(double unit)
{
    return (struct alignment_prices){(int32_t)(SKIP * unit), (int32_t)(SKIP * unit), (int32_t)(STEP * unit)};
}

static struct movement counted_frames(const struct movement *movement, struct repetition_span span)
{
    struct movement out = *movement; // borrows the frames
    out.frames += span.first;
    out.count = span.end - span.first;
    return out;
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

// Takes B's mean direction of each part to A's: what is held otherwise all along must not decide which instants belong
// together. Not further than 40 degrees, so that the numbers stay in their range.
static void center_features(const struct movement *a, const struct movement *b, const double *scale,
                            struct feature_frame *frames)
{
    const double most = 0.7;
    for (int p = 0; p < PART_COUNT; p++) {
        double x[3], y[3];
        if (!mean_direction(a, p, x) || !mean_direction(b, p, y))
            continue;
        for (int k = 0; k < 3; k++) {
            const int shift = (int)(fmax(-most, fmin(most, x[k] - y[k])) * scale[p] * FEATURE_UNIT);
            for (int32_t f = 0; f < b->count; f++)
                frames[f].number[3 * p + k] = (int16_t)(frames[f].number[3 * p + k] + shift);
        }
    }
}

// Both movements as feature frames in which each part that moves has about an equal say.
static enum status make_features(const struct movement of[2], uint16_t all_parts, double *unit,
                                 struct feature_frame *frames[2])
{
    const uint16_t parts = telling_parts(&of[0], &of[1], all_parts);
    double scale[PART_COUNT];
    movement_equal_say(&of[0], scale);
    *unit = price_unit(parts, scale);
    enum status status = movement_features(&of[0], parts, scale, &frames[0]);
    if (status == OK)
        status = movement_features(&of[1], parts, scale, &frames[1]);
    for (int p = 0; p < PART_COUNT; p++)
        scale[p] = parts >> p & 1 ? scale[p] : 0;
    if (status == OK)
        center_features(&of[0], &of[1], scale, frames[1]);
    return status;
}

static void free_features(struct feature_frame *frames[2])
{
    free(frames[0]);
    free(frames[1]);
}

// The alignment of what counts, its timeline, which repetitions belong together, and the timeline of these; all in
// frames of what counts.
// within: of A's frames, as in performances_judge.
static enum status align_counted(struct comparison *comparison, const struct repetition_span *within,
                                 struct timeline *repeated)
{
    const struct movement of[2] = {counted_frames(&comparison->a, comparison->counted_a),
                                   counted_frames(&comparison->judged, comparison->counted_b)};
    struct feature_frame *frames[2] = {NULL, NULL}, *plain[2] = {NULL, NULL};
    double unit = 0;
    enum status status = make_features(of, comparison->parts, &unit, frames);
    const struct features a = {frames[0], of[0].count}, b = {frames[1], of[1].count};
    const struct alignment_prices prices = prices_of(unit);
    if (status == OK)
        status = align(&a, &b, &prices, &comparison->alignment);
    if (status == OK)
        status = timeline_from_alignment(&comparison->alignment, &a, &b, &comparison->timeline);
    for (int k = 0; k < 2 && status == OK; k++)
        status = movement_features(&of[k], comparison->parts, NULL, &plain[k]);
    const struct performed sides[2] = {{&of[0], a, plain[0]}, {&of[1], b, plain[1]}};
    const struct performance_terms terms = {&prices, &comparison->by, within};
    if (status == OK)
        status = performances_judge(sides, &terms, repeated, &comparison->repetitions);
    free_features(frames);
    free_features(plain);
    return status;
}

// ---------------------------------------------------------------- a stretch that counts

static bool counts_all(const struct comparison *comparison)
{
    return comparison->counted_a.end - comparison->counted_a.first == comparison->a.count &&
           comparison->counted_b.end - comparison->counted_b.first == comparison->judged.count;
}

// The stretch of the reference, and all of the attempt.
static enum status count_stretch(struct comparison *comparison)
{
    const struct expectation *e = &comparison->expected;
    const int32_t count = comparison->a.count;
    comparison->counted_a = (struct repetition_span){0, count};
    comparison->counted_b = (struct repetition_span){0, comparison->b.count};
    if (!(e->to_s > 0))
        return OK;
    const double first = floor(e->from_s * MOVEMENT_RATE_HZ), end = ceil(e->to_s * MOVEMENT_RATE_HZ);
    comparison->counted_a =
        (struct repetition_span){(int32_t)fmin(count, fmax(0, first)), (int32_t)fmin(count, fmax(0, end))};
    return comparison->counted_a.first < comparison->counted_a.end
               ? OK
               : fail(ERR_INPUT, "what counts, %.1f s to %.1f s, is not in the reference, which lasts %.1f s",
                      e->from_s, e->to_s, count / MOVEMENT_RATE_HZ);
}

// Into frames of the whole attempt, of which what does not count is aligned with nothing, and of the whole reference.
static enum status widen_timeline(const struct comparison *comparison, struct timeline *timeline)
{
    if (!timeline->reference)
        return OK;
    const int32_t first = comparison->counted_b.first;
    float *whole = malloc((size_t)comparison->judged.count * sizeof *whole);
    if (!whole)
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    for (int32_t f = 0; f < comparison->judged.count; f++)
        whole[f] = f >= first && f < first + timeline->count
                       ? timeline->reference[f - first] + (float)comparison->counted_a.first
                       : NAN;
    free(timeline->reference);
    *timeline = (struct timeline){whole, comparison->judged.count};
    return OK;
}

static void forget_alignment(struct comparison *comparison, struct timeline *repeated)
{
    alignment_free(&comparison->alignment);
    timeline_free(&comparison->timeline);
    timeline_free(repeated);
    performances_free(&comparison->repetitions);
}

// Frames of what counts into frames of the wholes.
static enum status widen_alignment(struct comparison *comparison, struct timeline *repeated)
{
    const int32_t a = comparison->counted_a.first, b = comparison->counted_b.first;
    for (int32_t k = 0; k < comparison->alignment.count; k++) {
        comparison->alignment.pairs[k].a += a;
        comparison->alignment.pairs[k].b += b;
    }
    for (int32_t k = 0; k < comparison->repetitions.count; k++) {
        struct performance *p = &comparison->repetitions.at[k];
        p->reference = (struct repetition_span){p->reference.first + a, p->reference.end + a};
        p->attempt = (struct repetition_span){p->attempt.first + b, p->attempt.end + b};
    }
    const enum status status = widen_timeline(comparison, &comparison->timeline);
    return status == OK ? widen_timeline(comparison, repeated) : status;
}

// What of the attempt shows the stretch, by the alignment of the wholes. All of it where nothing does.
static struct repetition_span find_shown(const struct comparison *comparison, struct repetition_span wanted)
{
    enum { FEWEST = 5 }; // frames that are a stretch of the attempt
    int32_t first = -1, end = 0;
    for (int32_t k = 0; k < comparison->alignment.count; k++) {
        const struct alignment_pair *pair = &comparison->alignment.pairs[k];
        if (pair->a < wanted.first || pair->a >= wanted.end)
            continue;
        first = first < 0 ? pair->b : first;
        end = pair->b + 1;
    }
    return end - first >= FEWEST ? (struct repetition_span){first, end}
                                 : (struct repetition_span){0, comparison->judged.count};
}

// Of the wholes, in whose frames it is, only what shows the stretch remains.
static void mask_wholes(struct comparison *comparison, struct repetition_span wanted)
{
    struct timeline *timeline = &comparison->timeline;
    struct alignment *alignment = &comparison->alignment;
    int32_t kept = 0;
    for (int32_t f = 0; f < timeline->count; f++)
        if (timeline->reference[f] < (float)wanted.first || timeline->reference[f] > (float)(wanted.end - 1))
            timeline->reference[f] = NAN;
    for (int32_t k = 0; k < alignment->count; k++)
        if (alignment->pairs[k].a >= wanted.first && alignment->pairs[k].a < wanted.end)
            alignment->pairs[kept++] = alignment->pairs[k];
    alignment->count = kept;
}

// The attempt may hold the whole movement, several times where the reference has it once, or as often as the
// reference, where the stretch is in its place among these; or the stretch alone, once or several times.
static enum status align_stretch(struct comparison *comparison, struct timeline *repeated)
{
    const struct repetition_span wanted = comparison->counted_a;
    comparison->counted_a = (struct repetition_span){0, comparison->a.count};
    enum status status = align_counted(comparison, &wanted, repeated);
    const struct repetition_span shown = find_shown(comparison, wanted);
    const int32_t count = comparison->repetitions.count;
    if (status == OK && count && count != comparison->repetitions.all_references) {
        mask_wholes(comparison, wanted);
        comparison->counted_a = wanted;
        return OK;
    }
    comparison->counted_a = wanted;
    if (status == OK && !count) {
        forget_alignment(comparison, repeated);
        status = align_counted(comparison, NULL, repeated);
    }
    if (status == OK && (count || comparison->repetitions.count < 2)) {
        forget_alignment(comparison, repeated);
        comparison->counted_b = shown;
        status = align_counted(comparison, NULL, repeated);
    }
    return status == OK ? widen_alignment(comparison, repeated) : status;
}

static enum status align_all(struct comparison *comparison, struct timeline *repeated)
{
    return counts_all(comparison) ? align_counted(comparison, NULL, repeated) : align_stretch(comparison, repeated);
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
    const struct alignment_prices prices = prices_of(price_unit(parts, NULL));
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
        comparison->parts = comparison->a.ever_known & mirror.ever_known & (uint16_t)~comparison->by.ignored;
        return OK;
    }
    movement_free(&mirror);
    if (status == OK)
        comparison->judged = comparison->b;
    return status;
}

static void move_timeline(struct timeline *timeline, float frames)
{
    for (int32_t f = 0; f < timeline->count; f++)
        timeline->reference[f] += frames;
}

// Of what counts, in frames of the whole: what is left out of the reference beside it is not missing.
static enum status measure_pace(struct comparison *comparison, bool repeated)
{
    const struct movement a = counted_frames(&comparison->a, comparison->counted_a),
                          b = counted_frames(&comparison->judged, comparison->counted_b);
    const int32_t first_a = comparison->counted_a.first, first_b = comparison->counted_b.first;
    struct timeline counted = {comparison->timeline.reference + first_b, b.count};
    struct pace *pace = &comparison->pace;
    move_timeline(&counted, (float)-first_a);
    const enum status status = pace_measure(&a, &b, comparison->parts, &counted, repeated, pace);
    move_timeline(&counted, (float)first_a);
    pace->a_first += first_a;
    pace->a_end += first_a;
    pace->b_first += first_b;
    pace->b_end += first_b;
    for (int32_t k = 0; k < pace->piece_count; k++) {
        pace->pieces[k].a_first += first_a;
        pace->pieces[k].a_end += first_a;
        pace->pieces[k].b_first += first_b;
        pace->pieces[k].b_end += first_b;
    }
    return status;
}

// ---------------------------------------------------------------- relation

const char *relation_name(enum relation relation)
{
    static const char *const names[] = {"same", "other", "moved", "still", "part"};
    return names[relation];
}

// What a movement moves in the frames that the timeline uses, as a share of what it moves at all in those that count.
// used: [count].
static double used_share(const struct movement *movement, const bool *used, struct repetition_span counted,
                         uint16_t parts)
{
    double in = 0, all = 0;
    for (int32_t f = counted.first + 1; f < counted.end; f++) {
        const struct movement_frame *x = &movement->frames[f - 1], *y = &movement->frames[f];
        for (int p = 0; p < PART_COUNT; p++) {
            if (!(parts & x->known & y->known & 1u << p))
                continue;
            double square = 0;
            for (int k = 0; k < 3; k++) {
                const double d = (double)y->direction[p][k] - x->direction[p][k];
                square += d * d;
            }
            // Less than 6 degrees a second is noise.
            const double step = fmax(0, sqrt(square) - 0.1 / MOVEMENT_RATE_HZ);
            all += step;
            in += used[f] ? step : 0;
        }
    }
    return all > 0 ? in / all : 1;
}

static enum status measure_shares(struct comparison *comparison)
{
    const struct timeline *t = &comparison->timeline;
    bool *used_a = calloc((size_t)comparison->a.count + 1, sizeof *used_a),
         *used_b = calloc((size_t)t->count + 1, sizeof *used_b);
    enum status status = used_a && used_b ? OK : fail(ERR_MEMORY, "no memory to compare movements");
    for (int32_t f = 0, last = -1; f < t->count && status == OK; f++) {
        used_b[f] = !isnan(t->reference[f]);
        if (!used_b[f])
            continue;
        const int32_t at = (int32_t)(t->reference[f] + 0.5f);
        // Between two frames of B that follow each other A's are used, too, but for a leap of more than half a second.
        const int32_t from = last >= 0 && at > last && at - last < MOVEMENT_RATE_HZ / 2 ? last : at;
        for (int32_t i = from; i <= at && i < comparison->a.count; i++)
            used_a[i] = true;
        last = at;
    }
    if (status == OK) {
        comparison->judged_share[0] = used_share(&comparison->a, used_a, comparison->counted_a, comparison->parts);
        comparison->judged_share[1] = used_share(&comparison->judged, used_b, comparison->counted_b, comparison->parts);
    }
    free(used_a);
    free(used_b);
    return status;
}

// By hand: below 4 degrees a movement is a hold, above 6 it is none, each beside what the joints' errors add (in twice
// their variance: they are themselves sure to about a half); holds of one posture are within 25 degrees. The
// correlation as docs/notes/comparing.md says: the least at which one in a hundred pairs of different motions passes.
// At least half of what either moves has to be aligned.
static const double STILL_RAD = 0.07, MOVED_FACTOR = 1.5, SAME_POSE_RAD = 0.44, MIN_CORRELATION = 0.4, MIN_SHARE = 0.5;

static bool moves_more(double moved_rad, double than_rad, double error_rad)
{
    return moved_rad * moved_rad > than_rad * than_rad + 2 * error_rad * error_rad;
}

static void set_relation(struct comparison *comparison)
{
    const struct similarity *l = &comparison->similarity;
    const double *share = comparison->judged_share;
    const bool still_a = !moves_more(l->moved_a_rad, STILL_RAD, l->error_a_rad),
               still_b = !moves_more(l->moved_b_rad, STILL_RAD, l->error_b_rad),
               moves_a = moves_more(l->moved_a_rad, MOVED_FACTOR * STILL_RAD, l->error_a_rad),
               moves_b = moves_more(l->moved_b_rad, MOVED_FACTOR * STILL_RAD, l->error_b_rad),
               holds = (still_a || still_b) && !moves_a && !moves_b; // their correlation is that of noise
    const char *sentence = "";
    char part[160];
    enum relation relation = RELATION_SAME;
    if (still_a && moves_b) {
        relation = RELATION_MOVED;
        sentence = "You moved, where the reference holds still";
    } else if (still_b && moves_a) {
        relation = RELATION_STILL;
        sentence = "You held still, where the reference moves";
    } else if (holds ? l->rms_rad > SAME_POSE_RAD : l->correlation < MIN_CORRELATION) {
        relation = RELATION_OTHER;
        sentence = holds ? "This is another posture" : "This is another movement";
    } else if (share[0] < MIN_SHARE) {
        relation = RELATION_PART;
        snprintf(part, sizeof part, "Only a part was done: from %.1f s to %.1f s of the reference's %.1f s",
                 comparison->pace.a_first / MOVEMENT_RATE_HZ, comparison->pace.a_end / MOVEMENT_RATE_HZ,
                 comparison->a.count / MOVEMENT_RATE_HZ);
        sentence = part;
    } else if (share[1] < MIN_SHARE && 2 * comparison->pace.extra > comparison->pace.b_end - comparison->pace.b_first) {
        relation = RELATION_PART;
        snprintf(part, sizeof part,
                 "Most of the attempt is something else: %.1f s of its %.1f s are not in the reference",
                 comparison->pace.extra / MOVEMENT_RATE_HZ, comparison->judged.count / MOVEMENT_RATE_HZ);
        sentence = part;
    } else if (share[1] < MIN_SHARE) {
        relation = RELATION_PART;
        snprintf(part, sizeof part, "Most of the attempt is something else: only %.1f s to %.1f s are the movement",
                 comparison->pace.b_first / MOVEMENT_RATE_HZ, comparison->pace.b_end / MOVEMENT_RATE_HZ);
        sentence = part;
    }
    comparison->relation = relation;
    snprintf(comparison->relation_sentence, sizeof comparison->relation_sentence, "%s", sentence);
}

// ---------------------------------------------------------------- judging

// The whole as one performance.
static void judge_whole(struct comparison *comparison, struct pair_sums *sums)
{
    *sums = (struct pair_sums){.ignored = comparison->by.ignored};
    pair_sums_add(sums, &comparison->a, &comparison->judged, &comparison->alignment);
    noise_sums_add(sums->noise[0], &comparison->a, 0, comparison->a.count);
    noise_sums_add(sums->noise[1], &comparison->judged, 0, comparison->judged.count);
    comparison->terms = score_posture(sums, NULL, &comparison->by);
    comparison->similarity = similarity_of(sums, &comparison->a, &comparison->judged);
}

static void charge_times(struct comparison *comparison)
{
    const struct pace *pace = &comparison->pace;
    const double a = pace->a_end - pace->a_first + pace->missing, b = pace->b_end - pace->b_first;
    comparison->terms.missing_share = fmin(1, pace->missing / fmax(1, a));
    comparison->terms.extra_share = fmin(1, pace->extra / fmax(1, b));
}

// Frames of both that lie in pieces and pauses, as a share.
static double spare_share(const struct comparison *comparison)
{
    const struct pace *pace = &comparison->pace;
    double spare = 0;
    for (int32_t k = 0; k < pace->piece_count; k++)
        spare += pace->pieces[k].a_end - pace->pieces[k].a_first + pace->pieces[k].b_end - pace->pieces[k].b_first;
    return spare / (comparison->counted_a.end - comparison->counted_a.first + comparison->counted_b.end -
                    comparison->counted_b.first);
}

// Do the repetitions, as they were found, say no more than the whole? They do not where the whole is more alike, or
// where there are more or fewer of them, and yet the whole has nothing to spare. Costs as in score.h; by hand.
static bool whole_is_enough(const struct comparison *comparison, const struct score_terms *repeated)
{
    const double margin = 0.02, nearly_all = 0.8, little = 0.2;
    const double whole = comparison->terms.posture;
    const bool nothing_spare = comparison->judged_share[0] > nearly_all && comparison->judged_share[1] > nearly_all &&
                               spare_share(comparison) < little;
    if (!nothing_spare)
        return false;
    return whole + margin < repeated->posture ||
           (comparison->repetitions.count != comparison->repetitions.reference_count &&
            whole < repeated->posture + margin);
}

// The repetitions together: of these there may be more or fewer, with rests between them, which says nothing of how
// well they are done.
static enum status judge_repetitions(struct comparison *comparison, struct timeline *repeated)
{
    struct performances *all = &comparison->repetitions;
    const struct score_terms terms =
        score_posture(&all->sums, all->reference_count >= 2 ? all->moved : NULL, &comparison->by);
    if (whole_is_enough(comparison, &terms)) {
        performances_free(all);
        all->reference_count = 1;
        return OK;
    }
    const struct timeline swap = comparison->timeline;
    comparison->timeline = *repeated;
    *repeated = swap;
    comparison->terms = terms;
    comparison->similarity = similarity_of(&all->sums, &comparison->a, &comparison->judged);
    comparison->judged_share[0] = comparison->judged_share[1] = 1; // nearly: MIN_COVERED in repetitions.c
    pace_free(&comparison->pace);
    return measure_pace(comparison, true);
}

static enum status measure_ranges(struct comparison *comparison)
{
    const struct pace *pace = &comparison->pace;
    bool *of_a = pace_left_out(pace, true, comparison->a.count),
         *of_b = pace_left_out(pace, false, comparison->judged.count);
    enum status status = of_a && of_b ? OK : fail(ERR_MEMORY, "no memory for the ranges of angles");
    if (status == OK)
        status = body_angle_ranges(&comparison->a, pace->a_first, pace->a_end, of_a, comparison->range_a);
    if (status == OK)
        status = body_angle_ranges(&comparison->judged, pace->b_first, pace->b_end, of_b, comparison->range_b);
    free(of_a);
    free(of_b);
    return status;
}

static enum status judge_attempt(struct comparison *comparison)
{
    struct timeline repeated = {0};
    struct pair_sums sums;
    enum status status = align_all(comparison, &repeated);
    if (status == OK)
        status = measure_pace(comparison, false);
    if (status == OK)
        status = measure_shares(comparison);
    if (status == OK)
        judge_whole(comparison, &sums);
    if (status == OK && comparison->repetitions.count)
        status = judge_repetitions(comparison, &repeated);
    timeline_free(&repeated);
    if (status == OK)
        status = measure_ranges(comparison);
    if (status != OK)
        return status;
    if (!comparison->repetitions.count)
        charge_times(comparison);
    set_relation(comparison);
    if (comparison->relation != RELATION_SAME)
        return OK;
    status = findings_make(comparison);
    comparison->score = score_from_terms(&comparison->terms);
    comparison->score_sigma =
        score_error(&comparison->terms, comparison->repetitions.count ? &comparison->repetitions.sums : &sums,
                    &comparison->a, &comparison->judged, &comparison->by);
    return status;
}

enum status comparison_make(struct movement *a, struct movement *b, const struct expectation *expected,
                            struct comparison *out)
{
    *out = (struct comparison){.a = *a, .b = *b, .by = tolerances_of(expected)};
    out->parts = a->ever_known & b->ever_known & (uint16_t)~out->by.ignored;
    if (expected)
        out->expected = *expected;
    *a = *b = (struct movement){0};
    enum status status = count_stretch(out);
    if (!out->parts && status == OK)
        status =
            fail(ERR_INPUT,
                 out->by.ignored
                     ? "no part of the body that matters is known in both movements, so there is nothing to compare"
                     : "no part of the body is known in both movements, so there is nothing to compare");
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
    performances_free(&comparison->repetitions);
    free(comparison->findings);
    *comparison = (struct comparison){0};
}
