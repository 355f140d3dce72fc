// Stage "draw": drawing the actor at 1280x800, next to DETAIL_PAPER as the baseline: eleven cylinder meshes, each with
// one recorded frame as its projective texture, in one pass. The small world's dancer, seen from all round; each image
// at another recorded instant, or all at the same. Times are of all threads together, because without a graphics card
// the driver draws on several, and end when all is drawn. Finally the slowest of many images against the median, for
// both.
#include "reenact/render/actor_renderer.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_look.h"
#include "tests/support/gpu_finish.h"
#include "tests/support/rehearsed.h"
#include "tests/support/work.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 1280, HEIGHT = 800, ITEMS = 24, MANY = 500, SLOWEST = 10 };
static const double AWAY_M = 2.6;

struct draw_contender {
    struct gpu *gpu;
    struct take *take;
    struct renderer *renderer;
    bool same_frame;
};

// Processor time of drawing one image, ms.
struct steps {
    double all;    // of all threads
    double submit; // this thread: choosing what is drawn and submitting it, and the driver's vertex work
    double finish; // this thread, until all is drawn
    bool loaded;   // the frame was not resident
};

static enum status draw(struct draw_contender *c, int item, struct steps *out)
{
    int64_t frame = c->same_frame ? 0 : item % take_frame_count(c->take);
    const struct take_entry *first = take_entry(c->take, 0), *e = take_entry(c->take, frame);
    struct vec3 waist = pose_apply(first->world_from_camera, first->skeleton.joint[JOINT_WAIST]);
    double angle = 6.283185307179586 * item / ITEMS;
    struct vec3 eye = v3_add(waist, v3(AWAY_M * sin(angle), -AWAY_M * cos(angle), 0.4));
    struct renderer_view view = {.world_from_camera = bench_look_at(eye, waist),
                                 .time_ns = e->time_ns - first->time_ns};
    struct renderer_result result;
    *out = (struct steps){.loaded = renderer_nearest_resident_frame(c->renderer, frame, 0) < 0};
    const double began_ms = bench_all_threads_ms(), submit_ms = bench_clock_ms();
    enum status status = renderer_draw(c->renderer, &view, &result);
    const double finish_ms = bench_clock_ms();
    if (status == OK)
        status = gpu_finish(c->gpu);
    const double ended_ms = bench_clock_ms();
    out->all = bench_all_threads_ms() - began_ms;
    out->submit = finish_ms - submit_ms;
    out->finish = ended_ms - finish_ms;
    return status;
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct draw_contender *c = self;
    struct steps steps;
    struct gpu_counts before = gpu_get_counts(c->gpu);
    enum status status = draw(c, item, &steps);
    struct gpu_counts now = gpu_get_counts(c->gpu);
    out->time_ms = steps.all;
    out->error = (double)(now.draws - before.draws);
    out->extra[0] = (double)(now.uploads - before.uploads);
    out->extra[1] = (double)(now.made - before.made);
    return status;
}

