#include "locate/relocalization.h"

#include <string.h>

enum {
    MAX_BITS = 70,          // of 256 that may differ between landmark and feature; chosen by hand
    MAX_RATIO_PERCENT = 85, // the best must differ by less than this percentage of the second best; chosen by hand
    MAX_ROUNDS = 2000,      // of RANSAC; chosen by hand
    // By chance wrong matches agree with a wrong pose: of 300 matches three or four.
    MIN_INLIERS = 10,
};
static const double SAME_M = 0.05;      // landmarks nearer to each other than this are one corner mapped twice
static const double INLIER_SIGMA = 5;   // 3 pixels at the finest pyramid level
static const double MISS_CHANCE = 1e-3; // chance of never having drawn three correct matches

// ---------------------------------------------------------------- three points

static double evaluate_polynomial(const double *c, int degree, double x)
{
    double y = c[degree];
    for (int i = degree - 1; i >= 0; i--)
        y = y * x + c[i];
    return y;
}

// The real roots in [low, high], ascending: between those of the derivative, by bisection.
static int find_real_roots(const double *c, int degree, double low, double high, double *out)
{
    double slope[4], extrema[6];
    int intervals = 0, count = 0;
    if (degree < 1)
        return 0;
    for (int i = 0; i < degree; i++)
        slope[i] = (i + 1) * c[i + 1];
    extrema[0] = low;
    intervals = 1 + find_real_roots(slope, degree - 1, low, high, extrema + 1);
    extrema[intervals] = high;
    for (int i = 0; i < intervals; i++) {
        double a = extrema[i], b = extrema[i + 1], at_a = evaluate_polynomial(c, degree, a),
               at_b = evaluate_polynomial(c, degree, b);
        if (!(at_a * at_b <= 0) || a == b)
            continue;
        for (int k = 0; k < 50; k++) {
            double middle = (a + b) / 2, at = evaluate_polynomial(c, degree, middle);
            if ((at < 0) == (at_a < 0))
                a = middle;
            else
                b = middle;
        }
        out[count++] = (a + b) / 2;
    }
    return count;
}

