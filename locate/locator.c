// Opening and closing a locator; localisation is in locate/localize.c, tracking in locate/tracking.c.
#include "locate/locator.h"

#include "locate/locator_internal.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- locator frame

// The current image of the locator: its tags, features, and the pose problem that they make.

// Tags smaller than this, along their shortest side, are not searched for by prediction: their pattern is a blur.
// Chosen by hand.
static const double MIN_PREDICTED_PX = 10;
// The number of a predicted tag was not decoded, so its pattern must correlate well. Chosen by hand.
static const double PREDICTED_MIN_CORRELATION = 0.8;

void locator_begin_frame(struct locator *l, const uint8_t *color)
{
    locator_update_lens(l);
    gray_from_rgb(color, (size_t)l->lens.width * (size_t)l->lens.height, l->gray);
    l->frame_motion = l->expected;
    l->expected = shutter_motion_unknown();
}

void locator_add_observation(struct locator *l, const struct tag_observation *seen, int32_t which,
                             const uint16_t *depth)
{
    l->observations[l->observed_count] = *seen;
    l->observed_tag[l->observed_count] = which;
    l->depths[l->observed_count].count = 0;
    if (depth)
        tag_read_depth(seen, &l->lens, depth, &l->depths[l->observed_count]);
    l->observed_count++;
}

void locator_pnp_tags(const struct locator *l, struct pnp_tag *tags)
{
    for (int i = 0; i < l->observed_count; i++) {
        const struct place_tag *tag = &l->tags[l->observed_tag[i]];
        tags[i] = (struct pnp_tag){
            .seen = &l->observations[i],
            .depth = l->depths[i].count ? &l->depths[i] : NULL,
            .world_from_tag = tag->world_from_tag,
            .side_m = tag->side_m,
            .map_px = tag->rms_px / sqrt(2), // of a corner's x or y
            .covariance = tag->covariance,
        };
    }
}

struct pose_problem locator_problem(const struct locator *l, struct pnp_tag *tags, const struct pnp_point *points,
                                    int point_count)
{
    return (struct pose_problem){.tags = tags,
                                 .tag_count = tags ? l->observed_count : 0,
                                 .points = points,
                                 .point_count = point_count,
                                 .fx = l->lens.fx,
                                 .fy = l->lens.fy,
                                 .motion = l->motion};
}

int locator_select_inlier_tags(const struct locator *l, struct pnp_tag *tags, const struct shutter_motion *motion,
                               const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->observed_count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, camera_from_world, l->lens.fx, l->lens.fy);
        tags[i].used = tags[i].rms_px <= l->options.max_rms_px;
        used += tags[i].used;
    }
    return used;
}

// Where a tag must appear. False: not wholly in the image, from behind, too small.
static bool predict_corners(const struct locator *l, const struct place_tag *tag, const struct pose *camera_from_world,
                            struct pixel corner[4])
{
    struct vec3 world[4];
    place_tag_corners(tag, world);
    struct vec3 centre = pose_apply(*camera_from_world, tag->world_from_tag.translation);
    struct quat rotation = quat_multiply(camera_from_world->rotation, tag->world_from_tag.rotation);
    if (!(v3_dot(quat_rotate(rotation, v3(0, 0, 1)), centre) < 0))
        return false;
    for (int k = 0; k < 4; k++) {
        struct vec3 p = pose_apply(*camera_from_world, world[k]);
        // Far outside the image the distortion polynomial is not valid.
        if (!(p.z > 0.05) || fabs(p.x / p.z) > l->lens.width / l->lens.fx ||
            fabs(p.y / p.z) > l->lens.height / l->lens.fy)
            return false;
        corner[k] = shutter_project(&l->lens, l->motion, p);
        if (!(corner[k].x >= 1 && corner[k].y >= 1 && corner[k].x <= l->lens.width - 2 &&
              corner[k].y <= l->lens.height - 2))
            return false;
    }
    double shortest = 1e9;
    for (int k = 0; k < 4; k++)
        shortest = fmin(shortest, hypot(corner[k].x - corner[(k + 1) % 4].x, corner[k].y - corner[(k + 1) % 4].y));
    return shortest >= MIN_PREDICTED_PX;
}

