#include "capture/body/body_fit.h"

#include "capture/body/body_prior.h"
#include "capture/body/normal_equations.h"
#include "capture/segmentation/segment.h"

#include <string.h>

// Neighbouring points err together (cloth, shape): those of a patch of this width say no more than one, and a picture
// no more than this many. Of somebody whom another hides but for an arm the arm says no more than it did before.
#define PATCH_M     0.035
#define PATCHES_MAX 150.0
// Of the silhouette, a sample of the model: a limb is not as round as its solid is, by this much. Tighter, a limb that
// is beside its place in the picture would rather stay there than cross the gap.
#define FREE_SIGMA_M 0.030
#define OFF_PERSON_RATE                                                                                                \
    0.4 // of that weight beside the person: the mask ends where readings do, a little short of the rim
#define CROWN_RATE    4.0 // of that weight, a crown beside the person: hair and noise take a centimetre or two
#define CROWN_SLACK_M 0.010
#define FREE_REACH_M  0.25 // beyond this a sample's pull fades

// Near the floor. A mask ends some centimetres over it, by the sensor's noise: of a shoe its upper edge is seen. Points
// there are few, but they say which way the person faces, and do not err with the trunk.
#define RIM_M     0.05 // the mask ends no higher
#define SHOE_M    0.07 // and lower than this
#define FEET_M    0.11 // shoes and ankles
#define FEET_RATE 2.0  // of a point's weight

#define BEYOND_M 1e3 // off a tube that a place lies beyond the end of

// How the build changes with each factor of the shape.
struct shape_jacobian {
    struct vec3 a[SOLID_COUNT], b[SOLID_COUNT];
    double width_a[SOLID_COUNT], width_b[SOLID_COUNT], radius_a[SOLID_COUNT], radius_b[SOLID_COUNT];
};

// What is the same for all points.
struct solid_line {
    struct vec3 axis;
    double per_length2, length,
        lean;  // 1 / length^2; lean: of the nearest middle towards the thick end, by the way off the axis
    bool flat; // has a width
};

static struct solid_line make_solid_line(const struct body_solid *s)
{
    struct solid_line l = {.axis = v3_sub(s->b, s->a), .flat = s->width_a > 0 || s->width_b > 0};
    double length2 = v3_dot(l.axis, l.axis);
    l.length = sqrt(length2);
    l.per_length2 = length2 > 1e-12 ? 1 / length2 : 0;
    l.lean = (s->radius_b - s->radius_a) * l.per_length2;
    return l;
}

struct solid_hit {
    int solid;
    double distance, t, side_m;
    struct vec3 on;
};

// The distance alone; `view` is the unit vector to p.
static void measure_solid(const struct body_solid *s, const struct solid_line *l, struct vec3 p, struct vec3 view,
                          struct solid_hit *out)
{
    struct vec3 from_a = v3_sub(p, s->a);
    double along = v3_dot(from_a, l->axis) * l->per_length2;
    struct vec3 off = v3_sub(from_a, v3_scale(l->axis, along));
    double away2 = v3_dot(off, off);
    if (l->flat) {
        double beside = v3_dot(off, s->side),
               overhang = fmax(0, fabs(beside) - s->width_a - (s->width_b - s->width_a) * along);
        away2 = fmax(0, away2 - beside * beside + overhang * overhang);
    }
    along += l->lean * sqrt(away2);
    if (s->open && along > 1) {
        out->distance = BEYOND_M;
        return;
    }
    double t = along < 0 ? 0 : along > 1 ? 1 : along, radius = s->radius_a + (s->radius_b - s->radius_a) * t;
    out->t = t;
    out->side_m = 0;
    out->on = v3_add(s->a, v3_scale(l->axis, t));
    if (l->flat) {
        double width = s->width_a + (s->width_b - s->width_a) * t, beside = v3_dot(v3_sub(p, out->on), s->side);
        out->side_m = beside < -width ? -width : beside > width ? width : beside;
        out->on = v3_add(out->on, v3_scale(s->side, out->side_m));
    }
    off = v3_sub(p, out->on);
    double deep = v3_dot(off, view), off2 = v3_dot(off, off);
    if (deep <= 0) {
        out->distance = sqrt(off2) - radius;
        return;
    }
    // The surface seen on this ray lies in front of the middle.
    double flat2 = fmax(0, off2 - deep * deep), safe = fmax(radius, 1e-6);
    out->distance = flat2 < radius * radius ? flat2 / safe - deep * sqrt(fmax(0, 1 - flat2 / (safe * safe))) - radius
                                            : sqrt(flat2) - radius;
}

