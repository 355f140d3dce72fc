#include "app/state/playback_predictor.h"

// Chosen by hand. MISSED_MAX: consecutive misses, after which only every eighth prediction is made. JUMP_NS: of the
// take, between two frames; playing at the highest speed stays below it.
enum { MISSED_MAX = 8 };
static const int64_t JUMP_NS = 500000000;

// The take's time from this frame to the next: as from the last frame to this one, or as one frame earlier if that was
// shorter (a frame was skipped); one recorded frame after a jump.
static int64_t step_from(struct playback_predictor *p, const struct playback_now *now, int64_t round_ns)
{
    int64_t step = ((now->at_ns - p->at_ns) % round_ns + round_ns) % round_ns, before = p->step_ns;
    const bool jumped = !(step > 0 && step < JUMP_NS);
    p->at_ns = now->at_ns;
    p->step_ns = jumped ? 0 : step;
    if (jumped)
        return now->frame_ns;
    return before > 0 && before < step ? before : step;
}

// The first coming frame whose data can still be loaded in time: 1 is the next one.
static int first_in_time(struct playback_predictor *p, const struct playback_now *now)
{
    int64_t between_ns = now->clock_ns - p->clock_ns, late = between_ns > 0 ? now->load_ns / between_ns : 0;
    p->clock_ns = now->clock_ns;
    return 1 + (int)(late < PREDICTED_MAX ? late : PREDICTED_MAX);
}

int playback_predict(struct playback_predictor *p, const struct playback_now *now, int64_t at_ns[PREDICTED_MAX])
{
    const int64_t round_ns = now->length_ns + now->frame_ns; // the last frame is shown as long as the others
    const int64_t step = step_from(p, now, round_ns);
    const int first = first_in_time(p, now);
    if (!now->playing || (p->missed > MISSED_MAX && p->missed % MISSED_MAX)) // then only from time to time
        return 0;
    int count = 0;
    for (int k = first; k < first + PREDICTED_MAX; k++) {
        int64_t at = now->at_ns + k * step;
        if (at < round_ns || now->loop)
            at_ns[count++] = at % round_ns;
    }
    return count;
}

void playback_predictor_report(struct playback_predictor *p, bool ready) { p->missed = ready ? 0 : p->missed + 1; }
