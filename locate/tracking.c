// Tracking: the pose of an image from the tags and landmarks of the last one. The tracks' pose (precise, drifts) is
// fused with the pose that the map gives (locate/pose_fusion.h); each track's reprojection error against the fused pose
// is estimated as a bias that the next image's pose does not have to explain.
#include "base/linear_algebra.h"
#include "locate/locator_internal.h"

#include <string.h>

// ---------------------------------------------------------------- locator tracks

// Starting and dropping the locator's tracks.

struct vec3 locator_point_in_camera(const struct locator *locator, const struct pose *camera_from_world,
                                    struct vec3 world, double time_s)
{
    return shutter_apply_motion(locator->motion, time_s, pose_apply(*camera_from_world, world));
}

void locator_add_track(struct locator *locator, int32_t point, struct vec3 world, const double seen[3], struct pixel at,
                       const struct pose *camera_from_world)
{
    if (locator->track_count == LOCATOR_MAX_TRACKS)
        return;
    struct point_track *t = &locator->tracks[locator->track_count];
    double time_s = shutter_row_time(&locator->lens, at.y);
    struct vec3 p = locator_point_in_camera(locator, camera_from_world, world, time_s),
                ray = lens_ray(&locator->lens, at);
    *t = (struct point_track){.point = point, .world = world, .at = at, .ray = ray, .time_s = time_s};
    memcpy(t->seen, seen, sizeof t->seen);
    t->bias[0] = point < 0 ? 0 : locator->lens.fx * (ray.x - p.x / p.z);
    t->bias[1] = point < 0 ? 0 : locator->lens.fy * (ray.y - p.y / p.z);
    t->bias_variance = point < 0 ? LOCATOR_CORNER_PX * LOCATOR_CORNER_PX : LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX;
    t->noise[0] = t->noise[2] = LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX;
    t->template_view = v3_sub(pose_inverse(*camera_from_world).translation, world);
    locator->track_count += klt_patch_extract(&locator->pyramid, at, &t->patch);
}

void locator_drop_track(struct locator *locator, int i)
{
    locator->track_count--;
    if (i < locator->track_count)
        locator->tracks[i] = locator->tracks[locator->track_count];
}

// ---------------------------------------------------------------- landmark activation

// Landmark activation: landmarks that come into view while a camera is tracked become tracks. Feature extraction and
// matching are expensive, so only one or two small regions of each image are searched: where most tracks are likely to
// be gained.

enum {
    // Chosen by hand.
    MISSING_PER_REGION = 20, // one region is searched for every so many missing tracks
    MAX_SEARCHES = 2,        // regions of one image, so that each image costs about the same
    CELLS_PER_REGION = 10,   // along the side of a region; each counts as one track to be gained
    CELLS_X = LOCATOR_REGIONS_X * CELLS_PER_REGION,
    CELLS_Y = LOCATOR_REGIONS_Y * CELLS_PER_REGION,
    MAX_MISSED_COUNT = 15, // bounds how little a landmark that is never found is expected to gain
    NO_POINT = 255,        // in a cell without landmarks
};
static const double MIN_DISTANCE_PX = 5; // tracks nearer to each other are redundant; chosen by hand
static const float MIN_GAIN = 1;         // expected new tracks, times images waited, that are worth a search

static bool is_crowded(const struct locator *locator, struct pixel at)
{
    for (int i = 0; i < locator->track_count; i++)
        if (fabs(locator->tracks[i].at.x - at.x) < MIN_DISTANCE_PX &&
            fabs(locator->tracks[i].at.y - at.y) < MIN_DISTANCE_PX)
            return true;
    return false;
}

void locator_add_landmark_tracks(struct locator *locator, int found, const struct pose *camera_from_world)
{
    for (int i = 0; i < found && locator->track_count < LOCATOR_MAX_TRACKS; i++) {
        const struct feature *f = &locator->index.features[locator->matches[i].feature];
        locator->missed_count[locator->matches[i].point] = 0;
        double seen[3];
        if (is_crowded(locator, f->at))
            continue;
        landmark_covariance(&locator->points[locator->matches[i].point], f, &locator->lens, camera_from_world, seen);
        locator_add_track(locator, locator->matches[i].point, locator->points[locator->matches[i].point].world, seen,
                          f->at, camera_from_world);
    }
}

