// Stage "avatar": the outline's error all round against the time until the first image can be drawn, by the number of
// frames that the avatar is made of. Next to it what needs no preparation: the nearest frame's depth as a mesh.
#include "reenact/avatar/avatar.h"
#include "reenact/render/actor_renderer.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_views_data.h"
#include "tests/bench/bench_views_mesh.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { UPLOADS_MOST = 1000 };

struct contender {
    const struct views_data *data;
    const struct setting *setting;
    struct renderer *renderer; // NULL: the mesh
    uint8_t *rgb, *rgba, *alpha;
    double ready_ms;
};

static const struct setting {
    const char *name;
    int frames;   // that the avatar is made of; 0: none is made
    bool simple;  // as drawn until the avatar is there
    bool is_mesh; // the depth of one frame
} settings[] = {
    {"120 frames", AVATAR_FRAMES, false, false},
    {"60 frames", 60, false, false},
    {"30 frames", 30, false, false},
    {"15 frames", 15, false, false},
    {"simple body", AVATAR_FRAMES, true, false},
    {"cylinders", 0, false, false},
    {"one frame's depth", 0, false, true},
};
enum { SETTINGS = COUNT_OF(settings) };

static enum status draw(struct contender *c, const struct views_image *p)
{
    const struct take *take = c->data->own;
    if (!c->renderer) {
        memcpy(c->rgb, p->room, 3 * (size_t)c->data->lens.width * (size_t)c->data->lens.height);
        return views_mesh_draw(c->data->own, views_nearest_frame(take, p->since_ns), &c->data->lens, p->found, c->rgb,
                               c->alpha);
    }
    const struct renderer_view view = {.world_from_camera = p->found, .time_ns = p->since_ns, .color = p->room};
    struct renderer_result result;
    enum status status = OK;
    int images = 0;
    do // an avatar is uploaded in steps
        status = renderer_draw(c->renderer, &view, &result);
    while (status == OK && !renderer_upload_done(c->renderer) && ++images < UPLOADS_MOST);
    return status == OK ? renderer_read(c->renderer, c->rgb) : status;
}

static enum status prepare(struct contender *c)
{
    struct avatar avatar = {0};
    struct source_rays *rays = NULL;
    enum status status = OK;
    if (c->setting->frames) {
        const struct avatar_options options = {
            .max_frames = c->setting->frames, .simple = c->setting->simple, .threads = 2};
        status = source_rays_open(&rays, take_calibration(c->data->own));
        if (status == OK)
            status = avatar_make(&avatar, c->data->own, rays, &options);
    }
    if (status == OK)
        status = renderer_set_avatar(c->renderer, c->setting->frames ? &avatar : NULL);
    avatar_free(&avatar);
    source_rays_close(&rays);
    return status;
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct contender *c = self;
    const struct views_image *p = &c->data->image[item];
    const double from_ms = bench_all_threads_ms();
    enum status status = item == 0 && c->renderer ? prepare(c) : OK; // a new round
    if (status == OK && p->placed)
        status = draw(c, p);
    if (item == 0)
        c->ready_ms = bench_all_threads_ms() - from_ms;
    out->time_ms = c->ready_ms;
    if (status != OK || !p->placed)
        return status == OK ? NOTHING : status;
    if (c->renderer) {
        status = renderer_read_actor(c->renderer, c->rgba);
        for (int i = 0; i < c->data->lens.width * c->data->lens.height; i++)
            c->alpha[i] = c->rgba[4 * i + 3];
    }
    if (status == OK)
        views_judge(c->data, p, c->rgb, c->alpha, out);
    return status;
}

// The image half-way by three of the settings.
static enum status draw_pictures(struct bench *b, struct contender *c)
{
    static const int shown[] = {0, 3, SETTINGS - 1};
    const int item = c->data->count / 2;
    enum status status = OK;
    for (size_t i = 0; i < COUNT_OF(shown) && status == OK; i++) {
        struct contender *by = &c[shown[i]];
        struct bench_measure measured = {0};
        char caption[100];
        status = measure(by, item, &measured);
        snprintf(caption, sizeof caption, "%s: outline %.1f %%, %.1f dB", by->setting->name, measured.error,
                 measured.extra[0]);
        if (status == OK)
            bench_picture(b, caption, by->rgb, c->data->lens.width, c->data->lens.height);
    }
    return status == NOTHING ? OK : status;
}

static enum status run_settings(struct bench *b, const struct views_data *data, struct gpu *gpu)
{
    struct contender c[SETTINGS] = {{0}};
    struct bench_contender contenders[SETTINGS];
    struct renderer_options options = renderer_default_options();
    const size_t pixels = (size_t)data->lens.width * (size_t)data->lens.height;
    uint8_t *rgb = malloc(3 * pixels), *rgba = malloc(4 * pixels), *alpha = malloc(pixels);
    enum status status = rgb && rgba && alpha ? OK : fail(ERR_MEMORY, "no memory for an image");
    options.avatar_later = true;
    for (int i = 0; i < SETTINGS; i++) {
        c[i] = (struct contender){data, &settings[i], NULL, rgb, rgba, alpha, 0};
        contenders[i] = (struct bench_contender){settings[i].name, measure, &c[i], settings[i].is_mesh};
        if (status == OK && !settings[i].is_mesh)
            status = renderer_open(&c[i].renderer, gpu, data->own, &data->lens, &options);
    }
    if (status == OK)
        status = bench_run(b, contenders, SETTINGS, data->count);
    if (status == OK)
        status = draw_pictures(b, c);
    for (int i = 0; i < SETTINGS; i++)
        renderer_close(&c[i].renderer);
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
        status = run_settings(b, &data, gpu);
    gpu_close(&gpu);
    views_data_close(&data);
    return status;
}

const struct bench_stage bench_stage_avatar = {
    .name = "avatar",
    .about = "the actor's shape from all frames of a take",
    .error_name = "outline_pct",
    .time_name = "ready_ms",
    .extra_names = {"psnr_db", "inside_db", "missing_pct", "extra_pct"},
    .run = run,
};