int locator_detect_predicted(struct locator *l, const uint8_t *color, const uint16_t *depth,
                             const struct pose *camera_from_world, int most_pixels, int *missing)
{
    int before = l->observed_count, predicted_count = 0;
    for (int32_t k = 0; k < l->tag_count && l->observed_count < PNP_MAX_TAGS; k++) {
        bool seen = false;
        for (int i = 0; i < l->observed_count; i++)
            seen = seen || l->observed_tag[i] == k;
        struct tag_candidate candidate = {.id = l->tags[k].id, .pattern = &l->patterns[k]};
        struct tag_observation fine;
        if (seen || !predict_corners(l, &l->tags[k], camera_from_world, candidate.corner))
            continue;
        predicted_count++;
        if (tag_refine_sampled(l->refiner, color, &candidate, most_pixels, &fine) &&
            fine.correlation > PREDICTED_MIN_CORRELATION)
            locator_add_observation(l, &fine, k, depth);
    }
    if (missing)
        *missing = predicted_count - (l->observed_count - before);
    return l->observed_count - before;
}

double locator_rms(const struct locator *l, const struct pnp_tag *tags, const struct pose *camera_from_world)
{
    double sum = 0;
    int used = 0;
    for (int i = 0; i < l->observed_count; i++) {
        if (!tags[i].used)
            continue;
        double rms = pnp_tag_rms(&tags[i], l->motion, camera_from_world, l->lens.fx, l->lens.fy);
        sum += rms * rms;
        used++;
    }
    return used ? sqrt(sum / used) : 0;
}

static enum status index_features(struct locator *l, enum status status, int count, const uint16_t *depth)
{
    if (status != OK)
        return status;
    feature_index_build(&l->index, l->features, count, &l->lens);
    for (int i = 0; i < count && depth; i++)
        l->feature_depths[i] = feature_depth(&l->lens, depth, l->features[i].at);
    return OK;
}

enum status locator_extract_features(struct locator *l, const uint16_t *depth)
{
    int count;
    enum status status =
        features_detect(l->gray, l->lens.width, l->lens.height, l->features, l->options.features, &count);
    return index_features(l, status, count, depth);
}

enum status locator_extract_region_features(struct locator *l, int region, const uint16_t *depth)
{
    enum { BEYOND_PX = 24 }; // more than the margin without features at the edges of a region
    int width = l->lens.width, height = l->lens.height, count;
    int column = region % LOCATOR_REGIONS_X, row = region / LOCATOR_REGIONS_X;
    int left = column * width / LOCATOR_REGIONS_X - BEYOND_PX,
        right = (column + 1) * width / LOCATOR_REGIONS_X + BEYOND_PX;
    int top = row * height / LOCATOR_REGIONS_Y - BEYOND_PX, bottom = (row + 1) * height / LOCATOR_REGIONS_Y + BEYOND_PX;
    left = left > 0 ? left : 0, right = right < width ? right : width;
    top = top > 0 ? top : 0, bottom = bottom < height ? bottom : height;
    const struct image_region area = {left, top, right - left, bottom - top};
    enum status status =
        features_detect_region(l->gray, width, &area, l->features, 2 * FEATURES_MAX / LOCATOR_REGIONS, &count);
    return index_features(l, status, count, depth);
}

