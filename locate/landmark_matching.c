#include "locate/landmark_matching.h"

#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

enum {
    CELL_PX = 16,
    MAX_BITS = 64,          // of 256 that may differ
    MAX_BITS_NARROW = 80,   // the same within LANDMARK_NARROW_PX: then one in ten shows something else
    MAX_RATIO_PERCENT = 80, // percent: the best must differ by less than this share of the second best
    MIN_POINTS = 12,
};

void feature_index_build(struct feature_index *index, const struct feature *features, int count,
                         const struct lens *lens)
{
    index->features = features;
    index->count = count < FEATURES_MAX ? count : FEATURES_MAX;
    int cell = CELL_PX;
    do {
        index->across = (lens->width + cell - 1) / cell;
        index->down = (lens->height + cell - 1) / cell;
        cell *= 2;
    } while (index->across * index->down > 4096);
    memset(index->start, 0, sizeof index->start);
    int cells[FEATURES_MAX];
    for (int i = 0; i < index->count; i++) {
        int x = (int)(features[i].at.x * index->across / lens->width),
            y = (int)(features[i].at.y * index->down / lens->height);
        x = x < 0 ? 0 : x >= index->across ? index->across - 1 : x;
        y = y < 0 ? 0 : y >= index->down ? index->down - 1 : y;
        cells[i] = y * index->across + x;
        index->start[cells[i] + 1]++;
    }
    for (int i = 0; i < index->across * index->down; i++)
        index->start[i + 1] += index->start[i];
    int next[4097];
    memcpy(next, index->start, sizeof next);
    for (int i = 0; i < index->count; i++)
        index->order[next[cells[i]]++] = i;
}

void feature_covariance(const struct feature *f, double out[3])
{
    // Measured in the small world, between two features that truly show one point: the standard deviation in pixels of
    // the feature's copy, by the ratio of the slope's two main values. Along an edge it slides no further than it is
    // looked for. Each of the two has half of the variance.
    static const double CORNER = 0.5, ACROSS = -0.25, LEAST = 0.24, ALONG = 0.4, MOST = 1.3, EACH = 0.5;
    double middle = (f->slope[0] + f->slope[2]) / 2.0, turn_x = (f->slope[0] - f->slope[2]) / 2.0, turn_y = f->slope[1];
    double apart = hypot(turn_x, turn_y), ratio = (middle + apart) / fmax(middle - apart, 1e-6 * (middle + 1e-6));
    ratio = fmax(ratio, 1);
    double across = fmax(LEAST, CORNER * pow(ratio, ACROSS)) * f->scale;
    double along = fmin(MOST, CORNER * pow(ratio, ALONG)) * f->scale;
    // Half of the two variances' sum, and what the direction of the slope takes from it or adds.
    double mean = EACH * (across * across + along * along) / 2;
    double change = apart > 0 ? (EACH * across * across - mean) / apart : 0;
    out[0] = mean + change * turn_x;
    out[1] = change * turn_y;
    out[2] = mean - change * turn_x;
}

// r^T C q.
static double bilinear_form(const float c[6], struct vec3 r, struct vec3 q)
{
    struct vec3 cq = {(double)c[0] * q.x + (double)c[1] * q.y + (double)c[2] * q.z,
                      (double)c[1] * q.x + (double)c[3] * q.y + (double)c[4] * q.z,
                      (double)c[2] * q.x + (double)c[4] * q.y + (double)c[5] * q.z};
    return v3_dot(r, cq);
}

// What looks less alike was found less exactly, or is something else: by how much larger the variance is than usual.
static double variance_factor(const struct place_point *point, const struct feature *f)
{
    // Measured in the small world, between features within LANDMARK_NARROW_PX that should show one point: mean squared
    // error by bits that differ, 0.35 of the usual at 7, 0.62 at 16, 0.95 at 25, 1.5 at 35, 2.5 at 45, 3.5 at 55, 4.7
    // at 65.
    double bits = feature_distance(point->descriptor, f->descriptor) / 32.0;
    return fmax(1, 0.3 + bits * bits);
}

