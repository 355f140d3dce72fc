#include "app/state/frame_times.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

// ---------------------------------------------------------------- frame skip

// Chosen by hand: weight of a new time in the mean; ratio to the mean above which a time is an outlier.
static const double SKIP_SMOOTH = 0.2, OUTLIER_RATIO = 3;

bool frame_skip_update(struct frame_skip *skip, double took_ms, bool placed, bool newer)
{
    if (!(took_ms >= 0 && took_ms <= DBL_MAX)) // it would stay in the mean for ever
        return skip->skipped_last = false;
    const bool unusual = skip->typical_ms > 0 && took_ms > OUTLIER_RATIO * skip->typical_ms;
    skip->typical_ms += (skip->typical_ms > 0 ? SKIP_SMOOTH : 1) * (took_ms - skip->typical_ms);
    return skip->skipped_last = unusual && placed && newer && !skip->skipped_last;
}

// ---------------------------------------------------------------- frame times

const char *const frame_stage_names[FRAME_STAGES] = {[FRAME_LOCATE] = "locate",
                                                     [FRAME_WAIT] = "wait",
                                                     [FRAME_ACTOR] = "actor",
                                                     [FRAME_CONTROLS] = "controls",
                                                     [FRAME_SHOW] = "show"};

void frame_times_add(struct frame_times *times, const double ms[FRAME_STAGES])
{
    double total = 0;
    for (int i = 0; i < FRAME_STAGES; i++) {
        times->ms[times->next][i] = (float)ms[i];
        times->sum_ms[i] += ms[i];
        total += ms[i];
    }
    times->next = (times->next + 1) % FRAMES_KEPT;
    times->count += times->count < FRAMES_KEPT;
    times->frames++;
    if (total > times->total_worst_ms)
        times->total_worst_ms = total;
}

const float *frame_times_at(const struct frame_times *times, int back)
{
    if (back < 0 || back >= times->count)
        return NULL;
    return times->ms[(times->next - 1 - back + 2 * FRAMES_KEPT) % FRAMES_KEPT];
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double frame_times_median(const struct frame_times *times)
{
    double totals[FRAMES_KEPT];
    for (int back = 0; back < times->count; back++) {
        const float *ms = frame_times_at(times, back);
        totals[back] = 0;
        for (int i = 0; i < FRAME_STAGES; i++)
            totals[back] += (double)ms[i];
    }
    qsort(totals, (size_t)times->count, sizeof totals[0], compare_doubles);
    return times->count ? totals[times->count / 2] : 0;
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

bool governor_update(struct resolution_governor *governor, double took_ms)
{
    if (!(took_ms >= 0 && took_ms < HUGE_VAL)) // it would stay in the mean for ever
        return false;
    if (governor->warmup_left > 0) { // the first frames after a change carry its cost
        governor->warmup_left--;
        governor->typical_ms = took_ms;
        return false;
    }
    governor->typical_ms += SMOOTH * (took_ms - governor->typical_ms);
    // The finer level takes at most this ratio squared more time: time grows no faster than the number of pixels.
    double finer = governor->level ? scales[governor->level - 1] / scales[governor->level] : 1;
    governor->headroom_frames =
        governor->typical_ms * finer * finer < 0.8 * governor->budget_ms ? governor->headroom_frames + 1 : 0;
    int level = governor->level;
    governor->backoff_left -= governor->backoff_left > 0;
    if (governor->since_fall >= 0 && ++governor->since_fall == EVALUATE_AFTER) {
        governor->since_fall = -1;
        if (governor->typical_ms > USEFUL_RATIO * governor->before_ms) {
            governor->backoff_left = BACKOFF;
            governor->level--;
            governor->warmup_left = WARMUP;
            return true;
        }
    }
    if (governor->typical_ms > governor->budget_ms && governor->since_fall < 0 && !governor->backoff_left &&
        level < GOVERNOR_LEVELS - 1)
        level++;
    else if (governor->headroom_frames >= governor->headroom_needed && level > 0)
        level--;
    if (level == governor->level)
        return false;
    bool rises = level < governor->level;
    if (!rises && governor->rose && governor->headroom_needed < MAX_HEADROOM_FRAMES)
        governor->headroom_needed *= 2;
    governor->rose = rises;
    if (!rises) {
        governor->before_ms = governor->typical_ms;
        governor->since_fall = 0;
    }
    governor->level = level;
    governor->headroom_frames = 0;
    governor->warmup_left = WARMUP;
    return true;
}

double governor_scale(const struct resolution_governor *governor) { return scales[governor->level]; }
