// Opening and closing a locator, and what localisation from scratch and tracking (locate/localize.c) share.
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

void locator_begin_frame(struct locator *locator, const uint8_t *color)
{
    locator_update_lens(locator);
    gray_from_rgb(color, (size_t)locator->lens.width * (size_t)locator->lens.height, locator->gray);
    locator->frame_motion = locator->expected;
    locator->expected = shutter_motion_unknown();
}

void locator_add_observation(struct locator *locator, const struct tag_observation *seen, int32_t which,
                             const uint16_t *depth)
{
    locator->observations[locator->observed_count] = *seen;
    locator->observed_tag[locator->observed_count] = which;
    locator->depths[locator->observed_count].count = 0;
    if (depth)
        tag_read_depth(seen, &locator->lens, depth, &locator->depths[locator->observed_count]);
    locator->observed_count++;
}

void locator_pnp_tags(const struct locator *locator, struct pnp_tag *tags)
{
    for (int i = 0; i < locator->observed_count; i++) {
        const struct place_tag *tag = &locator->tags[locator->observed_tag[i]];
        tags[i] = (struct pnp_tag){
            .seen = &locator->observations[i],
            .depth = locator->depths[i].count ? &locator->depths[i] : NULL,
            .world_from_tag = tag->world_from_tag,
            .side_m = tag->side_m,
            .map_px = tag->rms_px / sqrt(2), // of a corner's x or y
            .covariance = tag->covariance,
        };
    }
}

struct pose_problem locator_problem(const struct locator *locator, struct pnp_tag *tags, const struct pnp_point *points,
                                    int point_count)
{
    return (struct pose_problem){.tags = tags,
                                 .tag_count = tags ? locator->observed_count : 0,
                                 .points = points,
                                 .point_count = point_count,
                                 .fx = locator->lens.fx,
                                 .fy = locator->lens.fy,
                                 .motion = locator->motion};
}

int locator_select_inlier_tags(const struct locator *locator, struct pnp_tag *tags, const struct shutter_motion *motion,
                               const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < locator->observed_count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, camera_from_world, locator->lens.fx, locator->lens.fy);
        tags[i].used = tags[i].rms_px <= locator->options.max_rms_px;
        used += tags[i].used;
    }
    return used;
}

// Where a tag must appear. False: not wholly in the image, from behind, too small.
static bool predict_corners(const struct locator *locator, const struct place_tag *tag,
                            const struct pose *camera_from_world, struct pixel corner[4])
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
        if (!(p.z > 0.05) || fabs(p.x / p.z) > locator->lens.width / locator->lens.fx ||
            fabs(p.y / p.z) > locator->lens.height / locator->lens.fy)
            return false;
        corner[k] = shutter_project(&locator->lens, locator->motion, p);
        if (!(corner[k].x >= 1 && corner[k].y >= 1 && corner[k].x <= locator->lens.width - 2 &&
              corner[k].y <= locator->lens.height - 2))
            return false;
    }
    double shortest = 1e9;
    for (int k = 0; k < 4; k++)
        shortest = fmin(shortest, hypot(corner[k].x - corner[(k + 1) % 4].x, corner[k].y - corner[(k + 1) % 4].y));
    return shortest >= MIN_PREDICTED_PX;
}

int locator_detect_predicted(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                             const struct pose *camera_from_world, int max_pixels, int *missing)
{
    int before = locator->observed_count, predicted_count = 0;
    for (int32_t k = 0; k < locator->tag_count && locator->observed_count < PNP_MAX_TAGS; k++) {
        bool seen = false;
        for (int i = 0; i < locator->observed_count; i++)
            seen = seen || locator->observed_tag[i] == k;
        struct tag_candidate candidate = {.id = locator->tags[k].id, .pattern = &locator->patterns[k]};
        struct tag_observation fine;
        if (seen || !predict_corners(locator, &locator->tags[k], camera_from_world, candidate.corner))
            continue;
        predicted_count++;
        if (tag_refine_sampled(locator->refiner, color, &candidate, max_pixels, &fine) &&
            fine.correlation > PREDICTED_MIN_CORRELATION)
            locator_add_observation(locator, &fine, k, depth);
    }
    if (missing)
        *missing = predicted_count - (locator->observed_count - before);
    return locator->observed_count - before;
}