// Where in the image landmarks should be seen.
struct search_gain {
    // Expected new tracks of a search in each region, times the images since the last one there.
    float gain[LOCATOR_REGIONS];
    uint8_t missed_count[CELLS_Y][CELLS_X]; // of the likeliest landmark in each cell, or NO_POINT
};

// The cell of a pixel, counted along the rows; -1: outside the image.
static int cell_of(const struct lens *lens, struct pixel at)
{
    int x = (int)(at.x * CELLS_X / lens->width), y = (int)(at.y * CELLS_Y / lens->height);
    return at.x < 0 || at.y < 0 || x >= CELLS_X || y >= CELLS_Y ? -1 : y * CELLS_X + x;
}

static int region_of_cell(int cell)
{
    return cell / CELLS_X / CELLS_PER_REGION * LOCATOR_REGIONS_X + cell % CELLS_X / CELLS_PER_REGION;
}

// Sorts the landmarks that should be seen by the region of the image in which they are.
static void sort_into_regions(struct locator *locator, const struct pose *camera_from_world, struct search_gain *out)
{
    double r[3][3];
    const struct vec3 *t = &camera_from_world->translation;
    int32_t in_region[LOCATOR_REGIONS + 1] = {0};
    uint8_t *missed_count = &out->missed_count[0][0];
    memset(missed_count, NO_POINT, sizeof out->missed_count);
    quat_to_matrix(camera_from_world->rotation, r);
    for (int32_t i = 0; i < locator->point_count; i++) {
        const struct vec3 w = locator->points[i].world;
        struct vec3 p = {r[0][0] * w.x + r[0][1] * w.y + r[0][2] * w.z + t->x,
                         r[1][0] * w.x + r[1][1] * w.y + r[1][2] * w.z + t->y,
                         r[2][0] * w.x + r[2][1] * w.y + r[2][2] * w.z + t->z};
        int cell = locator_in_image(&locator->lens, p) ? cell_of(&locator->lens, lens_project(&locator->lens, p)) : -1;
        locator->region_of[i] = cell < 0 ? -1 : region_of_cell(cell);
        if (cell < 0)
            continue;
        missed_count[cell] =
            locator->missed_count[i] < missed_count[cell] ? locator->missed_count[i] : missed_count[cell];
        in_region[locator->region_of[i] + 1]++;
    }
    for (int i = 0; i < LOCATOR_REGIONS; i++)
        in_region[i + 1] += in_region[i];
    memcpy(locator->region_start, in_region, sizeof locator->region_start);
    for (int32_t i = 0; i < locator->point_count; i++)
        if (locator->region_of[i] >= 0)
            locator->points_by_region[in_region[locator->region_of[i]]++] = i;
}

// Cells that a track covers gain nothing.
static void update_gain(struct locator *locator, struct search_gain *gain)
{
    uint8_t *missed_count = &gain->missed_count[0][0];
    for (int i = 0; i < locator->track_count; i++) {
        int cell = cell_of(&locator->lens, locator->tracks[i].at);
        if (cell >= 0)
            missed_count[cell] = NO_POINT;
    }
    memset(gain->gain, 0, sizeof gain->gain);
    for (int i = 0; i < CELLS_X * CELLS_Y; i++)
        if (missed_count[i] != NO_POINT)
            gain->gain[region_of_cell(i)] += 1.0f / (float)(1 + missed_count[i]);
    for (int i = 0; i < LOCATOR_REGIONS; i++)
        gain->gain[i] *= (float)++locator->frames_unsearched[i];
}

