#include "compare/live_judge.h"

#include "base/clamp.h"
#include "base/portable_math.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

enum { AVERAGED = 5 }; // frames, as in part_differences

// The differences of one frame's directions to those of the reference's frame.
struct judged_frame {
    uint16_t known;
    float difference[PART_COUNT][3];
};

struct live_judge {
    const struct movement *reference;
    double *price;      // of the best path that ends at each frame of the reference, past costs faded out
    int32_t first, end; // of the window; prices outside of it mean nothing
    struct tolerances by;
    int32_t counted_first, counted_end; // frames of the reference that count
    bool begun;
    struct judged_frame last[AVERAGED]; // a ring
    int next, count;
};

// By hand: what was more than half a second ago counts little; a step of one movement alone costs what 8 degrees do.
static const double FADE = 0.93, STEP = 0.02;

enum status live_judge_open(struct live_judge **out, const struct movement *reference)
{
    *out = NULL;
    struct live_judge *j = calloc(1, sizeof *j);
    if (!j)
        return fail(ERR_MEMORY, "no memory to judge a movement");
    j->reference = reference;
    j->end = reference->count;
    live_judge_set_expectation(j, NULL);
    j->price = calloc((size_t)reference->count, sizeof *j->price);
    enum status status = j->price ? OK : fail(ERR_MEMORY, "no memory to judge a movement");
    if (status != OK)
        live_judge_close(&j);
    *out = j;
    return status;
}

void live_judge_close(struct live_judge **judge)
{
    if (*judge) {
        free((*judge)->price);
        free(*judge);
    }
    *judge = NULL;
}

void live_judge_restart(struct live_judge *judge)
{
    judge->begun = false;
    judge->count = 0;
}

void live_judge_set_reference(struct live_judge *judge, const struct movement *reference)
{
    assert(reference->count == judge->reference->count);
    if (reference == judge->reference)
        return;
    judge->reference = reference;
    live_judge_restart(judge);
}

void live_judge_set_expectation(struct live_judge *judge, const struct expectation *expected)
{
    judge->by = tolerances_of(expected);
    judge->counted_first = 0;
    judge->counted_end = INT32_MAX;
    if (expected && expected->to_s > 0) {
        judge->counted_first = (int32_t)floor(expected->from_s * MOVEMENT_RATE_HZ);
        judge->counted_end = (int32_t)ceil(fmin(1e6, expected->to_s) * MOVEMENT_RATE_HZ);
    }
}

void live_judge_set_window(struct live_judge *judge, int32_t first, int32_t end)
{
    const int32_t count = judge->reference->count;
    first = clamp_int(first, 0, count - 1);
    if (end > count)
        end = count;
    else if (end <= first)
        end = first + 1;
    bool any = false;
    for (int32_t i = first; i < end; i++) {
        if (i < judge->first || i >= judge->end)
            judge->price[i] = INFINITY; // reached from within the window only
        any = any || isfinite(judge->price[i]);
    }
    judge->first = first;
    judge->end = end;
    judge->begun = judge->begun && any;
}

static double squared_chord(const struct movement_frame *a, const struct movement_frame *b, int p)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double d = (double)a->direction[p][k] - b->direction[p][k];
        sum += d * d;
    }
    return sum;
}

// Mean squared chord of the parts known in both that matter; NaN where none is.
static double frame_cost(const struct live_judge *judge, int32_t i, const struct movement_frame *frame)
{
    const struct movement_frame *movement_frame = &judge->reference->frames[i];
    const uint16_t known = frame->known & movement_frame->known & (uint16_t)~judge->by.ignored;
    double sum = 0, count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        if (!(known >> p & 1))
            continue;
        sum += squared_chord(frame, movement_frame, p);
        count++;
    }
    return count > 0 ? sum / count : NAN;
}

static int32_t advance_alignment(struct live_judge *judge, const struct movement_frame *frame)
{
    double diagonal = INFINITY, above = INFINITY;
    int32_t best = judge->first;
    for (int32_t i = judge->first; i < judge->end; i++) {
        double c = frame_cost(judge, i, frame);
        c = isnan(c) ? 0 : c;
        const double left = judge->begun ? judge->price[i] : 0;
        double price = (judge->begun ? fmin(FADE * left + STEP, FADE * diagonal) : 0) + c;
        price = fmin(price, above + STEP + c);
        diagonal = left;
        above = judge->price[i] = price;
        if (price < judge->price[best])
            best = i;
    }
    judge->begun = true;
    return best;
}

// Keeps the frame's differences to the reference's.
static void keep_differences(struct live_judge *judge, const struct movement_frame *frame,
                             const struct movement_frame *movement_frame)
{
    struct judged_frame *to = &judge->last[judge->next];
    to->known = frame->known & movement_frame->known;
    for (int p = 0; p < PART_COUNT; p++)
        for (int k = 0; k < 3; k++)
            to->difference[p][k] = frame->direction[p][k] - movement_frame->direction[p][k];
    judge->next = (judge->next + 1) % AVERAGED;
    judge->count += judge->count < AVERAGED;
}

static double mean_angle(const struct live_judge *judge, int p)
{
    double sum[3] = {0};
    int used = 0;
    for (int i = 0; i < judge->count; i++) {
        const struct judged_frame *f = &judge->last[i];
        if (!(f->known >> p & 1))
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += f->difference[p][k];
        used++;
    }
    const double chord = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]) / used;
    return 2 * portable_asin(fmin(1, 0.5 * chord));
}

void live_judge_frame(struct live_judge *judge, const struct movement_frame *frame, int32_t *reference,
                      struct part_difference parts[PART_COUNT])
{
    *reference = advance_alignment(judge, frame);
    const struct movement_frame *movement_frame = &judge->reference->frames[*reference];
    const bool counts = *reference >= judge->counted_first && *reference < judge->counted_end;
    const uint16_t known = counts ? frame->known & movement_frame->known & (uint16_t)~judge->by.ignored : 0;
    keep_differences(judge, frame, movement_frame);
    for (int p = 0; p < PART_COUNT; p++) {
        parts[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
        if (!(known >> p & 1))
            continue;
        const double angle = mean_angle(judge, p),
                     sigma = sqrt((double)movement_frame->sigma[p] * movement_frame->sigma[p] +
                                  (double)frame->sigma[p] * frame->sigma[p]);
        parts[p].sigma_rad = (float)sigma;
        parts[p].angle_rad = (float)sqrt(fmax(0, angle * angle - sigma * sigma));
        parts[p].verdict =
            verdict_within(parts[p].angle_rad, parts[p].sigma_rad, judge->by.threshold[p] * DIFFERENT_RAD);
    }
}

double live_judge_away(const struct live_judge *judge, const struct movement_frame *frame, int32_t reference)
{
    const double c = frame_cost(judge, reference, frame);
    return isnan(c) ? NAN : 2 * portable_asin(fmin(1, 0.5 * sqrt(c)));
}
