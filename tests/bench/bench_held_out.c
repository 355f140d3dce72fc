// Stage "left-out": every fifth frame of a take is left out, and its image is synthesised from the others for the
// sensor's own camera at that instant, with the pose interpolated between the neighbouring frames. The error is the
// difference from what the sensor recorded. For takes without a place and without another camera; truth/mask/ gives the
// actor's mask, which is evaluated only where the sensor measured depth: elsewhere it is unknown.
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "reenact/render/actor_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_record.h"
#include "tests/support/film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { EVERY = 5, FIRST = 2, MOST = 400, FILMED = 120 };
static const uint8_t NOT_DRAWN = 128; // grey, where nothing is drawn
static const uint8_t UNKNOWN = 128;

struct held_out_image {
    char name[64]; // 0007
    int64_t time_ns;
};

struct left_out {
    char folder[4096];
    struct scratch scratch;
    struct recording *recording;
    struct take *take;
    struct lens lens;
    struct held_out_image image[MOST];
    int count;
};

struct held_out_viewer {
    const struct left_out *data;
    struct renderer *renderer;
    struct skeleton_track *motion;
    uint8_t *room, *drawn, *rgba, *expected;
};

// The list of one kind of images, rgb.txt or depth.txt, without every fifth; names (may be NULL) receives those left
// out.
static enum status thin_out(const struct left_out *data, const char *list, struct left_out *names)
{
    char path[8192], line[512], file[256];
    snprintf(path, sizeof path, "%s/%s", data->folder, list);
    FILE *from = fopen(path, "r"), *to = fopen(scratch_file(&data->scratch, list), "w");
    enum status status = from && to ? OK : fail(ERR_MISSING, "%s cannot be read", path);
    double seconds;
    for (int i = 0; status == OK && fgets(line, sizeof line, from);) {
        if (sscanf(line, "%lf %255s", &seconds, file) != 2)
            continue;
        bool out = i++ % EVERY == FIRST;
        if (!out)
            fputs(line, to);
        if (!out || !names || names->count == MOST)
            continue;
        struct held_out_image *p = &names->image[names->count++];
        const char *base = strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
        snprintf(p->name, sizeof p->name, "%.*s", (int)strcspn(base, "."), base);
        p->time_ns = (int64_t)llround(seconds * 1e9);
    }
    if (from)
        fclose(from);
    if (to)
        fclose(to);
    return status;
}

static enum status link_to(const struct left_out *data, const char *name)
{
    char path[8192];
    char *whole = realpath(data->folder, NULL);
    snprintf(path, sizeof path, "%s/%s", whole ? whole : data->folder, name);
    free(whole);
    return symlink(path, scratch_file(&data->scratch, name)) ? fail(ERR_IO, "%s cannot be linked to", path) : OK;
}

static enum status record(struct left_out *data)
{
    static const char *const links[] = {"rgb", "depth", "calibration.json"};
    char uri[300], file[300];
    enum status status = thin_out(data, "rgb.txt", data);
    if (status == OK)
        status = thin_out(data, "depth.txt", NULL);
    for (size_t i = 0; i < COUNT_OF(links) && status == OK; i++)
        status = link_to(data, links[i]);
    snprintf(uri, sizeof uri, "folder:%s", data->scratch.path);
    snprintf(file, sizeof file, "%s", scratch_file(&data->scratch, "left_out.reenact"));
    if (status == OK)
        status = bench_record(uri, file);
    if (status == OK)
        status = recording_open(&data->recording, file);
    if (status == OK)
        status = take_open(&data->take, data->recording, "take");
    if (status == OK)
        data->lens = take_calibration(data->take)->color;
    return status;
}

// *mask: 255 the actor, 0 not, 128 unknown.
static enum status read_expected(const struct left_out *data, const char *name, uint8_t *rgb, uint8_t **mask)
{
    char path[8192];
    uint8_t *bytes = NULL;
    size_t count;
    void *pixels = NULL, *depth = NULL;
    int width, height, depth_width = 0, depth_height = 0;
    snprintf(path, sizeof path, "%s/rgb/%s.jpg", data->folder, name);
    enum status status = file_read(path, &bytes, &count);
    if (status == OK)
        status = jpeg_decode(bytes, count, rgb, data->lens.width, data->lens.height);
    free(bytes);
    snprintf(path, sizeof path, "%s/truth/mask/%s.png", data->folder, name);
    if (status == OK)
        status = png_read(path, PNG_GRAY8, &pixels, &width, &height);
    *mask = pixels;
    if (status == OK && (width != data->lens.width || height != data->lens.height))
        status = fail(ERR_INPUT, "%s is not of the images' size", path);
    snprintf(path, sizeof path, "%s/depth/%s.png", data->folder, name);
    if (status == OK)
        status = png_read(path, PNG_GRAY16, &depth, &depth_width, &depth_height);
    if (status == OK && (width != depth_width || height != depth_height))
        status = fail(ERR_INPUT, "%s is not of the images' size", path);
    for (int i = 0; status == OK && i < width * height; i++)
        (*mask)[i] = !((uint16_t *)depth)[i] ? UNKNOWN : (*mask)[i] > 127 ? 255 : 0;
    free(depth);
    return status;
}