// New landmarks in one region.
static enum status search_region(struct locator *locator, int region, const uint16_t *depth,
                                 const struct pose *camera_from_world)
{
    const int32_t *which = locator->points_by_region + locator->region_start[region];
    int32_t count = locator->region_start[region + 1] - locator->region_start[region];
    enum status status = locator_extract_region_features(locator, region, depth);
    if (status != OK)
        return status;
    for (int32_t i = 0; i < count; i++) {
        locator->region_points[i] = locator->points[which[i]];
        locator->missed_count[which[i]] += locator->missed_count[which[i]] < MAX_MISSED_COUNT;
    }
    const struct match_query query = {
        .points = locator->region_points, .point_count = count, .index = &locator->index, .lens = &locator->lens};
    int found = landmarks_match(&query, (struct match_window){LANDMARK_NARROW_PX, false}, locator->motion,
                                camera_from_world, locator->matches, FEATURES_MAX);
    for (int i = 0; i < found; i++)
        locator->matches[i].point = which[locator->matches[i].point];
    locator_add_landmark_tracks(locator, found, camera_from_world);
    return OK;
}

enum status locator_activate_landmarks(struct locator *l, const uint16_t *depth, const struct pose *camera_from_world)
{
    struct search_gain e;
    int missing = l->options.points - l->track_count,
        searches = (missing + MISSING_PER_REGION - 1) / MISSING_PER_REGION;
    searches = searches < MAX_SEARCHES ? searches : MAX_SEARCHES;
    if (searches <= 0 || !l->point_count)
        return OK;
    sort_into_regions(l, camera_from_world, &e);
    update_gain(l, &e);
    while (searches-- > 0) {
        int best = 0;
        for (int i = 1; i < LOCATOR_REGIONS; i++)
            if (e.gain[i] > e.gain[best])
                best = i;
        if (e.gain[best] < MIN_GAIN)
            break;
        enum status status = search_region(l, best, depth, camera_from_world);
        if (status != OK)
            return status;
        e.gain[best] = 0;
        l->frames_unsearched[best] = 0;
    }
    return OK;
}

// ---------------------------------------------------------------- tracking

// Chosen by hand, all of them.
enum { TAG_SAMPLES = 800, MIN_TAG_SAMPLES = 200 }; // pixels sampled of all tags together; of each at least
enum { MIN_TRACKS = 15 };                          // fewer landmarks are no basis for a pose, with or without a tag
static const double OUTLIER_SIGMA = 4;             // a track with a larger Mahalanobis distance is dropped
static const double MIN_TRACKING_PX = 0.05;        // least tracking noise, standard deviation
enum { NOISE_FRAMES = 10 };                        // length of the running mean of the tracking noise, images
// When so many tracks are found this near to the guess, the others are looked for only there.
enum { GOOD_GUESS_TRACKS = 24 };
static const double GOOD_GUESS_PX = 2;
static const double CHANGE_PX = 0.05; // random walk of a track's bias, each image
// A patch is cut again once the viewpoint has moved by this share of its distance.
static const double NEW_TEMPLATE_ANGLE = 0.08;

// The corners of the tags used, by which the tags are found in the next image.
static void add_corners(struct locator *locator, const struct pnp_tag *tags, const struct pose *camera_from_world)
{
    for (int i = 0; i < locator->observed_count; i++) {
        struct vec3 world[4];
        const double seen[3] = {LOCATOR_CORNER_PX * LOCATOR_CORNER_PX, 0, LOCATOR_CORNER_PX * LOCATOR_CORNER_PX};
        place_tag_corners(&locator->tags[locator->observed_tag[i]], world);
        for (int k = 0; k < 4 && tags[i].used; k++)
            locator_add_track(locator, -1, world[k], seen,
                              lens_project(&locator->lens, locator->observations[i].ray[k]), camera_from_world);
    }
}

// Reprojection errors of a tag's corners, ideal pixels.
static void tag_corner_errors(const struct locator *locator, int i, const struct pose *camera_from_world, double out[8])
{
    struct vec3 world[4];
    place_tag_corners(&locator->tags[locator->observed_tag[i]], world);
    for (int k = 0; k < 4; k++) {
        struct vec3 p =
            locator_point_in_camera(locator, camera_from_world, world[k], locator->observations[i].time_s[k]);
        out[2 * k] = locator->lens.fx * (locator->observations[i].ray[k].x - p.x / p.z);
        out[2 * k + 1] = locator->lens.fy * (locator->observations[i].ray[k].y - p.y / p.z);
    }
}

