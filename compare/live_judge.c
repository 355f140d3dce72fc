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
    j->price = calloc((size_t)reference->count, sizeof *j->price);
    enum status status = j->price ? OK : fail(ERR_MEMORY, "no memory to judge a movement");
    if (status != OK)
        live_judge_close(&j);
    *out = j;
    return status;
}

void live_judge_close(struct live_judge **j)
{
    if (*j) {
        free((*j)->price);
        free(*j);
    }
    *j = NULL;
}

void live_judge_restart(struct live_judge *j)
{
    j->begun = false;
    j->count = 0;
}

void live_judge_set_reference(struct live_judge *j, const struct movement *reference)
{
    assert(reference->count == j->reference->count);
    if (reference == j->reference)
        return;
    j->reference = reference;
    live_judge_restart(j);
}

void live_judge_set_window(struct live_judge *j, int32_t first, int32_t end)
{
    const int32_t count = j->reference->count;
    first = clamp_int(first, 0, count - 1);
    if (end > count)
        end = count;
    else if (end <= first)
        end = first + 1;
    bool any = false;
    for (int32_t i = first; i < end; i++) {
        if (i < j->first || i >= j->end)
            j->price[i] = INFINITY; // reached from within the window only
        any = any || isfinite(j->price[i]);
    }
    j->first = first;
    j->end = end;
    j->begun = j->begun && any;
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

// Mean squared chord of the parts known in both; NaN where none is.
static double cost(const struct live_judge *j, int32_t i, const struct movement_frame *frame)
{
    const struct movement_frame *x = &j->reference->frames[i];
    double sum = 0, count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        if (!(frame->known & x->known & 1u << p))
            continue;
        sum += squared_chord(frame, x, p);
        count++;
    }
    return count > 0 ? sum / count : NAN;
}

static int32_t advance(struct live_judge *j, const struct movement_frame *frame)
{
    double diagonal = INFINITY, above = INFINITY;
    int32_t best = j->first;
    for (int32_t i = j->first; i < j->end; i++) {
        double c = cost(j, i, frame);
        c = isnan(c) ? 0 : c;
        const double left = j->begun ? j->price[i] : 0;
        double price = (j->begun ? fmin(FADE * left + STEP, FADE * diagonal) : 0) + c;
        price = fmin(price, above + STEP + c);
        diagonal = left;
        above = j->price[i] = price;
        if (price < j->price[best])
            best = i;
    }
    j->begun = true;
    return best;
}

// Keeps the frame's differences to the reference's.
static void keep(struct live_judge *j, const struct movement_frame *frame, const struct movement_frame *x)
{
    struct judged_frame *to = &j->last[j->next];
    to->known = frame->known & x->known;
    for (int p = 0; p < PART_COUNT; p++)
        for (int k = 0; k < 3; k++)
            to->difference[p][k] = frame->direction[p][k] - x->direction[p][k];
    j->next = (j->next + 1) % AVERAGED;
    j->count += j->count < AVERAGED;
}

static double mean_angle(const struct live_judge *j, int p)
{
    double sum[3] = {0};
    int used = 0;
    for (int i = 0; i < j->count; i++) {
        const struct judged_frame *f = &j->last[i];
        if (!(f->known >> p & 1))
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += f->difference[p][k];
        used++;
    }
    const double chord = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]) / used;
    return 2 * portable_asin(fmin(1, 0.5 * chord));
}

void live_judge_frame(struct live_judge *j, const struct movement_frame *frame, int32_t *reference,
                      struct part_difference parts[PART_COUNT])
{
    *reference = advance(j, frame);
    const struct movement_frame *x = &j->reference->frames[*reference];
    keep(j, frame, x);
    for (int p = 0; p < PART_COUNT; p++) {
        parts[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
        if (!(frame->known & x->known & 1u << p))
            continue;
        const double angle = mean_angle(j, p),
                     sigma = sqrt((double)x->sigma[p] * x->sigma[p] + (double)frame->sigma[p] * frame->sigma[p]);
        parts[p].sigma_rad = (float)sigma;
        parts[p].angle_rad = (float)sqrt(fmax(0, angle * angle - sigma * sigma));
        parts[p].verdict = verdict_of(parts[p].angle_rad, parts[p].sigma_rad);
    }
}

double live_judge_away(const struct live_judge *j, const struct movement_frame *frame, int32_t reference)
{
    const double c = cost(j, reference, frame);
    return isnan(c) ? NAN : 2 * portable_asin(fmin(1, 0.5 * sqrt(c)));
}
