#include "locate/pose_solver.h"

#include "base/least_squares.h"
#include "base/linear_algebra.h"

#include <string.h>

// ---------------------------------------------------------------- planar pose

// Twice the signed area of a, b, c on the plane z = 1.
static double twice_signed_area(struct vec3 a, struct vec3 b, struct vec3 c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

bool planar_homography(const struct vec3 ray[4], double h[9])
{
    double longest = 0;
    for (int i = 0; i < 4; i++) {
        if (!v3_finite(ray[i]))
            return false;
        longest = fmax(longest, v3_distance(ray[i], ray[(i + 1) % 4]));
    }
    // No three corners in a line, none inside the triangle of the others. Seen from the front the corners run
    // counter-clockwise, so with y down the signed areas are negative.
    for (int i = 0; i < 4; i++)
        if (!(twice_signed_area(ray[i], ray[(i + 1) % 4], ray[(i + 2) % 4]) < -1e-4 * longest * longest))
            return false;
    // Heckbert's closed form for the unit square (0,0), (1,0), (1,1), (0,1) ...
    struct vec3 p0 = ray[0], p1 = ray[1], p2 = ray[2], p3 = ray[3];
    double dx1 = p1.x - p2.x, dx2 = p3.x - p2.x, sx = p0.x - p1.x + p2.x - p3.x;
    double dy1 = p1.y - p2.y, dy2 = p3.y - p2.y, sy = p0.y - p1.y + p2.y - p3.y;
    double det = dx1 * dy2 - dx2 * dy1;
    double g = (sx * dy2 - dx2 * sy) / det, k = (dx1 * sy - sx * dy1) / det;
    double a = p1.x - p0.x + g * p1.x, b = p3.x - p0.x + k * p3.x, c = p0.x;
    double d = p1.y - p0.y + g * p1.y, e = p3.y - p0.y + k * p3.y, f = p0.y;
    // ... with (u + 1) / 2, (v + 1) / 2 as its coordinates
    double m[9] = {a / 2, b / 2, c + (a + b) / 2, d / 2, e / 2, f + (d + e) / 2, g / 2, k / 2, 1 + (g + k) / 2};
    if (!(fabs(m[8]) > 1e-12))
        return false;
    for (int i = 0; i < 9; i++) {
        h[i] = m[i] / m[8];
        if (!isfinite(h[i]))
            return false;
    }
    return true;
}

// The translation t for a given rotation: linear least squares on (r + t).xy - ray.xy * (r + t).z = 0 over the rotated
// corners r.
static bool solve_translation(const struct vec3 rotated[4], const struct vec3 ray[4], struct vec3 *t)
{
    double a[9] = {0}, b[3] = {0};
    for (int i = 0; i < 4; i++) {
        double x = ray[i].x, y = ray[i].y;
        double ex = x * rotated[i].z - rotated[i].x, ey = y * rotated[i].z - rotated[i].y;
        a[0] += 1;
        a[4] += 1;
        a[6] -= x;
        a[7] -= y;
        a[8] += x * x + y * y;
        b[0] += ex;
        b[1] += ey;
        b[2] -= x * ex + y * ey;
    }
    if (!cholesky_factor(a, 3)) // reads the lower triangle only
        return false;
    cholesky_solve(a, 3, b);
    *t = v3(b[0], b[1], b[2]);
    return v3_finite(*t);
}

// Adds the pose with this rotation if it puts the square in front of the camera, its face towards it.
static int add_pose(double r[3][3], double half, const struct vec3 ray[4], struct pose *out, int count)
{
    static const double corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    struct pose pose = {quat_from_matrix(r), {0, 0, 0}};
    struct vec3 rotated[4];
    for (int i = 0; i < 4; i++)
        rotated[i] = quat_rotate(pose.rotation, v3(half * corner[i][0], half * corner[i][1], 0));
    if (!solve_translation(rotated, ray, &pose.translation) || !pose_finite(pose))
        return count;
    for (int i = 0; i < 4; i++)
        if (!(rotated[i].z + pose.translation.z > 1e-3 * half))
            return count;
    struct vec3 normal = quat_rotate(pose.rotation, v3(0, 0, 1));
    if (!(v3_dot(normal, pose.translation) < 0))
        return count;
    out[count] = pose;
    return count + 1;
}

int planar_poses(double side_m, const struct vec3 ray[4], struct pose out[2])
{
    double h[9];
    if (!(side_m > 0) || !isfinite(side_m) || !planar_homography(ray, h))
        return 0;
    // Derivative of the homography at the square's centre, and where the centre falls.
    double vx = h[2], vy = h[5];
    double j[2][2] = {{h[0] - h[6] * vx, h[1] - h[7] * vx}, {h[3] - h[6] * vy, h[4] - h[7] * vy}};
    // Rotates the optical axis towards the centre.
    double rv[3][3];
    quat_to_matrix(quat_between(v3(0, 0, 1), v3(vx, vy, 1)), rv);
    double b[2][2] = {{rv[0][0] - vx * rv[2][0], rv[0][1] - vx * rv[2][1]},
                      {rv[1][0] - vy * rv[2][0], rv[1][1] - vy * rv[2][1]}};
    double det = b[0][0] * b[1][1] - b[0][1] * b[1][0];
    if (!(fabs(det) > 1e-12))
        return 0;
    double a[2][2];
    for (int c = 0; c < 2; c++) {
        a[0][c] = (b[1][1] * j[0][c] - b[0][1] * j[1][c]) / det;
        a[1][c] = (b[0][0] * j[1][c] - b[1][0] * j[0][c]) / det;
    }
    // Its largest singular value is the scale; divided by it, a is the upper left 2 x 2 block of a rotation.
    double s00 = a[0][0] * a[0][0] + a[0][1] * a[0][1], s11 = a[1][0] * a[1][0] + a[1][1] * a[1][1];
    double s01 = a[0][0] * a[1][0] + a[0][1] * a[1][1];
    double scale = sqrt((s00 + s11 + sqrt((s00 - s11) * (s00 - s11) + 4 * s01 * s01)) / 2);
    if (!(scale > 1e-12))
        return 0;
    double r[2][2] = {{a[0][0] / scale, a[0][1] / scale}, {a[1][0] / scale, a[1][1] / scale}};
    double b0 = sqrt(fmax(0, 1 - r[0][0] * r[0][0] - r[1][0] * r[1][0]));
    double b1 = sqrt(fmax(0, 1 - r[0][1] * r[0][1] - r[1][1] * r[1][1]));
    if (-(r[0][0] * r[0][1] + r[1][0] * r[1][1]) < 0)
        b1 = -b1;
    int count = 0;
    for (int sign = 1; sign >= -1; sign -= 2) {
        struct vec3 c0 = v3(r[0][0], r[1][0], sign * b0), c1 = v3(r[0][1], r[1][1], sign * b1);
        c0 = v3_unit(c0);
        c1 = v3_unit(v3_sub(c1, v3_scale(c0, v3_dot(c0, c1))));
        struct vec3 c2 = v3_cross(c0, c1);
        double own[3][3] = {{c0.x, c1.x, c2.x}, {c0.y, c1.y, c2.y}, {c0.z, c1.z, c2.z}}, rotation[3][3];
        for (int row = 0; row < 3; row++)
            for (int c = 0; c < 3; c++)
                rotation[row][c] = rv[row][0] * own[0][c] + rv[row][1] * own[1][c] + rv[row][2] * own[2][c];
        count = add_pose(rotation, side_m / 2, ray, out, count);
    }
    return count;
}

double planar_pose_offset_m(double side_m, const struct vec3 ray[4], const struct pose *expected)
{
    static const double RANGE_SHARE = 0.03;
    struct pose two[2];
    int count = planar_poses(side_m, ray, two);
    double min = count ? INFINITY : 0;
    for (int i = 0; i < count; i++) {
        double off = v3_distance(two[i].translation, expected->translation);
        min = fmin(min, off - RANGE_SHARE * v3_length(two[i].translation));
    }
    return fmax(min, 0);
}

// ---------------------------------------------------------------- pose candidates

// pnp_solve of locate/pose_solver.h: the pose from tags alone, refined from both planar poses of every tag; the best
// and the second best distinct pose are kept.

// Uncertainty added to corners from stage to stage, so that tags far from the one that gave the start can pull
// although they are pixels off. Chosen by hand.
static const double STAGES_PX[] = {8, 2, 0.5, 0};
// Two poses are distinct from here on, and fit equally well up to here. Chosen by hand; AMBIGUOUS_COST is a difference
// of robust costs.
static const double DISTINCT_RAD = 0.05, DISTINCT_M = 0.05, AMBIGUOUS_COST = 12;

// Sets used and rms_px; of tags with the same number only the best is used. Returns how many are used.
static int select_inliers(const struct pose_problem *problem, const struct shutter_motion *motion,
                          const struct pose *pose, double max_rms_px)
{
    struct pnp_tag *tags = problem->tags;
    int used = 0, count = problem->tag_count;
    for (int i = 0; i < count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, pose, problem->fx, problem->fy);
        tags[i].used = tags[i].rms_px <= max_rms_px;
    }
    for (int i = 0; i < count; i++)
        for (int k = 0; k < count; k++)
            if (i != k && tags[i].seen->id == tags[k].seen->id && tags[i].used && tags[k].used)
                tags[tags[i].rms_px <= tags[k].rms_px ? k : i].used = false;
    for (int i = 0; i < count; i++)
        used += tags[i].used;
    return used;
}

