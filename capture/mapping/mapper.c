// The mapper: collects the frames of a sweep, runs the steps of mapping in order, exports the place and the report.
#include "base/registered_depth.h"
#include "capture/mapping/map_frontend.h"
#include "capture/mapping/sweep_tracker.h"
#include "platform/files/jpeg.h"

#include <stdlib.h>
#include <string.h>

enum { PLAN_STRIDE = 2 };

struct mapper {
    struct map map;
    struct mapper_options options;
    struct map_frontend *frontend;
    struct sweep_tracker *sweep; // NULL: without a plan
    struct calibration given;    // of the frames; the map's depth lies on colour's pixels
    uint16_t *resized;           // depth on them; NULL: the frames' lies there already
    int32_t frames_seen, stride, image_stride;
    int32_t still;                         // frames that showed the same view as the last one kept, one after the other
    int32_t frames_with_tag[TAG_ID_COUNT]; // frames that show the tag, listed or not
};

// Relative. A focal length self-calibrated in another place is more accurate than this; a guess is not.
static const double MAX_FOCAL_SIGMA = 0.01;

struct mapper_options mapper_default_options(void)
{
    return (struct mapper_options){.quad_decimate = 1, .max_points = 4000, .max_views = 40};
}

static enum status check_input(const struct calibration *calibration, const struct mapper_tag *tags, int32_t tag_count,
                               const struct mapper_options *options)
{
    if (!calibration->color.width)
        return fail(ERR_INPUT, "a place is mapped from colour pictures, and this sensor has depth only");
    enum status status = lens_check(&calibration->color, "color");
    if (status != OK)
        return status;
    if (calibration->color.focal_sigma > MAX_FOCAL_SIGMA)
        return fail(ERR_INPUT,
                    "the camera's focal length is known to %.1f %% only, and the place would be no more accurate; "
                    "calibrate its lens (the guide says how)",
                    calibration->color.focal_sigma * 100);
    if (options->max_points < 0 || options->max_points > MAP_MAX_CANDIDATES || options->max_views < 0)
        return fail(ERR_INPUT, "max_points must lie between 0 and %d, max_views must not be negative",
                    (int)MAP_MAX_CANDIDATES);
    if (tag_count < 0 || tag_count > MAPPER_MAX_TAGS)
        return fail(ERR_INPUT, "a place is mapped by at most %d tags, not %d", (int)MAPPER_MAX_TAGS, (int)tag_count);
    if (!tag_count && !(options->prior && options->prior->tag_count) &&
        ((!map_depth_usable(calibration) && !registered_depth_differs(calibration)) || !options->max_points))
        return fail(ERR_INPUT, "without tags the scale of a place comes from depth on the colour's pixels, and this "
                               "sensor has none; hang tags and list them");
    for (int32_t i = 0; i < tag_count; i++) {
        if (tags[i].id < 0 || tags[i].id >= TAG_ID_COUNT || !(tags[i].side_m > 0) || !isfinite(tags[i].side_m))
            return fail(ERR_INPUT, "tag %d with a side of %g m cannot be a tag of tag36h11", (int)tags[i].id,
                        tags[i].side_m);
        for (int32_t k = 0; k < i; k++)
            if (tags[k].id == tags[i].id)
                return fail(ERR_INPUT, "tag %d is listed twice", (int)tags[i].id);
    }
    return OK;
}

static enum status open_parts(struct mapper *mapper, const struct mapper_tag *tags, int32_t tag_count)
{
    struct map *map = &mapper->map;
    map->frames = calloc(MAP_MAX_FRAMES, sizeof *map->frames);
    if (registered_depth_differs(&mapper->given))
        mapper->resized = malloc(lens_pixels(&mapper->given.color) * sizeof *mapper->resized);
    if (!map->frames || (registered_depth_differs(&mapper->given) && !mapper->resized))
        return fail(ERR_MEMORY, "no memory to map a place");
    enum status status = map_load_prior(map, mapper->options.prior, tags, tag_count);
    if (status == OK && mapper->options.plan)
        status = sweep_tracker_open(&mapper->sweep, map);
    return status == OK ? map_frontend_open(&mapper->frontend, map, &mapper->options) : status;
}

