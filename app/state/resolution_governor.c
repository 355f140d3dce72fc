#include "app/state/resolution_governor.h"

#include <math.h>

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