// The orthonormal axes that three points span, in columns. False: they lie in a line.
static bool triangle_axes(const struct vec3 p[3], double m[3][3])
{
    struct vec3 x = v3_unit(v3_sub(p[1], p[0])), z = v3_cross(x, v3_sub(p[2], p[0]));
    if (!(v3_length(z) > 1e-6))
        return false;
    z = v3_unit(z);
    struct vec3 y = v3_cross(z, x);
    const double own[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    memcpy(m, own, sizeof own);
    return true;
}

// The rigid motion that takes three points to three others, from the axes that they span.
static bool superpose_points(const struct vec3 world[3], const struct vec3 camera[3], struct pose *camera_from_world)
{
    double a[3][3], b[3][3], rotation[3][3];
    if (!triangle_axes(world, a) || !triangle_axes(camera, b))
        return false;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            rotation[r][c] = b[r][0] * a[c][0] + b[r][1] * a[c][1] + b[r][2] * a[c][2];
    camera_from_world->rotation = quat_from_matrix(rotation);
    struct vec3 translation = {0, 0, 0};
    for (int i = 0; i < 3; i++)
        translation = v3_add(translation, v3_sub(camera[i], quat_rotate(camera_from_world->rotation, world[i])));
    camera_from_world->translation = v3_scale(translation, 1.0 / 3);
    return pose_finite(*camera_from_world);
}

// P3P: the poses that put three points onto three rays (unit length, camera axes). Writes up to four and returns how
// many; 0 for points in a line or numbers that are not finite. Grunert's equation as in Haralick et al., IJCV 1994.
static int p3p_poses(const struct vec3 world[3], const struct vec3 ray[3], struct pose camera_from_world[4])
{
    struct vec3 ab = v3_sub(world[1], world[0]), ac = v3_sub(world[2], world[0]), bc = v3_sub(world[2], world[1]);
    double a2 = v3_dot(bc, bc), b2 = v3_dot(ac, ac), c2 = v3_dot(ab, ab);
    double ca = v3_dot(ray[1], ray[2]), cb = v3_dot(ray[0], ray[2]), cg = v3_dot(ray[0], ray[1]);
    if (!(b2 > 1e-12) || !isfinite(a2 + b2 + c2 + ca + cb + cg) || !(v3_length(v3_cross(ab, ac)) > 1e-6))
        return 0;
    double q = (a2 - c2) / b2, p = (a2 + c2) / b2, c = c2 / b2, a = a2 / b2;
    const double quartic[5] = {
        (1 + q) * (1 + q) - 4 * a * cg * cg,
        4 * (-q * (1 + q) * cb + 2 * a * cg * cg * cb - (1 - p) * ca * cg),
        2 * (q * q - 1 + 2 * q * q * cb * cb + 2 * (1 - c) * ca * ca - 4 * p * ca * cb * cg + 2 * (1 - a) * cg * cg),
        4 * (q * (1 - q) * cb - (1 - p) * ca * cg + 2 * c * ca * ca * cb),
        (q - 1) * (q - 1) - 4 * c * ca * ca,
    };
    double v[5];
    // v: distance of the third point over that of the first.
    int n = find_real_roots(quartic, 4, 0.02, 50, v), count = 0;
    for (int i = 0; i < n && count < 4; i++) {
        double under = 2 * (cg - v[i] * ca), over = (q - 1) * v[i] * v[i] - 2 * q * cb * v[i] + 1 + q;
        double first = sqrt(b2 / (1 + v[i] * v[i] - 2 * v[i] * cb)), u = over / under;
        if (!(fabs(under) > 1e-9) || !(u > 0) || !isfinite(first))
            continue;
        const struct vec3 camera[3] = {v3_scale(ray[0], first), v3_scale(ray[1], first * u),
                                       v3_scale(ray[2], first * v[i])};
        count += superpose_points(world, camera, &camera_from_world[count]);
    }
    return count;
}

// ---------------------------------------------------------------- matches

// The best landmark for a feature; -1: none, or another one elsewhere is nearly as good.
static int32_t best_point(const struct place_landmark *points, int32_t point_count, const struct feature *feature,
                          int *bits)
{
    int32_t best = -1;
    int second = 257;
    *bits = 257;
    for (int32_t i = 0; i < point_count; i++) {
        int d = feature_distance(points[i].descriptor, feature->descriptor);
        if (d >= second)
            continue;
        bool same = best >= 0 && v3_distance(points[i].world, points[best].world) < SAME_M;
        if (d < *bits) {
            if (!same)
                second = *bits;
            *bits = d;
            best = i;
        } else if (!same) {
            second = d;
        }
    }
    return *bits <= MAX_BITS && *bits * 100 < MAX_RATIO_PERCENT * second ? best : -1;
}

int relocalize_match(const struct match_query *query, struct landmark_match *out, int capacity)
{
    const struct feature_index *index = query->index;
    int bits[FEATURES_MAX], at[257 + 1] = {0};
    int32_t which[FEATURES_MAX];
    struct landmark_match sorted[FEATURES_MAX];
    for (int i = 0; i < index->count; i++) {
        which[i] = best_point(query->points, query->point_count, &index->features[i], &bits[i]);
        if (which[i] >= 0)
            at[bits[i] + 1]++;
    }
    for (int b = 0; b < 257; b++)
        at[b + 1] += at[b];
    int all = at[257], count = 0;
    for (int i = 0; i < index->count; i++)
        if (which[i] >= 0)
            sorted[at[bits[i]]++] = (struct landmark_match){which[i], i};
    for (int i = 0; i < all && count < capacity; i++) {
        bool taken = false; // by a feature with fewer differing bits
        for (int k = 0; k < count && !taken; k++)
            taken = out[k].point == sorted[i].point;
        if (!taken)
            out[count++] = sorted[i];
    }
    return count;
}

// ---------------------------------------------------------------- consensus

static uint32_t draw_random(uint64_t *state, uint32_t below)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((*state >> 33) % below);
}

