#include "app/state/playback_predictor.h"

enum { MISSED_MAX = 8 };
static const int64_t JUMP_NS = 500000000; // of the take, from picture to picture: more than anybody plays

// How far the take goes from one picture to the next: as far as from the last to this one, or as before that where one
// was left out; from recorded frame to recorded frame where it jumped.
static int64_t step_from(struct playback_predictor *f, const struct playback_now *now, int64_t round_ns)
{
    int64_t step = ((now->at_ns - f->at_ns) % round_ns + round_ns) % round_ns, before = f->step_ns;
    const bool jumped = !(step > 0 && step < JUMP_NS);
    f->at_ns = now->at_ns;
    f->step_ns = jumped ? 0 : step;
    return jumped ? now->frame_ns : before > 0 && before < step ? before : step;
}

// The first of the pictures to come that can still be made ready in time: 1 is the next one.
static int first_in_time(struct playback_predictor *f, const struct playback_now *now)
{
    int64_t between_ns = now->clock_ns - f->clock_ns, late = between_ns > 0 ? now->load_ns / between_ns : 0;
    f->clock_ns = now->clock_ns;
    return 1 + (int)(late < PREDICTED_MAX ? late : PREDICTED_MAX);
}

int playback_predict(struct playback_predictor *f, const struct playback_now *now, int64_t at_ns[PREDICTED_MAX])
{
    const int64_t round_ns = now->length_ns + now->frame_ns; // the last frame is shown as long as the others
    const int64_t step = step_from(f, now, round_ns);
    const int first = first_in_time(f, now);
    if (!now->playing || (f->missed > MISSED_MAX && f->missed % MISSED_MAX)) // from time to time it is tried again
        return 0;
    int count = 0;
    for (int k = first; k < first + PREDICTED_MAX; k++) {
        int64_t at = now->at_ns + k * step;
        if (at < round_ns || now->loop)
            at_ns[count++] = at % round_ns;
    }
    return count;
}

void playback_predictor_report(struct playback_predictor *f, bool ready) { f->missed = ready ? 0 : f->missed + 1; }
