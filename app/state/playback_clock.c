#include "app/state/playback_clock.h"

#include "base/clamp.h"

#include <math.h>

struct playback_clock playback_start(int64_t length_ns, int64_t frames)
{
    assert(length_ns >= 0 && frames >= 1);
    return (struct playback_clock){
        .length_ns = length_ns, .step_ns = frames > 1 ? length_ns / (frames - 1) : 0, .loop = true, .speed = 1};
}

static int64_t clamp_to_take(const struct playback_clock *p, int64_t at_ns)
{
    return clamp_int64(at_ns, 0, p->length_ns);
}

int64_t playback_at(const struct playback_clock *p, int64_t clock_ns)
{
    if (!p->playing || p->length_ns == 0)
        return p->at_ns;
    int64_t at = p->at_ns + llround((double)(clock_ns - p->clock_ns) * p->speed);
    if (!p->loop)
        return clamp_to_take(p, at);
    int64_t round = p->length_ns + p->step_ns; // the last frame is shown as long as the others
    at = (at % round + round) % round;
    return clamp_to_take(p, at);
}

static void rebase(struct playback_clock *p, int64_t clock_ns)
{
    p->at_ns = playback_at(p, clock_ns);
    p->clock_ns = clock_ns;
}

bool playback_tick(struct playback_clock *p, int64_t clock_ns)
{
    if (!p->playing || p->loop || playback_at(p, clock_ns) < p->length_ns)
        return false;
    rebase(p, clock_ns);
    p->playing = false;
    return true;
}

void playback_play(struct playback_clock *p, int64_t clock_ns, bool playing)
{
    rebase(p, clock_ns);
    if (playing && !p->playing && !p->loop && p->at_ns >= p->length_ns)
        p->at_ns = 0;
    p->playing = playing;
}

void playback_seek(struct playback_clock *p, int64_t clock_ns, int64_t at_ns)
{
    p->at_ns = clamp_to_take(p, at_ns);
    p->clock_ns = clock_ns;
}

void playback_step(struct playback_clock *p, int64_t clock_ns, int frames)
{
    rebase(p, clock_ns);
    p->playing = false;
    if (p->step_ns == 0)
        return;
    int64_t last = (p->length_ns + p->step_ns / 2) / p->step_ns;
    int64_t frame = (p->at_ns + p->step_ns / 2) / p->step_ns + frames;
    if (p->loop)
        frame = (frame % (last + 1) + last + 1) % (last + 1);
    p->at_ns = clamp_to_take(p, frame * p->step_ns);
}

void playback_set_speed(struct playback_clock *p, int64_t clock_ns, double speed)
{
    rebase(p, clock_ns);
    p->speed = fmin(fmax(speed, PLAYBACK_SLOWEST), PLAYBACK_FASTEST);
}

void playback_set_loop(struct playback_clock *p, int64_t clock_ns, bool loop)
{
    rebase(p, clock_ns);
    p->loop = loop;
}

void playback_skip(struct playback_clock *p, int64_t clock_from_ns, int64_t clock_to_ns)
{
    rebase(p, clock_from_ns);
    p->clock_ns = clock_to_ns;
}