void match_covariance(const struct place_point *point, const struct feature *f, double out[3])
{
    double times = variance_factor(point, f);
    feature_covariance(f, out);
    for (int i = 0; i < 3; i++)
        out[i] *= times;
}

void landmark_covariance(const struct place_point *point, const struct feature *f, const struct lens *lens,
                         const struct pose *camera_from_world, double out[3])
{
    struct vec3 p = pose_apply(*camera_from_world, point->world);
    match_covariance(point, f, out);
    // The sweep's pictures showed it no better, and an edge leads all of them astray alike.
    for (int i = 0; i < 3; i++)
        out[i] *= 2;
    if (!(p.z > 0.1))
        return;
    // How far the picture of the point moves with it, world axes.
    struct quat back = quat_conjugate(camera_from_world->rotation);
    struct vec3 x = quat_rotate(back, v3(lens->fx / p.z, 0, -lens->fx * p.x / (p.z * p.z)));
    struct vec3 y = quat_rotate(back, v3(0, lens->fy / p.z, -lens->fy * p.y / (p.z * p.z)));
    out[0] += bilinear_form(point->covariance, x, x);
    out[1] += bilinear_form(point->covariance, x, y);
    out[2] += bilinear_form(point->covariance, y, y);
}

double landmark_depth_variance(const struct place_point *point, const struct pose *camera_from_world)
{
    struct vec3 z = quat_rotate(quat_conjugate(camera_from_world->rotation), v3(0, 0, 1));
    return bilinear_form(point->covariance, z, z);
}

double feature_depth(const struct lens *lens, const uint16_t *depth, struct pixel at)
{
    int x = (int)floor(at.x + 0.5), y = (int)floor(at.y + 0.5), count = 0, low = 65535, high = 0;
    double sum = 0;
    if (x < 1 || y < 1 || x > lens->width - 2 || y > lens->height - 2)
        return 0;
    for (int dy = -1; dy <= 1; dy++) {
        for (int dx = -1; dx <= 1; dx++) {
            int z = depth[(size_t)(y + dy) * (size_t)lens->width + (size_t)(x + dx)];
            if (!z)
                continue;
            low = z < low ? z : low;
            high = z > high ? z : high;
            sum += z;
            count++;
        }
    }
    double z = count ? sum / count * 1e-3 : 0;
    return count >= 6 && (high - low) * 1e-3 < 5 * depth_sigma(z) + 0.01 * z ? z : 0;
}

static bool within_distance(struct pixel a, struct pixel b, double distance)
{
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) < distance * distance;
}

// The feature within the radius that looks most like the point; -1: none, or not clearly.
static int best_feature(const struct place_point *point, const struct feature_index *index, const struct lens *lens,
                        struct pixel at, double radius, int *bits)
{
    int x0 = (int)((at.x - radius) * index->across / lens->width),
        x1 = (int)((at.x + radius) * index->across / lens->width);
    int y0 = (int)((at.y - radius) * index->down / lens->height),
        y1 = (int)((at.y + radius) * index->down / lens->height);
    x0 = x0 < 0 ? 0 : x0, y0 = y0 < 0 ? 0 : y0;
    x1 = x1 >= index->across ? index->across - 1 : x1, y1 = y1 >= index->down ? index->down - 1 : y1;
    int best = -1, second = 256;
    *bits = 257;
    for (int y = y0; y <= y1; y++) {
        for (int k = index->start[y * index->across + x0]; k < index->start[y * index->across + x1 + 1]; k++) {
            const struct feature *f = &index->features[index->order[k]];
            double dx = f->at.x - at.x, dy = f->at.y - at.y;
            if (dx * dx + dy * dy > radius * radius)
                continue;
            int d = feature_distance(point->descriptor, f->descriptor);
            if (d >= second && d >= *bits)
                continue;
            // The same corner in another copy of the picture is no rival.
            bool same = best >= 0 && within_distance(f->at, index->features[best].at, 3);
            if (d < *bits) {
                if (!same)
                    second = *bits;
                *bits = d;
                best = index->order[k];
            } else if (!same && d < second) {
                second = d;
            }
        }
    }
    int most = radius > LANDMARK_NARROW_PX ? MAX_BITS : MAX_BITS_NARROW;
    return *bits <= most && *bits * 100 < MAX_RATIO_PERCENT * second ? best : -1;
}

