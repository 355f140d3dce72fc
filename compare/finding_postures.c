// Findings about one joint: posture and range; and about one limb: early or late.
#include "compare/findings_internal.h"
#include "compare/limb_times.h"
#include "compare/sliding_quantile.h"

#include "base/parallel.h"
#include "base/portable_math.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double RAD = 180 / 3.14159265358979323846; // degrees in a radian

// By hand. A posture is found where it is off by 10 degrees and 1.2 standard deviations for 0.3 s in all, as long as it
// stays above 6; gaps of 0.3 s do not end it. It is off by as much as in the upper third of that time.
static const double BEGIN_DEGREES = 10, STAY_DEGREES = 6, SIGMA_SHARE = 1.2, UPPER_SHARE = 0.67;
// As in score.h, half of what a joint is off by all along is build, dress and where a sensor puts the joints: as little
// as it is off for a quarter of the time.
static const double OFFSET_SHARE = 0.5, OFFSET_QUANTILE = 0.25;
enum { FRAMES_AT_ONCE = 4096, THREADS = 4 }; // a thread's share of a long attempt; a short one has none of its own
enum { LEAST_FRAMES = 9, MOST_GAP = 9, SMOOTH_HALF = 11, MOST_HALF = 30, LEAST_LATE = 20 };

struct series {
    const struct body_joint *joint;
    float (*difference)[3];   // smoothed
    float *degrees, *sigma;   // of the difference; NaN where unknown
    float *angle_a, *angle_b; // the joint's named angle, rad
    float *fresh;             // how much of a frame says something new
    float *weight;            // what a frame says against noise
    double offset;            // degrees: what it is off by all along
};

struct judge {
    struct comparison *c;
    int32_t count;
    struct limb_shift *limb[LIMBS];
    struct weighed *scratch;
    struct series s;
};

static double at_seconds(int32_t frame) { return frame / MOVEMENT_RATE_HZ; }

// Names as the attempt's own sides: what was judged may be its mirror image.
static const char *side_word(const struct judge *g, enum part p)
{
    const enum part own = g->c->mirrored ? mirrored_part(p) : p;
    return strncmp(part_name(own), "left", 4) ? "Right" : "Left";
}

static const char *own_part(const struct judge *g, enum part p)
{
    return part_name(g->c->mirrored ? mirrored_part(p) : p);
}

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
static void sort_many(struct weighed *v, struct weighed *other, int32_t count)
{
    enum { BITS = 11, PASSES = 3, DIGITS = 1 << BITS };
    for (int pass = 0; pass < PASSES; pass++) {
        int32_t begin[DIGITS + 1] = {0};
        for (int32_t k = 0; k < count; k++)
            begin[1 + (bits_of(v[k].value) >> (pass * BITS) & (DIGITS - 1))]++;
        for (int d = 0; d < DIGITS; d++)
            begin[d + 1] += begin[d];
        for (int32_t k = 0; k < count; k++)
            other[begin[bits_of(v[k].value) >> (pass * BITS) & (DIGITS - 1)]++] = v[k];
        struct weighed *const sorted = other;
        other = v;
        v = sorted;
    }
    memcpy(other, v, (size_t)count * sizeof *v); // an odd number of passes
}

// The value below which `share` of the weight is; sorts. Values are 0 or more. NaN: nothing there. v has room for twice
// as many.
static double weighed_quantile(struct weighed *v, int32_t count, double share)
{
    enum { MANY = 4096 };
    double sum = 0, before = 0;
    for (int32_t k = 0; k < count; k++)
        sum += v[k].weight;
    if (count < MANY)
        qsort(v, (size_t)count, sizeof *v, by_value);
    else
        sort_many(v, v + count, count);
    for (int32_t k = 0; k < count; k++) {
        before += v[k].weight;
        if (before >= share * sum)
            return v[k].value;
    }
    return NAN;
}

