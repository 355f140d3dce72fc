#include "capture/body/body_fit.h"

#include "base/depth_noise.h"
#include "base/portable_math.h"
#include "capture/body/body_prior.h"
#include "capture/body/normal_equations.h"
#include "capture/body/solid_distance.h"

#include <string.h>

// Weights of the evidence, chosen by hand; docs/notes/skeleton.md has what free space and patches gain.
//
// Neighbouring points have correlated errors (cloth, shape): those of a patch of this width weigh as one independent
// point, and a frame as no more than PATCHES_MAX. If the person is occluded but for an arm, the arm weighs as before.
#define PATCH_M     0.035
#define PATCHES_MAX 150.0
// Standard deviation of a silhouette sample: a limb is less round than its solid by this much. A tighter one would keep
// a limb beside its place in the image rather than let it cross the gap.
#define FREE_SIGMA_M    0.030
#define OFF_PERSON_RATE 0.4 // of that weight beside the person: the mask ends a little inside the true silhouette
#define CROWN_RATE      4.0 // of that weight for the crown of the head: hair and noise take a centimetre or two
#define CROWN_SLACK_M   0.010
#define FREE_REACH_M    0.25 // c of the samples' robust kernel

// Near the floor the mask ends some centimetres above it, by the sensor's noise: of a shoe only the upper edge is seen.
// Points there are few, but they tell which way the person faces, and their errors are independent of the trunk's.
#define RIM_M     0.05 // the mask's lower edge is at most this high,
#define SHOE_M    0.07 // and always lower than this
#define FEET_M    0.11 // shoes and ankles
#define FEET_RATE 2.0  // of a point's weight

#define FRONT_M        0.04 // cloth in front of the measured depth, beside twice the noise
#define NEAR_PLANE_M   0.2  // samples nearer than this are ignored
#define ROOT_STEP_MAX  0.2  // metres in one iteration
#define ANGLE_STEP_MAX 0.5  // radians in one iteration
#define SHAPE_STEP_MAX 0.1  // of a factor's logarithm in one iteration
#define DAMPING        0.01 // of the diagonal

// How the solids change with each factor of the shape: derivatives by forward differences.
struct shape_jacobian {
    struct vec3 a[SOLID_COUNT], b[SOLID_COUNT];
    double width_a[SOLID_COUNT], width_b[SOLID_COUNT], radius_a[SOLID_COUNT], radius_b[SOLID_COUNT];
};

// How far each factor of the shape moves the surface point `hit` of a solid along n.
static void shape_row(const struct shape_jacobian slope[SHAPE_COUNT], const struct body_solid *solid,
                      const struct solid_hit *hit, struct vec3 n, double row[SHAPE_COUNT])
{
    const int i = hit->solid;
    const double t = hit->t;
    double width = solid_width(solid, t);
    double share = width > 1e-9 ? hit->side_m / width : 0;
    for (int k = 0; k < SHAPE_COUNT; k++) {
        const struct shape_jacobian *s = &slope[k];
        double radius = s->radius_a[i] + (s->radius_b[i] - s->radius_a[i]) * t,
               wide = s->width_a[i] + (s->width_b[i] - s->width_a[i]) * t;
        row[k] = v3_dot(n, v3_mix(s->a[i], s->b[i], t)) + radius + share * wide * v3_dot(n, solid->side);
    }
}

static void find_shape_jacobians(const struct body_shape *shape, const struct body_pose *pose,
                                 const struct body_build *build, struct shape_jacobian slope[SHAPE_COUNT])
{
    const double d = 1e-4;
    for (int k = 0; k < SHAPE_COUNT; k++) {
        struct body_shape other = *shape;
        struct body_build moved;
        other.log[k] += d;
        body_forward_kinematics(&other, pose, &moved);
        for (int i = 0; i < build->solids; i++) {
            const struct body_solid *solid = &moved.solid[i], *o = &build->solid[i];
            slope[k].a[i] = v3_scale(v3_sub(solid->a, o->a), 1 / d);
            slope[k].b[i] = v3_scale(v3_sub(solid->b, o->b), 1 / d);
            slope[k].width_a[i] = (solid->width_a - o->width_a) / d;
            slope[k].width_b[i] = (solid->width_b - o->width_b) / d;
            slope[k].radius_a[i] = (solid->radius_a - o->radius_a) / d;
            slope[k].radius_b[i] = (solid->radius_b - o->radius_b) / d;
        }
    }
}