static struct vec3 surface_normal(const struct body_solid *s, const struct solid_hit *n, struct vec3 p,
                                  struct vec3 view)
{
    double radius = s->radius_a + (s->radius_b - s->radius_a) * n->t;
    struct vec3 out = v3_sub(p, n->on);
    double deep = v3_dot(out, view);
    if (deep > 0) {
        struct vec3 flat = v3_sub(out, v3_scale(view, deep));
        double s1 = v3_length(flat), sine = s1 < radius ? s1 / fmax(radius, 1e-6) : 1;
        return v3_sub(v3_scale(v3_unit(flat), sine), v3_scale(view, sqrt(fmax(0, 1 - sine * sine))));
    }
    struct vec3 normal = v3_unit(out);
    return v3_dot(normal, normal) < 0.5 ? v3_scale(view, -1) : normal;
}

double solid_distance(const struct body_solid *s, struct vec3 p, struct vec3 *normal, struct vec3 *on, double *t,
                      double *side_m)
{
    struct solid_line line = make_solid_line(s);
    struct solid_hit n = {.solid = 0};
    measure_solid(s, &line, p, v3_unit(p), &n);
    *normal = surface_normal(s, &n, p, v3_unit(p));
    *on = n.on;
    *t = n.t;
    *side_m = n.side_m;
    return n.distance;
}

// How far each factor of the shape moves a place on solid i's surface along n.
static void shape_row(const struct shape_jacobian slope[SHAPE_COUNT], const struct body_solid *solid, int i, double t,
                      double side_m, struct vec3 n, double row[SHAPE_COUNT])
{
    double width = solid->width_a + (solid->width_b - solid->width_a) * t;
    double share = width > 1e-9 ? side_m / width : 0;
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
            const struct body_solid *m = &moved.solid[i], *o = &build->solid[i];
            slope[k].a[i] = v3_scale(v3_sub(m->a, o->a), 1 / d);
            slope[k].b[i] = v3_scale(v3_sub(m->b, o->b), 1 / d);
            slope[k].width_a[i] = (m->width_a - o->width_a) / d;
            slope[k].width_b[i] = (m->width_b - o->width_b) / d;
            slope[k].radius_a[i] = (m->radius_a - o->radius_a) / d;
            slope[k].radius_b[i] = (m->radius_b - o->radius_b) / d;
        }
    }
}

// A sphere around each solid spares most of the distances. Array by array, so
// that a compiler takes several at once.
struct solid_bounds {
    float x[SOLID_COUNT], y[SOLID_COUNT], z[SOLID_COUNT], radius[SOLID_COUNT];
    struct solid_line line[SOLID_COUNT];
};

static void find_bounds(const struct body_build *build, struct solid_bounds *bounds)
{
    for (int i = 0; i < build->solids; i++) {
        const struct body_solid *s = &build->solid[i];
        bounds->line[i] = make_solid_line(s);
        struct vec3 centre = v3_mix(s->a, s->b, 0.5);
        bounds->x[i] = (float)centre.x, bounds->y[i] = (float)centre.y, bounds->z[i] = (float)centre.z;
        bounds->radius[i] = (float)(0.5 * bounds->line[i].length + fmax(s->width_a, s->width_b) +
                                    fmax(s->radius_a, s->radius_b) + 1e-4);
    }
}

