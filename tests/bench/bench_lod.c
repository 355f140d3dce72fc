// Stage "levels": error against time of each level of detail, from 1 m to 6 m, all round the small world's dancer, each
// view at another recorded instant. The truth is the world's own rendering from the same pose.
//
// The error: the area between the true silhouette and the drawn one per pixel of the true silhouette's length, that is
// the mean distance between the two. Next to it what the program predicted (reenact/render/actor_renderer.h), and the
// colour error where both cover. Times are of all threads together until all is drawn, the median of several drawings
// of the same image by each level in turn, then the median of the views, relative to DETAIL_PAPER. What a level costs
// before its first picture: processor time, and memory that stays, of the graphics driver included.
#include "reenact/render/actor_renderer.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_lod_plot.h"
#include "tests/bench/bench_look.h"
#include "tests/bench/bench_views_data.h"
#include "tests/support/gpu_finish.h"
#include "tests/world/world.h"

#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { VIEWS = 6, DRAWN = 5, LEVELS = 6, PICTURED_M = 3 };
static const double ABOVE_M = 0.4;   // the viewer's height above the waist
static const double AROUND_M = 0.35; // of the person about the joints, at most
static const double SAME_PLACE_M =
    0.15; // furniture occludes the actor if it is nearer than the nearest joint by this much

// How the levels are drawn.
static const struct {
    const char *name, *colour;
    enum detail detail;
    double error_px; // allowed
    bool pictured;   // on the page
} plans[LEVELS] = {
    {"paper", "#c60", DETAIL_PAPER, 1, true},      {"parts", "#383", DETAIL_PARTS, 1, true},
    {"fused", "#088", DETAIL_FUSED, 1, true},      {"full", "#06c", DETAIL_FULL, 1, true},
    {"auto, 1 px", "#000", DETAIL_AUTO, 1, false}, {"auto, 20 px", "#a0a", DETAIL_AUTO, 20, true},
};

struct level {
    struct renderer *renderer;
    double area, length, predicted, squares, covered; // sums over a distance's views
    int at[DETAIL_LEVELS];                            // views drawn at each level
    double ms[VIEWS];
    double prepare_s, kept_mib;
};

enum { BACKGROUND, PERSON, HIDDEN };

struct lod_bench {
    struct views_data data;
    struct world *world;
    struct gpu *gpu;
    struct level level[LEVELS];
    uint8_t *rgb, *rgba, *seen; // the true image; the drawn person; BACKGROUND ... of each pixel
    double length;              // of the true silhouette
    int views;                  // at each distance
    struct bench *bench;        // for pictures of one view; NULL: of this view none
};

// ------------------------------------------------------------- the truth

// The part of the image with the person in it, as a lens of its own. *nearest_m: depth of the nearest joint.
static struct lens crop_to(const struct lens *whole, const struct skeleton *in_viewer, int *left, int *top,
                           double *nearest_m)
{
    double x0 = whole->width, x1 = 0, y0 = whole->height, y1 = 0;
    *nearest_m = INFINITY;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = in_viewer->joint[j];
        double z = fmax(p.z, 0.2), margin = AROUND_M * whole->fx / z;
        struct pixel at = lens_project(whole, v3(p.x, p.y, z));
        x0 = fmin(x0, at.x - margin), x1 = fmax(x1, at.x + margin);
        y0 = fmin(y0, at.y - margin), y1 = fmax(y1, at.y + margin);
        *nearest_m = fmin(*nearest_m, z);
    }
    struct lens part = *whole;
    *left = (int)fmax(0, floor(x0));
    *top = (int)fmax(0, floor(y0));
    part.width = (int)fmin(whole->width, ceil(x1)) - *left;
    part.height = (int)fmin(whole->height, ceil(y1)) - *top;
    part.cx -= *left;
    part.cy -= *top;
    return part;
}

// The sum over directions of a silhouette's steps between pixels is 4/pi of its length.
static double silhouette_length(const uint8_t *seen, int width, int height)
{
    int steps = 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const uint8_t *at = &seen[y * width + x];
            steps += x + 1 < width && at[0] + at[1] == PERSON;
            steps += y + 1 < height && at[0] + at[width] == PERSON;
        }
    return steps * 0.7853981633974483;
}

