#include "locate/locator_internal.h"

#include <string.h>

// Tags are read by this many pixels, all of them together.
enum { TAG_PIXELS = 3000, LEAST_TAG_PIXELS = 500 };
// So many points are enough, and with fewer than half of that new ones are looked for.
enum { ENOUGH_TRACKS = 160, FEW_TRACKS = 100 };
// Fewer say nothing, without a tag and with one.
enum { LEAST_TRACKS = 15 };
static const double FAR_SIGMA = 4;  // a track further off is lost
static const double CORNER_PX = 1;  // how sure a tag's corner is by brightness alone
static const double FOLLOW_PX = 0.25; // how exactly a patch is found again
static const double CHANGE_PX = 0.05; // by how much more a track errs in the next picture
static const double LEAK = 0.1;       // the share of what was learnt of a track's error that is forgotten with each picture
static const double NEAR_PX = 4;    // how near a point is looked for around a pose that is known
static const double APART_PX = 8;  // tracks nearer to each other tell the same
static const double NEW_LOOK = 0.08; // a patch seen from this much aside (radians), nearer or further is cut anew

static bool in_picture(const struct lens *lens, struct vec3 p)
{
    // A distortion polynomial means nothing far outside the picture.
    return p.z > 0.1 && fabs(p.x) < lens->width / lens->fx * p.z && fabs(p.y) < lens->height / lens->fy * p.z;
}

static bool crowded(const struct locator *l, struct pixel at)
{
    for (int i = 0; i < l->track_count; i++)
        if (fabs(l->tracks[i].at.x - at.x) < APART_PX && fabs(l->tracks[i].at.y - at.y) < APART_PX)
            return true;
    return false;
}

static void add_track(struct locator *l, int32_t point, struct vec3 world, double sigma_px, struct pixel at,
                      const struct pose *camera_from_world)
{
    if (l->track_count == LOCATOR_MOST_TRACKS)
        return;
    struct point_track *t = &l->tracks[l->track_count];
    *t = (struct point_track){.point = point, .world = world, .sigma_px = sigma_px, .at = at};
    t->off_variance = sigma_px * sigma_px;
    t->cut_from = v3_sub(pose_inverse(*camera_from_world).translation, world);
    l->track_count += patch_cut(&l->picture, at, &t->patch);
}

// The corners of the tags used lead to the tags in the next picture.
static void add_corners(struct locator *l, const struct fit_tag *tags, const struct pose *camera_from_world)
{
    for (int i = 0; i < l->count; i++) {
        struct vec3 world[4];
        place_tag_corners(&l->tags[l->which[i]], world);
        for (int k = 0; k < 4 && tags[i].used; k++)
            add_track(l, -1, world[k], CORNER_PX, lens_project(&l->lens, l->sightings[i].ray[k]), camera_from_world);
    }
}

// Features that show points of the place, as far as there is room and none is near.
static void add_points(struct locator *l, int agree, const struct pose *camera_from_world)
{
    for (int i = 0; i < agree && l->track_count < ENOUGH_TRACKS; i++) {
        const struct feature *f = &l->index.features[l->matches[i].feature];
        if (!crowded(l, f->at))
            add_track(l, l->matches[i].point, l->points[l->matches[i].point].world, feature_sigma(f), f->at,
                      camera_from_world);
    }
}

void locator_remember(struct locator *l, const struct fit_tag *tags, int agree, const struct pose *camera_from_world)
{
    patch_picture_fill(&l->picture, l->gray);
    l->track_count = 0;
    l->last = *camera_from_world;
    add_corners(l, tags, camera_from_world);
    add_points(l, agree, camera_from_world);
}

// Finds the tracks in the new picture; those not found are dropped.
static void find_tracks(struct locator *l, const struct pose *guess)
{
    int kept = 0;
    for (int i = 0; i < l->track_count; i++) {
        struct point_track *t = &l->tracks[i];
        struct vec3 before = pose_apply(l->last, t->world), now = pose_apply(*guess, t->world);
        if (!in_picture(&l->lens, before) || !in_picture(&l->lens, now))
            continue;
        // By how much it moves is known better than where it is.
        struct pixel a = lens_project(&l->lens, before), b = lens_project(&l->lens, now);
        struct pixel at = {t->at.x + b.x - a.x, t->at.y + b.y - a.y};
        if (!patch_follow(&l->picture, &t->patch, &at))
            continue;
        t->at = at;
        if (kept != i)
            l->tracks[kept] = *t;
        kept++;
    }
    l->track_count = kept;
}

// What the tracks say, for a fit. corners: those of tags too. learnt: less what is known of
// their errors. Returns how many.
static int gather(const struct locator *l, const uint16_t *depth, bool corners, bool learnt, struct fit_point *out)
{
    int count = 0;
    for (int i = 0; i < l->track_count; i++) {
        const struct point_track *t = &l->tracks[i];
        if (t->point < 0 && !corners)
            continue;
        struct vec3 ray = lens_ray(&l->lens, t->at);
        struct fit_point *p = &out[count++];
        *p = (struct fit_point){t->world, ray.x, ray.y, t->sigma_px,
                                depth && t->point >= 0 ? feature_depth(&l->lens, depth, t->at) : 0};
        if (learnt) {
            p->x -= t->off[0] / l->lens.fx;
            p->y -= t->off[1] / l->lens.fy;
            p->sigma_px = sqrt(t->off_variance + FOLLOW_PX * FOLLOW_PX);
        }
    }
    return count;
}

