#include "compare/findings.h"

#include "base/portable_math.h"
#include "base/threads.h"
#include "compare/difference.h"
#include "compare/movement.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum status finding_add(struct comparison *comparison, const struct finding *finding, bool timed);

// ---------------------------------------------------------------- not judged

// Joints as people say them; of those that are there twice the left one is listed.
static const struct {
    enum joint joint;
    const char *one, *two; // two NULL: there is one only
} joint_words[] = {
    {JOINT_HEAD, "head", NULL},
    {JOINT_NECK, "neck", NULL},
    {JOINT_LEFT_SHOULDER, "shoulder", "shoulders"},
    {JOINT_LEFT_ELBOW, "elbow", "elbows"},
    {JOINT_LEFT_HAND, "hand", "hands"},
    {JOINT_TORSO, "torso", NULL},
    {JOINT_WAIST, "waist", NULL},
    {JOINT_LEFT_HIP, "hip", "hips"},
    {JOINT_LEFT_KNEE, "knee", "knees"},
    {JOINT_LEFT_FOOT, "foot", "feet"},
};
// From a left joint to its right one.
static const int TO_RIGHT = JOINT_RIGHT_SHOULDER - JOINT_LEFT_SHOULDER;

static void append_text(char *out, const char *text)
{
    const size_t used = strlen(out);
    snprintf(out + used, NOT_JUDGED_BYTES - used, "%s", text);
}

// The joints of a set, "the knees, the left hand". Returns how many things are named, two of a kind as two.
static int name_joints(uint16_t joints, char out[NOT_JUDGED_BYTES])
{
    int count = 0;
    *out = 0;
    for (size_t k = 0; k < COUNT_OF(joint_words); k++) {
        const bool left = joints >> joint_words[k].joint & 1,
                   right = joint_words[k].two && joints >> (joint_words[k].joint + TO_RIGHT) & 1;
        if (!left && !right)
            continue;
        append_text(out, count ? ", the " : "the ");
        if (joint_words[k].two && !(left && right))
            append_text(out, left ? "left " : "right ");
        append_text(out, left && right ? joint_words[k].two : joint_words[k].one);
        count += left + right;
    }
    return count;
}

static void say_not_judged(uint16_t joints, const char *how, const char *where, char out[NOT_JUDGED_BYTES])
{
    char text[NOT_JUDGED_BYTES];
    const int count = name_joints(joints, text);
    if (!count)
        return;
    append_text(out, *out ? "; " : "could not be judged: ");
    append_text(out, text);
    append_text(out, count > 1 ? " are " : " is ");
    append_text(out, how);
    append_text(out, where);
}

// Parts that are known too seldom although their joints are known at times.
static void say_parts(const struct comparison *comparison, char out[NOT_JUDGED_BYTES])
{
    for (int p = 0; p < PART_COUNT; p++) {
        char text[64];
        if ((comparison->parts | comparison->by.ignored) >> p & 1)
            continue;
        snprintf(text, sizeof text, "%sthe %s", *out ? ", " : "could not be judged: ", part_name((enum part)p));
        for (char *at = text; (at = strchr(at, '_'));)
            *at = ' ';
        append_text(out, text);
    }
    append_text(out, ": hardly ever seen whole");
}

// The joints of the parts that matter.
static uint16_t joints_that_matter(const struct comparison *comparison)
{
    uint16_t joints = 0;
    if (!comparison->by.ignored)
        return UINT16_MAX;
    for (int p = 0; p < PART_COUNT; p++)
        if (!(comparison->by.ignored >> p & 1))
            joints |= (uint16_t)(1u << part_ends[p].from | 1u << part_ends[p].to);
    return joints;
}

const char *not_judged_text(const struct comparison *comparison, char out[NOT_JUDGED_BYTES])
{
    const uint16_t asked = joints_that_matter(comparison), none_a = asked & (uint16_t)~comparison->a.joints_ever,
                   none_b = asked & (uint16_t)~comparison->b.joints_ever,
                   few_a = asked & comparison->a.joints_ever & (uint16_t)~comparison->a.joints_often,
                   few_b = asked & comparison->b.joints_ever & (uint16_t)~comparison->b.joints_often;
    *out = 0;
    if (!(~(comparison->parts | comparison->by.ignored) & ((1u << PART_COUNT) - 1)))
        return out;
    say_not_judged(none_a & none_b, "in neither movement", "", out);
    say_not_judged(none_b & (uint16_t)~none_a, "not in ", "the attempt", out);
    say_not_judged(none_a & (uint16_t)~none_b, "not in ", "the reference", out);
    say_not_judged(few_b, "hardly ever in ", "the attempt", out);
    say_not_judged(few_a, "hardly ever in ", "the reference", out);
    if (!*out)
        say_parts(comparison, out);
    return out;
}

// ---------------------------------------------------------------- finding moment

// Where in the attempt a finding is seen best, and on which part.

int part_by_name(const char *name)
{
    for (int p = 0; p < PART_COUNT; p++)
        if (!strcmp(name, part_name((enum part)p)))
            return p;
    return -1;
}

int judged_part(const struct comparison *comparison, int part)
{
    return part >= 0 && comparison->mirrored ? (int)mirrored_part((enum part)part) : part;
}

static const char turn_noun[] = "Trunk turns";

// How far a frame of the attempt differs in what the finding is about, rad; 0: not surely.
static double finding_difference(const struct comparison *comparison, const struct finding *finding, int32_t frame)
{
    const int judged = judged_part(comparison, part_by_name(finding->part));
    struct part_difference parts[PART_COUNT];
    if (finding->noun && !strcmp(finding->noun, turn_noun)) { // the part's direction says nothing of it
        if (isnan(comparison->timeline.reference[frame]))
            return 0;
        const struct movement_frame at = movement_at(&comparison->a, comparison->timeline.reference[frame]);
        return fabs((double)body_angle_of(&comparison->judged.frames[frame], ANGLE_TWIST) -
                    body_angle_of(&at, ANGLE_TWIST)); // NaN is never the most
    }
    comparison_differences(comparison, &comparison->judged, frame, parts);
    return parts[judged].verdict == VERDICT_DIFFERENT ? parts[judged].angle_rad : 0;
}

double finding_worst_s(const struct comparison *comparison, const struct finding *finding)
{
    const int32_t first = (int32_t)(finding->from_s * MOVEMENT_RATE_HZ + 0.5),
                  end = (int32_t)(finding->to_s * MOVEMENT_RATE_HZ);
    const bool of_part = part_by_name(finding->part) >= 0;
    double worst_s = 0.5 * (finding->from_s + finding->to_s), max = 0;
    for (int32_t k = first; k < end && k < comparison->judged.count && of_part; k++) {
        const double difference = finding_difference(comparison, finding, k);
        if (difference > max) {
            max = difference;
            worst_s = k / MOVEMENT_RATE_HZ;
        }
    }
    return worst_s;
}