// Updates each tag's biases by the tracks' pose, and makes them relative to `best`, the fused pose.
static void update_tag_biases(struct locator *locator, const struct pnp_tag *tags, const struct pose *tracked,
                              const struct pose *best)
{
    bool seen[PNP_MAX_TAGS] = {false};
    for (int32_t k = 0; k < locator->tag_count; k++) {
        int i = 0;
        while (i < locator->observed_count && (locator->observed_tag[i] != k || !tags[i].used))
            i++;
        if (i == locator->observed_count)
            locator->tag_tracks[k].known = false;
        else
            seen[i] = true;
    }
    for (int i = 0; i < locator->observed_count; i++) {
        struct tag_track *t = &locator->tag_tracks[locator->observed_tag[i]];
        double at[8], fused[8], variance = t->known ? t->bias_variance + CHANGE_PX * CHANGE_PX : 1e6;
        double gain = variance / (variance + LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX);
        if (!seen[i])
            continue;
        tag_corner_errors(locator, i, tracked, at);
        tag_corner_errors(locator, i, best, fused);
        for (int k = 0; k < 8; k++) {
            t->bias[k] = t->known ? t->bias[k] : at[k];
            t->bias[k] += gain * (at[k] - t->bias[k]) + fused[k] - at[k];
        }
        t->bias_variance = (1 - gain) * variance;
        t->known = true;
    }
}

void locator_start_tracks(struct locator *locator, const struct pnp_tag *tags, int agree,
                          const struct pose *camera_from_world, const double covariance[36])
{
    static const double none[36];
    klt_pyramid_build(&locator->pyramid, locator->gray);
    locator->track_count = 0;
    locator->last = *camera_from_world;
    locator->last_motion = locator->frame_motion;
    for (int32_t k = 0; k < locator->tag_count; k++)
        locator->tag_tracks[k].known = false;
    update_tag_biases(locator, tags, camera_from_world, camera_from_world);
    pose_fusion_start(&locator->fusion, covariance, none);
    add_corners(locator, tags, camera_from_world);
    locator_add_landmark_tracks(locator, agree, camera_from_world);
    for (int i = 0; i < locator->track_count; i++)
        locator->tracks[i].fused = true;
}

// Finds the tracks in the new image; those not found are dropped.
static void find_tracks(struct locator *locator, const struct pose *guess)
{
    double farthest = 0; // of a track from where the guess has it
    for (int i = 0; i < locator->track_count;) {
        struct point_track *t = &locator->tracks[i];
        struct vec3 before = pose_apply(locator->last, t->world), now = pose_apply(*guess, t->world);
        if (!locator_in_image(&locator->lens, before) || !locator_in_image(&locator->lens, now)) {
            locator_drop_track(locator, i);
            continue;
        }
        // The predicted motion is more accurate than the predicted position.
        struct pixel a = shutter_project(&locator->lens, locator->motion ? &locator->last_motion : NULL, before),
                     b = shutter_project(&locator->lens, locator->motion, now);
        const struct pixel guessed = {t->at.x + b.x - a.x, t->at.y + b.y - a.y};
        struct pixel at = guessed;
        bool near_guess = i >= GOOD_GUESS_TRACKS && farthest < GOOD_GUESS_PX;
        if (!(near_guess && klt_patch_track(&locator->pyramid, &t->patch, true, &at)) &&
            !klt_patch_track(&locator->pyramid, &t->patch, false, &at)) {
            locator_drop_track(locator, i);
            continue;
        }
        if (!near_guess)
            farthest = fmax(farthest, hypot(at.x - guessed.x, at.y - guessed.y));
        t->at = at;
        t->ray = lens_ray(&locator->lens, at);
        t->time_s = shutter_row_time(&locator->lens, at.y);
        i++;
    }
}

