// Stage "views": synthesised images of the take from all round: their error by the angle between the sensor's and the
// viewer's direction to the person; the contribution of each cause, with joints and camera poses replaced by the true
// ones; and next to it DETAIL_PAPER ([D14]), and the selected frame's own depth as a mesh.
//
// The error is the share of the two silhouettes' union that only one of them covers (1 - intersection over union). The
// psnr is over that union; "inside" over the intersection, where only colours can be wrong.
#include "reenact/render/actor_renderer.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_study.h"
#include "tests/bench/bench_views_data.h"
#include "tests/bench/bench_views_mesh.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BINS = 5 };
static const double bin_ends_deg[BINS] = {15, 45, 90, 135, 180};
static const char *const bin_names[BINS] = {"0-15 degrees", "15-45", "45-90", "90-135", "135-180"};

struct views_viewer {
    const struct views_data *data;
    struct renderer *renderer; // NULL: the mesh
    bool true_poses;
    uint8_t *rgb, *rgba, *alpha;
};

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct views_viewer *v = self;
    const struct views_image *p = &v->data->image[item];
    size_t pixels = (size_t)v->data->lens.width * (size_t)v->data->lens.height;
    if (!v->true_poses && !p->placed)
        return NOTHING;
    struct pose pose = v->true_poses ? p->truth : p->found;
    double started_ms = bench_clock_ms();
    enum status status;
    if (v->renderer) {
        struct renderer_view view = {.world_from_camera = pose, .time_ns = p->since_ns, .color = p->room};
        struct renderer_result result;
        status = renderer_draw(v->renderer, &view, &result);
        if (status == OK)
            status = renderer_read(v->renderer, v->rgb);
    } else {
        memcpy(v->rgb, p->room, 3 * pixels);
        status = views_mesh_draw(v->data->own, views_nearest_frame(v->data->own, p->since_ns), &v->data->lens, pose,
                                 v->rgb, v->alpha);
    }
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK && v->renderer) {
        status = renderer_read_actor(v->renderer, v->rgba);
        for (size_t i = 0; i < pixels; i++)
            v->alpha[i] = v->rgba[4 * i + 3];
    }
    if (status == OK)
        views_judge(v->data, p, v->rgb, v->alpha, out);
    return status;
}

// The image half-way: the truth, and what each makes of it.
static enum status draw_pictures(struct bench *b, struct views_viewer *full, struct views_viewer *paper,
                                 struct views_viewer *mesh)
{
    struct views_viewer *const viewers[] = {full, paper, mesh};
    const char *const captions[] = {"full (default)", "paper", "raw depth as a mesh"};
    const int item = full->data->count / 2;
    struct bench_measure measured = {0};
    enum status status = OK;
    bench_picture(b, "the truth", full->data->image[item].expected, full->data->lens.width, full->data->lens.height);
    for (size_t i = 0; i < COUNT_OF(viewers) && status == OK; i++) {
        char caption[100];
        status = measure(viewers[i], item, &measured);
        snprintf(caption, sizeof caption, "%s: %.1f dB, outline %.1f %%", captions[i], measured.extra[0],
                 measured.error);
        if (status == OK)
            bench_picture(b, caption, viewers[i]->rgb, full->data->lens.width, full->data->lens.height);
    }
    return status == NOTHING ? OK : status;
}

static enum status run_viewers(struct bench *b, const struct views_data *data, struct gpu *gpu)
{
    struct renderer *own = NULL, *true_joints = NULL, *paper = NULL;
    struct renderer_options options = renderer_default_options();
    size_t pixels = (size_t)data->lens.width * (size_t)data->lens.height;
    uint8_t *rgb = malloc(3 * pixels), *rgba = malloc(4 * pixels), *alpha = malloc(pixels);
    enum status status = rgb && rgba && alpha ? OK : fail(ERR_MEMORY, "no memory for an image");
    if (status == OK)
        status = renderer_open(&own, gpu, data->own, &data->lens, &options);
    if (status == OK && !bench_inputs(b)->brief)
        status = renderer_open(&true_joints, gpu, data->true_take, &data->lens, &options);
    options.detail = DETAIL_PAPER;
    if (status == OK)
        status = renderer_open(&paper, gpu, data->own, &data->lens, &options);
    if (status == OK) {
        struct views_viewer full = {data, own, false, rgb, rgba, alpha}, poses = full, joints = full, both = full,
                            paper_viewer = full, mesh = full;
        poses.true_poses = both.true_poses = true;
        joints.renderer = both.renderer = true_joints;
        paper_viewer.renderer = paper;
        mesh.renderer = NULL;
        const struct bench_contender contenders[] = {
            {"full", measure, &full, false},
            {"paper", measure, &paper_viewer, true},
            {"depth mesh", measure, &mesh, false},
            {"full, true poses", measure, &poses, false},
            {"full, true joints", measure, &joints, false},
            {"full, both true", measure, &both, false},
        };
        const bool brief = bench_inputs(b)->brief; // without what the truth would change
        int bin_of[VIEWS_MAX];
        for (int i = 0; i < data->count; i++) {
            bin_of[i] = 0;
            while (bin_of[i] < BINS - 1 && data->image[i].angle_deg >= bin_ends_deg[bin_of[i]])
                bin_of[i]++;
        }
        const struct bench_groups bins = {bin_names, BINS, bin_of};
        status = bench_run_grouped(b, contenders, brief ? 3 : COUNT_OF(contenders), data->count, &bins);
        if (status == OK)
            status = draw_pictures(b, &full, &paper_viewer, &mesh);
    }
    renderer_close(&own);
    renderer_close(&true_joints);
    renderer_close(&paper);
    free(rgb);
    free(rgba);
    free(alpha);
    return status;
}

static enum status run(struct bench *b)
{
    static struct views_data data;
    struct gpu *gpu = NULL;
    enum status status = views_data_open(&data, bench_inputs(b)->data, bench_inputs(b)->brief);
    if (status == OK)
        status = gpu_open(&gpu);
    if (status == OK)
        status = run_viewers(b, &data, gpu);
    if (status == OK && bench_inputs(b)->brief)
        status = bench_study_measure(&data);
    gpu_close(&gpu);
    views_data_close(&data);
    return status;
}

const struct bench_stage bench_stage_views = {
    .name = "views",
    .about = "synthesised images of the person from all round",
    .error_name = "outline_pct",
    .time_name = "draw_ms",
    .extra_names = {"psnr_db", "inside_db", "missing_pct", "extra_pct"},
    .run = run,
};
