// Landmarks of the map: creation, matching, merging of duplicates, outlier removal, selection.
#include "capture/mapping/map_internal.h"
#include "locate/relocalization.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- map triangulation

// Triangulation of features where a sweep has no depth: matches descriptors between pairs of frames with a baseline,
// near their epipolar lines, by poses that are roughly known from tags.

// All chosen by hand.
enum {
    PARTNERS = 6,   // frames that one is matched with
    MAX_BITS = 48,  // Hamming distance of a match
    MARGIN_BITS = 8 // by which the second-best match, at another depth, must be worse
};
static const double MIN_BASELINE_M = 0.1, MAX_BASELINE_M = 1.5, MAX_ROTATION = 0.6;
static const double MIN_PARALLAX = 0.05; // radians between the two rays
static const double MAX_ERROR_PX = 2.5;  // reprojection error at full image size
static const double MIN_DEPTH_M = 0.2, MAX_DEPTH_M = 12;
static const double SAME_DEPTH_SHARE = 0.05; // depths that differ by less than this share are the same
static const float MAX_SCALE_RATIO = 1.6F;

// The frames with the most similar viewing direction among those with a usable baseline. Returns how many.
static int find_partners(const struct map *map, const struct map_frame *frame, const struct map_frame *out[PARTNERS])
{
    double angles[PARTNERS];
    int count = 0;
    const struct pose from = pose_inverse(frame->camera_from_world);
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *other = &map->frames[i];
        const struct pose to = pose_inverse(other->camera_from_world);
        double baseline = v3_distance(from.translation, to.translation), angle = pose_angle(from, to);
        if (other == frame || !other->placed || baseline < MIN_BASELINE_M || baseline > MAX_BASELINE_M ||
            angle > MAX_ROTATION)
            continue;
        int at = count < PARTNERS ? count++ : PARTNERS;
        for (; at > 0 && angles[at - 1] > angle; at--)
            if (at < PARTNERS) {
                angles[at] = angles[at - 1];
                out[at] = out[at - 1];
            }
        if (at < PARTNERS) {
            angles[at] = angle;
            out[at] = other;
        }
    }
    return count;
}

// The midpoint of two rays (z = 1) where they are closest, in the first camera's axes. False: too nearly parallel,
// outside the depth range, or a reprojection error of `off` or more, in units of z = 1.
static bool intersect_rays(struct vec3 a, struct vec3 b, struct pose a_from_b, double off, struct vec3 *out)
{
    struct vec3 d = quat_rotate(a_from_b.rotation, b), o = a_from_b.translation;
    double aa = v3_dot(a, a), ad = v3_dot(a, d), dd = v3_dot(d, d), ao = v3_dot(a, o), od = v3_dot(d, o);
    double det = aa * dd - ad * ad;
    if (det < MIN_PARALLAX * MIN_PARALLAX * aa * dd)
        return false;
    double s = (dd * ao - ad * od) / det, t = (ad * ao - aa * od) / det;
    if (s < MIN_DEPTH_M || s > MAX_DEPTH_M || t < MIN_DEPTH_M || t > MAX_DEPTH_M)
        return false;
    *out = v3_scale(v3_add(v3_scale(a, s), v3_add(o, v3_scale(d, t))), 0.5);
    struct vec3 in_b = pose_apply(pose_inverse(a_from_b), *out);
    return hypot(out->x / out->z - a.x, out->y / out->z - a.y) < off &&
           hypot(in_b.x / in_b.z - b.x, in_b.y / in_b.z - b.y) < off;
}

struct depth_match {
    int bits, other_bits; // of the best match, and of the best one at another depth
    double depth;
};