// ---------------------------------------------------------------- finding pieces

// Findings about time as a whole: what is missing or added, pauses, pace, repetitions, the side.

// Frames, by hand: pauses so near each other are one, and what is longer or shorter is said from so many on.
enum { SAME_REST = 15, MIN_NET = 12 };

// By hand: what a finding costs at most beside the deviations of its parts, which are means over the whole movement.
static const double FINDING_COST = 0.25, TIMING_SPREAD_S = 1;

static double timing_cost(double seconds) { return FINDING_COST * robust_cost(seconds / TIMING_SPREAD_S); }

static double frames_to_seconds(double frames) { return frames / MOVEMENT_RATE_HZ; }

// "second": of the whole turns of the movement, which one ends nearest to `frame`?
static int which_turn(const struct movement *movement, int32_t frame)
{
    const double whole = 5.2; // 300 degrees: a turn that is not quite closed counts
    double from = movement->frames[0].heading;
    int turns = 0;
    for (int32_t f = 0; f <= frame && f < movement->count; f++)
        if (fabs((double)movement->frames[f].heading - from) >= whole) {
            turns++;
            from = movement->frames[f].heading;
        }
    return turns;
}

static const char *ordinal_word(int n)
{
    static const char *const names[] = {"", "first", "second", "third", "fourth", "fifth", "sixth"};
    return n >= 1 && n <= 6 ? names[n] : "last";
}

static enum status of_piece(struct comparison *comparison, const struct piece *piece)
{
    struct finding f = {.part = "body", .unit = "s"};
    const double a_s = frames_to_seconds(piece->a_end - piece->a_first),
                 b_s = frames_to_seconds(piece->b_end - piece->b_first);
    const bool turn = fabs(piece->turned_rad) > 2.6; // 150 degrees
    f.from_s = frames_to_seconds(piece->b_first);
    f.to_s = frames_to_seconds(piece->b_end);
    switch (piece->kind) {
    case PIECE_MISSING:
        f.kind = FINDING_MISSING;
        f.from_s = frames_to_seconds(piece->a_first);
        f.to_s = frames_to_seconds(piece->a_end);
        f.amount = a_s;
        if (turn)
            snprintf(f.sentence, sizeof f.sentence, "The %s turn is missing",
                     ordinal_word(which_turn(&comparison->a, piece->a_end)));
        else
            snprintf(f.sentence, sizeof f.sentence, "%.1f s of the reference are missing", a_s);
        break;
    case PIECE_EXTRA:
        f.kind = FINDING_EXTRA;
        f.amount = b_s;
        snprintf(f.sentence, sizeof f.sentence, turn ? "A turn too many" : "%.1f s that the reference does not have",
                 b_s);
        break;
    case PIECE_PAUSE:
        f.kind = FINDING_TIMING;
        f.amount = b_s - a_s;
        f.cost = timing_cost(f.amount);
        snprintf(f.sentence, sizeof f.sentence, "You paused for %.1f s", f.amount);
        break;
    case PIECE_PAUSE_SKIPPED:
        f.kind = FINDING_TIMING;
        f.amount = b_s - a_s;
        f.cost = timing_cost(f.amount);
        snprintf(f.sentence, sizeof f.sentence, "The pause is %.1f s too short", -f.amount);
        break;
    }
    return finding_add(comparison, &f, true);
}

static enum status of_pace(struct comparison *comparison)
{
    // By hand: more than four times as fast, or as slow, is an alignment that leaps over what is missing, not a pace.
    const double least = 0.25, most = 4, ratio = comparison->pace.ratio;
    if (!(ratio > least && ratio < most) || fabs(ratio - 1) < 0.12 ||
        comparison->pace.b_end - comparison->pace.b_first < 30)
        return OK;
    struct finding f = {.kind = FINDING_TIMING,
                        .part = "body",
                        .from_s = frames_to_seconds(comparison->pace.b_first),
                        .to_s = frames_to_seconds(comparison->pace.b_end),
                        .amount = 100 * (ratio - 1),
                        .unit = "%"};
    if (ratio > 1)
        snprintf(f.sentence, sizeof f.sentence, "You were %.1f times as fast", ratio);
    else
        snprintf(f.sentence, sizeof f.sentence, "You took %.1f times as long", 1 / ratio);
    return finding_add(comparison, &f, false);
}

// More or fewer repetitions than the reference, where that holds several.
static enum status of_repetitions(struct comparison *comparison)
{
    const int32_t wanted = comparison->repetitions.reference_count, got = comparison->repetitions.count;
    if (wanted < 2 || !got || wanted == got)
        return OK;
    const int32_t off = abs(wanted - got);
    struct finding f = {.kind = got < wanted ? FINDING_MISSING : FINDING_EXTRA,
                        .part = "body",
                        .to_s = frames_to_seconds(comparison->judged.count),
                        .amount = off,
                        .unit = "times"};
    const char *missing = off > 1 ? "are missing" : "is missing";
    snprintf(f.sentence, sizeof f.sentence, "%d repetition%s %s: %d instead of %d", (int)off, off > 1 ? "s" : "",
             got < wanted ? missing : "too many", (int)got, (int)wanted);
    return finding_add(comparison, &f, false);
}

static bool is_pause(const struct piece *piece)
{
    return piece->kind == PIECE_PAUSE || piece->kind == PIECE_PAUSE_SKIPPED;
}

static int32_t frames_longer(const struct piece *piece)
{
    return piece->b_end - piece->b_first - (piece->a_end - piece->a_first);
}

// While both stand still it is open which instants belong together: the alignment may wait in one movement and then in
// the other. Of such pauses by turns only what remains is one. Joins piece k with those that follow it so; returns how
// many they are.
static int32_t join_pauses(const struct pace *pace, int32_t k, struct piece *joined)
{
    int32_t count = 1;
    *joined = pace->pieces[k];
    for (; is_pause(joined) && k + count < pace->piece_count; count++) {
        const struct piece *last = &pace->pieces[k + count - 1], *next = &pace->pieces[k + count];
        if (!is_pause(next) || next->kind == last->kind || next->b_first - last->b_end > SAME_REST ||
            next->a_first - last->a_end > SAME_REST)
            break;
        joined->a_end = next->a_end;
        joined->b_end = next->b_end;
    }
    if (count > 1)
        joined->kind = frames_longer(joined) > 0 ? PIECE_PAUSE : PIECE_PAUSE_SKIPPED;
    return count;
}

