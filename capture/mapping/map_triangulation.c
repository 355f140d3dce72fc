// How far away a sweep's natural points are where it has no depth: from where two of its pictures, taken from
// different places, show what looks the same. The poses are known roughly by then, from tags.
#include "capture/mapping/map_internal.h"

#include <stdlib.h>

enum {
    PARTNERS = 6,   // pictures that one is compared with
    MAX_BITS = 48,  // by which what is the same may differ
    MARGIN_BITS = 8 // more than the best must differ whatever lies elsewhere
};
static const double MIN_BASELINE_M = 0.1, MAX_BASELINE_M = 1.5, MAX_ROTATION = 0.6;
static const double MIN_PARALLAX = 0.05; // radians between the two rays
static const double MAX_ERROR_PX = 2.5;  // from where they should meet, at full size
static const double MIN_DEPTH_M = 0.2, MAX_DEPTH_M = 12;
static const double SAME_DEPTH_SHARE = 0.05; // depths that differ by less of themselves are the same
static const float MAX_SCALE_RATIO = 1.6F;

// The pictures that look most the same way from elsewhere. Returns how many.
static int find_partners(const struct map *m, const struct map_frame *f, const struct map_frame *out[PARTNERS])
{
    double angles[PARTNERS];
    int count = 0;
    const struct pose from = pose_inverse(f->camera_from_world);
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *other = &m->frames[i];
        const struct pose to = pose_inverse(other->camera_from_world);
        double baseline = v3_distance(from.translation, to.translation), angle = pose_angle(from, to);
        if (other == f || !other->placed || baseline < MIN_BASELINE_M || baseline > MAX_BASELINE_M ||
            angle > MAX_ROTATION)
            continue;
        int at = count < PARTNERS ? count++ : PARTNERS;
        for (; at > 0 && angles[at - 1] > angle; at--)
            if (at < PARTNERS) {
                angles[at] = angles[at - 1];
                out[at] = out[at - 1];
            }
        if (at < PARTNERS) {
            angles[at] = angle;
            out[at] = other;
        }
    }
    return count;
}

// Where two rays (z = 1) pass each other, in the first camera's axes. False: too nearly parallel, behind a camera, or
// too far from each other.
static bool intersect_rays(struct vec3 a, struct vec3 b, struct pose a_from_b, double off, struct vec3 *out)
{
    struct vec3 d = quat_rotate(a_from_b.rotation, b), o = a_from_b.translation;
    double aa = v3_dot(a, a), ad = v3_dot(a, d), dd = v3_dot(d, d), ao = v3_dot(a, o), od = v3_dot(d, o);
    double det = aa * dd - ad * ad;
    if (det < MIN_PARALLAX * MIN_PARALLAX * aa * dd)
        return false;
    double s = (dd * ao - ad * od) / det, t = (ad * ao - aa * od) / det;
    if (s < MIN_DEPTH_M || s > MAX_DEPTH_M || t < MIN_DEPTH_M || t > MAX_DEPTH_M)
        return false;
    *out = v3_scale(v3_add(v3_scale(a, s), v3_add(o, v3_scale(d, t))), 0.5);
    struct vec3 in_b = pose_apply(pose_inverse(a_from_b), *out);
    return hypot(out->x / out->z - a.x, out->y / out->z - a.y) < off &&
           hypot(in_b.x / in_b.z - b.x, in_b.y / in_b.z - b.y) < off;
}

struct depth_match {
    int bits, other_bits; // of the best, and of the best that lies elsewhere
    double depth;
};

static void match_frames(const struct map *m, const struct map_frame *f, const struct vec3 *rays,
                         const struct map_frame *other, struct depth_match *matches)
{
    const struct lens *lens = &m->calibration.color;
    const struct pose f_from_other = pose_multiply(f->camera_from_world, pose_inverse(other->camera_from_world));
    for (int32_t k = 0; k < other->feature_count; k++) {
        const struct feature *b = &other->features[k].feature;
        const struct vec3 ray = lens_ray(lens, b->at);
        for (int32_t i = 0; i < f->feature_count; i++) {
            const struct feature *a = &f->features[i].feature;
            struct depth_match *l = &matches[i];
            if (a->scale > MAX_SCALE_RATIO * b->scale || b->scale > MAX_SCALE_RATIO * a->scale)
                continue;
            int bits = feature_distance(a->descriptor, b->descriptor);
            struct vec3 p;
            if (bits > MAX_BITS || bits >= l->other_bits ||
                !intersect_rays(rays[i], ray, f_from_other, MAX_ERROR_PX * (double)fmaxf(a->scale, b->scale) / lens->fx,
                                &p))
                continue;
            bool same = l->depth > 0 && fabs(p.z - l->depth) < SAME_DEPTH_SHARE * l->depth;
            if (bits < l->bits)
                *l = (struct depth_match){bits, same ? l->other_bits : l->bits, p.z};
            else if (!same)
                l->other_bits = bits;
        }
    }
}

void map_triangulate(const struct map *m, struct map_frame *f)
{
    const struct map_frame *partners[PARTNERS];
    struct vec3 rays[MAP_MAX_FEATURES];
    struct depth_match matches[MAP_MAX_FEATURES];
    for (int32_t i = 0; i < f->feature_count; i++) {
        rays[i] = lens_ray(&m->calibration.color, f->features[i].feature.at);
        matches[i] = (struct depth_match){MAX_BITS + 1, MAX_BITS + 1 + MARGIN_BITS, 0};
    }
    int count = find_partners(m, f, partners);
    for (int i = 0; i < count; i++)
        match_frames(m, f, rays, partners[i], matches);
    for (int32_t i = 0; i < f->feature_count; i++)
        f->features[i].triangulated_depth =
            matches[i].other_bits - matches[i].bits > MARGIN_BITS ? matches[i].depth : 0;
}

enum status map_cull_low_parallax(struct map *m)
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
            if (s->point >= m->held_points && !(least[s->point] < cos(MIN_PARALLAX)))
                s->point = -1;
        }
    free(first);
    free(least);
    return status;
}