static void match_frames(const struct map *map, const struct map_frame *frame, const struct vec3 *rays,
                         const struct map_frame *other, struct depth_match *matches)
{
    const struct lens *lens = &map->calibration.color;
    const struct pose f_from_other = pose_multiply(frame->camera_from_world, pose_inverse(other->camera_from_world));
    for (int32_t k = 0; k < other->feature_count; k++) {
        const struct feature *feature = &other->features[k].feature;
        const struct vec3 ray = lens_ray(lens, feature->at);
        for (int32_t i = 0; i < frame->feature_count; i++) {
            const struct feature *a = &frame->features[i].feature;
            struct depth_match *match = &matches[i];
            if (a->scale > MAX_SCALE_RATIO * feature->scale || feature->scale > MAX_SCALE_RATIO * a->scale)
                continue;
            int bits = feature_distance(a->descriptor, feature->descriptor);
            struct vec3 p;
            if (bits > MAX_BITS || bits >= match->other_bits ||
                !intersect_rays(rays[i], ray, f_from_other,
                                MAX_ERROR_PX * (double)fmaxf(a->scale, feature->scale) / lens->fx, &p))
                continue;
            bool same = match->depth > 0 && fabs(p.z - match->depth) < SAME_DEPTH_SHARE * match->depth;
            if (bits < match->bits)
                *match = (struct depth_match){bits, same ? match->other_bits : match->bits, p.z};
            else if (!same)
                match->other_bits = bits;
        }
    }
}

void map_triangulate(const struct map *map, struct map_frame *frame)
{
    const struct map_frame *partners[PARTNERS];
    struct vec3 rays[MAP_MAX_FEATURES];
    struct depth_match matches[MAP_MAX_FEATURES];
    for (int32_t i = 0; i < frame->feature_count; i++) {
        rays[i] = lens_ray(&map->calibration.color, frame->features[i].feature.at);
        matches[i] = (struct depth_match){MAX_BITS + 1, MAX_BITS + 1 + MARGIN_BITS, 0};
    }
    int count = find_partners(map, frame, partners);
    for (int i = 0; i < count; i++)
        match_frames(map, frame, rays, partners[i], matches);
    for (int32_t i = 0; i < frame->feature_count; i++)
        frame->features[i].triangulated_depth =
            matches[i].other_bits - matches[i].bits > MARGIN_BITS ? matches[i].depth : 0;
}

enum status map_cull_low_parallax(struct map *map)
{
    struct vec3 *first = calloc((size_t)map->point_count + 1, sizeof *first); // direction of the first observation
    double *min = malloc(sizeof *min * ((size_t)map->point_count + 1));       // least cosine between that and any other
    enum status status = first && min ? OK : fail(ERR_MEMORY, "no memory to check %d points", (int)map->point_count);
    for (int32_t i = 0; i < map->point_count && status == OK; i++)
        min[i] = 1;
    for (int32_t i = 0; i < map->frame_count && status == OK; i++) {
        const struct map_frame *f = &map->frames[i];
        const struct vec3 eye = pose_inverse(f->camera_from_world).translation;
        for (int32_t k = 0; k < f->feature_count; k++) {
            const int32_t point = f->placed ? f->features[k].point : -1;
            if (point < 0)
                continue;
            const struct vec3 way = v3_unit(v3_sub(map->points[point].world, eye));
            if (v3_dot(first[point], first[point]) > 0)
                min[point] = fmin(min[point], v3_dot(first[point], way));
            else
                first[point] = way;
        }
    }
    for (int32_t i = 0; i < map->frame_count && status == OK; i++)
        for (int32_t k = 0; k < map->frames[i].feature_count; k++) {
            struct map_feature *s = &map->frames[i].features[k];
            if (s->point >= map->held_points && !(min[s->point] < cos(MIN_PARALLAX)))
                s->point = -1;
        }
    free(first);
    free(min);
    return status;
}

// ---------------------------------------------------------------- map loop closure

// Loop closure. A sweep that comes back to its beginning has accumulated drift and maps old landmarks a second time,
// displaced. Here each frame is relocalised among the landmarks it should see but that are not connected to it; the
// duplicates become one landmark, and bundle adjustment distributes the drift over the loop.

// Chosen by hand.
enum { MIN_INLIERS = 20, CLOSURE_ROUNDS = 15 };
static const double INLIER_PX = 4;
static const double SEARCH_WIDTH = 1.5; // of the field searched for old landmarks, in image widths and heights

struct loop_scratch {
    struct map_scratch frame;
    int32_t *merged_into;          // of each landmark: the one that it duplicates (union-find)
    bool *covisible;               // of each frame: shares a landmark with the present one
    bool *known;                   // of each landmark: shown by a covisible frame
    struct place_landmark *points; // the old landmarks searched for
    int32_t *point_index;          // of each of those: index into map.points
    int32_t count;
};