struct pose_candidate {
    struct pose pose;
    struct shutter_motion motion;
    double cost;
    int used;
    uint64_t which; // tags used: bit i is tag i
};

// From one starting pose to the pose that most tags agree on. staged: corners are uncertain at first, which leads out
// of a mirrored pose where other tags contradict it.
static struct pose_candidate refine_candidate(const struct pose_problem *problem, struct pose start, bool staged,
                                              double max_rms_px)
{
    struct pose_candidate c = {.pose = start};
    struct pose_problem own = {
        .tags = problem->tags, .tag_count = problem->tag_count, .fx = problem->fx, .fy = problem->fy};
    if (problem->motion) {
        c.motion = *problem->motion;
        own.motion = &c.motion;
    }
    for (int i = 0; i < own.tag_count; i++)
        own.tags[i].used = true;
    for (size_t s = staged ? 0 : COUNT_OF(STAGES_PX) - 1; s < COUNT_OF(STAGES_PX); s++) {
        own.tag_px = STAGES_PX[s];
        c.cost = pnp_refine(&own, &c.pose);
    }
    for (int round = 0; round < 3; round++) {
        uint64_t before = c.which;
        c.used = select_inliers(&own, own.motion, &c.pose, max_rms_px);
        c.which = 0;
        for (int i = 0; i < own.tag_count; i++)
            c.which |= (uint64_t)own.tags[i].used << i;
        if (!c.used || (round && c.which == before))
            break;
        c.cost = pnp_refine(&own, &c.pose);
    }
    return c;
}

