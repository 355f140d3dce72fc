#include "reenact/avatar/deformation_grid.h"

#include <math.h>

struct deformation_grid deformation_grid_about(const struct surface_mesh *s)
{
    struct vec3 low = s->points[0], high = low;
    for (int i = 1; i < s->point_count; i++) {
        struct vec3 p = s->points[i];
        low = v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    const struct vec3 margin = {DEFORMATION_STEP_M, DEFORMATION_STEP_M, DEFORMATION_STEP_M};
    struct deformation_grid g = {.corner = v3_sub(low, margin)};
    struct vec3 extent = v3_sub(v3_add(high, margin), g.corner);
    g.size[0] = (int)ceil(extent.x / DEFORMATION_STEP_M) + 1;
    g.size[1] = (int)ceil(extent.y / DEFORMATION_STEP_M) + 1;
    g.size[2] = (int)ceil(extent.z / DEFORMATION_STEP_M) + 1;
    return g;
}

bool deformation_grid_is_small(const struct surface_mesh *s)
{
    const struct deformation_grid g = deformation_grid_about(s);
    return (int64_t)g.size[0] * g.size[1] * g.size[2] <= DEFORMATION_POINTS_MOST;
}

int deformation_grid_count(const struct deformation_grid *g) { return g->size[0] * g->size[1] * g->size[2]; }

struct vec3 deformation_grid_point(const struct deformation_grid *g, int at)
{
    return v3_add(g->corner, v3_scale(v3(at % g->size[0], at / g->size[0] % g->size[1], at / g->size[0] / g->size[1]),
                                      DEFORMATION_STEP_M));
}

bool deformation_grid_cell(const struct deformation_grid *g, struct vec3 p, struct deformation_cell *out)
{
    const double q[3] = {(p.x - g->corner.x) / DEFORMATION_STEP_M, (p.y - g->corner.y) / DEFORMATION_STEP_M,
                         (p.z - g->corner.z) / DEFORMATION_STEP_M};
    int cell[3];
    double in[3];
    for (int i = 0; i < 3; i++) {
        if (!(q[i] >= 0 && q[i] < g->size[i] - 1))
            return false;
        cell[i] = (int)q[i];
        in[i] = q[i] - cell[i];
    }
    const int at = (cell[2] * g->size[1] + cell[1]) * g->size[0] + cell[0];
    for (int c = 0; c < 8; c++) {
        out->at[c] = at + (c & 1) + ((c >> 1 & 1) + (c >> 2) * g->size[1]) * g->size[0];
        out->weight[c] = 1;
        for (int i = 0; i < 3; i++)
            out->weight[c] *= c >> i & 1 ? in[i] : 1 - in[i];
    }
    return true;
}
