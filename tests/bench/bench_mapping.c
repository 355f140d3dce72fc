// Stage "mapping": the place's tags from a sweep of the small world with a sensor: the error of their corners, and the
// time of the whole sweep, by the number of images and by what is used of them. Next to it what one would do with
// libapriltag: chain its own tag poses from image to image.
#include "capture/mapping/mapper.h"
#include "locate/tag_corners.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_tags_peers.h"
#include "tests/support/align.h"
#include "tests/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SWEEP = 40, SWEEPS = 4, MOST_TAGS = 32 };

// Noise is all that one sweep (item) differs in from another.
struct sweep {
    struct world *world;
    struct calibration sensor;
    const struct place_tag *tags; // the truth
    int32_t tag_count;
    uint8_t *color[SWEEP], *noisy_color[SWEEP];
    uint16_t *depth[SWEEP], *noisy_depth[SWEEP];
    uint8_t *gray; // of one image
    int noisy;     // the item that the noise is of; -1: none yet
};

static size_t pixels_of(const struct sweep *s)
{
    return (size_t)s->sensor.color.width * (size_t)s->sensor.color.height;
}

static double time_of(int image) { return (double)WORLD_SWEEP_S * image / SWEEP; }

static enum status film(struct sweep *s)
{
    const struct world_options options = world_default_options();
    enum status status = world_open(&s->world, &options);
    if (status != OK)
        return status;
    s->sensor = world_calibration(1);
    s->tags = world_tags(s->world, &s->tag_count);
    const size_t pixels = pixels_of(s);
    s->noisy = -1;
    s->gray = malloc(pixels);
    if (!s->gray)
        status = fail(ERR_MEMORY, "no memory for an image");
    for (int i = 0; i < SWEEP && status == OK; i++) {
        const struct world_shot shot = {s->sensor.color, world_sweep_pose(s->world, time_of(i)), 0, false};
        s->color[i] = malloc(3 * pixels);
        s->depth[i] = malloc(pixels * sizeof *s->depth[i]);
        s->noisy_color[i] = malloc(3 * pixels);
        s->noisy_depth[i] = malloc(pixels * sizeof *s->noisy_depth[i]);
        status = s->color[i] && s->depth[i] && s->noisy_color[i] && s->noisy_depth[i]
                     ? world_render(s->world, &shot, &(struct world_image){.color = s->color[i], .depth = s->depth[i]})
                     : fail(ERR_MEMORY, "no memory for the sweep");
    }
    return status;
}

static void close_sweep(struct sweep *s)
{
    for (int i = 0; i < SWEEP; i++) {
        free(s->color[i]);
        free(s->depth[i]);
        free(s->noisy_color[i]);
        free(s->noisy_depth[i]);
    }
    free(s->gray);
    world_close(&s->world);
}

// The sweep as the sensor gives it.
static enum status add_noise(struct sweep *s, int item)
{
    const struct lens *lens = &s->sensor.color;
    enum status status = OK;
    for (int i = 0; i < SWEEP && s->noisy != item && status == OK; i++) {
        const uint64_t seed = (uint64_t)(item * SWEEP + i);
        memcpy(s->noisy_color[i], s->color[i], 3 * pixels_of(s));
        world_color_noise(s->noisy_color[i], lens->width, lens->height, seed);
        status = world_depth_noise(lens, s->depth[i], seed, s->noisy_depth[i]);
    }
    s->noisy = status == OK ? item : -1;
    return status;
}

static struct frame frame_of(const struct sweep *s, int image)
{
    return (struct frame){
        .time_ns = (int64_t)(time_of(image) * 1e9), .color = s->noisy_color[image], .depth = s->noisy_depth[image]};
}

// Error: the corners' rms after a rigid alignment with the truth, mm.
static enum status judge(const struct sweep *s, const struct place *place, struct bench_measure *out)
{
    struct pose truth_from_place;
    double worst = 0;
    const double rms = align_tags(place, s->tags, s->tag_count, &truth_from_place);
    for (int32_t i = 0; i < place->tag_count; i++)
        for (int32_t k = 0; k < s->tag_count; k++)
            if (s->tags[k].id == place->tags[i].id)
                worst = fmax(worst, v3_distance(pose_apply(truth_from_place, place->tags[i].world_from_tag.translation),
                                                s->tags[k].world_from_tag.translation));
    out->error = 1e3 * rms;
    out->extra[0] = 1e3 * worst;
    out->extra[1] = place->tag_count;
    return isfinite(rms) ? OK : NOTHING;
}

// ---------------------------------------------------------------- the contenders

static const struct setting {
    const char *name;
    int step; // every so manieth image of the sweep
    bool depth, landmarks;
} settings[] = {
    {"ours, 40 images", 1, true, true},           {"ours, 20 images", 2, true, true},
    {"ours, 10 images", 4, true, true},           {"tags and depth alone", 1, true, false},
    {"tags and landmarks alone", 1, false, true}, {"tags alone", 1, false, false},
};
enum { SETTINGS = COUNT_OF(settings) };

struct contender {
    struct sweep *sweep;
    const struct setting *setting; // NULL: libapriltag
    struct apriltag_peer *peer;
};