static void mark_covisible(const struct map *map, const struct map_frame *frame, struct loop_scratch *scratch)
{
    memset(scratch->known, 0, (size_t)map->point_count * sizeof *scratch->known);
    for (int32_t k = 0; k < frame->feature_count; k++)
        if (frame->features[k].point >= 0)
            scratch->known[frame->features[k].point] = true;
    for (int32_t i = 0; i < map->frame_count; i++) {
        scratch->covisible[i] = false;
        for (int32_t k = 0; k < map->frames[i].feature_count && !scratch->covisible[i]; k++)
            scratch->covisible[i] =
                map->frames[i].features[k].point >= 0 && scratch->known[map->frames[i].features[k].point];
    }
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; k < map->frames[i].feature_count && scratch->covisible[i]; k++)
            if (map->frames[i].features[k].point >= 0)
                scratch->known[map->frames[i].features[k].point] = true;
}

static void select_old_points(const struct map *map, const struct map_frame *frame, struct loop_scratch *scratch)
{
    const struct lens *lens = &map->calibration.color;
    double wide = SEARCH_WIDTH * lens->width / lens->fx / 2, high = SEARCH_WIDTH * lens->height / lens->fy / 2;
    scratch->count = 0;
    for (int32_t i = 0; i < map->point_count; i++) {
        struct vec3 p = pose_apply(frame->camera_from_world, map->points[i].world);
        if (scratch->known[i] || !(p.z > 0.1) || fabs(p.x) > wide * p.z || fabs(p.y) > high * p.z)
            continue;
        scratch->points[scratch->count] = map->points[i];
        scratch->point_index[scratch->count++] = i;
    }
}

static int32_t find_root(const int32_t *merged_into, int32_t i)
{
    while (merged_into[i] != i)
        i = merged_into[i];
    return i;
}

// Matches the frame's features with old landmarks. Returns how many match.
static int match_old_points(struct map *map, struct map_frame *map_frame, struct loop_scratch *scratch)
{
    struct pose pose;
    struct map_scratch *frame = &scratch->frame;
    const struct lens *lens = &map->calibration.color;
    int agree, matched = 0;
    map_index_features(frame, map, map_frame);
    const struct match_query query = {
        .points = scratch->points, .point_count = scratch->count, .index = &frame->index, .lens = lens};
    int count = relocalize_match(&query, frame->matches, MAP_MAX_FEATURES);
    if (!relocalize(&query, frame->matches, count, NULL, &pose, &agree) || agree < MIN_INLIERS)
        return 0;
    count =
        landmarks_match(&query, (struct match_window){INLIER_PX, false}, NULL, &pose, frame->matches, MAP_MAX_FEATURES);
    for (int k = 0; k < count; k++) {
        struct map_feature *feature = &map_frame->features[frame->matches[k].feature];
        int32_t old = scratch->point_index[frame->matches[k].point];
        if (feature->point < 0) {
            feature->point = old;
        } else {
            int32_t a = find_root(scratch->merged_into, feature->point), b = find_root(scratch->merged_into, old);
            if (a >= map->held_points || b >= map->held_points)
                scratch->merged_into[a > b ? a : b] = a > b ? b : a; // the lower index is the older one
        }
        matched++;
    }
    return matched;
}

static void apply_merges(struct map *map, const int32_t *merged_into)
{
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; k < map->frames[i].feature_count; k++)
            if (map->frames[i].features[k].point >= 0)
                map->frames[i].features[k].point = find_root(merged_into, map->frames[i].features[k].point);
}

static enum status loop_scratch_alloc(struct loop_scratch *scratch, const struct map *map)
{
    size_t points = (size_t)map->point_count + 1;
    scratch->merged_into = malloc(points * sizeof *scratch->merged_into);
    scratch->known = malloc(points * sizeof *scratch->known);
    scratch->points = malloc(points * sizeof *scratch->points);
    scratch->point_index = malloc(points * sizeof *scratch->point_index);
    scratch->covisible = malloc((size_t)map->frame_count + 1);
    return scratch->merged_into && scratch->known && scratch->points && scratch->point_index && scratch->covisible
               ? OK
               : fail(ERR_MEMORY, "no memory to close the loops of a sweep");
}

static void loop_scratch_free(struct loop_scratch *scratch)
{
    free(scratch->merged_into);
    free(scratch->known);
    free(scratch->points);
    free(scratch->point_index);
    free(scratch->covisible);
    free(scratch);
}

