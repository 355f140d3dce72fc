#include "platform/sensors/stream_clocks.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// Chosen by hand, in frames of the slower stream: a colour camera starts up to some frames after its depth.
static const double LATE_FRAMES = 3, SHIFT_FRAMES = 6;
// Of the difference between two rates: how well the images' distance must tell the same as the streams' lengths.
static const double RATE_TOLERANCE = 0.25;
enum { MIN_STEPS = 8 }; // of each stream, that say anything about a rate or an offset where there are pairs

static int by_size(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

// How many frames a step is: where images are missing, several.
static double frames_in(const struct stream_times *times, int64_t step_ns)
{
    return fmax(1, round((double)step_ns / (double)times->median_ns));
}

static void take_median(struct stream_times *times, int count)
{
    int64_t sorted[STREAM_TIMES_EARLY];
    for (int i = 0; i < count; i++)
        sorted[i] = times->early_ns[i];
    qsort(sorted, (size_t)count, sizeof *sorted, by_size);
    times->median_ns = sorted[count / 2];
    for (int i = 0; i < count; i++)
        times->steps += frames_in(times, times->early_ns[i]);
}

void stream_times_add(struct stream_times *times, int64_t time_ns)
{
    const int64_t step_ns = time_ns - times->last_ns, steps = times->count - 1; // so far
    times->last_ns = time_ns;
    if (!times->count++) {
        times->first_ns = time_ns;
        return;
    }
    if (times->median_ns) {
        times->steps += frames_in(times, step_ns);
        return;
    }
    times->early_ns[steps] = step_ns;
    if (steps + 1 == STREAM_TIMES_EARLY)
        take_median(times, STREAM_TIMES_EARLY);
}

static double length_s(const struct stream_times *times)
{
    return 1e-9 * ((double)times->last_ns - (double)times->first_ns);
}

static double seconds_from(int64_t a_ns, int64_t b_ns) { return 1e-9 * ((double)b_ns - (double)a_ns); }

struct clock_finding stream_clocks_judge(const struct stream_times *color, const struct stream_times *depth,
                                         int64_t pairs)
{
    struct stream_times c = *color, d = *depth;
    struct clock_finding found = {CLOCKS_AGREE, 0, 1};
    if (!c.count || !d.count)
        return found;
    if (!c.median_ns && c.count > 1)
        take_median(&c, (int)c.count - 1);
    if (!d.median_ns && d.count > 1)
        take_median(&d, (int)d.count - 1);
    const double begins_s = seconds_from(d.first_ns, c.first_ns), ends_s = seconds_from(d.last_ns, c.last_ns);
    found.ahead_s = begins_s;
    if (fmin(c.steps, d.steps) >= MIN_STEPS) {
        const double step_c = length_s(&c) / c.steps, step_d = length_s(&d) / d.steps, frame_s = fmax(step_c, step_d);
        const double lengths = length_s(&c) / length_s(&d), rate = step_c / step_d;
        const bool as_long = fabs(ends_s - begins_s) < LATE_FRAMES * frame_s;
        if (!as_long && fabs(rate - lengths) < RATE_TOLERANCE * fabs(lengths - 1))
            found.fault = CLOCKS_RATE;
        else if (as_long && fmin(fabs(begins_s), fabs(ends_s)) > SHIFT_FRAMES * frame_s)
            found.fault = CLOCKS_SHIFTED;
        found.rate = lengths;
    }
    const bool overlap = c.first_ns <= d.last_ns && d.first_ns <= c.last_ns;
    if (found.fault == CLOCKS_AGREE && !pairs && !overlap)
        found.fault = CLOCKS_APART;
    return found;
}

// ------------------------------------------------------------- in words

// A rate that is that of two units: "a thousand"; NULL: it is none.
static const char *unit_factor(double rate)
{
    const double times = rate > 1 ? rate : 1 / rate, near_share = 0.1;
    static const struct {
        double factor;
        const char *text;
    } units[] = {{1e3, "1000"}, {1e6, "1000000"}, {1e9, "1000000000"}};
    for (size_t i = 0; i < COUNT_OF(units); i++)
        if (fabs(times / units[i].factor - 1) < near_share)
            return units[i].text;
    return NULL;
}

static void say_rate(const struct clock_finding *finding, bool listed, char *out, size_t bytes)
{
    const char *unit = unit_factor(finding->rate);
    if (unit && listed)
        snprintf(out, bytes, "the times of %s are in a unit %s times as small as those of %s: give both in seconds",
                 finding->rate > 1 ? "rgb.txt" : "depth.txt", unit, finding->rate > 1 ? "depth.txt" : "rgb.txt");
    else if (listed)
        snprintf(out, bytes,
                 "colour's clock runs %.6g times as fast as depth's (%+.0f millionths), so that pictures of other "
                 "moments are paired: divide the times in rgb.txt, counted from the first, by %.6g",
                 finding->rate, 1e6 * (finding->rate - 1), finding->rate);
    else
        snprintf(out, bytes,
                 "colour's clock runs %.6g times as fast as depth's, so that pictures of other moments are paired: the "
                 "sensor's driver, or what wrote the file, gives its two streams different clocks",
                 finding->rate);
}

static void say_shift(const struct clock_finding *finding, bool listed, char *out, size_t bytes)
{
    const bool ahead = finding->ahead_s > 0;
    if (listed)
        snprintf(out, bytes,
                 "colour's clock is %.3f s %s depth's, so that no picture meets its own depth: %s %.3f s %s the times "
                 "in rgb.txt",
                 fabs(finding->ahead_s), ahead ? "ahead of" : "behind", ahead ? "take" : "add", fabs(finding->ahead_s),
                 ahead ? "off" : "to");
    else
        snprintf(out, bytes,
                 "colour's clock is %.3f s %s depth's, so that no picture meets its own depth: start the sensor again; "
                 "if it stays so, its driver, or what wrote the file, gives its two streams different clocks",
                 fabs(finding->ahead_s), ahead ? "ahead of" : "behind");
}

const char *stream_clocks_text(const struct clock_finding *finding, bool listed, char out[STREAM_CLOCKS_TEXT_BYTES])
{
    const size_t bytes = STREAM_CLOCKS_TEXT_BYTES;
    *out = 0;
    if (finding->fault == CLOCKS_RATE)
        say_rate(finding, listed, out, bytes);
    else if (finding->fault == CLOCKS_SHIFTED)
        say_shift(finding, listed, out, bytes);
    else if (finding->fault == CLOCKS_APART)
        snprintf(out, bytes, "colour begins %.3f s %s depth, and no picture of one is near one of the other: %s",
                 fabs(finding->ahead_s), finding->ahead_s > 0 ? "after" : "before",
                 listed ? "put the times in rgb.txt and depth.txt on one clock, or remove rgb.txt to use depth alone"
                        : "the sensor's driver, or what wrote the file, gives its two streams different clocks");
    return out;
}
