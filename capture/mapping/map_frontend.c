// Detection of tags and features on worker threads.
#include "capture/mapping/map_frontend.h"

#include "base/threads.h"

#include <stdlib.h>
#include <string.h>

enum { WORKERS = 2, SLOTS = 2 * WORKERS };

struct slot {
    struct map_frontend_result result;
    uint8_t *color, *jpeg;
    uint16_t *depth;
    size_t jpeg_capacity;
    struct failure failure; // how the worker ended
};

// Images go to the workers in turn, so that results do not depend on their speed.
struct worker {
    struct map_frontend *frontend;
    struct tag_detector *detector;
    struct tag_refiner *refiner;
    uint8_t *gray;
    struct queue *todo, *done; // slots
    struct worker_thread thread;
};

struct map_frontend {
    const struct map *map;
    bool points;
    struct worker workers[WORKERS];
    struct slot slots[SLOTS];
    int64_t put, taken;
};

void map_frame_free(struct map_frame *frame)
{
    free(frame->seen);
    free(frame->depths);
    free(frame->raw_seen);
    free(frame->raw_depths);
    free(frame->tag_index);
    free(frame->features);
    free(frame->jpeg);
    free(frame->depth);
    *frame = (struct map_frame){0};
}

bool map_depth_usable(const struct calibration *calibration)
{
    return calibration->registered && calibration->depth.width == calibration->color.width &&
           calibration->depth.height == calibration->color.height;
}

static enum status detect_tags(struct worker *worker, struct map_frontend_result *out)
{
    struct tag_detection seen[PNP_MAX_TAGS];
    const struct map *map = worker->frontend->map;
    const struct lens *lens = &map->calibration.color;
    const uint16_t *depth = map_depth_usable(&map->calibration) ? out->frame.depth : NULL;
    struct map_frame *f = &out->observed;
    int count;
    enum status status = tag_detector_detect(
        worker->detector, &(struct gray_image){worker->gray, lens->width, lens->height}, seen, PNP_MAX_TAGS, &count);
    if (status != OK)
        return status;
    f->seen = calloc((size_t)count + 1, sizeof *f->seen);
    f->depths = calloc((size_t)count + 1, sizeof *f->depths);
    f->tag_index = calloc((size_t)count + 1, sizeof *f->tag_index);
    f->raw_seen = calloc((size_t)count + 1, sizeof *f->raw_seen);
    f->raw_depths = calloc((size_t)count + 1, sizeof *f->raw_depths);
    if (!f->seen || !f->depths || !f->tag_index || !f->raw_seen || !f->raw_depths)
        return fail(ERR_MEMORY, "no memory for the tags of a picture");
    for (int i = 0; i < count; i++) {
        bool duplicate = (i > 0 && seen[i - 1].id == seen[i].id) || (i + 1 < count && seen[i + 1].id == seen[i].id);
        if (i == 0 || seen[i - 1].id != seen[i].id)
            out->ids[out->id_count++] = seen[i].id;
        for (int32_t k = 0; k < map->tag_count && !duplicate; k++) { // of two with one id it is unknown which is meant
            if (map->tags[k].id != seen[i].id ||
                !tag_refine(worker->refiner, out->frame.color, seen[i].id, &map->tags[k].pattern, seen[i].corner,
                            &f->seen[f->seen_count]))
                continue;
            if (depth)
                tag_read_depth(&f->seen[f->seen_count], lens, depth, &f->depths[f->seen_count]);
            f->raw_seen[f->seen_count] = f->seen[f->seen_count];
            f->raw_depths[f->seen_count] = f->depths[f->seen_count];
            f->tag_index[f->seen_count++] = k;
        }
    }
    return OK;
}

static enum status detect_features(struct worker *worker, struct map_frontend_result *out)
{
    struct feature found[MAP_MAX_FEATURES];
    const struct map *map = worker->frontend->map;
    const struct lens *lens = &map->calibration.color;
    const uint16_t *depth = map_depth_usable(&map->calibration) ? out->frame.depth : NULL;
    struct map_frame *f = &out->observed;
    int count = 0;
    enum status status = worker->frontend->points
                             ? features_detect(worker->gray, lens->width, lens->height, found, MAP_MAX_FEATURES, &count)
                             : OK;
    if (status != OK)
        return status;
    f->features = calloc((size_t)count + 1, sizeof *f->features);
    if (!f->features)
        return fail(ERR_MEMORY, "no memory for the points of a picture");
    for (int i = 0; i < count; i++) {
        double z = depth ? feature_depth(lens, depth, found[i].at) : 0;
        f->features[i] = (struct map_feature){found[i], z, 0, -1, found[i].at, z};
    }
    f->feature_count = count;
    return OK;
}

static void process_frame(struct worker *worker, struct slot *slot)
{
    const struct lens *lens = &worker->frontend->map->calibration.color;
    gray_from_rgb(slot->result.frame.color, (size_t)lens->width * (size_t)lens->height, worker->gray);
    enum status status = detect_tags(worker, &slot->result);
    if (status == OK)
        status = detect_features(worker, &slot->result);
    failure_keep(&slot->failure, status);
}

static void *run_worker(void *context)
{
    struct worker *w = context;
    for (struct slot *s; (s = queue_take(w->todo));) {
        process_frame(w, s);
        queue_put(w->done, s);
    }
    return NULL;
}

