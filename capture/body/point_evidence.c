#include "capture/body/point_evidence.h"

#include "capture/body/normal_equations.h"

#include <string.h>

#define SIGMA_FLOOR_PX  1.5 // the network's cells, and motion between colour and depth
#define VISIBILITY_NONE 0.5 // a point less visible than this does not count,
#define VISIBILITY_FULL 0.9 // one more visible than this counts in full
#define NEAR_PLANE_M    0.2

// Places and standard deviations below were measured with POSE_NETWORK_LITE on eight rendered films (woman, man, child,
// heavy; kata and pirouette; 240 images), against the body fitted to their depth where that is within 45 mm of the true
// joints: the larger of what median and 95th percentile give, of a body 1.72 m tall. Rendered faces are flat, so that
// the nose is put a third further ahead. Real images are harder: an actor 250 px tall had 7.7 px, 1.4 times as much.
#define REAL_IMAGE_RATE 1.4

// A point of the body: at t along a solid's axis, and `off` in that segment's axes and the solid's radii there.
struct point_rule {
    enum segment segment;
    int solid;
    double t;
    struct vec3 off;
    double sigma_m;
};

#define EACH(name, segment, solid, t, x, y, z, sigma)                                                                  \
    [BODY_POINT_LEFT_##name] = {segment(LEFT), solid(LEFT), t, {x, y, z}, sigma},                                      \
    [BODY_POINT_RIGHT_##name] = {segment(RIGHT), solid(RIGHT), t, {-(x), y, z}, sigma}
#define HEAD_OF(side)       SEG_HEAD
#define PELVIS_OF(side)     SEG_PELVIS
#define CLAVICLE_OF(side)   SEG_##side##_CLAVICLE
#define ARM_OF(side)        SEG_##side##_UPPER_ARM
#define FOREARM_OF(side)    SEG_##side##_FOREARM
#define THIGH_OF(side)      SEG_##side##_THIGH
#define SHIN_OF(side)       SEG_##side##_SHIN
#define FOOT_OF(side)       SEG_##side##_FOOT
#define SKULL(side)         SOLID_SKULL
#define ARM_SOLID(side)     SOLID_##side##_ARM + 1
#define FOREARM_SOLID(side) SOLID_##side##_ARM + 2
#define THIGH_SOLID(side)   SOLID_##side##_LEG
#define SHIN_SOLID(side)    SOLID_##side##_LEG + 1
#define FOOT_SOLID(side)    SOLID_##side##_LEG + 2

static const struct point_rule point_rule[BODY_POINT_COUNT] = {
    [BODY_POINT_NOSE] = {SEG_HEAD, SOLID_SKULL, 0, {0, 0.2, 0.9}, 0.020},
    EACH(EYE, HEAD_OF, SKULL, 0.4, 0.3, 0.3, 0.7, 0.020),
    EACH(EAR, HEAD_OF, SKULL, 0.2, 0.6, 0.2, 0.2, 0.020),
    EACH(SHOULDER, CLAVICLE_OF, ARM_SOLID, 0, -0.1, 0.2, 0.15, 0.030),
    EACH(ELBOW, ARM_OF, ARM_SOLID, 1, 0, 0, 0, 0.031),
    EACH(WRIST, FOREARM_OF, FOREARM_SOLID, 1, 0, 0, 0, 0.035),
    EACH(HIP, PELVIS_OF, THIGH_SOLID, 0, 0, -0.1, 0.15, 0.026),
    EACH(KNEE, THIGH_OF, THIGH_SOLID, 1, 0, 0, 0, 0.025),
    EACH(ANKLE, SHIN_OF, SHIN_SOLID, 1, 0, 0, 0, 0.033),
    EACH(HEEL, FOOT_OF, FOOT_SOLID, 0, -0.4, -0.4, 0, 0.041),
    EACH(TOE, FOOT_OF, FOOT_SOLID, 1, 0, -0.3, 0, 0.050),
};

struct vec3 body_point_on(const struct body_build *build, enum body_point_name name)
{
    const struct point_rule *rule = &point_rule[name];
    const struct body_solid *s = &build->solid[rule->solid];
    struct vec3 at = v3_mix(s->a, s->b, rule->t);
    const double radius = solid_radius(s, rule->t), off[3] = {rule->off.x, rule->off.y, rule->off.z};
    for (int k = 0; k < 3; k++)
        at = v3_add(at, v3_scale(body_axis(build, rule->segment, k), radius * off[k]));
    return at;
}

static bool in_image(const struct lens *lens, struct pixel px)
{
    return px.x >= -0.5 && px.y >= -0.5 && px.x <= lens->width - 0.5 && px.y <= lens->height - 0.5;
}

void point_evidence_read(struct point_evidence *out, const struct body_points *points,
                         const struct calibration *calibration, double distance_m)
{
    const struct pose depth_from_color = pose_inverse(calibration->color_from_depth);
    const struct lens *lens = &calibration->color;
    double all = 0;
    memset(out, 0, sizeof *out);
    memset(out->index, -1, sizeof out->index);
    out->eye = depth_from_color.translation;
    for (int k = 0; points->person && k < BODY_POINT_COUNT; k++) {
        const struct body_point *p = &points->at[k];
        const struct pixel px = {(double)p->x_px, (double)p->y_px};
        const double beyond = (double)p->visibility - VISIBILITY_NONE, full = VISIBILITY_FULL - VISIBILITY_NONE;
        if (!(beyond > 0) || !in_image(lens, px))
            continue;
        const struct vec3 along = v3_unit(quat_rotate(depth_from_color.rotation, lens_ray(lens, px)));
        const struct vec3 right = v3_perpendicular(along);
        const double seen = fmin(1, beyond / full);
        const double angle = REAL_IMAGE_RATE * point_rule[k].sigma_m / fmax(distance_m, NEAR_PLANE_M),
                     pixel = SIGMA_FLOOR_PX / lens->fx;
        out->index[k] = (int8_t)out->count;
        out->ray[out->count++] = (struct point_ray){.name = (enum body_point_name)k,
                                                    .along = along,
                                                    .across = {right, v3_cross(along, right)},
                                                    .sigma = sqrt(angle * angle + pixel * pixel),
                                                    .weight = seen};
        all += seen;
    }
    for (int i = 0; i < out->count; i++)
        out->ray[i].weight *= fmin(1, POINTS_INDEPENDENT / all);
}

// Residuals are the tangents u of the angles off the ray, du/dp = (across - u along) / depth.
static double ray_energy(const struct point_evidence *evidence, const struct point_ray *ray,
                         const struct body_build *build, struct normal_equations *system)
{
    const struct vec3 p = body_point_on(build, ray->name), q = v3_sub(p, evidence->eye);
    const double depth = v3_dot(q, ray->along), c2 = POINT_KERNEL * POINT_KERNEL;
    if (depth < NEAR_PLANE_M)
        return ray->weight * POINT_ENERGY_MAX;
    double u[2], e2 = 0;
    for (int k = 0; k < 2; k++) {
        u[k] = v3_dot(q, ray->across[k]) / depth;
        e2 += u[k] * u[k] / (ray->sigma * ray->sigma);
    }
    const double fade = c2 / (c2 + e2);
    for (int k = 0; system && k < 2; k++) {
        const struct vec3 slope = v3_sub(ray->across[k], v3_scale(ray->along, u[k]));
        const double length = v3_length(slope), scale = length / (depth * ray->sigma);
        normal_equations_add(system, build,
                             &(struct point_residual){.segment = point_rule[ray->name].segment,
                                                      .point = p,
                                                      .normal = v3_scale(slope, 1 / length),
                                                      .residual = -u[k] * depth / length,
                                                      .weight = ray->weight * fade * fade * scale * scale});
    }
    return 0.5 * ray->weight * e2 * fade;
}

double point_evidence_energy(const struct point_evidence *evidence, const struct body_build *build,
                             struct normal_equations *system)
{
    double energy = 0;
    for (int i = 0; evidence && i < evidence->count; i++)
        energy += ray_energy(evidence, &evidence->ray[i], build, system);
    return energy;
}

static bool is_on(const struct point_ray *ray, int first, int count)
{
    const int solid = point_rule[ray->name].solid;
    return solid >= first && solid < first + count;
}

double point_evidence_dispute(const struct point_evidence *evidence, const struct body_build *build, int first,
                              int count)
{
    double energy = 0, max = 0;
    for (int i = 0; evidence && i < evidence->count; i++)
        if (is_on(&evidence->ray[i], first, count)) {
            energy += ray_energy(evidence, &evidence->ray[i], build, NULL);
            max += evidence->ray[i].weight * POINT_ENERGY_MAX;
        }
    return max > 0 ? energy / max : 0;
}
