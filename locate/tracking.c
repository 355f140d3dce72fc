#include "locate/locator_internal.h"

#include "base/linear_algebra.h"

#include <string.h>

// Tags are read by this many pixels, all of them together.
enum { TAG_SAMPLES = 800, MIN_TAG_SAMPLES = 200 };
// Fewer say nothing, without a tag and with one.
enum { MIN_TRACKS = 15 };
static const double OUTLIER_SIGMA = 4;  // a track further off is lost
static const double CORNER_PX = 1;      // how sure a tag's corner is by brightness alone
static const double TRACKING_PX = 0.25; // how exactly a patch is found again, as long as nothing else is known
static const double MIN_TRACKING_PX = 0.05;
enum { NOISE_FRAMES = 10 }; // pictures that say how exactly
// Where so many tracks are as near to where the guess has them, the others are looked for only there.
enum { GOOD_GUESS_TRACKS = 24 };
static const double GOOD_GUESS_PX = 2;
static const double CHANGE_PX = 0.05; // by how much more a track errs in the next picture
static const double NEW_TEMPLATE_ANGLE =
    0.08; // a patch seen from this much aside (radians), nearer or further is cut anew

// Where a point is for the camera when the row is read that shows it.
static struct vec3 in_camera(const struct locator *l, const struct pose *camera_from_world, struct vec3 world,
                             double time_s)
{
    return shutter_apply_motion(l->motion, time_s, pose_apply(*camera_from_world, world));
}

void locator_add_track(struct locator *l, int32_t point, struct vec3 world, const double seen[3], struct pixel at,
                       const struct pose *camera_from_world)
{
    if (l->track_count == LOCATOR_MAX_TRACKS)
        return;
    struct point_track *t = &l->tracks[l->track_count];
    double time_s = shutter_row_time(&l->lens, at.y);
    struct vec3 p = in_camera(l, camera_from_world, world, time_s), ray = lens_ray(&l->lens, at);
    *t = (struct point_track){.point = point, .world = world, .at = at, .ray = ray, .time_s = time_s};
    memcpy(t->seen, seen, sizeof t->seen);
    t->bias[0] = point < 0 ? 0 : l->lens.fx * (ray.x - p.x / p.z);
    t->bias[1] = point < 0 ? 0 : l->lens.fy * (ray.y - p.y / p.z);
    t->bias_variance = point < 0 ? CORNER_PX * CORNER_PX : TRACKING_PX * TRACKING_PX;
    t->noise[0] = t->noise[2] = TRACKING_PX * TRACKING_PX;
    t->template_view = v3_sub(pose_inverse(*camera_from_world).translation, world);
    l->track_count += klt_patch_extract(&l->pyramid, at, &t->patch);
}

// The corners of the tags used lead to the tags in the next picture.
static void add_corners(struct locator *l, const struct pnp_tag *tags, const struct pose *camera_from_world)
{
    for (int i = 0; i < l->count; i++) {
        struct vec3 world[4];
        const double sure[3] = {CORNER_PX * CORNER_PX, 0, CORNER_PX * CORNER_PX};
        place_tag_corners(&l->tags[l->which[i]], world);
        for (int k = 0; k < 4 && tags[i].used; k++)
            locator_add_track(l, -1, world[k], sure, lens_project(&l->lens, l->observations[i].ray[k]),
                              camera_from_world);
    }
}

// By how much the corners of a tag are off where the pose has them, ideal pixels.
static void tag_corner_errors(const struct locator *l, int i, const struct pose *camera_from_world, double out[8])
{
    struct vec3 world[4];
    place_tag_corners(&l->tags[l->which[i]], world);
    for (int k = 0; k < 4; k++) {
        struct vec3 p = in_camera(l, camera_from_world, world[k], l->observations[i].time_s[k]);
        out[2 * k] = l->lens.fx * (l->observations[i].ray[k].x - p.x / p.z);
        out[2 * k + 1] = l->lens.fy * (l->observations[i].ray[k].y - p.y / p.z);
    }
}

