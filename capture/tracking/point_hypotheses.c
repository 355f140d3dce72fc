#include "capture/tracking/point_hypotheses.h"

#include "base/portable_math.h"

#include <stdlib.h>

// Chosen by hand.
#define DISPUTED_SHARE 0.4  // of what the points of a limb can have against a place: it is disputed
#define OUT_OF_REACH_M 0.10 // a ray that passes a limb's reach by more than this says nothing about it
#define MARCH_FIRST_M  0.5
#define MARCH_LAST_M   8.0
#define MARCH_STEP_M   0.04
#define BEHIND_M       0.30 // further behind a surface than this, a ray has passed it without a hit: depth is missing
#define SURFACE_M      0.08 // a joint lies this much behind the surface
#define SPHERE_M       0.16
#define BODY_REACH_M   0.8 // from the median depth of the points
#define BESIDE_M       0.15
#define ON_SHARE       0.5
enum { POINTS_MIN = 4 };

static const enum body_point_name limb_point[LIMB_COUNT][2] = {
    {BODY_POINT_LEFT_ELBOW, BODY_POINT_LEFT_WRIST},
    {BODY_POINT_RIGHT_ELBOW, BODY_POINT_RIGHT_WRIST},
    {BODY_POINT_LEFT_KNEE, BODY_POINT_LEFT_ANKLE},
    {BODY_POINT_RIGHT_KNEE, BODY_POINT_RIGHT_ANKLE},
};

// Where a ray meets a sphere; where it passes by, the point of the sphere nearest to it. Returns the number of points.
static int meet_sphere(struct vec3 eye, struct vec3 along, struct vec3 centre, double radius, struct vec3 out[2])
{
    const struct vec3 to = v3_sub(centre, eye);
    const double ahead = v3_dot(to, along), d2 = v3_dot(to, to) - ahead * ahead, half2 = radius * radius - d2;
    const struct vec3 foot = v3_add(eye, v3_scale(along, ahead));
    if (half2 <= 0) {
        if (d2 > (radius + OUT_OF_REACH_M) * (radius + OUT_OF_REACH_M))
            return 0;
        out[0] = v3_add(centre, v3_scale(v3_unit(v3_sub(foot, centre)), radius));
        return 1;
    }
    out[0] = v3_sub(foot, v3_scale(along, sqrt(half2)));
    out[1] = v3_add(foot, v3_scale(along, sqrt(half2)));
    return 2;
}

int point_limb_targets(const struct point_evidence *points, const struct body_build *build, int k,
                       struct limb_target out[LIMB_TARGETS_MAX])
{
    if (!points || points->index[limb_point[k][0]] < 0 || points->index[limb_point[k][1]] < 0)
        return 0;
    const struct body_limb *l = &body_limbs[k];
    const struct vec3 root = build->origin[l->upper], bend = points->ray[points->index[limb_point[k][0]]].along,
                      tip = points->ray[points->index[limb_point[k][1]]].along;
    const double upper_m = v3_distance(root, build->origin[l->lower]),
                 lower_m = v3_distance(build->origin[l->lower], build->origin[l->end]);
    struct vec3 middle[2], end[2];
    int count = 0, middles = meet_sphere(points->eye, bend, root, upper_m, middle);
    for (int i = 0; i < middles; i++) {
        const int ends = meet_sphere(points->eye, tip, middle[i], lower_m, end);
        for (int j = 0; j < ends; j++)
            out[count++] = (struct limb_target){end[j], v3_sub(middle[i], root)};
    }
    return count;
}

bool point_limb_is_disputed(const struct point_evidence *points, const struct body_build *build, int k)
{
    return point_evidence_dispute(points, build, body_limbs[k].first_solid, LIMB_SOLIDS) > DISPUTED_SHARE;
}

// The distance along a ray of the first surface that depth shows; 0: none.
static double first_surface_m(struct vec3 eye, struct vec3 along, const struct lens *lens, const uint16_t *depth,
                              const uint8_t *mask)
{
    for (double m = MARCH_FIRST_M; m < MARCH_LAST_M; m += MARCH_STEP_M) {
        const struct vec3 p = v3_add(eye, v3_scale(along, m));
        if (p.z < MARCH_FIRST_M)
            continue;
        const struct pixel px = lens_project(lens, p);
        if (!(px.x >= 0 && px.y >= 0 && px.x < lens->width - 1 && px.y < lens->height - 1))
            continue;
        const int at = (int)(px.y + 0.5) * lens->width + (int)(px.x + 0.5);
        const double there = mask && !mask[at] ? 0 : depth[at] * 0.001;
        if (there > 0 && p.z >= there)
            return p.z < there + BEHIND_M ? m : 0;
    }
    return 0;
}

enum body_point_name point_of_limb(int k, int which) { return limb_point[k][which]; }

double point_surface_m(const struct point_evidence *points, enum body_point_name name, const struct lens *lens,
                       const uint16_t *depth, const uint8_t *mask)
{
    return points->index[name] < 0
               ? 0
               : first_surface_m(points->eye, points->ray[points->index[name]].along, lens, depth, mask);
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int point_spheres(const struct point_evidence *points, const struct lens *lens, const uint16_t *depth,
                  struct bounding_sphere out[POINT_SPHERES_MAX])
{
    double far[BODY_POINT_COUNT], sorted[BODY_POINT_COUNT];
    int count = 0, hits = 0;
    for (int i = 0; i < points->count; i++) {
        far[i] = first_surface_m(points->eye, points->ray[i].along, lens, depth, NULL);
        if (far[i] > 0)
            sorted[hits++] = far[i];
    }
    if (hits < POINTS_MIN)
        return 0;
    qsort(sorted, (size_t)hits, sizeof *sorted, compare_doubles);
    for (int i = 0; i < points->count; i++)
        if (far[i] > 0 && fabs(far[i] - sorted[hits / 2]) < BODY_REACH_M)
            out[count++] = (struct bounding_sphere){
                v3_add(points->eye, v3_scale(points->ray[i].along, far[i] + SURFACE_M)), SPHERE_M};
    return count < POINTS_MIN ? 0 : count;
}

bool points_are_on_person(const struct point_evidence *points, const struct depth_evidence *evidence, double distance_m)
{
    int on = 0;
    for (int i = 0; i < points->count; i++) {
        const struct vec3 p = v3_add(points->eye, v3_scale(points->ray[i].along, distance_m));
        double depth, dx, dy;
        if (p.z < MARCH_FIRST_M)
            continue;
        const enum evidence_kind kind = evidence_at(evidence, lens_project(&evidence->lens, p), p.z, &depth, &dx, &dy);
        on += kind == EVIDENCE_PERSON ||
              (kind == EVIDENCE_OFF_PERSON && portable_hypot(dx, dy) * p.z / evidence->lens.fx < BESIDE_M);
    }
    return points->count >= POINTS_MIN && on > ON_SHARE * points->count;
}