// Whether a camera at `eye` sees the point from about the side from which the sweep saw it. True where that is not
// known.
static bool faces_camera(const struct place_point *point, struct vec3 eye)
{
    // So much further aside than the sweep's own pictures of it on average, as a cosine: 30 degrees. Of what seemed to
    // be a point of the small world, one in 900 was something else up to there, one in 35 beyond.
    static const double ASIDE = 0.866;
    const struct vec3 mean = {(double)point->seen_from[0], (double)point->seen_from[1], (double)point->seen_from[2]};
    double square = v3_dot(mean, mean); // the mean, too, of the cosines between the mean and what it is made of
    return square == 0 || v3_dot(v3_unit(v3_sub(eye, point->world)), mean) > square - (1 - ASIDE);
}

int landmarks_match(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                    const struct lens *lens, const struct shutter_motion *motion, const struct pose *camera_from_world,
                    double radius_px, bool only_facing, struct landmark_match *out, int capacity)
{
    int32_t owner[FEATURES_MAX];
    int bits_of[FEATURES_MAX];
    double wide = 0.8 * lens->width / lens->fx, high = 0.8 * lens->height / lens->fy;
    const struct vec3 eye = pose_inverse(*camera_from_world).translation;
    for (int i = 0; i < index->count; i++)
        owner[i] = -1;
    for (int32_t i = 0; i < point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, points[i].world);
        if (!(p.z > 0.1) || fabs(p.x) > wide * p.z || fabs(p.y) > high * p.z)
            continue;
        struct pixel at = shutter_project(lens, motion, p);
        if (!(at.x > -radius_px && at.y > -radius_px && at.x < lens->width + radius_px &&
              at.y < lens->height + radius_px))
            continue;
        if (only_facing && !faces_camera(&points[i], eye))
            continue;
        int bits, f = best_feature(&points[i], index, lens, at, radius_px, &bits);
        if (f >= 0 && (owner[f] < 0 || bits < bits_of[f])) {
            owner[f] = i;
            bits_of[f] = bits;
        }
    }
    int count = 0;
    for (int f = 0; f < index->count && count < capacity; f++)
        if (owner[f] >= 0)
            out[count++] = (struct landmark_match){owner[f], f};
    return count;
}

int landmark_correspondences(const struct place_point *points, const struct feature_index *index, const double *depth,
                             const struct lens *lens, const struct pose *camera_from_world,
                             const struct landmark_match *matches, int count, struct pnp_point *out)
{
    for (int i = 0; i < count; i++) {
        const struct feature *f = &index->features[matches[i].feature];
        const struct place_point *point = &points[matches[i].point];
        struct vec3 ray = lens_ray(lens, f->at);
        out[i] = (struct pnp_point){.world = point->world,
                                    .x = ray.x,
                                    .y = ray.y,
                                    .z = depth ? depth[matches[i].feature] : 0,
                                    .z_variance = landmark_depth_variance(point, camera_from_world),
                                    .time_s = shutter_row_time(lens, f->at.y)};
        landmark_covariance(point, f, lens, camera_from_world, out[i].covariance);
    }
    return count;
}

// The direction in which points lie closest together: a wall's normal. Inverse iteration.
static struct vec3 plane_normal(const struct pnp_point *points, int count, struct vec3 centre)
{
    double a[9] = {0}, trace = 0, n[3] = {0.48, 0.6, 0.64};
    for (int i = 0; i < count; i++) {
        struct vec3 d = v3_sub(points[i].world, centre);
        const double x[3] = {d.x, d.y, d.z};
        for (int r = 0; r < 3; r++)
            for (int c = 0; c <= r; c++)
                a[r * 3 + c] += x[r] * x[c];
    }
    trace = a[0] + a[4] + a[8];
    for (int r = 0; r < 3; r++)
        a[r * 4] += 1e-9 * trace + 1e-12;
    if (!cholesky_factor(a, 3))
        return v3(0, 0, 0);
    for (int round = 0; round < 20; round++) {
        cholesky_solve(a, 3, n);
        struct vec3 u = v3_unit(v3(n[0], n[1], n[2]));
        n[0] = u.x, n[1] = u.y, n[2] = u.z;
    }
    return v3(n[0], n[1], n[2]);
}

