// Stage "tags": one tag of 16 cm, 1 to 5 m away, tilted by up to a radian about two axes, in an image of 640 x 480 with
// f = 525 and noise of 2 grey levels: errors of its range and its rotation from a single image, and the time.
#include "locate/pose_solver.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_tags_peers.h"
#include "tests/support/tag_picture.h"

#include <stdio.h>
#include <stdlib.h>

enum { IMAGES = 200, WIDTH = 640, HEIGHT = 480, PIXELS = WIDTH * HEIGHT };
static const uint64_t SEED = 2014;
static const double SIDE_M = 0.16, FLIP_DEG = 15;

struct tag_images {
    struct lens lens;
    uint8_t *rgb, *gray; // IMAGES of each
    struct pose camera_from_tag[IMAGES];
    int32_t id[IMAGES];
};

static enum status make(struct tag_images *p, int count)
{
    struct rng rng = {SEED};
    p->lens = tag_picture_lens(WIDTH, HEIGHT, 525);
    p->rgb = malloc((size_t)IMAGES * PIXELS * 3);
    p->gray = malloc((size_t)IMAGES * PIXELS);
    if (!p->rgb || !p->gray)
        return fail(ERR_MEMORY, "no memory for images of tags");
    for (int i = 0; i < count; i++) {
        double distance = 1 + 4 * rng_uniform(&rng);
        double yaw = 2 * rng_uniform(&rng) - 1, pitch = 2 * rng_uniform(&rng) - 1;
        struct place_tag tag = {
            .id = (int32_t)(TAG_ID_COUNT * rng_uniform(&rng)), .side_m = SIDE_M, .world_from_tag = POSE_IDENTITY};
        struct tag_picture image = {
            .lens = p->lens,
            .tags = &tag,
            .tag_count = 1,
            .noise = 2,
            .seed = SEED + (uint64_t)i,
            .world_from_camera = tag_picture_view(distance, yaw, pitch, 6.28 * rng_uniform(&rng)),
            .rgb = p->rgb + (size_t)i * PIXELS * 3,
        };
        // anywhere in the image
        double up = 0.6 * (rng_uniform(&rng) - 0.5), right = 0.8 * (rng_uniform(&rng) - 0.5);
        struct vec3 aside = v3(right, up, 0);
        image.world_from_camera.translation =
            v3_add(image.world_from_camera.translation,
                   v3_scale(quat_rotate(image.world_from_camera.rotation, aside), distance));
        if (!tag_picture_draw(&image))
            return fail(ERR_INPUT, "tag %d could not be drawn", (int)tag.id);
        gray_from_rgb(image.rgb, PIXELS, p->gray + (size_t)i * PIXELS);
        p->camera_from_tag[i] = pose_inverse(image.world_from_camera);
        p->id[i] = tag.id;
    }
    return OK;
}

static void judge(const struct tag_images *p, int item, struct pose found, double started_ms, struct bench_measure *out)
{
    out->time_ms = bench_clock_ms() - started_ms;
    const struct pose *truth = &p->camera_from_tag[item];
    double turned = pose_angle(found, *truth) * 57.29577951308232;
    out->error = fabs(found.translation.z - truth->translation.z) * 1e3;
    out->extra[0] = fmin(turned, FLIP_DEG); // one mirrored pose must not dominate the mean
    out->extra[1] = turned > FLIP_DEG;
}

struct tags_ours {
    const struct tag_images *images;
    struct tag_detector *finder;
    struct tag_refiner *refiner;
    struct tag_pattern patterns[IMAGES];
    uint8_t *gray;
};

static enum status open_ours(struct tags_ours *o, const struct tag_images *p, double quad_decimate)
{
    *o = (struct tags_ours){.images = p, .gray = malloc(PIXELS)};
    if (!o->gray)
        return fail(ERR_MEMORY, "no memory for an image");
    for (int i = 0; i < IMAGES; i++)
        if (!tag_pattern(p->id[i], &o->patterns[i]))
            return fail(ERR_MEMORY, "no memory for a tag's pattern");
    enum status status = tag_refiner_open(&o->refiner, &p->lens);
    return status == OK ? tag_detector_open(&o->finder, quad_decimate) : status;
}

static void close_ours(struct tags_ours *o)
{
    tag_detector_close(&o->finder);
    tag_refiner_close(&o->refiner);
    free(o->gray);
}

