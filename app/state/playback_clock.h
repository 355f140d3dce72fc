// Maps the clock's time to a take's time: play, pause, scrub, step, change the speed, loop. Pure: every call is given
// the time of a monotonic clock. Nanoseconds.
#pragma once
#include "base/status.h"

// ---------------------------------------------------------------- playback predictor

// Predicts which instants of a take the next frames will show, so that their data can be loaded beforehand: as far
// apart as the last frames were. Pure; nanoseconds.

enum { PREDICTED_MAX = 3 };

// Zeroed before the first frame.
struct playback_predictor {
    int64_t at_ns;    // the take's instant in the last frame
    int64_t step_ns;  // from the frame before to the last one, in the take's time; 0: it jumped
    int64_t clock_ns; // when the last frame was drawn
    int missed;       // consecutive frames for which nothing was ready
};

struct playback_now {
    int64_t at_ns;     // the take's instant that is shown
    int64_t length_ns; // of the take
    int64_t frame_ns;  // from one recorded frame to the next
    bool playing, loop;
    int64_t clock_ns; // when it is drawn
    int64_t load_ns;  // duration of loading one frame's data; 0: not known
};

// The instants to load for, the nearest first. Returns how many; 0: paused, or predictions keep failing.
int playback_predict(struct playback_predictor *predictor, const struct playback_now *now,
                     int64_t at_ns[PREDICTED_MAX]);

// Reports whether the data of a drawn frame was ready.
void playback_predictor_report(struct playback_predictor *predictor, bool ready);

// ---------------------------------------------------------------- playback clock

static const double PLAYBACK_SLOWEST = 0.1, PLAYBACK_FASTEST = 2;

struct playback_clock {
    int64_t length_ns; // of the take; its last instant is shown, too
    int64_t step_ns;   // from one recorded frame to the next
    bool playing, loop;
    double speed; // PLAYBACK_SLOWEST..PLAYBACK_FASTEST
    // The take's instant `at_ns` is shown at the clock's time `clock_ns`.
    int64_t at_ns, clock_ns;
};

// Paused at the start, speed 1, looping. frames >= 1 are spread evenly over length_ns >= 0.
struct playback_clock playback_start(int64_t length_ns, int64_t frames);

// The take's instant at `clock_ns`, which may lie a little before that of the last call: a camera image is that old
// when it is drawn.
int64_t playback_at(const struct playback_clock *clock, int64_t clock_ns);

// Stops at the end if it does not loop. True: it stopped just now.
bool playback_tick(struct playback_clock *clock, int64_t clock_ns);

void playback_play(struct playback_clock *clock, int64_t clock_ns, bool playing); // from the end it starts again
void playback_seek(struct playback_clock *clock, int64_t clock_ns, int64_t at_ns);
// Pauses, then moves by that many frames.
void playback_step(struct playback_clock *clock, int64_t clock_ns, int frames);
void playback_set_speed(struct playback_clock *clock, int64_t clock_ns, double speed);
void playback_set_loop(struct playback_clock *clock, int64_t clock_ns, bool loop);

// The app was suspended between the two times: continue with the instant of clock_from_ns.
void playback_skip(struct playback_clock *clock, int64_t clock_from_ns, int64_t clock_to_ns);
