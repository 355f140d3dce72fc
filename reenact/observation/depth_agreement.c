#include "reenact/observation/depth_agreement.h"

int depth_pixel_at(const struct lens *lens, struct vec3 p)
{
    if (!(p.z > 0.05))
        return -1;
    const struct pixel px = lens_project(lens, p);
    const double x = floor(px.x + 0.5), y = floor(px.y + 0.5);
    return x >= 0 && y >= 0 && x < lens->width && y < lens->height ? (int)y * lens->width + (int)x : -1;
}

bool depth_agrees(const struct depth_frame *s, int pixel, double depth_m, int margin_px)
{
    return s->part[pixel] < PART_COUNT && s->edge_distance[pixel] >= margin_px &&
           fabs(s->depth[pixel] * 1e-3 - depth_m) <= DEPTH_AGREEMENT_M;
}

bool depth_agrees_with_bone(const struct depth_frame *s, const struct lens *lens, struct vec3 p, int bone,
                            int margin_px)
{
    const int pixel = depth_pixel_at(lens, p);
    return pixel >= 0 && depth_agrees(s, pixel, p.z, margin_px) && bones_adjacent(s->part[pixel], (int)bone_part(bone));
}
