// World points of a view's pixels, and how far a point is from it.
#include "surround/view/surround_view.h"

void surround_view_point(const struct surround_view *view, int x, int y, float inverse_z, double world[3])
{
    const double z = inverse_z > 1e-4f ? 1 / (double)inverse_z : 1e4;
    const double c[3] = {(x - view->lens.cx) / view->lens.fx * z, (y - view->lens.cy) / view->lens.fy * z, z};
    const struct vec3 *t = &view->world_from_view.translation;
    const double origin[3] = {t->x, t->y, t->z};
    for (int i = 0; i < 3; i++)
        world[i] = view->axes[i][0] * c[0] + view->axes[i][1] * c[1] + view->axes[i][2] * c[2] + origin[i];
}

double surround_view_distance(struct pose world_from_view, const struct surround_picture *picture)
{
    const struct vec3 eye = world_from_view.translation, ahead = quat_rotate(world_from_view.rotation, v3(0, 0, 1));
    const struct vec3 focus = v3_add(eye, v3_scale(ahead, 3)), at = picture->world_from_camera.translation;
    const double distance = fmin(v3_distance(at, eye), v3_distance(at, focus));
    if (picture->panorama)
        return distance;
    const double(*axes)[3] = picture->axes;
    return distance + 1 - (axes[0][2] * ahead.x + axes[1][2] * ahead.y + axes[2][2] * ahead.z);
}