static enum status open_renderer(struct draw_contender *c, const struct draw_contender *like, enum detail detail,
                                 bool same_frame, bool kept)
{
    static const struct lens lens = {WIDTH, HEIGHT, 1000, 1000, (WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0, 0, 0, 0,
                                     0,     0,      0,    0};
    struct renderer_options o = renderer_default_options();
    *c = *like;
    o.detail = detail;
    o.texture_bytes = kept ? o.texture_bytes : 0;
    c->same_frame = same_frame;
    return renderer_open(&c->renderer, c->gpu, c->take, &lens, &o);
}

struct drawn_image {
    int number;
    struct steps ms;
    struct work work;
};

static int slowest_first(const void *a, const void *b)
{
    const struct drawn_image *x = a, *y = b;
    return (x->ms.all < y->ms.all) - (x->ms.all > y->ms.all);
}

// After ITEMS images the same ones repeat, so the minimum for each is its own cost, nearly undisturbed.
static double own_ms(const struct drawn_image *images, int item)
{
    double least = INFINITY;
    for (int i = 0; i < MANY; i++)
        if (images[i].number % ITEMS == item)
            least = fmin(least, images[i].ms.all);
    return least;
}

// A thread that had to wait for a processor finds its caches filled by another program.
static bool was_disturbed(const struct drawn_image *p)
{
    return p->work.stolen_ms > 0 || p->work.waited_ms > 0.1 * p->ms.all;
}

static void print_many(const char *name, struct drawn_image *images)
{
    double own[ITEMS], sorted[ITEMS], undisturbed_ms = 0;
    for (int k = 0; k < ITEMS; k++)
        sorted[k] = own[k] = own_ms(images, k);
    qsort(images, MANY, sizeof *images, slowest_first);
    const double median = images[MANY / 2].ms.all, own_median = bench_percentile(sorted, ITEMS, 0.5);
    for (int i = 0; i < MANY && undisturbed_ms == 0; i++)
        undisturbed_ms = was_disturbed(&images[i]) ? 0 : images[i].ms.all;
    printf("%s, %d images: median %.2f ms, the slowest %.2f times that;\n", name, MANY, median,
           images[0].ms.all / median);
    if (undisturbed_ms > 0)
        printf("the slowest undisturbed one %.2f times;\n", undisturbed_ms / median);
    else
        printf("every one of them was disturbed;\n");
    printf("of the %d different ones, by the minimum of repeated drawing, the most expensive takes %.2f times the "
           "median\n",
           ITEMS, sorted[ITEMS - 1] / own_median);
    for (int i = 0; i < SLOWEST; i++) {
        const struct drawn_image *p = &images[i];
        printf("  slow: number %3d, %5.2f ms, at least %5.2f (submit %5.2f, finish %5.2f, the driver's threads %5.2f); "
               "waited %5.2f, stolen %2.0f, %2.0f pages%s\n",
               p->number, p->ms.all, own[p->number % ITEMS], p->ms.submit, p->ms.finish,
               p->ms.all - p->ms.submit - p->ms.finish, p->work.waited_ms, p->work.stolen_ms, p->work.faults,
               p->ms.loaded ? ", loaded" : "");
    }
    printf("\n");
}

// Those before the first are drawn but not reported: they warm the caches.
static enum status measure_many(const char *name, struct draw_contender *c)
{
    struct drawn_image images[MANY];
    for (int i = -ITEMS; i < MANY; i++) {
        const struct work before = work_so_far();
        struct drawn_image image = {.number = i};
        enum status status = draw(c, i < 0 ? i + ITEMS : i, &image.ms);
        if (status < 0)
            return status;
        image.work = work_since(&before);
        if (i >= 0)
            images[i] = image;
    }
    print_many(name, images);
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
        {"ours, changing frames", DETAIL_FULL, false, true}, {"paper, changing frames", DETAIL_PAPER, false, true},
        {"ours, one frame", DETAIL_FULL, true, true},        {"paper, one frame", DETAIL_PAPER, true, true},
        {"ours, not resident", DETAIL_FULL, false, false},   {"paper, not resident", DETAIL_PAPER, false, false},
    };
    struct rehearsed rehearsed;
    struct draw_contender base = {0}, all[CONTENDERS] = {{0}};
    struct bench_contender contenders[CONTENDERS];
    enum status status = rehearsed_open(&rehearsed, 0);
    base.take = rehearsed.take;
    if (status == OK)
        status = gpu_open(&base.gpu);
    for (int i = 0; i < CONTENDERS && status == OK; i++) {
        contenders[i] = (struct bench_contender){plans[i].name, measure, &all[i], i == 1};
        status = open_renderer(&all[i], &base, plans[i].detail, plans[i].same_frame, plans[i].kept);
    }
    // Of a few rounds the first must not count: shaders are compiled and frames uploaded in it.
    const int items = bench_count(b, ITEMS, 0.35);
    for (int i = 0; i < items * CONTENDERS && status == OK && bench_inputs(b)->brief; i++) {
        struct steps ignored;
        status = draw(&all[i % CONTENDERS], i / CONTENDERS, &ignored);
    }
    if (status == OK) {
        if (!bench_inputs(b)->brief && !bench_inputs(b)->json)
            printf("draw: %d x %d, %s\n", WIDTH, HEIGHT, gpu_renderer(base.gpu));
        status = bench_run(b, contenders, CONTENDERS, items);
    }
    for (int i = 0; i < 2 && status == OK && !bench_inputs(b)->brief; i++)
        status = measure_many(plans[i].name, &all[i]);
    for (int i = 0; i < CONTENDERS; i++)
        renderer_close(&all[i].renderer);
    gpu_close(&base.gpu);
    rehearsed_close(&rehearsed);
    return status;
}

const struct bench_stage bench_stage_draw = {
    .name = "draw",
    .about = "drawing the actor at 1280x800, next to eleven textured cylinders",
    .error_name = "draw_calls",
    .time_name = "time_ms",
    .extra_names = {"uploads", "made"},
    .run = run,
};