static void try_solid(const struct body_build *build, const struct solid_line *line, int k, struct vec3 p,
                      struct vec3 view, struct solid_hit *best)
{
    struct solid_hit n = {.solid = k};
    measure_solid(&build->solid[k], &line[k], p, view, &n);
    if (fabs(n.distance) < fabs(best->distance))
        *best = n;
}

// `guess`: a solid to try first, -1 none.
static struct solid_hit find_nearest(const struct body_build *build, const struct solid_bounds *bounds, struct vec3 p,
                                     struct vec3 view, int guess)
{
    struct solid_hit best = {.solid = 0, .distance = 1e9};
    if (guess >= 0)
        try_solid(build, bounds->line, guess, p, view, &best);
    float away2[SOLID_COUNT], x = (float)p.x, y = (float)p.y, z = (float)p.z;
    for (int k = 0; k < build->solids; k++) {
        float dx = x - bounds->x[k], dy = y - bounds->y[k], dz = z - bounds->z[k];
        away2[k] = dx * dx + dy * dy + dz * dz;
    }
    for (int k = 0; k < build->solids; k++) {
        float reach = (float)fabs(best.distance) + bounds->radius[k];
        if (k != guess && away2[k] <= reach * reach)
            try_solid(build, bounds->line, k, p, view, &best);
    }
    return best;
}

static double point_share(const struct depth_evidence *e)
{
    double patches = fmin(PATCHES_MAX, e->extent_m2 / (PATCH_M * PATCH_M));
    return fmin(1, patches / fmax(e->count, 1));
}

// What the skirt hides says nothing of the shape beneath: there a surface that is nearest to a point is not the one
// seen.
static bool is_under_skirt(const struct body_build *build, const struct body_solid *s, struct vec3 p)
{
    if (build->solids <= SOLID_SKIRT || s->segment < SEG_LEFT_THIGH)
        return false;
    const struct body_solid *skirt = &build->solid[SOLID_SKIRT + (s->segment >= SEG_RIGHT_THIGH)];
    struct vec3 axis = v3_sub(skirt->b, skirt->a);
    return v3_dot(v3_sub(p, skirt->a), axis) < v3_dot(axis, axis);
}

// Points against the nearest surface that the camera can see. With `system` NULL only judges.
static double add_points(const struct fit_task *task, const struct body_build *build,
                         const struct shape_jacobian *slope, struct fit_result *out, struct normal_equations *system)
{
    const struct depth_evidence *e = task->evidence;
    struct solid_bounds bounds;
    find_bounds(build, &bounds);
    double c2 = task->kernel_m * task->kernel_m, share = point_share(e) * task->point_stride, energy = 0;
    for (int i = 0; i < e->count; i += task->point_stride) {
        struct vec3 p = e->point[i].p, view = v3_unit(p);
        struct solid_hit best = find_nearest(build, &bounds, p, view, out->solid[i]);
        out->residual[i] = (float)best.distance;
        out->solid[i] = (int8_t)best.solid;
        double e2 = best.distance * best.distance, fade = c2 / (c2 + e2), weight = e->point[i].weight * share;
        if (task->have_floor && v3_dot(task->up, p) + task->floor_m < FEET_M)
            weight *= FEET_RATE;
        energy += 0.5 * weight * e2 * fade; // Geman and McClure
        if (!system)
            continue;
        const struct body_solid *s = &build->solid[best.solid];
        double radius = s->radius_a + (s->radius_b - s->radius_a) * best.t, row[SHAPE_COUNT];
        struct vec3 normal = surface_normal(s, &best, p, view);
        bool has_shape_row = slope && !is_under_skirt(build, s, p);
        if (has_shape_row)
            shape_row(slope, s, best.solid, best.t, best.side_m, normal, row);
        struct vec3 at = v3_add(best.on, v3_scale(normal, radius));
        double pull = weight * fade * fade,
               swing = s->open ? BODY_SKIRT_SWING * best.t : 0; // a hem moves with the thighs
        if (swing > 0)
            normal_equations_add(system, build, best.solid == SOLID_SKIRT ? SEG_LEFT_THIGH : SEG_RIGHT_THIGH, at,
                                 normal, best.distance, swing * pull, NULL);
        normal_equations_add(system, build, s->segment, at, normal, best.distance, (1 - swing) * pull,
                             has_shape_row ? row : NULL);
    }
    return energy;
}