static enum status measure_ours(void *self, int item, struct bench_measure *out)
{
    const struct contender *c = self;
    struct sweep *s = c->sweep;
    struct calibration sensor = s->sensor;
    struct mapper_options options = mapper_default_options();
    struct mapper_tag tags[MOST_TAGS];
    struct mapper *m = NULL;
    struct mapper_report report;
    struct place place = {0};
    const int32_t count = s->tag_count < MOST_TAGS ? s->tag_count : MOST_TAGS;
    for (int32_t i = 0; i < count; i++)
        tags[i] = (struct mapper_tag){s->tags[i].id, s->tags[i].side_m};
    sensor.registered = c->setting->depth;
    if (!c->setting->landmarks)
        options.max_points = 0;
    enum status status = add_noise(s, item);
    if (status == OK)
        status = mapper_open(&m, &sensor, tags, count, &options);
    for (int i = 0; i < SWEEP && status == OK; i += c->setting->step) {
        const struct frame frame = frame_of(s, i);
        const double from_ms = bench_all_threads_ms();
        status = mapper_add(m, &frame);
        out->time_ms += bench_all_threads_ms() - from_ms;
    }
    const double from_ms = bench_all_threads_ms();
    if (status == OK)
        status = mapper_finish(m, &place, &report);
    out->time_ms += bench_all_threads_ms() - from_ms;
    if (status == OK)
        status = judge(s, &place, out);
    mapper_close(&m);
    place_free(&place);
    return status;
}

// The camera by the nearest tag that is known already; tags not known yet by the camera.
static void chain(const struct place_tag *truth, const struct apriltag_peer_tag *seen, int count, struct place *place)
{
    const struct place_tag *known = NULL;
    struct pose world_from_camera = POSE_IDENTITY;
    double nearest_m = INFINITY;
    for (int i = 0; i < count; i++)
        for (int32_t k = 0; k < place->tag_count; k++) {
            const double away_m = v3_length(seen[i].camera_from_tag.translation);
            if (place->tags[k].id != truth[seen[i].index].id || away_m >= nearest_m)
                continue;
            nearest_m = away_m;
            known = &place->tags[k];
            world_from_camera = pose_multiply(known->world_from_tag, pose_inverse(seen[i].camera_from_tag));
        }
    for (int i = 0; i < count && (known || !place->tag_count); i++) {
        bool is_known = false;
        for (int32_t k = 0; k < place->tag_count; k++)
            is_known = is_known || place->tags[k].id == truth[seen[i].index].id;
        if (is_known || place->tag_count == MOST_TAGS)
            continue;
        place->tags[place->tag_count] = truth[seen[i].index];
        place->tags[place->tag_count++].world_from_tag = pose_multiply(world_from_camera, seen[i].camera_from_tag);
    }
}

static enum status measure_peer(void *self, int item, struct bench_measure *out)
{
    const struct contender *c = self;
    struct sweep *s = c->sweep;
    struct place_tag chained[MOST_TAGS];
    struct place place = {.tags = chained};
    const enum status status = add_noise(s, item);
    for (int i = 0; i < SWEEP && status == OK; i++) {
        struct apriltag_peer_tag seen[MOST_TAGS];
        gray_from_rgb(s->noisy_color[i], pixels_of(s), s->gray);
        const double from_ms = bench_all_threads_ms();
        const struct apriltag_peer_tags of = {s->tags, s->tag_count, seen, MOST_TAGS};
        chain(s->tags, seen, apriltag_peer_find_all(c->peer, s->gray, &s->sensor.color, &of), &place);
        out->time_ms += bench_all_threads_ms() - from_ms;
    }
    return status == OK ? judge(s, &place, out) : status;
}

static enum status run(struct bench *b)
{
    static struct sweep s;
    struct contender c[SETTINGS + 1];
    struct bench_contender contenders[SETTINGS + 1];
    enum status status = film(&s);
    for (int i = 0; i <= SETTINGS; i++) {
        c[i] = (struct contender){&s, i < SETTINGS ? &settings[i] : NULL, NULL};
        contenders[i] = i < SETTINGS ? (struct bench_contender){settings[i].name, measure_ours, &c[i], false}
                                     : (struct bench_contender){"libapriltag, chained", measure_peer, &c[i], true};
    }
    if (status == OK)
        status = apriltag_peer_open(&c[SETTINGS].peer, 1);
    if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), bench_count(b, SWEEPS, 0.5));
    for (int i = 0; i < 3 && status == OK; i++)
        bench_picture(b,
                      i == 0   ? "the sweep's first image"
                      : i == 1 ? "half-way"
                               : "the last",
                      s.color[i * (SWEEP - 1) / 2], s.sensor.color.width, s.sensor.color.height);
    apriltag_peer_close(&c[SETTINGS].peer);
    close_sweep(&s);
    return status;
}

const struct bench_stage bench_stage_mapping = {
    .name = "mapping",
    .about = "a place's tags from a sweep with a depth sensor",
    .error_name = "corners_mm",
    .time_name = "sweep_ms",
    .extra_names = {"worst_mm", "tags"},
    .run = run,
};
