// Stage "live": from a depth sensor's frame to its judged picture. A film with known mistakes is played in real time
// through the real source into the live screens, drawn without a window at 1280 x 800, next to what tracking and
// drawing take alone. Its first rows are processor time of one thread; the screens' rows are by the clock, in the
// median over the frames, and end when the GPU (or the driver in its place) has finished.
//
// With --data: a recording's folder with exercise.reenact and a sensor's folder "wrong", as tests/live_screens makes
// it; else a shorter film is made.
#include "base/clock.h"
#include "platform/sensors/source.h"
#include "tests/bench/bench.h"
#include "tests/support/glass.h"
#include "tests/support/gpu_finish.h"
#include "tests/support/live_rehearsal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { FILM_FRAMES = 80, MAX_FRAMES = 2000 };

struct series {
    double ms[MAX_FRAMES];
    int count;
};

static void add(struct series *s, double ms)
{
    if (s->count < MAX_FRAMES)
        s->ms[s->count++] = ms;
}

static enum status add_row(struct bench *b, const char *name, struct series *s)
{
    const double median = bench_percentile(s->ms, s->count, 0.5); // sorts
    const double values[] = {median, bench_percentile(s->ms, s->count, 0.95), s->count ? s->ms[s->count - 1] : NAN,
                             s->count};
    return bench_add_row(b, name, values);
}

// Every frame of the film by the tracker and the judge alone.
static enum status track_alone(struct bench *b, const char *file, const char *sensor)
{
    static struct series track, judge;
    track.count = judge.count = 0;
    struct movement reference = {0};
    struct movement_source from;
    struct source *source = NULL;
    struct live_tracker *tracker = NULL;
    struct frame frame;
    enum status status = movement_read(file, NULL, &reference, &from);
    if (status == OK)
        status = source_open(&source, sensor, SOURCE_SENSOR);
    const struct live_tracker_options options = {.calibration = source ? source_calibration(source) : NULL,
                                                 .reference = &reference};
    if (status == OK)
        status = live_tracker_open(&tracker, &options);
    while (status == OK && (status = source_next(source, &frame)) == OK) {
        struct live_look look;
        status = live_tracker_next(tracker, frame.time_ns, frame.color, frame.depth, NULL, &look);
        if (status != OK || !look.person)
            continue;
        add(&track, look.track_ms);
        add(&judge, look.judge_ms);
    }
    status = status == NOTHING ? OK : status;
    if (status == OK)
        status = add_row(b, "tracking, a frame", &track);
    if (status == OK)
        status = add_row(b, "judging it, all the reference searched", &judge);
    live_tracker_close(&tracker);
    source_close(&source);
    movement_free(&reference);
    return status;
}

struct screen_times {
    struct series track, draw, latency;
    int64_t tracked, dropped;
};

// One drawing, until the GPU has finished. Returns how long it took, ms.
static double draw(struct glass *g)
{
    const struct viewer_surface surface = {g->target, g->width, g->height, 0, glass_scale(g)};
    const int64_t begun_ns = clock_now_ns();
    if (viewer_draw(g->viewer, &surface, begun_ns) != OK || gpu_finish(g->gpu) != OK)
        abort();
    viewer_presented(g->viewer, clock_now_ns());
    return (double)(clock_now_ns() - begun_ns) * 1e-6;
}

