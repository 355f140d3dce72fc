#include "surround/alignment/plane_refinement.h"

#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

enum { ITERATIONS = 6 };
#define PRIOR_SHIFT_M 0.05
#define PRIOR_TURN    0.017
#define HUBER         1.5 // standard deviations
// Errors of neighbouring samples are alike, and a voxel's plane is no truth either: all samples of a capture count as
// so many independent ones, and so many of a voxel as one.
#define INDEPENDENT 200
#define VOXEL_ALIKE 20
#define MOST_OFF_M  0.08 // a point farther from the voxel's plane belongs to something else

// A voxel's plane, kept: voxels are asked for again and again. A later voxel in the same slot replaces it.
enum { KEPT_PLANES = 16384 };
struct kept_plane {
    const struct voxel *voxel; // NULL: empty
    bool flat;
    double normal[3], mean[3], variance;
};

static const struct kept_plane *plane_of(const struct voxel_map *planes, struct kept_plane *kept, const double p[3])
{
    const struct voxel *v = voxel_map_at(planes, p);
    if (!v)
        return NULL;
    struct kept_plane *slot = &kept[(size_t)(v - planes->table) % KEPT_PLANES];
    if (slot->voxel != v) {
        double thickness = 0;
        slot->voxel = v;
        slot->flat = voxel_plane(v, slot->normal, &thickness);
        voxel_mean(planes, v, slot->mean);
        slot->variance = thickness * thickness / v->count * VOXEL_ALIKE;
    }
    return slot->flat ? slot : NULL;
}

static void add_point(struct normal_equations *e, const struct kept_plane *plane, const double p[3],
                      const double origin[3], double sigma, double share)
{
    double r = 0, arm[3];
    for (int i = 0; i < 3; i++) {
        r += plane->normal[i] * (p[i] - plane->mean[i]);
        arm[i] = p[i] - origin[i];
    }
    if (fabs(r) > MOST_OFF_M)
        return;
    const double s = sqrt(sigma * sigma + plane->variance) + 1e-3;
    const double huber = fabs(r) <= HUBER * s ? 1 : HUBER * s / fabs(r);
    normal_equations_add(e, plane->normal, arm, r, share * huber / (s * s));
}

// Adds the prior and holds the degrees that leave the floor; then the step.
static void solve(struct normal_equations *e, const struct pose *now, const struct pose *prior, double step[6])
{
    const struct quat turned = quat_multiply(prior->rotation, quat_conjugate(now->rotation));
    const struct vec3 back = quat_to_rotation_vector(turned), away = v3_sub(prior->translation, now->translation);
    const double to_prior[6] = {back.x, back.y, back.z, away.x, away.y, away.z};
    for (int a = 0; a < 6; a++) {
        const double sigma = a < 3 ? PRIOR_TURN : PRIOR_SHIFT_M;
        const bool held = a == 0 || a == 1 || a == 5;
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

struct refinement {
    const struct voxel_map *planes;
    const struct depth_points *points;
    int stride;
    struct kept_plane *kept;
};

static void add_points(const struct refinement *r, const struct pose *now, struct normal_equations *e)
{
    const double origin[3] = {now->translation.x, now->translation.y, now->translation.z};
    const double share = fmin(1, (double)INDEPENDENT * r->stride / (r->points->count + 1));
    double m[3][3];
    quat_to_matrix(now->rotation, m);
    for (int i = 0; i < r->points->count; i += r->stride) {
        const float *b = r->points->xyz[i];
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + origin[k];
        const struct kept_plane *plane = plane_of(r->planes, r->kept, p);
        if (plane)
            add_point(e, plane, p, origin, r->points->sigma[i], share);
    }
}

enum status plane_refine(const struct voxel_map *planes, const struct depth_points *points, int most,
                         const struct pose_evidence *more, struct pose *world_from_body)
{
    const struct pose prior = *world_from_body;
    struct refinement r = {planes, points, points->count > most ? points->count / most : 1,
                           calloc(KEPT_PLANES, sizeof *r.kept)};
    if (!r.kept)
        return fail(ERR_MEMORY, "out of memory");
    for (int it = 0; it < ITERATIONS; it++) {
        struct normal_equations e = {0};
        const struct pose now = *world_from_body;
        double step[6];
        add_points(&r, &now, &e);
        if (more && more->add)
            more->add(more->self, &now, &e);
        solve(&e, &now, &prior, step);
        const struct quat turn = quat_from_rotation_vector(v3(step[0], step[1], step[2]));
        world_from_body->rotation = quat_unit(quat_multiply(turn, now.rotation));
        world_from_body->translation = v3_add(now.translation, v3(step[3], step[4], step[5]));
        if (fabs(step[2]) < 1e-5 && fabs(step[3]) < 5e-5 && fabs(step[4]) < 5e-5)
            break;
    }
    free(r.kept);
    return OK;
}
