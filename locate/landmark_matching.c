#include "locate/landmark_matching.h"

#include "base/clamp.h"
#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

enum {
    CELL_PX = 16,
    MAX_BITS = 64,          // of 256 that may differ; chosen by hand
    MAX_BITS_NARROW = 80,   // within LANDMARK_NARROW_PX; tuned on the tests' small world: one in ten is then wrong
    MAX_RATIO_PERCENT = 80, // the best must differ by less than this percentage of the second best; chosen by hand
    MIN_POINTS = 12,        // fewer matches are no basis for a pose; chosen by hand
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
        x = clamp_int(x, 0, index->across - 1);
        y = clamp_int(y, 0, index->down - 1);
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

void feature_covariance(const struct feature *feature, double out[3])
{
    // Tuned on the tests' small world (tests/world), the known truth of which tells between which two features the same
    // point is seen: the standard deviation of their difference, in pixels of the pyramid level, as a power of the
    // ratio of the gradient matrix's eigenvalues. Along an edge it is bounded by the search radius. Each of the two
    // features has half of the variance.
    static const double CORNER = 0.5, ACROSS = -0.25, LEAST = 0.24, ALONG = 0.4, MOST = 1.3, EACH = 0.5;
    double middle = (feature->slope[0] + feature->slope[2]) / 2.0,
           apart_x = (feature->slope[0] - feature->slope[2]) / 2.0, apart_y = feature->slope[1];
    double apart = hypot(apart_x, apart_y), ratio = (middle + apart) / fmax(middle - apart, 1e-6 * (middle + 1e-6));
    ratio = fmax(ratio, 1);
    double across = fmax(LEAST, CORNER * pow(ratio, ACROSS)) * feature->scale;
    double along = fmin(MOST, CORNER * pow(ratio, ALONG)) * feature->scale;
    // The mean of the two variances, and the deviatoric part along the gradient's direction.
    double mean = EACH * (across * across + along * along) / 2;
    double change = apart > 0 ? (EACH * across * across - mean) / apart : 0;
    out[0] = mean + change * apart_x;
    out[1] = change * apart_y;
    out[2] = mean - change * apart_x;
}

// r^T C q.
static double bilinear_form(const float c[6], struct vec3 r, struct vec3 q)
{
    struct vec3 cq = {(double)c[0] * q.x + (double)c[1] * q.y + (double)c[2] * q.z,
                      (double)c[1] * q.x + (double)c[3] * q.y + (double)c[4] * q.z,
                      (double)c[2] * q.x + (double)c[4] * q.y + (double)c[5] * q.z};
    return v3_dot(r, cq);
}

// Variance against the usual one: where more bits differ, the match is less exact, or wrong.
static double variance_factor(const struct place_landmark *point, const struct feature *feature)
{
    // Tuned on the tests' small world: mean squared error of features within LANDMARK_NARROW_PX that should show the
    // same point, by bits that differ: 0.35 of the usual at 7, 0.62 at 16, 0.95 at 25, 1.5 at 35, 2.5 at 45, 3.5 at 55,
    // 4.7 at 65.
    double bits = feature_distance(point->descriptor, feature->descriptor) / 32.0;
    return fmax(1, 0.3 + bits * bits);
}

void match_covariance(const struct place_landmark *point, const struct feature *feature, double out[3])
{
    double times = variance_factor(point, feature);
    feature_covariance(feature, out);
    for (int i = 0; i < 3; i++)
        out[i] *= times;
}

void landmark_covariance(const struct place_landmark *point, const struct feature *feature, const struct lens *lens,
                         const struct pose *camera_from_world, double out[3])
{
    struct vec3 p = pose_apply(*camera_from_world, point->world);
    match_covariance(point, feature, out);
    // The sweep's images showed it no better, and along an edge their errors are the same, so they do not average out.
    for (int i = 0; i < 3; i++)
        out[i] *= 2;
    if (!(p.z > 0.1))
        return;
    // Derivatives of the projection by the point, world axes.
    struct quat back = quat_conjugate(camera_from_world->rotation);
    struct vec3 x = quat_rotate(back, v3(lens->fx / p.z, 0, -lens->fx * p.x / (p.z * p.z)));
    struct vec3 y = quat_rotate(back, v3(0, lens->fy / p.z, -lens->fy * p.y / (p.z * p.z)));
    out[0] += bilinear_form(point->covariance, x, x);
    out[1] += bilinear_form(point->covariance, x, y);
    out[2] += bilinear_form(point->covariance, y, y);
}

double landmark_depth_variance(const struct place_landmark *point, const struct pose *camera_from_world)
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
    return count >= 6 && (high - low) * 1e-3 < 5 * depth_absolute_sigma_m(z) + 0.01 * z ? z : 0;
}

