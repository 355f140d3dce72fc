#include "reenact/tint.h"

#include <stdlib.h>

static const double LEAST_FACING = 0.35; // cosine towards the camera
static const double NEAR_M = 0.03;       // the reading that vouches for a place lies this near

enum { WITHIN_PX = 2 }; // of an edge colours are mixed

struct shown {
    struct vec3 at, normal; // colour camera's axes
    struct pixel px;        // of the colour picture
};

// Where a point of the surface is seen; false: it is not.
static bool find_shown(const struct tint *t, const struct posture *posture, int point, struct pose depth_from_color,
                       struct shown *out)
{
    const struct skin *skin = &t->skins[point];
    skin_place(skin, posture, t->surface->points[point], t->surface->normals[point], &out->at, &out->normal);
    if (!(out->at.z > 0.05) || -v3_dot(out->normal, v3_unit(out->at)) < LEAST_FACING)
        return false;
    struct vec3 d = pose_apply(depth_from_color, out->at);
    if (!(d.z > 0.05))
        return false;
    const struct sight *s = t->sight;
    struct pixel seen = lens_project(&t->calibration->depth, d);
    int x = (int)floor(seen.x + 0.5), y = (int)floor(seen.y + 0.5), i = y * s->width + x;
    if (x < 0 || y < 0 || x >= s->width || y >= s->height || s->edge[i] < WITHIN_PX || s->part[i] >= PART_COUNT ||
        !parts_meet((enum part)s->part[i], (enum part)skin->part[0]) || fabs(s->depth[i] * 1e-3 - d.z) > NEAR_M)
        return false;
    out->px = lens_project(&t->calibration->color, out->at);
    return true;
}

int tint_rows(const struct tint *t, const struct posture *posture, int reach, struct tint_row *rows, int most)
{
    const struct lens *lens = &t->calibration->color;
    struct pose depth_from_color =
        t->calibration->registered ? POSE_IDENTITY : pose_inverse(t->calibration->color_from_depth);
    int count = 0, every = 1 + 3 * t->surface->point_count / most;
    for (int i = 0; i < t->surface->point_count && count + 3 <= most; i += every) {
        struct shown place;
        if (t->coat->filled[i] || !find_shown(t, posture, i, depth_from_color, &place))
            continue;
        int x = (int)floor(place.px.x + 0.5), y = (int)floor(place.px.y + 0.5);
        if (x < reach || y < reach || x + reach >= lens->width || y + reach >= lens->height)
            continue;
        struct vec3 world = quat_rotate(t->world_from_camera.rotation, place.normal);
        const float normal[3] = {(float)world.x, (float)world.y, (float)world.z};
        double light = (double)coat_lit(&t->coat->light, normal), z = place.at.z;
        const uint8_t *at = t->rgb + 3 * (y * lens->width + x);
        for (int c = 0; c < 3; c++) {
            double left = at[c - 3 * reach], right = at[c + 3 * reach], up = at[c - 3 * reach * lens->width],
                   down = at[c + 3 * reach * lens->width];
            double across = (right - left) / (510.0 * reach), along = (down - up) / (510.0 * reach);
            double here = at[c] / 255.0 + across * (place.px.x - x) + along * (place.px.y - y);
            struct tint_row *row = &rows[count++];
            row->part = t->skins[i].part[0];
            row->at = place.at;
            row->along = v3(across * lens->fx / z, along * lens->fy / z,
                            -(across * lens->fx * place.at.x + along * lens->fy * place.at.y) / (z * z));
            row->value = sqrt((double)t->coat->color[i][c] * light) - here;
        }
    }
    return count;
}
