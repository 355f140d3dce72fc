#include "objects/thing_map.h"

#include "base/linear_algebra.h"

#define OUTSIDE   16.27 // chi^2 with 3 degrees of freedom, 99.9 %
#define BY_HAND_M 0.1   // standard deviation of a place without a covariance: chosen by hand
#define JITTER2   1e-8  // m^2, added before inverting: 0.1 mm

static bool inverse(const struct covariance3 *c, double out[9])
{
    const double m[9] = {c->xx + JITTER2, c->xy, c->xz, c->xy, c->yy + JITTER2, c->yz, c->xz, c->yz, c->zz + JITTER2};
    return invert_symmetric(m, 3, out);
}

static struct vec3 times(const double m[9], struct vec3 v)
{
    return v3(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
              m[6] * v.x + m[7] * v.y + m[8] * v.z);
}

static bool apart(struct vec3 a, const struct covariance3 *ca, struct vec3 b, const struct covariance3 *cb)
{
    const struct covariance3 sum = covariance3_add(ca, cb);
    const struct vec3 d = v3_sub(a, b);
    double m[9];
    return inverse(&sum, m) && v3_dot(d, times(m, d)) > OUTSIDE;
}

// a and its covariance become the information-weighted mean with b.
static void fuse(struct vec3 *a, struct covariance3 *ca, struct vec3 b, const struct covariance3 *cb)
{
    double ia[9], ib[9], sum[9], mean[9];
    if (!inverse(ca, ia) || !inverse(cb, ib))
        return;
    for (int i = 0; i < 9; i++)
        sum[i] = ia[i] + ib[i];
    if (!invert_symmetric(sum, 3, mean))
        return;
    *a = times(mean, v3_add(times(ia, *a), times(ib, b)));
    *ca = (struct covariance3){mean[0], mean[1], mean[2], mean[4], mean[5], mean[8]};
}

static struct mapped_thing *entry(struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++)
        if (map->things[i].thing == thing)
            return &map->things[i];
    if (map->count == THINGS_MOST)
        return NULL;
    map->things[map->count] = (struct mapped_thing){.thing = thing};
    return &map->things[map->count++];
}

void thing_map_know(struct thing_map *map, int thing, const struct pose *world_from_thing,
                    const struct covariance3 *covariance)
{
    struct mapped_thing *t = entry(map, thing);
    if (!t)
        return;
    *t = (struct mapped_thing){.thing = thing, .world_from_thing = *world_from_thing, .known = true};
    t->covariance = covariance3_trace(covariance) > 0 ? *covariance : covariance3_isotropic(BY_HAND_M * BY_HAND_M);
}

static void move(struct mapped_thing *t, struct quat rotation)
{
    t->world_from_thing = (struct pose){rotation, t->elsewhere};
    t->covariance = t->elsewhere_covariance;
    t->moves++;
    t->doubted = false;
}

void thing_map_add(struct thing_map *map, const struct sighting *s, const struct pose *world_from_left)
{
    struct mapped_thing *t = entry(map, s->thing);
    const struct pose world = pose_multiply(*world_from_left, s->left_from_thing);
    const struct covariance3 c = covariance3_rotate(world_from_left->rotation, &s->covariance);
    if (!t)
        return;
    t->misses = 0;
    t->gone = false;
    if (!t->sightings++ && !t->known) {
        t->world_from_thing = world;
        t->covariance = c;
        return;
    }
    if (!apart(t->world_from_thing.translation, &t->covariance, world.translation, &c)) {
        if (covariance3_trace(&c) < covariance3_trace(&t->covariance))
            t->world_from_thing.rotation = world.rotation;
        fuse(&t->world_from_thing.translation, &t->covariance, world.translation, &c);
        t->doubted = false;
        return;
    }
    if (t->doubted && !apart(t->elsewhere, &t->elsewhere_covariance, world.translation, &c)) {
        fuse(&t->elsewhere, &t->elsewhere_covariance, world.translation, &c);
        move(t, world.rotation);
        return;
    }
    t->doubted = true;
    t->elsewhere = world.translation;
    t->elsewhere_rotation = world.rotation;
    t->elsewhere_covariance = c;
}

void thing_map_absent(struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++) {
        struct mapped_thing *t = &map->things[i];
        if (t->thing == thing && t->doubted)
            move(t, t->elsewhere_rotation);
        else if (t->thing == thing)
            t->gone = true;
    }
}

void thing_map_miss(struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++)
        if (map->things[i].thing == thing && ++map->things[i].misses >= THING_MISSES_TO_GONE)
            map->things[i].gone = true;
}

const struct mapped_thing *thing_map_find(const struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++)
        if (map->things[i].thing == thing)
            return &map->things[i];
    return NULL;
}
