// Stage "surround": virtual cameras on a small made-up road (tests/support/road_scene.h), drawn from panoramas with
// dense depth by several settings, next to splatting the plain coloured points. Error: root mean square of the colours'
// levels against the true picture. Silhouettes: of the pixels within so many of a jump of the true depth, the share
// whose depth is off by more than 5 % or which are not drawn; paper 003's test of equation 1 and 2 is there to lessen
// it. Lines: mean difference of where the detector finds the lane's lines on the drawn and on the true picture. By the
// graphics card, larger, next to the same points splatted by it; time there is that of all threads, because without a
// graphics card the driver has several.
#include "base/clock.h"
#include "surround/gpu/surround_renderer.h"
#include "tests/bench/bench.h"
#include "tests/bench/point_splats.h"
#include "tests/support/gpu_finish.h"
#include "tests/support/road_scene.h"
#include "tests/support/surround_readback.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { VIEWS = 6, SILHOUETTE_PX = 5 };
static const uint32_t SEED = 2013;

enum engine { PROCESSOR, PROCESSOR_POINTS, CARD, CARD_POINTS };
enum { SIZES = 2 }; // the processor's, the graphics card's

struct views {
    struct lens lens;
    uint8_t *truth[VIEWS];
    float *depth[VIEWS];
    bool *silhouette[VIEWS];
    struct surround_view view;
};

struct surround_bench {
    struct road_scene scene;
    struct views views[SIZES];
    struct gpu *gpu;
    struct surround_renderer *renderer;
    struct point_splats *splats;
};

struct contender {
    struct surround_bench *all;
    struct view_options options;
    enum engine engine;
};

// Within SILHOUETTE_PX of two neighbours whose depths differ by more than a tenth.
static void mark_silhouettes(const struct lens *lens, const float *depth, bool *out)
{
    const int w = lens->width, h = lens->height;
    for (int v = 0; v < h - 1; v++)
        for (int u = 0; u < w - 1; u++) {
            const float here = depth[v * w + u], right = depth[v * w + u + 1], down = depth[(v + 1) * w + u];
            const float least = fminf(here, fminf(right, down)), most = fmaxf(here, fmaxf(right, down));
            if (most <= 1.1f * least && least > 0)
                continue;
            if (most <= 0)
                continue;
            for (int y = v - SILHOUETTE_PX; y <= v + SILHOUETTE_PX; y++)
                for (int x = u - SILHOUETTE_PX; x <= u + SILHOUETTE_PX; x++)
                    if (x >= 0 && y >= 0 && x < w && y < h)
                        out[y * w + x] = true;
        }
}

static enum status make_views(struct surround_bench *b, const struct lens *lens, struct views *out)
{
    const size_t pixels = (size_t)lens->width * (size_t)lens->height;
    out->lens = *lens;
    enum status status = surround_view_open(&out->view, lens);
    for (int i = 0; i < VIEWS && status == OK; i++) {
        out->truth[i] = malloc(pixels * 3);
        out->depth[i] = malloc(pixels * sizeof **out->depth);
        out->silhouette[i] = calloc(pixels, sizeof **out->silhouette);
        if (!out->truth[i] || !out->depth[i] || !out->silhouette[i])
            return fail(ERR_MEMORY, "no memory for pictures");
        road_view_truth(&b->scene, lens, road_view(i), out->truth[i], out->depth[i]);
        mark_silhouettes(lens, out->depth[i], out->silhouette[i]);
    }
    return status;
}

static void free_views(struct views *v)
{
    surround_view_close(&v->view);
    for (int i = 0; i < VIEWS; i++) {
        free(v->truth[i]);
        free(v->depth[i]);
        free(v->silhouette[i]);
    }
}