double locator_rms(const struct locator *locator, const struct pnp_tag *tags, const struct pose *camera_from_world)
{
    double sum = 0;
    int used = 0;
    for (int i = 0; i < locator->observed_count; i++) {
        if (!tags[i].used)
            continue;
        double rms = pnp_tag_rms(&tags[i], locator->motion, camera_from_world, locator->lens.fx, locator->lens.fy);
        sum += rms * rms;
        used++;
    }
    return used ? sqrt(sum / used) : 0;
}

static enum status index_features(struct locator *locator, enum status status, int count, const uint16_t *depth)
{
    if (status != OK)
        return status;
    feature_index_build(&locator->index, locator->features, count, &locator->lens);
    for (int i = 0; i < count && depth; i++)
        locator->feature_depths[i] = feature_depth(&locator->lens, depth, locator->features[i].at);
    return OK;
}

enum status locator_extract_features(struct locator *locator, const uint16_t *depth)
{
    int count;
    enum status status = features_detect(locator->gray, locator->lens.width, locator->lens.height, locator->features,
                                         locator->options.features, &count);
    return index_features(locator, status, count, depth);
}

enum status locator_extract_region_features(struct locator *locator, int region, const uint16_t *depth)
{
    enum { BEYOND_PX = 24 }; // more than the margin without features at the edges of a region
    int width = locator->lens.width, height = locator->lens.height, count;
    int column = region % LOCATOR_REGIONS_X, row = region / LOCATOR_REGIONS_X;
    int left = column * width / LOCATOR_REGIONS_X - BEYOND_PX,
        right = (column + 1) * width / LOCATOR_REGIONS_X + BEYOND_PX;
    int top = row * height / LOCATOR_REGIONS_Y - BEYOND_PX, bottom = (row + 1) * height / LOCATOR_REGIONS_Y + BEYOND_PX;
    left = left > 0 ? left : 0, right = right < width ? right : width;
    top = top > 0 ? top : 0, bottom = bottom < height ? bottom : height;
    const struct image_region area = {left, top, right - left, bottom - top};
    enum status status = features_detect_region(locator->gray, width, &area, locator->features,
                                                2 * FEATURES_MAX / LOCATOR_REGIONS, &count);
    return index_features(locator, status, count, depth);
}

