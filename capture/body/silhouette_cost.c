#include "capture/body/silhouette_cost.h"

#include "base/depth_noise.h"
#include "base/portable_math.h"

// Chosen by hand; test_occluded_shin measures the outcome.
#define PATCH_M       0.02
#define MARGIN        0.70 // of the radius: farther out the solid may be wider than the real limb
#define RIM_M         0.01 // off the person by this much counts half: a mask ends where depth does
#define FRONT_M       0.04 // cloth in front of the measured depth, beside twice the noise
#define DEEP_M        0.03 // beyond that, this much counts half
#define SHOE_UNSEEN_M 0.07 // over the floor, of a shoe: a mask ends there
#define NEAR_PLANE_M  0.2  // surfaces nearer than this are ignored

enum { ACROSS = 2 }; // patches to each side of a limb's middle line

static double saturate(double off_m, double half_m)
{
    return off_m > 0 ? off_m * off_m / (off_m * off_m + half_m * half_m) : 0;
}

// 0: the surface at depth surface_m on the ray through c (camera axes) is the person's or occluded; 1: it is certainly
// not there.
static double outside_share(const struct fit_task *task, struct vec3 c, double surface_m)
{
    const struct depth_evidence *e = task->evidence;
    double measured, dx, dy;
    if (c.z < NEAR_PLANE_M || (task->have_floor && v3_dot(task->up, c) + task->floor_m < SHOE_UNSEEN_M))
        return 0;
    enum evidence_kind kind = evidence_at(e, lens_project(&e->lens, c), c.z, &measured, &dx, &dy);
    if (kind == EVIDENCE_OFF_PERSON) // dx, dy lead to a cell's middle
        return saturate((portable_hypot(dx, dy) - 0.5 * (e->step + 1)) * c.z / e->lens.fx, RIM_M);
    if (kind == EVIDENCE_PERSON && measured > 0)
        return saturate(measured - surface_m - FRONT_M - 2 * depth_sigma_m(measured), DEEP_M);
    return 0;
}

double silhouette_outside_patches(const struct fit_task *task, const struct body_build *build, int first, int count)
{
    double patches = 0;
    for (int k = first; k < first + count; k++) {
        const struct body_solid *s = &build->solid[k];
        struct vec3 axis = v3_sub(s->b, s->a), across = v3_unit(v3_cross(axis, s->a));
        double length = v3_length(axis);
        int along = (int)fmax(1, ceil(length / PATCH_M));
        for (int i = 0; i < along; i++) {
            double t = (i + 0.5) / along, radius = solid_radius(s, t),
                   patch = length / along * MARGIN / ACROSS * radius / (PATCH_M * PATCH_M);
            struct vec3 middle = v3_mix(s->a, s->b, t);
            for (int j = -ACROSS; j <= ACROSS; j++) {
                double off = MARGIN / ACROSS * j;
                struct vec3 c = v3_add(middle, v3_scale(across, off * radius));
                patches += patch * outside_share(task, c, c.z - radius * sqrt(1 - off * off));
            }
        }
    }
    return patches;
}