enum constraint_set {
    TAG_CORNERS = 1, // with tag corners
    UNBIASED = 2,    // less the biases
    FUSED = 4,       // only those that took part in the map's last pose
    NOISE = 8,       // without error, with the covariance of the tracking noise
    DRIFT = 16,      // without error, with the variance of the biases' change
};

// Standard deviation by which a track's bias changes in the next image, pixels: the landmark's distance in the map is
// about as accurate as a depth sample, and it is now seen from elsewhere.
static double change_px(const struct locator *locator, const struct point_track *track,
                        const struct pose *camera_from_world)
{
    struct vec3 from = v3_sub(pose_inverse(*camera_from_world).translation, track->world),
                before = v3_sub(pose_inverse(locator->last).translation, track->world);
    double z = v3_length(from), aside = v3_length(v3_cross(from, before)) / (z * v3_length(before));
    return hypot(CHANGE_PX, locator->lens.fx / z * depth_absolute_sigma_m(z) * aside);
}

// The tracks as points of a pose problem. Returns how many.
static int make_constraints(const struct locator *locator, const uint16_t *depth, enum constraint_set what,
                            const struct pose *camera_from_world, struct pnp_point *out)
{
    int count = 0;
    for (int i = 0; i < locator->track_count; i++) {
        const struct point_track *t = &locator->tracks[i];
        if ((t->point < 0 && !(what & TAG_CORNERS)) || ((what & FUSED) && !t->fused))
            continue;
        struct pnp_point *p = &out[count++];
        *p = (struct pnp_point){.world = t->world, .x = t->ray.x, .y = t->ray.y, .time_s = t->time_s};
        if (depth && t->point >= 0) {
            p->z = feature_depth(&locator->lens, depth, t->at);
            p->z_variance = landmark_depth_variance(&locator->points[t->point], camera_from_world);
        }
        memcpy(p->covariance, t->seen, sizeof p->covariance);
        if (what & UNBIASED) {
            p->x -= t->bias[0] / locator->lens.fx;
            p->y -= t->bias[1] / locator->lens.fy;
            p->sigma_px = sqrt(t->bias_variance);
            memcpy(p->covariance, t->noise, sizeof p->covariance);
        }
        if (what & (NOISE | DRIFT)) {
            struct vec3 at = locator_point_in_camera(locator, camera_from_world, t->world, t->time_s);
            p->x = at.x / at.z;
            p->y = at.y / at.z;
            p->sigma_px = what & NOISE ? 0 : change_px(locator, t, camera_from_world);
            memset(p->covariance, 0, sizeof p->covariance);
            if (what & NOISE)
                memcpy(p->covariance, t->noise, sizeof p->covariance);
        }
    }
    return count;
}

// Drops the tracks that disagree with the pose. Returns how many landmarks are left.
static int drop_outliers(struct locator *locator, const struct pose *camera_from_world)
{
    int points = 0;
    for (int i = 0; i < locator->track_count;) {
        const struct point_track *t = &locator->tracks[i];
        struct pnp_point p = {.world = t->world,
                              .x = t->ray.x,
                              .y = t->ray.y,
                              .covariance = {t->seen[0], t->seen[1], t->seen[2]},
                              .time_s = t->time_s};
        if (!(pnp_point_error(&p, locator->motion, camera_from_world, locator->lens.fx, locator->lens.fy) <
              OUTLIER_SIGMA)) {
            locator_drop_track(locator, i);
            continue;
        }
        points += t->point >= 0;
        i++;
    }
    return points;
}

