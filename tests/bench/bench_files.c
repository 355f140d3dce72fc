// Stages "color", "record" and "open": colour coding, writing frames, and opening a file up to the first picture.
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "recording/recording.h"
#include "reenact/render/actor_renderer.h"
#include "tests/bench/bench.h"
#include "tests/support/rehearsed.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ------------------------------------------------------------- colour coding

struct color_contender {
    struct take *take;
    int quality; // 0: PNG, level 6
};

static enum status measure_color(void *self, int item, struct bench_measure *out)
{
    struct color_contender *c = self;
    const struct lens *lens = &take_calibration(c->take)->color;
    const size_t count = (size_t)lens->width * (size_t)lens->height * 3;
    struct take_images images;
    uint8_t *bytes = NULL, *back = malloc(count);
    size_t coded = 0;
    enum status status = back ? take_read(c->take, item, TAKE_COLOR, &images) : fail(ERR_MEMORY, "no memory");
    if (status == OK) {
        const double from_ms = bench_clock_ms();
        const struct png_layout layout = {PNG_RGB8, lens->width, lens->height};
        status = c->quality ? jpeg_encode(images.color, lens->width, lens->height, c->quality, &bytes, &coded)
                            : png_encode(&layout, images.color, 6, &bytes, &coded);
        out->time_ms = bench_clock_ms() - from_ms;
    }
    double squares = 0;
    if (status == OK && c->quality)
        status = jpeg_decode(bytes, coded, back, lens->width, lens->height);
    for (size_t i = 0; status == OK && c->quality && i < count; i++)
        squares += ((double)back[i] - images.color[i]) * ((double)back[i] - images.color[i]);
    out->error = 24.0 * (double)coded / (double)count;
    out->extra[0] = squares > 0 ? 10 * log10(65025 * (double)count / squares) : 99;
    free(bytes);
    free(back);
    return status;
}

// About the person's neck in the first frame, magnified.
static enum status draw_part(struct bench *b, const struct color_contender *c, const char *name)
{
    enum { PART_WIDTH = 80, PART_HEIGHT = 60, TIMES = 4, WIDTH = PART_WIDTH * TIMES, HEIGHT = PART_HEIGHT * TIMES };
    static uint8_t part[3 * WIDTH * HEIGHT];
    const struct lens *lens = &take_calibration(c->take)->color;
    const size_t count = (size_t)lens->width * (size_t)lens->height * 3;
    const struct pixel at = lens_project(lens, take_entry(c->take, 0)->skeleton.joint[JOINT_NECK]);
    const int left = (int)fmin(fmax(at.x - PART_WIDTH / 2, 0), lens->width - PART_WIDTH),
              top = (int)fmin(fmax(at.y - PART_HEIGHT / 2, 0), lens->height - PART_HEIGHT);
    struct take_images images;
    uint8_t *bytes = NULL, *back = malloc(count);
    size_t coded = 0;
    char caption[100];
    enum status status = back ? take_read(c->take, 0, TAKE_COLOR, &images) : fail(ERR_MEMORY, "no memory");
    if (status == OK)
        memcpy(back, images.color, count);
    if (status == OK && c->quality)
        status = jpeg_encode(images.color, lens->width, lens->height, c->quality, &bytes, &coded);
    if (status == OK && c->quality)
        status = jpeg_decode(bytes, coded, back, lens->width, lens->height);
    for (int y = 0; y < HEIGHT && status == OK; y++)
        for (int x = 0; x < WIDTH; x++) {
            const int from = 3 * ((top + y / TIMES) * lens->width + left + x / TIMES);
            memcpy(part + 3 * (y * WIDTH + x), back + from, 3);
        }
    snprintf(caption, sizeof caption, "%s, %d times magnified", name, TIMES);
    if (status == OK)
        bench_picture(b, caption, part, WIDTH, HEIGHT);
    free(bytes);
    free(back);
    return status;
}

static enum status run_color(struct bench *b)
{
    static const int qualities[] = {60, 75, 85, 92, 97, 0};
    static const char *const names[] = {"JPEG, quality 60", "JPEG, quality 75", "JPEG, quality 85",
                                        "JPEG, quality 92", "JPEG, quality 97", "PNG, level 6"};
    enum { CONTENDERS = COUNT_OF(qualities) };
    struct color_contender all[CONTENDERS];
    struct bench_contender contenders[CONTENDERS];
    struct rehearsed rehearsed;
    enum status status = rehearsed_open(&rehearsed, 0);
    for (int i = 0; i < CONTENDERS; i++) {
        all[i] = (struct color_contender){rehearsed.take, qualities[i]};
        contenders[i] = (struct bench_contender){names[i], measure_color, &all[i], !qualities[i]};
    }
    if (status == OK)
        status = bench_run(b, contenders, CONTENDERS, (int)take_frame_count(rehearsed.take));
    static const int shown[] = {0, 2, 3, CONTENDERS - 1};
    for (size_t i = 0; i < COUNT_OF(shown) && status == OK; i++)
        status = draw_part(b, &all[shown[i]], names[shown[i]]);
    rehearsed_close(&rehearsed);
    return status;
}

