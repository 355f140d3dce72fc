#include "locate/planar_pose.h"

#include "base/linear_algebra.h"
#include "locate/pose_solver.h"

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