// missing, extra, pauses, pace, repetitions, mirrored
static enum status find_pieces(struct comparison *comparison)
{
    enum status status = OK;
    if (comparison->mirrored) {
        const struct finding f = {.kind = FINDING_MIRRORED,
                                  .part = "body",
                                  .from_s = frames_to_seconds(comparison->pace.b_first),
                                  .to_s = frames_to_seconds(comparison->pace.b_end),
                                  .amount = 1,
                                  .unit = "times",
                                  .sentence = "Mirrored: you used the other side"};
        status = finding_add(comparison, &f, false);
    }
    if (status == OK)
        status = of_repetitions(comparison);
    for (int32_t k = 0, count; k < comparison->pace.piece_count && status == OK; k += count) {
        struct piece p;
        count = join_pauses(&comparison->pace, k, &p);
        if (is_pause(&p) && abs(frames_longer(&p)) < MIN_NET)
            continue;
        status = of_piece(comparison, &p);
    }
    return status == OK ? of_pace(comparison) : status;
}

// ---------------------------------------------------------------- finding postures

// Findings about one joint: posture and range; and about one limb: early or late.

static const double RAD = 180 / 3.14159265358979323846; // degrees in a radian

// By hand. A posture is found where it is off by 10 degrees and 1.2 standard deviations for 0.3 s in all, as long as it
// stays above 6; gaps of 0.3 s do not end it. It is off by as much as in the upper third of that time.
static const double BEGIN_DEGREES = 10, STAY_DEGREES = 6, SIGMA_SHARE = 1.2, UPPER_SHARE = 0.67;
enum { FRAMES_AT_ONCE = 4096, THREADS = 4 }; // a thread's share of a long attempt; a short one has none of its own
enum { MIN_FRAMES = 9, MAX_GAP = 9, SMOOTH_HALF = 11, MAX_HALF = 30, MIN_LATE = 20 };
// By hand.
static const double MIN_BALANCE = 0.6;

struct series {
    const struct body_joint *joint;
    float (*difference)[3];   // smoothed
    float *degrees, *sigma;   // of the difference; NaN where unknown
    float *angle_a, *angle_b; // the joint's named angle, rad
    float *fresh;             // how much of a frame says something new
    float *weight;            // what a frame says against noise
    double begin, stay;       // degrees, see BEGIN_DEGREES
};

struct judge {
    struct comparison *c;
    int32_t count;
    struct limb_shift *limb[LIMBS];
    struct weighed *scratch;
    bool *left_out[2]; // frames of A and B that lie in pieces of their own
    struct series s;
};

static double at_seconds(int32_t frame) { return frame / MOVEMENT_RATE_HZ; }

// ------------------------------------------------------------- the series

struct weighed {
    float value, weight;
};

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static int by_value(const void *a, const void *b)
{
    const float x = ((const struct weighed *)a)->value, y = ((const struct weighed *)b)->value;
    return (x > y) - (x < y);
}

// By 11 bits of the values at a time, which are 0 or more: then floats are in the order of their bits. Stable, as
// glibc's qsort is, and ten times as fast for hours of frames.
static void sort_many(struct weighed *weighed, struct weighed *other, int32_t count)
{
    enum { BITS = 11, PASSES = 3, DIGITS = 1 << BITS };
    for (int pass = 0; pass < PASSES; pass++) {
        int32_t begin[DIGITS + 1] = {0};
        for (int32_t k = 0; k < count; k++)
            begin[1 + (bits_of(weighed[k].value) >> (pass * BITS) & (DIGITS - 1))]++;
        for (int d = 0; d < DIGITS; d++)
            begin[d + 1] += begin[d];
        for (int32_t k = 0; k < count; k++)
            other[begin[bits_of(weighed[k].value) >> (pass * BITS) & (DIGITS - 1)]++] = weighed[k];
        struct weighed *const sorted = other;
        other = weighed;
        weighed = sorted;
    }
    memcpy(other, weighed, (size_t)count * sizeof *weighed); // an odd number of passes
}

// The value below which `share` of the weight is; sorts. Values are 0 or more. NaN: nothing there. v has room for twice
// as many.
static double weighed_quantile(struct weighed *weighed, int32_t count, double share)
{
    enum { MANY = 4096 };
    double sum = 0, before = 0;
    for (int32_t k = 0; k < count; k++)
        sum += weighed[k].weight;
    if (count < MANY)
        qsort(weighed, (size_t)count, sizeof *weighed, by_value);
    else
        sort_many(weighed, weighed + count, count);
    for (int32_t k = 0; k < count; k++) {
        before += weighed[k].weight;
        if (before >= share * sum)
            return weighed[k].value;
    }
    return NAN;
}

// What a frame says against noise of its own and of 3 degrees.
static double weight_of(const struct series *series, int32_t f)
{
    return series->fresh[f] / ((double)series->sigma[f] * series->sigma[f] + 9);
}

// Many frames of B that show one of A (a pause) tell little more than one: A's error is the same in all of them.
static void fill_fresh(const struct judge *judge)
{
    enum { HALF = 2 };
    const double min = 0.2; // of B's own errors; by hand
    const float *reference = judge->c->timeline.reference;
    for (int32_t f = 0; f < judge->count; f++) {
        int32_t first = f, end = f;
        while (first > 0 && first > f - HALF && !isnan(reference[first - 1]))
            first--;
        while (end + 1 < judge->count && end < f + HALF && !isnan(reference[end + 1]))
            end++;
        const double pace = end > first ? ((double)reference[end] - reference[first]) / (end - first) : 1;
        judge->s.fresh[f] = (float)fmax(min, fmin(1, pace));
    }
}

// The frames about f whose `fresh` is SMOOTH_HALF in sum to either side.
static void window_about(const struct series *series, int32_t count, int32_t f, int32_t *first, int32_t *end)
{
    double before = 0, after = 0;
    *first = f;
    *end = f + 1;
    while (*first > 0 && f - *first < MAX_HALF && (before += series->fresh[*first - 1]) <= SMOOTH_HALF)
        --*first;
    while (*end < count && *end - f <= MAX_HALF && (after += series->fresh[*end]) <= SMOOTH_HALF)
        ++*end;
}

// The differences about a frame, axis by axis.
struct smoothing {
    int32_t first, end; // frames that are in it
    struct sliding_quantile axis[3];
};

static void add_frames(struct smoothing *smoothing, const struct series *series, int32_t first, int32_t end)
{
    for (int32_t k = first; k < end; k++)
        for (int axis = 0; axis < 3 && !isnan(series->sigma[k]); axis++)
            sliding_add(&smoothing->axis[axis], k, series->difference[k][axis], series->weight[k]);
}