enum status mapper_open(struct mapper **out, const struct calibration *calibration, const struct mapper_tag *tags,
                        int32_t tag_count, const struct mapper_options *options)
{
    *out = NULL;
    struct mapper_options wanted = options ? *options : mapper_default_options();
    enum status status = check_input(calibration, tags, tag_count, &wanted);
    if (status != OK)
        return status;
    struct mapper *m = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "no memory to map a place");
    m->map.calibration = m->given = *calibration;
    if (registered_depth_differs(calibration))
        m->map.calibration.depth = calibration->color;
    m->map.depth_scale = 1;
    m->map.on_step = wanted.on_step;
    m->map.self = wanted.self;
    m->options = wanted;
    m->stride = m->image_stride = 1;
    status = open_parts(m, tags, tag_count);
    if (status != OK)
        mapper_close(&m);
    *out = m;
    return status;
}

static void drop_image(struct map_frame *frame)
{
    free(frame->jpeg);
    free(frame->depth);
    frame->jpeg = NULL;
    frame->depth = NULL;
}

void mapper_close(struct mapper **out)
{
    struct mapper *m = *out;
    if (!m)
        return;
    map_frontend_close(&m->frontend);
    sweep_tracker_close(&m->sweep);
    for (int32_t i = 0; i < m->map.frame_count; i++)
        map_frame_free(&m->map.frames[i]);
    free(m->map.frames);
    free(m->map.tags);
    free(m->map.points);
    free(m->map.point_observations);
    free(m->resized);
    free(m);
    *out = NULL;
}

// Drops every second frame when there are too many; every second image too.
static void decimate_frames(struct mapper *mapper)
{
    struct map *map = &mapper->map;
    if (map->frame_count == MAP_MAX_FRAMES) {
        int32_t kept = 0;
        for (int32_t i = 0; i < map->frame_count; i++) {
            if (i % 2)
                map_frame_free(&map->frames[i]);
            else
                map->frames[kept++] = map->frames[i];
        }
        memset(map->frames + kept, 0, (size_t)(map->frame_count - kept) * sizeof *map->frames);
        map->frame_count = kept;
        mapper->stride *= 2;
    }
    int32_t images = 0;
    for (int32_t i = 0; i < map->frame_count; i++)
        images += map->frames[i].jpeg || map->frames[i].depth;
    if (images < MAP_MAX_IMAGES)
        return;
    images = 0;
    for (int32_t i = 0; i < map->frame_count; i++)
        if ((map->frames[i].jpeg || map->frames[i].depth) && images++ % 2)
            drop_image(&map->frames[i]);
    mapper->image_stride *= 2;
}

static enum status copy_image(const struct mapper *mapper, const struct frame *frame, struct map_frame *out)
{
    const struct calibration *c = &mapper->map.calibration;
    if (frame->jpeg) {
        out->jpeg = malloc(frame->jpeg_bytes);
        if (!out->jpeg)
            return fail(ERR_MEMORY, "no memory for a picture of the place");
        memcpy(out->jpeg, frame->jpeg, frame->jpeg_bytes);
        out->jpeg_bytes = frame->jpeg_bytes;
    } else {
        enum status status =
            jpeg_encode(frame->color, c->color.width, c->color.height, 92, &out->jpeg, &out->jpeg_bytes);
        if (status != OK)
            return status;
    }
    if (frame->depth && c->depth.width) {
        size_t bytes = (size_t)c->depth.width * (size_t)c->depth.height * sizeof *out->depth;
        out->depth = malloc(bytes);
        if (!out->depth)
            return fail(ERR_MEMORY, "no memory for a depth picture of the place");
        memcpy(out->depth, frame->depth, bytes);
    }
    return OK;
}

// Where a sensor stands still, its first FIRST_STILL frames are kept, and then one of so many: what they show is the
// same, and the time that a map takes grows with the square of the frames that show a landmark. All chosen by hand.
enum { FIRST_STILL = 12, ONE_STILL_OF = 8, COMPARED = 200, MIN_COMPARED = 60, SAME_BITS = 40 };
static const double SAME_PX = 1, SAME_SHARE = 0.6;

static bool shows_feature(const struct map_frame *frame, const struct feature *wanted)
{
    for (int32_t i = 0; i < frame->feature_count; i++) {
        const struct feature *own = &frame->features[i].feature;
        if (fabs(own->at.x - wanted->at.x) < SAME_PX && fabs(own->at.y - wanted->at.y) < SAME_PX &&
            feature_distance(own->descriptor, wanted->descriptor) < SAME_BITS)
            return true;
    }
    return false;
}