// The weight of one point: independent patches per point.
static double point_share(const struct depth_evidence *evidence)
{
    double patches = fmin(PATCHES_MAX, evidence->extent_m2 / (PATCH_M * PATCH_M));
    return fmin(1, patches / fmax(evidence->count, 1));
}

// What the skirt hides says nothing about the shape underneath: the surface nearest to a point is not the visible one
// there.
static bool is_under_skirt(const struct body_build *build, const struct body_solid *solid, struct vec3 p)
{
    if (build->solids <= SOLID_SKIRT || solid->segment < SEG_LEFT_THIGH)
        return false;
    const struct body_solid *skirt = &build->solid[SOLID_SKIRT + (solid->segment >= SEG_RIGHT_THIGH)];
    struct vec3 axis = v3_sub(skirt->b, skirt->a);
    return v3_dot(v3_sub(p, skirt->a), axis) < v3_dot(axis, axis);
}

// The residual of one point against solid `best` in the normal equations.
static void add_point_residual(const struct body_build *build, const struct shape_jacobian *slope, struct vec3 p,
                               const struct solid_hit *best, double pull, struct normal_equations *system)
{
    const struct body_solid *s = &build->solid[best->solid];
    double radius = solid_radius(s, best->t), row[SHAPE_COUNT];
    struct vec3 normal = surface_normal(s, best, p, v3_unit(p));
    bool has_shape_row = slope && !is_under_skirt(build, s, p);
    if (has_shape_row)
        shape_row(slope, s, best, normal, row);
    struct point_residual r = {
        .point = v3_add(best->on, v3_scale(normal, radius)), .normal = normal, .residual = best->distance};
    double swing = s->open ? BODY_SKIRT_SWING * best->t : 0; // a hem moves with the thighs
    if (swing > 0) {
        r.segment = best->solid == SOLID_SKIRT ? SEG_LEFT_THIGH : SEG_RIGHT_THIGH;
        r.weight = swing * pull;
        normal_equations_add(system, build, &r);
    }
    r.segment = s->segment;
    r.weight = (1 - swing) * pull;
    r.shape = has_shape_row ? row : NULL;
    normal_equations_add(system, build, &r);
}

// The points' energy against the nearest visible surface. system NULL: the energy alone.
static double add_points(const struct fit_task *task, const struct body_build *build,
                         const struct shape_jacobian *slope, struct fit_result *out, struct normal_equations *system)
{
    const struct depth_evidence *e = task->evidence;
    struct solid_bounds bounds;
    find_solid_bounds(build, &bounds);
    double c2 = task->kernel_m * task->kernel_m, share = point_share(e) * task->point_stride, energy = 0;
    for (int i = 0; i < e->count; i += task->point_stride) {
        struct vec3 p = e->point[i].p, view = v3_unit(p);
        struct solid_hit best = find_nearest_solid(build, &bounds, p, view, out->solid[i]);
        out->residual[i] = (float)best.distance;
        out->solid[i] = (int8_t)best.solid;
        double e2 = best.distance * best.distance, fade = c2 / (c2 + e2), weight = e->point[i].weight * share;
        if (task->have_floor && v3_dot(task->up, p) + task->floor_m < FEET_M)
            weight *= FEET_RATE;
        energy += 0.5 * weight * e2 * fade; // Geman-McClure
        if (system)
            add_point_residual(build, slope, p, &best, weight * fade * fade, system);
    }
    return energy;
}

#define LATERAL_RATE  0.75 // samples lie this share of the radius to the side,
#define LATERAL_DEPTH 0.66 // where the round front is this share in front of the middle: sqrt(1 - 0.75^2)
#define MIDDLE_WEIGHT 0.3  // of a sample on the axis,
#define SIDE_WEIGHT   0.15 // and of one to the side