static bool is_better(const struct pose_candidate *a, const struct pose_candidate *b)
{
    return a->used != b->used ? a->used > b->used : a->cost < b->cost;
}

static bool has_duplicate_id(const struct pnp_tag *tags, int count, int i)
{
    for (int k = 0; k < count; k++)
        if (k != i && tags[k].seen->id == tags[i].seen->id)
            return true;
    return false;
}

// Different rotations; or different positions that no tag supports both.
static bool are_distinct(const struct pose_candidate *a, const struct pose_candidate *b)
{
    if (pose_angle(a->pose, b->pose) > DISTINCT_RAD)
        return true;
    return !(a->which & b->which) &&
           v3_distance(pose_inverse(a->pose).translation, pose_inverse(b->pose).translation) > DISTINCT_M;
}

// Keeps the best pose and the best of those distinct from it.
static void keep_best_two(const struct pose_candidate *candidate, struct pose_candidate *best,
                          struct pose_candidate *second)
{
    bool distinct = !best->used || are_distinct(candidate, best);
    if (!best->used || is_better(candidate, best)) {
        if (best->used && distinct)
            *second = *best;
        *best = *candidate;
        if (second->used && !are_distinct(second, best))
            second->used = 0;
    } else if (distinct && (!second->used || is_better(candidate, second))) {
        *second = *candidate;
    }
}

enum status pnp_solve(const struct pose_problem *problem, double max_rms_px, struct pnp_solution *out)
{
    struct pnp_tag *tags = problem->tags;
    const int count = problem->tag_count;
    struct pose_candidate best = {.used = 0}, second = {.used = 0};
    assert(count >= 0 && count <= PNP_MAX_TAGS);
    for (int i = 0; i < count; i++) {
        struct pose two[2];
        int n = planar_poses(tags[i].side_m, tags[i].seen->ray, two);
        for (int k = 0; k < 2 * n; k++) {
            bool staged = k >= n;
            if (staged && count == 1)
                break;
            struct pose start = pose_multiply(two[k % n], pose_inverse(tags[i].world_from_tag));
            struct pose_candidate c = refine_candidate(problem, start, staged, max_rms_px);
            if (c.used && pose_finite(c.pose))
                keep_best_two(&c, &best, &second);
        }
    }
    if (!best.used)
        return NOTHING;
    // Which of two tags with the same number is the mapped one, only another tag can decide.
    select_inliers(problem, problem->motion ? &best.motion : NULL, &best.pose, max_rms_px);
    bool confirmed = best.used > 1;
    for (int i = 0; i < count && !confirmed; i++)
        confirmed = tags[i].used && !has_duplicate_id(tags, count, i);
    if (!confirmed)
        return NOTHING;
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += tags[i].used ? tags[i].rms_px * tags[i].rms_px : 0;
    *out = (struct pnp_solution){.camera_from_world = best.pose,
                                 .other = second.pose,
                                 .rms_px = sqrt(sum / best.used),
                                 .cost = best.cost,
                                 .other_excess_cost = second.cost - best.cost,
                                 .used = best.used,
                                 .motion = best.motion,
                                 .other_motion = second.motion};
    bool alike = second.used == best.used && second.cost - best.cost < AMBIGUOUS_COST;
    return alike ? AMBIGUOUS : OK;
}