static void remove_frames(struct smoothing *smoothing, int32_t first, int32_t end)
{
    for (int32_t k = first; k < end; k++)
        for (int axis = 0; axis < 3; axis++)
            sliding_remove(&smoothing->axis[axis], k);
}

static void slide_window(struct smoothing *smoothing, const struct series *series, int32_t first, int32_t end)
{
    if (first >= smoothing->end || end <= smoothing->first) {
        *smoothing = (struct smoothing){.first = first, .end = first};
    } else {
        remove_frames(smoothing, smoothing->first, first);
        remove_frames(smoothing, end, smoothing->end);
        smoothing->first = smoothing->first > first ? smoothing->first : first;
        smoothing->end = smoothing->end < end ? smoothing->end : end;
    }
    add_frames(smoothing, series, first, smoothing->first);
    add_frames(smoothing, series, smoothing->end, end);
    smoothing->first = first;
    smoothing->end = end;
}

// Of the median of the differences about a frame, axis by axis: a tracker's gross mistakes are short, and a median
// passes over what is shorter than half its window. Frames in their order, one window for all of them.
static float smoothed_degrees(const struct series *series, int32_t count, int32_t f, struct smoothing *window)
{
    double square = 0, sum = 0;
    int32_t first, end;
    window_about(series, count, f, &first, &end);
    slide_window(window, series, first, end);
    for (int32_t k = first; k < end; k++)
        sum += isnan(series->sigma[k]) ? 0 : series->weight[k];
    for (int axis = 0; axis < 3; axis++) {
        const double middle = sliding_quantile_of(&window->axis[axis], sum, 0.5);
        square += middle * middle;
    }
    return (float)(2 * RAD * portable_asin(fmin(1, sqrt(square) / 2)));
}

static void fill_frame(struct judge *judge, int32_t f)
{
    const struct comparison *c = judge->c;
    struct series *s = &judge->s;
    const struct body_joint *j = s->joint;
    double d[3] = {0}, sigma = 0;
    s->degrees[f] = s->sigma[f] = s->angle_a[f] = s->angle_b[f] = NAN;
    memset(s->difference[f], 0, sizeof s->difference[f]);
    if (isnan(c->timeline.reference[f]))
        return;
    const double shift = j->limb >= 0 ? judge->limb[j->limb][f].frames : 0;
    const struct movement_frame x = movement_at(&c->a, c->timeline.reference[f] + shift);
    if (!joint_difference(&x, &c->judged.frames[f], j, d, &sigma))
        return;
    for (int k = 0; k < 3; k++)
        s->difference[f][k] = (float)d[k];
    s->sigma[f] = (float)(sigma * RAD);
    s->angle_a[f] = body_angle_of(&x, j->angle);
    s->angle_b[f] = body_angle_of(&c->judged.frames[f], j->angle);
    s->weight[f] = (float)weight_of(s, f);
}

static int32_t end_of_share(const struct judge *judge, int share)
{
    return judge->count - share * FRAMES_AT_ONCE < FRAMES_AT_ONCE ? judge->count : (share + 1) * FRAMES_AT_ONCE;
}

static void fill_share(void *context, int share)
{
    struct judge *judge = context;
    for (int32_t f = share * FRAMES_AT_ONCE; f < end_of_share(judge, share); f++)
        fill_frame(judge, f);
}

// Each share starts with an empty window: a quantile depends on the frames in its window alone.
static void smooth_share(void *context, int share)
{
    struct judge *judge = context;
    struct smoothing window = {.first = 0};
    for (int32_t f = share * FRAMES_AT_ONCE; f < end_of_share(judge, share); f++)
        if (!isnan(judge->s.sigma[f]))
            judge->s.degrees[f] = smoothed_degrees(&judge->s, judge->count, f, &window);
}

static void fill_series(struct judge *judge, const struct body_joint *joint)
{
    const int shares = (int)((judge->count + FRAMES_AT_ONCE - 1) / FRAMES_AT_ONCE);
    judge->s.joint = joint;
    judge->s.begin = judge->c->by.threshold[joint->part] * BEGIN_DEGREES;
    judge->s.stay = judge->c->by.threshold[joint->part] * STAY_DEGREES;
    parallel_for(THREADS, shares, fill_share, judge);
    parallel_for(THREADS, shares, smooth_share, judge);
}

// ------------------------------------------------------------- posture

// What is wrong over first..end - 1.
struct wrong {
    double degrees, angle_degrees, difference[3], sigma;
};

// The degrees below which a share of the frames are, by weight; UPPER_SHARE for the size: it is wrong less where it
// begins and ends, and a tracker's mistakes are more but short. NaN: nothing known.
static double level_of(const struct series *series, int32_t first, int32_t end, double share, struct weighed *scratch)
{
    int32_t count = 0;
    for (int32_t f = first; f < end; f++)
        if (!isnan(series->degrees[f]))
            scratch[count++] = (struct weighed){series->degrees[f], (float)weight_of(series, f)};
    return weighed_quantile(scratch, count, share);
}

// The weighted mean over the frames about that level.
static struct wrong measure_deviation(const struct series *series, int32_t first, int32_t end, struct weighed *scratch)
{
    struct wrong w = {0};
    const double level = level_of(series, first, end, UPPER_SHARE, scratch);
    double used = 0;
    for (int32_t f = first; f < end; f++) {
        if (isnan(series->degrees[f]) || isnan(series->angle_a[f]) || isnan(series->angle_b[f]) ||
            fabs(series->degrees[f] - level) > 0.3 * level)
            continue;
        const double weight = weight_of(series, f);
        w.degrees += weight * series->degrees[f];
        w.sigma += weight * series->sigma[f];
        w.angle_degrees += weight * ((double)series->angle_b[f] - series->angle_a[f]) * RAD;
        for (int k = 0; k < 3; k++)
            w.difference[k] += weight * series->difference[f][k];
        used += weight;
    }
    for (int k = 0; k < 3 && used > 0; k++)
        w.difference[k] /= used;
    w.degrees = used > 0 ? w.degrees / used : 0;
    w.sigma = used > 0 ? w.sigma / used : 0;
    w.angle_degrees = used > 0 ? w.angle_degrees / used : 0;
    return w;
}

static const char *direction_word(const struct judge *judge, const double d[3])
{
    const double x = judge->c->mirrored ? -d[0] : d[0];
    if (fabs(d[2]) >= fabs(d[0]) && fabs(d[2]) >= fabs(d[1]))
        return d[2] > 0 ? "further up" : "further down";
    if (fabs(d[1]) >= fabs(d[0]))
        return d[1] > 0 ? "further forwards" : "further back";
    return x > 0 ? "further to the left" : "further to the right";
}

