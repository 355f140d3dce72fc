// Stage "place": localisation of a tablet carried round a room: position error, jumps from one image to the next, and
// time. Next to it libapriltag with its own pose of the largest visible tag, in the same map.
//
// The images are the small world's, at 30 Hz; or with --data those of a folder that holds place/ and viewer/ (TUM
// layout), tags.json, and truth/viewer_truth.txt and truth/tags_truth.json as truth. Poses are compared in the axes of
// the map's tags. behind_mm: how far the estimate lags towards an earlier position; what a single image lags is the
// map's error.
//
// The stage "still" is the same with a tablet on a table: jumps are jitter.
#include "capture/mapping/mapper.h"
#include "locate/camera_tracker.h"
#include "locate/tag_corners.h"
#include "platform/files/json.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_folder.h"
#include "tests/bench/bench_tags_peers.h"
#include "tests/support/align.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 200, MOST_TAGS = 64, SWEEP = 40, WALK = 90 };
static const double WALK_HZ = 30, STILL_AT_S = 1;

struct camera_walk {
    struct place place;
    struct lens lens;
    int count;
    int64_t time_ns[MOST];
    uint8_t *rgb[MOST], *gray[MOST];
    struct pose truth[MOST]; // world_from_camera, in the place's axes once aligned
};

static size_t pixels_of(const struct lens *lens) { return (size_t)lens->width * (size_t)lens->height; }

// Keeps a copy of the image.
static enum status keep_image(struct camera_walk *w, const uint8_t *rgb, int64_t time_ns, struct pose truth)
{
    size_t pixels = pixels_of(&w->lens);
    int i = w->count;
    w->rgb[i] = malloc(pixels * 3);
    w->gray[i] = malloc(pixels);
    if (!w->rgb[i] || !w->gray[i])
        return fail(ERR_MEMORY, "no memory for the images of the walk");
    memcpy(w->rgb[i], rgb, pixels * 3);
    gray_from_rgb(rgb, pixels, w->gray[i]);
    w->time_ns[i] = time_ns;
    w->truth[i] = truth;
    w->count++;
    return OK;
}

// Puts the truth into the place's axes, by where the map has the tags: the poses under test have no influence. truth:
// the same tags' corners, count of them.
static enum status align_truth(struct camera_walk *w, const int32_t *ids, const struct vec3 *truth, int count)
{
    struct vec3 ours[MOST_TAGS], theirs[MOST_TAGS];
    int n = 0;
    for (int32_t i = 0; i < w->place.tag_count; i++) {
        for (int k = 0; k < count && n < MOST_TAGS; k++) {
            if (ids[k] != w->place.tags[i].id)
                continue;
            ours[n] = w->place.tags[i].world_from_tag.translation;
            theirs[n++] = truth[k];
        }
    }
    if (n < 3)
        return fail(ERR_INPUT, "the truth knows only %d of the tags in the map", n);
    struct pose place_from_truth = align_points(theirs, ours, n);
    for (int i = 0; i < w->count; i++)
        w->truth[i] = pose_multiply(place_from_truth, w->truth[i]);
    return OK;
}

static enum status align_to_world(struct camera_walk *w, const struct world *world)
{
    int32_t count, ids[MOST_TAGS];
    struct vec3 at[MOST_TAGS];
    const struct place_tag *tags = world_tags(world, &count);
    for (int32_t i = 0; i < count && i < MOST_TAGS; i++) {
        ids[i] = tags[i].id;
        at[i] = tags[i].world_from_tag.translation;
    }
    return align_truth(w, ids, at, count < MOST_TAGS ? count : MOST_TAGS);
}

// truth/tags_truth.json: {"tags": [{"id": 0, "corners": [[x, y, z], ...]}, ...]}
static enum status align_to_file(struct camera_walk *w, const char *data)
{
    char path[4096];
    struct json *root = NULL;
    int32_t ids[MOST_TAGS];
    struct vec3 at[MOST_TAGS];
    int count = 0;
    snprintf(path, sizeof path, "%s/truth/tags_truth.json", data);
    enum status status = json_read(path, &root);
    const struct json *tags = status == OK ? json_member(root, "tags") : NULL;
    for (int i = 0; status == OK && i < json_count(tags) && count < MOST_TAGS; i++) {
        const struct json *tag = json_at(tags, i), *corners = json_member(tag, "corners");
        double id, sum[3] = {0}, value;
        status = json_need_number(tag, "id", path, &id);
        for (int k = 0; k < 4; k++)
            for (int axis = 0; axis < 3; axis++)
                if (json_get_number(json_at(json_at(corners, k), axis), &value))
                    sum[axis] += value / 4;
        ids[count] = (int32_t)id;
        at[count++] = v3(sum[0], sum[1], sum[2]);
    }
    json_free(&root);
    return status == OK ? align_truth(w, ids, at, count) : status;
}

// ---------------------------------------------------------------- the small world's walk