bool locator_fill_result(const struct locator *l, const struct pnp_solution *found, int point_count,
                         const double covariance[36], const double noise[36], struct location *out)
{
    double sigma_m = sqrt(covariance[21] + covariance[28] + covariance[35]);
    if (!(sigma_m <= l->options.max_position_sigma_m))
        return false;
    *out = (struct location){
        .world_from_camera = pose_inverse(found->camera_from_world),
        .rms_px = found->rms_px,
        .tags_used = found->used,
        .tags_rejected = l->observed_count - found->used,
        .points_used = point_count,
        .position_sigma_m = sigma_m,
        .other = pose_inverse(found->other),
        .other_excess_cost = found->other_excess_cost,
    };
    memcpy(out->covariance, covariance, sizeof out->covariance);
    memcpy(out->noise, noise, sizeof out->noise);
    return true;
}

// ---------------------------------------------------------------- rolling shutter detect

// Detects a rolling shutter that the camera's lens does not mention. When such a camera rotates, no pose fits all tags,
// and one by those that happen to agree may be 30 cm off. The test: with a read-out time and a velocity all tags fit.

// Most cameras read an image within 10 to 33 ms. The velocity is estimated with the pose, and only the motion within an
// image matters, so an error of a half in the read-out time is absorbed by the velocity.
static const double LIKELY_READOUT_S = 0.03;
// Three tags give 24 numbers for the 12 of pose and velocity. Each tag may cost twice the mean robust cost of eight
// normal errors (7.5, see pnp_covariance); a tag that was moved does not fit by a camera's motion.
enum { MIN_TAGS = 3 };
static const double MAX_TAG_COST = 15;
// With a less certain focal length, tags contradict each other because of it.
static const double SURE_FOCAL_SIGMA = 0.01;

bool locator_detect_rolling_shutter(struct locator *l, const struct pnp_tag *tags, const struct pnp_solution *found)
{
    struct tag_observation seen[PNP_MAX_TAGS];
    struct pnp_tag retimed[PNP_MAX_TAGS];
    struct shutter_motion unknown = shutter_motion_unknown();
    struct lens rolling = l->lens;
    struct tag_refiner *refiner;
    struct pnp_solution fit;
    if (l->motion || l->observed_count < MIN_TAGS || (found && found->used == l->observed_count) ||
        l->lens.focal_sigma > SURE_FOCAL_SIGMA)
        return false;
    rolling.readout_s = LIKELY_READOUT_S;
    for (int i = 0; i < l->observed_count; i++) {
        retimed[i] = tags[i];
        retimed[i].seen = &seen[i];
        seen[i] = l->observations[i];
        for (int k = 0; k < 4; k++)
            seen[i].time_s[k] = shutter_row_time(&rolling, lens_project(&rolling, seen[i].ray[k]).y);
    }
    const struct pose_problem problem = {
        .tags = retimed, .tag_count = l->observed_count, .fx = rolling.fx, .fy = rolling.fy, .motion = &unknown};
    if (pnp_solve(&problem, l->options.max_rms_px, &fit) == NOTHING || fit.used < l->observed_count ||
        fit.cost > MAX_TAG_COST * fit.used || tag_refiner_open(&refiner, &rolling) != OK)
        return false;
    tag_refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = rolling;
    l->motion = &l->frame_motion;
    l->frame_motion = unknown;
    memcpy(l->observations, seen, sizeof *seen * (size_t)l->observed_count);
    return true;
}

// ---------------------------------------------------------------- self calibration

// Self-calibration: an uncertain focal length is estimated while the camera is localised in the place, see
// locate/focal_estimate.h.

// A smaller change (of the logarithm), or one below twice its standard deviation, is not worth losing the tracks.
// Chosen by hand.
static const double MIN_CHANGE = 0.001, MIN_SIGMAS = 2;
// One in so many tracked images is used: those between show the same. Chosen by hand.
enum { FOCAL_INTERVAL = 3 };

// The estimate of log(focal length) less that of the lens in use.
static double focal_correction(const struct locator *l, double *sigma)
{
    *sigma = l->given_lens.focal_sigma;
    return focal_estimate_posterior(&l->focal, log(l->given_lens.fx / l->lens.fx), sigma);
}

