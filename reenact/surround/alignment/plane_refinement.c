#include "reenact/surround/alignment/plane_refinement.h"

#include "base/linear_algebra.h"

#include <string.h>

enum { ITERATIONS = 10 };
#define PRIOR_SHIFT_M 0.05
#define PRIOR_TURN    0.017
#define HUBER         1.5 // standard deviations
// Errors of neighbouring samples are alike, and a voxel's plane is no truth either: so many samples count as one.
#define SAMPLES_ALIKE 20
#define MOST_OFF_M    0.08 // a point farther from the voxel's plane belongs to something else

struct normal_equations {
    double h[36], g[6];
    int matched;
};

static void add_residual(struct normal_equations *e, const double n[3], const double arm[3], double r, double weight)
{
    const double j[6] = {
        arm[1] * n[2] - arm[2] * n[1], arm[2] * n[0] - arm[0] * n[2], arm[0] * n[1] - arm[1] * n[0], n[0], n[1], n[2]};
    for (int a = 0; a < 6; a++) {
        e->g[a] -= weight * j[a] * r;
        for (int b = 0; b < 6; b++)
            e->h[6 * a + b] += weight * j[a] * j[b];
    }
}

static void add_point(struct normal_equations *e, const struct voxel_map *planes, const double p[3],
                      const double origin[3], double sigma)
{
    const struct voxel *v = voxel_map_at(planes, p);
    double normal[3], thickness, mean[3], r = 0, arm[3];
    if (!v || !voxel_plane(v, normal, &thickness))
        return;
    voxel_mean(planes, v, mean);
    for (int i = 0; i < 3; i++) {
        r += normal[i] * (p[i] - mean[i]);
        arm[i] = p[i] - origin[i];
    }
    if (fabs(r) > MOST_OFF_M)
        return;
    const double s = sqrt(sigma * sigma + thickness * thickness / v->count * SAMPLES_ALIKE) + 1e-3;
    const double huber = fabs(r) <= HUBER * s ? 1 : HUBER * s / fabs(r);
    add_residual(e, normal, arm, r, huber / (s * s * SAMPLES_ALIKE));
    e->matched++;
}

// Adds the prior and holds the degrees that must not move; then the step.
static void solve(struct normal_equations *e, const struct pose *now, const struct pose *prior, bool tilt,
                  double step[6])
{
    const struct quat turned = quat_multiply(prior->rotation, quat_conjugate(now->rotation));
    const struct vec3 back = quat_to_rotation_vector(turned), away = v3_sub(prior->translation, now->translation);
    const double to_prior[6] = {back.x, back.y, back.z, away.x, away.y, away.z};
    for (int a = 0; a < 6; a++) {
        const double sigma = a < 3 ? PRIOR_TURN : PRIOR_SHIFT_M;
        const bool held = !tilt && (a == 0 || a == 1 || a == 5);
        const double information = held ? 1e15 : 1 / (sigma * sigma);
        e->h[7 * a] += information;
        e->g[a] += information * (held ? 0 : to_prior[a]);
        step[a] = e->g[a];
    }
    if (cholesky_factor(e->h, 6))
        cholesky_solve(e->h, 6, step);
    else
        memset(step, 0, 6 * sizeof *step);
}

int plane_refine(const struct voxel_map *planes, const struct depth_points *points, bool tilt, int most,
                 struct pose *world_from_body)
{
    const struct pose prior = *world_from_body;
    const int stride = points->count > most ? points->count / most : 1;
    int matched = 0;
    for (int it = 0; it < ITERATIONS; it++) {
        struct normal_equations e = {0};
        const struct pose now = *world_from_body;
        const double origin[3] = {now.translation.x, now.translation.y, now.translation.z};
        double m[3][3], step[6];
        quat_to_matrix(now.rotation, m);
        for (int i = 0; i < points->count; i += stride) {
            const float *b = points->xyz[i];
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + origin[k];
            add_point(&e, planes, p, origin, points->sigma[i]);
        }
        matched = e.matched;
        solve(&e, &now, &prior, tilt, step);
        const struct quat turn = quat_from_rotation_vector(v3(step[0], step[1], step[2]));
        world_from_body->rotation = quat_unit(quat_multiply(turn, now.rotation));
        world_from_body->translation = v3_add(now.translation, v3(step[3], step[4], step[5]));
        if (fabs(step[2]) < 1e-6 && fabs(step[3]) < 1e-5 && fabs(step[4]) < 1e-5)
            break;
    }
    return matched;
}
