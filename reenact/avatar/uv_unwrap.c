#include "reenact/avatar/uv_unwrap.h"

#include <stdlib.h>
#include <string.h>

enum { OWNER_SIDE = 1024, MAX_SIDE = 1280 };

// Chosen by hand.
static const double MIN_FACING = 0.5, SEED_FACING = 0.8; // cosines between a triangle's normal and its chart's
static const double INSIDE = 1e-3; // barycentric coordinate: a texel centre with less is on the edge, in no triangle

// A part of the surface, and the plane that it is projected to; texels count along the first two axes.
struct uv_chart {
    struct vec3 across, along, up; // unit
    int left, top, width, height;  // of its texels, the margin included
    int x, y;                      // of its top-left texel in the image
    int32_t first, count;          // its triangles in `order`
};

struct unwrapper {
    const struct surface_mesh *surface;
    const int32_t *corners;
    int triangles;
    double texel_m;
    struct vec3 *facing;                // of each triangle: its normal
    int32_t (*neighbor)[3];             // as in uv_mesh
    int32_t *chart_of;                  // of each triangle; -1: none yet
    int32_t *order;                     // triangles, chart by chart
    int32_t (*texel_owner)[OWNER_SIDE]; // the last chart that claimed this texel, coordinates modulo the side; -1: none
    struct uv_chart *charts;
    int32_t chart_count, placed; // placed: triangles that are in a chart
};

// ---------------------------------------------------------------- neighbours

struct mesh_edge {
    int32_t low, high, triangle, side;
};

static int by_ends(const void *a, const void *b)
{
    const struct mesh_edge *edge = a, *q = b;
    if (edge->low != q->low)
        return edge->low < q->low ? -1 : 1;
    if (edge->high != q->high)
        return edge->high < q->high ? -1 : 1;
    return (edge->triangle > q->triangle) - (edge->triangle < q->triangle);
}

static enum status find_neighbours(struct unwrapper *unwrapper)
{
    struct mesh_edge *edges = malloc(sizeof *edges * 3 * (size_t)unwrapper->triangles);
    if (!edges)
        return fail(ERR_MEMORY, "no memory for unwrapping the mesh");
    for (int i = 0; i < 3 * unwrapper->triangles; i++) {
        int32_t a = unwrapper->corners[i], b = unwrapper->corners[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = (struct mesh_edge){a < b ? a : b, a < b ? b : a, i / 3, i % 3};
        unwrapper->neighbor[i / 3][i % 3] = -1;
    }
    qsort(edges, 3 * (size_t)unwrapper->triangles, sizeof *edges, by_ends);
    for (int i = 0; i + 1 < 3 * unwrapper->triangles; i++) {
        const struct mesh_edge *a = &edges[i], *b = &edges[i + 1];
        if (a->low != b->low || a->high != b->high)
            continue;
        unwrapper->neighbor[a->triangle][a->side] = b->triangle;
        unwrapper->neighbor[b->triangle][b->side] = a->triangle;
        i++;
    }
    free(edges);
    return OK;
}

// ---------------------------------------------------------------- charts

static void project_uv(const struct unwrapper *unwrapper, const struct uv_chart *chart, int32_t point, double at[2])
{
    struct vec3 p = unwrapper->surface->points[point];
    at[0] = v3_dot(p, chart->across) / unwrapper->texel_m;
    at[1] = v3_dot(p, chart->along) / unwrapper->texel_m;
}

// Claims the texels whose centres lie in the triangle. False: the chart has one of them already; none is claimed.
static bool claim_texels(struct unwrapper *unwrapper, const struct uv_chart *chart, int32_t number, int32_t triangle)
{
    double q[3][2], low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        project_uv(unwrapper, chart, unwrapper->corners[3 * triangle + i], q[i]);
        for (int k = 0; k < 2; k++)
            low[k] = fmin(low[k], q[i][k]), high[k] = fmax(high[k], q[i][k]);
    }
    double area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
    if (area == 0)
        return true;
    for (int claiming = 0; claiming < 2; claiming++) // test all, then claim all
        for (int y = (int)ceil(low[1]); y <= (int)floor(high[1]); y++)
            for (int x = (int)ceil(low[0]); x <= (int)floor(high[0]); x++) {
                double u = ((q[1][0] - x) * (q[2][1] - y) - (q[1][1] - y) * (q[2][0] - x)) / area;
                double v = ((q[2][0] - x) * (q[0][1] - y) - (q[2][1] - y) * (q[0][0] - x)) / area;
                if (u < INSIDE || v < INSIDE || 1 - u - v < INSIDE)
                    continue;
                int32_t *at = &unwrapper->texel_owner[y & (OWNER_SIDE - 1)][x & (OWNER_SIDE - 1)];
                if (*at == number && !claiming)
                    return false;
                *at = number;
            }
    return true;
}

