// How far away a sweep's natural points are where it has no depth: from where two of its pictures, taken from
// different places, show what looks the same. The poses are known roughly by then, from tags.
#include "capture/mapping/map_internal.h"

#include <stdlib.h>

enum {
    PARTNERS = 6,    // pictures that one is compared with
    MOST_BITS = 48,  // by which what is the same may differ
    CLEARLY_BITS = 8 // more than the best must differ whatever lies elsewhere
};
static const double LEAST_BASE_M = 0.1, MOST_BASE_M = 1.5, MOST_TURN = 0.6;
static const double LEAST_ANGLE = 0.05; // radians between the two rays
static const double OFF_PX = 2.5;       // from where they should meet, at full size
static const double NEAREST_M = 0.2, FARTHEST_M = 12;
static const double SAME_SHARE = 0.05; // depths that differ by less of themselves are the same
static const float MOST_SCALED = 1.6F;

// The pictures that look most the same way from elsewhere. Returns how many.
static int find_partners(const struct map *m, const struct map_frame *f, const struct map_frame *out[PARTNERS])
{
    double turns[PARTNERS];
    int count = 0;
    const struct pose from = pose_inverse(f->camera_from_world);
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *other = &m->frames[i];
        const struct pose to = pose_inverse(other->camera_from_world);
        double base = v3_distance(from.translation, to.translation), turn = pose_angle(from, to);
        if (other == f || !other->placed || base < LEAST_BASE_M || base > MOST_BASE_M || turn > MOST_TURN)
            continue;
        int at = count < PARTNERS ? count++ : PARTNERS;
        for (; at > 0 && turns[at - 1] > turn; at--)
            if (at < PARTNERS) {
                turns[at] = turns[at - 1];
                out[at] = out[at - 1];
            }
        if (at < PARTNERS) {
            turns[at] = turn;
            out[at] = other;
        }
    }
    return count;
}

// Where two rays (z = 1) pass each other, in the first camera's axes. False: too nearly parallel, behind a camera, or
// too far from each other.
static bool meet(struct vec3 a, struct vec3 b, struct pose a_from_b, double off, struct vec3 *out)
{
    struct vec3 d = quat_rotate(a_from_b.rotation, b), o = a_from_b.translation;
    double aa = v3_dot(a, a), ad = v3_dot(a, d), dd = v3_dot(d, d), ao = v3_dot(a, o), od = v3_dot(d, o);
    double det = aa * dd - ad * ad;
    if (det < LEAST_ANGLE * LEAST_ANGLE * aa * dd)
        return false;
    double s = (dd * ao - ad * od) / det, t = (ad * ao - aa * od) / det;
    if (s < NEAREST_M || s > FARTHEST_M || t < NEAREST_M || t > FARTHEST_M)
        return false;
    *out = v3_scale(v3_add(v3_scale(a, s), v3_add(o, v3_scale(d, t))), 0.5);
    struct vec3 in_b = pose_apply(pose_inverse(a_from_b), *out);
    return hypot(out->x / out->z - a.x, out->y / out->z - a.y) < off &&
           hypot(in_b.x / in_b.z - b.x, in_b.y / in_b.z - b.y) < off;
}

struct likely {
    int bits, other_bits; // of the best, and of the best that lies elsewhere
    double depth;
};

static void compare(const struct map *m, const struct map_frame *f, const struct vec3 *rays,
                    const struct map_frame *other, struct likely *likely)
{
    const struct lens *lens = &m->calibration.color;
    const struct pose f_from_other = pose_multiply(f->camera_from_world, pose_inverse(other->camera_from_world));
    for (int32_t k = 0; k < other->feature_count; k++) {
        const struct feature *b = &other->features[k].feature;
        const struct vec3 ray = lens_ray(lens, b->at);
        for (int32_t i = 0; i < f->feature_count; i++) {
            const struct feature *a = &f->features[i].feature;
            struct likely *l = &likely[i];
            if (a->scale > MOST_SCALED * b->scale || b->scale > MOST_SCALED * a->scale)
                continue;
            int bits = feature_distance(a->descriptor, b->descriptor);
            struct vec3 p;
            if (bits > MOST_BITS || bits >= l->other_bits ||
                !meet(rays[i], ray, f_from_other, OFF_PX * (double)fmaxf(a->scale, b->scale) / lens->fx, &p))
                continue;
            bool same = l->depth > 0 && fabs(p.z - l->depth) < SAME_SHARE * l->depth;
            if (bits < l->bits)
                *l = (struct likely){bits, same ? l->other_bits : l->bits, p.z};
            else if (!same)
                l->other_bits = bits;
        }
    }
}

void map_see_in_two(const struct map *m, struct map_frame *f)
{
    const struct map_frame *partners[PARTNERS];
    struct vec3 rays[MAP_FEATURES];
    struct likely likely[MAP_FEATURES];
    for (int32_t i = 0; i < f->feature_count; i++) {
        rays[i] = lens_ray(&m->calibration.color, f->features[i].feature.at);
        likely[i] = (struct likely){MOST_BITS + 1, MOST_BITS + 1 + CLEARLY_BITS, 0};
    }
    int count = find_partners(m, f, partners);
    for (int i = 0; i < count; i++)
        compare(m, f, rays, partners[i], likely);
    for (int32_t i = 0; i < f->feature_count; i++)
        f->features[i].guess = likely[i].other_bits - likely[i].bits > CLEARLY_BITS ? likely[i].depth : 0;
}

enum status map_forget_narrow(struct map *m)
{
    struct vec3 *first = calloc((size_t)m->point_count + 1, sizeof *first); // direction it was seen in
    double *least = malloc(sizeof *least * ((size_t)m->point_count + 1));   // cosine between that and any other
    enum status status = first && least ? OK : fail(ERR_MEMORY, "no memory to judge %d points", (int)m->point_count);
    for (int32_t i = 0; i < m->point_count && status == OK; i++)
        least[i] = 1;
    for (int32_t i = 0; i < m->frame_count && status == OK; i++) {
        const struct map_frame *f = &m->frames[i];
        const struct vec3 eye = pose_inverse(f->camera_from_world).translation;
        for (int32_t k = 0; k < f->feature_count; k++) {
            const int32_t point = f->placed ? f->features[k].point : -1;
            if (point < 0)
                continue;
            const struct vec3 way = v3_unit(v3_sub(m->points[point].world, eye));
            if (v3_dot(first[point], first[point]) > 0)
                least[point] = fmin(least[point], v3_dot(first[point], way));
            else
                first[point] = way;
        }
    }
    for (int32_t i = 0; i < m->frame_count && status == OK; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count; k++) {
            struct map_feature *s = &m->frames[i].features[k];
            if (s->point >= m->held_points && !(least[s->point] < cos(LEAST_ANGLE)))
                s->point = -1;
        }
    free(first);
    free(least);
    return status;
}