const struct bench_stage bench_stage_color = {.name = "color",
                                              .about = "coding of colour images",
                                              .error_name = "bits_per_pixel",
                                              .time_name = "encode_ms",
                                              .extra_names = {"psnr_db"},
                                              .run = run_color};

// ------------------------------------------------------------- writing

enum { BATCH = 10 };

struct record_contender {
    const struct scratch *scratch;
    const struct calibration *calibration;
    uint8_t *jpeg;
    size_t jpeg_bytes;
    uint16_t *depth;
    bool folder;
    int written;
};

static enum status write_folder(struct record_contender *c, double *bytes)
{
    enum status status = OK;
    *bytes = 0;
    for (int i = 0; i < BATCH && status == OK; i++) {
        char name[64];
        uint8_t *png;
        size_t count;
        const struct png_layout layout = {PNG_GRAY16, c->calibration->depth.width, c->calibration->depth.height};
        snprintf(name, sizeof name, "frames/%d.jpg", i);
        scratch_write(c->scratch, name, c->jpeg, c->jpeg_bytes);
        status = png_encode(&layout, c->depth, 6, &png, &count);
        snprintf(name, sizeof name, "frames/%d.png", i);
        if (status == OK)
            scratch_write(c->scratch, name, png, count);
        *bytes += status == OK ? (double)(count + c->jpeg_bytes) : 0;
        if (status == OK)
            free(png);
    }
    return status;
}

static enum status write_recording(struct record_contender *c, double *bytes)
{
    char path[300];
    struct recording_writer *w = NULL;
    struct recording_report report = {0};
    snprintf(path, sizeof path, "%s", scratch_file(c->scratch, "bench.reenact"));
    unlink(path);
    enum status status = recording_create(&w, path);
    if (status == OK)
        status = recording_begin_take(w, "a", c->calibration);
    for (int i = 0; i < BATCH && status == OK; i++) {
        const struct take_frame f = {.time_ns = i * INT64_C(33333333),
                                     .world_from_camera = POSE_IDENTITY,
                                     .jpeg = c->jpeg,
                                     .jpeg_bytes = c->jpeg_bytes,
                                     .depth = c->depth};
        status = recording_add_frame(w, &f);
    }
    if (status == OK)
        status = recording_end_take(w);
    const enum status closed = recording_close(&w);
    FILE *file = fopen(path, "r");
    if (file && !fseek(file, 0, SEEK_END))
        report.bytes = ftell(file);
    if (file)
        fclose(file);
    *bytes = (double)report.bytes;
    return status == OK ? closed : status;
}

static enum status measure_record(void *self, int item, struct bench_measure *out)
{
    struct record_contender *c = self;
    double bytes = 0;
    (void)item;
    const double from_ms = bench_all_threads_ms();
    const enum status status = c->folder ? write_folder(c, &bytes) : write_recording(c, &bytes);
    out->time_ms = (bench_all_threads_ms() - from_ms) / BATCH;
    out->error = bytes / BATCH * 1e-3;
    return status;
}

static enum status run_record(struct bench *b)
{
    struct rehearsed rehearsed;
    struct scratch scratch = scratch_make();
    struct record_contender ours = {.scratch = &scratch}, folder;
    struct take_images images;
    enum status status = rehearsed_open(&rehearsed, 0);
    if (status == OK)
        status = take_read(rehearsed.take, 0, TAKE_COLOR | TAKE_DEPTH, &images);
    if (status == OK) {
        const struct lens *lens = &take_calibration(rehearsed.take)->color;
        const struct lens *depth = &take_calibration(rehearsed.take)->depth;
        const size_t bytes = (size_t)depth->width * (size_t)depth->height * sizeof *ours.depth;
        ours.calibration = take_calibration(rehearsed.take);
        status = jpeg_encode(images.color, lens->width, lens->height, 90, &ours.jpeg, &ours.jpeg_bytes);
        ours.depth = malloc(bytes);
        if (status == OK && ours.depth)
            memcpy(ours.depth, images.depth, bytes);
    }
    folder = ours;
    folder.folder = true;
    const struct bench_contender contenders[] = {{"one file", measure_record, &ours, false},
                                                 {"a folder of images", measure_record, &folder, true}};
    if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), 4);
    free(ours.jpeg);
    free(ours.depth);
    rehearsed_close(&rehearsed);
    scratch_remove(&scratch);
    return status;
}

const struct bench_stage bench_stage_record = {.name = "record",
                                               .about = "writing a frame: depth, colour that the camera has coded",
                                               .error_name = "kilobytes",
                                               .time_name = "time_ms",
                                               .run = run_record};

// ------------------------------------------------------------- opening

enum open_way { OPEN_CYLINDERS, OPEN_AVATAR, OPEN_VIDEO };

