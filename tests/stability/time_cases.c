// Time: long takes, clocks that jump, a million frames.
#include "app/state/frame_times.h"
#include "app/state/playback_clock.h"
#include "compare/movement.h"
#include "recording/recording.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/stability/stability.h"

#include <math.h>

#define FRAME_NS INT64_C(33333333)

// in: frames that are played one after the other at normal speed -> where the take is then, seconds.
static struct answer ask_playback(const double *in)
{
    const int64_t frames = (int64_t)in[0];
    struct playback_clock p = playback_start(frames * FRAME_NS, frames + 1);
    p.loop = false;
    playback_play(&p, 0, true);
    int64_t now = 0;
    for (int64_t i = 0; i < frames; i++) {
        now += FRAME_NS;
        (void)playback_tick(&p, now);
    }
    return answer_value((double)playback_at(&p, now) * 1e-9);
}

static struct answer playback_in_float(const double *in)
{
    const float step[2] = {(float)FRAME_NS * 1e-9F, (float)in[0]};
    float sum;
    plain_sum_of_steps.in_float(step, &sum);
    return answer_value((double)sum);
}

// The same with the speed changed at every frame: each change begins the count again.
static struct answer ask_changes(const double *in)
{
    const int64_t frames = (int64_t)in[0];
    struct playback_clock p = playback_start(frames * FRAME_NS, frames + 1);
    p.loop = false;
    playback_play(&p, 0, true);
    for (int64_t i = 0; i < frames; i++)
        playback_set_speed(&p, i * FRAME_NS, i % 2 ? 1.5 : 0.5);
    return answer_value((double)playback_at(&p, frames * FRAME_NS) * 1e-9);
}

// in: milliseconds of a frame, frames -> the mean.
static struct answer ask_mean(const double *in)
{
    static struct frame_times t;
    t = (struct frame_times){0};
    const double ms[FRAME_STAGES] = {in[0]};
    for (int i = 0; i < (int)in[1]; i++)
        frame_times_add(&t, ms);
    return answer_value(t.sum_ms[0] / (double)t.frames);
}

static struct answer mean_in_float(const double *in)
{
    const float step[2] = {(float)in[0], (float)in[1]};
    float sum;
    plain_sum_of_steps.in_float(step, &sum);
    return answer_value((double)sum / in[1]);
}

static struct answer ask_median(const double *in)
{
    static struct frame_times t;
    t = (struct frame_times){0};
    const double ms[FRAME_STAGES] = {in[1]};
    for (int i = 0; i < (int)in[0]; i++)
        frame_times_add(&t, ms);
    return answer_value(frame_times_median(&t));
}

static struct answer mean_of_none(const double *in) { return answer_value(in[0] * in[1] / in[0]); }

// Two samples, in ns -> the second's time, and whether a jump was closed up.
static struct answer ask_jump(const double *in)
{
    struct joint_samples s = {0};
    struct joint_sample at = {.time_ns = (int64_t)in[0]};
    enum status status = joint_samples_add(&s, &at);
    at.time_ns = (int64_t)in[1];
    if (status == OK)
        status = joint_samples_add(&s, &at);
    const struct answer a =
        status == OK && s.count == 2
            ? answer_values((double[]){(double)(s.at[1].time_ns - s.at[0].time_ns) * 1e-9, (double)s.jumps}, 2)
            : answer_of(ANSWER_UNKNOWN);
    joint_samples_free(&s);
    return a;
}

static struct answer difference(const double *in) { return answer_values((double[]){(in[1] - in[0]) * 1e-9, 0}, 2); }

// in: frames of a take, of one instant -> where playing it is after a second.
static struct answer ask_short(const double *in)
{
    struct playback_clock p = playback_start((int64_t)in[1], (int64_t)in[0]);
    playback_play(&p, 0, true);
    return answer_value((double)playback_at(&p, 1000000000));
}

static struct answer remainder_of(const double *in) { return answer_value(fmod(1e9, in[1])); }

// in: the take's time, its length -> after seeking to that.
static struct answer ask_seek(const double *in)
{
    struct playback_clock p = playback_start((int64_t)in[1], 10);
    playback_seek(&p, 0, (int64_t)in[0]);
    return answer_value((double)playback_at(&p, 0));
}

static struct answer as_wanted(const double *in) { return answer_value(in[0]); }