static enum status map_world(const struct world *world, struct camera_walk *w)
{
    struct calibration sensor = world_calibration(1);
    struct mapper_tag tags[64];
    struct mapper_report report;
    struct mapper *m;
    int32_t count;
    const struct place_tag *known = world_tags(world, &count);
    for (int32_t i = 0; i < count; i++)
        tags[i] = (struct mapper_tag){known[i].id, known[i].side_m};
    uint8_t *color = malloc(pixels_of(&sensor.color) * 3);
    uint16_t *depth = malloc(pixels_of(&sensor.color) * sizeof *depth);
    enum status status = color && depth ? mapper_open(&m, &sensor, tags, count, NULL) : ERR_MEMORY;
    for (int i = 0; i < SWEEP && status == OK; i++) {
        double t = (double)WORLD_SWEEP_S * i / SWEEP;
        struct world_shot shot = {sensor.color, world_sweep_pose(world, t), 0, false};
        struct frame frame = {.time_ns = (int64_t)(t * 1e9), .color = color, .depth = depth};
        status = world_render(world, &shot, &(struct world_image){.color = color, .depth = depth});
        world_color_noise(color, sensor.color.width, sensor.color.height, (uint64_t)i);
        if (status == OK)
            status = world_depth_noise(&sensor.color, depth, (uint64_t)i, depth);
        if (status == OK)
            status = mapper_add(m, &frame);
    }
    if (status == OK)
        status = mapper_finish(m, &w->place, &report);
    if (color && depth)
        mapper_close(&m);
    free(color);
    free(depth);
    return status;
}

static enum status make(struct camera_walk *w, bool still, int images)
{
    struct world_options options = world_default_options();
    struct world *world;
    options.motion = "still";
    enum status status = world_open(&world, &options);
    if (status != OK)
        return status;
    status = map_world(world, w);
    w->lens = world_viewer_calibration(1).color;
    uint8_t *color = malloc(pixels_of(&w->lens) * 3);
    if (status == OK && !color)
        status = fail(ERR_MEMORY, "no memory for an image");
    for (int i = 0; i < images && status == OK; i++) {
        struct world_shot shot = {w->lens, world_viewer_pose(world, still ? STILL_AT_S : i / WALK_HZ), 0, false};
        status = world_render(world, &shot, &(struct world_image){.color = color});
        world_color_noise(color, w->lens.width, w->lens.height, 500 + (uint64_t)i);
        if (status == OK)
            status = keep_image(w, color, (int64_t)(i / WALK_HZ * 1e9), shot.world_from_camera);
    }
    if (status == OK)
        status = align_to_world(w, world);
    free(color);
    world_close(&world);
    return status;
}

// ---------------------------------------------------------------- a folder's walk

static enum status read_folder(const char *data, struct camera_walk *w)
{
    char path[4096];
    struct source *camera = NULL;
    struct frame frame;
    enum status status = bench_map_folder(data, &w->place);
    FILE *truth = NULL;
    if (status == OK)
        status = bench_open_truth(data, "viewer_truth.txt", &truth);
    snprintf(path, sizeof path, "folder:%s/viewer", data);
    if (status == OK)
        status = source_open(&camera, path, SOURCE_CAMERA);
    if (status == OK)
        w->lens = source_calibration(camera)->color;
    while (status == OK && w->count < MOST && (status = source_next(camera, &frame)) == OK) {
        struct pose pose;
        if (frame.color && bench_truth_at(truth, (double)frame.time_ns * 1e-9, &pose))
            status = keep_image(w, frame.color, frame.time_ns, pose);
    }
    if (truth)
        fclose(truth);
    source_close(&camera);
    return status == NOTHING || status == OK ? align_to_file(w, data) : status;
}

// ---------------------------------------------------------------- the contenders

// Settings from a small tablet's to the best. Those that relocalisation needs are not varied while tracking, and vice
// versa.
static const struct setting {
    const char *name;
    bool tracked;
    double quad_decimate;
    int features, points;
} settings[] = {
    {"ours, tracked", true, 1, 1000, 150},         {"tracked, 40 landmarks", true, 1, 1000, 40},
    {"tracked, 80 landmarks", true, 1, 1000, 80},  {"tracked, 200 landmarks", true, 1, 1000, 200},
    {"ours, relocalised", false, 1, 1000, 150},    {"decimate 2", false, 2, 1000, 150},
    {"decimate 2, 500 feat.", false, 2, 500, 150}, {"decimate 3, 250 feat.", false, 3, 250, 150},
};
enum { SETTINGS = COUNT_OF(settings), PEERS = 2 };

struct runner {
    const struct camera_walk *walk;
    const struct setting *setting;
    struct locator *locator;
    struct camera_tracker *track;
    struct apriltag_peer *peer;
    int last; // the previous item; its error:
    struct vec3 error;
};