// ---------------------------------------------------------------- pose residuals, types

// Residuals of the pose solver: what one tag, one depth sample or one landmark adds to the normal equations
// of a small motion of the camera (base/least_squares.h). Axes, order of the numbers, kernel and costs:
// locate/pose_solver.h.

// What is estimated: the motion of the camera, and with a rolling shutter its velocity.
enum { POSE_DOF = 6, POSE_VELOCITY_DOF = 12 };

#define CAUCHY_SCALE 3.0 // c of the Cauchy kernel, standard deviations

// How the camera projects: pixels per unit of x / z and y / z, and how it moves while it reads its rows.
struct pnp_projection {
    double fx, fy;
    const struct shutter_motion *motion; // NULL: no rolling shutter
};

// The inverse covariance of a tag's eight corner coordinates, 1 / pixels^2: image noise, map error and extra_px.
struct corner_information {
    double a[64];
};

// ---------------------------------------------------------------- pose residuals

// Robust costs of what lies behind the camera; chosen by hand, above what any visible outlier costs.
static const double BEHIND_TAG_COST = 1e6, BEHIND_POINT_COST = 100;

// The derivative by the velocity: what was seen at time_s was seen from where the camera was then.
static void fill_velocity_jacobian(double by[POSE_VELOCITY_DOF], double time_s)
{
    for (int i = 0; i < POSE_DOF; i++)
        by[POSE_DOF + i] = -time_s * by[i];
}

// Corner errors in ideal pixels and their derivative by a small motion of the camera. False: a corner is not in
// front of the camera.
static bool corner_errors(const struct pnp_tag *tag, const struct pnp_projection *projection,
                          const struct pose *camera_from_tag, double e[8], double by[8][POSE_VELOCITY_DOF])
{
    const double fx = projection->fx, fy = projection->fy;
    double half = tag->side_m / 2;
    const double own[4][2] = {{-half, -half}, {half, -half}, {half, half}, {-half, half}};
    for (int k = 0; k < 4; k++) {
        double time_s = tag->seen->time_s[k];
        struct vec3 p =
            shutter_apply_motion(projection->motion, time_s, pose_apply(*camera_from_tag, v3(own[k][0], own[k][1], 0)));
        if (!(p.z > 1e-3))
            return false;
        double x = p.x / p.z, y = p.y / p.z, ux = fx / p.z, uy = fy / p.z;
        e[2 * k] = fx * (x - tag->seen->ray[k].x);
        e[2 * k + 1] = fy * (y - tag->seen->ray[k].y);
        const double row0[6] = {ux * -x * p.y, ux * (p.z + x * p.x), ux * -p.y, ux, 0, -ux * x};
        const double row1[6] = {uy * (-p.z - y * p.y), uy * y * p.x, uy * p.x, 0, uy, -uy * y};
        memcpy(by[2 * k], row0, sizeof row0);
        memcpy(by[2 * k + 1], row1, sizeof row1);
        fill_velocity_jacobian(by[2 * k], time_s);
        fill_velocity_jacobian(by[2 * k + 1], time_s);
    }
    return true;
}

// Depth samples inside one tag against the tag's plane. The row timing of the depth sensor, another camera, is not
// known, so its derivative by the velocity is 0.
static double add_depth(struct least_squares_sums *equations, const struct pnp_tag *tag,
                        const struct pose *camera_from_tag)
{
    double cost = 0;
    struct vec3 normal = quat_rotate(camera_from_tag->rotation, v3(0, 0, 1));
    double offset = v3_dot(normal, camera_from_tag->translation);
    for (int i = 0; i < tag->depth->count; i++) {
        const struct depth_sample *s = &tag->depth->sample[i];
        struct vec3 ray = v3(s->x, s->y, 1);
        double slant = v3_dot(normal, ray), sigma = depth_absolute_sigma_m(s->z);
        if (!(fabs(slant) > 1e-3))
            continue;
        double z = offset / slant, e = (z - s->z) / sigma;
        struct vec3 rotation = v3_scale(v3_cross(normal, ray), -z / slant), translation = v3_scale(normal, 1 / slant);
        double by[POSE_VELOCITY_DOF] = {rotation.x / sigma,    rotation.y / sigma,    rotation.z / sigma,
                                        translation.x / sigma, translation.y / sigma, translation.z / sigma};
        double ratio = 1 + e * e / (CAUCHY_SCALE * CAUCHY_SCALE);
        least_squares_add(equations, e, by, tag->depth->share / ratio);
        cost += tag->depth->share * CAUCHY_SCALE * CAUCHY_SCALE * log(ratio);
    }
    return cost;
}