static bool is_turn(const struct body_joint *joint) { return joint->angle == ANGLE_TWIST; }

// What the joint, or its part where no angle of it is named, is called on one side.
static const char *noun_of(const struct body_joint *joint, bool angle)
{
    if (joint->part == PART_UPPER_TORSO)
        return is_turn(joint) ? turn_noun : "Trunk leans";
    if (joint->part == PART_HEAD)
        return "Head";
    static const char *const names[2][2][2] = {{{"upper arm", "upper arm"}, {"forearm", "elbow"}},
                                               {{"thigh", "hip"}, {"shin", "knee"}}};
    return names[joint->limb >= 2][joint->carrier == CARRIER_PART][angle];
}

// What is wrong in words: noun and predicate; the amount is signed where an angle is named.
static void say_posture(const struct judge *judge, const struct wrong *wrong, struct finding *f)
{
    const struct body_joint *j = judge->s.joint;
    const bool bend = j->carrier == CARRIER_PART, trunk = j->part == PART_UPPER_TORSO,
               arm = j->limb == 0 || j->limb == 1,
               named = fabs(wrong->angle_degrees) >= 0.6 * wrong->degrees && (bend || trunk || arm);
    const bool more = wrong->angle_degrees > 0;
    const char *way = direction_word(judge, wrong->difference);
    f->amount = named ? wrong->angle_degrees : wrong->degrees;
    f->noun = noun_of(j, named);
    if (named && is_turn(j))
        way = more != judge->c->mirrored ? "further to the left" : "further to the right";
    else if (named && trunk)
        way = more ? "further forwards" : "further back";
    else if (named && bend)
        way = more ? "more bent" : "less bent";
    else if (named)
        way = more ? "higher" : "lower";
    snprintf(f->predicate, sizeof f->predicate, "%.0f° %s", fabs(f->amount), way);
}

// Of what is compared, the share that a finding lasts.
static double finding_share(const struct judge *judge, const struct finding *finding)
{
    const double seconds = finding->to_s - finding->from_s;
    return seconds / fmax(seconds, at_seconds(judge->c->pace.b_end - judge->c->pace.b_first));
}

// A part that the reference hardly moves costs less, as in score.h.
static double finding_cost(const struct judge *judge, double degrees, double share)
{
    const enum part part = judge->s.joint->part;
    const double z = degrees / RAD / (judge->c->by.spread[part][DEVIATION_OFFSET] * natural_offset_rad(part));
    const double weight = PART_COUNT * judge->c->terms.part[part].weight; // 1: as the mean part
    return FINDING_COST * robust_cost(z) * sqrt(share * fmin(1, weight));
}

static struct finding new_finding(const struct judge *judge, enum finding_kind kind, int32_t first, int32_t end)
{
    const enum part part = judge->s.joint->part, own = judge->c->mirrored ? mirrored_part(part) : part;
    const char *name = part_name(own);
    const enum body_side side = strncmp(name, "left", 4) == 0 ? SIDE_LEFT : SIDE_RIGHT;
    return (struct finding){.kind = kind,
                            .part = name,
                            .parts = (uint16_t)(1u << part),
                            .side = mirrored_part(own) == own ? SIDE_NONE : side,
                            .from_s = at_seconds(first),
                            .to_s = at_seconds(end),
                            .unit = "deg"};
}

static enum status add_posture(struct judge *judge, int32_t first, int32_t end)
{
    const struct wrong w = measure_deviation(&judge->s, first, end, judge->scratch);
    struct finding f = new_finding(judge, FINDING_POSTURE, first, end);
    say_posture(judge, &w, &f);
    // What may be the joints' own error counts less.
    const double sure = w.degrees * w.degrees / (w.degrees * w.degrees + 4 * w.sigma * w.sigma + 1e-9);
    // Of the mean square of what differs, what is in the mean costs by its part's offset (score.h), and not once more.
    const double share = finding_share(judge, &f);
    f.cost = sure * finding_cost(judge, sqrt(1 - share) * w.degrees, share);
    // Shoulders that are higher on one side, or drawn forwards, are no turn.
    const bool mostly = level_of(&judge->s, first, end, 0.5, judge->scratch) >= judge->s.begin &&
                        (!is_turn(judge->s.joint) || fabs(w.angle_degrees) >= 0.6 * w.degrees);
    return fabs(f.amount) < judge->s.begin || !mostly ? OK : finding_add(judge->c, &f, true);
}

static bool is_finding_begin(const struct series *series, int32_t f)
{
    // The head is short and trackers know it badly.
    const double share = series->joint->part == PART_HEAD ? 2 * SIGMA_SHARE : SIGMA_SHARE;
    return series->degrees[f] >= series->begin + share * series->sigma[f]; // false for NaN
}

static enum status scan_posture(struct judge *judge)
{
    const struct series *s = &judge->s;
    enum status status = OK;
    for (int32_t f = 0; f < judge->count && status == OK; f++) {
        if (!is_finding_begin(s, f))
            continue;
        int32_t first = f, end = f + 1;
        double frames = s->fresh[f];
        while (first > 0 && s->degrees[first - 1] >= s->stay) // false for NaN
            first--;
        for (int32_t k = end; k < judge->count && k < end + MAX_GAP; k++)
            if (s->degrees[k] >= s->stay) {
                end = k + 1;
                frames += is_finding_begin(s, k) ? s->fresh[k] : 0;
            }
        if (frames >= MIN_FRAMES)
            status = add_posture(judge, first, end);
        f = end;
    }
    return status;
}

// ------------------------------------------------------------- range

// Does B's angle follow A's with another gain? Least squares B = gain A + offset against B = A + offset. Or does it
// follow A's all the way, but for what the alignment had to leap over?
static bool gain_explains(const struct series *series, int32_t count, double range_difference)
{
    double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
    for (int32_t f = 0; f < count; f++) {
        if (isnan(series->angle_a[f]) || isnan(series->angle_b[f]))
            continue;
        n++;
        a += series->angle_a[f];
        b += series->angle_b[f];
        aa += (double)series->angle_a[f] * series->angle_a[f];
        ab += (double)series->angle_a[f] * series->angle_b[f];
        bb += (double)series->angle_b[f] * series->angle_b[f];
    }
    if (n < 15)
        return false;
    const double vaa = aa / n - a / n * a / n, vab = ab / n - a / n * b / n, vbb = bb / n - b / n * b / n;
    if (vaa <= 0)
        return false;
    const double gain = vab / vaa, plain = vaa + vbb - 2 * vab, scaled = vbb - gain * vab;
    return (fabs(gain - 1) > 0.12 && scaled < 0.2 * plain) || sqrt(plain) < 0.2 * range_difference;
}