static enum status film_truth(struct lod_bench *s, struct pose viewer, double time_s)
{
    const struct lens *lens = &s->data.lens;
    size_t pixels = (size_t)lens->width * (size_t)lens->height;
    struct skeleton joints = world_joints_in_camera(s->world, time_s, viewer);
    int left, top;
    double nearest_m;
    struct world_shot shot = {crop_to(lens, &joints, &left, &top, &nearest_m), viewer, time_s, true};
    size_t part = (size_t)shot.lens.width * (size_t)shot.lens.height;
    uint8_t *rgb = malloc(3 * part), *mask = malloc(part);
    uint16_t *room = malloc(part * sizeof *room);
    enum status status = rgb && mask && room ? OK : fail(ERR_MEMORY, "no memory for an image");
    if (status == OK)
        status = world_render(s->world, &shot, &(struct world_image){.color = rgb, .mask = mask});
    shot.actor = false;
    if (status == OK)
        status = world_render(s->world, &shot, &(struct world_image){.depth = room});
    memset(s->seen, BACKGROUND, pixels);
    for (size_t i = 0; i < part && status == OK; i++) {
        size_t at = (i / (size_t)shot.lens.width + (size_t)top) * (size_t)lens->width + i % (size_t)shot.lens.width +
                    (size_t)left;
        bool hidden = room[i] && room[i] * 0.001 < nearest_m - SAME_PLACE_M;
        s->seen[at] = hidden ? HIDDEN : mask[i] ? PERSON : BACKGROUND;
        memcpy(s->rgb + 3 * at, rgb + 3 * i, 3);
    }
    s->length = silhouette_length(s->seen, lens->width, lens->height);
    free(rgb);
    free(mask);
    free(room);
    return status;
}

// ------------------------------------------------------------- the levels

static void judge(const struct lod_bench *s, struct level *l)
{
    l->length += s->length;
    for (int i = 0; i < s->data.lens.width * s->data.lens.height; i++) {
        bool there = s->seen[i] == PERSON, drawn = s->rgba[4 * i + 3] >= 128;
        if (s->seen[i] == HIDDEN)
            continue;
        l->area += there != drawn;
        for (int c = 0; c < 3 && there && drawn; c++) {
            double d = (double)s->rgba[4 * i + c] - (double)s->rgb[3 * i + c];
            l->squares += d * d;
            l->covered++;
        }
    }
}

// ------------------------------------------------------------- pictures

enum { MARGIN = 12 }; // pixels around the person
static const uint8_t PAPER[3] = {245, 245, 245}, TOO_MUCH[3] = {220, 40, 40}, TOO_LITTLE[3] = {40, 90, 220};

struct box {
    int x0, y0, x1, y1; // first and last
};

static struct box box_of_person(const struct lod_bench *s)
{
    const int width = s->data.lens.width, height = s->data.lens.height;
    struct box b = {width, height, 0, 0};
    for (int i = 0; i < width * height; i++)
        if (s->seen[i] == PERSON) {
            const int x = i % width, y = i / width;
            b = (struct box){x < b.x0 ? x : b.x0, y < b.y0 ? y : b.y0, x > b.x1 ? x : b.x1, y > b.y1 ? y : b.y1};
        }
    return (struct box){b.x0 > MARGIN ? b.x0 - MARGIN : 0, b.y0 > MARGIN ? b.y0 - MARGIN : 0,
                        b.x1 + MARGIN < width ? b.x1 + MARGIN : width - 1,
                        b.y1 + MARGIN < height ? b.y1 + MARGIN : height - 1};
}

