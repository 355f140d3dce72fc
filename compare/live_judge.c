#include "compare/live_judge.h"

#include "base/portable_math.h"

#include <stdlib.h>

struct live_judge {
    const struct movement *reference;
    double *price; // of the best path that ends at each frame of the reference, past costs faded out
    bool begun;
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

void live_judge_restart(struct live_judge *j) { j->begun = false; }

// Mean squared chord of the parts known in the frame; 0 where none is.
static double cost(const struct live_judge *j, int32_t i, const struct movement_frame *frame)
{
    const struct movement_frame *x = &j->reference->frames[i];
    double sum = 0, count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        if (!(frame->known & x->known & 1u << p))
            continue;
        for (int k = 0; k < 3; k++) {
            const double d = (double)frame->direction[p][k] - x->direction[p][k];
            sum += d * d;
        }
        count++;
    }
    return count > 0 ? sum / count : 0;
}

static int32_t advance(struct live_judge *j, const struct movement_frame *frame)
{
    double diagonal = 0, above = 0;
    int32_t best = 0;
    for (int32_t i = 0; i < j->reference->count; i++) {
        const double c = cost(j, i, frame), left = j->begun ? j->price[i] : 0;
        double arrived = FADE * left + STEP;
        if (i && FADE * diagonal < arrived)
            arrived = FADE * diagonal;
        double price = (j->begun ? arrived : 0) + c;
        if (i && above + STEP + c < price)
            price = above + STEP + c;
        diagonal = left;
        above = j->price[i] = price;
        if (price < j->price[best])
            best = i;
    }
    j->begun = true;
    return best;
}

void live_judge_frame(struct live_judge *j, const struct movement_frame *frame, int32_t *reference,
                      struct part_difference parts[PART_COUNT])
{
    *reference = advance(j, frame);
    const struct movement_frame *x = &j->reference->frames[*reference];
    for (int p = 0; p < PART_COUNT; p++) {
        parts[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
        if (!(frame->known & x->known & 1u << p))
            continue;
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            const double d = (double)frame->direction[p][k] - x->direction[p][k];
            sum += d * d;
        }
        const double angle = 2 * portable_asin(fmin(1, 0.5 * sqrt(sum)));
        parts[p].sigma_rad = (float)sqrt((double)x->sigma[p] * x->sigma[p] + (double)frame->sigma[p] * frame->sigma[p]);
        parts[p].angle_rad = (float)angle;
        parts[p].verdict = verdict_of(angle, parts[p].sigma_rad);
    }
}
