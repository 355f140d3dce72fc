#include "locate/locator_internal.h"
#include "locate/relocalization.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

// Tags smaller than this many pixels along their shortest side are not searched
// for by prediction: their pattern is a blur.
static const double MIN_PREDICTED_PX = 10;
// A predicted tag must look the part: nothing has read its number.
static const double PREDICTED_MIN_CORRELATION = 0.8;

// A point that was never found is as likely as one that was, and then three times not.
enum { UNKNOWN_MISSED_COUNT = 3 };

enum { MIN_TRACKED = 30, MAX_TRACKED = 200 }; // locator_options.points

// Without a tag, so many points must agree; of fewer than SURELY_ENOUGH at least one in ONE_IN of all that
// should be in sight: a thing that stands elsewhere too, or came into a bent map twice, leads to a
// pose from which nothing else is where it should be.
enum { MIN_WITHOUT_TAGS = 20, SURELY_ENOUGH = 40, ONE_IN = 16 };
// So many times as many points as agree with tags outvote them.
enum { OUTVOTE_FACTOR = 3 };

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
    if (place->tag_count <= 0 && place->point_count < MIN_WITHOUT_TAGS)
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
    const double half_as_large = 2 * l->options.quad_decimate;
    return status == OK && half_as_large <= TAG_MAX_DECIMATE ? tag_detector_open(&l->coarse_detector, half_as_large)
                                                             : status;
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

static void add_observation(struct locator *l, const struct tag_observation *seen, int32_t which, const uint16_t *depth)
{
    l->observations[l->count] = *seen;
    l->which[l->count] = which;
    l->depths[l->count].count = 0;
    if (depth)
        tag_read_depth(seen, &l->lens, depth, &l->depths[l->count]);
    l->count++;
}

void locator_set_motion_prior(struct locator *l, const double speed[6], const double covariance[36])
{
    l->expected = shutter_motion_prior(speed, covariance);
}

void locator_begin_frame(struct locator *l, const uint8_t *color)
{
    locator_update_lens(l);
    gray_from_rgb(color, (size_t)l->lens.width * (size_t)l->lens.height, l->gray);
    l->frame_motion = l->expected;
    l->expected = shutter_motion_unknown();
}

// The tags that the detector sees.
static enum status detect_tags(struct locator *l, struct tag_detector *detector, const uint8_t *color,
                               const uint16_t *depth)
{
    struct tag_detection seen[PNP_MAX_TAGS];
    int count;
    l->count = 0;
    enum status status = tag_detector_detect(detector, &(struct gray_image){l->gray, l->lens.width, l->lens.height},
                                             seen, PNP_MAX_TAGS, &count);
    if (status != OK)
        return status;
    for (int i = 0; i < count; i++) {
        for (int32_t k = 0; k < l->tag_count; k++) {
            struct tag_observation fine;
            if (l->tags[k].id == seen[i].id &&
                tag_refine(l->refiner, color, seen[i].id, &l->patterns[k], seen[i].corner, &fine))
                add_observation(l, &fine, k, depth);
        }
    }
    return OK;
}