// Grows a chart from one triangle over its neighbours that face much the same way.
static void grow_chart(struct unwrapper *unwrapper, int32_t seed, struct vec3 up)
{
    int32_t number = unwrapper->chart_count++;
    struct uv_chart *chart = &unwrapper->charts[number];
    struct vec3 reference = fabs(up.y) < 0.7 ? v3(0, 1, 0) : v3(1, 0, 0);
    *chart = (struct uv_chart){.up = up, .across = v3_unit(v3_cross(reference, up)), .first = unwrapper->placed};
    chart->along = v3_cross(up, chart->across);
    unwrapper->chart_of[seed] = number;
    unwrapper->order[unwrapper->placed++] = seed;
    claim_texels(unwrapper, chart, number, seed);
    for (int32_t at = chart->first; at < unwrapper->placed; at++)
        for (int side = 0; side < 3; side++) {
            int32_t next = unwrapper->neighbor[unwrapper->order[at]][side];
            if (next < 0 || unwrapper->chart_of[next] >= 0 || v3_dot(unwrapper->facing[next], up) < MIN_FACING ||
                !claim_texels(unwrapper, chart, number, next))
                continue;
            unwrapper->chart_of[next] = number;
            unwrapper->order[unwrapper->placed++] = next;
        }
    chart->count = unwrapper->placed - chart->first;
}

// First what faces one of the main directions, which makes few large charts; then what is left.
static void cut_charts(struct unwrapper *unwrapper)
{
    const struct vec3 main[] = {v3(0, 0, -1), v3(0, 0, 1), v3(1, 0, 0), v3(-1, 0, 0), v3(0, -1, 0), v3(0, 1, 0)};
    for (size_t m = 0; m < COUNT_OF(main); m++)
        for (int32_t t = 0; t < unwrapper->triangles; t++)
            if (unwrapper->chart_of[t] < 0 && v3_dot(unwrapper->facing[t], main[m]) > SEED_FACING)
                grow_chart(unwrapper, t, main[m]);
    for (int32_t t = 0; t < unwrapper->triangles; t++)
        if (unwrapper->chart_of[t] < 0)
            grow_chart(unwrapper, t, unwrapper->facing[t]);
    for (int32_t i = 0; i < unwrapper->chart_count; i++) {
        struct uv_chart *chart = &unwrapper->charts[i];
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, at[2];
        for (int32_t k = 0; k < 3 * chart->count; k++) {
            project_uv(unwrapper, chart, unwrapper->corners[3 * unwrapper->order[chart->first + k / 3] + k % 3], at);
            for (int e = 0; e < 2; e++)
                low[e] = fmin(low[e], at[e]), high[e] = fmax(high[e], at[e]);
        }
        chart->left = (int)floor(low[0]) - UV_CHART_MARGIN / 2, chart->top = (int)floor(low[1]) - UV_CHART_MARGIN / 2;
        chart->width = (int)ceil(high[0]) - chart->left + UV_CHART_MARGIN / 2;
        chart->height = (int)ceil(high[1]) - chart->top + UV_CHART_MARGIN / 2;
    }
}

// ---------------------------------------------------------------- packing

// In rows, the highest charts first, in an image about square. ERR_INPUT: too large.
static enum status pack_charts(struct unwrapper *unwrapper, struct uv_mesh *out)
{
    int highest = 0, row_height = 0, x = 0, y = 0;
    double area = 0;
    for (int32_t i = 0; i < unwrapper->chart_count; i++) {
        struct uv_chart *chart = &unwrapper->charts[i];
        if (chart->width > OWNER_SIDE || chart->height > OWNER_SIDE)
            return fail(ERR_INPUT, "the person is too large for the texture atlas");
        area += (double)chart->width * chart->height;
        highest = chart->height > highest ? chart->height : highest;
        out->width = chart->width > out->width ? chart->width : out->width;
    }
    while ((double)out->width * out->width < area)
        out->width++;
    for (int height = highest; height > 0; height--)
        for (int32_t i = 0; i < unwrapper->chart_count; i++) {
            struct uv_chart *chart = &unwrapper->charts[i];
            if (chart->height != height)
                continue;
            if (x + chart->width > out->width)
                x = 0, y += row_height, row_height = 0;
            chart->x = x, chart->y = y;
            x += chart->width;
            row_height = row_height ? row_height : height;
        }
    out->height = y + row_height;
    return out->width <= MAX_SIDE && out->height <= MAX_SIDE
               ? OK
               : fail(ERR_INPUT, "the person is too large for the texture atlas");
}