// Of the joint's difference, mean over the frames that know it; degrees.
static double mean_sigma(const struct series *series, int32_t count)
{
    double sum = 0, used = 0;
    for (int32_t f = 0; f < count; f++)
        if (!isnan(series->sigma[f])) {
            sum += series->sigma[f];
            used++;
        }
    return used > 0 ? sum / used : 0;
}

// What an angle goes through over first..end - 1 when its medians are looked at, degrees: what a tracker's short
// mistakes add is not in it.
static double held_range(const struct movement *movement, const bool *left_out, enum body_angle angle, int32_t first,
                         int32_t end)
{
    double low = INFINITY, high = -INFINITY;
    struct sliding_quantile window = {.count = 0};
    for (int32_t f = first, ahead = first; f < end; f++) {
        for (; ahead <= f + SMOOTH_HALF && ahead < end; ahead++) {
            const float rad = body_angle_of(&movement->frames[ahead], angle);
            if (!isnan(rad) && !left_out[ahead])
                sliding_add(&window, ahead, rad, 1);
        }
        const double middle = sliding_quantile_of(&window, window.count, 0.5);
        low = fmin(low, middle); // of a NaN the other
        high = fmax(high, middle);
        sliding_remove(&window, f - SMOOTH_HALF);
    }
    return high > low ? (high - low) * RAD : 0;
}

static bool held_less(const struct judge *judge, double by_degrees)
{
    const struct pace *p = &judge->c->pace;
    const enum body_angle angle = judge->s.joint->angle;
    return 2 * (held_range(&judge->c->a, judge->left_out[0], angle, p->a_first, p->a_end) -
                held_range(&judge->c->judged, judge->left_out[1], angle, p->b_first, p->b_end)) >=
           by_degrees;
}

static enum status scan_range(struct judge *judge, bool *found)
{
    const struct body_joint *j = judge->s.joint;
    const struct angle_range *a = &judge->c->range_a[j->angle], *b = &judge->c->range_b[j->angle];
    const double range_a = ((double)a->high - a->low) * RAD, range_b = ((double)b->high - b->low) * RAD,
                 threshold = judge->c->by.threshold[j->part];
    *found = false;
    if (isnan(range_a) || isnan(range_b) || (j->limb < 0 && !is_turn(j)) || range_a < 25 ||
        range_a - range_b <
            fmax(12 * threshold + SIGMA_SHARE * mean_sigma(&judge->s, judge->count),
                 0.2 * fmin(1, threshold) * range_a) || // going too far is posture: it has a place and a time
        !gain_explains(&judge->s, judge->count, fabs(range_b - range_a) / RAD) ||
        !held_less(judge, range_a - range_b))
        return OK;
    struct finding f = new_finding(judge, FINDING_RANGE, judge->c->pace.b_first, judge->c->pace.b_end);
    f.noun = noun_of(j, true);
    f.amount = range_b - range_a;
    f.cost = finding_cost(judge, 0.5 * fabs(f.amount), finding_share(judge, &f));
    snprintf(f.predicate, sizeof f.predicate, "%.0f° %s: %.0f° instead of %.0f°", fabs(f.amount),
             f.amount < 0 ? "less" : "more", range_b, range_a);
    *found = true;
    return finding_add(judge->c, &f, false);
}

// ------------------------------------------------------------- a limb's time

// A limb that moves less than the reference's, or further, seems late one way and early on the way back: then its time
// is not what differs. Frames that are late less those that are early, as a share of both.
static double late_balance(const struct judge *judge, const struct limb_shift *of)
{
    double late = 0, early = 0;
    for (int32_t f = 0; f < judge->count; f++)
        if (of[f].late)
            *(of[f].frames < 0 ? &late : &early) += 1;
    return late + early > 0 ? fabs(late - early) / (late + early) : 0;
}

static enum status scan_late(struct judge *judge, int limb)
{
    static const enum part parts[LIMBS] = {PART_LEFT_UPPER_ARM, PART_RIGHT_UPPER_ARM, PART_LEFT_THIGH,
                                           PART_RIGHT_THIGH};
    const struct limb_shift *of = judge->limb[limb];
    const uint16_t ignored = judge->c->by.ignored, both = (uint16_t)(3u << parts[limb]); // recording/skeleton.h's order
    const enum part part = ignored >> parts[limb] & 1 ? parts[limb] + 1 : parts[limb];
    enum status status = OK;
    if ((ignored & both) == both || late_balance(judge, of) < MIN_BALANCE)
        return OK;
    for (int k = 0; k < BODY_JOINTS; k++)
        if (body_joints[k].part == part)
            judge->s.joint = &body_joints[k];
    for (int32_t f = 0; f < judge->count && status == OK; f++) {
        int32_t end = f;
        double sum = 0;
        for (; end < judge->count && of[end].late && (of[end].frames < 0) == (of[f].frames < 0); end++)
            sum += of[end].frames;
        if (end - f >= MIN_LATE) {
            // Negative: the limb shows an earlier instant of A, so it is late.
            struct finding x = new_finding(judge, FINDING_TIMING, f, end);
            x.amount = -sum / (end - f) / MOVEMENT_RATE_HZ;
            x.parts = both & (uint16_t)~ignored;
            x.unit = "s";
            x.cost = timing_cost(x.amount);
            x.noun = limb >= 2 ? "leg" : "arm";
            snprintf(x.predicate, sizeof x.predicate, "%.1f s %s", fabs(x.amount), x.amount > 0 ? "late" : "early");
            status = finding_add(judge->c, &x, true);
        }
        f = end > f ? end - 1 : f;
    }
    return status;
}

// ------------------------------------------------------------- all

static bool open_judge(struct judge *judge, struct comparison *comparison)
{
    const size_t n = (size_t)comparison->judged.count;
    *judge = (struct judge){.c = comparison, .count = comparison->judged.count};
    judge->scratch = malloc(2 * n * sizeof *judge->scratch);
    judge->left_out[0] = pace_left_out(&comparison->pace, true, comparison->a.count);
    judge->left_out[1] = pace_left_out(&comparison->pace, false, comparison->judged.count);
    judge->s.difference = malloc(n * sizeof *judge->s.difference);
    judge->s.degrees = malloc(n * sizeof *judge->s.degrees);
    judge->s.sigma = malloc(n * sizeof *judge->s.sigma);
    judge->s.angle_a = malloc(n * sizeof *judge->s.angle_a);
    judge->s.angle_b = malloc(n * sizeof *judge->s.angle_b);
    judge->s.fresh = malloc(n * sizeof *judge->s.fresh);
    judge->s.weight = malloc(n * sizeof *judge->s.weight);
    bool have = judge->scratch && judge->left_out[0] && judge->left_out[1] && judge->s.difference && judge->s.degrees &&
                judge->s.sigma && judge->s.angle_a && judge->s.angle_b && judge->s.fresh && judge->s.weight;
    for (int k = 0; k < LIMBS; k++) {
        judge->limb[k] = malloc(n * sizeof *judge->limb[k]);
        have = have && judge->limb[k];
    }
    return have;
}

