#include "locate/pose_solver.h"

#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

// The fit begins with corners this uncertain and tightens, so that tags far from
// the one that gave the start can pull although they are pixels off.
static const double STAGES_PX[] = {8, 2, 0.5, 0};
static const double CAUCHY_SCALE = 3; // standard deviations from where on errors lose weight
// Two poses count as different from here on, and as equally good up to here.
static const double DISTINCT_RAD = 0.05, DISTINCT_M = 0.05, AMBIGUOUS_COST = 12;

// What is fitted: a small motion (turn, shift) of the camera, and with a rolling shutter its speed.
enum { POSE_DOF = 6, POSE_VELOCITY_DOF = 12 };

struct pnp_equations {
    int size; // POSE_DOF or POSE_VELOCITY_DOF
    double a[POSE_VELOCITY_DOF * POSE_VELOCITY_DOF], g[POSE_VELOCITY_DOF], cost;
};

// Adds a residual e (already whitened) with derivative `by`; weight is the loss's slope.
static void add_residual(struct pnp_equations *n, double e, const double by[POSE_VELOCITY_DOF], double weight)
{
    for (int i = 0; i < n->size; i++) {
        n->g[i] -= weight * by[i] * e;
        for (int j = 0; j <= i; j++)
            n->a[i * n->size + j] += weight * by[i] * by[j];
    }
}

// What is seen at time_s was seen from where the camera was then: as if it had moved the other way.
static void fill_velocity_jacobian(double by[POSE_VELOCITY_DOF], double time_s)
{
    for (int i = 0; i < POSE_DOF; i++)
        by[POSE_DOF + i] = -time_s * by[i];
}

