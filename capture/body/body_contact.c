#include "capture/body/normal_equations.h"

// Feet do not go through the floor, and the lower one mostly stands on it: the
// mask ends above the floor, so that no point pulls a sole down.
double body_floor_energy(const struct fit_task *task, const struct body_build *build, struct normal_equations *system)
{
    double energy = 0;
    if (!task->have_floor)
        return 0;
    double lowest = 1e9;
    int standing = -1;
    for (int i = 0; i < SOLID_SKIRT; i++) {
        const struct body_solid *s = &build->solid[i];
        bool foot = s->segment == SEG_LEFT_FOOT || s->segment == SEG_RIGHT_FOOT;
        double sum = 0;
        for (int end = 0; end < 2; end++) {
            struct vec3 c = end ? s->b : s->a;
            double over = v3_dot(task->up, c) + task->floor_m - (end ? s->radius_b : s->radius_a);
            sum += over;
            if (over >= 0)
                continue;
            double weight = 1 / (0.02 * 0.02);
            energy += 0.5 * weight * fmin(over * over, 0.04);
            normal_equations_add(system, build, s->segment, c, task->up, -over, weight, NULL);
        }
        if (foot && sum < lowest) {
            lowest = sum;
            standing = i;
        }
    }
    const struct body_solid *s = &build->solid[standing];
    for (int end = 0; end < 2; end++) { // heel and toe of the lower foot, unless it is well off the floor
        struct vec3 c = end ? s->b : s->a;
        double over = v3_dot(task->up, c) + task->floor_m - (end ? s->radius_b : s->radius_a);
        if (over <= 0 || over > 0.5)
            continue;
        double c2 = 0.06 * 0.06, fade = c2 / (c2 + over * over), weight = 1 / (0.02 * 0.02);
        energy += 0.5 * weight * over * over * fade;
        normal_equations_add(system, build, s->segment, c, task->up, -over, weight * fade * fade, NULL);
    }
    return energy;
}

// Flesh gives way: surfaces may overlap by this share of the thinner one's radius.
#define SOFT_TISSUE_RATE 0.5
#define CONTACT_SIGMA_M  0.015

// How deep a ball is in a solid; *out points the short way out. <= 0: not in it.
static double penetration_depth(const struct body_solid *s, struct vec3 c, double radius, struct vec3 *out)
{
    struct vec3 axis = v3_sub(s->b, s->a), from = v3_sub(c, s->a);
    double length2 = v3_dot(axis, axis), t = length2 > 1e-12 ? v3_dot(from, axis) / length2 : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    double width = s->width_a + (s->width_b - s->width_a) * t, thick = s->radius_a + (s->radius_b - s->radius_a) * t;
    struct vec3 middle = v3_add(s->a, v3_scale(axis, t)), off = v3_sub(c, middle);
    double beside = width > 0 ? v3_dot(off, s->side) : 0;
    off = v3_sub(off, v3_scale(s->side, beside < -width ? -width : beside > width ? width : beside));
    *out = v3_unit(off);
    return thick + radius - v3_length(off);
}

static double collision_cost(const struct body_build *build, int mover, int first, int last, double t,
                             double limb_energy[SEG_COUNT], struct normal_equations *system)
{
    const struct body_solid *m = &build->solid[mover];
    struct vec3 c = v3_mix(m->a, m->b, t);
    double radius = (m->radius_a + (m->radius_b - m->radius_a) * t) * (1 - 2 * SOFT_TISSUE_RATE), energy = 0;
    for (int i = first; i <= last; i++) {
        struct vec3 out;
        double deep = penetration_depth(&build->solid[i], c, radius, &out);
        if (deep <= 0)
            continue;
        double weight = 1 / (CONTACT_SIGMA_M * CONTACT_SIGMA_M), cost = 0.5 * weight * fmin(deep * deep, 0.01);
        energy += cost;
        limb_energy[m->segment] += cost;
        normal_equations_add(system, build, m->segment, c, out, deep, weight, NULL);
    }
    return energy;
}

double body_collision_energy(const struct body_build *build, double limb_energy[SEG_COUNT], struct normal_equations *s)
{
    // The solids' order: trunk 0-2, neck 3, head 4, arms 5-8 and 9-12, legs 13-15 and 16-18.
    double energy = 0;
    for (int arm = 5; arm <= 9; arm += 4) {
        energy += collision_cost(build, arm + 1, 0, 2, 0.75, limb_energy, s);
        energy += collision_cost(build, arm + 2, 0, 4, 0.1, limb_energy, s);
        energy += collision_cost(build, arm + 2, 0, 4, 0.55, limb_energy, s);
        energy += collision_cost(build, arm + 3, 0, 4, 0.0, limb_energy, s);
        energy += collision_cost(build, arm + 3, 0, 4, 0.8, limb_energy, s);
        energy += collision_cost(build, arm + 3, 13, 13, 0.5, limb_energy, s);
        energy += collision_cost(build, arm + 3, 16, 16, 0.5, limb_energy, s);
    }
    for (int side = 0; side < 2; side++) {
        int mine = side ? 16 : 13, other = side ? 13 : 16;
        energy += collision_cost(build, mine + 1, other, other + 1, 0.1, limb_energy, s);
        energy += collision_cost(build, mine + 1, other + 1, other + 2, 0.6, limb_energy, s);
        energy += collision_cost(build, mine + 2, other + 1, other + 2, 0.0, limb_energy, s);
    }
    return energy;
}
