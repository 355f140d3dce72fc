#include "app/state/resolution_governor.h"

#include <math.h>

// Each level has about 0.65 of the pixels of the one before.
static const double scales[GOVERNOR_LEVELS] = {1, 0.8, 0.64, 0.5, 0.4};

static const double SMOOTH = 0.2;                                                // of a new time in the typical one
enum { SETTLE = 4, CALM = 90, MOST_CALM = 16 * CALM, JUDGE = 12, RESIGN = 900 }; // pictures
static const double WORTH = 0.93; // a fall that leaves more of the time than this was for nothing

struct governor governor_start(double budget_ms)
{
    return (struct governor){.budget_ms = budget_ms, .settle = SETTLE, .patience = CALM, .since_fall = -1};
}

bool governor_drawn(struct governor *g, double took_ms)
{
    if (g->settle > 0) { // the first ones after a change pay for it
        g->settle--;
        g->typical_ms = took_ms;
        return false;
    }
    g->typical_ms += SMOOTH * (took_ms - g->typical_ms);
    // What the finer level would take, if time went with pixels: it never goes faster than that.
    double finer = g->level ? scales[g->level - 1] / scales[g->level] : 1;
    g->calm = g->typical_ms * finer * finer < 0.8 * g->budget_ms ? g->calm + 1 : 0;
    int level = g->level;
    g->resigned -= g->resigned > 0;
    if (g->since_fall >= 0 && ++g->since_fall == JUDGE) {
        g->since_fall = -1;
        if (g->typical_ms > WORTH * g->before_ms) {
            g->resigned = RESIGN;
            g->level--;
            g->settle = SETTLE;
            return true;
        }
    }
    if (g->typical_ms > g->budget_ms && g->since_fall < 0 && !g->resigned && level < GOVERNOR_LEVELS - 1)
        level++;
    else if (g->calm >= g->patience && level > 0)
        level--;
    if (level == g->level)
        return false;
    bool rises = level < g->level;
    if (!rises && g->rose && g->patience < MOST_CALM)
        g->patience *= 2;
    g->rose = rises;
    if (!rises) {
        g->before_ms = g->typical_ms;
        g->since_fall = 0;
    }
    g->level = level;
    g->calm = 0;
    g->settle = SETTLE;
    return true;
}

double governor_scale(const struct governor *g) { return scales[g->level]; }