// Adds J C Jᵀ: the map's covariance C of the tag's pose, by which its corners err together.
static void add_map_error(const struct pnp_tag *tag, const struct pose *camera_from_world,
                          const struct pnp_projection *projection, double covariance[64])
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double half = tag->side_m / 2, rotation[3][3], by[8][6], times[8][6];
    quat_to_matrix(camera_from_tag.rotation, rotation);
    for (int k = 0; k < 4; k++) {
        const struct vec3 own = {k == 1 || k == 2 ? half : -half, k >= 2 ? half : -half, 0};
        struct vec3 p = pose_apply(camera_from_tag, own);
        if (!(p.z > 1e-3))
            return;
        for (int row = 0; row < 2; row++) {
            double f = row ? projection->fy : projection->fx, off = (row ? p.y : p.x) / p.z, *d = by[2 * k + row];
            for (int i = 0; i < 3; i++)
                d[3 + i] = f / p.z * (rotation[row][i] - off * rotation[2][i]);
            d[0] = own.y * d[5];
            d[1] = -own.x * d[5];
            d[2] = own.x * d[4] - own.y * d[3];
        }
    }
    memset(times, 0, sizeof times);
    for (int a = 0, i = 0; a < 6; a++)
        for (int b = a; b < 6; b++, i++)
            for (int r = 0; r < 8; r++) {
                times[r][a] += (double)tag->covariance[i] * by[r][b];
                if (a != b)
                    times[r][b] += (double)tag->covariance[i] * by[r][a];
            }
    for (int r = 0; r < 8; r++)
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 6; i++)
                covariance[r * 8 + c] += times[r][i] * by[c][i];
}

static void pnp_corner_information(const struct pnp_tag *tag, double extra_px, const struct pose *camera_from_world,
                                   const struct pnp_projection *projection, struct corner_information *information)
{
    double *out = information->a;
    memset(out, 0, sizeof information->a);
    double covariance[64], variance = extra_px * extra_px;
    if (extra_px < 1 && invert_symmetric(&tag->seen->information[0][0], 8, covariance)) {
        for (int i = 0; i < 8; i++)
            covariance[i * 8 + i] += variance + tag->map_px * tag->map_px;
        if (tag->covariance)
            add_map_error(tag, camera_from_world, projection, covariance);
        if (invert_symmetric(covariance, 8, out))
            return;
    }
    for (int i = 0; i < 8; i++)
        out[i * 8 + i] = 1 / (variance + 0.25);
}

// Each adds one tag or point to *equations and returns its robust cost. What is not visible adds a large constant cost.
static double pnp_add_tag(struct least_squares_sums *equations, const struct pnp_tag *tag,
                          const struct corner_information *information, const struct pnp_projection *projection,
                          const struct pose *camera_from_world, bool with_depth)
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double e[8], by[8][POSE_VELOCITY_DOF], weighted[8], chi2 = 0;
    if (!corner_errors(tag, projection, &camera_from_tag, e, by))
        return BEHIND_TAG_COST;
    for (int i = 0; i < 8; i++) {
        weighted[i] = 0;
        for (int j = 0; j < 8; j++)
            weighted[i] += information->a[i * 8 + j] * e[j];
        chi2 += weighted[i] * e[i];
    }
    double bound = 8 * CAUCHY_SCALE * CAUCHY_SCALE, slope = 1 / (1 + chi2 / bound);
    for (int a = 0; a < equations->n; a++) {
        double half[8]; // information * column a
        for (int i = 0; i < 8; i++) {
            half[i] = 0;
            for (int j = 0; j < 8; j++)
                half[i] += information->a[i * 8 + j] * by[j][a];
            equations->g[a] -= slope * half[i] * e[i];
        }
        for (int b = 0; b <= a; b++)
            for (int i = 0; i < 8; i++)
                equations->a[a * equations->n + b] += slope * half[i] * by[i][b];
    }
    double cost = bound * log(1 + chi2 / bound);
    return tag->depth && with_depth ? cost + add_depth(equations, tag, &camera_from_tag) : cost;
}