enum status map_close_loops(struct map *map)
{
    // From loose to tight, so that a gap of many pixels is not taken for an outlier. Chosen by hand.
    static const double EXTRA_SIGMA_PX[] = {30, 10, 3, 0};
    struct loop_scratch *d = calloc(1, sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to close the loops of a sweep");
    enum status status = loop_scratch_alloc(d, map);
    int matched = 0;
    for (int32_t i = 0; i < map->point_count && status == OK; i++)
        d->merged_into[i] = i;
    for (int32_t i = 0; i < map->frame_count && status == OK; i++) {
        if (!map->frames[i].placed)
            continue;
        mark_covisible(map, &map->frames[i], d);
        select_old_points(map, &map->frames[i], d);
        if (d->count >= MIN_INLIERS)
            matched += match_old_points(map, &map->frames[i], d);
    }
    if (matched)
        apply_merges(map, d->merged_into);
    loop_scratch_free(d);
    for (size_t i = 0; i < COUNT_OF(EXTRA_SIGMA_PX) && status == OK && matched; i++)
        status = map_bundle_adjust_relaxed(map, CLOSURE_ROUNDS, EXTRA_SIGMA_PX[i]);
    return status;
}

// ---------------------------------------------------------------- map landmarks

// Chosen by hand.
static const double REMATCH_PX = 4;     // search radius about a landmark's projection in an adjusted map
static const double DUPLICATE_M = 0.03; // landmarks this near, per axis, with similar descriptors are one
enum { DUPLICATE_BITS = 40, ROUNDS = 6, REFINE_ROUNDS = 15 };

// Two views always agree on some depth along the epipolar line, so without depth a third one has to confirm it.
static int min_observations(const struct map *map) { return map->has_depth ? 2 : 3; }

void map_index_features(struct map_scratch *scratch, const struct map *map, const struct map_frame *frame)
{
    for (int32_t i = 0; i < frame->feature_count; i++) {
        scratch->features[i] = frame->features[i].feature;
        scratch->depth[i] = frame->features[i].depth;
    }
    feature_index_build(&scratch->index, scratch->features, frame->feature_count, &map->calibration.color);
}

void map_assign_matches(struct map_frame *frame, const struct map_scratch *scratch, int count)
{
    for (int32_t i = 0; i < frame->feature_count; i++)
        frame->features[i].point = -1;
    for (int i = 0; i < count; i++)
        frame->features[scratch->matches[i].feature].point = scratch->matches[i].point;
}

void map_create_landmarks(struct map *map, struct map_frame *frame)
{
    struct pose world_from_camera = pose_inverse(frame->camera_from_world);
    if (!map->has_depth)
        map_triangulate(map, frame);
    for (int32_t i = 0; i < frame->feature_count && map->point_count < map->point_capacity; i++) {
        struct map_feature *feature = &frame->features[i];
        double depth = map->has_depth ? feature->depth : feature->triangulated_depth;
        if (feature->point >= 0 || !(depth > 0))
            continue;
        struct vec3 ray = lens_ray(&map->calibration.color, feature->feature.at);
        struct place_landmark *p = &map->points[map->point_count];
        *p = (struct place_landmark){.world = pose_apply(world_from_camera, v3_scale(ray, depth))};
        memcpy(p->descriptor, feature->feature.descriptor, sizeof p->descriptor);
        feature->point = map->point_count++;
    }
}

// Matches the map's landmarks in one frame, refines its pose by them, adds new ones.
static void add_frame_landmarks(struct map *map, struct map_scratch *scratch, struct map_frame *frame)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    int count = 0, tag_count = map_tag_correspondences(map, frame, tags), with_depth = 0;
    frame->visited = true;
    map_index_features(scratch, map, frame);
    const struct match_query query = map_match_query(map, scratch, tags, tag_count);
    bool known =
        landmarks_refine_pose(&query, NULL, &frame->camera_from_world, scratch->matches, MAP_MAX_FEATURES, &count);
    map_assign_matches(frame, scratch, known ? count : 0);
    for (int32_t i = 0; i < frame->feature_count; i++)
        with_depth += !map->has_depth || frame->features[i].depth > 0;
    // The pose from one tag alone is too inaccurate to add landmarks beside those of other frames. Where there are none
    // yet, the other frames are registered to this one and all are adjusted together.
    bool first = map->has_depth && !map->point_count;
    if ((known || tag_count > 1 || first) && 2 * count < with_depth)
        map_create_landmarks(map, frame);
}

