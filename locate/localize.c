// Localisation of one image: by tracking, or from scratch by tags from coarse to fine, landmarks around them, landmarks
// alone.
//
// Tracking: the pose of an image from the tags and landmarks of the last one. The tracks' pose (precise, drifts) is
// fused with the pose that the map gives (locate/pose_fusion.h); each track's reprojection error against the fused pose
// is estimated as a bias that the next image's pose does not have to explain.
#include "base/linear_algebra.h"
#include "locate/locator_internal.h"
#include "locate/relocalization.h"

#include <limits.h>
#include <string.h>

// ---------------------------------------------------------------- locator tracks

// Where a point is in camera axes at the time when its row is read.
static struct vec3 point_in_camera(const struct locator *locator, const struct pose *camera_from_world,
                                   struct vec3 world, double time_s)
{
    return shutter_apply_motion(locator->motion, time_s, pose_apply(*camera_from_world, world));
}

// Starts a track of something seen at a pixel, if there is space and enough texture. point, seen: as in struct
// point_track.
static void add_track(struct locator *locator, int32_t point, struct vec3 world, const double seen[3], struct pixel at,
                      const struct pose *camera_from_world)
{
    if (locator->track_count == LOCATOR_MAX_TRACKS)
        return;
    struct point_track *t = &locator->tracks[locator->track_count];
    double time_s = shutter_row_time(&locator->lens, at.y);
    struct vec3 p = point_in_camera(locator, camera_from_world, world, time_s), ray = lens_ray(&locator->lens, at);
    *t = (struct point_track){.point = point, .world = world, .at = at, .ray = ray, .time_s = time_s};
    memcpy(t->seen, seen, sizeof t->seen);
    t->bias[0] = point < 0 ? 0 : locator->lens.fx * (ray.x - p.x / p.z);
    t->bias[1] = point < 0 ? 0 : locator->lens.fy * (ray.y - p.y / p.z);
    t->bias_variance = point < 0 ? LOCATOR_CORNER_PX * LOCATOR_CORNER_PX : LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX;
    t->noise[0] = t->noise[2] = LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX;
    t->template_view = v3_sub(pose_inverse(*camera_from_world).translation, world);
    locator->track_count += klt_patch_extract(&locator->pyramid, at, &t->patch);
}

// Removes track i; the last one takes its index.
static void drop_track(struct locator *locator, int i)
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

