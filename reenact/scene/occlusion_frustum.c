// Culling of the occluder mesh by an occlusion frustum.
#include "reenact/scene/occlusion_frustum.h"
#include "base/portable_math.h"

#include <string.h>

void occlusion_frustum_add(struct occlusion_frustum *f, struct vec3 center, double radius_m)
{
    const double across[2] = {center.x, center.y}, steepest = 1.4; // radians; a side beyond is unbounded
    const bool first = !(f->farthest_m > 0);
    if (!(center.z + radius_m > 0))
        return; // behind the viewpoint
    f->farthest_m = fmax(f->farthest_m, center.z + radius_m);
    for (int i = 0; i < 2; i++) {
        const double away = portable_hypot(across[i], center.z),
                     half = away > radius_m ? portable_asin(radius_m / away) : INFINITY;
        const double to = portable_atan2(across[i], center.z), from_rad = to - half, to_rad = to + half;
        const double low = from_rad > -steepest ? portable_tan(fmin(from_rad, steepest)) : -INFINITY;
        const double high = to_rad < steepest ? portable_tan(fmax(to_rad, -steepest)) : INFINITY;
        f->low[i] = first ? low : fmin(f->low[i], low);
        f->high[i] = first ? high : fmax(f->high[i], high);
    }
}

struct occlusion_frustum occlusion_frustum_body(const struct skeleton *in_viewer)
{
    struct occlusion_frustum body = {0};
    for (int j = 0; j < JOINT_COUNT; j++)
        if (in_viewer->confidence[j] > 0)
            occlusion_frustum_add(&body, in_viewer->joint[j], OCCLUDER_BODY_RADIUS_M);
    return body;
}

static bool may_occlude(const struct occluder_sphere *sphere, const struct affine_map *viewer_from_room,
                        const struct occlusion_frustum *hidden)
{
    const struct vec3 *m = &sphere->middle;
    double p[3];
    for (int r = 0; r < 3; r++)
        p[r] = (double)viewer_from_room->row[r][0] * m->x + (double)viewer_from_room->row[r][1] * m->y +
               (double)viewer_from_room->row[r][2] * m->z + (double)viewer_from_room->row[r][3];
    bool may = hidden->farthest_m > 0 && p[2] > -sphere->radius_m && p[2] < hidden->farthest_m + sphere->radius_m;
    for (int i = 0; i < 2 && may; i++) { // distances of its centre beyond either side
        const double low = hidden->low[i], high = hidden->high[i];
        may = !(isfinite(low) && (low * p[2] - p[i]) / portable_hypot(low, 1) > sphere->radius_m) &&
              !(isfinite(high) && (p[i] - high * p[2]) / portable_hypot(high, 1) > sphere->radius_m);
    }
    return may;
}

int occluder_mesh_cull(const struct occluder_mesh *mesh, const struct affine_map *viewer_from_room,
                       const struct occlusion_frustum *hidden, uint16_t *corners)
{
    int count = 0;
    for (const struct occluder_sphere *b = mesh->spheres; b < mesh->spheres + mesh->sphere_count; b++) {
        if (!may_occlude(b, viewer_from_room, hidden))
            continue;
        memcpy(corners + count, mesh->corners + b->first, sizeof *corners * (size_t)b->count);
        count += b->count;
    }
    return count;
}