// A sample of the model: the surface `radius` in front of c.
struct free_sample {
    enum segment segment;
    struct vec3 c;
    double radius, rate;
    const struct shape_jacobian *slope; // of all solids by the shape; NULL: the shape is not learned from it
    int solid;
    double t, deep;      // t along the axis; the surface is deep * radius in front of it
    struct vec3 lateral; // from the axis to the sample, 0 or of length 1
};

// How far each factor of the shape moves a point along x, y and z.
typedef double shape_rows[3][SHAPE_COUNT];

static void find_rows(const struct free_sample *at, shape_rows out)
{
    for (int k = 0; k < SHAPE_COUNT; k++) {
        const struct shape_jacobian *s = &at->slope[k];
        const int i = at->solid;
        double radius = s->radius_a[i] + (s->radius_b[i] - s->radius_a[i]) * at->t,
               width = s->width_a[i] + (s->width_b[i] - s->width_a[i]) * at->t;
        struct vec3 by = v3_add(v3_mix(s->a[i], s->b[i], at->t), v3_scale(at->lateral, width + LATERAL_RATE * radius));
        out[0][k] = by.x;
        out[1][k] = by.y;
        out[2][k] = by.z - at->deep * radius;
    }
}

// The energy of a sample that lies beside the person or in front of the measured depth.
static double add_free_sample(const struct fit_task *task, const struct body_build *build,
                              const struct free_sample *sample, struct normal_equations *system)
{
    const struct vec3 c = sample->c;
    const double radius = sample->radius;
    double rate = sample->rate;
    const struct depth_evidence *e = task->evidence;
    if (c.z < NEAR_PLANE_M)
        return 0;
    struct vec3 at = c;
    double under = task->have_floor ? SHOE_M - (v3_dot(task->up, c) + task->floor_m) : 0;
    if (under > 0) { // judged by its upper edge, and not at all where even that is below the mask's
        at = v3_add(c, v3_scale(task->up, fmin(under, radius)));
        if (under - radius > SHOE_M - RIM_M)
            return 0;
    }
    struct pixel px = lens_project(&e->lens, at);
    double measured, dx, dy, front = c.z - radius;
    enum evidence_kind kind = evidence_at(e, px, c.z, &measured, &dx, &dy);
    double off[3] = {0, 0, 0};
    if (kind == EVIDENCE_OFF_PERSON) {
        rate *= OFF_PERSON_RATE;
        double slack = 0.5 * e->step;
        double length = portable_hypot(dx, dy), overhang = length > slack ? (length - slack) / length : 0;
        off[0] = dx * overhang * c.z / e->lens.fx;
        off[1] = dy * overhang * c.z / e->lens.fy;
    } else if (kind == EVIDENCE_PERSON && measured > 0) {
        double excess = measured - front - FRONT_M - 2 * depth_sigma_m(measured);
        off[2] = excess > 0 ? excess : 0;
    } else {
        return 0;
    }
    double e2 = off[0] * off[0] + off[1] * off[1] + off[2] * off[2], c2 = FREE_REACH_M * FREE_REACH_M;
    if (e2 == 0)
        return 0;
    double fade = c2 / (c2 + e2), weight = rate / (FREE_SIGMA_M * FREE_SIGMA_M);
    shape_rows grows;
    if (sample->slope)
        find_rows(sample, grows); // few samples get here
    for (int k = 0; k < 3; k++)
        if (off[k] != 0)
            normal_equations_add(system, build,
                                 &(struct point_residual){.segment = sample->segment,
                                                          .point = c,
                                                          .normal = v3(k == 0, k == 1, k == 2),
                                                          .residual = off[k],
                                                          .weight = weight * fade * fade,
                                                          .shape = sample->slope ? grows[k] : NULL});
    return 0.5 * weight * e2 * fade;
}

// The crown of the head: without it the trunk slides up and down in the image.
static double add_crown(const struct fit_task *task, const struct body_build *build, const struct body_solid *skull,
                        struct normal_equations *system)
{
    struct vec3 up = v3_unit(v3_sub(skull->b, skull->a));
    struct vec3 c = v3_add(skull->b, v3_scale(up, skull->radius_b - CROWN_SLACK_M));
    const struct free_sample crown = {.segment = skull->segment, .c = c, .rate = CROWN_RATE};
    return add_free_sample(task, build, &crown, system);
}