#define LATERAL_RATE  0.75 // of the radius, so far to the side samples lie
#define LATERAL_DEPTH 0.66 // and so far before the middle the round front is there: sqrt(1 - 0.75^2)

// A sample of the model: c, whose surface is `radius` before it.
struct free_sample {
    enum segment segment;
    struct vec3 c;
    double radius, rate;
    const struct shape_jacobian
        *slope; // how solid number `solid` moves with the shape; NULL: it teaches nothing of that
    int solid;
    double t, deep;      // along it, and of its radius before its middle
    struct vec3 lateral; // from its middle to there, 0 or of length 1
};

// How far each factor of the shape moves a place along x, y and z.
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

// It must not stand beside the person, nor in front of what was measured.
static double add_free_sample(const struct fit_task *task, const struct body_build *build,
                              const struct free_sample *sample, struct normal_equations *system)
{
    const struct vec3 c = sample->c;
    const double radius = sample->radius;
    double rate = sample->rate;
    const struct depth_evidence *e = task->evidence;
    if (c.z < 0.2)
        return 0;
    struct vec3 at = c;
    double under = task->have_floor ? SHOE_M - (v3_dot(task->up, c) + task->floor_m) : 0;
    if (under > 0) { // judged by its upper edge, and not at all where even that is under the rim
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
        double length = hypot(dx, dy), overhang = length > slack ? (length - slack) / length : 0;
        off[0] = dx * overhang * c.z / e->lens.fx;
        off[1] = dy * overhang * c.z / e->lens.fy;
    } else if (kind == EVIDENCE_PERSON && measured > 0) {
        double excess = measured - front - 0.04 - 2 * depth_sigma_m(measured);
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
        find_rows(sample, grows); // few samples come so far
    for (int k = 0; k < 3; k++)
        if (off[k] != 0)
            normal_equations_add(system, build, sample->segment, c, v3(k == 0, k == 1, k == 2), off[k],
                                 weight * fade * fade, sample->slope ? grows[k] : NULL);
    return 0.5 * weight * e2 * fade;
}

// Where a body ends at the top: without it a trunk slides up and down in its picture.
static double add_crown(const struct fit_task *task, const struct body_build *build, const struct body_solid *skull,
                        struct normal_equations *system)
{
    struct vec3 up = v3_unit(v3_sub(skull->b, skull->a));
    struct vec3 c = v3_add(skull->b, v3_scale(up, skull->radius_b - CROWN_SLACK_M));
    const struct free_sample crown = {.segment = skull->segment, .c = c, .rate = CROWN_RATE};
    return add_free_sample(task, build, &crown, system);
}

// slope: it teaches the shape, or NULL.
static double add_free_solid(const struct fit_task *task, const struct body_build *build, int i,
                             const struct shape_jacobian *slope, struct normal_equations *system)
{
    const struct body_solid *s = &build->solid[i];
    struct vec3 axis = v3_sub(s->b, s->a), across = v3_unit(v3_cross(axis, s->a));
    double energy = 0;
    if (s->width_a > 0)
        across = s->side;
    for (int k = 0; k < 4; k++) {
        double t = (k + 0.5) / 4, radius = s->radius_a + (s->radius_b - s->radius_a) * t,
               width = s->width_a + (s->width_b - s->width_a) * t;
        struct vec3 middle = v3_add(s->a, v3_scale(axis, t));
        for (int side = -1; side <= 1; side++) {
            double beside = side * (width + LATERAL_RATE * radius), deep = side ? LATERAL_DEPTH : 1;
            const struct free_sample sample = {.segment = s->segment,
                                               .c = v3_add(middle, v3_scale(across, beside)),
                                               .radius = deep * radius,
                                               .rate = side ? 0.15 : 0.3,
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
    double far = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]), limit = far > 0.2 ? 0.2 / far : 1;
    pose->root = v3_add(pose->root, v3_scale(v3(x[0], x[1], x[2]), limit));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation = v3(x[3 + 3 * s], x[4 + 3 * s], x[5 + 3 * s]);
        double angle = v3_length(rotation);
        if (angle > 0.5)
            rotation = v3_scale(rotation, 0.5 / angle);
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
                  body_collision_energy(&out->build, out->limb_energy, NULL) +
                  body_prior_joint_limits(shape, pose, NULL, NULL);
}

void body_evaluate(const struct fit_task *task, const struct body_pose *pose, const struct body_shape *shape,
                   struct fit_result *out)
{
    memset(out->solid, -1, sizeof out->solid);
    evaluate(task, pose, shape, out);
}

double body_evaluate_limb(const struct fit_task *task, const struct body_build *build, int first, int count,
                          const struct limb_point *point, int point_count)
{
    double c2 = task->kernel_m * task->kernel_m, energy = 0;
    struct solid_line line[SOLID_COUNT];
    for (int k = first; k < first + count; k++)
        line[k] = make_solid_line(&build->solid[k]);
    for (int i = 0; i < point_count; i++) {
        const struct evidence_point *p = &task->evidence->point[point[i].index];
        struct solid_hit best = {.distance = point[i].other_distance_m};
        for (int k = first; k < first + count; k++)
            try_solid(build, line, k, p->p, v3_unit(p->p), &best);
        double e2 = best.distance * best.distance;
        energy += 0.5 * p->weight * e2 * c2 / (c2 + e2);
    }
    energy *= point_share(task->evidence);
    for (int k = first; k < first + count; k++)
        energy += add_free_solid(task, build, k, NULL, NULL);
    return energy;
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
        normal_equations_assemble(&system, &out->build);
        body_prior_joint_limits(&shape, &pose, &system.h[0][0], system.g);
        body_prior_motion(&pose, &task->expected, task->expected_sigma, &system.h[0][0], system.g);
        double x[FIT_COUNT] = {0};
        if (!normal_equations_solve(&system, 0.01, x))
            break;
        move_pose(&pose, x);
        for (int k = 0; task->learn_shape && k < SHAPE_COUNT; k++)
            shape.log[k] += x[FIT_POSE_COUNT + k] < -0.1  ? -0.1
                            : x[FIT_POSE_COUNT + k] > 0.1 ? 0.1
                                                          : x[FIT_POSE_COUNT + k];
    }
    if (task->learn_shape && task->iterations > 0) {
        normal_equations_shape_information(&system, out->shape_information);
        for (int a = 0; a < SHAPE_COUNT; a++)
            for (int b = 0; b < SHAPE_COUNT; b++) // this picture's alone
                out->shape_information[a][b] -= task->shape.information[a][b] / task->learn_rate;
    }
    out->pose = pose;
    out->shape = shape;
    if (!task->rough)
        evaluate(task, &pose, &shape, out);
}

struct shape_prior shape_prior_default(void)
{
    // Standard deviations of an adult population around the proportions (5 to 8 %)
    // and of its height (8 %).
    static const double sigma[SHAPE_COUNT] = {0.12, 0.05, 0.07, 0.07, 0.07, 0.05, 0.04,
                                              0.04, 0.06, 0.08, 0.08, 0.08, 0.07, 0.08};
    struct shape_prior prior;
    memset(&prior, 0, sizeof prior);
    for (int k = 0; k < SHAPE_COUNT; k++)
        prior.information[k][k] = 1 / (sigma[k] * sigma[k]);
    return prior;
}