// A wall seen nearly head-on looks much the same from the mirrored side. Where the
// mirrored pose fits better, it is taken.
static void try_mirrored(const struct pnp_tag *tags, int tag_count, const struct pnp_point *points, int count,
                         const struct lens *lens, struct shutter_motion *motion, struct pose *camera_from_world)
{
    struct shutter_motion moving = motion ? *motion : shutter_motion_unknown();
    struct vec3 centre = v3(0, 0, 0);
    for (int i = 0; i < count; i++)
        centre = v3_add(centre, v3_scale(points[i].world, 1.0 / count));
    struct vec3 normal = plane_normal(points, count, centre);
    struct pose world_from_camera = pose_inverse(*camera_from_world);
    struct vec3 out = v3_sub(world_from_camera.translation, centre);
    struct vec3 mirrored = v3_sub(v3_scale(normal, 2 * v3_dot(normal, out)), out);
    struct quat turn = quat_between(out, mirrored);
    struct pose there = {quat_multiply(turn, world_from_camera.rotation), v3_add(centre, quat_rotate(turn, out))};
    struct pose pose = pose_inverse(there);
    double own = pnp_refine(tags, tag_count, 0, points, count, 0, lens->fx, lens->fy, motion, camera_from_world);
    double other = pnp_refine(tags, tag_count, 0, points, count, 0, lens->fx, lens->fy, motion ? &moving : NULL, &pose);
    if (!(other < own))
        return;
    *camera_from_world = pose;
    if (motion)
        *motion = moving;
}

// Searched ever nearer, each time from the pose that the last search gave; the fit of
// each begins as loose as the search. facing_first: points seen from another side than in
// the sweep join in when the others have said where they must be. How many points agree in
// the end, of *first found at first.
static int match_and_refine(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                            const double *depth, const struct lens *lens, const struct pnp_tag *tags, int tag_count,
                            double radius_px, bool facing_first, struct shutter_motion *motion, struct pose *pose,
                            struct landmark_match *matches, int capacity, int *first)
{
    struct pnp_point seen[FEATURES_MAX];
    int count;
    *first = 0;
    for (double radius = radius_px;; radius = fmax(radius / 2.5, LANDMARK_NARROW_PX)) {
        const bool only_facing = facing_first && radius > LANDMARK_NARROW_PX;
        count = landmarks_match(points, point_count, index, lens, motion, pose, radius, only_facing, matches, capacity);
        *first = *first ? *first : count;
        if (count < MIN_POINTS)
            return 0;
        landmark_correspondences(points, index, depth, lens, pose, matches, count, seen);
        for (double loose = radius / 3; loose > 0.5; loose /= 3)
            pnp_refine(tags, tag_count, 0, seen, count, loose, lens->fx, lens->fy, motion, pose);
        if (radius <= LANDMARK_NARROW_PX)
            break;
    }
    try_mirrored(tags, tag_count, seen, count, lens, motion, pose);
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (pnp_point_error(&seen[i], motion, pose, lens->fx, lens->fy) < 4)
            matches[kept++] = matches[i];
    return kept < MIN_POINTS || 2 * kept < count ? 0 : kept;
}

// The matches of points that face the camera. How many.
static int facing_matches(const struct place_point *points, const struct landmark_match *matches, int count,
                          const struct pose *camera_from_world, struct landmark_match *out)
{
    const struct vec3 eye = pose_inverse(*camera_from_world).translation;
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (faces_camera(&points[matches[i].point], eye))
            out[kept++] = matches[i];
    return kept;
}