static bool within_distance(struct pixel a, struct pixel b, double distance)
{
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) < distance * distance;
}

// The feature within the radius with the fewest differing bits; -1: none, or not clearly the best.
static int best_feature(const struct place_landmark *point, const struct feature_index *index, const struct lens *lens,
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
            // The same corner at another pyramid level does not compete in the ratio test.
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
    int max = radius > LANDMARK_NARROW_PX ? MAX_BITS : MAX_BITS_NARROW;
    return *bits <= max && *bits * 100 < MAX_RATIO_PERCENT * second ? best : -1;
}

// Whether a camera at `eye` sees the landmark from about the side from which the sweep saw it. True where that is not
// known.
static bool faces_camera(const struct place_landmark *point, struct vec3 eye)
{
    // Cosine of the angle allowed beyond that of the sweep's own images on average: 30 degrees. Tuned on the tests'
    // small world: up to there one match in 900 was wrong, beyond it one in 35.
    static const double ASIDE = 0.866;
    const struct vec3 mean = {(double)point->seen_from[0], (double)point->seen_from[1], (double)point->seen_from[2]};
    double square = v3_dot(mean, mean); // equals the mean cosine between the mean and its unit vectors
    return square == 0 || v3_dot(v3_unit(v3_sub(eye, point->world)), mean) > square - (1 - ASIDE);
}