static bool shows_the_same(const struct map_frame *a, const struct map_frame *b)
{
    const int32_t count = a->feature_count < COMPARED ? a->feature_count : COMPARED;
    int32_t same = 0;
    for (int32_t i = 0; i < count; i++)
        same += shows_feature(b, &a->features[i * (int64_t)a->feature_count / count].feature);
    return count >= MIN_COMPARED && same > SAME_SHARE * count;
}

// Whether a frame tells nothing new.
static bool is_superfluous(struct mapper *mapper, const struct map_frame *frame)
{
    const struct map *map = &mapper->map;
    if (!map->frame_count || !shows_the_same(frame, &map->frames[map->frame_count - 1])) {
        mapper->still = 0;
        return false;
    }
    mapper->still++;
    return mapper->still >= FIRST_STILL && mapper->still % ONE_STILL_OF;
}

// The next image from the front end becomes a frame of the map. NOTHING: there is none.
static enum status take_frame(struct mapper *mapper)
{
    struct map_frontend_result result;
    enum status status = map_frontend_take(mapper->frontend, &result);
    if (status != OK)
        return status;
    if (mapper->sweep)
        sweep_tracker_add(mapper->sweep, &result.observed, result.frame.depth);
    if (result.number % mapper->stride) { // mapper->stride has grown since it was put, or it is for the plan alone
        map_frame_free(&result.observed);
        return OK;
    }
    if (is_superfluous(mapper, &result.observed)) {
        map_frame_free(&result.observed);
        return OK;
    }
    mapper->map.has_depth |= result.frame.depth && map_depth_usable(&mapper->map.calibration);
    for (int32_t i = 0; i < result.id_count; i++)
        mapper->frames_with_tag[result.ids[i]]++;
    decimate_frames(mapper);
    if (mapper->map.frame_count % mapper->image_stride == 0)
        status = copy_image(mapper, &result.frame, &result.observed);
    if (status == OK)
        mapper->map.frames[mapper->map.frame_count++] = result.observed;
    else
        map_frame_free(&result.observed);
    return status;
}

enum status mapper_add(struct mapper *mapper, const struct frame *frame)
{
    if (!frame->color)
        return OK;
    int32_t number = mapper->frames_seen++;
    // The plan needs neighbouring images to follow the sensor, however long the sweep.
    const int32_t stride = mapper->sweep && mapper->stride > PLAN_STRIDE ? PLAN_STRIDE : mapper->stride;
    if (number % stride)
        return OK;
    struct frame on_color = *frame;
    if (mapper->resized && frame->depth) {
        registered_depth_resize(&mapper->given, frame->depth, mapper->resized);
        on_color.depth = mapper->resized;
    }
    enum status status = map_frontend_full(mapper->frontend) ? take_frame(mapper) : OK;
    return status == OK ? map_frontend_put(mapper->frontend, &on_color, number) : status;
}

void mapper_get_progress(const struct mapper *mapper, struct mapper_progress *out)
{
    const struct map *map = &mapper->map;
    int32_t group[MAPPER_MAX_TAGS], first = -1;
    *out = (struct mapper_progress){.listed = map->tag_count, .first_unseen = -1, .apart_a = -1, .apart_b = -1};
    for (int32_t t = 0; t < map->tag_count && t < MAPPER_MAX_TAGS; t++)
        group[t] = t;
    // Tags of one frame are one group, by the lowest index.
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 1; k < map->frames[i].seen_count; k++) {
            const int32_t a = group[map->frames[i].tag_index[0]], b = group[map->frames[i].tag_index[k]];
            const int32_t lower = a < b ? a : b, higher = a < b ? b : a;
            for (int32_t t = 0; t < map->tag_count && t < MAPPER_MAX_TAGS && lower < higher; t++)
                group[t] = group[t] == higher ? lower : group[t];
        }
    for (int32_t t = 0; t < map->tag_count && t < MAPPER_MAX_TAGS; t++) {
        if (!mapper->frames_with_tag[map->tags[t].id]) {
            out->first_unseen = out->first_unseen < 0 ? map->tags[t].id : out->first_unseen;
            continue;
        }
        out->seen++;
        if (first < 0)
            first = t;
        else if (group[t] != group[first] && out->apart_b < 0) {
            out->apart_a = map->tags[first].id;
            out->apart_b = map->tags[t].id;
        }
    }
}

const struct sweep_plan *mapper_plan(struct mapper *mapper)
{
    struct mapper_progress progress;
    if (!mapper->sweep)
        return NULL;
    mapper_get_progress(mapper, &progress);
    return sweep_tracker_plan(mapper->sweep, &progress);
}

