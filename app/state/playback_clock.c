#include "app/state/playback_clock.h"

#include <math.h>

struct player player_start(int64_t length_ns, int64_t frames)
{
    assert(length_ns >= 0 && frames >= 1);
    return (struct player){
        .length_ns = length_ns, .step_ns = frames > 1 ? length_ns / (frames - 1) : 0, .loop = true, .speed = 1};
}

static int64_t within(const struct player *p, int64_t at_ns)
{
    return at_ns < 0 ? 0 : at_ns > p->length_ns ? p->length_ns : at_ns;
}

int64_t player_at(const struct player *p, int64_t clock_ns)
{
    if (!p->playing || p->length_ns == 0)
        return p->at_ns;
    int64_t at = p->at_ns + llround((double)(clock_ns - p->clock_ns) * p->speed);
    if (!p->loop)
        return within(p, at);
    int64_t round = p->length_ns + p->step_ns; // the last frame is shown as long as the others
    at = (at % round + round) % round;
    return within(p, at);
}

static void anchor(struct player *p, int64_t clock_ns)
{
    p->at_ns = player_at(p, clock_ns);
    p->clock_ns = clock_ns;
}

bool player_tick(struct player *p, int64_t clock_ns)
{
    if (!p->playing || p->loop || player_at(p, clock_ns) < p->length_ns)
        return false;
    anchor(p, clock_ns);
    p->playing = false;
    return true;
}

void player_play(struct player *p, int64_t clock_ns, bool playing)
{
    anchor(p, clock_ns);
    if (playing && !p->playing && !p->loop && p->at_ns >= p->length_ns)
        p->at_ns = 0;
    p->playing = playing;
}

void player_seek(struct player *p, int64_t clock_ns, int64_t at_ns)
{
    p->at_ns = within(p, at_ns);
    p->clock_ns = clock_ns;
}

void player_step(struct player *p, int64_t clock_ns, int frames)
{
    anchor(p, clock_ns);
    p->playing = false;
    if (p->step_ns == 0)
        return;
    int64_t last = (p->length_ns + p->step_ns / 2) / p->step_ns;
    int64_t frame = (p->at_ns + p->step_ns / 2) / p->step_ns + frames;
    if (p->loop)
        frame = (frame % (last + 1) + last + 1) % (last + 1);
    p->at_ns = within(p, frame * p->step_ns);
}

void player_set_speed(struct player *p, int64_t clock_ns, double speed)
{
    anchor(p, clock_ns);
    p->speed = fmin(fmax(speed, PLAYER_SLOWEST), PLAYER_FASTEST);
}

void player_set_loop(struct player *p, int64_t clock_ns, bool loop)
{
    anchor(p, clock_ns);
    p->loop = loop;
}

void player_skip(struct player *p, int64_t clock_from_ns, int64_t clock_to_ns)
{
    anchor(p, clock_from_ns);
    p->clock_ns = clock_to_ns;
}