void locator_update_lens(struct locator *l)
{
    if (!(l->given_lens.focal_sigma > 0))
        return;
    const double by = focal_correction(l, &l->lens.focal_sigma), sigma = l->lens.focal_sigma;
    if (!(fabs(by) > MIN_CHANGE && fabs(by) > MIN_SIGMAS * sigma))
        return;
    struct lens better = l->lens;
    struct tag_refiner *refiner;
    better.fx *= exp(by);
    better.fy *= exp(by);
    if (tag_refiner_open(&refiner, &better) != OK)
        return; // no memory: keep the old one
    tag_refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = better;
    l->track_count = 0;
    focal_estimate_shift(&l->focal, by);
    focal_correction(l, &l->lens.focal_sigma);
}

void locator_observe_focal(struct locator *l, const struct pose_problem *problem, const struct pose *camera_from_world)
{
    if (++l->frames_since_focal < FOCAL_INTERVAL)
        return;
    l->frames_since_focal = 0;
    focal_estimate_add(&l->focal, problem, camera_from_world);
}

// The mean distance of tag corners and points along z; 0 where there are none.
static double mean_distance(const struct pose_problem *problem, const struct pose *camera_from_world)
{
    const struct pnp_tag *tags = problem->tags;
    double sum = 0;
    int count = 0;
    for (int i = 0; i < problem->tag_count; i++) {
        if (tags[i].used) {
            sum += 4 * pose_apply(*camera_from_world, tags[i].world_from_tag.translation).z; // of its corners
            count += 4;
        }
    }
    for (int i = 0; i < problem->point_count; i++)
        sum += pose_apply(*camera_from_world, problem->points[i].world).z;
    count += problem->point_count;
    return count ? sum / count : 0;
}

void locator_add_focal_variance(const struct locator *l, const struct pose_problem *problem,
                                const struct pose *camera_from_world, double covariance[36])
{
    if (!(l->given_lens.focal_sigma > 0))
        return;
    // Twice the distance with twice the focal length gives the same image size: the translation along z.
    const double off_m = l->lens.focal_sigma * mean_distance(problem, camera_from_world);
    covariance[35] += off_m * off_m;
}

// ---------------------------------------------------------------- moved tags

// Tags that are not where the place has them: moved since it was mapped, or another tag with the same number. They are
// outliers of the pose; here each image votes for which they are, so that the app can say so.

// What supports a pose by which a tag is judged to be elsewhere: so many other tags, or so many landmarks. Chosen by
// hand.
enum { MIN_OTHER_TAGS = 2, MIN_POINTS = 20 };
// A smaller offset, as a share of the tag's side, may be due to occlusion, bending or noise. Chosen by hand.
static const double MIN_MOVED_SHARE = 0.25;

static bool has_moved(const struct locator *l, int i, const struct pose *camera_from_world)
{
    const struct place_tag *tag = &l->tags[l->observed_tag[i]];
    const struct pose expected = pose_multiply(*camera_from_world, tag->world_from_tag);
    return planar_pose_offset_m(tag->side_m, l->observations[i].ray, &expected) > MIN_MOVED_SHARE * tag->side_m;
}

void locator_vote_moved_tags(struct locator *l, const struct pnp_tag *tags, int points,
                             const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->observed_count; i++)
        used += tags[i].used;
    if (used < MIN_OTHER_TAGS && points < MIN_POINTS)
        return;
    for (int i = 0; i < l->observed_count; i++) {
        int32_t *votes = &l->moved_votes[l->observed_tag[i]];
        if (tags[i].used)
            --*votes;
        else if (has_moved(l, i, camera_from_world))
            ++*votes;
    }
}

int32_t locator_moved_tags(const struct locator *l, int32_t *first)
{
    int32_t count = 0;
    *first = -1;
    for (int32_t k = 0; k < l->tag_count; k++) {
        if (l->moved_votes[k] <= 0)
            continue;
        if (!count++ || l->tags[k].id < *first)
            *first = l->tags[k].id;
    }
    return count;
}