static enum status make(struct surround_bench *b)
{
    const struct lens small = road_view_lens(1);
    const double f = 2 * small.fx; // of as wide an angle
    const struct lens display = {.width = 1280, .height = 800, .fx = f, .fy = f, .cx = 639.5, .cy = 399.5};
    printf("surround: seed %u, %d x %d, by the graphics card %d x %d\n", SEED, small.width, small.height, display.width,
           display.height);
    enum status status = road_scene_make(&b->scene, SEED);
    for (int i = 0; i < ROAD_PANORAMAS; i++)
        b->scene.pictures[i].depth_number = i + 1;
    if (status == OK)
        status = make_views(b, &small, &b->views[0]);
    if (status == OK)
        status = make_views(b, &display, &b->views[1]);
    if (status == OK)
        status = gpu_open(&b->gpu);
    if (status == OK)
        status = surround_renderer_open(&b->renderer, b->gpu);
    if (status == OK)
        status = point_splats_open(&b->splats, b->gpu, b->scene.pictures, ROAD_PANORAMAS);
    return status;
}

static void judge(const struct views *b, int item, struct bench_measure *out)
{
    const int pixels = b->lens.width * b->lens.height;
    double sum = 0, drawn[2], real[2];
    int off = 0, edge = 0, unseen = 0, lines = 0;
    for (int i = 0; i < pixels; i++) {
        for (int c = 0; c < 3; c++) {
            const double d = b->view.rgb[3 * i + c] - b->truth[item][3 * i + c];
            sum += d * d;
        }
        const double z = b->depth[item][i], got = (double)b->view.inverse_z[i];
        unseen += b->view.source[i] == SOURCE_UNSEEN;
        if (!b->silhouette[item][i])
            continue;
        edge++;
        off += got < 0 || (z > 0 ? !(got * z > 0.95 && got * z < 1.05) : got > 1e-3);
    }
    road_find_lines(b->truth[item], &b->lens, road_view(item), real);
    road_find_lines(b->view.rgb, &b->lens, road_view(item), drawn);
    out->error = sqrt(sum / (3.0 * pixels));
    out->extra[0] = edge ? 100.0 * off / edge : 0;
    out->extra[1] = 100.0 * unseen / pixels;
    out->extra[2] = 0;
    for (int side = 0; side < 2; side++)
        if (isfinite(drawn[side]) && isfinite(real[side])) {
            out->extra[2] += 1e3 * fabs(drawn[side] - real[side]);
            lines++;
        }
    out->extra[2] /= lines ? lines : 1;
    out->extra[3] = 2 - lines;
}

static enum status draw_by_card(const struct contender *c, struct pose at,
                                const struct surround_picture *const *pictures)
{
    struct surround_bench *b = c->all;
    const struct surround_image image = {b->views[1].lens, at, c->options, true, 0};
    const struct gpu_texture *texture;
    const enum status status = c->engine == CARD
                                   ? surround_renderer_draw(b->renderer, &image, pictures, ROAD_PANORAMAS, &texture)
                                   : point_splats_draw(b->splats, &image.lens, at);
    return status == OK ? gpu_finish(b->gpu) : status;
}

static enum status read_back(const struct contender *c)
{
    struct surround_view *view = &c->all->views[1].view;
    return c->engine == CARD          ? surround_readback(c->all->renderer, view)
           : c->engine == CARD_POINTS ? point_splats_read(c->all->splats, view)
                                      : OK;
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    const struct contender *c = self;
    struct surround_bench *b = c->all;
    struct views *v = &b->views[c->engine >= CARD];
    double (*const clock_ms)(void) = c->engine >= CARD ? bench_all_threads_ms : bench_clock_ms;
    const struct surround_picture *order[ROAD_PANORAMAS];
    const struct pose at = road_view(item);
    for (int k = 0; k < ROAD_PANORAMAS; k++)
        order[k] = &b->scene.pictures[k];
    const int64_t started_ns = clock_now_ns();
    const double started_ms = clock_ms();
    enum status status = surround_view_rank(at, order, ROAD_PANORAMAS);
    if (status == OK && c->engine >= CARD)
        status = draw_by_card(c, at, order);
    else if (status == OK && c->engine == PROCESSOR_POINTS)
        surround_view_splat(&v->view, at, order, ROAD_PANORAMAS);
    else if (status == OK)
        status = surround_view_draw(&v->view, at, order, ROAD_PANORAMAS, &c->options);
    out->time_ms = clock_ms() - started_ms;
    const double elapsed_ms = (double)(clock_now_ns() - started_ns) * 1e-6;
    if (status == OK)
        status = read_back(c);
    if (status == OK)
        judge(v, item, out);
    out->extra[4] = elapsed_ms;
    return status;
}