// slope: derivatives by the shape where that is learned, or NULL.
static double add_free_solid(const struct fit_task *task, const struct body_build *build, int i,
                             const struct shape_jacobian *slope, struct normal_equations *system)
{
    const struct body_solid *s = &build->solid[i];
    struct vec3 axis = v3_sub(s->b, s->a), across = v3_unit(v3_cross(axis, s->a));
    double energy = 0;
    if (s->width_a > 0)
        across = s->side;
    for (int k = 0; k < 4; k++) {
        double t = (k + 0.5) / 4, radius = solid_radius(s, t), width = solid_width(s, t);
        struct vec3 middle = v3_add(s->a, v3_scale(axis, t));
        for (int side = -1; side <= 1; side++) {
            double beside = side * (width + LATERAL_RATE * radius), deep = side ? LATERAL_DEPTH : 1;
            const struct free_sample sample = {.segment = s->segment,
                                               .c = v3_add(middle, v3_scale(across, beside)),
                                               .radius = deep * radius,
                                               .rate = side ? SIDE_WEIGHT : MIDDLE_WEIGHT,
                                               .slope = slope,
                                               .solid = i,
                                               .t = t,
                                               .deep = deep,
                                               .lateral = v3_scale(across, side)};
            energy += add_free_sample(task, build, &sample, system);
        }
    }
    if (i == SOLID_SKULL)
        energy += add_crown(task, build, s, system);
    return energy;
}

static double add_free_space(const struct fit_task *task, const struct body_build *build,
                             const struct shape_jacobian *slope, struct fit_result *out,
                             struct normal_equations *system)
{
    double energy = 0;
    memset(out->limb_energy, 0, sizeof out->limb_energy);
    for (int i = 0; i < build->solids; i++) {
        double cost = add_free_solid(task, build, i, slope, system);
        out->limb_energy[build->solid[i].segment] += cost;
        energy += cost;
    }
    return energy;
}

static void move_pose(struct body_pose *pose, const double *x)
{
    double far = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]), limit = far > ROOT_STEP_MAX ? ROOT_STEP_MAX / far : 1;
    pose->root = v3_add(pose->root, v3_scale(v3(x[0], x[1], x[2]), limit));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation = v3(x[3 + 3 * s], x[4 + 3 * s], x[5 + 3 * s]);
        double angle = v3_length(rotation);
        if (angle > ANGLE_STEP_MAX)
            rotation = v3_scale(rotation, ANGLE_STEP_MAX / angle);
        pose->rotation[s] = quat_unit(quat_multiply(quat_from_rotation_vector(rotation), pose->rotation[s]));
    }
}

static double add_shape_prior(const struct fit_task *task, const struct body_shape *shape,
                              struct normal_equations *system)
{
    double energy = 0;
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b < SHAPE_COUNT; b++) {
            double i = task->shape.information[a][b] / task->learn_rate, off = task->shape.mean.log[b] - shape->log[b];
            energy += 0.5 * i * off * (task->shape.mean.log[a] - shape->log[a]);
            if (system) {
                system->g[FIT_POSE_COUNT + a] += i * off;
                if (b <= a)
                    system->h[FIT_POSE_COUNT + a][FIT_POSE_COUNT + b] += i;
            }
        }
    return energy;
}

static void evaluate(const struct fit_task *task, const struct body_pose *pose, const struct body_shape *shape,
                     struct fit_result *out)
{
    out->pose = *pose;
    out->shape = *shape;
    body_forward_kinematics(shape, pose, &out->build);
    out->energy = add_points(task, &out->build, NULL, out, NULL) + add_free_space(task, &out->build, NULL, out, NULL) +
                  body_floor_energy(task, &out->build, NULL) +
                  body_collision_energy(&out->build, out->limb_energy, NULL) + body_crossed_legs_energy(&out->build) +
                  body_prior_joint_limits(shape, pose, NULL, NULL);
    out->energy += point_evidence_energy(task->points, &out->build, NULL);
    out->energy += joint_evidence_energy(task->joints, &out->build, NULL);
}