// Time of the last of in[0] frames of a movement, from one sample at its begin and one at its end.
static struct answer ask_frames(const double *in)
{
    struct joint_samples s = {0};
    struct movement m = {0};
    enum status status = OK;
    for (int i = 0; i <= (int)in[0] && status == OK; i++) {
        struct joint_sample at = {.time_ns = i * INT64_C(50000000000)};
        for (int j = 0; j < JOINT_COUNT; j++) {
            at.skeleton.joint[j] = v3(0.1 * j, 0.05 * j, 2);
            at.skeleton.confidence[j] = 1;
            at.sigma_m[j] = 0.01F;
        }
        status = joint_samples_add(&s, &at);
    }
    if (status == OK)
        status = movement_from_samples(&s, &m);
    const double count = m.count;
    movement_free(&m);
    joint_samples_free(&s);
    return answer_status(status, count);
}

static struct answer frames_in_float(const double *in)
{
    float time = 0;
    double count = 1;
    for (; time + 1.0F / 30 <= (float)(50 * in[0]); count++)
        time += 1.0F / 30;
    return answer_value(count);
}

static const struct stability_case cases[] = {
    {"playback after 10^6 frames", "integer nanoseconds", ANSWER_VALUE, ask_playback, NULL, playback_in_float,
     .in = {1e6}, .exact = {33333.333}, .exact_count = 1, .tolerance = 1e-9, .unit = "s"},
    {"a step of 1/30 s, added 10^6 times", "integer nanoseconds", ANSWER_VALUE, ask_playback, &plain_sum_of_steps,
     playback_in_float, .in = {1e6}, .exact = {33333.333}, .exact_count = 1, .tolerance = 1e-9, .unit = "s"},
    {"playback after 10^5 changes of speed", "rounded, not cut off", ANSWER_VALUE, ask_changes, NULL, playback_in_float,
     .in = {1e5}, .exact = {3333.3333}, .exact_count = 1, .tolerance = 1e-4, .unit = "s"},
    {"mean of 10^6 frames of 16.7 ms", "sums in double", ANSWER_VALUE, ask_mean, NULL, mean_in_float, .in = {16.7, 1e6},
     .exact = {16.7}, .exact_count = 1, .tolerance = 1e-6, .unit = "ms"},
    {"median of no frames", "0 of none", ANSWER_VALUE, ask_median, NULL, mean_of_none, .in = {0, 16.7}, .exact = {0},
     .exact_count = 1, .unit = "ms"},
    {"a clock that goes back by 10 s", "closed up", ANSWER_VALUE, ask_jump, NULL, difference, .in = {2e10, 1e10},
     .exact = {0.033, 1}, .exact_count = 2, .tolerance = 1e-12, .unit = "s"},
    {"a clock that goes ahead by a day", "closed up", ANSWER_VALUE, ask_jump, NULL, difference, .in = {0, 8.64e13},
     .exact = {0.033, 1}, .exact_count = 2, .tolerance = 1e-12, .unit = "s"},
    {"a clock that jumps by 580 years", "a difference that cannot overflow", ANSWER_VALUE, ask_jump, NULL, difference,
     .in = {-9.2e18, 9.2e18}, .exact = {0.033, 1}, .exact_count = 2, .tolerance = 1e-12, .unit = "s"},
    {"a clock that jumps back by 580 years", "a difference that cannot overflow", ANSWER_VALUE, ask_jump, NULL,
     difference, .in = {9.2e18, -9.2e18}, .exact = {0.033, 1}, .exact_count = 2, .tolerance = 1e-12, .unit = "s"},
    {"a sample at the time of the last", "dropped", ANSWER_UNKNOWN, ask_jump, NULL, difference, .in = {1e9, 1e9},
     .unit = "s"},
    {"playing a take of one frame", "no length, no remainder", ANSWER_VALUE, ask_short, NULL, remainder_of,
     .in = {1, 0}, .exact = {0}, .exact_count = 1, .unit = "ns"},
    {"seeking beyond a take's end", "clamped to the take", ANSWER_VALUE, ask_seek, NULL, as_wanted, .in = {9e18, 1e9},
     .exact = {1e9}, .exact_count = 1, .unit = "ns"},
    {"seeking before a take's begin", "clamped to the take", ANSWER_VALUE, ask_seek, NULL, as_wanted,
     .in = {-9e18, 1e9}, .exact = {0}, .exact_count = 1, .unit = "ns"},
    {"frames of a movement of 50 minutes", "frame by number, not by sum", ANSWER_VALUE, ask_frames, NULL,
     frames_in_float, .in = {60}, .exact = {90001}, .exact_count = 1, .unit = "frames"},
};
const struct stability_stage stability_time = {"time", cases, COUNT_OF(cases)};
