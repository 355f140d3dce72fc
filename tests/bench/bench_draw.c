// Drawing the actor at 1280x800, and beside it the plain path: eleven cylinder
// meshes, a projective texture of a recorded frame on each, one pass, which is
// DETAIL_PAPER. The small world's dancer, seen from all round; each picture at
// another recorded instant, or all at the same. Times are of all threads together,
// for without a graphics card the driver draws on several, and end when all is
// drawn. At last the slowest of many pictures against the median.
#include "tests/bench/bench.h"
#include "tests/bench/bench_look.h"
#include "tests/support/rehearsal.h"

#include "reenact/painter.h"

#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 1280, HEIGHT = 800, ITEMS = 24, MANY = 500 };
static const double AWAY_M = 2.6;

struct contender {
    struct gpu *gpu;
    struct take *take;
    struct painter *painter;
    bool same_frame;
};

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct contender *c = self;
    int64_t frame = c->same_frame ? 0 : item % take_frame_count(c->take);
    const struct take_entry *first = take_entry(c->take, 0), *e = take_entry(c->take, frame);
    struct vec3 him = pose_apply(first->world_from_camera, first->skeleton.joint[JOINT_WAIST]);
    double angle = 6.283185307179586 * item / ITEMS;
    struct vec3 eye = v3_add(him, v3(AWAY_M * sin(angle), -AWAY_M * cos(angle), 0.4));
    struct painter_view view = {.world_from_camera = bench_look_at(eye, him), .time_ns = e->time_ns - first->time_ns};
    struct painter_result result;
    struct gpu_counts before = gpu_count(c->gpu);
    double started_ms = bench_all_threads_ms();
    enum status status = painter_draw(c->painter, &view, &result);
    if (status == OK)
        status = gpu_wait(c->gpu);
    out->time_ms = bench_all_threads_ms() - started_ms;
    struct gpu_counts now = gpu_count(c->gpu);
    out->error = (double)(now.draws - before.draws);
    out->extra[0] = (double)(now.uploads - before.uploads);
    out->extra[1] = (double)(now.made - before.made);
    return status;
}

static enum status open_painter(struct contender *c, const struct contender *like, enum detail detail, bool same_frame,
                                bool kept)
{
    static const struct lens lens = {WIDTH, HEIGHT, 1000, 1000, (WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0, 0, 0, 0,
                                     0,     0,      0,    0};
    struct painter_options o = painter_default_options();
    *c = *like;
    o.detail = detail;
    o.texture_bytes = kept ? o.texture_bytes : 0;
    c->same_frame = same_frame;
    return painter_open(&c->painter, c->gpu, c->take, &lens, &o);
}

static enum status measure_many(struct contender *c)
{
    double ms[MANY];
    for (int i = 0; i < MANY; i++) {
        struct bench_measure m;
        enum status status = measure(c, i, &m);
        if (status < 0)
            return status;
        ms[i] = m.time_ms;
    }
    double median = bench_percentile(ms, MANY, 0.5);
    printf("ours, %d pictures, each time another frame: the slowest takes %.2f times the median\n\n", MANY,
           ms[MANY - 1] / median);
    return OK;
}

static enum status run(struct bench *b)
{
    enum { CONTENDERS = 6 };
    static const struct {
        const char *name;
        enum detail detail;
        bool same_frame, kept;
    } plans[CONTENDERS] = {
        {"ours, each time another frame", DETAIL_FULL, false, true},
        {"the plain path, likewise", DETAIL_PAPER, false, true},
        {"ours, always the same frame", DETAIL_FULL, true, true},
        {"the plain path, likewise", DETAIL_PAPER, true, true},
        {"ours, another that was not kept", DETAIL_FULL, false, false},
        {"the plain path, likewise", DETAIL_PAPER, false, false},
    };
    struct rehearsal rehearsal = rehearsal_make();
    struct recording *recording = NULL;
    struct contender base = {0}, all[CONTENDERS] = {{0}};
    struct bench_contender contenders[CONTENDERS];
    enum status status = recording_open(&recording, rehearsal.file);
    if (status == OK)
        status = take_open(&base.take, recording, "turn");
    if (status == OK)
        status = gpu_open(&base.gpu);
    for (int i = 0; i < CONTENDERS && status == OK; i++) {
        contenders[i] = (struct bench_contender){plans[i].name, measure, &all[i], i == 1};
        status = open_painter(&all[i], &base, plans[i].detail, plans[i].same_frame, plans[i].kept);
    }
    if (status == OK) {
        printf("draw: %d x %d, %s\n", WIDTH, HEIGHT, gpu_renderer(base.gpu));
        status = bench_run(b, contenders, CONTENDERS, ITEMS);
    }
    if (status == OK)
        status = measure_many(&all[0]);
    for (int i = 0; i < CONTENDERS; i++)
        painter_close(&all[i].painter);
    gpu_close(&base.gpu);
    take_close(&base.take);
    recording_free(&recording);
    rehearsal_end(&rehearsal);
    return status;
}

const struct bench_stage bench_stage_draw = {
    "draw", "the actor at 1280x800, beside eleven textured cylinders", "draw_calls", "time_ms", {"uploads", "made"},
    run};