// The person as drawn, or as it is; what is drawn beside the person and what is missing of it is marked.
static void show_person(const struct lod_bench *s, const char *caption, bool truth)
{
    const struct box b = box_of_person(s);
    const int width = b.x1 - b.x0 + 1, height = b.y1 - b.y0 + 1;
    uint8_t *rgb = width > 0 && height > 0 ? malloc(3 * (size_t)width * (size_t)height) : NULL;
    for (int i = 0; rgb && i < width * height; i++) {
        const int at = (b.y0 + i / width) * s->data.lens.width + b.x0 + i % width;
        const bool there = s->seen[at] == PERSON, drawn = s->rgba[4 * at + 3] >= 128 && s->seen[at] != HIDDEN;
        const uint8_t *from = truth            ? there ? s->rgb + 3 * at : PAPER
                              : there != drawn ? there ? TOO_LITTLE : TOO_MUCH
                              : there          ? s->rgba + 4 * at
                                               : PAPER;
        memcpy(rgb + 3 * i, from, 3);
    }
    if (rgb)
        bench_picture(s->bench, caption, rgb, width, height);
    free(rgb);
}

static void show_level(const struct lod_bench *s, int level)
{
    char caption[128];
    if (!s->bench || !plans[level].pictured)
        return;
    if (level == 0) {
        snprintf(caption, sizeof caption, "the truth, from %d m", PICTURED_M);
        show_person(s, caption, true);
    }
    snprintf(caption, sizeof caption, "%s; red is drawn beside the person, blue is missing", plans[level].name);
    show_person(s, caption, false);
}

// ------------------------------------------------------------- measuring

static enum status draw_view(struct lod_bench *s, const struct renderer_view *view, int number)
{
    double ms[LEVELS][DRAWN];
    enum status status = OK;
    for (int i = 0; i < DRAWN * LEVELS && status == OK; i++) {
        struct level *l = &s->level[i % LEVELS];
        struct renderer_result result;
        double started_ms = bench_all_threads_ms();
        status = renderer_draw(l->renderer, view, &result);
        if (status == OK)
            status = gpu_finish(s->gpu);
        ms[i % LEVELS][i / LEVELS] = bench_all_threads_ms() - started_ms;
        if (status != OK || i < (DRAWN - 1) * LEVELS)
            continue;
        status = renderer_read_actor(l->renderer, s->rgba);
        l->predicted += result.error_px;
        l->at[result.level]++;
        judge(s, l);
        show_level(s, i % LEVELS);
    }
    for (int i = 0; i < LEVELS && status == OK; i++)
        s->level[i].ms[number] = bench_percentile(ms[i], DRAWN, 0.5);
    return status;
}

static enum status measure_view(struct lod_bench *s, double away_m, int number)
{
    const struct take *take = s->data.own;
    const struct take_entry *e = take_entry(take, number * take_frame_count(take) / s->views);
    int64_t since_ns = e->time_ns - take_entry(take, 0)->time_ns;
    double time_s = (double)since_ns * 1e-9, angle = 6.283185307179586 * number / s->views;
    struct vec3 waist = world_joints(s->world, time_s).joint[JOINT_WAIST];
    struct vec3 eye = v3_add(waist, v3(away_m * sin(angle), -away_m * cos(angle), ABOVE_M));
    struct pose viewer = bench_look_at(eye, waist);
    enum status status = film_truth(s, viewer, time_s);
    // Relative to the sensor, so that the sensor's localisation does not count.
    struct pose take_from_world = pose_multiply(e->world_from_camera, pose_inverse(world_sensor_pose(s->world)));
    struct renderer_view view = {.world_from_camera = pose_multiply(take_from_world, viewer), .time_ns = since_ns};
    return status == OK ? draw_view(s, &view, number) : status;
}

// ------------------------------------------------------------- the stage

// Of the heap and of what is mapped for large blocks.
static double allocated_mib(void)
{
    const struct mallinfo2 info = mallinfo2();
    return (double)(info.uordblks + info.hblkhd) / (1 << 20);
}

static enum status open_level(struct lod_bench *s, int i)
{
    struct renderer_options o = renderer_default_options();
    o.detail = plans[i].detail;
    o.error_px = plans[i].error_px;
    const double began_ms = bench_all_threads_ms(), before_mib = allocated_mib();
    enum status status = renderer_open(&s->level[i].renderer, s->gpu, s->data.own, &s->data.lens, &o);
    if (status == OK && plans[i].detail == DETAIL_AUTO)
        status = renderer_measure_costs(s->level[i].renderer);
    s->level[i].prepare_s = (bench_all_threads_ms() - began_ms) / 1000;
    s->level[i].kept_mib = allocated_mib() - before_mib;
    return status;
}