// Landmarks that are near each other and have similar descriptors become one.
static enum status merge_duplicates(struct map *map)
{
    int32_t *merged_into = malloc((size_t)(map->point_count + 1) * sizeof *merged_into);
    if (!merged_into)
        return fail(ERR_MEMORY, "no memory to compare %d points", (int)map->point_count);
    for (int32_t i = 0; i < map->point_count; i++) {
        merged_into[i] = i;
        for (int32_t k = 0; k < i && i >= map->held_points; k++) {
            struct vec3 d = v3_sub(map->points[i].world, map->points[k].world);
            if (merged_into[k] == k && fabs(d.x) < DUPLICATE_M && fabs(d.y) < DUPLICATE_M && fabs(d.z) < DUPLICATE_M &&
                feature_distance(map->points[i].descriptor, map->points[k].descriptor) < DUPLICATE_BITS) {
                merged_into[i] = k;
                break;
            }
        }
    }
    int32_t kept = 0;
    for (int32_t i = 0; i < map->point_count; i++) {
        if (merged_into[i] == i) {
            map->points[kept] = map->points[i];
            merged_into[i] = kept++;
        } else {
            merged_into[i] = merged_into[merged_into[i]]; // k < i, so already final
        }
    }
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; k < map->frames[i].feature_count; k++)
            if (map->frames[i].features[k].point >= 0)
                map->frames[i].features[k].point = merged_into[map->frames[i].features[k].point];
    map->point_count = kept;
    free(merged_into);
    return OK;
}

// Matches every landmark in every placed frame again, near its projection.
static void rematch_all(struct map *map, struct map_scratch *scratch)
{
    for (int32_t i = 0; i < map->frame_count; i++) {
        struct map_frame *f = &map->frames[i];
        if (!f->placed)
            continue;
        map_index_features(scratch, map, f);
        const struct match_query query = map_match_query(map, scratch, NULL, 0);
        int count = landmarks_match(&query, (struct match_window){REMATCH_PX, false}, NULL, &f->camera_from_world,
                                    scratch->matches, MAP_MAX_FEATURES);
        map_assign_matches(f, scratch, count);
    }
}

static void count_observations(struct map *map)
{
    memset(map->point_observations, 0, (size_t)map->point_count * sizeof *map->point_observations);
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; map->frames[i].placed && k < map->frames[i].feature_count; k++)
            if (map->frames[i].features[k].point >= 0)
                map->point_observations[map->frames[i].features[k].point]++;
}

// Removes observations that are outliers to the adjusted map (more than 4 standard deviations), then those of landmarks
// with too few observations left.
static void cull_outliers(struct map *map)
{
    const struct lens *lens = &map->calibration.color;
    for (int32_t i = 0; i < map->frame_count; i++) {
        struct map_frame *f = &map->frames[i];
        for (int32_t k = 0; k < f->feature_count; k++) {
            struct map_feature *feature = &f->features[k];
            if (feature->point < 0)
                continue;
            struct vec3 ray = lens_ray(lens, feature->feature.at);
            struct pnp_point p = {.world = map->points[feature->point].world, .x = ray.x, .y = ray.y};
            landmark_covariance(&map->points[feature->point], &feature->feature, lens, &f->camera_from_world,
                                p.covariance);
            if (!f->placed || pnp_point_error(&p, NULL, &f->camera_from_world, lens->fx, lens->fy) > 4)
                feature->point = -1;
        }
    }
    count_observations(map);
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; k < map->frames[i].feature_count; k++) {
            struct map_feature *feature = &map->frames[i].features[k];
            if (feature->point >= map->held_points && map->point_observations[feature->point] < min_observations(map))
                feature->point = -1;
        }
    count_observations(map);
}

