#include "app/state/frame_times.h"

#include <stdlib.h>

const char *const frame_stage_names[FRAME_STAGES] = {[FRAME_LOCATE] = "locate",
                                                     [FRAME_WAIT] = "wait",
                                                     [FRAME_ACTOR] = "actor",
                                                     [FRAME_CONTROLS] = "controls",
                                                     [FRAME_SHOW] = "show"};

void frame_times_add(struct frame_times *t, const double ms[FRAME_STAGES])
{
    double total = 0;
    for (int i = 0; i < FRAME_STAGES; i++) {
        t->ms[t->next][i] = (float)ms[i];
        t->sum_ms[i] += ms[i];
        total += ms[i];
    }
    t->next = (t->next + 1) % FRAMES_KEPT;
    t->count += t->count < FRAMES_KEPT;
    t->frames++;
    if (total > t->total_worst_ms)
        t->total_worst_ms = total;
}

const float *frame_times_at(const struct frame_times *t, int back)
{
    if (back < 0 || back >= t->count)
        return NULL;
    return t->ms[(t->next - 1 - back + 2 * FRAMES_KEPT) % FRAMES_KEPT];
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double frame_times_median(const struct frame_times *t)
{
    double totals[FRAMES_KEPT];
    for (int back = 0; back < t->count; back++) {
        const float *ms = frame_times_at(t, back);
        totals[back] = 0;
        for (int i = 0; i < FRAME_STAGES; i++)
            totals[back] += (double)ms[i];
    }
    qsort(totals, (size_t)t->count, sizeof totals[0], ascending);
    return t->count ? totals[t->count / 2] : 0;
}