// Corner errors in ideal pixels and their derivative by a small motion (turn, shift)
// of the camera, applied on the left. False: a corner is not before the camera.
static bool corner_errors(const struct pnp_tag *tag, const struct shutter_motion *motion,
                          const struct pose *camera_from_tag, double fx, double fy, double e[8],
                          double by[8][POSE_VELOCITY_DOF])
{
    double half = tag->side_m / 2;
    const double own[4][2] = {{-half, -half}, {half, -half}, {half, half}, {-half, half}};
    for (int k = 0; k < 4; k++) {
        double time_s = tag->seen->time_s[k];
        struct vec3 p = shutter_apply_motion(motion, time_s, pose_apply(*camera_from_tag, v3(own[k][0], own[k][1], 0)));
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

// The robust cost of depth inside one tag, and its part of the normal equations. A depth sensor is
// another camera; how it reads its rows nobody knows, so it has no say in the speed.
static double add_depth(struct pnp_equations *n, const struct pnp_tag *tag, const struct pose *camera_from_tag)
{
    double cost = 0;
    struct vec3 normal = quat_rotate(camera_from_tag->rotation, v3(0, 0, 1));
    double offset = v3_dot(normal, camera_from_tag->translation);
    for (int i = 0; i < tag->depth->count; i++) {
        const struct depth_sample *s = &tag->depth->sample[i];
        struct vec3 ray = v3(s->x, s->y, 1);
        double slant = v3_dot(normal, ray), sigma = depth_sigma(s->z);
        if (!(fabs(slant) > 1e-3))
            continue;
        double z = offset / slant, e = (z - s->z) / sigma;
        struct vec3 turn = v3_scale(v3_cross(normal, ray), -z / slant), shift = v3_scale(normal, 1 / slant);
        double by[POSE_VELOCITY_DOF] = {turn.x / sigma,  turn.y / sigma,  turn.z / sigma,
                                        shift.x / sigma, shift.y / sigma, shift.z / sigma};
        double ratio = 1 + e * e / (CAUCHY_SCALE * CAUCHY_SCALE);
        add_residual(n, e, by, tag->depth->share / ratio);
        cost += tag->depth->share * CAUCHY_SCALE * CAUCHY_SCALE * log(ratio);
    }
    return cost;
}

// Where the map has the tag a little aside, all its corners err together.
static void add_map_error(const struct pnp_tag *tag, const struct pose *camera_from_world, double fx, double fy,
                          double covariance[64])
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double half = tag->side_m / 2, turn[3][3], by[8][6], times[8][6];
    quat_to_matrix(camera_from_tag.rotation, turn);
    for (int k = 0; k < 4; k++) {
        const struct vec3 own = {k == 1 || k == 2 ? half : -half, k >= 2 ? half : -half, 0};
        struct vec3 p = pose_apply(camera_from_tag, own);
        if (!(p.z > 1e-3))
            return;
        for (int row = 0; row < 2; row++) {
            double f = row ? fy : fx, off = (row ? p.y : p.x) / p.z, *d = by[2 * k + row];
            for (int i = 0; i < 3; i++)
                d[3 + i] = f / p.z * (turn[row][i] - off * turn[2][i]);
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

// The weights of one tag's corners.
struct weights {
    double a[64];
};

static void stage_information(const struct pnp_tag *tag, double extra_px, const struct pose *camera_from_world,
                              double fx, double fy, double out[64])
{
    memset(out, 0, 64 * sizeof *out);
    double covariance[64], variance = extra_px * extra_px;
    if (extra_px < 1 && invert_symmetric(&tag->seen->information[0][0], 8, covariance)) {
        for (int i = 0; i < 8; i++)
            covariance[i * 8 + i] += variance + tag->map_px * tag->map_px;
        if (tag->covariance)
            add_map_error(tag, camera_from_world, fx, fy, covariance);
        if (invert_symmetric(covariance, 8, out))
            return;
    }
    for (int i = 0; i < 8; i++)
        out[i * 8 + i] = 1 / (variance + 0.25);
}

// One tag's whole part. Returns its robust cost; a tag behind the camera costs a lot.
static double add_tag(struct pnp_equations *n, const struct pnp_tag *tag, const double information[64],
                      const struct shutter_motion *motion, const struct pose *camera_from_world, bool with_depth,
                      double fx, double fy)
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double e[8], by[8][POSE_VELOCITY_DOF], weighted[8], chi2 = 0;
    if (!corner_errors(tag, motion, &camera_from_tag, fx, fy, e, by))
        return 1e6;
    for (int i = 0; i < 8; i++) {
        weighted[i] = 0;
        for (int j = 0; j < 8; j++)
            weighted[i] += information[i * 8 + j] * e[j];
        chi2 += weighted[i] * e[i];
    }
    double bound = 8 * CAUCHY_SCALE * CAUCHY_SCALE, slope = 1 / (1 + chi2 / bound);
    for (int a = 0; a < n->size; a++) {
        double half[8]; // information * column a
        for (int i = 0; i < 8; i++) {
            half[i] = 0;
            for (int j = 0; j < 8; j++)
                half[i] += information[i * 8 + j] * by[j][a];
            n->g[a] -= slope * half[i] * e[i];
        }
        for (int b = 0; b <= a; b++)
            for (int i = 0; i < 8; i++)
                n->a[a * n->size + b] += slope * half[i] * by[i][b];
    }
    double cost = bound * log(1 + chi2 / bound);
    return tag->depth && with_depth ? cost + add_depth(n, tag, &camera_from_tag) : cost;
}

// One point's part.
static double add_point(struct pnp_equations *n, const struct pnp_point *point, double extra_px,
                        const struct shutter_motion *motion, const struct pose *camera_from_world, double fx, double fy)
{
    struct vec3 p = shutter_apply_motion(motion, point->time_s, pose_apply(*camera_from_world, point->world));
    if (!(p.z > 1e-2))
        return 100;
    // [a 0; b c] times an error in pixels has unit covariance
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
        depth = 1 / (sqrt(pow(depth_sigma(point->z), 2) + point->z_variance) + extra_px * p.z / fx);
        ez = (p.z - point->z) * depth;
        chi2 += ez * ez;
    }
    double slope = 1 / (1 + chi2 / bound);
    add_residual(n, ex, row0, slope);
    add_residual(n, ey, row1, slope);
    if (point->z > 0) {
        const double row2[POSE_VELOCITY_DOF] = {p.y * depth, -p.x * depth, 0, 0, 0, depth};
        add_residual(n, ez, row2, slope);
    }
    return bound * log(1 + chi2 / bound);
}

// All that one camera is fitted to.
struct pose_problem {
    const struct pnp_tag *tags;
    int tag_count;
    const struct pnp_point *points;
    int point_count;
    double point_px, fx, fy;
    const struct shutter_motion *motion; // or NULL
    bool depth;                          // of the tags
    struct weights information[PNP_MAX_TAGS];
};

// What was known of the speed before.
static void add_expected(struct pnp_equations *n, const struct shutter_motion *m)
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double off_i = m->speed[i] - m->expected[i], off_j = m->speed[j] - m->expected[j];
            n->cost += off_i * m->information[i * 6 + j] * off_j;
            n->g[POSE_DOF + i] -= m->information[i * 6 + j] * off_j;
            n->a[(POSE_DOF + i) * n->size + POSE_DOF + j] += m->information[i * 6 + j];
        }
}