// Without depth only a landmark's observations determine its distance. Where their chi-square is larger than in one
// case of a hundred, the landmark is not a single point (a T-junction of a near and a far edge, or one that slides
// along an edge), and its error exceeds its covariance. It is removed. chi2 with n degrees of freedom has mean n and
// variance 2n; two numbers an observation, three for the position.
static enum status cull_inconsistent(struct map *map)
{
    static const double ONE_IN_A_HUNDRED = 2.33; // standard deviations
    const struct lens *lens = &map->calibration.color;
    double *squares = calloc((size_t)map->point_count + 1, sizeof *squares);
    if (!squares)
        return fail(ERR_MEMORY, "no memory to check %d points", (int)map->point_count);
    for (int pass = 0; pass < 2; pass++)
        for (int32_t i = 0; i < map->frame_count; i++)
            for (int32_t k = 0; k < map->frames[i].feature_count; k++) {
                struct map_feature *feature = &map->frames[i].features[k];
                if (feature->point < map->held_points)
                    continue;
                struct vec3 ray = lens_ray(lens, feature->feature.at);
                struct pnp_point p = {.world = map->points[feature->point].world, .x = ray.x, .y = ray.y};
                match_covariance(&map->points[feature->point], &feature->feature, p.covariance);
                double error = pnp_point_error(&p, NULL, &map->frames[i].camera_from_world, lens->fx, lens->fy);
                double spare = 2.0 * map->point_observations[feature->point] - 3;
                if (!pass)
                    squares[feature->point] += error * error;
                else if (!(squares[feature->point] <= spare + ONE_IN_A_HUNDRED * sqrt(2 * spare)))
                    feature->point = -1;
            }
    free(squares);
    count_observations(map);
    return OK;
}

// The first frame to take landmarks from: the one that shows most mapped tags. -1: none.
static int32_t best_frame(const struct map *map)
{
    int32_t best = -1;
    int max = 0;
    for (int32_t i = 0; i < map->frame_count; i++) {
        struct pnp_tag tags[PNP_MAX_TAGS];
        int count = map->frames[i].placed ? map_tag_correspondences(map, &map->frames[i], tags) : 0;
        if (count > max) {
            max = count;
            best = i;
        }
    }
    return best;
}

struct ranked {
    int32_t point, observations;
};

static int by_observations(const void *left, const void *right)
{
    const struct ranked *a = left, *b = right;
    if (a->observations != b->observations)
        return a->observations > b->observations ? -1 : 1;
    return (a->point > b->point) - (a->point < b->point);
}

// Observations that constrain a frame well enough while the map grows; more of them cost time. Chosen by hand.
enum { MIN_FRAME_OBSERVATIONS = 80 };

// The frames that show each landmark: those of landmark p are observers[start[p]] .. observers[start[p + 1] - 1].
struct covisibility {
    int32_t *start, *observers;
};

static void covisibility_free(struct covisibility *covisibility)
{
    free(covisibility->start);
    free(covisibility->observers);
}

static enum status list_covisibility(const struct map *map, struct covisibility *out)
{
    size_t points = (size_t)map->point_count, observations = 0;
    for (size_t p = 0; p < points; p++)
        observations += (size_t)map->point_observations[p];
    *out =
        (struct covisibility){calloc(points + 1, sizeof *out->start), calloc(observations + 1, sizeof *out->observers)};
    if (!out->start || !out->observers) {
        covisibility_free(out);
        return fail(ERR_MEMORY, "no memory to adjust the map");
    }
    // Each start is first the end of the landmark's list; filling it backwards moves it to the beginning.
    int32_t end = 0;
    for (size_t p = 0; p < points; p++)
        out->start[p] = end += map->point_observations[p];
    out->start[points] = end;
    for (int32_t i = map->frame_count - 1; i >= 0; i--)
        for (int32_t k = 0; map->frames[i].placed && k < map->frames[i].feature_count; k++)
            if (map->frames[i].features[k].point >= 0)
                out->observers[--out->start[map->frames[i].features[k].point]] = i;
    return OK;
}

// Goes through the landmarks, those with most observations first, and includes each that is shown by a frame with too
// few included ones.
static void select_subset(const struct map *map, const struct covisibility *covisibility, struct ranked *order,
                          bool *included)
{
    int32_t held_by[MAP_MAX_FRAMES] = {0};
    for (int32_t i = 0; i < map->point_count; i++)
        order[i] = (struct ranked){i, map->point_observations[i]};
    qsort(order, (size_t)map->point_count, sizeof *order, by_observations);
    for (int32_t n = 0; n < map->point_count; n++) {
        int32_t point = order[n].point;
        for (int32_t k = covisibility->start[point]; k < covisibility->start[point + 1]; k++)
            included[point] = included[point] || held_by[covisibility->observers[k]] < MIN_FRAME_OBSERVATIONS;
        for (int32_t k = covisibility->start[point]; included[point] && k < covisibility->start[point + 1]; k++)
            held_by[covisibility->observers[k]]++;
    }
}