// Updates each track's bias by the tracks' pose, and makes it relative to `best`, the fused pose.
static void update_track_biases(struct locator *locator, const struct pose *tracked, const struct pose *best)
{
    for (int i = 0; i < locator->track_count; i++) {
        struct point_track *t = &locator->tracks[i];
        struct vec3 p = locator_point_in_camera(locator, tracked, t->world, t->time_s),
                    q = locator_point_in_camera(locator, best, t->world, t->time_s);
        double change = change_px(locator, t, tracked), variance = t->bias_variance + change * change;
        double gain = variance / (variance + (t->noise[0] + t->noise[2]) / 2);
        double off_x = locator->lens.fx * (t->ray.x - p.x / p.z) - t->bias[0],
               off_y = locator->lens.fy * (t->ray.y - p.y / p.z) - t->bias[1];
        // squared innovation, less what the bias's own uncertainty explains
        const double now[3] = {fmax(off_x * off_x * (1 - gain), MIN_TRACKING_PX * MIN_TRACKING_PX),
                               off_x * off_y * (1 - gain),
                               fmax(off_y * off_y * (1 - gain), MIN_TRACKING_PX * MIN_TRACKING_PX)};
        for (int k = 0; k < 3; k++)
            t->noise[k] += (now[k] - t->noise[k]) / NOISE_FRAMES;
        t->bias[0] += gain * off_x + locator->lens.fx * (p.x / p.z - q.x / q.z);
        t->bias[1] += gain * off_y + locator->lens.fy * (p.y / p.z - q.y / q.z);
        t->bias_variance = (1 - gain) * variance;
        t->fused = true;
    }
}

// Prepares the tracks for the next image: corners of the tags, patches as they look from here, and new landmarks where
// few are left.
static enum status prepare_next_frame(struct locator *locator, const struct pnp_tag *tags, const uint16_t *depth,
                                      const struct pose *camera_from_world)
{
    struct vec3 eye = pose_inverse(*camera_from_world).translation;
    for (int i = 0; i < locator->track_count;) {
        struct point_track *t = &locator->tracks[i];
        struct vec3 from = v3_sub(eye, t->world);
        bool changed = t->point >= 0 && v3_distance(from, t->template_view) > NEW_TEMPLATE_ANGLE * v3_length(from);
        if (changed)
            t->template_view = from;
        if (t->point < 0 || (changed && !klt_patch_extract(&locator->pyramid, t->at, &t->patch)))
            locator_drop_track(locator, i);
        else
            i++;
    }
    locator->last = *camera_from_world;
    locator->last_motion = locator->frame_motion;
    enum status status = locator_activate_landmarks(locator, depth, camera_from_world);
    add_corners(locator, tags, camera_from_world);
    return status;
}

// Tags that were also in the last image.
struct known_tags {
    struct pnp_tag tags[PNP_MAX_TAGS];
    int count;
};

// The tags that were also in the last image, less their biases.
static void correct_tags(struct locator *locator, const struct pnp_tag *tags, struct known_tags *known)
{
    struct pnp_tag *out = known->tags;
    int count = 0;
    for (int i = 0; i < locator->observed_count; i++) {
        const struct tag_track *t = &locator->tag_tracks[locator->observed_tag[i]];
        if (!t->known || !tags[i].used)
            continue;
        locator->corrected[count] = locator->observations[i];
        for (int k = 0; k < 4; k++) {
            locator->corrected[count].ray[k].x -= t->bias[2 * k] / locator->lens.fx;
            locator->corrected[count].ray[k].y -= t->bias[2 * k + 1] / locator->lens.fy;
        }
        out[count] = tags[i];
        out[count].depth = NULL;
        out[count].covariance = NULL; // the map's error is part of the bias
        out[count].seen = &locator->corrected[count];
        count++;
    }
    known->count = count;
}

static struct pose_problem tracks_problem(const struct locator *locator, struct known_tags *known,
                                          const struct pnp_point *points, int point_count)
{
    struct pose_problem problem = locator_problem(locator, known->tags, points, point_count);
    problem.tag_count = known->count;
    return problem;
}

// The small motion from one camera_from_world to another.
static void pose_difference(const struct pose *from, const struct pose *to, double out[6])
{
    struct pose by = pose_multiply(*to, pose_inverse(*from));
    struct vec3 rotation = quat_to_rotation_vector(by.rotation);
    const double d[6] = {rotation.x, rotation.y, rotation.z, by.translation.x, by.translation.y, by.translation.z};
    memcpy(out, d, sizeof d);
}