// What the pose that was followed says of each tag's error. best: the pose in the end.
static void update_tag_biases(struct locator *l, const struct pnp_tag *tags, const struct pose *followed,
                              const struct pose *best)
{
    bool seen[PNP_MAX_TAGS] = {false};
    for (int32_t k = 0; k < l->tag_count; k++) {
        int i = 0;
        while (i < l->count && (l->which[i] != k || !tags[i].used))
            i++;
        if (i == l->count)
            l->tag_tracks[k].known = false;
        else
            seen[i] = true;
    }
    for (int i = 0; i < l->count; i++) {
        struct tag_track *t = &l->tag_tracks[l->which[i]];
        double at[8], then[8], variance = t->known ? t->bias_variance + CHANGE_PX * CHANGE_PX : 1e6;
        double gain = variance / (variance + TRACKING_PX * TRACKING_PX);
        if (!seen[i])
            continue;
        tag_corner_errors(l, i, followed, at);
        tag_corner_errors(l, i, best, then);
        for (int k = 0; k < 8; k++) {
            t->bias[k] = t->known ? t->bias[k] : at[k];
            t->bias[k] += gain * (at[k] - t->bias[k]) + then[k] - at[k];
        }
        t->bias_variance = (1 - gain) * variance;
        t->known = true;
    }
}

void locator_start_tracks(struct locator *l, const struct pnp_tag *tags, int agree,
                          const struct pose *camera_from_world, const double covariance[36])
{
    static const double none[36];
    klt_pyramid_build(&l->pyramid, l->gray);
    l->track_count = 0;
    l->last = *camera_from_world;
    l->last_motion = l->frame_motion;
    for (int32_t k = 0; k < l->tag_count; k++)
        l->tag_tracks[k].known = false;
    update_tag_biases(l, tags, camera_from_world, camera_from_world);
    pose_fusion_start(&l->fusion, covariance, none);
    add_corners(l, tags, camera_from_world);
    locator_add_landmark_tracks(l, agree, camera_from_world);
    for (int i = 0; i < l->track_count; i++)
        l->tracks[i].fused = true;
}

// The last track takes the place of one that is dropped.
static void drop_track(struct locator *l, int i)
{
    l->track_count--;
    if (i < l->track_count)
        l->tracks[i] = l->tracks[l->track_count];
}

// Finds the tracks in the new picture; those not found are dropped.
static void find_tracks(struct locator *l, const struct pose *guess)
{
    double furthest = 0; // from where the guess has a track
    for (int i = 0; i < l->track_count;) {
        struct point_track *t = &l->tracks[i];
        struct vec3 before = pose_apply(l->last, t->world), now = pose_apply(*guess, t->world);
        if (!locator_in_image(&l->lens, before) || !locator_in_image(&l->lens, now)) {
            drop_track(l, i);
            continue;
        }
        // By how much it moves is known better than where it is.
        struct pixel a = shutter_project(&l->lens, l->motion ? &l->last_motion : NULL, before),
                     b = shutter_project(&l->lens, l->motion, now);
        const struct pixel guessed = {t->at.x + b.x - a.x, t->at.y + b.y - a.y};
        struct pixel at = guessed;
        bool near_guess = i >= GOOD_GUESS_TRACKS && furthest < GOOD_GUESS_PX;
        if (!(near_guess && klt_patch_track(&l->pyramid, &t->patch, true, &at)) &&
            !klt_patch_track(&l->pyramid, &t->patch, false, &at)) {
            drop_track(l, i);
            continue;
        }
        if (!near_guess)
            furthest = fmax(furthest, hypot(at.x - guessed.x, at.y - guessed.y));
        t->at = at;
        t->ray = lens_ray(&l->lens, at);
        t->time_s = shutter_row_time(&l->lens, at.y);
        i++;
    }
}

enum constraint_set {
    TAG_CORNERS = 1, // of tags, too
    UNBIASED = 2,    // less what is known of their errors
    FUSED = 4,       // only those of which the map's last pose knows
    NOISE = 8,       // as sure as they are followed, whatever is wrong with them
    DRIFT = 16,      // as sure as it is that what is wrong with them stays
};

// By how much more a point errs in the next picture: the map has its distance about as exactly
// as a sensor reads it, and it is now seen from elsewhere.
static double change_px(const struct locator *l, const struct point_track *t, const struct pose *camera_from_world)
{
    struct vec3 from = v3_sub(pose_inverse(*camera_from_world).translation, t->world),
                before = v3_sub(pose_inverse(l->last).translation, t->world);
    double z = v3_length(from), aside = v3_length(v3_cross(from, before)) / (z * v3_length(before));
    return hypot(CHANGE_PX, l->lens.fx / z * depth_absolute_sigma_m(z) * aside);
}