static void build_normal_equations(const struct pose_problem *all, const struct pose *camera_from_world,
                                   struct pnp_equations *n)
{
    memset(n, 0, sizeof *n);
    n->size = all->motion ? POSE_VELOCITY_DOF : POSE_DOF;
    if (all->motion)
        add_expected(n, all->motion);
    for (int i = 0; i < all->tag_count; i++)
        if (all->tags[i].used)
            n->cost += add_tag(n, &all->tags[i], all->information[i].a, all->motion, camera_from_world, all->depth,
                               all->fx, all->fy);
    for (int i = 0; i < all->point_count; i++)
        n->cost += add_point(n, &all->points[i], all->point_px, all->motion, camera_from_world, all->fx, all->fy);
}

static void apply_step(struct pose *p, struct shutter_motion *motion, const double d[POSE_VELOCITY_DOF])
{
    for (int i = 0; i < 6 && motion; i++)
        motion->speed[i] += d[POSE_DOF + i];
    struct pose small = {quat_from_rotation_vector(v3(d[0], d[1], d[2])), {d[3], d[4], d[5]}};
    *p = pose_multiply(small, *p);
}

double pnp_refine(const struct pnp_tag *tags, int count, double tag_px, const struct pnp_point *points, int point_count,
                  double point_px, double fx, double fy, struct shutter_motion *motion, struct pose *pose)
{
    struct shutter_motion next_motion;
    struct pose_problem all = {.tags = tags,
                               .tag_count = count,
                               .points = points,
                               .point_count = point_count,
                               .point_px = point_px,
                               .fx = fx,
                               .fy = fy,
                               .motion = motion,
                               // Beside corners that count for little, depth would bend the pose at will.
                               .depth = tag_px == 0};
    struct pnp_equations n, after;
    double damping = 1e-6;
    for (int i = 0; i < count; i++)
        stage_information(&tags[i], tag_px, pose, fx, fy, all.information[i].a);
    build_normal_equations(&all, pose, &n);
    for (int round = 0; round < 20; round++) {
        double a[POSE_VELOCITY_DOF * POSE_VELOCITY_DOF], d[POSE_VELOCITY_DOF];
        memcpy(a, n.a, sizeof a);
        memcpy(d, n.g, sizeof d);
        for (int i = 0; i < n.size; i++)
            a[i * n.size + i] *= 1 + damping;
        if (!cholesky_factor(a, n.size))
            break;
        cholesky_solve(a, n.size, d);
        struct pose next = *pose;
        if (motion) {
            next_motion = *motion;
            all.motion = &next_motion;
        }
        apply_step(&next, motion ? &next_motion : NULL, d);
        if (!pose_finite(next))
            break;
        build_normal_equations(&all, &next, &after);
        if (!(after.cost < n.cost)) {
            damping = fmax(damping * 10, 1e-4);
            if (damping > 1e4)
                break;
            continue;
        }
        bool converged = n.cost - after.cost < 1e-7 * (1 + n.cost);
        *pose = next;
        if (motion)
            *motion = next_motion;
        n = after;
        damping *= 0.1;
        if (converged)
            break;
    }
    return n.cost;
}

// The normal equations in the end, both halves of them.
static void final_normal_equations(const struct pnp_tag *tags, int count, const struct pnp_point *points,
                                   int point_count, double fx, double fy, const struct shutter_motion *motion,
                                   const struct pose *camera_from_world, struct pnp_equations *n)
{
    struct pose_problem all = {.tags = tags,
                               .tag_count = count,
                               .points = points,
                               .point_count = point_count,
                               .fx = fx,
                               .fy = fy,
                               .motion = motion,
                               .depth = true};
    for (int i = 0; i < count; i++)
        stage_information(&tags[i], 0, camera_from_world, fx, fy, all.information[i].a);
    build_normal_equations(&all, camera_from_world, n);
    for (int i = 0; i < n->size; i++)
        for (int j = 0; j < i; j++)
            n->a[j * n->size + i] = n->a[i * n->size + j];
}