// ---------------------------------------------------------------- locator

// A landmark's count of searches in vain starts at 3. A search is expected to find it with the weight 1 / (1 + count),
// see tracking.c: so one that was never searched for counts a quarter of one that was just found, as if it
// had been found and then missed three times. Chosen by hand.
enum { UNKNOWN_MISSED_COUNT = 3 };

enum { MIN_TRACKED = 30, MAX_TRACKED = 200 }; // of locator_options.points

struct locator_options locator_default_options(void)
{
    return (struct locator_options){
        .quad_decimate = 1, .features = 1000, .points = 150, .max_rms_px = 2.5, .max_position_sigma_m = 0.05};
}

static enum status check_inputs(const struct place *place, const struct lens *lens,
                                const struct locator_options *options)
{
    enum status status = lens_check(lens, "color");
    if (status != OK)
        return status;
    if (options->features < 100 || options->features > FEATURES_MAX)
        return fail(ERR_INPUT, "features must lie between 100 and %d, not %d", FEATURES_MAX, (int)options->features);
    if (options->points < MIN_TRACKED || options->points > MAX_TRACKED)
        return fail(ERR_INPUT, "points must lie between %d and %d, not %d", MIN_TRACKED, MAX_TRACKED,
                    (int)options->points);
    if (!(options->max_rms_px > 0))
        return fail(ERR_INPUT, "max_rms_px must be greater than 0, not %g", options->max_rms_px);
    if (!(options->max_position_sigma_m > 0))
        return fail(ERR_INPUT, "max_position_sigma_m must be greater than 0, not %g", options->max_position_sigma_m);
    if (place->tag_count <= 0 && place->point_count < LOCATOR_MIN_WITHOUT_TAGS)
        return fail(ERR_INPUT, "the place holds no tag and too few points to find a camera by; map it again, with tags "
                               "on its walls");
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *tag = &place->tags[i];
        if (!(tag->side_m > 0) || !isfinite(tag->side_m) || !pose_finite(tag->world_from_tag))
            return fail(ERR_INPUT, "tag %d of the place has no sensible size or pose", (int)tag->id);
        for (int32_t k = 0; k < i; k++)
            if (place->tags[k].id == tag->id)
                return fail(ERR_INPUT,
                            "the place holds two tags with the number %d; take one of them away and map it again",
                            (int)tag->id);
    }
    return OK;
}

static enum status init_locator(struct locator *l, const struct place *place)
{
    size_t pixels = (size_t)l->lens.width * (size_t)l->lens.height, n = (size_t)place->tag_count + 1;
    l->gray = malloc(pixels);
    l->tags = malloc(n * sizeof *l->tags);
    l->patterns = malloc(n * sizeof *l->patterns);
    l->tag_tracks = calloc(n, sizeof *l->tag_tracks);
    l->moved_votes = calloc(n, sizeof *l->moved_votes);
    if (!l->gray || !l->tags || !l->patterns || !l->tag_tracks || !l->moved_votes)
        return fail(ERR_MEMORY, "no memory to find a camera in the place");
    if (place->point_count > 0) {
        size_t points = (size_t)place->point_count;
        l->points = malloc(points * sizeof *l->points);
        l->region_points = malloc(points * sizeof *l->region_points);
        l->region_of = malloc(points * sizeof *l->region_of);
        l->points_by_region = malloc(points * sizeof *l->points_by_region);
        l->missed_count = calloc(points, sizeof *l->missed_count);
        if (!l->points || !l->region_points || !l->region_of || !l->points_by_region || !l->missed_count)
            return fail(ERR_MEMORY, "no memory to find a camera in the place");
        memcpy(l->points, place->points, points * sizeof *l->points);
        memset(l->missed_count, UNKNOWN_MISSED_COUNT, points);
        l->point_count = place->point_count;
    }
    l->tag_count = place->tag_count;
    if (l->tag_count)
        memcpy(l->tags, place->tags, (n - 1) * sizeof *l->tags);
    for (int32_t i = 0; i < l->tag_count; i++)
        if (!tag_pattern(l->tags[i].id, &l->patterns[i]))
            return fail(ERR_INPUT, "the place's tag %d is not of the family tag36h11, which ends at %d",
                        (int)l->tags[i].id, TAG_ID_COUNT - 1);
    enum status status = tag_refiner_open(&l->refiner, &l->lens);
    if (status == OK)
        status = klt_pyramid_open(&l->pyramid, l->lens.width, l->lens.height);
    if (status == OK)
        status = tag_detector_open(&l->detector, l->options.quad_decimate);
    const double coarse = 2 * l->options.quad_decimate;
    return status == OK && coarse <= TAG_MAX_DECIMATE ? tag_detector_open(&l->coarse_detector, coarse) : status;
}