// Stops when more than `to_beat` cannot be reached.
static int count_inliers(const struct pose_problem *problem, const struct shutter_motion *motion,
                         const struct pose *pose, int to_beat)
{
    int inliers = 0;
    for (int i = 0; i < problem->point_count && inliers + problem->point_count - i > to_beat; i++)
        inliers += pnp_point_error(&problem->points[i], motion, pose, problem->fx, problem->fy) < INLIER_SIGMA;
    return inliers;
}

// Refines the pose by its inliers, twice, since a better pose has more of them. Returns how many.
static int refine_inliers(const struct pose_problem *problem, struct pose *pose)
{
    struct pnp_point good[FEATURES_MAX];
    struct shutter_motion *motion = problem->motion;
    int inliers = 0;
    for (int round = 0; round < 2; round++) {
        int n = 0;
        for (int i = 0; i < problem->point_count; i++)
            if (pnp_point_error(&problem->points[i], motion, pose, problem->fx, problem->fy) < 2 * INLIER_SIGMA)
                good[n++] = problem->points[i];
        struct pose better = *pose;
        struct shutter_motion moving = motion ? *motion : shutter_motion_unknown();
        const struct pose_problem own = {
            .points = good, .point_count = n, .fx = problem->fx, .fy = problem->fy, .motion = motion ? &moving : NULL};
        pnp_refine(&own, &better);
        int now = count_inliers(problem, own.motion, &better, 0);
        if (now < inliers)
            break;
        inliers = now;
        *pose = better;
        if (motion)
            *motion = moving;
    }
    return inliers;
}

bool relocalize(const struct match_query *query, const struct landmark_match *matches, int count,
                struct shutter_motion *motion, struct pose *camera_from_world, int *inliers)
{
    const struct lens *lens = query->lens;
    struct pnp_point seen[FEATURES_MAX];
    const struct pose_problem problem = {
        .points = seen, .point_count = count, .fx = lens->fx, .fy = lens->fy, .motion = motion};
    struct vec3 ray[FEATURES_MAX];
    struct pose best = POSE_IDENTITY;
    uint64_t random_state = 1;
    int max = 0;
    double rounds = MAX_ROUNDS;
    if (count < MIN_INLIERS)
        return false;
    for (int i = 0; i < count; i++) {
        const struct feature *f = &query->index->features[matches[i].feature];
        struct vec3 r = lens_ray(lens, f->at);
        seen[i] = (struct pnp_point){.world = query->points[matches[i].point].world,
                                     .x = r.x,
                                     .y = r.y,
                                     .sigma_px = feature_sigma(f),
                                     .time_s = shutter_row_time(lens, f->at.y)};
        ray[i] = v3_unit(r);
    }
    for (int round = 0; round < rounds; round++) {
        // At first from the better matches, then from more and more of them.
        uint32_t among = (uint32_t)fmin(count, fmax(MIN_INLIERS, count * (0.3 + round / 300.0)));
        uint32_t i = draw_random(&random_state, among), k = draw_random(&random_state, among),
                 m = draw_random(&random_state, among);
        if (i == k || k == m || i == m)
            continue;
        struct pose poses[4];
        int n = p3p_poses((struct vec3[]){seen[i].world, seen[k].world, seen[m].world},
                          (struct vec3[]){ray[i], ray[k], ray[m]}, poses);
        for (int p = 0; p < n; p++) {
            int now = count_inliers(&problem, motion, &poses[p], max);
            if (now > max) {
                max = now;
                best = poses[p];
                double share = (double)max / count;
                rounds = fmin(rounds, log(MISS_CHANCE) / log(1 - share * share * share * 0.5) + 50);
            }
        }
    }
    if (max < MIN_INLIERS / 2)
        return false;
    max = refine_inliers(&problem, &best);
    if (max < MIN_INLIERS || !pose_finite(best))
        return false;
    *camera_from_world = best;
    *inliers = max;
    return true;
}
