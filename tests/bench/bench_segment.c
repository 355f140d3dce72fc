// Stage "segment": the actor's mask in depth images of the small world, against the rendered mask.
#include "capture/segmentation/segment.h"
#include "tests/bench/bench.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 320, HEIGHT = 240, PIXELS = WIDTH * HEIGHT, FRAMES = 40 };

struct segment_film {
    struct lens lens;
    uint16_t empty[PIXELS]; // the room without the actor
    uint16_t depth[FRAMES][PIXELS];
    uint8_t truth[FRAMES][PIXELS];
};

struct segment_contender {
    const struct segment_film *film;
    bool knows_room;
    struct segmenter *segmenter; // NULL: background subtraction
    uint8_t mask[PIXELS];
};

static enum status film_room(struct segment_film *f, int frames)
{
    struct world_options options = world_default_options();
    struct world *world;
    enum status status = world_open(&world, &options);
    if (status != OK)
        return status;
    f->lens = world_calibration(0.5).depth;
    struct world_shot shot = {f->lens, world_sensor_pose(world), 0, false};
    status = world_render(world, &shot, &(struct world_image){.depth = f->empty});
    if (status == OK)
        status = world_depth_noise(&f->lens, f->empty, 999, f->empty);
    shot.actor = true;
    for (int i = 0; i < frames && status == OK; i++) {
        shot.time_s = i / 30.0;
        status = world_render(world, &shot, &(struct world_image){.depth = f->depth[i], .mask = f->truth[i]});
        if (status == OK)
            status = world_depth_noise(&f->lens, f->depth[i], (uint64_t)i + 1, f->depth[i]);
    }
    world_close(&world);
    return status;
}

// 1 - intersection over union, of pixels that have depth, percent.
static double wrong_percent(const struct segment_film *f, int item, const uint8_t *mask)
{
    int both = 0, either = 0;
    for (int i = 0; i < PIXELS; i++) {
        const bool is = mask[i] != 0, should = f->truth[item][i] && f->depth[item][i];
        both += is && should;
        either += is || should;
    }
    return either ? 100.0 * (either - both) / either : 0;
}

// All that is nearer than the empty room by more than ten centimetres and a share of its depth.
static void subtract(const struct segment_film *f, int item, uint8_t *mask)
{
    for (int i = 0; i < PIXELS; i++) {
        const int there = f->depth[item][i], before = f->empty[i];
        mask[i] = there && before && there < before - 100 - before / 50 ? 255 : 0;
    }
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct segment_contender *c = self;
    const struct segment_film *f = c->film;
    if (item == 0 && c->segmenter) {
        segmenter_reset(c->segmenter);
        segmenter_set_background(c->segmenter, c->knows_room ? f->empty : NULL);
    }
    const double from_ms = bench_clock_ms();
    enum status status = OK;
    if (c->segmenter) {
        status = segmenter_next(c->segmenter, f->depth[item], NULL, 0, c->mask);
        if (status >= 0)
            segmenter_update_background(c->segmenter);
    } else {
        subtract(f, item, c->mask);
    }
    out->time_ms = bench_clock_ms() - from_ms;
    out->error = status == OK ? wrong_percent(f, item, c->mask) : 100;
    return status;
}

static void draw_mask(struct bench *b, const char *caption, const struct segment_film *f, int item, const uint8_t *mask)
{
    static uint8_t rgb[3 * PIXELS];
    for (int i = 0; i < PIXELS; i++) {
        const int gray = f->depth[item][i] / 24 < 255 ? f->depth[item][i] / 24 : 255;
        const bool wrong = (mask[i] != 0) != (f->truth[item][i] && f->depth[item][i]);
        rgb[3 * i] = (uint8_t)(wrong ? 230 : gray / 2);
        rgb[3 * i + 1] = (uint8_t)(wrong ? 40 : mask[i] ? 180 : gray / 2);
        rgb[3 * i + 2] = (uint8_t)(wrong ? 40 : gray / 2);
    }
    bench_picture(b, caption, rgb, WIDTH, HEIGHT);
}

static enum status run(struct bench *b)
{
    struct segment_film *film = calloc(1, sizeof *film);
    struct segment_contender *all = calloc(3, sizeof *all);
    const int frames = bench_count(b, FRAMES, 0.4);
    enum status status = film && all ? film_room(film, frames) : fail(ERR_MEMORY, "no memory for images");
    for (int i = 0; i < 3 && status == OK; i++) {
        all[i].film = film;
        all[i].knows_room = i == 0;
        if (i < 2)
            status = segmenter_open(&all[i].segmenter, &film->lens);
    }
    if (status == OK) {
        const struct bench_contender contenders[] = {
            {"ours, room known", measure, &all[0], false},
            {"ours, room unknown", measure, &all[1], false},
            {"background subtraction", measure, &all[2], true},
        };
        status = bench_run(b, contenders, COUNT_OF(contenders), frames);
        for (size_t i = 0; i < COUNT_OF(contenders) && status == OK; i++)
            draw_mask(b, contenders[i].name, film, frames - 1, all[i].mask);
    }
    for (int i = 0; i < 2 && all; i++)
        segmenter_close(&all[i].segmenter);
    free(film);
    free(all);
    return status;
}

const struct bench_stage bench_stage_segment = {
    .name = "segment",
    .about = "the actor's mask in depth images of 320 x 240",
    .error_name = "wrong_percent",
    .time_name = "time_ms",
    .run = run,
};