static double pnp_add_point(struct least_squares_sums *equations, const struct pnp_point *point, double extra_px,
                            const struct pnp_projection *projection, const struct pose *camera_from_world)
{
    const double fx = projection->fx, fy = projection->fy;
    struct vec3 p =
        shutter_apply_motion(projection->motion, point->time_s, pose_apply(*camera_from_world, point->world));
    if (!(p.z > 1e-2))
        return BEHIND_POINT_COST;
    // [a 0; b c] whitens an error in pixels: the inverse of its covariance's Cholesky factor.
    double variance = point->sigma_px * point->sigma_px + extra_px * extra_px, xx = variance + point->covariance[0];
    double a = 1 / sqrt(xx),
           c = 1 / sqrt(variance + point->covariance[2] - point->covariance[1] * point->covariance[1] / xx);
    double b = -c * point->covariance[1] / xx;
    double x = p.x / p.z, y = p.y / p.z, ux = fx / p.z, uy = fy / p.z;
    double off_x = fx * (x - point->x), off_y = fy * (y - point->y), ex = a * off_x, ey = b * off_x + c * off_y;
    const double by_x[6] = {ux * -x * p.y, ux * (p.z + x * p.x), ux * -p.y, ux, 0, -ux * x};
    const double by_y[6] = {uy * (-p.z - y * p.y), uy * y * p.x, uy * p.x, 0, uy, -uy * y};
    double row0[POSE_VELOCITY_DOF], row1[POSE_VELOCITY_DOF];
    for (int i = 0; i < POSE_DOF; i++) {
        row0[i] = a * by_x[i];
        row1[i] = b * by_x[i] + c * by_y[i];
    }
    fill_velocity_jacobian(row0, point->time_s);
    fill_velocity_jacobian(row1, point->time_s);
    double bound = CAUCHY_SCALE * CAUCHY_SCALE, chi2 = ex * ex + ey * ey, ez = 0, depth = 0;
    if (point->z > 0) {
        depth = 1 / (sqrt(pow(depth_absolute_sigma_m(point->z), 2) + point->z_variance) + extra_px * p.z / fx);
        ez = (p.z - point->z) * depth;
        chi2 += ez * ez;
    }
    double slope = 1 / (1 + chi2 / bound);
    least_squares_add(equations, ex, row0, slope);
    least_squares_add(equations, ey, row1, slope);
    if (point->z > 0) {
        const double row2[POSE_VELOCITY_DOF] = {p.y * depth, -p.x * depth, 0, 0, 0, depth};
        least_squares_add(equations, ez, row2, slope);
    }
    return bound * log(1 + chi2 / bound);
}

double pnp_tag_cost(const struct pnp_tag *tag, const struct pose *camera_from_world, double extra_px, double fx,
                    double fy)
{
    double storage[POSE_DOF * POSE_DOF + POSE_DOF];
    struct least_squares_sums n = least_squares_zero(POSE_DOF, storage);
    const struct pnp_projection projection = {.fx = fx, .fy = fy};
    struct corner_information information;
    pnp_corner_information(tag, extra_px, camera_from_world, &projection, &information);
    return pnp_add_tag(&n, tag, &information, &projection, camera_from_world, true);
}

double pnp_point_error(const struct pnp_point *point, const struct shutter_motion *motion,
                       const struct pose *camera_from_world, double fx, double fy)
{
    struct vec3 p = shutter_apply_motion(motion, point->time_s, pose_apply(*camera_from_world, point->world));
    if (!(p.z > 1e-2))
        return PNP_NOT_VISIBLE;
    double x = fx * (p.x / p.z - point->x), y = fy * (p.y / p.z - point->y);
    double variance = point->sigma_px * point->sigma_px;
    double xx = variance + point->covariance[0], xy = point->covariance[1], yy = variance + point->covariance[2];
    return sqrt((yy * x * x - 2 * xy * x * y + xx * y * y) / (xx * yy - xy * xy));
}

double pnp_tag_rms(const struct pnp_tag *tag, const struct shutter_motion *motion, const struct pose *camera_from_world,
                   double fx, double fy)
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    const struct pnp_projection projection = {fx, fy, motion};
    double e[8], by[8][POSE_VELOCITY_DOF], sum = 0;
    if (!corner_errors(tag, &projection, &camera_from_tag, e, by))
        return PNP_NOT_VISIBLE;
    for (int i = 0; i < 8; i++)
        sum += e[i] * e[i];
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1));
    return v3_dot(normal, camera_from_tag.translation) < 0 ? sqrt(sum / 4) : PNP_NOT_VISIBLE; // its face
}