static enum status start_worker(struct map_frontend *frontend, struct worker *worker,
                                const struct mapper_options *options)
{
    const struct lens *lens = &frontend->map->calibration.color;
    worker->frontend = frontend;
    worker->gray = malloc((size_t)lens->width * (size_t)lens->height);
    enum status status = worker->gray ? OK : fail(ERR_MEMORY, "no memory to map a place");
    if (status == OK)
        status = tag_refiner_open(&worker->refiner, lens);
    if (status == OK)
        status = tag_detector_open(&worker->detector, options->quad_decimate);
    if (status == OK)
        status = queue_open(&worker->todo, SLOTS);
    if (status == OK)
        status = queue_open(&worker->done, SLOTS);
    if (status == OK)
        status_ignore(worker_thread_start(&worker->thread, run_worker, worker,
                                          "to map a place")); // map_frontend_put then detects
    return status;
}

enum status map_frontend_open(struct map_frontend **out, const struct map *map, const struct mapper_options *options)
{
    struct map_frontend *l = calloc(1, sizeof *l);
    *out = l;
    if (!l)
        return fail(ERR_MEMORY, "no memory to map a place");
    l->map = map;
    l->points = options->max_points > 0;
    size_t pixels = (size_t)map->calibration.color.width * (size_t)map->calibration.color.height;
    size_t depths = (size_t)map->calibration.depth.width * (size_t)map->calibration.depth.height;
    enum status status = OK;
    for (int i = 0; i < WORKERS; i++)
        worker_thread_open(&l->workers[i].thread);
    for (int i = 0; i < SLOTS && status == OK; i++) {
        struct slot *s = &l->slots[i];
        s->color = malloc(pixels * 3);
        s->depth = malloc((depths + 1) * sizeof *s->depth);
        if (!s->color || !s->depth)
            status = fail(ERR_MEMORY, "no memory for %d pictures of a sweep", (int)SLOTS);
    }
    for (int i = 0; i < WORKERS && status == OK; i++)
        status = start_worker(l, &l->workers[i], options);
    if (status != OK)
        map_frontend_close(out);
    return status;
}

void map_frontend_close(struct map_frontend **out)
{
    struct map_frontend *frontend = *out;
    if (!frontend)
        return;
    for (int i = 0; i < WORKERS; i++) {
        struct worker *w = &frontend->workers[i];
        if (w->todo)
            queue_stop(w->todo);
        worker_thread_close(&w->thread);
        queue_close(&w->todo);
        queue_close(&w->done);
        tag_refiner_close(&w->refiner);
        tag_detector_close(&w->detector);
        free(w->gray);
    }
    for (int i = 0; i < SLOTS; i++) {
        map_frame_free(&frontend->slots[i].result.observed);
        free(frontend->slots[i].color);
        free(frontend->slots[i].depth);
        free(frontend->slots[i].jpeg);
    }
    free(frontend);
    *out = NULL;
}

bool map_frontend_full(const struct map_frontend *frontend) { return frontend->put - frontend->taken == SLOTS; }

static enum status copy_frame(struct slot *slot, const struct calibration *calibration, const struct frame *frame,
                              int32_t number)
{
    slot->result = (struct map_frontend_result){.frame = *frame, .number = number};
    slot->result.observed = (struct map_frame){.time_ns = frame->time_ns,
                                               .camera_from_world = POSE_IDENTITY,
                                               .has_odometry = frame->has_odometry,
                                               .odometry_from_camera = frame->odometry_from_camera};
    slot->result.frame.dmabuf = NULL;
    memcpy(slot->color, frame->color, (size_t)calibration->color.width * (size_t)calibration->color.height * 3);
    slot->result.frame.color = slot->color;
    if (frame->depth) {
        memcpy(slot->depth, frame->depth,
               (size_t)calibration->depth.width * (size_t)calibration->depth.height * sizeof *slot->depth);
        slot->result.frame.depth = slot->depth;
    }
    if (!frame->jpeg)
        return OK;
    if (slot->jpeg_capacity < frame->jpeg_bytes) {
        free(slot->jpeg);
        slot->jpeg_capacity = 0;
        slot->jpeg = malloc(frame->jpeg_bytes);
        if (!slot->jpeg)
            return fail(ERR_MEMORY, "no memory for a picture of the sweep");
        slot->jpeg_capacity = frame->jpeg_bytes;
    }
    memcpy(slot->jpeg, frame->jpeg, frame->jpeg_bytes);
    slot->result.frame.jpeg = slot->jpeg;
    return OK;
}

enum status map_frontend_put(struct map_frontend *frontend, const struct frame *frame, int32_t number)
{
    assert(!map_frontend_full(frontend));
    struct slot *s = &frontend->slots[frontend->put % SLOTS];
    struct worker *w = &frontend->workers[frontend->put % WORKERS];
    enum status status = copy_frame(s, &frontend->map->calibration, frame, number);
    if (status != OK)
        return status;
    frontend->put++;
    if (w->thread.runs)
        queue_put(w->todo, s);
    else
        process_frame(w, s); // the thread could not be created
    return OK;
}

enum status map_frontend_take(struct map_frontend *frontend, struct map_frontend_result *out)
{
    if (frontend->taken == frontend->put)
        return NOTHING;
    struct slot *s = &frontend->slots[frontend->taken % SLOTS];
    struct worker *w = &frontend->workers[frontend->taken++ % WORKERS];
    if (w->thread.runs)
        s = queue_take(w->done); // the same slot, once it is done
    if (s->failure.status != OK) {
        map_frame_free(&s->result.observed);
        return failure_restore(&s->failure);
    }
    *out = s->result;
    s->result.observed = (struct map_frame){0}; // owned by the caller now
    return OK;
}