enum status locator_open(struct locator **out, const struct place *place, const struct lens *lens,
                         const struct locator_options *options)
{
    *out = NULL;
    struct locator_options wanted = options ? *options : locator_default_options();
    enum status status = check_inputs(place, lens, &wanted);
    if (status != OK)
        return status;
    struct locator *l = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "no memory to find a camera in the place");
    l->lens = l->given_lens = *lens;
    l->options = wanted;
    l->motion = lens->readout_s > 0 ? &l->frame_motion : NULL;
    l->expected = shutter_motion_unknown();
    status = init_locator(l, place);
    if (status != OK)
        locator_close(&l);
    *out = l;
    return status;
}

void locator_close(struct locator **out)
{
    struct locator *l = *out;
    if (!l)
        return;
    tag_detector_close(&l->detector);
    tag_detector_close(&l->coarse_detector);
    tag_refiner_close(&l->refiner);
    klt_pyramid_close(&l->pyramid);
    free(l->gray);
    free(l->tags);
    free(l->patterns);
    free(l->tag_tracks);
    free(l->moved_votes);
    free(l->points);
    free(l->region_points);
    free(l->region_of);
    free(l->points_by_region);
    free(l->missed_count);
    free(l);
    *out = NULL;
}

void locator_set_motion_prior(struct locator *l, const double velocity[6], const double covariance[36])
{
    l->expected = shutter_motion_prior(velocity, covariance);
}

const struct lens *locator_lens(const struct locator *l) { return &l->lens; }

int locator_seen_tags(const struct locator *l, int32_t *ids, int capacity)
{
    int count = 0;
    for (int i = 0; i < l->observed_count; i++) {
        const int32_t id = l->tags[l->observed_tag[i]].id;
        int at = 0;
        while (at < count && ids[at] < id)
            at++;
        if ((at < count && ids[at] == id) || count == capacity)
            continue;
        memmove(ids + at + 1, ids + at, (size_t)(count++ - at) * sizeof *ids);
        ids[at] = id;
    }
    return count;
}

double locator_depth_scale(const struct locator *l)
{
    double sum = 0, weights = 0;
    for (int i = 0; i < l->observed_count; i++) {
        const struct tag_depth *depth = &l->depths[i];
        struct pose two[2];
        const int n = depth->count ? planar_poses(l->tags[l->observed_tag[i]].side_m, l->observations[i].ray, two) : 0;
        if (!n)
            continue;
        double measured = 0, z = two[0].translation.z;
        for (int32_t k = 0; k < depth->count; k++)
            measured += depth->sample[k].z / depth->count;
        z = n > 1 ? (z + two[1].translation.z) / 2 : z;
        const double side = l->tags[l->observed_tag[i]].side_m / z;
        sum += side * side * measured / z;
        weights += side * side;
    }
    return weights > 0 ? sum / weights : 0;
}

bool locator_focal_is_wrong(const struct locator *l, double *scale)
{
    return focal_estimate_is_wrong(&l->focal, scale);
}