// ---------------------------------------------------------------- pose solver

// The problem at one state of the estimate; projection.motion is the velocity's.
struct linear_system {
    const struct pose_problem *problem;
    struct pnp_projection projection;
    struct corner_information information[PNP_MAX_TAGS];
};

// The prior of the velocity.
static void add_velocity_prior(struct least_squares_sums *equations, const struct shutter_motion *motion)
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double off_i = motion->velocity[i] - motion->expected[i], off_j = motion->velocity[j] - motion->expected[j];
            equations->cost += off_i * motion->information[i * 6 + j] * off_j;
            equations->g[POSE_DOF + i] -= motion->information[i * 6 + j] * off_j;
            equations->a[(POSE_DOF + i) * equations->n + POSE_DOF + j] += motion->information[i * 6 + j];
        }
}

// The information of the corners is computed once, at the starting pose.
static void init_system(const struct pose_problem *problem, const struct pose *camera_from_world,
                        struct linear_system *all)
{
    all->problem = problem;
    all->projection = (struct pnp_projection){problem->fx, problem->fy, problem->motion};
    for (int i = 0; i < problem->tag_count; i++)
        pnp_corner_information(&problem->tags[i], problem->tag_px, camera_from_world, &all->projection,
                               &all->information[i]);
}

// equations: 0 before, of unknown_count().
static void build_normal_equations(const struct linear_system *all, const struct pose *camera_from_world,
                                   struct least_squares_sums *equations)
{
    const struct pose_problem *problem = all->problem;
    const struct shutter_motion *motion = all->projection.motion;
    // Beside corners of little weight, depth would bend the pose at will.
    const bool with_depth = problem->tag_px == 0;
    if (motion)
        add_velocity_prior(equations, motion);
    for (int i = 0; i < problem->tag_count; i++)
        if (problem->tags[i].used)
            equations->cost += pnp_add_tag(equations, &problem->tags[i], &all->information[i], &all->projection,
                                           camera_from_world, with_depth);
    for (int i = 0; i < problem->point_count; i++)
        equations->cost +=
            pnp_add_point(equations, &problem->points[i], problem->point_px, &all->projection, camera_from_world);
}

static int unknown_count(const struct pose_problem *problem) { return problem->motion ? POSE_VELOCITY_DOF : POSE_DOF; }

// Two states, as base/least_squares.h names them; motion: with a rolling shutter.
struct pose_fit {
    struct linear_system all;
    struct pose pose[2];
    struct shutter_motion motion[2];
};

static bool move_pose(void *user, const double *d)
{
    struct pose_fit *fit = user;
    const struct pose small = {quat_from_rotation_vector(v3(d[0], d[1], d[2])), {d[3], d[4], d[5]}};
    fit->pose[STATE_TRIED] = pose_multiply(small, fit->pose[STATE_KEPT]);
    if (fit->all.problem->motion) {
        fit->motion[STATE_TRIED] = fit->motion[STATE_KEPT];
        for (int i = 0; i < 6; i++)
            fit->motion[STATE_TRIED].velocity[i] += d[POSE_DOF + i];
    }
    return pose_finite(fit->pose[STATE_TRIED]);
}

static bool sum_residuals(void *user, enum least_squares_state state, struct least_squares_sums *equations)
{
    struct pose_fit *fit = user;
    fit->all.projection.motion = fit->all.problem->motion ? &fit->motion[state] : NULL;
    build_normal_equations(&fit->all, &fit->pose[state], equations);
    return true;
}

static void keep_pose(void *user)
{
    struct pose_fit *fit = user;
    fit->pose[STATE_KEPT] = fit->pose[STATE_TRIED];
    fit->motion[STATE_KEPT] = fit->motion[STATE_TRIED];
}

double pnp_refine(const struct pose_problem *problem, struct pose *pose)
{
    // Starts are within a few degrees, so nearly undamped; a cost of 1 is one standard deviation of one number.
    static const struct least_squares_options options = {20, 1e-6, 1e-7, 1};
    struct pose_fit fit = {.pose = {*pose}};
    const struct least_squares_problem least_squares = {unknown_count(problem), &fit,      move_pose,
                                                        sum_residuals,          keep_pose, NULL};
    double work[LEAST_SQUARES_WORK(POSE_VELOCITY_DOF)];
    struct least_squares_sums sums;
    init_system(problem, pose, &fit.all);
    if (problem->motion)
        fit.motion[STATE_KEPT] = *problem->motion;
    (void)least_squares_solve(&least_squares, &options, work, &sums);
    *pose = fit.pose[STATE_KEPT];
    if (problem->motion)
        *problem->motion = fit.motion[STATE_KEPT];
    return sums.cost;
}

