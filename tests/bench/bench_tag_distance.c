// Stage "tag-distance": one tag of 16 cm seen from 1, 2, 3, 4 and 5 m, 200 images each (640 x 480, f = 525, noise of 2
// grey levels, tilted by up to a radian about two axes), by us and by libapriltag at full resolution with its own pose.
// Errors are compared where both found the tag; a rotation error of more than FLIP_DEG is a flip (the mirrored
// solution). Then the same with a second tag beside it, by us alone.
#include "locate/pose_solver.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_tags_peers.h"
#include "tests/support/tag_picture.h"

#include <stdio.h>
#include <stdlib.h>

enum { POSES = 200, DISTANCES = 5, IMAGES = POSES * DISTANCES, WIDTH = 640, HEIGHT = 480, PIXELS = WIDTH * HEIGHT };
static const uint64_t SEED = 1605;
static const double SIDE_M = 0.16, ASIDE_M = 0.4, FLIP_DEG = 15, MAX_RMS_PX = 2.5;

enum { OURS, THEIRS, OURS_BY_TWO, WHO_COUNT };

struct result {
    bool found, said_ambiguous;
    double range_mm, rotation_deg;
};

struct setup {
    struct lens lens;
    struct tag_detector *finder;
    struct tag_refiner *refiner;
    struct apriltag_peer *apriltag;
    uint8_t *rgb, *gray;
    int drawn; // the image in rgb and gray: 2 * item + with the second tag; -1: none
    struct pose camera_from_tag;
    struct place_tag tags[2];
    struct tag_pattern patterns[2];
    struct result (*results)[WHO_COUNT]; // of each item
};

struct distance_contender {
    struct setup *setup;
    int who;
};

static enum status draw(struct setup *s, int item, bool two)
{
    struct rng rng = {SEED * 7919 + (uint64_t)item};
    if (s->drawn == 2 * item + two)
        return OK;
    double distance = 1 + item / POSES;
    double yaw = 2 * rng_uniform(&rng) - 1, pitch = 2 * rng_uniform(&rng) - 1;
    for (int i = 0; i < 2; i++)
        s->tags[i] = (struct place_tag){.id = (int32_t)((TAG_ID_COUNT - 1) * rng_uniform(&rng)),
                                        .side_m = SIDE_M,
                                        .world_from_tag = {POSE_IDENTITY.rotation, {i * ASIDE_M, 0, 0}}};
    if (s->tags[1].id == s->tags[0].id)
        s->tags[1].id++;
    for (int i = 0; i < 2; i++)
        if (!tag_pattern(s->tags[i].id, &s->patterns[i]))
            return fail(ERR_MEMORY, "no memory for a tag's pattern");
    struct tag_picture image = {
        .lens = s->lens,
        .tags = s->tags,
        .tag_count = two ? 2 : 1,
        .noise = 2,
        .seed = SEED + (uint64_t)item,
        .world_from_camera = tag_picture_view(distance, yaw, pitch, 6.28 * rng_uniform(&rng)),
        .rgb = s->rgb,
    };
    if (!tag_picture_draw(&image))
        return fail(ERR_INPUT, "tag %d could not be drawn", (int)s->tags[0].id);
    gray_from_rgb(s->rgb, PIXELS, s->gray);
    s->camera_from_tag = pose_inverse(image.world_from_camera);
    s->drawn = 2 * item + two;
    return OK;
}

// As the locator does for a place of these tags.
static enum status find(struct setup *s, int tag_count, struct pose *found, bool *ambiguous)
{
    struct tag_detection seen[8];
    struct tag_observation fine[2];
    struct pnp_tag tags[2];
    struct pnp_solution fit;
    int count, kept = 0;
    gray_from_rgb(s->rgb, PIXELS, s->gray);
    enum status status = tag_detector_detect(s->finder, &(struct gray_image){s->gray, WIDTH, HEIGHT}, seen, 8, &count);
    for (int i = 0; i < count && status == OK; i++)
        for (int k = 0; k < tag_count && kept < 2; k++)
            if (seen[i].id == s->tags[k].id &&
                tag_refine(s->refiner, s->rgb, seen[i].id, &s->patterns[k], seen[i].corner, &fine[kept])) {
                tags[kept] = (struct pnp_tag){
                    .seen = &fine[kept], .world_from_tag = s->tags[k].world_from_tag, .side_m = SIDE_M};
                kept++;
            }
    if (status == OK)
        status =
            kept
                ? pnp_solve(&(struct pose_problem){.tags = tags, .tag_count = kept, .fx = s->lens.fx, .fy = s->lens.fy},
                            MAX_RMS_PX, &fit)
                : NOTHING;
    if (status != OK && status != AMBIGUOUS)
        return status;
    *ambiguous = status == AMBIGUOUS;
    *found = fit.camera_from_world;
    return OK;
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct distance_contender *c = self;
    struct setup *s = c->setup;
    struct pose found = POSE_IDENTITY;
    bool ambiguous = false;
    enum status status = draw(s, item, c->who == OURS_BY_TWO);
    if (status != OK)
        return status;
    double started_ms = bench_clock_ms();
    if (c->who == THEIRS)
        status = apriltag_peer_find(s->apriltag, s->gray, &s->lens, s->tags[0].id, SIDE_M, &found);
    else
        status = find(s, c->who == OURS ? 1 : 2, &found, &ambiguous);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status != OK)
        return status;
    struct result r = {true, ambiguous, fabs(found.translation.z - s->camera_from_tag.translation.z) * 1e3,
                       pose_angle(found, s->camera_from_tag) * 57.29577951308232};
    s->results[item][c->who] = r;
    out->error = r.range_mm;
    out->extra[0] = fmin(r.rotation_deg, FLIP_DEG); // one mirrored pose must not dominate the mean
    out->extra[1] = r.rotation_deg > FLIP_DEG;
    return OK;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int count)
{
    if (!count)
        return NAN;
    qsort(values, (size_t)count, sizeof *values, ascending);
    return values[count / 2];
}