// The truth, and the same view by three of the settings.
static enum status draw_pictures(struct bench *bench, struct contender *c, const struct bench_contender *contenders)
{
    static const int shown[] = {0, 5, 6}, item = VIEWS / 2;
    const struct surround_bench *b = c->all;
    const struct views *small = &b->views[0];
    enum status status = OK;
    bench_picture(bench, "the truth", small->truth[item], small->lens.width, small->lens.height);
    for (size_t i = 0; i < COUNT_OF(shown) && status == OK; i++) {
        struct bench_measure measured = {0};
        char caption[100];
        status = measure(&c[shown[i]], item, &measured);
        snprintf(caption, sizeof caption, "%s: %.0f levels, %.0f %% of silhouettes off", contenders[shown[i]].name,
                 measured.error, measured.extra[0]);
        const struct views *v = &b->views[c[shown[i]].engine >= CARD];
        if (status == OK)
            bench_picture(bench, caption, v->view.rgb, v->lens.width, v->lens.height);
    }
    return status;
}

static enum status run_all(struct bench *bench, struct surround_bench *b)
{
    const struct view_options usual = view_default_options();
    struct contender c[8];
    for (size_t i = 0; i < COUNT_OF(c); i++)
        c[i] = (struct contender){b, usual, PROCESSOR};
    c[1].options.texture_pictures = 1;
    c[2].options.geometry_pictures = 2;
    c[3].options.geometry_pictures = 1;
    c[4].options.depth_test = false;
    c[5].engine = PROCESSOR_POINTS;
    c[6].engine = CARD;
    c[7].engine = CARD_POINTS;
    const struct bench_contender contenders[] = {
        {"ours", measure, &c[0], false},
        {"ours, texture of one picture", measure, &c[1], false},
        {"ours, geometry of two pictures", measure, &c[2], false},
        {"ours, geometry of one picture", measure, &c[3], false},
        {"ours, without the depth test", measure, &c[4], false},
        {"coloured points, splatted", measure, &c[5], true},
        {"ours, GLES 1280 x 800", measure, &c[6], false},
        {"coloured points, GLES 1280 x 800", measure, &c[7], false},
    };
    struct bench_measure once; // uploads
    enum status status = measure(&c[6], 0, &once);
    if (status == OK)
        status = bench_run(bench, contenders, COUNT_OF(contenders), VIEWS);
    return status == OK ? draw_pictures(bench, c, contenders) : status;
}

static enum status run(struct bench *bench)
{
    struct surround_bench *b = calloc(1, sizeof *b);
    enum status status = b ? make(b) : fail(ERR_MEMORY, "no memory");
    if (status == OK)
        status = run_all(bench, b);
    if (b) {
        point_splats_close(&b->splats);
        surround_renderer_close(&b->renderer);
        gpu_close(&b->gpu);
        road_scene_free(&b->scene);
        for (int i = 0; i < SIZES; i++)
            free_views(&b->views[i]);
    }
    free(b);
    return status;
}

const struct bench_stage bench_stage_surround = {
    "surround",
    "virtual cameras on a road, drawn from panoramas with depth",
    "rms_levels",
    "time_ms",
    {"silhouettes_off_percent", "unseen_percent", "lines_off_mm", "lines_missed", "elapsed_ms"},
    run};
