// Stage "surround": virtual cameras on a small made-up road (tests/support/road_scene.h), drawn from panoramas with
// dense depth by several settings, next to splatting the plain coloured points. Error: root mean square of the colours'
// levels against the true picture. Silhouettes: of the pixels within so many of a jump of the true depth, the share
// whose depth is off by more than 5 % or which are not drawn; paper 003's test of equation 1 and 2 is there to lessen
// it. Lines: mean difference of where the detector finds the lane's lines on the drawn and on the true picture.
#include "tests/bench/bench.h"

#include "tests/support/road_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { VIEWS = 6, SILHOUETTE_PX = 5 };
static const uint32_t SEED = 2013;

struct surround_bench {
    struct road_scene scene;
    struct lens lens;
    uint8_t *truth[VIEWS];
    float *depth[VIEWS];
    bool *silhouette[VIEWS];
    struct surround_view view;
};

struct contender {
    struct surround_bench *all;
    struct view_options how;
    bool plain;
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

static enum status make(struct surround_bench *b)
{
    b->lens = road_view_lens(1);
    printf("surround: seed %u, %d x %d\n", SEED, b->lens.width, b->lens.height);
    enum status status = road_scene_make(&b->scene, SEED);
    if (status == OK)
        status = surround_view_open(&b->view, &b->lens);
    const size_t pixels = (size_t)b->lens.width * (size_t)b->lens.height;
    for (int i = 0; i < VIEWS && status == OK; i++) {
        b->truth[i] = malloc(pixels * 3);
        b->depth[i] = malloc(pixels * sizeof **b->depth);
        b->silhouette[i] = calloc(pixels, sizeof **b->silhouette);
        if (!b->truth[i] || !b->depth[i] || !b->silhouette[i])
            return fail(ERR_MEMORY, "no memory for pictures");
        road_view_truth(&b->scene, &b->lens, road_view(i), b->truth[i], b->depth[i]);
        mark_silhouettes(&b->lens, b->depth[i], b->silhouette[i]);
    }
    return status;
}

static void judge(const struct surround_bench *b, int item, struct bench_measure *out)
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

static enum status measure(void *self, int item, struct bench_measure *out)
{
    const struct contender *c = self;
    struct surround_bench *b = c->all;
    const struct surround_picture *order[ROAD_PANORAMAS];
    const struct pose at = road_view(item);
    for (int k = 0; k < ROAD_PANORAMAS; k++)
        order[k] = &b->scene.pictures[k];
    const double started_ms = bench_clock_ms();
    enum status status = surround_view_rank(at, order, ROAD_PANORAMAS);
    if (status == OK && c->plain)
        surround_view_splat(&b->view, at, order, ROAD_PANORAMAS);
    else if (status == OK)
        status = surround_view_draw(&b->view, at, order, ROAD_PANORAMAS, &c->how);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK)
        judge(b, item, out);
    return status;
}

// The truth, and the same view by three of the settings.
static enum status draw_pictures(struct bench *bench, struct contender *c, const struct bench_contender *contenders)
{
    static const int shown[] = {0, 3, 5}, item = VIEWS / 2;
    const struct surround_bench *b = c->all;
    enum status status = OK;
    bench_picture(bench, "the truth", b->truth[item], b->lens.width, b->lens.height);
    for (size_t i = 0; i < COUNT_OF(shown) && status == OK; i++) {
        struct bench_measure measured = {0};
        char caption[100];
        status = measure(&c[shown[i]], item, &measured);
        snprintf(caption, sizeof caption, "%s: %.0f levels, %.0f %% of silhouettes off", contenders[shown[i]].name,
                 measured.error, measured.extra[0]);
        if (status == OK)
            bench_picture(bench, caption, b->view.rgb, b->lens.width, b->lens.height);
    }
    return status;
}

static enum status run(struct bench *bench)
{
    struct surround_bench *b = calloc(1, sizeof *b);
    enum status status = b ? make(b) : fail(ERR_MEMORY, "no memory");
    if (status == OK) {
        const struct view_options usual = view_default_options();
        struct contender c[6];
        for (size_t i = 0; i < COUNT_OF(c); i++)
            c[i] = (struct contender){b, usual, false};
        c[1].how.texture_pictures = 1;
        c[2].how.geometry_pictures = 2;
        c[3].how.geometry_pictures = 1;
        c[4].how.depth_test = false;
        c[5].plain = true;
        const struct bench_contender contenders[] = {
            {"ours", measure, &c[0], false},
            {"ours, texture of one picture", measure, &c[1], false},
            {"ours, geometry of two pictures", measure, &c[2], false},
            {"ours, geometry of one picture", measure, &c[3], false},
            {"ours, without the depth test", measure, &c[4], false},
            {"coloured points, splatted", measure, &c[5], true},
        };
        status = bench_run(bench, contenders, COUNT_OF(contenders), VIEWS);
        if (status == OK)
            status = draw_pictures(bench, c, contenders);
    }
    if (b) {
        road_scene_free(&b->scene);
        surround_view_close(&b->view);
        for (int i = 0; i < VIEWS; i++) {
            free(b->truth[i]);
            free(b->depth[i]);
            free(b->silhouette[i]);
        }
    }
    free(b);
    return status;
}

const struct bench_stage bench_stage_surround = {
    "surround",
    "virtual cameras on a road, drawn from panoramas with depth",
    "rms_levels",
    "time_ms",
    {"silhouettes_off_percent", "unseen_percent", "lines_off_mm", "lines_missed"},
    run};