// That part of the information of the map's pose that the last image had, too.
static void shared_information(const struct locator *locator, const uint16_t *depth, struct pnp_tag *tags,
                               const struct pose *map, struct pose_measurement *measurement)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    struct pnp_tag old[PNP_MAX_TAGS];
    double all[36], inverse[36];
    memset(measurement->map_information, 0, sizeof measurement->map_information);
    struct pose_problem problem =
        locator_problem(locator, tags, points, make_constraints(locator, depth, 0, map, points));
    pnp_information(&problem, map, all);
    if (!invert_symmetric(all, 6, inverse))
        return;
    for (int i = 0; i < locator->observed_count; i++) {
        old[i] = tags[i];
        old[i].used = tags[i].used && locator->tag_tracks[locator->observed_tag[i]].known;
    }
    problem = locator_problem(locator, old, points, make_constraints(locator, depth, FUSED, map, points));
    pnp_information(&problem, map, measurement->map_information);
    for (int i = 0; i < 36; i++) // the scale of pnp_covariance's residuals holds for both
        measurement->map_information[i] *= inverse[0] / measurement->map_covariance[0];
}

// Covariances of the tracks' pose: noise, independent from image to image, and drift, which adds up. known: the tags
// without biases. new_share: of the landmarks, those that are new. False: the tracks leave a motion undetermined.
static bool tracking_covariance(const struct locator *locator, struct known_tags *known, double new_share,
                                const struct pose *tracked, struct pose_measurement *measurement)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    double information[36];
    struct pose_problem problem =
        tracks_problem(locator, known, points, make_constraints(locator, NULL, NOISE, tracked, points));
    pnp_information(&problem, tracked, information);
    if (!invert_symmetric(information, 6, measurement->noise))
        return false;
    problem = tracks_problem(locator, known, points, make_constraints(locator, NULL, DRIFT, tracked, points));
    pnp_information(&problem, tracked, information);
    if (!invert_symmetric(information, 6, measurement->drift))
        return false;
    // New tracks were placed by one image and share the error of its pose.
    for (int i = 0; i < 36; i++)
        measurement->drift[i] += new_share * new_share * measurement->noise[i];
    return true;
}

// The velocity from the tracks becomes the prior for the map's pose.
static void update_velocity_prior(struct locator *locator, struct known_tags *known, const struct pose *tracked)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    const struct pose_problem problem =
        tracks_problem(locator, known, points, make_constraints(locator, NULL, UNBIASED, tracked, points));
    pnp_update_velocity_prior(&problem, tracked);
}

// Fuses the tracks' pose with the one that the map gives by itself. False: what is in view leaves a motion
// undetermined.
static bool fuse_with_map(struct locator *locator, const uint16_t *depth, struct pnp_tag *tags,
                          const struct pose *tracked, struct pose_measurement *measurement, struct pose *best)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    double by[6];
    struct pose map = *tracked;
    struct shutter_motion moving = locator->frame_motion;
    struct pose_problem problem =
        locator_problem(locator, tags, points, make_constraints(locator, depth, 0, tracked, points));
    problem.motion = locator->motion ? &moving : NULL;
    pnp_refine(&problem, &map);
    if (!pose_finite(map) || !pnp_covariance(&problem, &map, measurement->map_covariance))
        return false;
    shared_information(locator, depth, tags, &map, measurement);
    pose_difference(tracked, &map, measurement->offset);
    if (!pose_fusion_update(&locator->fusion, measurement, by))
        return false;
    struct pose small = {quat_from_rotation_vector(v3(by[0], by[1], by[2])), {by[3], by[4], by[5]}};
    *best = pose_multiply(small, *tracked);
    return pose_finite(*best);
}

bool locator_track_patches(struct locator *locator, const struct pose *camera_from_world)
{
    int before = locator->track_count;
    if (!before)
        return false;
    klt_pyramid_build(&locator->pyramid, locator->gray);
    find_tracks(locator, camera_from_world);
    return locator->track_count >= 4 && 3 * locator->track_count >= before;
}