// What a frame says against noise of its own and of 3 degrees.
static double weight_of(const struct series *s, int32_t f)
{
    return s->fresh[f] / ((double)s->sigma[f] * s->sigma[f] + 9);
}

// Many frames of B that show one of A (a pause) tell little more than one: A's error is the same in all of them.
static void fill_fresh(const struct judge *g)
{
    enum { HALF = 2 };
    const double least = 0.2; // of B's own errors; by hand
    const float *reference = g->c->timeline.reference;
    for (int32_t f = 0; f < g->count; f++) {
        int32_t first = f, end = f;
        while (first > 0 && first > f - HALF && !isnan(reference[first - 1]))
            first--;
        while (end + 1 < g->count && end < f + HALF && !isnan(reference[end + 1]))
            end++;
        const double pace = end > first ? ((double)reference[end] - reference[first]) / (end - first) : 1;
        g->s.fresh[f] = (float)fmax(least, fmin(1, pace));
    }
}

// The frames about f whose `fresh` is SMOOTH_HALF in sum to either side.
static void window_about(const struct series *s, int32_t count, int32_t f, int32_t *first, int32_t *end)
{
    double before = 0, after = 0;
    *first = f;
    *end = f + 1;
    while (*first > 0 && f - *first < MOST_HALF && (before += s->fresh[*first - 1]) <= SMOOTH_HALF)
        --*first;
    while (*end < count && *end - f <= MOST_HALF && (after += s->fresh[*end]) <= SMOOTH_HALF)
        ++*end;
}

// The differences about a frame, axis by axis.
struct smoothing {
    int32_t first, end; // frames that are in it
    struct sliding_quantile axis[3];
};

static void add_frames(struct smoothing *w, const struct series *s, int32_t first, int32_t end)
{
    for (int32_t k = first; k < end; k++)
        for (int axis = 0; axis < 3 && !isnan(s->sigma[k]); axis++)
            sliding_add(&w->axis[axis], k, s->difference[k][axis], s->weight[k]);
}

static void remove_frames(struct smoothing *w, int32_t first, int32_t end)
{
    for (int32_t k = first; k < end; k++)
        for (int axis = 0; axis < 3; axis++)
            sliding_remove(&w->axis[axis], k);
}

static void slide(struct smoothing *w, const struct series *s, int32_t first, int32_t end)
{
    if (first >= w->end || end <= w->first) {
        *w = (struct smoothing){.first = first, .end = first};
    } else {
        remove_frames(w, w->first, first);
        remove_frames(w, end, w->end);
        w->first = w->first > first ? w->first : first;
        w->end = w->end < end ? w->end : end;
    }
    add_frames(w, s, first, w->first);
    add_frames(w, s, w->end, end);
    w->first = first;
    w->end = end;
}

// Of the median of the differences about a frame, axis by axis: a tracker's gross mistakes are short, and a median
// passes over what is shorter than half its window. Frames in their order, one window for all of them.
static float smoothed_degrees(const struct series *s, int32_t count, int32_t f, struct smoothing *window)
{
    double square = 0, sum = 0;
    int32_t first, end;
    window_about(s, count, f, &first, &end);
    slide(window, s, first, end);
    for (int32_t k = first; k < end; k++)
        sum += isnan(s->sigma[k]) ? 0 : s->weight[k];
    for (int axis = 0; axis < 3; axis++) {
        const double middle = sliding_quantile_of(&window->axis[axis], sum, 0.5);
        square += middle * middle;
    }
    return (float)(2 * RAD * portable_asin(fmin(1, sqrt(square) / 2)));
}

static double offset_degrees(const struct judge *g)
{
    int32_t used = 0;
    for (int32_t f = 0; f < g->count; f++)
        if (!isnan(g->s.degrees[f]))
            g->scratch[used++] = (struct weighed){g->s.degrees[f], g->s.fresh[f]};
    return used ? weighed_quantile(g->scratch, used, OFFSET_QUANTILE) : 0;
}

