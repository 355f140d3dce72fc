// Triangulation of features where a sweep has no depth: matches descriptors between pairs of frames with a baseline,
// near their epipolar lines, by poses that are roughly known from tags.
#include "capture/mapping/map_internal.h"

#include <stdlib.h>

// All chosen by hand.
enum {
    PARTNERS = 6,   // frames that one is matched with
    MAX_BITS = 48,  // Hamming distance of a match
    MARGIN_BITS = 8 // by which the second-best match, at another depth, must be worse
};
static const double MIN_BASELINE_M = 0.1, MAX_BASELINE_M = 1.5, MAX_ROTATION = 0.6;
static const double MIN_PARALLAX = 0.05; // radians between the two rays
static const double MAX_ERROR_PX = 2.5;  // reprojection error at full image size
static const double MIN_DEPTH_M = 0.2, MAX_DEPTH_M = 12;
static const double SAME_DEPTH_SHARE = 0.05; // depths that differ by less than this share are the same
static const float MAX_SCALE_RATIO = 1.6F;

// The frames with the most similar viewing direction among those with a usable baseline. Returns how many.
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

// The midpoint of two rays (z = 1) where they are closest, in the first camera's axes. False: too nearly parallel,
// outside the depth range, or a reprojection error of `off` or more, in units of z = 1.
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
    int bits, other_bits; // of the best match, and of the best one at another depth
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
    struct vec3 *first = calloc((size_t)m->point_count + 1, sizeof *first); // direction of the first observation
    double *least = malloc(sizeof *least * ((size_t)m->point_count + 1));   // least cosine between that and any other
    enum status status = first && least ? OK : fail(ERR_MEMORY, "no memory to check %d points", (int)m->point_count);
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