// number: of each of the surface's points: its index in the current chart; scratch, -1 at first.
static void write_points(const struct unwrapper *unwrapper, struct uv_mesh *out, int32_t *number)
{
    for (int32_t i = 0; i < unwrapper->chart_count; i++) {
        const struct uv_chart *chart = &unwrapper->charts[i];
        int before = out->point_count;
        for (int32_t k = 0; k < 3 * chart->count; k++) {
            int32_t triangle = unwrapper->order[chart->first + k / 3], point = unwrapper->corners[3 * triangle + k % 3];
            if (number[point] < before) {
                double at[2];
                project_uv(unwrapper, chart, point, at);
                number[point] = out->point_count;
                out->points[out->point_count] = point;
                out->at[out->point_count][0] = (float)(at[0] - chart->left + chart->x + 0.5);
                out->at[out->point_count++][1] = (float)(at[1] - chart->top + chart->y + 0.5);
            }
            out->corners[3 * triangle + k % 3] = number[point];
        }
    }
    out->corner_count = 3 * unwrapper->triangles;
}

static enum status unwrap_with(struct unwrapper *unwrapper, struct uv_mesh *out, int32_t *number)
{
    for (int32_t t = 0; t < unwrapper->triangles; t++) {
        const struct vec3 *p = unwrapper->surface->points;
        const int32_t *q = unwrapper->corners + 3 * (size_t)t;
        unwrapper->facing[t] = v3_unit(v3_cross(v3_sub(p[q[1]], p[q[0]]), v3_sub(p[q[2]], p[q[0]])));
        unwrapper->chart_of[t] = -1;
    }
    for (int i = 0; i < OWNER_SIDE * OWNER_SIDE; i++)
        unwrapper->texel_owner[i / OWNER_SIDE][i % OWNER_SIDE] = -1;
    for (int i = 0; i < unwrapper->surface->point_count; i++)
        number[i] = -1;
    enum status status = find_neighbours(unwrapper);
    if (status != OK)
        return status;
    cut_charts(unwrapper);
    status = pack_charts(unwrapper, out);
    if (status == OK)
        write_points(unwrapper, out, number);
    return status;
}

enum status uv_unwrap(struct uv_mesh *out, const struct surface_mesh *surface, const int32_t *corners, int corner_count,
                      double texel_m)
{
    size_t triangles = (size_t)corner_count / 3;
    struct unwrapper c = {.surface = surface,
                          .corners = corners,
                          .triangles = (int)triangles,
                          .texel_m = texel_m,
                          .facing = malloc(sizeof *c.facing * triangles),
                          .chart_of = malloc(sizeof *c.chart_of * triangles),
                          .order = malloc(sizeof *c.order * triangles),
                          .texel_owner = malloc(sizeof *c.texel_owner * OWNER_SIDE),
                          .charts = malloc(sizeof *c.charts * triangles)};
    int32_t *number = malloc(sizeof *number * (size_t)surface->point_count);
    *out = (struct uv_mesh){.points = malloc(sizeof *out->points * 3 * triangles),
                            .at = malloc(sizeof *out->at * 3 * triangles),
                            .corners = malloc(sizeof *out->corners * 3 * triangles),
                            .neighbor = malloc(sizeof *out->neighbor * triangles)};
    c.neighbor = out->neighbor;
    enum status status = OK;
    if (!c.facing || !c.neighbor || !c.chart_of || !c.order || !c.texel_owner || !c.charts || !number || !out->points ||
        !out->at || !out->corners)
        status = fail(ERR_MEMORY, "no memory for unwrapping the mesh");
    if (status == OK)
        status = unwrap_with(&c, out, number);
    free(c.facing);
    free(c.chart_of);
    free(c.order);
    free(c.texel_owner);
    free(c.charts);
    free(number);
    if (status != OK)
        uv_mesh_free(out);
    return status;
}

void uv_mesh_free(struct uv_mesh *mesh)
{
    free(mesh->points);
    free(mesh->at);
    free(mesh->corners);
    free(mesh->neighbor);
    *mesh = (struct uv_mesh){0};
}