// Of the pose. Its speed is always known a little.
static void pose_information(const struct pnp_equations *n, double out[36])
{
    if (n->size == POSE_DOF)
        memcpy(out, n->a, 36 * sizeof *out);
    else if (!marginal_information(n->a, 6, false, out))
        memset(out, 0, 36 * sizeof *out);
}

void pnp_update_velocity_prior(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count,
                               double fx, double fy, struct shutter_motion *motion,
                               const struct pose *camera_from_world)
{
    struct pnp_equations n;
    double information[36];
    final_normal_equations(tags, count, points, point_count, fx, fy, motion, camera_from_world, &n);
    if (!marginal_information(n.a, 6, true, information))
        return;
    for (int i = 0; i < 36; i++) // the same from both sides
        motion->information[i] = (information[i] + information[i % 6 * 6 + i / 6]) / 2;
    memcpy(motion->expected, motion->speed, sizeof motion->expected);
}

void pnp_information(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count, double fx,
                     double fy, const struct shutter_motion *motion, const struct pose *camera_from_world,
                     double information[36])
{
    struct pnp_equations n;
    final_normal_equations(tags, count, points, point_count, fx, fy, motion, camera_from_world, &n);
    pose_information(&n, information);
}

// What normal errors cost: how many numbers are observed, the mean of their robust cost and its variance.
struct cost_statistics {
    double numbers, cost, variance;
};

static void add_expected_cost(struct cost_statistics *all, double times, struct cost_statistics one)
{
    all->numbers += times * one.numbers;
    all->cost += times * one.cost;
    all->variance += times * one.variance;
}

bool pnp_covariance(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count, double fx,
                    double fy, const struct shutter_motion *motion, const struct pose *camera_from_world,
                    double covariance[36])
{
    struct pnp_equations n;
    // By integration, of one depth reading, a point, a point with depth, a tag.
    static const struct cost_statistics DEPTH_SAMPLE = {1, 0.874, 1.222}, POINT = {2, 1.680, 2.112},
                                        DEEP_POINT = {3, 2.426, 2.760}, TAG = {8, 7.499, 12.42};
    double information[36];
    struct cost_statistics all = {0};
    for (int i = 0; i < count; i++) {
        add_expected_cost(&all, tags[i].used, TAG);
        if (tags[i].used && tags[i].depth)
            add_expected_cost(&all, tags[i].depth->share * tags[i].depth->count, DEPTH_SAMPLE);
    }
    for (int i = 0; i < point_count; i++)
        add_expected_cost(&all, 1, points[i].z > 0 ? DEEP_POINT : POINT);
    final_normal_equations(tags, count, points, point_count, fx, fy, motion, camera_from_world, &n);
    pose_information(&n, information);
    if (!invert_symmetric(information, 6, covariance))
        return false;
    // Larger than chance makes it in one case of six. The pose itself takes six numbers.
    double left = fmax(1, all.numbers - 6) / fmax(1, all.numbers);
    double grow = fmax(1, n.cost / (left * all.cost + sqrt(left * all.variance)));
    for (int i = 0; i < 36; i++)
        covariance[i] *= grow;
    return true;
}

double pnp_tag_cost(const struct pnp_tag *tag, const struct pose *camera_from_world, double extra_px, double fx,
                    double fy)
{
    struct pnp_equations n = {.size = POSE_DOF};
    struct weights w;
    stage_information(tag, extra_px, camera_from_world, fx, fy, w.a);
    return add_tag(&n, tag, w.a, NULL, camera_from_world, true, fx, fy);
}

double pnp_point_error(const struct pnp_point *point, const struct shutter_motion *motion,
                       const struct pose *camera_from_world, double fx, double fy)
{
    struct vec3 p = shutter_apply_motion(motion, point->time_s, pose_apply(*camera_from_world, point->world));
    if (!(p.z > 1e-2))
        return 1e9;
    double x = fx * (p.x / p.z - point->x), y = fy * (p.y / p.z - point->y);
    double variance = point->sigma_px * point->sigma_px;
    double xx = variance + point->covariance[0], xy = point->covariance[1], yy = variance + point->covariance[2];
    return sqrt((yy * x * x - 2 * xy * x * y + xx * y * y) / (xx * yy - xy * xy));
}