// The pose by the tracks alone: roughly by tag corners and landmarks, then with the tags observed around it. tags,
// known: filled. Returns how many landmarks agree; 0: too few.
static int solve_tracks_alone(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                              struct pnp_tag *tags, struct known_tags *known, struct pose *pose)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    int corners = 0;
    struct pose_problem problem =
        locator_problem(locator, NULL, points, make_constraints(locator, depth, TAG_CORNERS | UNBIASED, pose, points));
    for (problem.point_px = 8; problem.point_px > 0.4; problem.point_px /= 4)
        pnp_refine(&problem, pose);
    for (int i = 0; i < locator->track_count; i++)
        corners += locator->tracks[i].point < 0;
    int each = TAG_SAMPLES / (corners / 4 + 1);
    locator->observed_count = 0;
    locator_detect_predicted(locator, color, depth, pose, each > MIN_TAG_SAMPLES ? each : MIN_TAG_SAMPLES, NULL);
    locator_pnp_tags(locator, tags);
    drop_outliers(locator, pose);
    locator_select_inlier_tags(locator, tags, locator->motion, pose);
    correct_tags(locator, tags, known);
    problem = tracks_problem(locator, known, points, make_constraints(locator, NULL, UNBIASED, pose, points));
    pnp_refine(&problem, pose);
    int agree = drop_outliers(locator, pose);
    return !pose_finite(*pose) || agree < MIN_TRACKS || 2 * agree < problem.point_count ? 0 : agree;
}

// The share of the landmarks that are not yet fused.
static double new_track_share(const struct locator *locator, int agree)
{
    double fused = 0;
    for (int i = 0; i < locator->track_count; i++)
        fused += locator->tracks[i].point >= 0 && locator->tracks[i].fused;
    return 1 - fused / agree;
}

// Adds the image to the estimate of an uncertain focal length, and that uncertainty to the covariance.
static void account_for_focal_length(struct locator *locator, struct pnp_tag *tags, const struct pose *pose,
                                     double covariance[36])
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    const struct pose_problem problem =
        locator_problem(locator, tags, points, make_constraints(locator, NULL, 0, pose, points));
    locator_observe_focal(locator, &problem, pose);
    locator_add_focal_variance(locator, &problem, pose, covariance);
}

enum status locator_solve_tracks(struct locator *l, const uint8_t *color, const uint16_t *depth, struct pose pose,
                                 struct location *out)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct known_tags known;
    struct pose_measurement seen;
    double covariance[36];
    int agree = solve_tracks_alone(l, color, depth, tags, &known, &pose);
    if (!agree)
        return NOTHING;
    struct pnp_solution found = {.used = locator_select_inlier_tags(l, tags, l->motion, &pose)};
    if (!tracking_covariance(l, &known, new_track_share(l, agree), &pose, &seen))
        return NOTHING;
    if (l->motion) // before the map's biased points take part
        update_velocity_prior(l, &known, &pose);
    if (!fuse_with_map(l, depth, tags, &pose, &seen, &found.camera_from_world))
        return NOTHING;
    found.other = found.camera_from_world;
    found.rms_px = locator_rms(l, tags, &found.camera_from_world);
    pose_fusion_covariance(&l->fusion, covariance);
    if (l->given_lens.focal_sigma > 0)
        account_for_focal_length(l, tags, &found.camera_from_world, covariance);
    if (!locator_fill_result(l, &found, agree, covariance, seen.noise, out))
        return NOTHING;
    update_track_biases(l, &pose, &found.camera_from_world);
    update_tag_biases(l, tags, &pose, &found.camera_from_world);
    return prepare_next_frame(l, tags, depth, &found.camera_from_world);
}

enum status locator_track(struct locator *l, const uint8_t *color, const uint16_t *depth, struct pose guess,
                          struct location *out)
{
    struct pose pose = pose_inverse(guess);
    if (!l->track_count || !pose_finite(guess))
        return NOTHING;
    locator_begin_frame(l, color);
    return locator_track_patches(l, &pose) ? locator_solve_tracks(l, color, depth, pose, out) : NOTHING;
}
