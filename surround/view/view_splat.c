// The plain coloured point cloud.
#include "surround/view/view_layers.h"

#include <string.h>

static void splat(struct surround_view *view, const struct surround_picture *p, int u, int v)
{
    const size_t i = (size_t)v * (size_t)p->width + (size_t)u;
    const struct vec3 c = p->world_from_camera.translation, e = view->world_from_view.translation;
    float ray[3];
    double q[3], d[3];
    if (!(p->inverse[i] > 1e-4f))
        return;
    surround_picture_ray(p, u, v, ray);
    for (int k = 0; k < 3; k++)
        d[k] = (p->axes[k][0] * (double)ray[0] + p->axes[k][1] * (double)ray[1] + p->axes[k][2] * (double)ray[2]) /
               (double)p->inverse[i];
    const double w[3] = {d[0] + c.x - e.x, d[1] + c.y - e.y, d[2] + c.z - e.z};
    for (int k = 0; k < 3; k++)
        q[k] = view->axes[0][k] * w[0] + view->axes[1][k] * w[1] + view->axes[2][k] * w[2];
    if (q[2] < 0.05)
        return;
    const double fx = view->lens.fx * q[0] / q[2] + view->lens.cx, fy = view->lens.fy * q[1] / q[2] + view->lens.cy;
    if (!(fx > -1 && fy > -1 && fx < view->lens.width && fy < view->lens.height))
        return;
    const int x = (int)floor(fx), y = (int)floor(fy);
    for (int k = 0; k < 4; k++) {
        const int px = x + (k & 1), py = y + (k >> 1);
        if (px < 0 || py < 0 || px >= view->lens.width || py >= view->lens.height)
            continue;
        const size_t at = (size_t)py * (size_t)view->lens.width + (size_t)px;
        if (view->inverse_z[at] >= (float)(1 / q[2]))
            continue;
        view->inverse_z[at] = (float)(1 / q[2]);
        view->source[at] = SOURCE_SEEN;
        memcpy(view->rgb + 3 * at, p->rgb + 3 * i, 3);
    }
}

void surround_view_splat(struct surround_view *view, struct pose world_from_view,
                         const struct surround_picture *const *pictures, int count)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    view->world_from_view = world_from_view;
    quat_to_matrix(world_from_view.rotation, view->axes);
    memset(view->rgb, 128, pixels * 3);
    memset(view->source, SOURCE_UNSEEN, pixels);
    for (size_t i = 0; i < pixels; i++)
        view->inverse_z[i] = DEPTH_UNKNOWN;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < pictures[i]->height; v++)
            for (int u = 0; u < pictures[i]->width; u++)
                splat(view, pictures[i], u, v);
}