int landmarks_match(const struct match_query *query, struct match_window window, const struct shutter_motion *motion,
                    const struct pose *camera_from_world, struct landmark_match *out, int capacity)
{
    const struct place_landmark *points = query->points;
    const struct feature_index *index = query->index;
    const struct lens *lens = query->lens;
    const double radius_px = window.radius_px;
    int32_t owner[FEATURES_MAX];
    int bits_of[FEATURES_MAX];
    double wide = 0.8 * lens->width / lens->fx, high = 0.8 * lens->height / lens->fy;
    const struct vec3 eye = pose_inverse(*camera_from_world).translation;
    for (int i = 0; i < index->count; i++)
        owner[i] = -1;
    for (int32_t i = 0; i < query->point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, points[i].world);
        if (!(p.z > 0.1) || fabs(p.x) > wide * p.z || fabs(p.y) > high * p.z)
            continue;
        struct pixel at = shutter_project(lens, motion, p);
        if (!(at.x > -radius_px && at.y > -radius_px && at.x < lens->width + radius_px &&
              at.y < lens->height + radius_px))
            continue;
        if (window.only_facing && !faces_camera(&points[i], eye))
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

int landmark_correspondences(const struct match_query *query, const struct pose *camera_from_world,
                             const struct landmark_match *matches, int count, struct pnp_point *out)
{
    const struct lens *lens = query->lens;
    for (int i = 0; i < count; i++) {
        const struct feature *f = &query->index->features[matches[i].feature];
        const struct place_landmark *point = &query->points[matches[i].point];
        struct vec3 ray = lens_ray(lens, f->at);
        out[i] = (struct pnp_point){.world = point->world,
                                    .x = ray.x,
                                    .y = ray.y,
                                    .z = query->depth ? query->depth[matches[i].feature] : 0,
                                    .z_variance = landmark_depth_variance(point, camera_from_world),
                                    .time_s = shutter_row_time(lens, f->at.y)};
        landmark_covariance(point, f, lens, camera_from_world, out[i].covariance);
    }
    return count;
}

// The normal of the plane that fits the points best: smallest eigenvector of their covariance, by inverse iteration.
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

// A wall seen nearly head-on looks much the same from the mirrored side. Where the mirrored pose fits better, it is
// taken. problem: all matches and tags, with the current motion.
static void try_mirrored(const struct pose_problem *problem, struct pose *camera_from_world)
{
    struct shutter_motion *motion = problem->motion, moving = motion ? *motion : shutter_motion_unknown();
    const struct pnp_point *points = problem->points;
    const int count = problem->point_count;
    struct pose_problem mirrored_problem = *problem;
    struct vec3 centre = v3(0, 0, 0);
    for (int i = 0; i < count; i++)
        centre = v3_add(centre, v3_scale(points[i].world, 1.0 / count));
    struct vec3 normal = plane_normal(points, count, centre);
    struct pose world_from_camera = pose_inverse(*camera_from_world);
    struct vec3 out = v3_sub(world_from_camera.translation, centre);
    struct vec3 mirrored = v3_sub(v3_scale(normal, 2 * v3_dot(normal, out)), out);
    struct quat rotation = quat_between(out, mirrored);
    struct pose there = {quat_multiply(rotation, world_from_camera.rotation),
                         v3_add(centre, quat_rotate(rotation, out))};
    struct pose pose = pose_inverse(there);
    mirrored_problem.motion = motion ? &moving : NULL;
    double own = pnp_refine(problem, camera_from_world);
    double other = pnp_refine(&mirrored_problem, &pose);
    if (!(other < own))
        return;
    *camera_from_world = pose;
    if (motion)
        *motion = moving;
}

struct refinement {
    struct pose pose; // camera_from_world
    struct shutter_motion motion;
    int first, kept; // matches of the first search, and those that agree in the end
};

// Matches within ever smaller radii, each time from the pose that the last radius gave; the added uncertainty begins as
// large as the radius. window.only_facing: landmarks seen from another side than in the sweep take part only in the
// narrowest search, when the others have given the pose. matches: those that agree in the end.
static void match_and_refine(const struct match_query *query, struct match_window window, bool rolling,
                             struct refinement *refinement, struct landmark_match *matches, int capacity)
{
    struct pnp_point seen[FEATURES_MAX];
    struct pose_problem problem = {.tags = query->tags,
                                   .tag_count = query->tag_count,
                                   .points = seen,
                                   .fx = query->lens->fx,
                                   .fy = query->lens->fy,
                                   .motion = rolling ? &refinement->motion : NULL};
    int count;
    refinement->first = refinement->kept = 0;
    for (double radius = window.radius_px;; radius = fmax(radius / 2.5, LANDMARK_NARROW_PX)) {
        const bool only_facing = window.only_facing && radius > LANDMARK_NARROW_PX;
        count = landmarks_match(query, (struct match_window){radius, only_facing}, problem.motion, &refinement->pose,
                                matches, capacity);
        refinement->first = refinement->first ? refinement->first : count;
        if (count < MIN_POINTS)
            return;
        problem.point_count = landmark_correspondences(query, &refinement->pose, matches, count, seen);
        for (problem.point_px = radius / 3; problem.point_px > 0.5; problem.point_px /= 3)
            pnp_refine(&problem, &refinement->pose);
        if (radius <= LANDMARK_NARROW_PX)
            break;
    }
    problem.point_px = 0;
    try_mirrored(&problem, &refinement->pose);
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (pnp_point_error(&seen[i], problem.motion, &refinement->pose, problem.fx, problem.fy) < 4)
            matches[kept++] = matches[i];
    refinement->kept = kept < MIN_POINTS || 2 * kept < count ? 0 : kept;
}

// The matches of landmarks that face the camera. How many.
static int facing_matches(const struct place_landmark *points, const struct landmark_match *matches, int count,
                          const struct pose *camera_from_world, struct landmark_match *out)
{
    const struct vec3 eye = pose_inverse(*camera_from_world).translation;
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (faces_camera(&points[matches[i].point], eye))
            out[kept++] = matches[i];
    return kept;
}

// Where the landmarks that face the camera, by themselves, give another pose than all together, the others are wrong
// matches and are left out. How many matches remain; all of them where too few face the camera to decide.
static int drop_inconsistent(const struct match_query *query, struct shutter_motion *motion, struct pose *pose,
                             struct landmark_match *matches, int count)
{
    static const double WITHIN_95 = 12.592; // chi squared, six degrees of freedom
    struct pnp_point seen[FEATURES_MAX];
    struct landmark_match facing[FEATURES_MAX];
    struct pose alone = *pose;
    struct shutter_motion moving = motion ? *motion : shutter_motion_unknown();
    struct pose_problem problem = {
        .points = seen, .fx = query->lens->fx, .fy = query->lens->fy, .motion = motion ? &moving : NULL};
    double covariance[36], information[36], off = 0;
    int n = facing_matches(query->points, matches, count, pose, facing);
    if (n == count || n < MIN_POINTS)
        return count;
    problem.point_count = landmark_correspondences(query, pose, facing, n, seen);
    pnp_refine(&problem, &alone);
    if (!pnp_covariance(&problem, &alone, covariance) || !invert_symmetric(covariance, 6, information))
        return count;
    struct pose between = pose_multiply(alone, pose_inverse(*pose));
    struct vec3 rotation = quat_to_rotation_vector(between.rotation), translation = between.translation;
    const double d[6] = {rotation.x, rotation.y, rotation.z, translation.x, translation.y, translation.z};
    for (int i = 0; i < 36; i++)
        off += d[i / 6] * information[i] * d[i % 6];
    if (off < WITHIN_95) // conservative: a pose that they have part in differs from theirs by less
        return count;
    *pose = alone;
    if (motion)
        *motion = moving;
    memcpy(matches, facing, (size_t)n * sizeof *matches);
    return n;
}

bool landmarks_refine_pose(const struct match_query *query, struct shutter_motion *motion,
                           struct pose *camera_from_world, struct landmark_match *matches, int capacity,
                           int *match_count)
{
    // Three ways, of which the one with the most agreeing matches wins: near; far, since a small distant tag alone may
    // be off by more than the first search reaches, which shows when most of the first matches disagree in the end; and
    // without tags facing landmarks first, since a pattern that looks the same rotated may give consistent wrong
    // matches of landmarks that the sweep saw from another side. Radii chosen by hand.
    static const double FIRST_PX = 40, FAR_PX = 120;
    enum { NEAR, FAR, FACING_FIRST, WAYS };
    struct landmark_match other_matches[FEATURES_MAX];
    struct refinement start = {.pose = *camera_from_world, .motion = motion ? *motion : shutter_motion_unknown()};
    struct refinement best = start;
    int first = 0;
    if (capacity > FEATURES_MAX)
        capacity = FEATURES_MAX;
    for (int way = NEAR; way < WAYS; way++) {
        const struct match_window window = {way == FAR ? FAR_PX : FIRST_PX, way == FACING_FIRST};
        struct refinement now = start;
        if (way == FAR && 2 * best.kept >= first)
            continue;
        if (way == FACING_FIRST &&
            (query->tag_count || !best.kept ||
             facing_matches(query->points, matches, best.kept, &best.pose, other_matches) == best.kept))
            continue;
        match_and_refine(query, window, motion != NULL, &now, other_matches, capacity);
        if (way == NEAR)
            first = now.first;
        if (now.kept <= best.kept)
            continue;
        memcpy(matches, other_matches, (size_t)now.kept * sizeof *matches);
        best = now;
    }
    if (!best.kept)
        return false;
    *camera_from_world = best.pose;
    if (motion)
        *motion = best.motion;
    *match_count =
        query->tag_count ? best.kept : drop_inconsistent(query, motion, camera_from_world, matches, best.kept);
    return true;
}
