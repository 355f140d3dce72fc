#include "app/state/playback_clock.h"

#include "base/clamp.h"

#include <math.h>

// ---------------------------------------------------------------- playback predictor

// Chosen by hand. MISSED_MAX: consecutive misses, after which only every eighth prediction is made. JUMP_NS: of the
// take, between two frames; playing at the highest speed stays below it.
enum { MISSED_MAX = 8 };
static const int64_t JUMP_NS = 500000000;

// The take's time from this frame to the next: as from the last frame to this one, or as one frame earlier if that was
// shorter (a frame was skipped); one recorded frame after a jump.
static int64_t step_from(struct playback_predictor *predictor, const struct playback_now *now, int64_t round_ns)
{
    int64_t step = ((now->at_ns - predictor->at_ns) % round_ns + round_ns) % round_ns, before = predictor->step_ns;
    const bool jumped = !(step > 0 && step < JUMP_NS);
    predictor->at_ns = now->at_ns;
    predictor->step_ns = jumped ? 0 : step;
    if (jumped)
        return now->frame_ns;
    return before > 0 && before < step ? before : step;
}

// The first coming frame whose data can still be loaded in time: 1 is the next one.
static int first_in_time(struct playback_predictor *predictor, const struct playback_now *now)
{
    int64_t between_ns = now->clock_ns - predictor->clock_ns, late = between_ns > 0 ? now->load_ns / between_ns : 0;
    predictor->clock_ns = now->clock_ns;
    return 1 + (int)(late < PREDICTED_MAX ? late : PREDICTED_MAX);
}

int playback_predict(struct playback_predictor *predictor, const struct playback_now *now, int64_t at_ns[PREDICTED_MAX])
{
    const int64_t round_ns = now->length_ns + now->frame_ns; // the last frame is shown as long as the others
    const int64_t step = step_from(predictor, now, round_ns);
    const int first = first_in_time(predictor, now);
    if (!now->playing ||
        (predictor->missed > MISSED_MAX && predictor->missed % MISSED_MAX)) // then only from time to time
        return 0;
    int count = 0;
    for (int k = first; k < first + PREDICTED_MAX; k++) {
        int64_t at = now->at_ns + k * step;
        if (at < round_ns || now->loop)
            at_ns[count++] = at % round_ns;
    }
    return count;
}

void playback_predictor_report(struct playback_predictor *predictor, bool ready)
{
    predictor->missed = ready ? 0 : predictor->missed + 1;
}

// ---------------------------------------------------------------- playback clock

struct playback_clock playback_start(int64_t length_ns, int64_t frames)
{
    assert(length_ns >= 0 && frames >= 1);
    return (struct playback_clock){
        .length_ns = length_ns, .step_ns = frames > 1 ? length_ns / (frames - 1) : 0, .loop = true, .speed = 1};
}

static int64_t clamp_to_take(const struct playback_clock *clock, int64_t at_ns)
{
    return clamp_int64(at_ns, 0, clock->length_ns);
}

int64_t playback_at(const struct playback_clock *clock, int64_t clock_ns)
{
    if (!clock->playing || clock->length_ns == 0)
        return clock->at_ns;
    int64_t at = clock->at_ns + llround((double)(clock_ns - clock->clock_ns) * clock->speed);
    if (!clock->loop)
        return clamp_to_take(clock, at);
    int64_t round = clock->length_ns + clock->step_ns; // the last frame is shown as long as the others
    at = (at % round + round) % round;
    return clamp_to_take(clock, at);
}

static void rebase_clock(struct playback_clock *clock, int64_t clock_ns)
{
    clock->at_ns = playback_at(clock, clock_ns);
    clock->clock_ns = clock_ns;
}

bool playback_tick(struct playback_clock *clock, int64_t clock_ns)
{
    if (!clock->playing || clock->loop || playback_at(clock, clock_ns) < clock->length_ns)
        return false;
    rebase_clock(clock, clock_ns);
    clock->playing = false;
    return true;
}

void playback_play(struct playback_clock *clock, int64_t clock_ns, bool playing)
{
    rebase_clock(clock, clock_ns);
    if (playing && !clock->playing && !clock->loop && clock->at_ns >= clock->length_ns)
        clock->at_ns = 0;
    clock->playing = playing;
}

void playback_seek(struct playback_clock *clock, int64_t clock_ns, int64_t at_ns)
{
    clock->at_ns = clamp_to_take(clock, at_ns);
    clock->clock_ns = clock_ns;
}

void playback_step(struct playback_clock *clock, int64_t clock_ns, int frames)
{
    rebase_clock(clock, clock_ns);
    clock->playing = false;
    if (clock->step_ns == 0)
        return;
    int64_t last = (clock->length_ns + clock->step_ns / 2) / clock->step_ns;
    int64_t frame = (clock->at_ns + clock->step_ns / 2) / clock->step_ns + frames;
    if (clock->loop)
        frame = (frame % (last + 1) + last + 1) % (last + 1);
    clock->at_ns = clamp_to_take(clock, frame * clock->step_ns);
}

void playback_set_speed(struct playback_clock *clock, int64_t clock_ns, double speed)
{
    rebase_clock(clock, clock_ns);
    clock->speed = fmin(fmax(speed, PLAYBACK_SLOWEST), PLAYBACK_FASTEST);
}

void playback_set_loop(struct playback_clock *clock, int64_t clock_ns, bool loop)
{
    rebase_clock(clock, clock_ns);
    clock->loop = loop;
}

void playback_skip(struct playback_clock *clock, int64_t clock_from_ns, int64_t clock_to_ns)
{
    rebase_clock(clock, clock_from_ns);
    clock->clock_ns = clock_to_ns;
}