bool locator_fill_result(const struct locator *locator, const struct pnp_solution *found, int point_count,
                         const double covariance[36], const double noise[36], struct location *out)
{
    double sigma_m = sqrt(covariance[21] + covariance[28] + covariance[35]);
    if (!(sigma_m <= locator->options.max_position_sigma_m))
        return false;
    *out = (struct location){
        .world_from_camera = pose_inverse(found->camera_from_world),
        .rms_px = found->rms_px,
        .tags_used = found->used,
        .tags_rejected = locator->observed_count - found->used,
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

bool locator_detect_rolling_shutter(struct locator *locator, const struct pnp_tag *tags,
                                    const struct pnp_solution *found)
{
    struct tag_observation seen[PNP_MAX_TAGS];
    struct pnp_tag retimed[PNP_MAX_TAGS];
    struct shutter_motion unknown = shutter_motion_unknown();
    struct lens rolling = locator->lens;
    struct tag_refiner *refiner;
    struct pnp_solution fit;
    if (locator->motion || locator->observed_count < MIN_TAGS || (found && found->used == locator->observed_count) ||
        locator->lens.focal_sigma > SURE_FOCAL_SIGMA)
        return false;
    rolling.readout_s = LIKELY_READOUT_S;
    for (int i = 0; i < locator->observed_count; i++) {
        retimed[i] = tags[i];
        retimed[i].seen = &seen[i];
        seen[i] = locator->observations[i];
        for (int k = 0; k < 4; k++)
            seen[i].time_s[k] = shutter_row_time(&rolling, lens_project(&rolling, seen[i].ray[k]).y);
    }
    const struct pose_problem problem = {
        .tags = retimed, .tag_count = locator->observed_count, .fx = rolling.fx, .fy = rolling.fy, .motion = &unknown};
    if (pnp_solve(&problem, locator->options.max_rms_px, &fit) == NOTHING || fit.used < locator->observed_count ||
        fit.cost > MAX_TAG_COST * fit.used || tag_refiner_open(&refiner, &rolling) != OK)
        return false;
    tag_refiner_close(&locator->refiner);
    locator->refiner = refiner;
    locator->lens = rolling;
    locator->motion = &locator->frame_motion;
    locator->frame_motion = unknown;
    memcpy(locator->observations, seen, sizeof *seen * (size_t)locator->observed_count);
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
static double focal_correction(const struct locator *locator, double *sigma)
{
    *sigma = locator->given_lens.focal_sigma;
    return focal_estimate_posterior(&locator->focal, log(locator->given_lens.fx / locator->lens.fx), sigma);
}

void locator_update_lens(struct locator *locator)
{
    if (!(locator->given_lens.focal_sigma > 0))
        return;
    const double by = focal_correction(locator, &locator->lens.focal_sigma), sigma = locator->lens.focal_sigma;
    if (!(fabs(by) > MIN_CHANGE && fabs(by) > MIN_SIGMAS * sigma))
        return;
    struct lens better = locator->lens;
    struct tag_refiner *refiner;
    better.fx *= exp(by);
    better.fy *= exp(by);
    if (tag_refiner_open(&refiner, &better) != OK)
        return; // no memory: keep the old one
    tag_refiner_close(&locator->refiner);
    locator->refiner = refiner;
    locator->lens = better;
    locator->track_count = 0;
    focal_estimate_shift(&locator->focal, by);
    focal_correction(locator, &locator->lens.focal_sigma);
}

void locator_observe_focal(struct locator *locator, const struct pose_problem *problem,
                           const struct pose *camera_from_world)
{
    if (++locator->frames_since_focal < FOCAL_INTERVAL)
        return;
    locator->frames_since_focal = 0;
    focal_estimate_add(&locator->focal, problem, camera_from_world);
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

void locator_add_focal_variance(const struct locator *locator, const struct pose_problem *problem,
                                const struct pose *camera_from_world, double covariance[36])
{
    if (!(locator->given_lens.focal_sigma > 0))
        return;
    // Twice the distance with twice the focal length gives the same image size: the translation along z.
    const double off_m = locator->lens.focal_sigma * mean_distance(problem, camera_from_world);
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

static bool has_moved(const struct locator *locator, int i, const struct pose *camera_from_world)
{
    const struct place_tag *tag = &locator->tags[locator->observed_tag[i]];
    const struct pose expected = pose_multiply(*camera_from_world, tag->world_from_tag);
    return planar_pose_offset_m(tag->side_m, locator->observations[i].ray, &expected) > MIN_MOVED_SHARE * tag->side_m;
}

void locator_vote_moved_tags(struct locator *locator, const struct pnp_tag *tags, int points,
                             const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < locator->observed_count; i++)
        used += tags[i].used;
    if (used < MIN_OTHER_TAGS && points < MIN_POINTS)
        return;
    for (int i = 0; i < locator->observed_count; i++) {
        int32_t *votes = &locator->moved_votes[locator->observed_tag[i]];
        if (tags[i].used)
            --*votes;
        else if (has_moved(locator, i, camera_from_world))
            ++*votes;
    }
}

int32_t locator_moved_tags(const struct locator *locator, int32_t *first)
{
    int32_t count = 0;
    *first = -1;
    for (int32_t k = 0; k < locator->tag_count; k++) {
        if (locator->moved_votes[k] <= 0)
            continue;
        if (!count++ || locator->tags[k].id < *first)
            *first = locator->tags[k].id;
    }
    return count;
}

// ---------------------------------------------------------------- locator

// A landmark's count of searches in vain starts at 3. A search is expected to find it with the weight 1 / (1 + count),
// see localize.c: so one that was never searched for counts a quarter of one that was just found, as if it
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

static enum status init_locator(struct locator *locator, const struct place *place)
{
    size_t pixels = (size_t)locator->lens.width * (size_t)locator->lens.height, n = (size_t)place->tag_count + 1;
    locator->gray = malloc(pixels);
    locator->tags = malloc(n * sizeof *locator->tags);
    locator->patterns = malloc(n * sizeof *locator->patterns);
    locator->tag_tracks = calloc(n, sizeof *locator->tag_tracks);
    locator->moved_votes = calloc(n, sizeof *locator->moved_votes);
    if (!locator->gray || !locator->tags || !locator->patterns || !locator->tag_tracks || !locator->moved_votes)
        return fail(ERR_MEMORY, "no memory to find a camera in the place");
    if (place->point_count > 0) {
        size_t points = (size_t)place->point_count;
        locator->points = malloc(points * sizeof *locator->points);
        locator->region_points = malloc(points * sizeof *locator->region_points);
        locator->region_of = malloc(points * sizeof *locator->region_of);
        locator->points_by_region = malloc(points * sizeof *locator->points_by_region);
        locator->missed_count = calloc(points, sizeof *locator->missed_count);
        if (!locator->points || !locator->region_points || !locator->region_of || !locator->points_by_region ||
            !locator->missed_count)
            return fail(ERR_MEMORY, "no memory to find a camera in the place");
        memcpy(locator->points, place->points, points * sizeof *locator->points);
        memset(locator->missed_count, UNKNOWN_MISSED_COUNT, points);
        locator->point_count = place->point_count;
    }
    locator->tag_count = place->tag_count;
    if (locator->tag_count)
        memcpy(locator->tags, place->tags, (n - 1) * sizeof *locator->tags);
    for (int32_t i = 0; i < locator->tag_count; i++)
        if (!tag_pattern(locator->tags[i].id, &locator->patterns[i]))
            return fail(ERR_INPUT, "the place's tag %d is not of the family tag36h11, which ends at %d",
                        (int)locator->tags[i].id, TAG_ID_COUNT - 1);
    enum status status = tag_refiner_open(&locator->refiner, &locator->lens);
    if (status == OK)
        status = klt_pyramid_open(&locator->pyramid, locator->lens.width, locator->lens.height);
    if (status == OK)
        status = tag_detector_open(&locator->detector, locator->options.quad_decimate);
    const double coarse = 2 * locator->options.quad_decimate;
    return status == OK && coarse <= TAG_MAX_DECIMATE ? tag_detector_open(&locator->coarse_detector, coarse) : status;
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

void locator_set_motion_prior(struct locator *locator, const double velocity[6], const double covariance[36])
{
    locator->expected = shutter_motion_prior(velocity, covariance);
}

const struct lens *locator_lens(const struct locator *locator) { return &locator->lens; }

int locator_seen_tags(const struct locator *locator, int32_t *ids, int capacity)
{
    int count = 0;
    for (int i = 0; i < locator->observed_count; i++) {
        const int32_t id = locator->tags[locator->observed_tag[i]].id;
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

double locator_depth_scale(const struct locator *locator)
{
    double sum = 0, weights = 0;
    for (int i = 0; i < locator->observed_count; i++) {
        const struct tag_depth *depth = &locator->depths[i];
        struct pose two[2];
        const int n = depth->count ? planar_poses(locator->tags[locator->observed_tag[i]].side_m,
                                                  locator->observations[i].ray, two)
                                   : 0;
        if (!n)
            continue;
        double measured = 0, z = two[0].translation.z;
        for (int32_t k = 0; k < depth->count; k++)
            measured += depth->sample[k].z / depth->count;
        z = n > 1 ? (z + two[1].translation.z) / 2 : z;
        const double side = locator->tags[locator->observed_tag[i]].side_m / z;
        sum += side * side * measured / z;
        weights += side * side;
    }
    return weights > 0 ? sum / weights : 0;
}

bool locator_focal_is_wrong(const struct locator *locator, double *scale)
{
    return focal_estimate_is_wrong(&locator->focal, scale);
}