// What the tracks say, for a fit. Returns how many.
static int make_constraints(const struct locator *l, const uint16_t *depth, enum constraint_set what,
                            const struct pose *camera_from_world, struct pnp_point *out)
{
    int count = 0;
    for (int i = 0; i < l->track_count; i++) {
        const struct point_track *t = &l->tracks[i];
        if ((t->point < 0 && !(what & TAG_CORNERS)) || ((what & FUSED) && !t->fused))
            continue;
        struct pnp_point *p = &out[count++];
        *p = (struct pnp_point){.world = t->world, .x = t->ray.x, .y = t->ray.y, .time_s = t->time_s};
        if (depth && t->point >= 0) {
            p->z = feature_depth(&l->lens, depth, t->at);
            p->z_variance = landmark_depth_variance(&l->points[t->point], camera_from_world);
        }
        memcpy(p->covariance, t->seen, sizeof p->covariance);
        if (what & UNBIASED) {
            p->x -= t->bias[0] / l->lens.fx;
            p->y -= t->bias[1] / l->lens.fy;
            p->sigma_px = sqrt(t->bias_variance);
            memcpy(p->covariance, t->noise, sizeof p->covariance);
        }
        if (what & (NOISE | DRIFT)) {
            struct vec3 at = in_camera(l, camera_from_world, t->world, t->time_s);
            p->x = at.x / at.z;
            p->y = at.y / at.z;
            p->sigma_px = what & NOISE ? 0 : change_px(l, t, camera_from_world);
            memset(p->covariance, 0, sizeof p->covariance);
            if (what & NOISE)
                memcpy(p->covariance, t->noise, sizeof p->covariance);
        }
    }
    return count;
}

// Drops the tracks that disagree with the pose. How many points of the place agree.
static int drop_outliers(struct locator *l, const struct pose *camera_from_world)
{
    int points = 0;
    for (int i = 0; i < l->track_count;) {
        const struct point_track *t = &l->tracks[i];
        struct pnp_point p = {.world = t->world,
                              .x = t->ray.x,
                              .y = t->ray.y,
                              .covariance = {t->seen[0], t->seen[1], t->seen[2]},
                              .time_s = t->time_s};
        if (!(pnp_point_error(&p, l->motion, camera_from_world, l->lens.fx, l->lens.fy) < OUTLIER_SIGMA)) {
            drop_track(l, i);
            continue;
        }
        points += t->point >= 0;
        i++;
    }
    return points;
}

// What the pose that was followed says of each track's error. best: the pose in the end.
static void update_track_biases(struct locator *l, const struct pose *followed, const struct pose *best)
{
    for (int i = 0; i < l->track_count; i++) {
        struct point_track *t = &l->tracks[i];
        struct vec3 p = in_camera(l, followed, t->world, t->time_s), q = in_camera(l, best, t->world, t->time_s);
        double change = change_px(l, t, followed), variance = t->bias_variance + change * change;
        double gain = variance / (variance + (t->noise[0] + t->noise[2]) / 2);
        double off_x = l->lens.fx * (t->ray.x - p.x / p.z) - t->bias[0],
               off_y = l->lens.fy * (t->ray.y - p.y / p.z) - t->bias[1];
        // of the difference, what the offset does not explain by its own uncertainty
        const double now[3] = {fmax(off_x * off_x * (1 - gain), MIN_TRACKING_PX * MIN_TRACKING_PX),
                               off_x * off_y * (1 - gain),
                               fmax(off_y * off_y * (1 - gain), MIN_TRACKING_PX * MIN_TRACKING_PX)};
        for (int k = 0; k < 3; k++)
            t->noise[k] += (now[k] - t->noise[k]) / NOISE_FRAMES;
        t->bias[0] += gain * off_x + l->lens.fx * (p.x / p.z - q.x / q.z);
        t->bias[1] += gain * off_y + l->lens.fy * (p.y / p.z - q.y / q.z);
        t->bias_variance = (1 - gain) * variance;
        t->fused = true;
    }
}

// Which of the tags in sight agree with the pose. How many.
static int select_inlier_tags(struct locator *l, struct pnp_tag *tags, const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], l->motion, camera_from_world, l->lens.fx, l->lens.fy);
        tags[i].used = tags[i].rms_px <= l->options.max_rms_px;
        used += tags[i].used;
    }
    return used;
}