void body_evaluate(const struct fit_task *task, const struct body_pose *pose, const struct body_shape *shape,
                   struct fit_result *out)
{
    memset(out->solid, -1, sizeof out->solid);
    out->has_information = false;
    evaluate(task, pose, shape, out);
}

void body_fit(const struct fit_task *task, const struct body_pose *start, struct fit_result *out)
{
    struct body_pose pose = *start;
    struct body_shape shape = task->shape.mean;
    struct normal_equations system;
    memset(out->solid, -1, sizeof out->solid);
    struct shape_jacobian slope[SHAPE_COUNT];
    for (int iteration = 0; iteration < task->iterations; iteration++) {
        normal_equations_reset(&system, task->learn_shape);
        body_forward_kinematics(&shape, &pose, &out->build);
        if (task->learn_shape) {
            find_shape_jacobians(&shape, &pose, &out->build, slope);
            add_shape_prior(task, &shape, &system);
        }
        add_points(task, &out->build, task->learn_shape ? slope : NULL, out, &system);
        add_free_space(task, &out->build, task->learn_shape ? slope : NULL, out, &system);
        body_floor_energy(task, &out->build, &system);
        body_collision_energy(&out->build, out->limb_energy, &system);
        point_evidence_energy(task->points, &out->build, &system); // the shape is not learned from them,
        joint_evidence_energy(task->joints, &out->build, &system); // nor from these
        normal_equations_assemble(&system, &out->build);
        body_prior_joint_limits(&shape, &pose, &system.h[0][0], system.g);
        body_prior_motion(&pose, &task->expected, task->expected_sigma, &system.h[0][0], system.g);
        double x[FIT_COUNT] = {0};
        if (!normal_equations_solve(&system, DAMPING, x))
            break;
        move_pose(&pose, x);
        for (int k = 0; task->learn_shape && k < SHAPE_COUNT; k++)
            shape.log[k] += x[FIT_POSE_COUNT + k] < -SHAPE_STEP_MAX  ? -SHAPE_STEP_MAX
                            : x[FIT_POSE_COUNT + k] > SHAPE_STEP_MAX ? SHAPE_STEP_MAX
                                                                     : x[FIT_POSE_COUNT + k];
    }
    if (task->learn_shape && task->iterations > 0) {
        normal_equations_shape_information(&system, out->shape_information);
        for (int a = 0; a < SHAPE_COUNT; a++)
            for (int b = 0; b < SHAPE_COUNT; b++) // without the prior: this frame's alone
                out->shape_information[a][b] -= task->shape.information[a][b] / task->learn_rate;
    }
    out->pose = pose;
    out->shape = shape;
    out->has_information = !task->pose_only && task->iterations > 0;
    for (int i = 0; out->has_information && i < FIT_POSE_COUNT; i++)
        memcpy(out->information.h[i], system.h[i], sizeof out->information.h[i]);
    if (!task->pose_only)
        evaluate(task, &pose, &shape, out);
}

// Standard deviations of an adult population around the proportions (4 to 8 %); that of the height, 12 %, is wider than
// the 8 % of adults. In the order of enum shape_factor.
static const double shape_sigma[SHAPE_COUNT] = {0.12, 0.05, 0.07, 0.07, 0.07, 0.05, 0.04,
                                                0.04, 0.06, 0.08, 0.08, 0.08, 0.07, 0.08};
#define TALL_SIGMA 0.06 // of heights above the average: 1.94 m is two of them

struct shape_prior shape_prior_default(void)
{
    struct shape_prior prior;
    memset(&prior, 0, sizeof prior);
    for (int k = 0; k < SHAPE_COUNT; k++)
        prior.information[k][k] = 1 / (shape_sigma[k] * shape_sigma[k]);
    return prior;
}

double shape_log_odds(const struct body_shape *shape)
{
    double energy = 0;
    for (int k = 0; k < SHAPE_COUNT; k++) {
        double sigma = k == SHAPE_SCALE && shape->log[k] > 0 ? TALL_SIGMA : shape_sigma[k], off = shape->log[k] / sigma;
        energy += 0.5 * off * off;
    }
    return energy;
}