void locator_pnp_tags(const struct locator *l, struct pnp_tag *tags)
{
    for (int i = 0; i < l->count; i++) {
        const struct place_tag *tag = &l->tags[l->which[i]];
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

static enum status solve_from_tags(struct locator *l, struct pnp_tag *tags, struct pnp_solution *out)
{
    locator_pnp_tags(l, tags);
    return pnp_solve(tags, l->count, l->lens.fx, l->lens.fy, l->options.max_rms_px, l->motion, out);
}

// Where a tag must appear; false: not wholly in the picture, from behind, too small.
static bool predict_corners(const struct locator *l, const struct place_tag *tag, const struct pose *camera_from_world,
                            struct pixel corner[4])
{
    struct vec3 world[4];
    place_tag_corners(tag, world);
    struct vec3 centre = pose_apply(*camera_from_world, tag->world_from_tag.translation);
    struct quat turn = quat_multiply(camera_from_world->rotation, tag->world_from_tag.rotation);
    if (!(v3_dot(quat_rotate(turn, v3(0, 0, 1)), centre) < 0))
        return false;
    for (int k = 0; k < 4; k++) {
        struct vec3 p = pose_apply(*camera_from_world, world[k]);
        // A distortion polynomial means nothing far outside the picture.
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
    int before = l->count, predicted_count = 0;
    for (int32_t k = 0; k < l->tag_count && l->count < PNP_MAX_TAGS; k++) {
        bool there = false;
        for (int i = 0; i < l->count; i++)
            there = there || l->which[i] == k;
        struct pixel corner[4];
        struct tag_observation fine;
        if (there || !predict_corners(l, &l->tags[k], camera_from_world, corner))
            continue;
        predicted_count++;
        if (tag_refine_sampled(l->refiner, color, l->tags[k].id, &l->patterns[k], corner, most_pixels, &fine) &&
            fine.correlation > PREDICTED_MIN_CORRELATION)
            add_observation(l, &fine, k, depth);
    }
    if (missing)
        *missing = predicted_count - (l->count - before);
    return l->count - before;
}

// Natural points hold the pose where tags hold it badly: one tag far off, several
// in a row. Of two mirrored poses they tell the right one. How many agree; 0: too few.
static int refine_with_landmarks(struct locator *l, const struct pnp_tag *tags, bool with_depth, enum status *status,
                                 struct pnp_solution *found)
{
    const double *depths = with_depth ? l->feature_depths : NULL;
    struct pose first = found->camera_from_world, second = found->other;
    struct shutter_motion moving[2] = {found->motion, found->other_motion};
    int agree = 0, agree_second = 0;
    if (!landmarks_refine_pose(l->points, l->point_count, &l->index, depths, &l->lens, tags, l->count,
                               l->motion ? &moving[0] : NULL, &first, l->matches, FEATURES_MAX, &agree))
        agree = 0;
    if (*status == AMBIGUOUS &&
        landmarks_refine_pose(l->points, l->point_count, &l->index, depths, &l->lens, tags, l->count,
                              l->motion ? &moving[1] : NULL, &second, l->other_matches, FEATURES_MAX, &agree_second)) {
        if (agree_second > agree) {
            memcpy(l->matches, l->other_matches, sizeof l->matches);
            first = second;
            moving[0] = moving[1];
            agree = agree_second;
        }
    }
    if (!agree)
        return 0;
    // Points that drag the pose off the tags are points of something that moved.
    for (int i = 0; i < l->count; i++)
        if (tags[i].used && !(pnp_tag_rms(&tags[i], l->motion ? &moving[0] : NULL, &first, l->lens.fx, l->lens.fy) <
                              l->options.max_rms_px))
            return 0;
    found->camera_from_world = first;
    found->motion = moving[0];
    *status = OK;
    return agree;
}

double locator_rms(const struct locator *l, const struct pnp_tag *tags, const struct pose *camera_from_world)
{
    double sum = 0;
    int used = 0;
    for (int i = 0; i < l->count; i++) {
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

enum status locator_extract_region_features(struct locator *l, int part, const uint16_t *depth)
{
    enum { BEYOND_PX = 24 }; // what the detector leaves out at edges, and more
    int width = l->lens.width, height = l->lens.height, count;
    int column = part % LOCATOR_REGIONS_X, row = part / LOCATOR_REGIONS_X;
    int left = column * width / LOCATOR_REGIONS_X - BEYOND_PX,
        right = (column + 1) * width / LOCATOR_REGIONS_X + BEYOND_PX;
    int top = row * height / LOCATOR_REGIONS_Y - BEYOND_PX, bottom = (row + 1) * height / LOCATOR_REGIONS_Y + BEYOND_PX;
    left = left > 0 ? left : 0, right = right < width ? right : width;
    top = top > 0 ? top : 0, bottom = bottom < height ? bottom : height;
    const struct image_region region = {left, top, right - left, bottom - top};
    enum status status =
        features_detect_region(l->gray, width, &region, l->features, 2 * FEATURES_MAX / LOCATOR_REGIONS, &count);
    return index_features(l, status, count, depth);
}

// How many points should be in sight, hidden ones and ones that look different from here counted in.
static int count_visible_landmarks(const struct locator *l, const struct pose *camera_from_world)
{
    int visible = 0;
    double wide = 0.5 * l->lens.width / l->lens.fx, high = 0.5 * l->lens.height / l->lens.fy;
    for (int32_t i = 0; i < l->point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, l->points[i].world);
        visible += p.z > 0.1 && fabs(p.x) < wide * p.z && fabs(p.y) < high * p.z;
    }
    return visible;
}

// Whether so many points are enough to believe the pose without a tag.
static bool enough_landmarks(const struct locator *l, int kept, const struct pose *camera_from_world)
{
    return kept >= MIN_WITHOUT_TAGS &&
           (kept >= SURELY_ENOUGH || ONE_IN * kept >= count_visible_landmarks(l, camera_from_world));
}

// Where no tag says anything. How many points agree, into `matches`; 0: no place.
static int solve_from_landmarks(struct locator *l, bool with_depth, struct landmark_match *matches,
                                struct pnp_solution *found)
{
    int agree = 0, kept = 0;
    struct pose pose;
    struct shutter_motion moving = l->frame_motion, *motion = l->motion ? &moving : NULL;
    int count = relocalize_match(l->points, l->point_count, &l->index, matches, FEATURES_MAX);
    if (!relocalize(l->points, &l->index, &l->lens, matches, count, motion, &pose, &agree) ||
        !landmarks_refine_pose(l->points, l->point_count, &l->index, with_depth ? l->feature_depths : NULL, &l->lens,
                               NULL, 0, motion, &pose, matches, FEATURES_MAX, &kept) ||
        !enough_landmarks(l, kept, &pose))
        return 0;
    *found = (struct pnp_solution){.camera_from_world = pose, .other = pose, .motion = moving};
    return kept;
}

// The tags that fit the pose found, and no others, are used.
static void select_inlier_tags(const struct locator *l, struct pnp_tag *tags, struct pnp_solution *found)
{
    const struct shutter_motion *motion = l->motion ? &found->motion : NULL;
    found->used = 0;
    for (int i = 0; i < l->count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, &found->camera_from_world, l->lens.fx, l->lens.fy);
        tags[i].used = tags[i].rms_px <= l->options.max_rms_px;
        found->used += tags[i].used;
    }
}

// Tags that the detector missed join in; what the points said of the pose stands.
static enum status solve_with_predicted(struct locator *l, struct pnp_tag *tags, bool with_depth, enum status status,
                                        int *agree, struct pnp_solution *found)
{
    struct pnp_solution again;
    if (*agree) { // tags that were moved may be more than those that agree with the points
        enum status sure = OK;
        memcpy(l->other_matches, l->matches, sizeof l->matches);
        locator_pnp_tags(l, tags);
        select_inlier_tags(l, tags, found);
        int now = refine_with_landmarks(l, tags, with_depth, &sure, found);
        if (now)
            *agree = now;
        else
            memcpy(l->matches, l->other_matches, sizeof l->matches);
        return sure;
    }
    enum status more = solve_from_tags(l, tags, &again);
    if (more == NOTHING || again.used < found->used)
        return status;
    *found = again;
    return more;
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
        .tags_rejected = l->count - found->used,
        .points_used = point_count,
        .position_sigma_m = sigma_m,
        .other = pose_inverse(found->other),
        .other_excess_cost = found->other_excess_cost,
    };
    memcpy(out->covariance, covariance, sizeof out->covariance);
    memcpy(out->noise, noise, sizeof out->noise);
    return true;
}

// A tag was hung elsewhere where it says a place from which hardly a point is where it should be, no more than happen
// to lie near, and points many times as many say another. Several tags that agree have to be outvoted.
static void check_against_landmarks(struct locator *l, bool with_depth, struct pnp_tag *tags, enum status *status,
                                    struct pnp_solution *found, int *agree)
{
    struct pnp_solution other;
    if (ONE_IN * *agree >= count_visible_landmarks(l, &found->camera_from_world))
        return;
    int kept = solve_from_landmarks(l, with_depth, l->other_matches, &other);
    if (!kept || kept < OUTVOTE_FACTOR * *agree || (found->used > 1 && kept < SURELY_ENOUGH))
        return;
    select_inlier_tags(l, tags, &other);
    memcpy(l->matches, l->other_matches, sizeof l->matches);
    *found = other;
    *agree = kept;
    *status = OK;
}

// From the tags that the detector sees, with the points around. *agree: how many of l->matches do.
static enum status localize_from_tags(struct locator *l, struct tag_detector *detector, const uint8_t *color,
                                      const uint16_t *depth, struct pnp_tag *tags, struct pnp_solution *found,
                                      int *agree)
{
    *agree = 0;
    enum status status = detect_tags(l, detector, color, depth);
    if (status != OK)
        return status;
    status = solve_from_tags(l, tags, found);
    if (locator_detect_rolling_shutter(l, tags, status == NOTHING ? NULL : found))
        status = solve_from_tags(l, tags, found);
    if (status != NOTHING && l->point_count)
        *agree = refine_with_landmarks(l, tags, depth != NULL, &status, found);
    if (status != NOTHING && l->point_count)
        check_against_landmarks(l, depth != NULL, tags, &status, found, agree);
    return status;
}

// The tags that must be in sight besides join in. *missing: how many are not there.
static enum status add_predicted_tags(struct locator *l, const uint8_t *color, const uint16_t *depth,
                                      struct pnp_tag *tags, enum status status, struct pnp_solution *found, int *agree,
                                      int *missing)
{
    struct shutter_motion expected = l->frame_motion;
    l->frame_motion = found->motion;
    int more = locator_detect_predicted(l, color, depth, &found->camera_from_world, INT_MAX, missing);
    l->frame_motion = expected;
    return more ? solve_with_predicted(l, tags, depth != NULL, status, agree, found) : status;
}

// The same from a picture half as large, which shows most tags in a quarter of the time; those that it does not show
// are looked for where they must be. NOTHING, too, where every pixel may tell more: nothing bears out what a tag says,
// tags contradict each other, or one is not where it must be, but hangs elsewhere or is hidden.
static enum status localize_coarse(struct locator *l, const uint8_t *color, const uint16_t *depth, struct pnp_tag *tags,
                                   struct pnp_solution *found, int *agree)
{
    int missing = 0;
    if (!l->coarse_detector)
        return NOTHING;
    enum status status = localize_from_tags(l, l->coarse_detector, color, depth, tags, found, agree);
    if (status == OK && (*agree || found->used > 1))
        status = add_predicted_tags(l, color, depth, tags, status, found, agree, &missing);
    if (status < 0)
        return status;
    bool sure = status == OK && (*agree || found->used > 1) && found->used == l->count && !missing;
    return sure ? OK : NOTHING;
}

// From tags and points alone, whatever was seen before. *agree: how many of l->matches do.
static enum status localize_from_scratch(struct locator *l, const uint8_t *color, const uint16_t *depth,
                                         struct pnp_tag *tags, struct pnp_solution *found, int *agree)
{
    *agree = 0;
    locator_begin_frame(l, color);
    enum status status = l->point_count ? locator_extract_features(l, depth) : OK;
    if (status == OK)
        status = localize_coarse(l, color, depth, tags, found, agree);
    if (status == NOTHING) {
        status = localize_from_tags(l, l->detector, color, depth, tags, found, agree);
        if (status == NOTHING) {
            l->count = 0; // tags that fit nothing
            *agree = l->point_count ? solve_from_landmarks(l, depth != NULL, l->matches, found) : 0;
            if (!*agree)
                return NOTHING;
            status = OK;
        }
        if (status >= 0)
            status = add_predicted_tags(l, color, depth, tags, status, found, agree, NULL);
    }
    if (status < 0)
        return status;
    l->frame_motion = found->motion;
    found->rms_px = locator_rms(l, tags, &found->camera_from_world);
    return status;
}

// A corner that is found in several copies of the picture is found wrong in all of them: each counts once. How
// many are left.
static int drop_duplicates(const struct locator *l, struct pnp_point *points, int count)
{
    static const double SAME_PX = 4;
    int kept = 0;
    for (int i = 0; i < count; i++) {
        bool again = false;
        for (int k = 0; k < kept && !again; k++)
            again = fabs(points[k].x - points[i].x) * l->lens.fx < SAME_PX &&
                    fabs(points[k].y - points[i].y) * l->lens.fy < SAME_PX;
        if (!again)
            points[kept++] = points[i];
    }
    return kept;
}

static enum status localize(struct locator *l, const uint8_t *color, const uint16_t *depth, bool again,
                            struct location *out)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct pnp_point points[FEATURES_MAX];
    struct pnp_solution found = {.used = 0};
    const struct lens *lens = &l->lens;
    double covariance[36] = {0}, widened[36];
    int agree, apart = 0;
    enum status status = localize_from_scratch(l, color, depth, tags, &found, &agree);
    if (status == OK || status == AMBIGUOUS) {
        landmark_correspondences(l->points, &l->index, depth ? l->feature_depths : NULL, lens, &found.camera_from_world,
                                 l->matches, agree, points);
        apart = drop_duplicates(l, points, agree);
        const bool known = pnp_covariance(tags, l->count, points, apart, lens->fx, lens->fy, l->motion,
                                          &found.camera_from_world, covariance);
        if (known && status == OK)
            focal_estimate_add(&l->focal, tags, l->count, points, apart, lens->fx, lens->fy, l->motion,
                               &found.camera_from_world);
        memcpy(widened, covariance, sizeof widened);
        locator_add_focal_variance(l, tags, points, apart, &found.camera_from_world, widened);
        if (!known || !locator_fill_result(l, &found, agree, widened, covariance, out))
            status = NOTHING;
        if (status == OK)
            locator_vote_moved_tags(l, tags, agree, &found.camera_from_world);
    }
    if (again && status == OK && locator_track_patches(l, &found.camera_from_world)) {
        enum status followed = locator_solve_tracks(l, color, depth, found.camera_from_world, out);
        if (followed == NOTHING)
            l->track_count = 0;
        return followed == NOTHING ? OK : followed;
    }
    l->track_count = 0;
    if (status == OK || status == AMBIGUOUS)
        locator_start_tracks(l, tags, agree, &found.camera_from_world, covariance);
    return status;
}

enum status locator_localize(struct locator *l, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize(l, color, depth, false, out);
}

enum status locator_relocalize(struct locator *l, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize(l, color, depth, true, out);
}

const struct lens *locator_lens(const struct locator *l) { return &l->lens; }

bool locator_focal_is_wrong(const struct locator *l, double *scale)
{
    return focal_estimate_is_wrong(&l->focal, scale);
}