// Gets ready for the next picture: corners of the tags, patches as they look from here, and
// new points where few are left.
static enum status prepare_next_frame(struct locator *l, const struct pnp_tag *tags, const uint16_t *depth,
                                      const struct pose *camera_from_world)
{
    struct vec3 eye = pose_inverse(*camera_from_world).translation;
    for (int i = 0; i < l->track_count;) {
        struct point_track *t = &l->tracks[i];
        struct vec3 from = v3_sub(eye, t->world);
        bool changed = t->point >= 0 && v3_distance(from, t->template_view) > NEW_TEMPLATE_ANGLE * v3_length(from);
        if (changed)
            t->template_view = from;
        if (t->point < 0 || (changed && !klt_patch_extract(&l->pyramid, t->at, &t->patch)))
            drop_track(l, i);
        else
            i++;
    }
    l->last = *camera_from_world;
    l->last_motion = l->frame_motion;
    enum status status = locator_activate_landmarks(l, depth, camera_from_world);
    add_corners(l, tags, camera_from_world);
    return status;
}

// The tags that were in the last picture too, less what is known of their errors.
static int correct_tags(struct locator *l, const struct pnp_tag *tags, struct pnp_tag *out)
{
    int count = 0;
    for (int i = 0; i < l->count; i++) {
        const struct tag_track *t = &l->tag_tracks[l->which[i]];
        if (!t->known || !tags[i].used)
            continue;
        l->corrected[count] = l->observations[i];
        for (int k = 0; k < 4; k++) {
            l->corrected[count].ray[k].x -= t->bias[2 * k] / l->lens.fx;
            l->corrected[count].ray[k].y -= t->bias[2 * k + 1] / l->lens.fy;
        }
        out[count] = tags[i];
        out[count].depth = NULL;
        out[count].covariance = NULL; // that is among what is known
        out[count].seen = &l->corrected[count];
        count++;
    }
    return count;
}

// The small motion from one camera_from_world to another.
static void pose_difference(const struct pose *from, const struct pose *to, double out[6])
{
    struct pose by = pose_multiply(*to, pose_inverse(*from));
    struct vec3 turn = quat_to_rotation_vector(by.rotation);
    const double d[6] = {turn.x, turn.y, turn.z, by.translation.x, by.translation.y, by.translation.z};
    memcpy(out, d, sizeof d);
}

// How much the map's pose rests on what the last picture showed too.
static void shared_information(const struct locator *l, const uint16_t *depth, const struct pnp_tag *tags,
                               const struct pose *map, struct pose_measurement *measurement)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    struct pnp_tag old[PNP_MAX_TAGS];
    const struct lens *lens = &l->lens;
    double all[36], inverse[36];
    memset(measurement->map_information, 0, sizeof measurement->map_information);
    int count = make_constraints(l, depth, 0, map, points);
    pnp_information(tags, l->count, points, count, lens->fx, lens->fy, l->motion, map, all);
    if (!invert_symmetric(all, 6, inverse))
        return;
    for (int i = 0; i < l->count; i++) {
        old[i] = tags[i];
        old[i].used = tags[i].used && l->tag_tracks[l->which[i]].known;
    }
    count = make_constraints(l, depth, FUSED, map, points);
    pnp_information(old, l->count, points, count, lens->fx, lens->fy, l->motion, map, measurement->map_information);
    for (int i = 0; i < 36; i++) // errors that are larger than expected are so in both
        measurement->map_information[i] *= inverse[0] / measurement->map_covariance[0];
}

// How far the pose may be off by following alone: what of it is another in each picture, and
// what adds up.
static bool tracking_covariance(const struct locator *l, const struct pnp_tag *known, int known_count, double new_share,
                                const struct pose *followed, struct pose_measurement *measurement)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    const struct lens *lens = &l->lens;
    double information[36];
    int count = make_constraints(l, NULL, NOISE, followed, points);
    pnp_information(known, known_count, points, count, lens->fx, lens->fy, l->motion, followed, information);
    if (!invert_symmetric(information, 6, measurement->noise))
        return false;
    count = make_constraints(l, NULL, DRIFT, followed, points);
    pnp_information(known, known_count, points, count, lens->fx, lens->fy, l->motion, followed, information);
    if (!invert_symmetric(information, 6, measurement->drift))
        return false;
    // What is new was placed by one picture, and errs as that one did.
    for (int i = 0; i < 36; i++)
        measurement->drift[i] += new_share * new_share * measurement->noise[i];
    return true;
}