static void report_longest_gap(const struct map *map, struct mapper_report *report)
{
    int64_t longest = 0;
    for (int32_t i = 0; i < map->frame_count; i++) {
        int32_t end = i;
        while (end < map->frame_count && !map->frames[end].placed)
            end++;
        if (end == i)
            continue;
        int64_t from = map->frames[i].time_ns, to = map->frames[end - 1].time_ns, start = map->frames[0].time_ns;
        if (to - from > longest) {
            longest = to - from;
            report->lost_from_s = (double)(from - start) * 1e-9;
            report->lost_to_s = (double)(to - start) * 1e-9;
        }
        i = end;
    }
}

static void report_tags(const struct mapper *mapper, struct mapper_report *report)
{
    report->first_unseen = report->first_disconnected = report->first_unlisted = report->first_moved =
        report->first_outlier = report->first_wrong = -1;
    for (int32_t id = 0; id < TAG_ID_COUNT; id++) {
        const struct map_tag *tag = NULL;
        for (int32_t i = 0; i < mapper->map.tag_count; i++)
            if (mapper->map.tags[i].id == id)
                tag = &mapper->map.tags[i];
        if (tag && tag->moved && report->tags_moved++ == 0)
            report->first_moved = id;
        if (tag && tag->outlier && report->tags_outlier++ == 0)
            report->first_outlier = id;
        if (tag && tag->wrong && report->tags_wrong_side++ == 0) {
            report->first_wrong = id;
            report->listed_side_m = tag->side_m;
            report->measured_m = tag->measured_side_m;
        }
        if (tag && tag->mapped)
            report->tags_mapped++;
        else if (tag && !mapper->frames_with_tag[id] && report->tags_unseen++ == 0)
            report->first_unseen = id;
        else if (tag && mapper->frames_with_tag[id] && !tag->outlier && !tag->wrong && report->tags_disconnected++ == 0)
            report->first_disconnected = id;
        else if (!tag && mapper->frames_with_tag[id] > 1 && report->tags_unlisted++ == 0)
            report->first_unlisted = id;
    }
    report->all_wrong_side = mapper->map.list_is_wrong;
    report->frames_seen = mapper->frames_seen;
    report->readout_s = mapper->map.found_readout ? mapper->map.calibration.color.readout_s : 0;
    report->frames = mapper->map.frame_count;
    for (int32_t i = 0; i < mapper->map.frame_count; i++)
        report->frames_placed += mapper->map.frames[i].placed;
}

// How much two views differ: metres, with a radian counted as two.
static double view_distance(struct pose camera_a_from_world, struct pose camera_b_from_world)
{
    struct pose wa = pose_inverse(camera_a_from_world), wb = pose_inverse(camera_b_from_world);
    return v3_distance(wa.translation, wb.translation) + 2 * pose_angle(wa, wb);
}

// Farthest-point sampling: moves the images that are furthest from each other, and from the views the place has, to it.
static void export_views(struct map *map, int32_t max, struct place *out)
{
    double distance[MAP_MAX_FRAMES];
    for (int32_t i = 0; i < map->frame_count; i++) {
        distance[i] = map->frames[i].placed && map->frames[i].jpeg ? 1e9 : -1;
        for (int32_t k = 0; k < out->view_count && distance[i] > 0; k++)
            distance[i] = fmin(distance[i], view_distance(map->frames[i].camera_from_world,
                                                          pose_inverse(out->views[k].world_from_camera)));
    }
    for (max += out->view_count; out->view_count < max;) {
        int32_t best = -1;
        for (int32_t i = 0; i < map->frame_count; i++)
            if (distance[i] > 0.1 && (best < 0 || distance[i] > distance[best]))
                best = i;
        if (best < 0)
            break;
        struct map_frame *f = &map->frames[best];
        out->views[out->view_count++] = (struct place_view){
            .world_from_camera = pose_inverse(f->camera_from_world),
            .jpeg = f->jpeg,
            .jpeg_bytes = f->jpeg_bytes,
            .depth = f->depth,
        };
        f->jpeg = NULL; // owned by the place now
        f->depth = NULL;
        distance[best] = -1;
        for (int32_t i = 0; i < map->frame_count; i++)
            if (distance[i] > 0)
                distance[i] = fmin(distance[i], view_distance(map->frames[i].camera_from_world, f->camera_from_world));
    }
}