// From the colour image to the pose, as the locator does for a place of one tag.
static enum status measure_ours(void *self, int item, struct bench_measure *out)
{
    struct tags_ours *o = self;
    const struct tag_images *p = o->images;
    const uint8_t *rgb = p->rgb + (size_t)item * PIXELS * 3;
    struct tag_detection seen[8];
    int count;
    double started_ms = bench_clock_ms();
    gray_from_rgb(rgb, PIXELS, o->gray);
    enum status status = tag_detector_detect(o->finder, &(struct gray_image){o->gray, WIDTH, HEIGHT}, seen, 8, &count);
    if (status != OK)
        return status;
    for (int i = 0; i < count; i++) {
        struct tag_observation fine;
        struct pnp_solution fit;
        if (seen[i].id != p->id[item] ||
            !tag_refine(o->refiner, rgb, seen[i].id, &o->patterns[item], seen[i].corner, &fine))
            continue;
        struct pnp_tag tag = {.seen = &fine, .world_from_tag = POSE_IDENTITY, .side_m = SIDE_M};
        if (pnp_solve(&(struct pose_problem){.tags = &tag, .tag_count = 1, .fx = p->lens.fx, .fy = p->lens.fy}, 2.5,
                      &fit) == NOTHING)
            continue;
        judge(p, item, fit.camera_from_world, started_ms, out);
        return OK;
    }
    out->time_ms = bench_clock_ms() - started_ms;
    return NOTHING;
}

struct tags_peer {
    const struct tag_images *images;
    struct apriltag_peer *apriltag; // or NULL: ArUco
    enum aruco_corners corners;
};

static enum status measure_peer(void *self, int item, struct bench_measure *out)
{
    struct tags_peer *o = self;
    const struct tag_images *p = o->images;
    const uint8_t *gray = p->gray + (size_t)item * PIXELS;
    struct pose found;
    double started_ms = bench_clock_ms();
    enum status status = o->apriltag ? apriltag_peer_find(o->apriltag, gray, &p->lens, p->id[item], SIDE_M, &found)
                                     : aruco_peer_find(o->corners, gray, &p->lens, p->id[item], SIDE_M, &found);
    if (status == OK)
        judge(p, item, found, started_ms, out);
    else
        out->time_ms = bench_clock_ms() - started_ms;
    return status;
}

// The nearest, a middle and the farthest tag: what their distance is measured by.
static void draw_pictures(struct bench *b, const struct tag_images *p, int images)
{
    int order[3] = {0, 0, 0};
    for (int i = 0; i < images; i++) {
        const double z = p->camera_from_tag[i].translation.z;
        if (z < p->camera_from_tag[order[0]].translation.z)
            order[0] = i;
        if (z > p->camera_from_tag[order[2]].translation.z)
            order[2] = i;
        if (fabs(z - 3) < fabs(p->camera_from_tag[order[1]].translation.z - 3))
            order[1] = i;
    }
    for (int k = 0; k < 3; k++) {
        char caption[100];
        snprintf(caption, sizeof caption, "a tag at %.1f m", p->camera_from_tag[order[k]].translation.z);
        bench_picture(b, caption, p->rgb + (size_t)order[k] * PIXELS * 3, WIDTH, HEIGHT);
    }
}

static enum status run(struct bench *b)
{
    struct tag_images p = {0};
    struct tags_ours ours[3] = {0};
    struct tags_peer peers[5] = {0};
    const int images = bench_count(b, IMAGES, 0.1);
    enum status status = make(&p, images);
    if (!bench_inputs(b)->json && !bench_inputs(b)->brief)
        printf("tags: seed %llu\n", (unsigned long long)SEED);
    for (int i = 0; i < 3 && status == OK; i++)
        status = open_ours(&ours[i], &p, i + 1);
    for (int i = 0; i < 5; i++)
        peers[i] = (struct tags_peer){.images = &p, .corners = (enum aruco_corners)(i < 2 ? 0 : i - 2)};
    for (int i = 0; i < 2 && status == OK; i++)
        status = apriltag_peer_open(&peers[i].apriltag, i + 1);
    if (status == OK) {
        const struct bench_contender contenders[] = {
            {"ours, every pixel", measure_ours, &ours[0], false},
            {"ours, decimate 2", measure_ours, &ours[1], false},
            {"ours, decimate 3", measure_ours, &ours[2], false},
            {"libapriltag, every pixel", measure_peer, &peers[0], true},
            {"libapriltag, decimate 2", measure_peer, &peers[1], false},
            {"ArUco", measure_peer, &peers[2], false},
            {"ArUco, subpixel", measure_peer, &peers[3], false},
            {"ArUco, apriltag corners", measure_peer, &peers[4], false},
        };
        status = bench_run(b, contenders, COUNT_OF(contenders), images);
        draw_pictures(b, &p, images);
    }
    for (int i = 0; i < 3; i++)
        close_ours(&ours[i]);
    for (int i = 0; i < 2; i++)
        apriltag_peer_close(&peers[i].apriltag);
    free(p.rgb);
    free(p.gray);
    return status;
}

const struct bench_stage bench_stage_tags = {
    .name = "tags",
    .about = "range and rotation of one tag from one image",
    .error_name = "range_error_mm",
    .time_name = "time_ms",
    .extra_names = {"turn_deg", "mirrored"},
    .run = run,
};