static void fill_frame(struct judge *g, int32_t f)
{
    const struct comparison *c = g->c;
    struct series *s = &g->s;
    const struct body_joint *j = s->joint;
    double d[3] = {0}, sigma = 0;
    s->degrees[f] = s->sigma[f] = s->angle_a[f] = s->angle_b[f] = NAN;
    memset(s->difference[f], 0, sizeof s->difference[f]);
    if (isnan(c->timeline.reference[f]))
        return;
    const double shift = j->limb >= 0 ? g->limb[j->limb][f].frames : 0;
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

static int32_t end_of_share(const struct judge *g, int share)
{
    return g->count - share * FRAMES_AT_ONCE < FRAMES_AT_ONCE ? g->count : (share + 1) * FRAMES_AT_ONCE;
}

static void fill_share(void *context, int share)
{
    struct judge *g = context;
    for (int32_t f = share * FRAMES_AT_ONCE; f < end_of_share(g, share); f++)
        fill_frame(g, f);
}

// The window begins anew with each share; its quantiles do not depend on what it held before.
static void smooth_share(void *context, int share)
{
    struct judge *g = context;
    struct smoothing window = {.first = 0};
    for (int32_t f = share * FRAMES_AT_ONCE; f < end_of_share(g, share); f++)
        if (!isnan(g->s.sigma[f]))
            g->s.degrees[f] = smoothed_degrees(&g->s, g->count, f, &window);
}

static void fill(struct judge *g, const struct body_joint *j)
{
    const int shares = (int)((g->count + FRAMES_AT_ONCE - 1) / FRAMES_AT_ONCE);
    g->s.joint = j;
    parallel_for(THREADS, shares, fill_share, g);
    parallel_for(THREADS, shares, smooth_share, g);
    g->s.offset = offset_degrees(g);
}

// ------------------------------------------------------------- posture

// What is wrong over first..end - 1.
struct wrong {
    double degrees, angle_degrees, difference[3], sigma;
};

// The degrees below which a share of the frames are, by weight; UPPER_SHARE for the size: it is wrong less where it
// begins and ends, and a tracker's mistakes are more but short. NaN: nothing known.
static double level_of(const struct series *s, int32_t first, int32_t end, double share, struct weighed *scratch)
{
    int32_t count = 0;
    for (int32_t f = first; f < end; f++)
        if (!isnan(s->degrees[f]))
            scratch[count++] = (struct weighed){s->degrees[f], (float)weight_of(s, f)};
    return weighed_quantile(scratch, count, share);
}

// The weighted mean over the frames about that level.
static struct wrong measure(const struct series *s, int32_t first, int32_t end, struct weighed *scratch)
{
    struct wrong w = {0};
    const double level = level_of(s, first, end, UPPER_SHARE, scratch);
    double used = 0;
    for (int32_t f = first; f < end; f++) {
        if (isnan(s->degrees[f]) || isnan(s->angle_a[f]) || isnan(s->angle_b[f]) ||
            fabs(s->degrees[f] - level) > 0.3 * level)
            continue;
        const double weight = weight_of(s, f);
        w.degrees += weight * s->degrees[f];
        w.sigma += weight * s->sigma[f];
        w.angle_degrees += weight * ((double)s->angle_b[f] - s->angle_a[f]) * RAD;
        for (int k = 0; k < 3; k++)
            w.difference[k] += weight * s->difference[f][k];
        used += weight;
    }
    for (int k = 0; k < 3 && used > 0; k++)
        w.difference[k] /= used;
    w.degrees = used > 0 ? w.degrees / used : 0;
    w.sigma = used > 0 ? w.sigma / used : 0;
    w.angle_degrees = used > 0 ? w.angle_degrees / used : 0;
    return w;
}

static const char *direction_word(const struct judge *g, const double d[3])
{
    const double x = g->c->mirrored ? -d[0] : d[0];
    if (fabs(d[2]) >= fabs(d[0]) && fabs(d[2]) >= fabs(d[1]))
        return d[2] > 0 ? "further up" : "further down";
    if (fabs(d[1]) >= fabs(d[0]))
        return d[1] > 0 ? "further forwards" : "further back";
    return x > 0 ? "further to the left" : "further to the right";
}

// The sentence without its times; *amount is signed where an angle is named.
static void say(const struct judge *g, const struct wrong *w, double *amount, char *text, size_t size)
{
    const struct body_joint *j = g->s.joint;
    const bool named = fabs(w->angle_degrees) >= 0.6 * w->degrees;
    const double degrees = named ? fabs(w->angle_degrees) : w->degrees;
    const char *side = side_word(g, j->part), *where = direction_word(g, w->difference);
    const bool more = w->angle_degrees > 0;
    const char *forwards = more ? "further forwards" : "further back", *upwards = more ? "higher" : "lower";
    *amount = named ? w->angle_degrees : w->degrees;
    if (j->part == PART_UPPER_TORSO)
        snprintf(text, size, "Trunk leans %.0f° %s", degrees, named ? forwards : where);
    else if (j->part == PART_HEAD)
        snprintf(text, size, "Head %.0f° %s", w->degrees, where);
    else if (j->carrier == CARRIER_PART && named)
        snprintf(text, size, "%s %s %.0f° %s bent", side, j->limb < 2 ? "elbow" : "knee", degrees,
                 more ? "more" : "less");
    else if (j->carrier == CARRIER_PART)
        snprintf(text, size, "%s %s %.0f° %s", side, j->limb < 2 ? "forearm" : "shin", w->degrees, where);
    else if (j->limb < 2)
        snprintf(text, size, "%s upper arm %.0f° %s", side, degrees, named ? upwards : where);
    else
        snprintf(text, size, "%s thigh %.0f° %s", side, w->degrees, where);
    if (j->part == PART_HEAD || (j->part != PART_UPPER_TORSO && j->limb >= 2 && j->carrier != CARRIER_PART))
        *amount = w->degrees;
}

static enum status add_posture(struct judge *g, int32_t first, int32_t end)
{
    const struct wrong w = measure(&g->s, first, end, g->scratch);
    struct finding f = {.kind = FINDING_POSTURE,
                        .part = own_part(g, g->s.joint->part),
                        .from_s = at_seconds(first),
                        .to_s = at_seconds(end),
                        .unit = "deg"};
    say(g, &w, &f.amount, f.sentence, sizeof f.sentence);
    // By how much it counts: what may be the joints' own error counts less.
    const double sure = w.degrees * w.degrees / (w.degrees * w.degrees + 4 * w.sigma * w.sigma + 1e-9);
    f.weight = sure * (w.degrees - OFFSET_SHARE * g->s.offset) * fmin(1.5, sqrt(f.to_s - f.from_s)) *
               (g->s.joint->part == PART_HEAD ? 0.6 : 1);
    const bool mostly = level_of(&g->s, first, end, 0.5, g->scratch) >= BEGIN_DEGREES;
    return w.degrees < BEGIN_DEGREES || !mostly ? OK : finding_add(g->c, &f, true);
}

static bool begins(const struct series *s, int32_t f)
{
    // The head is short and trackers know it badly.
    const double share = s->joint->part == PART_HEAD ? 2 * SIGMA_SHARE : SIGMA_SHARE;
    return s->degrees[f] >= BEGIN_DEGREES + share * s->sigma[f]; // false for NaN
}

static enum status scan_posture(struct judge *g)
{
    const struct series *s = &g->s;
    enum status status = OK;
    for (int32_t f = 0; f < g->count && status == OK; f++) {
        if (!begins(s, f))
            continue;
        int32_t first = f, end = f + 1;
        double frames = s->fresh[f];
        while (first > 0 && s->degrees[first - 1] >= STAY_DEGREES) // false for NaN
            first--;
        for (int32_t k = end; k < g->count && k < end + MOST_GAP; k++)
            if (s->degrees[k] >= STAY_DEGREES) {
                end = k + 1;
                frames += begins(s, k) ? s->fresh[k] : 0;
            }
        if (frames >= LEAST_FRAMES)
            status = add_posture(g, first, end);
        f = end;
    }
    return status;
}

// ------------------------------------------------------------- range

// Does B's angle follow A's with another gain? Least squares B = gain A + offset against B = A + offset. Or does it
// follow A's all the way, but for what the alignment had to leap over?
static bool gain_explains(const struct series *s, int32_t count, double range_difference)
{
    double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
    for (int32_t f = 0; f < count; f++) {
        if (isnan(s->angle_a[f]) || isnan(s->angle_b[f]))
            continue;
        n++;
        a += s->angle_a[f];
        b += s->angle_b[f];
        aa += (double)s->angle_a[f] * s->angle_a[f];
        ab += (double)s->angle_a[f] * s->angle_b[f];
        bb += (double)s->angle_b[f] * s->angle_b[f];
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
static double mean_sigma(const struct series *s, int32_t count)
{
    double sum = 0, used = 0;
    for (int32_t f = 0; f < count; f++)
        if (!isnan(s->sigma[f])) {
            sum += s->sigma[f];
            used++;
        }
    return used > 0 ? sum / used : 0;
}

// What an angle goes through over first..end - 1 when its medians are looked at, degrees: what a tracker's short
// mistakes add is not in it.
static double held_range(const struct movement *m, enum body_angle angle, int32_t first, int32_t end)
{
    double low = INFINITY, high = -INFINITY;
    struct sliding_quantile window = {.count = 0};
    for (int32_t f = first, ahead = first; f < end; f++) {
        for (; ahead <= f + SMOOTH_HALF && ahead < end; ahead++) {
            const float rad = body_angle_of(&m->frames[ahead], angle);
            if (!isnan(rad))
                sliding_add(&window, ahead, rad, 1);
        }
        const double middle = sliding_quantile_of(&window, window.count, 0.5);
        low = fmin(low, middle); // of a NaN the other
        high = fmax(high, middle);
        sliding_remove(&window, f - SMOOTH_HALF);
    }
    return high > low ? (high - low) * RAD : 0;
}

static bool held_less(const struct judge *g, double by_degrees)
{
    const struct pace *p = &g->c->pace;
    const enum body_angle angle = g->s.joint->angle;
    return 2 * (held_range(&g->c->a, angle, p->a_first, p->a_end) -
                held_range(&g->c->judged, angle, p->b_first, p->b_end)) >=
           by_degrees;
}

static enum status scan_range(struct judge *g, bool *found)
{
    const struct body_joint *j = g->s.joint;
    const struct angle_range *a = &g->c->range_a[j->angle], *b = &g->c->range_b[j->angle];
    const double range_a = ((double)a->high - a->low) * RAD, range_b = ((double)b->high - b->low) * RAD;
    *found = false;
    if (isnan(range_a) || isnan(range_b) || j->limb < 0 || range_a < 25 ||
        range_a - range_b < fmax(12 + SIGMA_SHARE * mean_sigma(&g->s, g->count),
                                 0.2 * range_a) || // going too far is posture: it has a place and a time
        !gain_explains(&g->s, g->count, fabs(range_b - range_a) / RAD) ||
        !held_less(g, range_a - range_b))
        return OK;
    static const char *const names[2][2] = {{"upper arm", "elbow"}, {"hip", "knee"}};
    const char *name = names[j->limb >= 2][j->carrier == CARRIER_PART];
    struct finding f = {FINDING_RANGE,
                        own_part(g, j->part),
                        at_seconds(g->c->pace.b_first),
                        at_seconds(g->c->pace.b_end),
                        range_b - range_a,
                        "deg",
                        fabs(range_b - range_a),
                        ""};
    snprintf(f.sentence, sizeof f.sentence, "%s %s goes through %.0f° %s: %.0f° instead of %.0f°",
             side_word(g, j->part), name, fabs(range_b - range_a), range_b < range_a ? "less" : "more", range_b,
             range_a);
    *found = true;
    return finding_add(g->c, &f, false);
}

// ------------------------------------------------------------- a limb's time

static enum status scan_late(struct judge *g, int limb)
{
    static const char *const names[2] = {"arm", "leg"};
    static const enum part parts[LIMBS] = {PART_LEFT_UPPER_ARM, PART_RIGHT_UPPER_ARM, PART_LEFT_THIGH,
                                           PART_RIGHT_THIGH};
    const struct limb_shift *of = g->limb[limb];
    enum status status = OK;
    for (int32_t f = 0; f < g->count && status == OK; f++) {
        int32_t end = f;
        double sum = 0;
        for (; end < g->count && of[end].late && (of[end].frames < 0) == (of[f].frames < 0); end++)
            sum += of[end].frames;
        if (end - f >= LEAST_LATE) {
            // Negative: the limb shows an earlier instant of A, so it is late.
            const double late_s = -sum / (end - f) / MOVEMENT_RATE_HZ;
            struct finding x = {FINDING_TIMING,
                                own_part(g, parts[limb]),
                                at_seconds(f),
                                at_seconds(end),
                                late_s,
                                "s",
                                80 * fabs(late_s),
                                ""};
            snprintf(x.sentence, sizeof x.sentence, "%s %s %.1f s %s", side_word(g, parts[limb]), names[limb >= 2],
                     fabs(late_s), late_s > 0 ? "late" : "early");
            status = finding_add(g->c, &x, true);
        }
        f = end > f ? end - 1 : f;
    }
    return status;
}

// ------------------------------------------------------------- all

static bool open(struct judge *g, struct comparison *c)
{
    const size_t n = (size_t)c->judged.count;
    *g = (struct judge){.c = c, .count = c->judged.count};
    g->scratch = malloc(2 * n * sizeof *g->scratch);
    g->s.difference = malloc(n * sizeof *g->s.difference);
    g->s.degrees = malloc(n * sizeof *g->s.degrees);
    g->s.sigma = malloc(n * sizeof *g->s.sigma);
    g->s.angle_a = malloc(n * sizeof *g->s.angle_a);
    g->s.angle_b = malloc(n * sizeof *g->s.angle_b);
    g->s.fresh = malloc(n * sizeof *g->s.fresh);
    g->s.weight = malloc(n * sizeof *g->s.weight);
    bool have = g->scratch && g->s.difference && g->s.degrees && g->s.sigma && g->s.angle_a && g->s.angle_b &&
                g->s.fresh && g->s.weight;
    for (int k = 0; k < LIMBS; k++) {
        g->limb[k] = malloc(n * sizeof *g->limb[k]);
        have = have && g->limb[k];
    }
    return have;
}

static void close(struct judge *g)
{
    free(g->scratch);
    free(g->s.difference);
    free(g->s.degrees);
    free(g->s.sigma);
    free(g->s.angle_a);
    free(g->s.angle_b);
    free(g->s.fresh);
    free(g->s.weight);
    for (int k = 0; k < LIMBS; k++) {
        free(g->limb[k]);
    }
}

enum status find_postures(struct comparison *c)
{
    struct judge g;
    enum status status = open(&g, c) ? OK : fail(ERR_MEMORY, "no memory for the findings");
    if (status == OK)
        fill_fresh(&g);
    if (status == OK)
        status = limb_shifts(&c->a, &c->judged, &c->timeline, g.limb);
    for (int limb = 0; limb < LIMBS && status == OK; limb++)
        status = scan_late(&g, limb);
    for (int k = 0; k < BODY_JOINTS && status == OK; k++) {
        bool range = false;
        fill(&g, &body_joints[k]);
        status = scan_range(&g, &range);
        if (status == OK && !range)
            status = scan_posture(&g);
    }
    close(&g);
    return status;
}
