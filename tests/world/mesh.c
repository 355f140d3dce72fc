#include "tests/world/mesh.h"

#include "tests/world/numbers.h"

#include <stdlib.h>
#include <string.h>

enum { BLOCK = 8 };

struct net_grid {
    const struct form *form;
    float cell;
    struct vec3f low;
    int n[3]; // points along each axis, a multiple of BLOCK plus 1
    int blocks[3];
    float *value;    // at the points
    int *vertex;     // of the cell whose low corner is this point, -1: none
    uint8_t *active; // blocks that the surface may cross
};

static size_t point(const struct net_grid *g, int x, int y, int z)
{
    return ((size_t)z * (size_t)g->n[1] + (size_t)y) * (size_t)g->n[0] + (size_t)x;
}

static struct vec3f place(const struct net_grid *g, float x, float y, float z)
{
    return (struct vec3f){g->low.x + x * g->cell, g->low.y + y * g->cell, g->low.z + z * g->cell};
}

static void fill_block(struct net_grid *g, int bx, int by, int bz)
{
    struct vec3f middle = place(g, ((float)bx + 0.5f) * BLOCK, ((float)by + 0.5f) * BLOCK, ((float)bz + 0.5f) * BLOCK);
    float reach = 0.87f * BLOCK * g->cell; // half the diagonal
    float d = form_distance(g->form, middle, NULL);
    bool active = fabsf(d) < 1.6f * reach + 0.01f; // the distance is only approximate
    g->active[(bz * g->blocks[1] + by) * g->blocks[0] + bx] = active;
    if (!active)
        return;
    struct shape_subset subset = {.reach = 0};
    form_select_shapes(g->form, middle, reach, reach, &subset);
    for (int z = bz * BLOCK; z <= (bz + 1) * BLOCK; z++)
        for (int y = by * BLOCK; y <= (by + 1) * BLOCK; y++)
            for (int x = bx * BLOCK; x <= (bx + 1) * BLOCK; x++) {
                float *v = &g->value[point(g, x, y, z)];
                if (isnan(*v)) // else a neighbouring block's point, exact already
                    *v = form_distance(g->form, place(g, (float)x, (float)y, (float)z), &subset);
            }
}

typedef void visit_cell(struct net_grid *g, int x, int y, int z, struct mesh *m);

static void each_cell_of_block(struct net_grid *g, const int block[3], visit_cell *visit, struct mesh *m)
{
    int x0 = block[0] * BLOCK, y0 = block[1] * BLOCK, z0 = block[2] * BLOCK;
    for (int z = z0; z < z0 + BLOCK; z++)
        for (int y = y0; y < y0 + BLOCK; y++)
            for (int x = x0; x < x0 + BLOCK; x++)
                visit(g, x, y, z, m);
}

// Calls visit for every cell of every active block.
static void each_cell(struct net_grid *g, visit_cell *visit, struct mesh *m)
{
    for (int bz = 0; bz < g->blocks[2]; bz++)
        for (int by = 0; by < g->blocks[1]; by++)
            for (int bx = 0; bx < g->blocks[0]; bx++)
                if (g->active[(bz * g->blocks[1] + by) * g->blocks[0] + bx])
                    each_cell_of_block(g, (int[]){bx, by, bz}, visit, m);
}

static bool crossed(const struct net_grid *g, int x, int y, int z)
{
    bool inside = false, outside = false;
    for (int i = 0; i < 8; i++) {
        bool in = g->value[point(g, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))] < 0;
        inside |= in;
        outside |= !in;
    }
    return inside && outside;
}

static void count_cell(struct net_grid *g, int x, int y, int z, struct mesh *m)
{
    if (crossed(g, x, y, z))
        g->vertex[point(g, x, y, z)] = m->vertex_count++;
}

// The vertex of a cell: the mean of its edges' crossings.
static void place_vertex(struct net_grid *g, int x, int y, int z, struct mesh *m)
{
    int index = g->vertex[point(g, x, y, z)];
    if (index < 0)
        return;
    float sum[3] = {0}, value[8];
    int count = 0;
    for (int i = 0; i < 8; i++)
        value[i] = g->value[point(g, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))];
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) {
            int j = i | 1 << axis;
            if (j == i || (value[i] < 0) == (value[j] < 0))
                continue;
            float t = value[i] / (value[i] - value[j]);
            for (int k = 0; k < 3; k++)
                sum[k] += (float)(i >> k & 1) + (k == axis ? t : 0);
            count++;
        }
    m->at[index] =
        place(g, (float)x + sum[0] / (float)count, (float)y + sum[1] / (float)count, (float)z + sum[2] / (float)count);
}