static void judge(const struct held_out_viewer *v, const uint8_t *mask, struct bench_measure *out)
{
    double both = 0, missing = 0, extra = 0, squares = 0, inside = 0;
    for (int i = 0; i < v->data->lens.width * v->data->lens.height; i++) {
        bool there = mask[i] == 255, drawn = v->rgba[4 * i + 3] >= 128;
        if (mask[i] == UNKNOWN)
            continue;
        double off = 0;
        for (int c = 0; c < 3; c++) {
            double d = (double)v->drawn[3 * i + c] - (double)v->expected[3 * i + c];
            off += d * d / 3;
        }
        squares += there ? off : 0;
        inside += there && drawn ? off : 0;
        both += there && drawn;
        missing += there && !drawn;
        extra += drawn && !there;
    }
    out->error = 100 * (missing + extra) / (both + missing + extra);
    out->extra[0] = 10 * log10(65025 * (both + missing) / fmax(squares, 1e-6));
    out->extra[1] = 10 * log10(65025 * both / fmax(inside, 1e-6));
    out->extra[2] = 100 * missing / (both + missing + extra);
    out->extra[3] = 100 * extra / (both + missing + extra);
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct held_out_viewer *v = self;
    const struct held_out_image *p = &v->data->image[item];
    uint8_t *mask = NULL;
    struct renderer_view view = {.time_ns = p->time_ns - take_entry(v->data->take, 0)->time_ns, .color = v->room};
    struct renderer_result result;
    struct track_sample moment;
    enum status status = skeleton_track_at(v->motion, view.time_ns, false, &moment);
    view.world_from_camera = moment.world_from_camera;
    double started_ms = bench_clock_ms();
    if (status == OK)
        status = renderer_draw(v->renderer, &view, &result);
    if (status == OK)
        status = renderer_read(v->renderer, v->drawn);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK)
        status = renderer_read_actor(v->renderer, v->rgba);
    if (status == OK)
        status = read_expected(v->data, p->name, v->expected, &mask);
    if (status == OK)
        judge(v, mask, out);
    free(mask);
    return status;
}

static enum status draw_all(struct bench *b, const struct left_out *data, struct gpu *gpu)
{
    struct renderer *full = NULL, *paper = NULL;
    struct take_skeletons *skeletons = NULL;
    struct skeleton_track *motion = NULL;
    struct renderer_options options = renderer_default_options();
    size_t pixels = (size_t)data->lens.width * (size_t)data->lens.height;
    uint8_t *bytes = malloc(13 * pixels);
    enum status status = bytes ? OK : fail(ERR_MEMORY, "no memory for an image");
    options.shadow = false;
    if (status == OK)
        status = take_skeletons_open(&skeletons, data->take);
    if (status == OK)
        status = skeleton_track_open(&motion, data->take, skeletons);
    if (status == OK)
        status = renderer_open(&full, gpu, data->take, &data->lens, &options);
    options.detail = DETAIL_PAPER;
    if (status == OK)
        status = renderer_open(&paper, gpu, data->take, &data->lens, &options);
    if (status == OK) {
        memset(bytes, NOT_DRAWN, 3 * pixels);
        struct held_out_viewer ours = {
            data, full, motion, bytes, bytes + 3 * pixels, bytes + 6 * pixels, bytes + 10 * pixels};
        struct held_out_viewer paper_viewer = ours;
        paper_viewer.renderer = paper;
        const struct bench_contender contenders[] = {{"full", measure, &ours, false},
                                                     {"paper", measure, &paper_viewer, true}};
        status = bench_run(b, contenders, COUNT_OF(contenders), data->count);
    }
    skeleton_track_close(&motion);
    take_skeletons_close(&skeletons);
    renderer_close(&full);
    renderer_close(&paper);
    free(bytes);
    return status;
}

// The small world's dancer as the sensor sees it, and its masks in truth/.
static enum status film(struct left_out *data)
{
    struct world_options options = world_default_options();
    struct world *world;
    struct lens lens = world_calibration(1).color;
    uint8_t *mask = malloc((size_t)lens.width * (size_t)lens.height);
    enum status status = mask ? world_open(&world, &options) : fail(ERR_MEMORY, "no memory for an image");
    if (status != OK) {
        free(mask);
        return status;
    }
    film_sensor(world, &data->scratch, "sensor", 1, 0, FILMED);
    snprintf(data->folder, sizeof data->folder, "%s/sensor", data->scratch.path);
    scratch_text(&data->scratch, "sensor/truth/mask/readme", "where the person is");
    for (int i = FIRST; i < FILMED && status == OK; i += EVERY) {
        char name[64];
        struct world_shot shot = {lens, world_sensor_pose(world), i / 30.0, true};
        snprintf(name, sizeof name, "sensor/truth/mask/%04d.png", i);
        status = world_render(world, &shot, &(struct world_image){.mask = mask});
        for (int k = 0; k < lens.width * lens.height; k++)
            mask[k] = mask[k] ? 255 : 0;
        if (status == OK)
            status = png_write(scratch_file(&data->scratch, name), PNG_GRAY8, mask, lens.width, lens.height);
    }
    free(mask);
    world_close(&world);
    return status;
}

static enum status run(struct bench *b)
{
    static struct left_out data;
    struct gpu *gpu = NULL;
    enum status status = OK;
    data = (struct left_out){.scratch = scratch_make()};
    if (bench_inputs(b)->data)
        snprintf(data.folder, sizeof data.folder, "%s", bench_inputs(b)->data);
    else
        status = film(&data);
    if (status == OK)
        status = record(&data);
    if (status == OK)
        status = gpu_open(&gpu);
    if (status == OK)
        status = draw_all(b, &data, gpu);
    gpu_close(&gpu);
    take_close(&data.take);
    recording_free(&data.recording);
    scratch_remove(&data.scratch);
    return status;
}

const struct bench_stage bench_stage_held_out = {
    "left-out", "left-out frames of a take, synthesised from the others", "outline_pct",
    "draw_ms",  {"psnr_db", "inside_db", "missing_pct", "extra_pct"},     run};
