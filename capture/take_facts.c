#include "capture/take_facts.h"

#include "recording/recording_reader.h"

#include <stdlib.h>

// A film of a movement has from one picture a second, as the slowest webcams in the dark, to 1000, as no depth sensor.
static const double SLOWEST_STEP_S = 0.95, FASTEST_STEP_S = 1e-3, USUAL_STEP_S = 1.0 / 30;
// The longest that a sensor was seen to stall and come back is some seconds. Beyond this its clock was set.
static const double JUMP_S = 60;

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Converted first: the difference of times in a malformed file may overflow an int64.
static double seconds_between(const struct take *t, int64_t a, int64_t b)
{
    return ((double)take_entry(t, b)->time_ns - (double)take_entry(t, a)->time_ns) * 1e-9;
}

// The median time between frames, of at most STEPS of them.
static double median_step_s(const struct take *t)
{
    enum { STEPS = 500 };
    double steps[STEPS];
    const int64_t count = take_frame_count(t) - 1;
    int used = 0;
    if (count < 1)
        return 0;
    const int64_t stride = (count + STEPS - 1) / STEPS;
    for (int64_t i = 0; i < count && used < STEPS; i += stride)
        steps[used++] = seconds_between(t, i, i + 1);
    qsort(steps, (size_t)used, sizeof *steps, by_size);
    return steps[used / 2];
}

static void count_frames(const struct take *t, struct take_facts *f)
{
    int64_t seen = -1; // the last frame with a person
    for (int64_t i = 0; i < f->frames; i++) {
        const struct take_entry *e = take_entry(t, i);
        const double gap_s = i ? seconds_between(t, i - 1, i) : 0;
        f->with_skeleton += e->has_skeleton;
        f->with_color += e->has_color;
        f->with_depth += e->has_depth;
        f->located = f->located || e->located;
        if (gap_s > f->gap_s) {
            f->gap_s = gap_s;
            f->gap_at_s = seconds_between(t, 0, i - 1);
        }
        if (e->has_skeleton)
            seen = i;
        else
            f->unseen_s = fmax(f->unseen_s, seconds_between(t, seen < 0 ? 0 : seen, i));
    }
}

enum status take_facts_read(struct take *take, struct take_facts *out)
{
    int64_t places = 0;
    *out = (struct take_facts){.frames = take_frame_count(take),
                               .dropped = take_dropped(take),
                               .lost = take_lost(take),
                               .complete = take_is_complete(take)};
    enum status status =
        database_number(recording_database(take_recording(take)), "SELECT count(*) FROM place", &places);
    if (status != OK)
        return status;
    out->has_place = places > 0;
    count_frames(take, out);
    if (out->frames < 2)
        return OK;
    out->duration_s = seconds_between(take, 0, out->frames - 1);
    out->step_s = median_step_s(take);
    out->absurd_times = out->step_s >= SLOWEST_STEP_S || out->step_s < FASTEST_STEP_S;
    out->jumps = !out->absurd_times && out->gap_s > JUMP_S;
    return OK;
}

int64_t take_facts_step_ns(const struct take_facts *f, int64_t from_ns, int64_t to_ns, int64_t frames)
{
    const double usual_s = (f->absurd_times ? USUAL_STEP_S : f->step_s) * (double)frames,
                 step_s = ((double)to_ns - (double)from_ns) * 1e-9;
    const bool usual = f->absurd_times || (f->jumps && step_s > JUMP_S);
    return (int64_t)((usual ? usual_s : step_s) * 1e9);
}

// ------------------------------------------------------------- in words

static void say_times(const struct take_facts *f, struct take_verdict *out)
{
    // Units that were taken for seconds, by the step that each gives at 5 to 200 pictures a second.
    static const struct {
        const char *name, *factor;
        double a_second;
    } units[] = {{"milliseconds", "1000", 1e3}, {"microseconds", "1000000", 1e6}, {"nanoseconds", "1000000000", 1e9}};
    if (f->jumps)
        verdict_say(out, USE_ANY,
                    "the clock jumped ahead by %.1f %s at %.1f s: it was set while filming; trim the take there",
                    f->gap_s > 7200 ? f->gap_s / 3600 : f->gap_s / 60, f->gap_s > 7200 ? "h" : "min", f->gap_at_s);
    if (!f->absurd_times)
        return;
    for (size_t i = 0; i < COUNT_OF(units); i++)
        if (f->step_s >= 0.005 * units[i].a_second && f->step_s <= 0.2 * units[i].a_second) {
            verdict_say(out, USE_ANY,
                        "its times are %s taken for seconds, one picture in %.0f s: divide the film's times by %s and "
                        "record it again",
                        units[i].name, f->step_s, units[i].factor);
            return;
        }
    if (f->step_s >= SLOWEST_STEP_S)
        verdict_say(out, USE_ANY,
                    "its times cannot be right, one picture in %.1f s: give the film's times in seconds and record it "
                    "again",
                    f->step_s);
    else
        verdict_say(out, USE_ANY,
                    "its times cannot be right, %.0f pictures a second: give the film's times in seconds and record it "
                    "again",
                    1 / fmax(f->step_s, 1e-9));
}

// Thresholds chosen by hand: what is seen when the take is watched.
void take_facts_say(const struct take_facts *f, struct take_verdict *out)
{
    const double frames = f->frames ? (double)f->frames : 1;
    if (!f->frames)
        verdict_say(out, USE_ANY, "empty");
    if (f->lost)
        verdict_say(out, USE_ANY, "%lld frames lost to damage", (long long)f->lost);
    if (!f->complete)
        verdict_say(out, USE_ANY, "interrupted");
    say_times(f, out);
    if (f->with_skeleton && (double)f->with_skeleton < 0.9 * frames)
        verdict_say(out, USE_ANY, "a person in %.0f %% of the frames", 100 * (double)f->with_skeleton / frames);
    else if (f->with_skeleton && f->unseen_s > 1 && !f->absurd_times && !f->jumps)
        verdict_say(out, USE_ANY, "the person out of sight for %.1f s", f->unseen_s);
    if (f->frames && !f->with_color)
        verdict_say(out, USE_WATCH, "no colour");
    else if ((double)f->with_color < 0.9 * frames)
        verdict_say(out, USE_WATCH, "colour in %.0f %% of the frames", 100 * (double)f->with_color / frames);
    if (f->frames && !f->with_depth)
        verdict_say(out, USE_ANY, "no depth");
    if ((double)f->dropped > 0.02 * frames)
        verdict_say(out, USE_ANY, "%.0f %% of the frames dropped",
                    100 * (double)f->dropped / (frames + (double)f->dropped));
    if (f->gap_s > 0.5 && f->step_s < 0.2 && !f->jumps)
        verdict_say(out, USE_ANY, "a gap of %.1f s", f->gap_s);
    if (f->has_place && f->frames && !f->located)
        verdict_say(out, USE_WATCH, "where the actor stood is not known");
    if (f->duration_s < 1 && f->frames)
        verdict_say(out, USE_ANY, "shorter than a second");
}