struct open_contender {
    const char *file;
    struct gpu *gpu;
    enum open_way way;
    uint8_t *picture; // the first one, RGB
    struct lens lens; // of it
};

// Wrong pixels of the actor from the sensor's own side, of those that either mask or picture has.
static double wrong_percent(const uint8_t *rgba, const uint8_t *mask, size_t pixels)
{
    int both = 0, either = 0;
    for (size_t i = 0; i < pixels; i++) {
        const bool drawn = rgba[4 * i + 3] >= 128, is = mask[i] != 0;
        both += drawn && is;
        either += drawn || is;
    }
    return either ? 100.0 * (either - both) / either : 0;
}

// The actor over a plain background.
static void keep_picture(struct open_contender *c, const uint8_t *rgba)
{
    const size_t pixels = (size_t)c->lens.width * (size_t)c->lens.height;
    for (size_t i = 0; i < pixels && c->picture; i++)
        for (size_t k = 0; k < 3; k++)
            c->picture[3 * i + k] = rgba[4 * i + 3] >= 128 ? rgba[4 * i + k] : 60;
}

static enum status draw_first(struct open_contender *c, struct take *take, double *wrong)
{
    const struct lens *lens = &take_calibration(take)->color;
    const size_t pixels = (size_t)lens->width * (size_t)lens->height;
    struct renderer_options options = renderer_default_options();
    struct renderer *renderer = NULL;
    struct renderer_result result;
    struct take_images images;
    options.avatar_later = c->way == OPEN_CYLINDERS;
    enum status status = renderer_open(&renderer, c->gpu, take, lens, &options);
    if (status == OK && options.avatar_later)
        status = renderer_set_avatar(renderer, NULL);
    const struct renderer_view view = {.world_from_camera = take_entry(take, 0)->world_from_camera};
    if (status == OK)
        status = renderer_draw(renderer, &view, &result);
    uint8_t *rgba = malloc(4 * pixels);
    if (status == OK)
        status = rgba ? renderer_read_actor(renderer, rgba) : fail(ERR_MEMORY, "no memory for an image");
    if (status == OK)
        keep_picture(c, rgba);
    if (status == OK)
        status = take_read(take, 0, TAKE_MASK, &images);
    *wrong = status == OK && images.mask ? wrong_percent(rgba, images.mask, pixels) : NAN;
    free(rgba);
    renderer_close(&renderer);
    return status;
}

static enum status measure_open(void *self, int item, struct bench_measure *out)
{
    struct open_contender *c = self;
    struct recording *r = NULL;
    struct take *take = NULL;
    struct take_images images;
    (void)item;
    const double from_ms = bench_all_threads_ms();
    enum status status = recording_open(&r, c->file);
    if (status == OK)
        status = take_open(&take, r, recording_take_name(r, 0));
    if (status == OK && c->way == OPEN_VIDEO) {
        status = take_read(take, 0, TAKE_COLOR, &images);
        if (status == OK && c->picture)
            memcpy(c->picture, images.color, 3 * (size_t)c->lens.width * (size_t)c->lens.height);
    } else if (status == OK) {
        status = draw_first(c, take, &out->error);
    }
    out->time_ms = bench_all_threads_ms() - from_ms;
    take_close(&take);
    recording_free(&r);
    return status;
}

static enum status run_open(struct bench *b)
{
    struct rehearsed rehearsed;
    struct gpu *gpu = NULL;
    enum status status = rehearsed_open(&rehearsed, 0);
    if (status == OK)
        status = gpu_open(&gpu);
    static const char *const names[] = {
        [OPEN_CYLINDERS] = "cylinders first", [OPEN_AVATAR] = "with the avatar", [OPEN_VIDEO] = "plain video"};
    enum { WAYS = COUNT_OF(names) };
    struct open_contender all[WAYS] = {{0}};
    struct bench_contender contenders[WAYS];
    for (int i = 0; i < WAYS && status == OK; i++) {
        const struct lens *lens = &take_calibration(rehearsed.take)->color;
        all[i] = (struct open_contender){rehearsed.rehearsal.file, gpu, (enum open_way)i,
                                         malloc(3 * (size_t)lens->width * (size_t)lens->height), *lens};
        contenders[i] = (struct bench_contender){names[i], measure_open, &all[i], i == OPEN_VIDEO};
        if (!all[i].picture)
            status = fail(ERR_MEMORY, "no memory for an image");
    }
    if (status == OK)
        status = bench_run(b, contenders, WAYS, 2);
    for (int i = 0; i < WAYS; i++) {
        if (status == OK)
            bench_picture(b, names[i], all[i].picture, all[i].lens.width, all[i].lens.height);
        free(all[i].picture);
    }
    gpu_close(&gpu);
    rehearsed_close(&rehearsed);
    return status;
}

const struct bench_stage bench_stage_open = {.name = "open",
                                             .about = "opening a file of 8 frames up to the first picture, from the "
                                                      "sensor's own side",
                                             .error_name = "wrong_percent",
                                             .time_name = "time_ms",
                                             .run = run_open};
