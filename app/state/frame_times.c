#include "app/state/frame_times.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

// ---------------------------------------------------------------- frame skip

// Chosen by hand: weight of a new time in the mean; ratio to the mean above which a time is an outlier.
static const double SKIP_SMOOTH = 0.2, OUTLIER_RATIO = 3;

bool frame_skip_update(struct frame_skip *s, double took_ms, bool placed, bool newer)
{
    if (!(took_ms >= 0 && took_ms <= DBL_MAX)) // it would stay in the mean for ever
        return s->skipped_last = false;
    const bool unusual = s->typical_ms > 0 && took_ms > OUTLIER_RATIO * s->typical_ms;
    s->typical_ms += (s->typical_ms > 0 ? SKIP_SMOOTH : 1) * (took_ms - s->typical_ms);
    return s->skipped_last = unusual && placed && newer && !s->skipped_last;
}

// ---------------------------------------------------------------- frame times

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

// ---------------------------------------------------------------- resolution governor

// Each level has about 0.65 of the pixels of the one before.
static const double scales[GOVERNOR_LEVELS] = {1, 0.8, 0.64, 0.5, 0.4};

// Chosen by hand. SMOOTH: weight of a new time in the mean. USEFUL_RATIO: a fall that leaves more than this share of
// the time gained nothing. The others count frames.
static const double SMOOTH = 0.2, USEFUL_RATIO = 0.93;
enum {
    WARMUP = 4,
    HEADROOM_FRAMES = 90,
    MAX_HEADROOM_FRAMES = 16 * HEADROOM_FRAMES,
    EVALUATE_AFTER = 12,
    BACKOFF = 900
};

struct resolution_governor governor_start(double budget_ms)
{
    return (struct resolution_governor){
        .budget_ms = budget_ms, .warmup_left = WARMUP, .headroom_needed = HEADROOM_FRAMES, .since_fall = -1};
}

bool governor_update(struct resolution_governor *g, double took_ms)
{
    if (!(took_ms >= 0 && took_ms < HUGE_VAL)) // it would stay in the mean for ever
        return false;
    if (g->warmup_left > 0) { // the first frames after a change carry its cost
        g->warmup_left--;
        g->typical_ms = took_ms;
        return false;
    }
    g->typical_ms += SMOOTH * (took_ms - g->typical_ms);
    // The finer level takes at most this ratio squared more time: time grows no faster than the number of pixels.
    double finer = g->level ? scales[g->level - 1] / scales[g->level] : 1;
    g->headroom_frames = g->typical_ms * finer * finer < 0.8 * g->budget_ms ? g->headroom_frames + 1 : 0;
    int level = g->level;
    g->backoff_left -= g->backoff_left > 0;
    if (g->since_fall >= 0 && ++g->since_fall == EVALUATE_AFTER) {
        g->since_fall = -1;
        if (g->typical_ms > USEFUL_RATIO * g->before_ms) {
            g->backoff_left = BACKOFF;
            g->level--;
            g->warmup_left = WARMUP;
            return true;
        }
    }
    if (g->typical_ms > g->budget_ms && g->since_fall < 0 && !g->backoff_left && level < GOVERNOR_LEVELS - 1)
        level++;
    else if (g->headroom_frames >= g->headroom_needed && level > 0)
        level--;
    if (level == g->level)
        return false;
    bool rises = level < g->level;
    if (!rises && g->rose && g->headroom_needed < MAX_HEADROOM_FRAMES)
        g->headroom_needed *= 2;
    g->rose = rises;
    if (!rises) {
        g->before_ms = g->typical_ms;
        g->since_fall = 0;
    }
    g->level = level;
    g->headroom_frames = 0;
    g->warmup_left = WARMUP;
    return true;
}

double governor_scale(const struct resolution_governor *g) { return scales[g->level]; }