// Where the points that face the camera, by themselves, know of another pose than all together, the others show
// something else and are left out. How many matches remain; as many where too few face it to tell.
static int drop_inconsistent(const struct place_point *points, const struct feature_index *index, const double *depth,
                             const struct lens *lens, struct shutter_motion *motion, struct pose *pose,
                             struct landmark_match *matches, int count)
{
    static const double WITHIN_95 = 12.592; // chi squared, six numbers
    struct pnp_point seen[FEATURES_MAX];
    struct landmark_match facing[FEATURES_MAX];
    struct pose alone = *pose;
    struct shutter_motion moving = motion ? *motion : shutter_motion_unknown(), *with = motion ? &moving : NULL;
    double covariance[36], information[36], off = 0;
    int n = facing_matches(points, matches, count, pose, facing);
    if (n == count || n < MIN_POINTS)
        return count;
    landmark_correspondences(points, index, depth, lens, pose, facing, n, seen);
    pnp_refine(NULL, 0, 0, seen, n, 0, lens->fx, lens->fy, with, &alone);
    if (!pnp_covariance(NULL, 0, seen, n, lens->fx, lens->fy, with, &alone, covariance) ||
        !invert_symmetric(covariance, 6, information))
        return count;
    struct pose between = pose_multiply(alone, pose_inverse(*pose));
    struct vec3 turn = quat_to_rotation_vector(between.rotation);
    const double d[6] = {turn.x, turn.y, turn.z, between.translation.x, between.translation.y, between.translation.z};
    for (int i = 0; i < 36; i++)
        off += d[i / 6] * information[i] * d[i % 6];
    if (off < WITHIN_95) // of those alone; from a pose that they have part in they differ by less
        return count;
    *pose = alone;
    if (motion)
        *motion = moving;
    memcpy(matches, facing, (size_t)n * sizeof *matches);
    return n;
}

bool landmarks_refine_pose(const struct place_point *points, int32_t point_count, const struct feature_index *index,
                           const double *depth, const struct lens *lens, const struct pnp_tag *tags, int tag_count,
                           struct shutter_motion *motion, struct pose *camera_from_world,
                           struct landmark_match *matches, int capacity, int *match_count)
{
    // A small far tag alone may be off by more than the first search reaches. That
    // shows: most of what seemed to match at first does not in the end. And without a tag
    // a pattern that looks the same turned round may lead all of its points astray alike:
    // then those that are seen from where the sweep saw them know of a pose that more fit.
    static const double FIRST_PX = 40, FAR_PX = 120;
    struct landmark_match other_matches[FEATURES_MAX];
    const struct pose start = *camera_from_world;
    const struct shutter_motion still = motion ? *motion : shutter_motion_unknown();
    struct pose best = start;
    struct shutter_motion best_motion = still;
    int first = 0, kept = 0;
    if (capacity > FEATURES_MAX)
        capacity = FEATURES_MAX;
    for (int way = 0; way < 3; way++) { // near, far, facing first
        struct pose pose = start;
        struct shutter_motion moving = still;
        int other_first;
        if (way == 1 && 2 * kept >= first)
            continue;
        if (way == 2 && (tag_count || !kept || facing_matches(points, matches, kept, &best, other_matches) == kept))
            continue;
        int other =
            match_and_refine(points, point_count, index, depth, lens, tags, tag_count, way == 1 ? FAR_PX : FIRST_PX,
                             way == 2, motion ? &moving : NULL, &pose, other_matches, capacity, &other_first);
        if (way == 0)
            first = other_first;
        if (other <= kept)
            continue;
        memcpy(matches, other_matches, (size_t)other * sizeof *matches);
        kept = other;
        best = pose;
        best_motion = moving;
    }
    if (!kept)
        return false;
    *camera_from_world = best;
    if (motion)
        *motion = best_motion;
    *match_count =
        tag_count ? kept : drop_inconsistent(points, index, depth, lens, motion, camera_from_world, matches, kept);
    return true;
}