double pnp_tag_rms(const struct pnp_tag *tag, const struct shutter_motion *motion, const struct pose *camera_from_world,
                   double fx, double fy)
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double e[8], by[8][POSE_VELOCITY_DOF], sum = 0;
    if (!corner_errors(tag, motion, &camera_from_tag, fx, fy, e, by))
        return 1e9;
    for (int i = 0; i < 8; i++)
        sum += e[i] * e[i];
    // and the reader must see its face
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1));
    return v3_dot(normal, camera_from_tag.translation) < 0 ? sqrt(sum / 4) : 1e9;
}

// Sets used and rms_px; of twins with one number only the best is used. Returns how many.
static int select_inliers(struct pnp_tag *tags, int count, const struct shutter_motion *motion, const struct pose *pose,
                          double fx, double fy, double max_rms_px)
{
    int used = 0;
    for (int i = 0; i < count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, pose, fx, fy);
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
    uint64_t which; // bit i: tag i
};

// From one start to the pose that most tags agree on; `loose`: with corners loose at
// first, which leads out of a mirrored pose where other tags are against it.
static struct pose_candidate refine_candidate(struct pnp_tag *tags, int count, const struct shutter_motion *known,
                                              struct pose pose, bool loose, double fx, double fy, double max_rms_px)
{
    struct pose_candidate c = {.pose = pose};
    struct shutter_motion *motion = known ? &c.motion : NULL;
    if (known)
        c.motion = *known;
    for (int i = 0; i < count; i++)
        tags[i].used = true;
    for (size_t s = loose ? 0 : COUNT_OF(STAGES_PX) - 1; s < COUNT_OF(STAGES_PX); s++)
        c.cost = pnp_refine(tags, count, STAGES_PX[s], NULL, 0, 0, fx, fy, motion, &c.pose);
    for (int round = 0; round < 3; round++) {
        uint64_t before = c.which;
        c.used = select_inliers(tags, count, motion, &c.pose, fx, fy, max_rms_px);
        c.which = 0;
        for (int i = 0; i < count; i++)
            c.which |= (uint64_t)tags[i].used << i;
        if (!c.used || (round && c.which == before))
            break;
        c.cost = pnp_refine(tags, count, 0, NULL, 0, 0, fx, fy, motion, &c.pose);
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

// Turned against one another; or elsewhere, each on the word of other tags.
static bool are_distinct(const struct pose_candidate *a, const struct pose_candidate *b)
{
    if (pose_angle(a->pose, b->pose) > DISTINCT_RAD)
        return true;
    return !(a->which & b->which) &&
           v3_distance(pose_inverse(a->pose).translation, pose_inverse(b->pose).translation) > DISTINCT_M;
}

// Keeps the best pose and the best of those apart from it.
static void keep_best_two(const struct pose_candidate *c, struct pose_candidate *best, struct pose_candidate *second)
{
    bool apart = !best->used || are_distinct(c, best);
    if (!best->used || is_better(c, best)) {
        if (best->used && apart)
            *second = *best;
        *best = *c;
        if (second->used && !are_distinct(second, best))
            second->used = 0;
    } else if (apart && (!second->used || is_better(c, second))) {
        *second = *c;
    }
}

enum status pnp_solve(struct pnp_tag *tags, int count, double fx, double fy, double max_rms_px,
                      const struct shutter_motion *motion, struct pnp_solution *out)
{
    struct pose_candidate best = {.used = 0}, second = {.used = 0};
    assert(count >= 0 && count <= PNP_MAX_TAGS);
    for (int i = 0; i < count; i++) {
        struct pose two[2];
        int n = planar_poses(tags[i].side_m, tags[i].seen->ray, two);
        for (int k = 0; k < 2 * n; k++) {
            bool loose = k >= n;
            if (loose && count == 1)
                break;
            struct pose start = pose_multiply(two[k % n], pose_inverse(tags[i].world_from_tag));
            struct pose_candidate c = refine_candidate(tags, count, motion, start, loose, fx, fy, max_rms_px);
            if (c.used && pose_finite(c.pose))
                keep_best_two(&c, &best, &second);
        }
    }
    if (!best.used)
        return NOTHING;
    // Which of two tags with one number is the mapped one, only another tag can say.
    select_inliers(tags, count, motion ? &best.motion : NULL, &best.pose, fx, fy, max_rms_px);
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
