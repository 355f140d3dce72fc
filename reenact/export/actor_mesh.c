// The avatar's surface at one instant, as PLY.
#include "reenact/export/actor_motion.h"

#include "formats/ply.h"

// A linear colour (vertex_color.h) as a byte.
static uint8_t byte_of(float linear)
{
    const float encoded = sqrtf(fmaxf(0, linear));
    return (uint8_t)(fminf(1, encoded) * 255 + 0.5F);
}

enum status actor_export_mesh_ply(const struct actor_export *a, int64_t frame, FILE *out)
{
    const struct surface_mesh *s = &a->avatar->surface;
    struct bone_transforms at;
    struct ply ply = {0};
    enum status status = bones_at_frame(a, frame, &at);
    for (int i = 0; i < s->point_count && status == OK; i++) {
        const float *color = a->avatar->vertex_colors.color[i];
        const uint8_t rgb[3] = {byte_of(color[0]), byte_of(color[1]), byte_of(color[2])};
        struct vec3 p, n;
        linear_blend_skin(&a->avatar->skins[i], &at, s->points[i], s->normals[i], &p, &n);
        status = ply_add_point(&ply, p, rgb);
    }
    for (int i = 0; i < s->corner_count && status == OK; i += 3)
        status = ply_add_triangle(&ply, s->corners[i], s->corners[i + 1], s->corners[i + 2]);
    if (status == OK)
        ply_print(&ply, "world axes, z up", out);
    ply_free(&ply);
    return status;
}
