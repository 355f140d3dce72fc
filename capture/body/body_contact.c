// Contacts: feet against the floor, arms against the trunk, legs against each other. Quadratic penalties of
// penetration, whose energy is bounded.
#include "capture/body/normal_equations.h"

// Chosen by hand.
#define FLOOR_SIGMA_M     0.02
#define FLOOR_DEEP_MAX_M2 0.04 // deeper does not cost more
#define STAND_REACH_M     0.06 // c of the robust kernel that draws the lower foot to the floor,
#define STAND_MAX_M       0.5  // which has no effect above this height

// Without the standing foot's term no point would pull a sole down: the mask ends above the floor.
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
            double weight = 1 / (FLOOR_SIGMA_M * FLOOR_SIGMA_M);
            energy += 0.5 * weight * fmin(over * over, FLOOR_DEEP_MAX_M2);
            normal_equations_add(system, build, &(struct point_residual){s->segment, c, task->up, -over, weight, NULL});
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
        if (over <= 0 || over > STAND_MAX_M)
            continue;
        double c2 = STAND_REACH_M * STAND_REACH_M, fade = c2 / (c2 + over * over),
               weight = 1 / (FLOOR_SIGMA_M * FLOOR_SIGMA_M);
        energy += 0.5 * weight * over * over * fade;
        normal_equations_add(system, build,
                             &(struct point_residual){s->segment, c, task->up, -over, weight * fade * fade, NULL});
    }
    return energy;
}

#define SOFT_TISSUE_RATE    0.5 // soft tissue: surfaces may overlap by this share of the moving one's diameter
#define CONTACT_SIGMA_M     0.015
#define CONTACT_DEEP_MAX_M2 0.01 // deeper does not cost more

// Knees are seldom on each other's side, and an image shows crossed legs nearly as it shows the same ones uncrossed.
#define CROSSED_LOG_ODDS 5.0
#define CROSSED_M        0.06 // knees over each other by this much cost half of that

// Penetration depth of a sphere in a solid; *out is the direction of the shortest way out. <= 0: it is outside.
static double penetration_depth(const struct body_solid *solid, struct vec3 c, double radius, struct vec3 *out)
{
    struct vec3 axis = v3_sub(solid->b, solid->a), from = v3_sub(c, solid->a);
    double length2 = v3_dot(axis, axis), t = length2 > 1e-12 ? v3_dot(from, axis) / length2 : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    double width = solid_width(solid, t), thick = solid_radius(solid, t);
    struct vec3 middle = v3_add(solid->a, v3_scale(axis, t)), off = v3_sub(c, middle);
    double beside = width > 0 ? v3_dot(off, solid->side) : 0;
    off = v3_sub(off, v3_scale(solid->side, beside < -width ? -width : beside > width ? width : beside));
    *out = v3_unit(off);
    return thick + radius - v3_length(off);
}

// A sphere of solid `mover` at t along its axis, tested against the solids `first` to `last`.
struct collision_probe {
    int mover, first, last;
    double t;
};

static double collision_cost(const struct body_build *build, const struct collision_probe *probe,
                             double limb_energy[SEG_COUNT], struct normal_equations *system)
{
    const struct body_solid *solid = &build->solid[probe->mover];
    struct vec3 c = v3_mix(solid->a, solid->b, probe->t);
    double radius = (solid_radius(solid, probe->t)) * (1 - 2 * SOFT_TISSUE_RATE), energy = 0;
    for (int i = probe->first; i <= probe->last; i++) {
        struct vec3 out;
        double deep = penetration_depth(&build->solid[i], c, radius, &out);
        if (deep <= 0)
            continue;
        double weight = 1 / (CONTACT_SIGMA_M * CONTACT_SIGMA_M),
               cost = 0.5 * weight * fmin(deep * deep, CONTACT_DEEP_MAX_M2);
        energy += cost;
        limb_energy[solid->segment] += cost;
        normal_equations_add(system, build, &(struct point_residual){solid->segment, c, out, deep, weight, NULL});
    }
    return energy;
}

// Of an arm: upper arm, forearm and hand against trunk, head and thighs.
#define ARM_PROBES(arm)                                                                                                \
    {arm + 1, SOLID_PELVIS, SOLID_CHEST, 0.75}, {arm + 2, SOLID_PELVIS, SOLID_SKULL, 0.1},                             \
        {arm + 2, SOLID_PELVIS, SOLID_SKULL, 0.55}, {arm + 3, SOLID_PELVIS, SOLID_SKULL, 0.0},                         \
        {arm + 3, SOLID_PELVIS, SOLID_SKULL, 0.8}, {arm + 3, SOLID_LEFT_LEG, SOLID_LEFT_LEG, 0.5},                     \
    {                                                                                                                  \
        arm + 3, SOLID_RIGHT_LEG, SOLID_RIGHT_LEG, 0.5                                                                 \
    }
// Of a leg: thigh, shin and foot against the other leg.
#define LEG_PROBES(leg, other)                                                                                         \
    {leg, other, other, 0.4}, {leg, other, other, 0.75}, {leg + 1, other, other + 1, 0.1},                             \
        {leg + 1, other + 1, other + 2, 0.6},                                                                          \
    {                                                                                                                  \
        leg + 2, other + 1, other + 2, 0.0                                                                             \
    }

static const struct collision_probe probes[] = {
    ARM_PROBES(SOLID_LEFT_ARM),
    ARM_PROBES(SOLID_RIGHT_ARM),
    LEG_PROBES(SOLID_LEFT_LEG, SOLID_RIGHT_LEG),
    LEG_PROBES(SOLID_RIGHT_LEG, SOLID_LEFT_LEG),
};

double body_collision_energy(const struct body_build *build, double limb_energy[SEG_COUNT],
                             struct normal_equations *equations)
{
    double energy = 0;
    for (size_t i = 0; i < COUNT_OF(probes); i++)
        energy += collision_cost(build, &probes[i], limb_energy, equations);
    return energy;
}

double body_crossed_legs_energy(const struct body_build *build)
{
    struct vec3 left = body_axis(build, SEG_PELVIS, 0),
                apart = v3_sub(build->joint[JOINT_LEFT_KNEE], build->joint[JOINT_RIGHT_KNEE]);
    double over = fmax(0, -v3_dot(left, apart)) / CROSSED_M;
    return CROSSED_LOG_ODDS * over * over / (1 + over * over);
}