// The loop of reenact_watch.c: draws when there is something new.
static void play(struct glass *g, enum live_screen screen, struct screen_times *out)
{
    struct view_state *s = g->state;
    int64_t seen = 0, last_attempt = s->live.attempt;
    for (const int64_t until_ns = clock_now_ns() + 120000000000; clock_now_ns() < until_ns;) {
        viewer_update(g->viewer, clock_now_ns());
        s->live.screen = screen;
        if (s->live.phase == LIVE_READY && s->live.person_ns && s->live.attempt == last_attempt)
            view_state_do(s, DO_PLAY_PAUSE, clock_now_ns());
        if (s->live.phase == LIVE_SUMMARY && s->live.judged == s->live.finished)
            break;
        if (!s->changed) {
            clock_sleep_until_ns(clock_now_ns() + 1000000);
            continue;
        }
        const double draw_ms = draw(g);
        const struct live_frame *f = viewer_live_view(g->viewer).frame;
        // A film's first frame has waited for the attempt.
        if (!f || f->number == seen || s->live.phase != LIVE_DOING || f->attempt != s->live.attempt)
            continue;
        seen = f->number;
        add(&out->draw, draw_ms);
        add(&out->track, (double)(f->tracked_ns - f->received_ns) * 1e-6);
        add(&out->latency, (double)(clock_now_ns() - f->received_ns) * 1e-6);
    }
    const struct live_sensor_state state = live_sensor_query(viewer_live_view(g->viewer).sensor);
    out->tracked = state.received;
    out->dropped = state.dropped;
    view_state_do(s, DO_BACK, clock_now_ns());
}

static enum status add_screen(struct bench *b, const char *name, struct screen_times *t)
{
    char row[80];
    snprintf(row, sizeof row, "%s: tracking and judging", name);
    enum status status = add_row(b, row, &t->track);
    snprintf(row, sizeof row, "%s: drawing", name);
    if (status == OK)
        status = add_row(b, row, &t->draw);
    snprintf(row, sizeof row, "%s: frame to judged picture", name);
    if (status == OK)
        status = add_row(b, row, &t->latency);
    if (!bench_inputs(b)->json && !bench_inputs(b)->brief)
        printf(
            "live: %s: frame to judged picture is %.2f times tracking plus drawing; %lld frames tracked so far, %lld "
            "not\n",
            name,
            bench_percentile(t->latency.ms, t->latency.count, 0.5) /
                (bench_percentile(t->track.ms, t->track.count, 0.5) + bench_percentile(t->draw.ms, t->draw.count, 0.5)),
            (long long)t->tracked, (long long)t->dropped);
    return status;
}

static enum status play_screens(struct bench *b, const char *file, const char *sensor)
{
    static const char *const names[] = {"mirror", "beside"};
    static struct screen_times times;
    struct glass g;
    const struct viewer_options options = {.file = file, .sensor = sensor, .fixed_resolution = true, .refresh_hz = 60};
    enum status status = OK;
    glass_open(&g, GLASS_LONG, GLASS_SHORT, &options);
    glass_draw(&g);
    g.state->live.hands_free = false;
    while (g.state->crossfade < 1)
        glass_draw_and_wait(&g);
    for (int screen = LIVE_MIRROR; screen <= LIVE_BESIDE && status == OK; screen++) {
        times.track.count = times.draw.count = times.latency.count = 0;
        play(&g, (enum live_screen)screen, &times);
        status = add_screen(b, names[screen], &times);
    }
    glass_close(&g);
    return status;
}

static enum status run(struct bench *b)
{
    static const char *const columns[] = {"median_ms", "p95_ms", "most_ms", "frames"};
    const char *data = bench_inputs(b)->data;
    struct live_rehearsal made = {0};
    char file[600], sensor[600];
    bench_columns(b, columns, COUNT_OF(columns));
    if (data) {
        snprintf(file, sizeof file, "%s/exercise.reenact", data);
        snprintf(sensor, sizeof sensor, "folder:%s/wrong", data);
    } else {
        made = live_rehearsal_make(FILM_FRAMES, 1);
        snprintf(file, sizeof file, "%s", made.file);
        snprintf(sensor, sizeof sensor, "%s", made.wrong);
    }
    enum status status = track_alone(b, file, sensor);
    if (status == OK)
        status = play_screens(b, file, sensor);
    if (!data)
        live_rehearsal_end(&made);
    return status;
}

const struct bench_stage bench_stage_live = {
    "live", "from a sensor's frame to its judged picture, next to tracking and drawing alone", "", "", {0}, run};