// Adjusts with as few landmarks as constrain the frames: enough while the map grows.
static enum status adjust_subset(struct map *map)
{
    struct covisibility covisibility;
    enum status status = list_covisibility(map, &covisibility);
    if (status != OK)
        return status;
    struct ranked *order = calloc((size_t)map->point_count + 1, sizeof *order);
    bool *included = calloc((size_t)map->point_count + 1, sizeof *included);
    if (order && included) {
        select_subset(map, &covisibility, order, included);
        status = map_bundle_adjust_subset(map, ROUNDS, included);
    } else {
        status = fail(ERR_MEMORY, "no memory to adjust the map");
    }
    covisibility_free(&covisibility);
    free(order);
    free(included);
    return status;
}

enum status map_build_landmarks(struct map *map)
{
    struct map_scratch *d = malloc(sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    int32_t start = best_frame(map);
    for (int32_t i = start; start >= 0 && i < map->frame_count; i++)
        if (map->frames[i].placed && !map->frames[i].visited)
            add_frame_landmarks(map, d, &map->frames[i]);
    for (int32_t i = start - 1; i >= 0; i--)
        if (map->frames[i].placed && !map->frames[i].visited)
            add_frame_landmarks(map, d, &map->frames[i]);
    cull_outliers(map);
    free(d);
    return adjust_subset(map);
}

// Keeps the constant landmarks, and of the others the `max` with most observations. ERR_MEMORY.
static enum status keep_best(struct map *map, int32_t max)
{
    struct ranked *order = malloc((size_t)(map->point_count + 1) * sizeof *order);
    int32_t *now = malloc((size_t)(map->point_count + 1) * sizeof *now);
    struct place_landmark *chosen = malloc((size_t)(map->point_count + 1) * sizeof *chosen);
    enum status status =
        order && now && chosen ? OK : fail(ERR_MEMORY, "no memory to choose among %d points", (int)map->point_count);
    int32_t count = 0, held = map->held_points;
    for (int32_t i = 0; i < held && status == OK; i++)
        now[i] = i;
    for (int32_t i = held; i < map->point_count && status == OK; i++) {
        now[i] = -1;
        if (map->point_observations[i] >= min_observations(map) && v3_finite(map->points[i].world))
            order[count++] = (struct ranked){i, map->point_observations[i]};
    }
    if (status == OK) {
        qsort(order, (size_t)count, sizeof *order, by_observations);
        count = count < max ? count : max;
        for (int32_t n = 0; n < count; n++) {
            chosen[n] = map->points[order[n].point];
            now[order[n].point] = held + n;
        }
        memcpy(map->points + held, chosen, (size_t)count * sizeof *chosen);
        map->point_count = held + count;
        for (int32_t i = 0; i < map->frame_count; i++)
            for (int32_t k = 0; k < map->frames[i].feature_count; k++)
                if (map->frames[i].features[k].point >= 0)
                    map->frames[i].features[k].point = now[map->frames[i].features[k].point];
        count_observations(map);
    }
    free(order);
    free(now);
    free(chosen);
    return status;
}

// Gives each new landmark the medoid of its observations' descriptors (Hamming distance). ERR_MEMORY.
static enum status select_descriptors(struct map *map)
{
    enum { MOST = 12 };
    const uint8_t **seen = calloc((size_t)map->point_count * MOST + 1, sizeof *seen);
    int *count = calloc((size_t)map->point_count + 1, sizeof *count);
    for (int32_t i = 0; i < map->frame_count && seen && count; i++)
        for (int32_t k = 0; k < map->frames[i].feature_count; k++) {
            const struct map_feature *feature = &map->frames[i].features[k];
            if (feature->point >= 0 && count[feature->point] < MOST)
                seen[feature->point * MOST + count[feature->point]++] = feature->feature.descriptor;
        }
    for (int32_t i = map->held_points; i < map->point_count && seen && count; i++) {
        int min = 1 << 30;
        for (int a = 0; a < count[i]; a++) {
            int sum = 0;
            for (int b = 0; b < count[i]; b++)
                sum += feature_distance(seen[i * MOST + a], seen[i * MOST + b]);
            if (sum < min) {
                min = sum;
                memcpy(map->points[i].descriptor, seen[i * MOST + a], sizeof map->points[i].descriptor);
            }
        }
    }
    enum status status =
        seen && count ? OK : fail(ERR_MEMORY, "no memory to describe %d points", (int)map->point_count);
    free(seen);
    free(count);
    return status;
}

// ---------------------------------------------------------------- read-out time

// Where nobody gave the camera's read-out time and the sweep shows that there is one: that by which the adjusted map
// has the least cost, of READOUT_TRIALS a step apart, between them by a parabola.
static const double READOUT_STEP_S = 8e-3; // cameras have 10 to 33 ms
static const double READOUT_GAIN = 0.01;   // of the cost, that it must save: chosen by hand
enum { READOUT_TRIALS = 6, READOUT_FINE_TRIALS = 3 };

// The lowest point of the parabola through three costs a step apart; from -1 to 1, of a step from the middle one.
static double parabola_lowest(double before, double middle, double after)
{
    const double bend = before - 2 * middle + after;
    return bend > 0 ? fmax(-1, fmin(1, 0.5 * (before - after) / bend)) : 0;
}

// Adjusts with read-out times from first_s on; the lens has the best one then. *gain: the share of the first one's cost
// that it saves. Ends early where the cost rises.
static enum status try_readouts(struct map *map, double first_s, double step_s, int trials, double *gain)
{
    double cost[READOUT_TRIALS];
    int best = 0, tried = 0;
    for (; tried < trials && tried <= best + 1; tried++) {
        map->calibration.color.readout_s = first_s + tried * step_s;
        const enum status status = map_bundle_adjust(map, REFINE_ROUNDS, false, &cost[tried]);
        if (status != OK)
            return status;
        best = cost[tried] < cost[best] ? tried : best;
    }
    const bool inside = best > 0 && best + 1 < tried;
    const double share = inside ? parabola_lowest(cost[best - 1], cost[best], cost[best + 1]) : 0;
    map->calibration.color.readout_s = first_s + (best + share) * step_s;
    *gain = cost[0] > 0 ? (cost[0] - cost[best]) / cost[0] : 0;
    return OK;
}

static enum status settle_readout(struct map *map)
{
    double *readout_s = &map->calibration.color.readout_s, gain;
    const double before_s = *readout_s;
    if ((before_s > 0 && !map->found_readout) || map->has_prior || !map_shows_longer_readout(map))
        return OK;
    const double step_s = map->found_readout ? 0.5 * READOUT_STEP_S : READOUT_STEP_S;
    const enum status status = try_readouts(map, map->found_readout ? before_s - step_s : 0, step_s,
                                            map->found_readout ? READOUT_FINE_TRIALS : READOUT_TRIALS, &gain);
    if (status != OK)
        return status;
    if (!map->found_readout && gain < READOUT_GAIN)
        *readout_s = 0;
    map->found_readout = *readout_s > 0;
    return map_bundle_adjust(map, REFINE_ROUNDS, false, NULL);
}

enum status map_refine_landmarks(struct map *map, int32_t max)
{
    struct map_scratch *d = malloc(sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    enum status status = merge_duplicates(map);
    for (int round = 0; round < 2 && status == OK; round++) {
        rematch_all(map, d);
        if (!map->has_depth)
            status = map_cull_low_parallax(map);
        cull_outliers(map);
        if (status == OK)
            status = keep_best(map, max);
        if (status == OK)
            status = round ? map_bundle_adjust(map, REFINE_ROUNDS, false, NULL)
                           : map_bundle_adjust_depth_scale(map, REFINE_ROUNDS);
        if (status == OK)
            status = settle_readout(map);
    }
    cull_outliers(map);
    if (!map->has_depth && status == OK)
        status = cull_inconsistent(map);
    if (!map->has_depth && status == OK) // without the observations just removed
        status = map_bundle_adjust(map, REFINE_ROUNDS, false, NULL);
    if (status == OK)
        status = keep_best(map, max);
    if (status == OK)
        status = select_descriptors(map);
    free(d);
    return status;
}