enum { EQUATIONS = POSE_VELOCITY_DOF * POSE_VELOCITY_DOF + POSE_VELOCITY_DOF };

// The normal equations at the solution, both triangles.
static struct least_squares_sums final_normal_equations(const struct pose_problem *problem,
                                                        const struct pose *camera_from_world, double storage[EQUATIONS])
{
    struct pose_problem exact = *problem;
    struct linear_system all;
    struct least_squares_sums equations = least_squares_zero(unknown_count(problem), storage);
    exact.tag_px = exact.point_px = 0;
    init_system(&exact, camera_from_world, &all);
    build_normal_equations(&all, camera_from_world, &equations);
    least_squares_mirror(&equations);
    return equations;
}

// Of the pose, the velocity marginalised: its prior always leaves it finite.
static void pose_information(const struct least_squares_sums *equations, double out[36])
{
    if (equations->n == POSE_DOF)
        memcpy(out, equations->a, 36 * sizeof *out);
    else if (!marginal_information(equations->a, 6, false, out))
        memset(out, 0, 36 * sizeof *out);
}

void pnp_update_velocity_prior(const struct pose_problem *problem, const struct pose *camera_from_world)
{
    struct shutter_motion *motion = problem->motion;
    double information[36], storage[EQUATIONS];
    const struct least_squares_sums n = final_normal_equations(problem, camera_from_world, storage);
    if (!marginal_information(n.a, 6, true, information))
        return;
    for (int i = 0; i < 36; i++) // symmetric
        motion->information[i] = (information[i] + information[i % 6 * 6 + i / 6]) / 2;
    memcpy(motion->expected, motion->velocity, sizeof motion->expected);
}

void pnp_information(const struct pose_problem *problem, const struct pose *camera_from_world, double information[36])
{
    double storage[EQUATIONS];
    const struct least_squares_sums n = final_normal_equations(problem, camera_from_world, storage);
    pose_information(&n, information);
}

// What normally distributed errors cost: how many numbers are observed, the mean of their robust cost and its
// variance.
struct cost_statistics {
    double numbers, cost, variance;
};

static void add_expected_cost(struct cost_statistics *all, double times, struct cost_statistics one)
{
    all->numbers += times * one.numbers;
    all->cost += times * one.cost;
    all->variance += times * one.variance;
}

bool pnp_covariance(const struct pose_problem *problem, const struct pose *camera_from_world, double covariance[36])
{
    // Of one depth sample, a point, a point with depth, a tag: mean and variance of b ln(1 + x / b) where x is chi
    // squared with k degrees of freedom, that is
    //     m = integral over x > 0 of b ln(1 + x / b) x^(k/2 - 1) e^(-x/2) / (2^(k/2) Gamma(k/2)) dx
    // and the same of the square, less m^2. Numerically, with c = CAUCHY_SCALE: k = 1, 2, 3 with b = c^2, k = 8 with
    // b = 8 c^2.
    static const struct cost_statistics DEPTH_SAMPLE = {1, 0.874, 1.222}, POINT = {2, 1.680, 2.112},
                                        DEEP_POINT = {3, 2.426, 2.760}, TAG = {8, 7.499, 12.42};
    const struct pnp_tag *tags = problem->tags;
    double information[36], storage[EQUATIONS];
    struct cost_statistics all = {0};
    for (int i = 0; i < problem->tag_count; i++) {
        add_expected_cost(&all, tags[i].used, TAG);
        if (tags[i].used && tags[i].depth)
            add_expected_cost(&all, tags[i].depth->share * tags[i].depth->count, DEPTH_SAMPLE);
    }
    for (int i = 0; i < problem->point_count; i++)
        add_expected_cost(&all, 1, problem->points[i].z > 0 ? DEEP_POINT : POINT);
    const struct least_squares_sums n = final_normal_equations(problem, camera_from_world, storage);
    pose_information(&n, information);
    if (!invert_symmetric(information, 6, covariance))
        return false;
    // The residuals' cost against its mean plus one standard deviation, which chance exceeds in one case of six. The
    // pose itself takes up six numbers.
    double left = fmax(1, all.numbers - 6) / fmax(1, all.numbers);
    double grow = fmax(1, n.cost / (left * all.cost + sqrt(left * all.variance)));
    for (int i = 0; i < 36; i++)
        covariance[i] *= grow;
    return true;
}