static enum status open_lod_bench(struct lod_bench *s, bool brief)
{
    struct world_options world = world_default_options();
    enum status status = views_data_open(&s->data, NULL, brief);
    size_t pixels = (size_t)s->data.lens.width * (size_t)s->data.lens.height;
    if (status == OK)
        status = world_open(&s->world, &world);
    if (status == OK)
        status = gpu_open(&s->gpu);
    for (int i = 0; i < LEVELS && status == OK; i++)
        status = open_level(s, i);
    if (status != OK)
        return status;
    s->rgb = malloc(3 * pixels);
    s->rgba = malloc(4 * pixels);
    s->seen = malloc(pixels);
    return s->rgb && s->rgba && s->seen ? OK : fail(ERR_MEMORY, "no memory for an image");
}

static void close_lod_bench(struct lod_bench *s)
{
    for (int i = 0; i < LEVELS; i++)
        renderer_close(&s->level[i].renderer);
    gpu_close(&s->gpu);
    world_close(&s->world);
    views_data_close(&s->data);
    free(s->rgb);
    free(s->rgba);
    free(s->seen);
}

static enum status sum_up(struct bench *b, struct lod_bench *s, int distance, struct lod_plot_line *lines)
{
    enum status status = OK;
    double plain_ms = bench_percentile(s->level[0].ms, s->views, 0.5);
    for (int i = 0; i < LEVELS && status == OK; i++) {
        struct level *l = &s->level[i];
        struct lod_plot_mark *m = &lines[i].mark[distance];
        char name[64];
        *m = (struct lod_plot_mark){distance + 1, bench_percentile(l->ms, s->views, 0.5) / plain_ms,
                                    l->area / l->length, l->predicted / s->views};
        snprintf(name, sizeof name, "%g m, %s", m->away_m, plans[i].name);
        status = bench_add_row(
            b, name,
            (const double[]){m->time_ratio, m->error_px, m->predicted_px, sqrt(l->squares / fmax(l->covered, 1)),
                             100.0 * l->at[DETAIL_PAPER] / s->views, 100.0 * l->at[DETAIL_PARTS] / s->views,
                             100.0 * l->at[DETAIL_FUSED] / s->views, l->prepare_s, l->kept_mib});
        *l = (struct level){.renderer = l->renderer, .prepare_s = l->prepare_s, .kept_mib = l->kept_mib};
    }
    return status;
}

static enum status run(struct bench *b)
{
    static struct lod_bench s;
    static const char *const columns[] = {"time_ratio", "error_px",  "predicted", "grey_rms", "paper_pct",
                                          "parts_pct",  "fused_pct", "prepare_s", "kept_mib"};
    struct lod_plot_line lines[LEVELS];
    for (int i = 0; i < LEVELS; i++)
        lines[i] = (struct lod_plot_line){
            .name = plans[i].name, .colour = plans[i].colour, .ring = plans[i].detail == DETAIL_AUTO};
    const bool brief = bench_inputs(b)->brief;
    bench_columns(b, columns, COUNT_OF(columns));
    s.views = brief ? 3 : VIEWS;
    enum status status = open_lod_bench(&s, brief);
    for (int d = 0; d < LOD_PLOT_DISTANCES && status == OK; d += brief ? 2 : 1) {
        for (int v = 0; v < s.views && status == OK; v++) {
            s.bench = d + 1 == PICTURED_M && v == 1 ? b : NULL;
            status = measure_view(&s, d + 1, v);
        }
        if (status == OK)
            status = sum_up(b, &s, d, lines);
    }
    const char *plot = bench_inputs(b)->plot;
    if (status == OK && plot)
        status = lod_plot(plot, lines, LEVELS);
    close_lod_bench(&s);
    return status;
}

const struct bench_stage bench_stage_lod = {
    .name = "levels",
    .about = "error against time of each level of detail, 1 m to 6 m from the person",
    .error_name = "error_px",
    .time_name = "time_ratio",
    .run = run,
};
