// Naive surface nets of the occluder grid; allocation of its mesh.
#include "reenact/scene/occluder_grid.h"

#include <stdlib.h>
#include <string.h>

static const float MIN_WEIGHT = 0.4F; // about two views from 2 m; chosen by hand

// The net's vertex in the cube from grid point `at`: the mean of the zero crossings on its edges. False: the cube has
// none, or a corner is unknown.
static bool surface_net_point(const struct occluder_grid *g, size_t at, float out[3])
{
    const size_t step[3] = {1, (size_t)g->size[0], (size_t)g->size[0] * (size_t)g->size[1]};
    float d[8], sum[3] = {0};
    int inside = 0, crossings = 0;
    for (int i = 0; i < 8; i++) {
        size_t corner = at + (i & 1) * step[0] + (size_t)(i >> 1 & 1) * step[1] + (size_t)(i >> 2) * step[2];
        if (!(g->weight[corner] >= MIN_WEIGHT))
            return false;
        d[i] = g->sum[corner] / g->weight[corner];
        inside += d[i] < 0;
    }
    if (inside == 0 || inside == 8)
        return false;
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) {
            int j = i | 1 << axis;
            if (j == i || (d[i] < 0) == (d[j] < 0))
                continue;
            for (int k = 0; k < 3; k++)
                sum[k] += k == axis ? d[i] / (d[i] - d[j]) : (float)(i >> k & 1);
            crossings++;
        }
    const double corner[3] = {g->corner.x, g->corner.y, g->corner.z};
    const size_t cell[3] = {at % step[1], at / step[1] % (size_t)g->size[1], at / step[2]};
    for (int k = 0; k < 3; k++)
        out[k] = (float)(corner[k] + g->step * ((double)cell[k] + (double)(sum[k] / (float)crossings)));
    return true;
}

// The quads about the three edges from grid point `at`: each crossed edge joins the vertices of its four cubes.
static void add_quads(const struct occluder_grid *g, const int32_t *number, size_t at, const int cell[3],
                      struct occluder_mesh *out)
{
    const size_t step[3] = {1, (size_t)g->size[0], (size_t)g->size[0] * (size_t)g->size[1]};
    for (int axis = 0; axis < 3; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        if (cell[axis] + 1 >= g->size[axis] || cell[u] < 1 || cell[v] < 1)
            continue;
        size_t to = at + step[axis];
        if (!(g->weight[at] > 0 && g->weight[to] > 0) || (g->sum[at] < 0) == (g->sum[to] < 0))
            continue;
        const int32_t q[4] = {number[at], number[at - step[u]], number[at - step[u] - step[v]], number[at - step[v]]};
        if (q[0] < 0 || q[1] < 0 || q[2] < 0 || q[3] < 0)
            continue;
        const bool along = g->sum[at] < 0; // the empty side lies along the axis
        const int32_t corners[6] = {q[0], q[along ? 1 : 3], q[2], q[along ? 0 : 2], q[along ? 2 : 1], q[along ? 3 : 0]};
        for (int i = 0; i < 6; i++)
            out->corners[out->corner_count++] = (uint16_t)corners[i];
    }
}

// Numbers the cubes' vertices; -1: no vertex. False: there are more than OCCLUDER_MAX_POINTS.
static bool add_points(const struct occluder_grid *g, int32_t *number, struct occluder_mesh *out)
{
    for (int z = 0; z + 1 < g->size[2]; z++)
        for (int y = 0; y + 1 < g->size[1]; y++)
            for (int x = 0; x + 1 < g->size[0]; x++) {
                const size_t at = occluder_grid_index(g, x, y, z);
                float p[3];
                number[at] = surface_net_point(g, at, p) ? out->point_count : -1;
                if (number[at] < 0)
                    continue;
                if (out->point_count == OCCLUDER_MAX_POINTS)
                    return false;
                memcpy(out->points[out->point_count++], p, sizeof p);
            }
    return true;
}

static void add_faces(const struct occluder_grid *g, const int32_t *number, struct occluder_mesh *out)
{
    for (int z = 0; z + 1 < g->size[2]; z++)
        for (int y = 0; y + 1 < g->size[1]; y++)
            for (int x = 0; x + 1 < g->size[0]; x++)
                add_quads(g, number, occluder_grid_index(g, x, y, z), (const int[3]){x, y, z}, out);
}

void occluder_mesh_free(struct occluder_mesh *mesh)
{
    free(mesh->points);
    free(mesh->corners);
    free(mesh->spheres);
    *mesh = (struct occluder_mesh){0};
}

enum status occluder_surface_nets(const struct occluder_grid *g, struct occluder_mesh *out, bool *too_large)
{
    const size_t count = (size_t)g->size[0] * (size_t)g->size[1] * (size_t)g->size[2];
    int32_t *number = malloc(sizeof *number * count);
    *out = (struct occluder_mesh){.points = malloc(sizeof *out->points * OCCLUDER_MAX_POINTS),
                                  .corners = malloc(sizeof *out->corners * 18 * OCCLUDER_MAX_POINTS)};
    *too_large = false;
    enum status status = number && out->points && out->corners ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        *too_large = !add_points(g, number, out);
    if (status == OK && !*too_large) {
        add_faces(g, number, out);
        status = out->corner_count ? OK : NOTHING;
    }
    free(number);
    if (status != OK || *too_large)
        occluder_mesh_free(out);
    return status;
}
