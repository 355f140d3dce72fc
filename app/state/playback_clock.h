// The time of a take while it is watched: playing, pausing, scrubbing, stepping,
// slowly or fast, over and over. Pure: whoever calls says what time it is, by a
// clock that only moves forward. Nanoseconds.
#pragma once
#include "base/status.h"

static const double PLAYBACK_SLOWEST = 0.1, PLAYBACK_FASTEST = 2;

struct playback_clock {
    int64_t length_ns; // of the take; its last instant is shown, too
    int64_t step_ns;   // from one recorded frame to the next
    bool playing, loop;
    double speed; // PLAYBACK_SLOWEST..PLAYBACK_FASTEST
    // The take's instant `at_ns` belongs to the clock's `clock_ns`.
    int64_t at_ns, clock_ns;
};

// Paused at the beginning, at speed 1, looping. frames >= 1 spread evenly over length_ns >= 0.
struct playback_clock playback_start(int64_t length_ns, int64_t frames);

// The take's instant that belongs to the clock's `clock_ns`, which may lie a
// little before the last call's: a camera's picture is that old when it is drawn.
int64_t playback_at(const struct playback_clock *p, int64_t clock_ns);

// Comes to an end, where it does not loop. True: it stopped just now.
bool playback_tick(struct playback_clock *p, int64_t clock_ns);

void playback_play(struct playback_clock *p, int64_t clock_ns, bool playing); // from the end it begins anew
void playback_seek(struct playback_clock *p, int64_t clock_ns, int64_t at_ns);
void playback_step(struct playback_clock *p, int64_t clock_ns,
                   int frames); // pauses, then goes to the frame so far away
void playback_set_speed(struct playback_clock *p, int64_t clock_ns, double speed);
void playback_set_loop(struct playback_clock *p, int64_t clock_ns, bool loop);

// Time went by that nobody watched (the tablet slept): go on from where it was at clock_from_ns.
void playback_skip(struct playback_clock *p, int64_t clock_from_ns, int64_t clock_to_ns);