static void close_judge(struct judge *judge)
{
    free(judge->scratch);
    free(judge->left_out[0]);
    free(judge->left_out[1]);
    free(judge->s.difference);
    free(judge->s.degrees);
    free(judge->s.sigma);
    free(judge->s.angle_a);
    free(judge->s.angle_b);
    free(judge->s.fresh);
    free(judge->s.weight);
    for (int k = 0; k < LIMBS; k++)
        free(judge->limb[k]);
}

// posture, range and a limb's timing
static enum status find_postures(struct comparison *comparison)
{
    struct judge g;
    enum status status = open_judge(&g, comparison) ? OK : fail(ERR_MEMORY, "no memory for the findings");
    if (status == OK)
        fill_fresh(&g);
    if (status == OK)
        status =
            limb_shifts(&comparison->a, &comparison->judged, &comparison->timeline, comparison->by.ignored, g.limb);
    bool ranged[LIMBS] = {false};
    for (int k = 0; k < BODY_JOINTS && status == OK; k++) {
        bool range = false;
        if (comparison->by.ignored >> body_joints[k].part & 1)
            continue;
        fill_series(&g, &body_joints[k]);
        status = scan_range(&g, &range);
        if (status == OK && !range)
            status = scan_posture(&g);
        if (range && body_joints[k].limb >= 0)
            ranged[body_joints[k].limb] = true;
    }
    for (int limb = 0; limb < LIMBS && status == OK; limb++)
        if (!ranged[limb])
            status = scan_late(&g, limb);
    close_judge(&g);
    return status;
}

// ---------------------------------------------------------------- finding list

// The list of findings, and its words.

const char *finding_kind_name(enum finding_kind kind)
{
    static const char *const kind_names[] = {"posture", "range", "timing", "missing", "extra", "mirrored"};
    return kind_names[kind];
}

const char *part_name(enum part part)
{
    static const char *const kind_names[PART_COUNT] = {
        [PART_HEAD] = "head",
        [PART_UPPER_TORSO] = "upper_torso",
        [PART_LOWER_TORSO] = "lower_torso",
        [PART_LEFT_UPPER_ARM] = "left_upper_arm",
        [PART_LEFT_FOREARM] = "left_forearm",
        [PART_RIGHT_UPPER_ARM] = "right_upper_arm",
        [PART_RIGHT_FOREARM] = "right_forearm",
        [PART_LEFT_THIGH] = "left_thigh",
        [PART_LEFT_SHIN] = "left_shin",
        [PART_RIGHT_THIGH] = "right_thigh",
        [PART_RIGHT_SHIN] = "right_shin",
    };
    return kind_names[part];
}

// Appends. `timed`: the sentence says when. ERR_MEMORY.
static enum status finding_add(struct comparison *comparison, const struct finding *finding, bool timed)
{
    struct finding *more = realloc(comparison->findings, (size_t)(comparison->finding_count + 1) * sizeof *more);
    if (!more)
        return fail(ERR_MEMORY, "no memory for the findings");
    comparison->findings = more;
    more += comparison->finding_count++;
    *more = *finding;
    more->timed = timed;
    return OK;
}

// ---------------------------------------------------------------- one cause, one finding

static double overlap_s(const struct finding *x, const struct finding *y)
{
    return fmin(x->to_s, y->to_s) - fmax(x->from_s, y->from_s);
}

// At the same time for most of the shorter one's, and by amounts of one sign of which one is at most twice the other.
static bool is_alike(const struct finding *x, const struct finding *y)
{
    const double shorter = fmin(x->to_s - x->from_s, y->to_s - y->from_s), a = fabs(x->amount), b = fabs(y->amount);
    return x->kind == y->kind && (x->amount > 0) == (y->amount > 0) && overlap_s(x, y) > 0.5 * shorter && a <= 2 * b &&
           b <= 2 * a;
}

static bool is_one_side(const struct finding *f) { return f->side == SIDE_LEFT || f->side == SIDE_RIGHT; }

static bool is_mirrored_pair(const struct finding *x, const struct finding *y)
{
    return x->noun && y->noun && !strcmp(x->noun, y->noun) && is_one_side(x) && is_one_side(y) && x->side != y->side &&
           is_alike(x, y) &&
           (x->kind == FINDING_RANGE || !strcmp(strchr(x->predicate, ' '), strchr(y->predicate, ' ')));
}

static const uint16_t THIGHS = 1u << PART_LEFT_THIGH | 1u << PART_RIGHT_THIGH,
                      SHINS = 1u << PART_LEFT_SHIN | 1u << PART_RIGHT_SHIN;

// A knee that is bent otherwise takes the hip with it: a squat that is shallower is one thing.
static bool is_hip_of_knee(const struct finding *knee, const struct finding *hip)
{
    return (knee->kind == FINDING_POSTURE || knee->kind == FINDING_RANGE) && (knee->parts & SHINS) &&
           (hip->kind == FINDING_POSTURE || hip->kind == FINDING_RANGE || hip->kind == FINDING_TIMING) &&
           (hip->parts & THIGHS) && (hip->kind == FINDING_TIMING || !(hip->parts & SHINS)) &&
           (hip->side == knee->side || knee->side == SIDE_BOTH) &&
           overlap_s(knee, hip) > 0.5 * (hip->to_s - hip->from_s);
}

static void absorb_finding(struct finding *into, const struct finding *from)
{
    into->parts |= from->parts;
    into->cost = 1 - (1 - into->cost) * (1 - from->cost);
}

static void remove_finding(struct comparison *comparison, int32_t at)
{
    memmove(&comparison->findings[at], &comparison->findings[at + 1],
            (size_t)(comparison->finding_count - at - 1) * sizeof *comparison->findings);
    comparison->finding_count--;
}

