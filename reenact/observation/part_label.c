#include "reenact/observation/part_label.h"

#include "base/clamp.h"

#include <stdlib.h>

struct part_capsules part_capsules_of(const struct skeleton *skeleton, const struct body *body)
{
    struct part_capsules b = {0};
    for (int p = 0; p < PART_COUNT; p++) {
        if (!part_is_known(body, skeleton, (enum part)p))
            continue;
        int i = b.count++;
        b.part[i] = (enum part)p;
        b.from[i] = skeleton->joint[part_ends[p].from];
        b.along[i] = v3_sub(skeleton->joint[part_ends[p].to], b.from[i]);
        b.along2[i] = v3_dot(b.along[i], b.along[i]);
        b.radius[i] = body->radius_rate[p] * sqrt(b.along2[i]);
        b.middle[i] = v3_add(b.from[i], v3_scale(b.along[i], 0.5));
        b.bounding_radius[i] = 0.5 * sqrt(b.along2[i]) + b.radius[i];
    }
    return b;
}

uint16_t part_label(const struct part_capsules *b, struct vec3 p, double shared_m, double outside_m)
{
    double gap[PART_COUNT], best = outside_m;
    for (int i = 0; i < b->count; i++) {
        struct vec3 d = v3_sub(p, b->from[i]);
        double t = b->along2[i] > 0 ? v3_dot(d, b->along[i]) / b->along2[i] : 0;
        t = clamp_double(t, 0, 1);
        gap[i] = v3_length(v3_sub(d, v3_scale(b->along[i], t))) - b->radius[i];
        best = fmin(best, gap[i]);
    }
    if (!(best < outside_m))
        return 0;
    uint16_t parts = PART_LABEL_PERSON;
    for (int i = 0; i < b->count; i++)
        if (gap[i] <= best + shared_m)
            parts |= (uint16_t)(1 << b->part[i]);
    return parts;
}

int part_nearest(const struct part_capsules *b, struct vec3 p, double outside_m)
{
    double best = outside_m;
    int nearest = -1;
    for (int i = 0; i < b->count; i++) {
        struct vec3 d = v3_sub(p, b->from[i]), from_middle = v3_sub(p, b->middle[i]);
        double away = best + b->bounding_radius[i];
        if (v3_dot(from_middle, from_middle) > away * away)
            continue; // the bounding ball is farther than the nearest part
        double t = b->along2[i] > 0 ? v3_dot(d, b->along[i]) / b->along2[i] : 0;
        t = clamp_double(t, 0, 1);
        d = v3_sub(d, v3_scale(b->along[i], t));
        double away2 = v3_dot(d, d), reach = best + b->radius[i];
        if (!(reach > 0) || away2 > reach * reach)
            continue; // farther than the nearest part, found without a square root
        double gap = sqrt(away2) - b->radius[i];
        if (gap < best)
            best = gap, nearest = (int)b->part[i];
    }
    return nearest;
}

double part_max_distance_m(bool has_mask) { return has_mask ? 0.25 : 0.10; }

bool part_pixel_on_surface(const uint16_t *depth, const uint8_t *mask, int width, int height, int i)
{
    int same_mm = 30 + depth_step_mm(depth[i]);
    int x = i % width, y = i / width;
    if (!depth[i] || (mask && !mask[i]) || x == 0 || y == 0 || x == width - 1 || y == height - 1)
        return false;
    const int around[] = {i - 1, i + 1, i - width, i + width};
    int same = 0;
    for (int n = 0; n < 4; n++)
        same += abs(depth[around[n]] - depth[i]) <= same_mm;
    return same >= 2;
}

struct source_rays {
    int count;
    struct pose color_from_depth;
    bool same_axes;
    float xy[][2]; // z = 1
};

enum status source_rays_open(struct source_rays **out, const struct calibration *c)
{
    *out = NULL;
    int width = c->depth.width, height = c->depth.height;
    struct source_rays *r = malloc(sizeof *r + sizeof r->xy[0] * (size_t)width * (size_t)height);
    if (!r)
        return fail(ERR_MEMORY, "out of memory");
    r->count = width * height;
    r->color_from_depth = c->color_from_depth;
    r->same_axes = c->registered;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            struct vec3 ray = lens_ray(&c->depth, (struct pixel){x, y});
            r->xy[y * width + x][0] = (float)ray.x;
            r->xy[y * width + x][1] = (float)ray.y;
        }
    *out = r;
    return OK;
}

void source_rays_close(struct source_rays **r)
{
    free(*r);
    *r = NULL;
}

int source_rays_count(const struct source_rays *r) { return r->count; }

struct vec3 source_rays_point(const struct source_rays *r, int i, uint16_t depth_mm)
{
    double z = depth_mm * 1e-3;
    struct vec3 p = v3(r->xy[i][0] * z, r->xy[i][1] * z, z);
    return r->same_axes ? p : pose_apply(r->color_from_depth, p);
}