// Views have no calibration of their own: they are read with the place's.
static bool same_calibration(const struct calibration *a, const struct calibration *b)
{
    return lens_equal(&a->color, &b->color) && lens_equal(&a->depth, &b->depth) && a->registered == b->registered &&
           (a->registered || !memcmp(&a->color_from_depth, &b->color_from_depth, sizeof a->color_from_depth));
}

static enum status export_place(struct mapper *mapper, struct place *out)
{
    struct map *map = &mapper->map;
    const struct place *prior = mapper->options.prior;
    const struct calibration *calibration = prior ? &prior->calibration : &map->calibration;
    *out = (struct place){.calibration = *calibration, .rms_px = map->rms_px, .rms_m = map->rms_m};
    out->tags = calloc((size_t)map->tag_count + 1, sizeof *out->tags);
    out->points = calloc((size_t)map->point_count + 1, sizeof *out->points);
    size_t views = (size_t)(prior ? prior->view_count : 0) + (size_t)mapper->options.max_views;
    out->views = calloc(views + 1, sizeof *out->views);
    if (!out->tags || !out->points || !out->views) {
        place_free(out);
        return fail(ERR_MEMORY, "no memory for the map of the place");
    }
    for (int32_t i = 0; i < map->tag_count; i++) {
        const struct map_tag *t = &map->tags[i];
        if (!t->mapped)
            continue;
        struct place_tag *tag = &out->tags[out->tag_count++];
        *tag = (struct place_tag){t->id, t->side_m, t->world_from_tag, t->rms_px, t->observations, {0}};
        memcpy(tag->covariance, t->covariance, sizeof tag->covariance);
    }
    memcpy(out->points, map->points, (size_t)map->point_count * sizeof *out->points);
    out->point_count = map->point_count;
    enum status status = prior ? map_copy_prior_views(prior, out) : OK;
    if (status != OK)
        place_free(out);
    else if (same_calibration(calibration, &map->calibration))
        export_views(map, mapper->options.max_views, out);
    return status;
}

enum status mapper_finish(struct mapper *mapper, struct place *out, struct mapper_report *report)
{
    *out = (struct place){0};
    *report = (struct mapper_report){0};
    enum status status;
    do
        status = take_frame(mapper);
    while (status == OK);
    if (status < 0)
        return status;
    if (!mapper->map.frame_count)
        return fail(ERR_INPUT, "the sweep holds no colour picture; film the place with colour and depth");
    const struct place *prior = mapper->options.prior;
    if (mapper->map.tag_count && !prior && map_most_observed_tag(&mapper->map, false) < 0) {
        report_tags(mapper, report);
        return map_explain_no_tags(&mapper->map, mapper->frames_with_tag);
    }
    status = map_check_depth_turn(&mapper->map);
    if (status == OK)
        status = map_check_tag_sides(&mapper->map);
    if (status == OK && prior)
        status = map_release_moved_tags(&mapper->map);
    if (status == OK)
        status = map_bootstrap(&mapper->map, mapper->options.max_points > 0);
    if (status == OK && prior)
        status = map_check_overlap(&mapper->map);
    if (status == OK)
        map_remove_outlier_tags(&mapper->map);
    if (status == OK && mapper->options.max_points)
        status = map_refine_landmarks(&mapper->map, mapper->options.max_points);
    if (status == OK)
        map_compute_residuals(&mapper->map);
    if (status == OK)
        status = map_judge(&mapper->map, report);
    if (status == OK)
        status = map_check_use(&mapper->map, report);
    if (status == OK && prior) {
        map_merge_residuals(&mapper->map, prior);
        report->floor_from_depth = true;
    } else if (status == OK) {
        status = map_align_gravity(&mapper->map, &report->floor_from_depth);
    }
    if (status == OK)
        status = map_landmark_covariances(&mapper->map);
    if (status == OK)
        status = map_tag_covariances(&mapper->map);
    if (status == OK)
        status = export_place(mapper, out);
    report_tags(mapper, report);
    report_longest_gap(&mapper->map, report);
    return status;
}

bool mapper_pose(const struct mapper *mapper, int64_t time_ns, struct pose *world_from_camera)
{
    for (int32_t i = 0; i < mapper->map.frame_count; i++)
        if (mapper->map.frames[i].time_ns == time_ns && mapper->map.frames[i].placed) {
            *world_from_camera = pose_inverse(mapper->map.frames[i].camera_from_world);
            return true;
        }
    return false;
}