// A quad for each crossed edge that starts at the cell's low corner.
static void make_quads(struct net_grid *g, int x, int y, int z, struct mesh *m)
{
    float here = g->value[point(g, x, y, z)];
    for (int axis = 0; axis < 3; axis++) {
        int d[3] = {axis == 0, axis == 1, axis == 2}, p[3] = {x, y, z}, u = (axis + 1) % 3, v = (axis + 2) % 3;
        float there = g->value[point(g, x + d[0], y + d[1], z + d[2])];
        if ((here < 0) == (there < 0) || p[u] == 0 || p[v] == 0)
            continue;
        int quad[4];
        for (int i = 0; i < 4; i++) { // around the edge, anticlockwise seen from its far end
            int q[3] = {x, y, z};
            q[u] -= i == 0 || i == 3;
            q[v] -= i < 2;
            quad[i] = g->vertex[point(g, q[0], q[1], q[2])];
        }
        if (quad[0] < 0 || quad[1] < 0 || quad[2] < 0 || quad[3] < 0)
            continue;
        bool out = here < 0; // the edge leaves the body
        for (int t = 0; t < 2; t++) {
            int a = quad[0], b = quad[t + 1], c = quad[t + 2];
            int *to = m->triangles ? m->triangles[m->triangle_count] : NULL;
            if (to)
                to[0] = a, to[1] = out ? b : c, to[2] = out ? c : b;
            m->triangle_count++;
        }
    }
}

static enum status grid_make(struct net_grid *g, const struct form *form, float cell)
{
    // A box around all shapes.
    float low[3] = {10, 10, 10}, high[3] = {-10, -10, -10};
    for (int i = 0; i < form->count; i++) {
        const struct shape *s = &form->shapes[i];
        float r = maxf(s->ra, s->rb), a[3] = {s->a.x, s->a.y, s->a.z}, b[3] = {s->b.x, s->b.y, s->b.z};
        for (int k = 0; k < 3; k++) {
            bool blob = s->kind == SHAPE_ELLIPSOID;
            low[k] = minf(low[k], blob ? a[k] - b[k] : minf(a[k], b[k]) - r);
            high[k] = maxf(high[k], blob ? a[k] + b[k] : maxf(a[k], b[k]) + r);
        }
    }
    low[2] = maxf(low[2], 0); // soles
    *g = (struct net_grid){.form = form, .cell = cell};
    size_t points = 1, blocks = 1;
    for (int k = 0; k < 3; k++) {
        low[k] -= 2.5f * cell + 0.005f;
        g->blocks[k] = (int)ceilf((high[k] - low[k] + 2.5f * cell + 0.02f) / (cell * BLOCK));
        g->n[k] = g->blocks[k] * BLOCK + 1;
        points *= (size_t)g->n[k];
        blocks *= (size_t)g->blocks[k];
    }
    g->low = (struct vec3f){low[0], low[1], low[2]};
    g->value = malloc(points * sizeof *g->value);
    g->vertex = malloc(points * sizeof *g->vertex);
    g->active = calloc(blocks, 1);
    if (!g->value || !g->vertex || !g->active)
        return fail(ERR_MEMORY, "out of memory for the figure's grid");
    for (size_t i = 0; i < points; i++)
        g->value[i] = NAN, g->vertex[i] = -1;
    return OK;
}

// Newton steps onto the folded surface: that also removes the grid's own pattern.
static void finish_vertices(struct mesh *m, const struct form *f, float cell)
{
    struct shape_subset subset = {.reach = 0};
    for (int i = 0; i < m->vertex_count; i++) { // block by block, so that `subset` stays valid
        struct vec3f *p = &m->at[i];
        form_select_shapes(f, *p, 0.01f, 0.04f, &subset);
        struct vec3f normal = m->normal[i] = form_normal(f, *p, &subset);
        float d = maxf(-0.7f * cell, minf(0.7f * cell, form_folded(f, *p, &subset)));
        p->x -= d * normal.x, p->y -= d * normal.y, p->z -= d * normal.z;
    }
}

enum status mesh_of(struct mesh *out, const struct form *form, float cell_m)
{
    memset(out, 0, sizeof *out);
    struct mesh m = {0};
    struct net_grid g;
    enum status status = grid_make(&g, form, cell_m);
    if (!status) {
        for (int z = 0; z < g.blocks[2]; z++)
            for (int y = 0; y < g.blocks[1]; y++)
                for (int x = 0; x < g.blocks[0]; x++)
                    fill_block(&g, x, y, z);
        each_cell(&g, count_cell, &m);
        each_cell(&g, make_quads, &m); // counts only
        m.at = malloc((size_t)m.vertex_count * sizeof *m.at);
        m.normal = malloc((size_t)m.vertex_count * sizeof *m.normal);
        m.triangles = malloc((size_t)m.triangle_count * sizeof *m.triangles);
        if (!m.at || !m.normal || !m.triangles)
            status = fail(ERR_MEMORY, "out of memory for the figure's skin");
    }
    if (!status) {
        each_cell(&g, place_vertex, &m);
        m.triangle_count = 0;
        each_cell(&g, make_quads, &m);
        finish_vertices(&m, form, cell_m);
    }
    free(g.value);
    free(g.vertex);
    free(g.active);
    if (status)
        mesh_free(&m);
    *out = m;
    return status;
}

void mesh_free(struct mesh *m)
{
    free(m->at);
    free(m->normal);
    free(m->triangles);
    memset(m, 0, sizeof *m);
}