// Both sides' findings of one kind become one, which says the greater amount's numbers.
static void merge_sides(struct comparison *comparison)
{
    for (int32_t i = 0; i < comparison->finding_count; i++)
        for (int32_t k = i + 1; k < comparison->finding_count; k++) {
            struct finding *x = &comparison->findings[i], *y = &comparison->findings[k];
            if (!is_mirrored_pair(x, y))
                continue;
            const bool first = fabs(x->amount) >= fabs(y->amount);
            struct finding both = first ? *x : *y;
            absorb_finding(&both, first ? y : x);
            both.side = SIDE_BOTH;
            both.from_s = fmin(x->from_s, y->from_s);
            both.to_s = fmax(x->to_s, y->to_s);
            *x = both;
            remove_finding(comparison, k);
            break;
        }
}

static bool absorb_hip(struct comparison *comparison)
{
    for (int32_t i = 0; i < comparison->finding_count; i++)
        for (int32_t k = 0; k < comparison->finding_count; k++)
            if (i != k && is_hip_of_knee(&comparison->findings[i], &comparison->findings[k])) {
                absorb_finding(&comparison->findings[i], &comparison->findings[k]);
                remove_finding(comparison, k);
                return true;
            }
    return false;
}

static void compose_sentence(struct finding *f)
{
    static const char *const sides[] = {[SIDE_LEFT] = "Left ", [SIDE_RIGHT] = "Right ", [SIDE_BOTH] = "Both "};
    char *text = f->sentence;
    const size_t size = sizeof f->sentence;
    size_t used = strlen(text);
    const bool both = f->side == SIDE_BOTH,
               hips = (f->parts & SHINS) && (f->parts & THIGHS) && f->kind != FINDING_TIMING;
    const char *through = "";
    if (f->kind == FINDING_RANGE)
        through = both || hips ? " go through" : " goes through";
    if (f->noun && f->side == SIDE_NONE)
        used = (size_t)snprintf(text, size, "%s %s", f->noun, f->predicate);
    else if (f->noun && hips)
        used = (size_t)snprintf(text, size, "%s%s%s %s", sides[f->side], both ? "knees and hips" : "knee and hip",
                                through, f->predicate);
    else if (f->noun)
        used = (size_t)snprintf(text, size, "%s%s%s%s %s", sides[f->side], f->noun, both ? "s" : "", through,
                                f->predicate);
    if (f->timed && used < size)
        snprintf(text + used, size - used, ", from %.1f s to %.1f s%s", f->from_s, f->to_s,
                 f->kind == FINDING_MISSING ? " of the reference" : "");
}

// ---------------------------------------------------------------- losses

// A finding's share of what all pieces of its kind take away. 0: it is none, or one of whole repetitions.
static double piece_share(const struct comparison *comparison, const struct finding *f)
{
    double all_s = 0;
    if ((f->kind != FINDING_MISSING && f->kind != FINDING_EXTRA) || strcmp(f->unit, "s") != 0)
        return 0;
    for (int32_t k = 0; k < comparison->finding_count; k++) {
        const struct finding *other = &comparison->findings[k];
        all_s += other->kind == f->kind && !strcmp(other->unit, "s") ? other->amount : 0;
    }
    return all_s > 0 ? f->amount / all_s : 0;
}

// What a finding's parts cost, each shared among the findings that name it, and what it costs beside.
static double whole_cost(const struct comparison *comparison, const struct finding *f)
{
    const struct score_terms *terms = &comparison->terms;
    double sum = f->cost;
    for (int p = 0; p < PART_COUNT; p++) {
        int sharing = 0;
        for (int32_t k = 0; k < comparison->finding_count; k++)
            sharing += comparison->findings[k].parts >> p & 1;
        if (f->parts >> p & 1)
            sum += terms->part[p].weight * terms->part[p].cost / sharing;
    }
    return sum + piece_share(comparison, f) * (f->kind == FINDING_MISSING ? terms->missing_share : terms->extra_share);
}

// What a finding costs a repetition that it lies in, by how much of that it lasts.
static void judge_each_repetition(struct comparison *comparison)
{
    const double whole_s = at_seconds(comparison->pace.b_end - comparison->pace.b_first);
    for (int32_t k = 0; k < comparison->repetitions.count; k++) {
        struct performance *performance = &comparison->repetitions.at[k];
        const struct finding span = {.from_s = at_seconds(performance->attempt.first),
                                     .to_s = at_seconds(performance->attempt.end)};
        double square = 0;
        for (int32_t n = 0; n < comparison->finding_count; n++) {
            const struct finding *f = &comparison->findings[n];
            const double in_s = fmax(0, overlap_s(f, &span)), of_whole = (f->to_s - f->from_s) / fmax(1e-9, whole_s);
            const double cost = f->cost / sqrt(fmin(1, fmax(1e-3, of_whole))) * sqrt(in_s / (span.to_s - span.from_s));
            square += f->kind == FINDING_POSTURE ? cost * cost : 0;
        }
        performance->score *= 1 - fmin(1, sqrt(square));
    }
}

// Shares what the score lacks among the findings; what deviates without being worth a sentence keeps its own.
static void share_loss(struct comparison *comparison)
{
    const struct score_terms *terms = &comparison->terms;
    double all = terms->posture + terms->missing_share + terms->extra_share;
    for (int32_t k = 0; k < comparison->finding_count; k++)
        all += comparison->findings[k].cost;
    const double lost = 100 - score_from_terms(terms);
    for (int32_t k = 0; k < comparison->finding_count && all > 0; k++)
        comparison->findings[k].loss = whole_cost(comparison, &comparison->findings[k]) / all * lost;
}

// ---------------------------------------------------------------- findings

static int worst_first(const void *a, const void *b)
{
    const struct finding *x = a, *y = b;
    const bool mirrored_x = x->kind == FINDING_MIRRORED, mirrored_y = y->kind == FINDING_MIRRORED;
    if (mirrored_x != mirrored_y)
        return mirrored_x ? -1 : 1;
    if (x->loss != y->loss)
        return x->loss < y->loss ? 1 : -1;
    return (x->from_s > y->from_s) - (x->from_s < y->from_s);
}

enum status findings_make(struct comparison *c)
{
    enum status status = find_pieces(c);
    if (status == OK)
        status = find_postures(c);
    if (status != OK)
        return status;
    merge_sides(c);
    while (absorb_hip(c))
        ;
    double square = 0; // several findings have one cause more often than not: less than their sum
    for (int32_t k = 0; k < c->finding_count; k++) {
        compose_sentence(&c->findings[k]);
        square += c->findings[k].cost * c->findings[k].cost;
    }
    c->terms.findings = fmin(1, sqrt(square));
    share_loss(c);
    judge_each_repetition(c);
    if (c->finding_count > 1)
        qsort(c->findings, (size_t)c->finding_count, sizeof *c->findings, worst_first);
    return OK;
}