// What is followed says how fast the camera moves.
static void update_velocity_prior(struct locator *l, const struct pnp_tag *known, int known_count,
                                  const struct pose *followed)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    int count = make_constraints(l, NULL, UNBIASED, followed, points);
    pnp_update_velocity_prior(known, known_count, points, count, l->lens.fx, l->lens.fy, l->motion, followed);
}

// From the pose that was followed towards the one that the map gives by itself, as far as
// that is worth. False: what is in sight leaves a motion open.
static bool fuse_with_map(struct locator *l, const uint16_t *depth, const struct pnp_tag *tags,
                          const struct pose *followed, struct pose_measurement *measurement, struct pose *best)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    const struct lens *lens = &l->lens;
    double by[6];
    struct pose map = *followed;
    struct shutter_motion moving = l->frame_motion, *motion = l->motion ? &moving : NULL;
    int count = make_constraints(l, depth, 0, followed, points);
    pnp_refine(tags, l->count, 0, points, count, 0, lens->fx, lens->fy, motion, &map);
    if (!pose_finite(map) ||
        !pnp_covariance(tags, l->count, points, count, lens->fx, lens->fy, motion, &map, measurement->map_covariance))
        return false;
    shared_information(l, depth, tags, &map, measurement);
    pose_difference(followed, &map, measurement->offset);
    if (!pose_fusion_update(&l->fusion, measurement, by))
        return false;
    struct pose small = {quat_from_rotation_vector(v3(by[0], by[1], by[2])), {by[3], by[4], by[5]}};
    *best = pose_multiply(small, *followed);
    return pose_finite(*best);
}

bool locator_track_patches(struct locator *l, const struct pose *camera_from_world)
{
    int before = l->track_count;
    if (!before)
        return false;
    klt_pyramid_build(&l->pyramid, l->gray);
    find_tracks(l, camera_from_world);
    return l->track_count >= 4 && 3 * l->track_count >= before;
}

enum status locator_solve_tracks(struct locator *l, const uint8_t *color, const uint16_t *depth, struct pose pose,
                                 struct location *out)
{
    struct pnp_point points[LOCATOR_MAX_TRACKS];
    struct pnp_tag tags[PNP_MAX_TAGS], known[PNP_MAX_TAGS];
    const struct lens *lens = &l->lens;
    int count = make_constraints(l, depth, TAG_CORNERS | UNBIASED, &pose, points), corners = 0;
    for (double loose = 8; loose > 0.4; loose /= 4)
        pnp_refine(NULL, 0, 0, points, count, loose, lens->fx, lens->fy, l->motion, &pose);
    for (int i = 0; i < l->track_count; i++)
        corners += l->tracks[i].point < 0;
    int each = TAG_SAMPLES / (corners / 4 + 1);
    l->count = 0;
    locator_detect_predicted(l, color, depth, &pose, each > MIN_TAG_SAMPLES ? each : MIN_TAG_SAMPLES, NULL);
    locator_pnp_tags(l, tags);
    drop_outliers(l, &pose);
    select_inlier_tags(l, tags, &pose);
    int known_count = correct_tags(l, tags, known);
    count = make_constraints(l, NULL, UNBIASED, &pose, points);
    pnp_refine(known, known_count, 0, points, count, 0, lens->fx, lens->fy, l->motion, &pose);
    int agree = drop_outliers(l, &pose);
    if (!pose_finite(pose) || agree < MIN_TRACKS || 2 * agree < count)
        return NOTHING;
    struct pnp_solution found = {.used = select_inlier_tags(l, tags, &pose)};
    struct pose_measurement seen;
    double covariance[36], fused = 0;
    for (int i = 0; i < l->track_count; i++)
        fused += l->tracks[i].point >= 0 && l->tracks[i].fused;
    if (!tracking_covariance(l, known, known_count, 1 - fused / agree, &pose, &seen))
        return NOTHING;
    if (l->motion) // the map's own errors say nothing of the speed
        update_velocity_prior(l, known, known_count, &pose);
    if (!fuse_with_map(l, depth, tags, &pose, &seen, &found.camera_from_world))
        return NOTHING;
    found.other = found.camera_from_world;
    found.rms_px = locator_rms(l, tags, &found.camera_from_world);
    pose_fusion_covariance(&l->fusion, covariance);
    if (l->given_lens.focal_sigma > 0) {
        count = make_constraints(l, NULL, 0, &found.camera_from_world, points);
        locator_observe_focal(l, tags, points, count, &found.camera_from_world);
        locator_add_focal_variance(l, tags, points, count, &found.camera_from_world, covariance);
    }
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
