#include "compare/findings.h"

#include "base/threads.h"
#include "base/portable_math.h"
#include "compare/difference.h"
#include "compare/movement.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum status finding_add(struct comparison *c, const struct finding *f, bool timed);

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

static void append(char *out, const char *text)
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
        append(out, count ? ", the " : "the ");
        if (joint_words[k].two && !(left && right))
            append(out, left ? "left " : "right ");
        append(out, left && right ? joint_words[k].two : joint_words[k].one);
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
    append(out, *out ? "; " : "could not be judged: ");
    append(out, text);
    append(out, count > 1 ? " are " : " is ");
    append(out, how);
    append(out, where);
}

// Parts that are known too seldom although their joints are known at times.
static void say_parts(const struct comparison *c, char out[NOT_JUDGED_BYTES])
{
    for (int p = 0; p < PART_COUNT; p++) {
        char text[64];
        if (c->parts >> p & 1)
            continue;
        snprintf(text, sizeof text, "%sthe %s", *out ? ", " : "could not be judged: ", part_name((enum part)p));
        for (char *at = text; (at = strchr(at, '_'));)
            *at = ' ';
        append(out, text);
    }
    append(out, ": hardly ever seen whole");
}

const char *not_judged_text(const struct comparison *c, char out[NOT_JUDGED_BYTES])
{
    const uint16_t none_a = (uint16_t)~c->a.joints_ever, none_b = (uint16_t)~c->b.joints_ever,
                   few_a = c->a.joints_ever & (uint16_t)~c->a.joints_often,
                   few_b = c->b.joints_ever & (uint16_t)~c->b.joints_often;
    *out = 0;
    if (!(~c->parts & ((1u << PART_COUNT) - 1)))
        return out;
    say_not_judged(none_a & none_b, "in neither movement", "", out);
    say_not_judged(none_b & (uint16_t)~none_a, "not in ", "the attempt", out);
    say_not_judged(none_a & (uint16_t)~none_b, "not in ", "the reference", out);
    say_not_judged(few_b, "hardly ever in ", "the attempt", out);
    say_not_judged(few_a, "hardly ever in ", "the reference", out);
    if (!*out)
        say_parts(c, out);
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

int judged_part(const struct comparison *c, int part)
{
    return part >= 0 && c->mirrored ? (int)mirrored_part((enum part)part) : part;
}

double finding_worst_s(const struct comparison *c, const struct finding *f)
{
    const int32_t first = (int32_t)(f->from_s * MOVEMENT_RATE_HZ + 0.5), end = (int32_t)(f->to_s * MOVEMENT_RATE_HZ);
    const int judged = judged_part(c, part_by_name(f->part));
    double worst_s = 0.5 * (f->from_s + f->to_s);
    float most = 0;
    for (int32_t k = first; k < end && k < c->judged.count && judged >= 0; k++) {
        struct part_difference parts[PART_COUNT];
        part_differences(&c->a, &c->judged, &c->timeline, k, parts);
        if (parts[judged].verdict == VERDICT_DIFFERENT && parts[judged].angle_rad > most) {
            most = parts[judged].angle_rad;
            worst_s = k / MOVEMENT_RATE_HZ;
        }
    }
    return worst_s;
}

// ---------------------------------------------------------------- finding pieces

// Findings about time as a whole: what is missing or added, pauses, pace, repetitions, the side.

// A second longer or shorter counts as 20 degrees do for a second: a pause that is hardly noticed comes last. By hand.
#define PAUSE_WEIGHT 20

enum { LEAST_REST = 18, SAME_REST = 15, LEAST_NET = 10 }; // frames; by hand

static double seconds(double frames) { return frames / MOVEMENT_RATE_HZ; }

// "second": of the whole turns of the movement, which one ends nearest to `frame`?
static int which_turn(const struct movement *m, int32_t frame)
{
    const double whole = 5.2; // 300 degrees: a turn that is not quite closed counts
    double from = m->frames[0].heading;
    int turns = 0;
    for (int32_t f = 0; f <= frame && f < m->count; f++)
        if (fabs((double)m->frames[f].heading - from) >= whole) {
            turns++;
            from = m->frames[f].heading;
        }
    return turns;
}

static const char *ordinal(int n)
{
    static const char *const names[] = {"", "first", "second", "third", "fourth", "fifth", "sixth"};
    return n >= 1 && n <= 6 ? names[n] : "last";
}

static enum status of_piece(struct comparison *c, const struct piece *p)
{
    struct finding f = {.part = "body", .unit = "s"};
    const double a_s = seconds(p->a_end - p->a_first), b_s = seconds(p->b_end - p->b_first);
    const bool turn = fabs(p->turned_rad) > 2.6; // 150 degrees
    f.from_s = seconds(p->b_first);
    f.to_s = seconds(p->b_end);
    switch (p->kind) {
    case PIECE_MISSING:
        f.kind = FINDING_MISSING;
        f.from_s = seconds(p->a_first);
        f.to_s = seconds(p->a_end);
        f.amount = a_s;
        f.weight = 60 + 20 * a_s;
        if (turn)
            snprintf(f.sentence, sizeof f.sentence, "The %s turn is missing", ordinal(which_turn(&c->a, p->a_end)));
        else
            snprintf(f.sentence, sizeof f.sentence, "%.1f s of the reference are missing", a_s);
        break;
    case PIECE_EXTRA:
        f.kind = FINDING_EXTRA;
        f.amount = b_s;
        f.weight = 40 + 15 * b_s;
        snprintf(f.sentence, sizeof f.sentence, turn ? "A turn too many" : "%.1f s that the reference does not have",
                 b_s);
        break;
    case PIECE_PAUSE:
        f.kind = FINDING_TIMING;
        f.amount = b_s - a_s;
        f.weight = PAUSE_WEIGHT * f.amount;
        snprintf(f.sentence, sizeof f.sentence, "You paused for %.1f s", f.amount);
        break;
    case PIECE_PAUSE_SKIPPED:
        f.kind = FINDING_TIMING;
        f.amount = b_s - a_s;
        f.weight = -PAUSE_WEIGHT * f.amount;
        snprintf(f.sentence, sizeof f.sentence, "The pause is %.1f s too short", -f.amount);
        break;
    }
    return finding_add(c, &f, true);
}

static enum status of_pace(struct comparison *c)
{
    const double percent = 100 * (c->pace.ratio - 1);
    if (!(c->pace.ratio > 0) || fabs(percent) < 12 || c->pace.b_end - c->pace.b_first < 30)
        return OK;
    struct finding f = {FINDING_TIMING, "body", seconds(c->pace.b_first), seconds(c->pace.b_end),
                        percent,        "%",    fabs(percent) / 4,        ""};
    snprintf(f.sentence, sizeof f.sentence, "You were %.0f %% %s", fabs(percent),
             percent > 0 ? "too fast" : "too slow");
    return finding_add(c, &f, false);
}

// Frames of one movement that the alignment could not use: pieces, pauses and what is before and after.
static int32_t unused(const struct comparison *c, bool of_a)
{
    const struct pace *p = &c->pace;
    int32_t sum = of_a ? p->a_first + c->a.count - p->a_end : p->b_first + c->judged.count - p->b_end;
    for (int32_t k = 0; k < p->piece_count; k++) {
        const struct piece *x = &p->pieces[k];
        if (of_a ? x->kind == PIECE_MISSING || x->kind == PIECE_PAUSE_SKIPPED
                 : x->kind == PIECE_EXTRA || x->kind == PIECE_PAUSE)
            sum += of_a ? x->a_end - x->a_first : x->b_end - x->b_first;
    }
    return sum;
}

// Repetitions are too few or too many only where the alignment, too, has half a repetition to spare.
static enum status of_repetitions(struct comparison *c, bool *said)
{
    const int32_t wanted = c->repetitions.reference_count, got = c->repetitions.count;
    *said = false;
    if (wanted < 2 || got < 2 || wanted == got)
        return OK;
    const int32_t off = abs(wanted - got);
    const int32_t length = (got < wanted ? c->a.count : c->judged.count) / (got < wanted ? wanted : got);
    if (2 * unused(c, got < wanted) < length)
        return OK;
    struct finding f = {.kind = got < wanted ? FINDING_MISSING : FINDING_EXTRA,
                        .part = "body",
                        .to_s = seconds(c->judged.count),
                        .amount = off,
                        .unit = "times",
                        .weight = 50};
    const char *missing = off > 1 ? "are missing" : "is missing";
    snprintf(f.sentence, sizeof f.sentence, "%d repetition%s %s: %d instead of %d", (int)off, off > 1 ? "s" : "",
             got < wanted ? missing : "too many", (int)got, (int)wanted);
    *said = true;
    return finding_add(c, &f, false);
}

static bool is_pause(const struct piece *p) { return p->kind == PIECE_PAUSE || p->kind == PIECE_PAUSE_SKIPPED; }

static int32_t frames_longer(const struct piece *p) { return p->b_end - p->b_first - (p->a_end - p->a_first); }

// While both stand still it is open which instants belong together: the alignment may wait in one movement and then in
// the other. Of such pauses by turns only what remains is one. Joins piece k with those that follow it so; returns how
// many they are.
static int32_t join_pauses(const struct pace *p, int32_t k, struct piece *joined)
{
    int32_t count = 1;
    *joined = p->pieces[k];
    for (; is_pause(joined) && k + count < p->piece_count; count++) {
        const struct piece *last = &p->pieces[k + count - 1], *next = &p->pieces[k + count];
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
static enum status find_pieces(struct comparison *c)
{
    enum status status = OK;
    if (c->mirrored) {
        const struct finding f = {
            FINDING_MIRRORED, "body", seconds(c->pace.b_first),           seconds(c->pace.b_end), 1,
            "times",          1000,   "Mirrored: you used the other side"};
        status = finding_add(c, &f, false);
    }
    bool said = false;
    if (status == OK)
        status = of_repetitions(c, &said);
    // What one performance of the reference lacks or adds when it is done several times is no finding.
    const bool several = c->repetitions.count >= 2 && c->repetitions.reference_count < 2;
    // Between repetitions people rest a little longer or shorter.
    const int32_t least = c->repetitions.count >= 2 && c->repetitions.reference_count >= 2 ? LEAST_REST : 0;
    for (int32_t k = 0, count; k < c->pace.piece_count && status == OK && !several; k += count) {
        struct piece p;
        count = join_pauses(&c->pace, k, &p);
        if (is_pause(&p) && abs(frames_longer(&p)) < (count > 1 && least < LEAST_NET ? LEAST_NET : least))
            continue;
        if (!said || (p.kind != PIECE_MISSING && p.kind != PIECE_EXTRA))
            status = of_piece(c, &p);
    }
    return status == OK && !several && !said ? of_pace(c) : status;
}

// ---------------------------------------------------------------- finding postures

// Findings about one joint: posture and range; and about one limb: early or late.

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
static void say_posture(const struct judge *g, const struct wrong *w, double *amount, char *text, size_t size)
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
    say_posture(g, &w, &f.amount, f.sentence, sizeof f.sentence);
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

// posture, range and a limb's timing
static enum status find_postures(struct comparison *c)
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

// ---------------------------------------------------------------- finding list

// The list of findings, and its words.

const char *finding_kind_name(enum finding_kind k)
{
    static const char *const kind_names[] = {"posture", "range", "timing", "missing", "extra", "mirrored"};
    return kind_names[k];
}

const char *part_name(enum part p)
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
    return kind_names[p];
}

// Appends; times in frames. `sentence` without its times, which are added where `timed`. ERR_MEMORY.
static enum status finding_add(struct comparison *c, const struct finding *f, bool timed)
{
    struct finding *more = realloc(c->findings, (size_t)(c->finding_count + 1) * sizeof *more);
    if (!more)
        return fail(ERR_MEMORY, "no memory for the findings");
    c->findings = more;
    more += c->finding_count++;
    *more = *f;
    if (timed) {
        const size_t used = strlen(more->sentence);
        snprintf(more->sentence + used, sizeof more->sentence - used, ", from %.1f s to %.1f s", f->from_s, f->to_s);
    }
    return OK;
}

// ---------------------------------------------------------------- findings

static int worst_first(const void *a, const void *b)
{
    const struct finding *x = a, *y = b;
    if (x->weight != y->weight)
        return x->weight < y->weight ? 1 : -1;
    return (x->from_s > y->from_s) - (x->from_s < y->from_s);
}

enum status findings_make(struct comparison *c)
{
    enum status status = find_pieces(c);
    if (status == OK)
        status = find_postures(c);
    if (status == OK && c->finding_count > 1)
        qsort(c->findings, (size_t)c->finding_count, sizeof *c->findings, worst_first);
    return status;
}