// Features matched to landmarks become tracks, as far as there is space and none is near. found: of locator->matches.
static void add_landmark_tracks(struct locator *locator, int found, const struct pose *camera_from_world)
{
    for (int i = 0; i < found && locator->track_count < LOCATOR_MAX_TRACKS; i++) {
        const struct feature *f = &locator->index.features[locator->matches[i].feature];
        locator->missed_count[locator->matches[i].point] = 0;
        double seen[3];
        if (is_crowded(locator, f->at))
            continue;
        landmark_covariance(&locator->points[locator->matches[i].point], f, &locator->lens, camera_from_world, seen);
        add_track(locator, locator->matches[i].point, locator->points[locator->matches[i].point].world, seen, f->at,
                  camera_from_world);
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
    add_landmark_tracks(locator, found, camera_from_world);
    return OK;
}

// Searches a small part of the image, where most is to be gained, for new landmarks.
static enum status activate_landmarks(struct locator *locator, const uint16_t *depth,
                                      const struct pose *camera_from_world)
{
    struct search_gain e;
    int missing = locator->options.points - locator->track_count,
        searches = (missing + MISSING_PER_REGION - 1) / MISSING_PER_REGION;
    searches = searches < MAX_SEARCHES ? searches : MAX_SEARCHES;
    if (searches <= 0 || !locator->point_count)
        return OK;
    sort_into_regions(locator, camera_from_world, &e);
    update_gain(locator, &e);
    while (searches-- > 0) {
        int best = 0;
        for (int i = 1; i < LOCATOR_REGIONS; i++)
            if (e.gain[i] > e.gain[best])
                best = i;
        if (e.gain[best] < MIN_GAIN)
            break;
        enum status status = search_region(locator, best, depth, camera_from_world);
        if (status != OK)
            return status;
        e.gain[best] = 0;
        locator->frames_unsearched[best] = 0;
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
            add_track(locator, -1, world[k], seen, lens_project(&locator->lens, locator->observations[i].ray[k]),
                      camera_from_world);
    }
}

// Reprojection errors of a tag's corners, ideal pixels.
static void tag_corner_errors(const struct locator *locator, int i, const struct pose *camera_from_world, double out[8])
{
    struct vec3 world[4];
    place_tag_corners(&locator->tags[locator->observed_tag[i]], world);
    for (int k = 0; k < 4; k++) {
        struct vec3 p = point_in_camera(locator, camera_from_world, world[k], locator->observations[i].time_s[k]);
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

// After localising from scratch: starts tracks of what the image showed. agree: of locator->matches; covariance: of the
// pose.
static void start_tracks(struct locator *locator, const struct pnp_tag *tags, int agree,
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
    add_landmark_tracks(locator, agree, camera_from_world);
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
            drop_track(locator, i);
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
            drop_track(locator, i);
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
            struct vec3 at = point_in_camera(locator, camera_from_world, t->world, t->time_s);
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
            drop_track(locator, i);
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
        struct vec3 p = point_in_camera(locator, tracked, t->world, t->time_s),
                    q = point_in_camera(locator, best, t->world, t->time_s);
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
            drop_track(locator, i);
        else
            i++;
    }
    locator->last = *camera_from_world;
    locator->last_motion = locator->frame_motion;
    enum status status = activate_landmarks(locator, depth, camera_from_world);
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

// Finds the tracks in locator->gray near where the pose puts them. False: too few are found.
static bool track_patches(struct locator *locator, const struct pose *camera_from_world)
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

// The pose from the tracks, found so. As locator_track.
static enum status solve_tracks(struct locator *locator, const uint8_t *color, const uint16_t *depth, struct pose pose,
                                struct location *out)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct known_tags known;
    struct pose_measurement seen;
    double covariance[36];
    int agree = solve_tracks_alone(locator, color, depth, tags, &known, &pose);
    if (!agree)
        return NOTHING;
    struct pnp_solution found = {.used = locator_select_inlier_tags(locator, tags, locator->motion, &pose)};
    if (!tracking_covariance(locator, &known, new_track_share(locator, agree), &pose, &seen))
        return NOTHING;
    if (locator->motion) // before the map's biased points take part
        update_velocity_prior(locator, &known, &pose);
    if (!fuse_with_map(locator, depth, tags, &pose, &seen, &found.camera_from_world))
        return NOTHING;
    found.other = found.camera_from_world;
    found.rms_px = locator_rms(locator, tags, &found.camera_from_world);
    pose_fusion_covariance(&locator->fusion, covariance);
    if (locator->given_lens.focal_sigma > 0)
        account_for_focal_length(locator, tags, &found.camera_from_world, covariance);
    if (!locator_fill_result(locator, &found, agree, covariance, seen.noise, out))
        return NOTHING;
    update_track_biases(locator, &pose, &found.camera_from_world);
    update_tag_biases(locator, tags, &pose, &found.camera_from_world);
    return prepare_next_frame(locator, tags, depth, &found.camera_from_world);
}

enum status locator_track(struct locator *locator, const uint8_t *color, const uint16_t *depth, struct pose guess,
                          struct location *out)
{
    struct pose pose = pose_inverse(guess);
    if (!locator->track_count || !pose_finite(guess))
        return NOTHING;
    locator_begin_frame(locator, color);
    return track_patches(locator, &pose) ? solve_tracks(locator, color, depth, pose, out) : NOTHING;
}

// ---------------------------------------------------------------- localisation from scratch

// Without a tag, of fewer than SURELY_ENOUGH landmarks that agree at least one in ONE_IN of all that should be in view
// must agree: an object that is also elsewhere, or that a distorted map holds twice, gives a pose from which nothing
// else is where it should be. Chosen by hand.
enum { SURELY_ENOUGH = 40, ONE_IN = 16 };
// And however many agree, so many must look alike: within a narrow search chance offers a feature that differs by up to
// 80 bits to every other landmark, and a pose that gathers such features is metres off. Features of something else
// hardly ever differ by as few as 45. Chosen on the tests' small world, where right poses of clear pictures have 19 and
// more, wrong ones (of mirrored, overexposed and noisy pictures) mostly up to 13; and of those that look alike
// anywhere 37 % and more, against 29 and 36 %. Other walks were left out.
enum { ALIKE_BITS = 45, MIN_ALIKE = 14, ONE_IN_AGREES = 3 };
static const double AGREE_PX = 4; // at the finest pyramid level
// So many times as many landmarks as agree with the tags outvote them. Chosen by hand.
enum { OUTVOTE_FACTOR = 3 };

// One image and what has been found in it so far.
struct localization {
    const uint8_t *color;
    const uint16_t *depth; // or NULL
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct pnp_solution found;
    int agree;   // how many of the locator's matches agree with it
    int missing; // tags that must be in view but were not found
};

static struct match_query query_of(const struct locator *locator, bool with_depth, struct pnp_tag *tags)
{
    return (struct match_query){.points = locator->points,
                                .point_count = locator->point_count,
                                .index = &locator->index,
                                .depth = with_depth ? locator->feature_depths : NULL,
                                .lens = &locator->lens,
                                .tags = tags,
                                .tag_count = tags ? locator->observed_count : 0};
}

// The tags of the place that the detector sees.
static enum status detect_tags(struct locator *locator, struct tag_detector *detector,
                               const struct localization *localization)
{
    struct tag_detection seen[PNP_MAX_TAGS];
    int count;
    locator->observed_count = 0;
    enum status status =
        tag_detector_detect(detector, &(struct gray_image){locator->gray, locator->lens.width, locator->lens.height},
                            seen, PNP_MAX_TAGS, &count);
    if (status != OK)
        return status;
    for (int i = 0; i < count; i++) {
        for (int32_t k = 0; k < locator->tag_count; k++) {
            struct tag_observation fine;
            if (locator->tags[k].id == seen[i].id && tag_refine(locator->refiner, localization->color, seen[i].id,
                                                                &locator->patterns[k], seen[i].corner, &fine))
                locator_add_observation(locator, &fine, k, localization->depth);
        }
    }
    return OK;
}

static enum status solve_from_tags(struct locator *locator, struct pnp_tag *tags, struct pnp_solution *out)
{
    locator_pnp_tags(locator, tags);
    const struct pose_problem problem = locator_problem(locator, tags, NULL, 0);
    return pnp_solve(&problem, locator->options.max_rms_px, out);
}

// Landmarks constrain the pose where tags do so badly: one distant tag, several in a row. They also select one of two
// mirrored poses. Returns how many agree, into locator->matches; 0: too few, localization->found unchanged.
static int refine_with_landmarks(struct locator *locator, struct localization *localization, enum status *status)
{
    const struct match_query query = query_of(locator, localization->depth != NULL, localization->tags);
    struct pose first = localization->found.camera_from_world, second = localization->found.other;
    struct shutter_motion moving[2] = {localization->found.motion, localization->found.other_motion};
    int agree = 0, agree_second = 0;
    if (!landmarks_refine_pose(&query, locator->motion ? &moving[0] : NULL, &first, locator->matches, FEATURES_MAX,
                               &agree))
        agree = 0;
    if (*status == AMBIGUOUS && landmarks_refine_pose(&query, locator->motion ? &moving[1] : NULL, &second,
                                                      locator->other_matches, FEATURES_MAX, &agree_second)) {
        if (agree_second > agree) {
            memcpy(locator->matches, locator->other_matches, sizeof locator->matches);
            first = second;
            moving[0] = moving[1];
            agree = agree_second;
        }
    }
    if (!agree)
        return 0;
    // Landmarks that pull the pose away from the tags belong to something that moved.
    for (int i = 0; i < locator->observed_count; i++)
        if (localization->tags[i].used &&
            !(pnp_tag_rms(&localization->tags[i], locator->motion ? &moving[0] : NULL, &first, locator->lens.fx,
                          locator->lens.fy) < locator->options.max_rms_px))
            return 0;
    localization->found.camera_from_world = first;
    localization->found.motion = moving[0];
    *status = OK;
    return agree;
}

// How many landmarks are within the image, including hidden ones and ones that look different from here.
static int count_visible_landmarks(const struct locator *locator, const struct pose *camera_from_world)
{
    int visible = 0;
    double wide = 0.5 * locator->lens.width / locator->lens.fx, high = 0.5 * locator->lens.height / locator->lens.fy;
    for (int32_t i = 0; i < locator->point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, locator->points[i].world);
        visible += p.z > 0.1 && fabs(p.x) < wide * p.z && fabs(p.y) < high * p.z;
    }
    return visible;
}

// Of the matches that nothing but their looks made, and that look alike, a part must agree with the pose: those of a
// mirrored picture do not. matches: in the order of the bits that differ.
static bool enough_alike_agree(const struct locator *locator, const struct landmark_match *matches, int count,
                               const struct shutter_motion *motion, const struct pose *camera_from_world)
{
    int alike = 0, agree = 0;
    for (int i = 0; i < count; i++) {
        const struct feature *seen = &locator->features[matches[i].feature];
        const struct place_landmark *point = &locator->points[matches[i].point];
        if (feature_distance(point->descriptor, seen->descriptor) > ALIKE_BITS)
            break;
        const struct vec3 at = shutter_apply_motion(motion, shutter_row_time(&locator->lens, seen->at.y),
                                                    pose_apply(*camera_from_world, point->world));
        const struct vec3 ray = lens_ray(&locator->lens, seen->at);
        alike++;
        agree += at.z > 0.1 && hypot(locator->lens.fx * (at.x / at.z - ray.x),
                                     locator->lens.fy * (at.y / at.z - ray.y)) < AGREE_PX * (double)seen->scale;
    }
    return ONE_IN_AGREES * agree >= alike;
}

static bool enough_alike(const struct locator *locator, const struct landmark_match *matches, int kept)
{
    int alike = 0;
    for (int i = 0; i < kept; i++)
        alike += feature_distance(locator->points[matches[i].point].descriptor,
                                  locator->features[matches[i].feature].descriptor) <= ALIKE_BITS;
    return alike >= MIN_ALIKE;
}

// Whether these landmarks are enough to accept the pose without a tag.
static bool enough_landmarks(const struct locator *locator, const struct landmark_match *matches, int kept,
                             const struct pose *camera_from_world)
{
    return kept >= LOCATOR_MIN_WITHOUT_TAGS && enough_alike(locator, matches, kept) &&
           (kept >= SURELY_ENOUGH || ONE_IN * kept >= count_visible_landmarks(locator, camera_from_world));
}

// Without tags. Returns how many landmarks agree, into `matches`; 0: no pose.
static int solve_from_landmarks(struct locator *locator, bool with_depth, struct landmark_match *matches,
                                struct pnp_solution *found)
{
    const struct match_query query = query_of(locator, with_depth, NULL);
    int agree = 0, kept = 0;
    struct pose pose;
    struct shutter_motion moving = locator->frame_motion, *motion = locator->motion ? &moving : NULL;
    struct landmark_match by_looks[FEATURES_MAX];
    int count = relocalize_match(&query, matches, FEATURES_MAX);
    memcpy(by_looks, matches, (size_t)count * sizeof *by_looks);
    if (!relocalize(&query, matches, count, motion, &pose, &agree) ||
        !landmarks_refine_pose(&query, motion, &pose, matches, FEATURES_MAX, &kept) ||
        !enough_landmarks(locator, matches, kept, &pose) ||
        !enough_alike_agree(locator, by_looks, count, motion, &pose))
        return 0;
    *found = (struct pnp_solution){.camera_from_world = pose, .other = pose, .motion = moving};
    return kept;
}

// The tags that agree with the pose found, and no others, are used.
static void select_inlier_tags(const struct locator *locator, struct pnp_tag *tags, struct pnp_solution *found)
{
    found->used =
        locator_select_inlier_tags(locator, tags, locator->motion ? &found->motion : NULL, &found->camera_from_world);
}

// The pose again, with tags that the detector missed; a pose that landmarks agree with is only refined.
static enum status solve_with_predicted(struct locator *locator, struct localization *localization, enum status status)
{
    struct pnp_solution again;
    if (localization->agree) { // tags that were moved may be more than those that agree with the landmarks
        enum status sure = OK;
        memcpy(locator->other_matches, locator->matches, sizeof locator->matches);
        locator_pnp_tags(locator, localization->tags);
        select_inlier_tags(locator, localization->tags, &localization->found);
        int now = refine_with_landmarks(locator, localization, &sure);
        if (now)
            localization->agree = now;
        else
            memcpy(locator->matches, locator->other_matches, sizeof locator->matches);
        return sure;
    }
    enum status more = solve_from_tags(locator, localization->tags, &again);
    if (more == NOTHING || again.used < localization->found.used)
        return status;
    localization->found = again;
    return more;
}

// A tag was moved if hardly a landmark is where it should be from the pose that it gives, no more than agree by chance,
// and many times as many landmarks give another pose. Several tags that agree have to be outvoted.
static void check_against_landmarks(struct locator *locator, struct localization *localization, enum status *status)
{
    struct pnp_solution other;
    if (ONE_IN * localization->agree >= count_visible_landmarks(locator, &localization->found.camera_from_world))
        return;
    int kept = solve_from_landmarks(locator, localization->depth != NULL, locator->other_matches, &other);
    if (!kept || kept < OUTVOTE_FACTOR * localization->agree || (localization->found.used > 1 && kept < SURELY_ENOUGH))
        return;
    select_inlier_tags(locator, localization->tags, &other);
    memcpy(locator->matches, locator->other_matches, sizeof locator->matches);
    localization->found = other;
    localization->agree = kept;
    *status = OK;
}

// From the tags that the detector sees, with the landmarks around.
static enum status localize_from_tags(struct locator *locator, struct tag_detector *detector,
                                      struct localization *localization)
{
    localization->agree = 0;
    enum status status = detect_tags(locator, detector, localization);
    if (status != OK)
        return status;
    status = solve_from_tags(locator, localization->tags, &localization->found);
    if (locator_detect_rolling_shutter(locator, localization->tags, status == NOTHING ? NULL : &localization->found))
        status = solve_from_tags(locator, localization->tags, &localization->found);
    if (status != NOTHING && locator->point_count)
        localization->agree = refine_with_landmarks(locator, localization, &status);
    if (status != NOTHING && locator->point_count)
        check_against_landmarks(locator, localization, &status);
    return status;
}

// Adds the tags that must also be in view, and counts those that are missing.
static enum status add_predicted_tags(struct locator *locator, struct localization *localization, enum status status)
{
    struct shutter_motion expected = locator->frame_motion;
    locator->frame_motion = localization->found.motion;
    int more = locator_detect_predicted(locator, localization->color, localization->depth,
                                        &localization->found.camera_from_world, INT_MAX, &localization->missing);
    locator->frame_motion = expected;
    return more ? solve_with_predicted(locator, localization, status) : status;
}

// From a half-size image, in which most tags are detected in a quarter of the time; the others are looked for where
// they must be. NOTHING, too, where the full image may give more: nothing confirms what a single tag says, tags
// contradict each other, or one that must be in view is missing (moved or hidden).
static enum status localize_coarse(struct locator *locator, struct localization *localization)
{
    localization->missing = 0;
    if (!locator->coarse_detector)
        return NOTHING;
    enum status status = localize_from_tags(locator, locator->coarse_detector, localization);
    if (status == OK && (localization->agree || localization->found.used > 1))
        status = add_predicted_tags(locator, localization, status);
    if (status < 0)
        return status;
    bool sure = status == OK && (localization->agree || localization->found.used > 1) &&
                localization->found.used == locator->observed_count && !localization->missing;
    return sure ? OK : NOTHING;
}

// From the full image: tags, or else landmarks alone.
static enum status localize_fine(struct locator *locator, struct localization *localization)
{
    enum status status = localize_from_tags(locator, locator->detector, localization);
    if (status == NOTHING) {
        locator->observed_count = 0; // no pose fits the tags
        localization->agree = locator->point_count ? solve_from_landmarks(locator, localization->depth != NULL,
                                                                          locator->matches, &localization->found)
                                                   : 0;
        if (!localization->agree)
            return NOTHING;
        status = OK;
    }
    return status < 0 ? status : add_predicted_tags(locator, localization, status);
}

// From tags and landmarks alone, independently of earlier images.
static enum status localize_from_scratch(struct locator *locator, struct localization *localization)
{
    locator_begin_frame(locator, localization->color);
    enum status status = locator->point_count ? locator_extract_features(locator, localization->depth) : OK;
    if (status == OK)
        status = localize_coarse(locator, localization);
    if (status == NOTHING) {
        status = localize_fine(locator, localization);
        if (status == NOTHING)
            return NOTHING;
    }
    if (status < 0)
        return status;
    locator->frame_motion = localization->found.motion;
    localization->found.rms_px = locator_rms(locator, localization->tags, &localization->found.camera_from_world);
    return status;
}

// A corner that is a feature at several pyramid levels has the same error in all of them, so it must count once.
// Returns how many points are left.
static int drop_duplicates(const struct locator *locator, struct pnp_point *points, int count)
{
    static const double SAME_PX = 4;
    int kept = 0;
    for (int i = 0; i < count; i++) {
        bool again = false;
        for (int k = 0; k < kept && !again; k++)
            again = fabs(points[k].x - points[i].x) * locator->lens.fx < SAME_PX &&
                    fabs(points[k].y - points[i].y) * locator->lens.fy < SAME_PX;
        if (!again)
            points[kept++] = points[i];
    }
    return kept;
}

// The covariance of the pose found, and *out. NOTHING: it is too uncertain.
static enum status evaluate_pose(struct locator *locator, struct localization *localization, enum status status,
                                 double covariance[36], struct location *out)
{
    struct pnp_point points[FEATURES_MAX];
    const struct match_query query = query_of(locator, localization->depth != NULL, NULL);
    const struct pose *pose = &localization->found.camera_from_world;
    double widened[36];
    landmark_correspondences(&query, pose, locator->matches, localization->agree, points);
    const struct pose_problem problem =
        locator_problem(locator, localization->tags, points, drop_duplicates(locator, points, localization->agree));
    const bool known = pnp_covariance(&problem, pose, covariance);
    if (known && status == OK)
        focal_estimate_add(&locator->focal, &problem, pose);
    memcpy(widened, covariance, sizeof widened);
    locator_add_focal_variance(locator, &problem, pose, widened);
    if (!known || !locator_fill_result(locator, &localization->found, localization->agree, widened, covariance, out))
        status = NOTHING;
    if (status == OK)
        locator_vote_moved_tags(locator, localization->tags, localization->agree, pose);
    return status;
}

// keep_tracks: existing tracks are continued from the pose found, where enough of them are found.
static enum status localize_camera(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                                   bool keep_tracks, struct location *out)
{
    struct localization s = {.color = color, .depth = depth, .found = {.used = 0}};
    double covariance[36] = {0};
    enum status status = localize_from_scratch(locator, &s);
    if (status == OK || status == AMBIGUOUS)
        status = evaluate_pose(locator, &s, status, covariance, out);
    if (keep_tracks && status == OK && track_patches(locator, &s.found.camera_from_world)) {
        enum status tracked = solve_tracks(locator, color, depth, s.found.camera_from_world, out);
        if (tracked == NOTHING)
            locator->track_count = 0;
        return tracked == NOTHING ? OK : tracked;
    }
    locator->track_count = 0;
    if (status == OK || status == AMBIGUOUS)
        start_tracks(locator, s.tags, s.agree, &s.found.camera_from_world, covariance);
    return status;
}

enum status locator_localize(struct locator *locator, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize_camera(locator, color, depth, false, out);
}

enum status locator_relocalize(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                               struct location *out)
{
    return localize_camera(locator, color, depth, true, out);
}