struct distance_summary {
    int found, flips, ambiguous;
    double range_mm, rotation_deg; // medians over what both found
};

static struct distance_summary sum_up(const struct setup *s, int distance, int who, int other)
{
    struct distance_summary sum = {0};
    double range[POSES], rotation[POSES];
    int both = 0;
    for (int i = distance * POSES; i < (distance + 1) * POSES; i++) {
        const struct result *r = &s->results[i][who];
        sum.found += r->found;
        sum.flips += r->found && r->rotation_deg > FLIP_DEG;
        sum.ambiguous += r->said_ambiguous;
        if (!r->found || !s->results[i][other].found)
            continue;
        range[both] = r->range_mm;
        rotation[both++] = r->rotation_deg;
    }
    sum.range_mm = median(range, both);
    sum.rotation_deg = median(rotation, both);
    return sum;
}

static void print_by_distance(const struct setup *s)
{
    printf("tag-distance: seed %llu; ours / libapriltag, medians over the images in which both found the tag\n",
           (unsigned long long)SEED);
    printf("  m        found     range mm        rotation deg    flips (ours said so)   by two tags: found flips\n");
    for (int d = 0; d < DISTANCES; d++) {
        struct distance_summary a = sum_up(s, d, OURS, THEIRS), b = sum_up(s, d, THEIRS, OURS),
                                two = sum_up(s, d, OURS_BY_TWO, OURS_BY_TWO);
        printf("  %d   %4d /%4d   %6.2f /%6.2f   %6.3f /%6.3f   %3d /%3d (%3d)           %4d %4d\n", d + 1, a.found,
               b.found, a.range_mm, b.range_mm, a.rotation_deg, b.rotation_deg, a.flips, b.flips, a.ambiguous,
               two.found, two.flips);
    }
}

static enum status run(struct bench *b)
{
    struct setup s = {.lens = tag_picture_lens(WIDTH, HEIGHT, 525),
                      .rgb = malloc((size_t)PIXELS * 3),
                      .gray = malloc(PIXELS),
                      .drawn = -1,
                      .results = calloc(IMAGES, sizeof *s.results)};
    struct distance_contender who[WHO_COUNT];
    enum status status = s.rgb && s.gray && s.results ? OK : fail(ERR_MEMORY, "no memory for images of tags");
    if (status == OK)
        status = tag_refiner_open(&s.refiner, &s.lens);
    if (status == OK)
        status = tag_detector_open(&s.finder, 1);
    if (status == OK)
        status = apriltag_peer_open(&s.apriltag, 1);
    for (int i = 0; i < WHO_COUNT; i++)
        who[i] = (struct distance_contender){&s, i};
    const struct bench_contender contenders[] = {
        {"ours", measure, &who[OURS], false},
        {"libapriltag", measure, &who[THEIRS], true},
        {"ours, two tags", measure, &who[OURS_BY_TWO], false},
    };
    if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), IMAGES);
    if (status == OK)
        print_by_distance(&s);
    tag_detector_close(&s.finder);
    tag_refiner_close(&s.refiner);
    apriltag_peer_close(&s.apriltag);
    free(s.rgb);
    free(s.gray);
    free(s.results);
    return status;
}

const struct bench_stage bench_stage_tag_distance = {
    "tag-distance",           "one tag from 1 to 5 m, next to libapriltag metre by metre",
    "range_error_mm",         "time_ms",
    {"turn_deg", "mirrored"}, run};
