// World points of a view's pixels.
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