static void judge(struct runner *r, int item, struct pose found, struct bench_measure *out)
{
    const struct pose *truth = &r->walk->truth[item];
    struct vec3 error = v3_sub(found.translation, truth->translation);
    out->error = v3_length(error) * 1e3;
    out->extra[0] = pose_angle(found, *truth) * 57.29577951308232;
    out->extra[1] = item > 0 && r->last == item - 1 ? v3_distance(error, r->error) * 1e3 : 0;
    out->extra[2] = out->extra[1] > 5;
    if (item > 0) {
        struct vec3 way = v3_sub(truth->translation, r->walk->truth[item - 1].translation);
        out->extra[3] = v3_length(way) > 0 ? -v3_dot(error, v3_unit(way)) * 1e3 : 0;
    }
    r->last = item;
    r->error = error;
}

static enum status measure_find(void *self, int item, struct bench_measure *out)
{
    struct runner *r = self;
    struct location at;
    double started_ms = bench_clock_ms();
    enum status status = locator_localize(r->locator, r->walk->rgb[item], NULL, &at);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK)
        judge(r, item, at.world_from_camera, out);
    return status == AMBIGUOUS ? NOTHING : status;
}

static struct locator_options options_of(const struct setting *s)
{
    struct locator_options options = locator_default_options();
    options.quad_decimate = s->quad_decimate;
    options.features = s->features;
    options.points = s->points;
    return options;
}

static enum status measure_track(void *self, int item, struct bench_measure *out)
{
    struct runner *r = self;
    struct location at;
    struct camera_motion motion;
    if (item == 0) { // a new round
        struct locator_options options = options_of(r->setting);
        camera_tracker_close(&r->track);
        enum status status = camera_tracker_open(&r->track, &r->walk->place, &r->walk->lens, &options);
        if (status != OK)
            return status;
    }
    double started_ms = bench_clock_ms();
    enum status status =
        camera_tracker_process(r->track, r->walk->rgb[item], NULL, r->walk->time_ns[item], &at, &motion);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK)
        judge(r, item, at.world_from_camera, out);
    return status == AMBIGUOUS ? NOTHING : status;
}

static enum status measure_peer(void *self, int item, struct bench_measure *out)
{
    struct runner *r = self;
    struct pose found;
    double started_ms = bench_clock_ms();
    enum status status = apriltag_peer_locate(r->peer, r->walk->gray[item], &r->walk->lens, r->walk->place.tags,
                                              r->walk->place.tag_count, &found);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK)
        judge(r, item, found, out);
    return status;
}

static enum status run(struct bench *b, bool still)
{
    static struct camera_walk w;
    struct runner r[SETTINGS + PEERS];
    struct bench_contender contenders[SETTINGS + PEERS];
    const char *data = bench_inputs(b)->data;
    enum status status = data && !still ? read_folder(data, &w) : make(&w, still, bench_count(b, WALK, 0.2));
    for (size_t i = 0; i < COUNT_OF(r); i++)
        r[i] = (struct runner){.walk = &w, .last = -1};
    for (size_t i = 0; i < SETTINGS && status == OK; i++) {
        const struct setting *s = &settings[i];
        struct locator_options options = options_of(s);
        r[i].setting = s;
        if (!s->tracked)
            status = locator_open(&r[i].locator, &w.place, &w.lens, &options);
        contenders[i] = (struct bench_contender){s->name, s->tracked ? measure_track : measure_find, &r[i], false};
    }
    for (int i = 0; i < PEERS && status == OK; i++) {
        struct runner *peer = &r[SETTINGS + i];
        status = apriltag_peer_open(&peer->peer, i + 1);
        contenders[SETTINGS + i] = (struct bench_contender){i ? "libapriltag, decimate 2" : "libapriltag, every pixel",
                                                            measure_peer, peer, i == 0};
    }
    if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), w.count);
    for (int i = 0; i < 3 && i < w.count && status == OK; i++) {
        const int at = i * (w.count - 1) / 2;
        bench_picture(b,
                      i == 0   ? "the tablet's first image"
                      : i == 1 ? "half-way"
                               : "the last",
                      w.rgb[at], w.lens.width, w.lens.height);
    }
    for (size_t i = 0; i < COUNT_OF(r); i++) {
        locator_close(&r[i].locator);
        camera_tracker_close(&r[i].track);
        apriltag_peer_close(&r[i].peer);
    }
    for (int i = 0; i < w.count; i++) {
        free(w.rgb[i]);
        free(w.gray[i]);
    }
    place_free(&w.place);
    return status;
}

static enum status run_walking(struct bench *b) { return run(b, false); }

static enum status run_still(struct bench *b) { return run(b, true); }

const struct bench_stage bench_stage_map = {
    .name = "place",
    .about = "localisation of a tablet carried round a room",
    .error_name = "position_mm",
    .time_name = "time_ms",
    .extra_names = {"turn_deg", "jump_mm", "jumps_over_5mm", "behind_mm"},
    .run = run_walking,
};

const struct bench_stage bench_stage_still = {"still",   "jitter of a tablet that lies on a table", "position_mm",
                                              "time_ms", {"turn_deg", "jump_mm", "jumps_over_5mm"}, run_still};