// Drops the tracks that disagree with the pose. How many points of the place agree.
static int drop_bad(struct locator *l, const struct pose *camera_from_world)
{
    int kept = 0, points = 0;
    for (int i = 0; i < l->track_count; i++) {
        struct point_track *t = &l->tracks[i];
        struct vec3 ray = lens_ray(&l->lens, t->at);
        struct fit_point p = {t->world, ray.x, ray.y, t->sigma_px, 0};
        if (!(fit_point_error(&p, camera_from_world, l->lens.fx, l->lens.fy) < FAR_SIGMA))
            continue;
        points += t->point >= 0;
        if (kept != i)
            l->tracks[kept] = *t;
        kept++;
    }
    l->track_count = kept;
    return points;
}

// What the pose says of each track's error.
static void learn(struct locator *l, const struct pose *camera_from_world)
{
    for (int i = 0; i < l->track_count; i++) {
        struct point_track *t = &l->tracks[i];
        struct vec3 ray = lens_ray(&l->lens, t->at), p = pose_apply(*camera_from_world, t->world);
        double variance = t->off_variance + CHANGE_PX * CHANGE_PX, gain = variance / (variance + FOLLOW_PX * FOLLOW_PX);
        const double now[2] = {l->lens.fx * (ray.x - p.x / p.z), l->lens.fy * (ray.y - p.y / p.z)};
        for (int k = 0; k < 2; k++)
            t->off[k] = (1 - LEAK) * (t->off[k] + gain * (now[k] - t->off[k]));
        t->off_variance = (1 - gain) * variance;
    }
}

// Which of the tags in sight agree with the pose. How many.
static int use_tags(struct locator *l, struct fit_tag *tags, const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->count; i++) {
        tags[i].rms_px = fit_tag_rms(&tags[i], camera_from_world, l->lens.fx, l->lens.fy);
        tags[i].used = tags[i].rms_px <= l->options.max_rms_px;
        used += tags[i].used;
    }
    return used;
}

// Gets ready for the next picture: corners of the tags, patches as they look from here, and
// new points where few are left.
static enum status look_ahead(struct locator *l, const struct fit_tag *tags, const uint16_t *depth,
                              const struct pose *camera_from_world)
{
    int kept = 0;
    struct vec3 eye = pose_inverse(*camera_from_world).translation;
    for (int i = 0; i < l->track_count; i++) {
        struct point_track *t = &l->tracks[i];
        struct vec3 from = v3_sub(eye, t->world);
        if (t->point < 0)
            continue;
        if (v3_distance(from, t->cut_from) > NEW_LOOK * v3_length(from)) {
            t->cut_from = from;
            if (!patch_cut(&l->picture, t->at, &t->patch))
                continue;
        }
        if (kept != i)
            l->tracks[kept] = *t;
        kept++;
    }
    l->track_count = kept;
    l->last = *camera_from_world;
    if (kept < FEW_TRACKS && l->point_count) {
        enum status status = locator_find_features(l, depth);
        if (status != OK)
            return status;
        int count = points_match(l->points, l->point_count, &l->index, &l->lens, camera_from_world, NEAR_PX, l->matches,
                                 FEATURES_MAX);
        add_points(l, count, camera_from_world);
    }
    add_corners(l, tags, camera_from_world);
    return OK;
}

enum status locator_follow(struct locator *l, const uint8_t *color, const uint16_t *depth, struct pose guess,
                           struct location *out)
{
    struct fit_point points[LOCATOR_MOST_TRACKS];
    struct fit_tag tags[FIT_MAX_TAGS];
    const struct lens *lens = &l->lens;
    struct pose pose = pose_inverse(guess);
    l->count = 0;
    if (!l->track_count || !pose_finite(guess))
        return NOTHING;
    int before = l->track_count;
    gray_from_rgb(color, (size_t)lens->width * (size_t)lens->height, l->gray);
    patch_picture_fill(&l->picture, l->gray);
    find_tracks(l, &pose);
    if (l->track_count < 4 || 3 * l->track_count < before)
        return NOTHING;
    int count = gather(l, depth, true, true, points);
    for (double loose = 8; loose > 0.4; loose /= 4)
        fit_refine(NULL, 0, 0, points, count, loose, lens->fx, lens->fy, &pose);
    int tag_count = 0;
    for (int i = 0; i < l->track_count; i++)
        tag_count += l->tracks[i].point < 0;
    int each = TAG_PIXELS / (tag_count / 4 + 1);
    locator_look_where_predicted(l, color, depth, &pose, each > LEAST_TAG_PIXELS ? each : LEAST_TAG_PIXELS);
    locator_fit_tags(l, tags);
    drop_bad(l, &pose);
    use_tags(l, tags, &pose);
    count = gather(l, depth, false, true, points);
    fit_refine(tags, l->count, 0, points, count, 0, lens->fx, lens->fy, &pose);
    int agree = drop_bad(l, &pose);
    struct camera_fit found = {.camera_from_world = pose, .other = pose, .used = use_tags(l, tags, &pose)};
    if (!pose_finite(pose) || agree < LEAST_TRACKS || 2 * agree < count)
        return NOTHING;
    found.rms_px = locator_rms(l, tags, &pose);
    count = gather(l, depth, false, false, points);
    if (!locator_describe(l, tags, points, count, &found, out))
        return NOTHING;
    learn(l, &pose);
    return look_ahead(l, tags, depth, &pose);
}
