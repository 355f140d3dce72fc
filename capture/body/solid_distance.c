#include "capture/body/solid_distance.h"

#define BEYOND_M 1e3 // distance from a tube of a point beyond its end

static struct solid_line make_solid_line(const struct body_solid *solid)
{
    struct solid_line l = {.axis = v3_sub(solid->b, solid->a), .flat = solid->width_a > 0 || solid->width_b > 0};
    double length2 = v3_dot(l.axis, l.axis);
    l.length = sqrt(length2);
    l.per_length2 = length2 > 1e-12 ? 1 / length2 : 0;
    l.lean = (solid->radius_b - solid->radius_a) * l.per_length2;
    return l;
}

// Fills all but `solid`; `view` is the unit vector to p.
static void measure_solid(const struct body_solid *solid, const struct solid_line *line, struct vec3 p,
                          struct vec3 view, struct solid_hit *out)
{
    struct vec3 from_a = v3_sub(p, solid->a);
    double along = v3_dot(from_a, line->axis) * line->per_length2;
    struct vec3 off = v3_sub(from_a, v3_scale(line->axis, along));
    double away2 = v3_dot(off, off);
    if (line->flat) {
        double beside = v3_dot(off, solid->side),
               overhang = fmax(0, fabs(beside) - solid->width_a - (solid->width_b - solid->width_a) * along);
        away2 = fmax(0, away2 - beside * beside + overhang * overhang);
    }
    along += line->lean * sqrt(away2);
    if (solid->open && along > 1) {
        out->distance = BEYOND_M;
        return;
    }
    double t = along < 0 ? 0 : along > 1 ? 1 : along, radius = solid_radius(solid, t);
    out->t = t;
    out->side_m = 0;
    out->on = v3_add(solid->a, v3_scale(line->axis, t));
    if (line->flat) {
        double width = solid_width(solid, t), beside = v3_dot(v3_sub(p, out->on), solid->side);
        out->side_m = beside < -width ? -width : beside > width ? width : beside;
        out->on = v3_add(out->on, v3_scale(solid->side, out->side_m));
    }
    off = v3_sub(p, out->on);
    double deep = v3_dot(off, view), off2 = v3_dot(off, off);
    if (deep <= 0) {
        out->distance = sqrt(off2) - radius;
        return;
    }
    // Behind the middle: the surface on this ray lies in front of it.
    double flat2 = fmax(0, off2 - deep * deep), safe = fmax(radius, 1e-6);
    out->distance = flat2 < radius * radius ? flat2 / safe - deep * sqrt(fmax(0, 1 - flat2 / (safe * safe))) - radius
                                            : sqrt(flat2) - radius;
}

struct vec3 surface_normal(const struct body_solid *solid, const struct solid_hit *hit, struct vec3 p, struct vec3 view)
{
    double radius = solid_radius(solid, hit->t);
    struct vec3 out = v3_sub(p, hit->on);
    double deep = v3_dot(out, view);
    if (deep > 0) {
        struct vec3 flat = v3_sub(out, v3_scale(view, deep));
        double s1 = v3_length(flat), sine = s1 < radius ? s1 / fmax(radius, 1e-6) : 1;
        return v3_sub(v3_scale(v3_unit(flat), sine), v3_scale(view, sqrt(fmax(0, 1 - sine * sine))));
    }
    struct vec3 normal = v3_unit(out);
    return v3_dot(normal, normal) < 0.5 ? v3_scale(view, -1) : normal;
}

double solid_distance(const struct body_solid *solid, struct vec3 p, struct vec3 *normal)
{
    struct solid_line line = make_solid_line(solid);
    struct solid_hit hit = {.solid = 0};
    measure_solid(solid, &line, p, v3_unit(p), &hit);
    if (normal)
        *normal = surface_normal(solid, &hit, p, v3_unit(p));
    return hit.distance;
}

void find_solid_bounds(const struct body_build *build, struct solid_bounds *bounds)
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

// Replaces *best by solid k where that is nearer to p. view: the unit vector to p.
static void try_solid(const struct body_build *build, const struct solid_line *line, int k, struct vec3 p,
                      struct vec3 view, struct solid_hit *best)
{
    struct solid_hit n = {.solid = k};
    measure_solid(&build->solid[k], &line[k], p, view, &n);
    if (fabs(n.distance) < fabs(best->distance))
        *best = n;
}

struct solid_hit find_nearest_solid(const struct body_build *build, const struct solid_bounds *bounds, struct vec3 p,
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
