#include "reenact/scene/place_mesh.h"

#include "platform/files/jpeg.h"

#include <stdlib.h>
#include <string.h>

// STEP: of rows and columns of a depth picture that become vertices. JUMP: neighbouring depths farther apart than this
// share lie on two surfaces. CELL_M: the smallest cell. Chosen by hand.
enum { STEP = 4, TABLE = 1 << 17 };
static const double JUMP = 0.06, CELL_M = 0.05, GROW = 1.4, FARTHEST_M = 8;

struct cluster {
    int32_t cell[3];
    int32_t number; // 0: free; else the vertex's number + 1
};

struct builder {
    const struct place *place;
    double cell_m;
    struct cluster *table; // open addressing
    double (*sum)[10];     // of each vertex: point, normal, colour, count
    int vertex_count;
    uint32_t *corners;
    int corner_count, corner_capacity;
    bool full, failed;
    // of one view
    struct vec3 *points; // world; NaN: none
    int32_t *numbers;    // cluster of each point; -1
    uint8_t *rgb;
    int columns, rows;
};

static uint32_t hash(const int32_t c[3])
{
    return (uint32_t)c[0] * 73856093u ^ (uint32_t)c[1] * 19349663u ^ (uint32_t)c[2] * 83492791u;
}

// The number of the point's cluster, a new one if need be. -1: there are too many.
static int32_t cluster_of(struct builder *builder, struct vec3 p)
{
    const int32_t cell[3] = {(int32_t)floor(p.x / builder->cell_m), (int32_t)floor(p.y / builder->cell_m),
                             (int32_t)floor(p.z / builder->cell_m)};
    uint32_t at = hash(cell) % TABLE;
    while (builder->table[at].number && memcmp(builder->table[at].cell, cell, sizeof cell) != 0)
        at = (at + 1) % TABLE;
    if (builder->table[at].number)
        return builder->table[at].number - 1;
    if (builder->vertex_count == PLACE_MESH_VERTICES) {
        builder->full = true;
        return -1;
    }
    memcpy(builder->table[at].cell, cell, sizeof cell);
    builder->table[at].number = ++builder->vertex_count;
    memset(builder->sum[builder->vertex_count - 1], 0, sizeof *builder->sum);
    return builder->vertex_count - 1;
}

static void place_points(struct builder *builder, const struct place_view *view)
{
    const struct calibration *c = &builder->place->calibration;
    for (int r = 0; r < builder->rows; r++)
        for (int k = 0; k < builder->columns; k++) {
            const int x = k * STEP, y = r * STEP;
            const double z = view->depth[(size_t)y * (size_t)c->depth.width + (size_t)x] * 1e-3;
            const int i = r * builder->columns + k;
            builder->numbers[i] = -1;
            builder->points[i] = v3(NAN, NAN, NAN);
            if (!(z > 0.2 && z < FARTHEST_M))
                continue;
            const struct vec3 ray = lens_ray(&c->depth, (struct pixel){x, y});
            const struct vec3 in_color = pose_apply(c->color_from_depth, v3_scale(ray, z));
            builder->points[i] = pose_apply(view->world_from_camera, in_color);
            builder->numbers[i] = cluster_of(builder, builder->points[i]);
            if (builder->numbers[i] < 0)
                continue;
            double *sum = builder->sum[builder->numbers[i]];
            sum[0] += builder->points[i].x, sum[1] += builder->points[i].y, sum[2] += builder->points[i].z;
            sum[9]++;
            if (!(in_color.z > 0.05))
                continue;
            const struct pixel px = lens_project(&c->color, in_color);
            const int u = (int)(px.x + 0.5), v = (int)(px.y + 0.5);
            const bool within = px.x >= 0 && px.y >= 0 && u < c->color.width && v < c->color.height;
            const uint8_t *rgb =
                within && builder->rgb ? builder->rgb + 3 * ((size_t)v * (size_t)c->color.width + (size_t)u) : NULL;
            for (int n = 0; n < 3; n++)
                sum[6 + n] += rgb ? rgb[n] : 128;
        }
}

static bool is_triangle_joined(const struct builder *builder, struct vec3 eye, const int corner[3])
{
    for (int k = 0; k < 3; k++) {
        const struct vec3 p = builder->points[corner[k]], q = builder->points[corner[(k + 1) % 3]];
        const double near = v3_distance(p, eye);
        if (builder->numbers[corner[k]] < 0 || !(fabs(near - v3_distance(q, eye)) < JUMP * near))
            return false;
    }
    return true;
}

static void add_triangle(struct builder *builder, struct vec3 eye, const int corner[3])
{
    if (!is_triangle_joined(builder, eye, corner))
        return;
    const struct vec3 p = builder->points[corner[0]];
    const struct vec3 n = v3_cross(v3_sub(builder->points[corner[1]], p), v3_sub(builder->points[corner[2]], p));
    const int32_t of[3] = {builder->numbers[corner[0]], builder->numbers[corner[1]], builder->numbers[corner[2]]};
    for (int k = 0; k < 3; k++) {
        double *sum = builder->sum[of[k]];
        sum[3] += n.x, sum[4] += n.y, sum[5] += n.z;
    }
    if (of[0] == of[1] || of[1] == of[2] || of[2] == of[0])
        return;
    if (builder->corner_count + 3 > builder->corner_capacity) {
        const int capacity = builder->corner_capacity ? 2 * builder->corner_capacity : 1 << 16;
        uint32_t *grown = realloc(builder->corners, sizeof *grown * (size_t)capacity);
        builder->failed |= !grown;
        if (!grown)
            return;
        builder->corners = grown;
        builder->corner_capacity = capacity;
    }
    int first = 0; // the lowest number first
    for (int k = 1; k < 3; k++)
        if (of[k] < of[first])
            first = k;
    for (int k = 0; k < 3; k++)
        builder->corners[builder->corner_count++] = (uint32_t)of[(first + k) % 3];
}

static void add_view(struct builder *builder, const struct place_view *view)
{
    const struct calibration *c = &builder->place->calibration;
    const struct vec3 eye = view->world_from_camera.translation;
    uint8_t *rgb = builder->rgb;
    if (!view->jpeg || (rgb && jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, c->color.width, c->color.height) != OK))
        builder->rgb = NULL; // grey
    place_points(builder, view);
    for (int r = 0; r + 1 < builder->rows; r++)
        for (int k = 0; k + 1 < builder->columns; k++) {
            const int i = r * builder->columns + k;
            // Rows run down and columns right in the picture, so this order is counter-clockwise to the camera.
            add_triangle(builder, eye, (const int[3]){i, i + builder->columns, i + 1});
            add_triangle(builder, eye, (const int[3]){i + 1, i + builder->columns, i + builder->columns + 1});
        }
    builder->rgb = rgb;
}

static int compare_triangles(const void *a, const void *b) { return memcmp(a, b, 3 * sizeof(uint32_t)); }

// Views that show the same wall give the same triangles.
static void remove_doubles(struct builder *builder)
{
    int kept = 0;
    qsort(builder->corners, (size_t)builder->corner_count / 3, 3 * sizeof *builder->corners, compare_triangles);
    for (int i = 0; i < builder->corner_count; i += 3)
        if (!kept || compare_triangles(builder->corners + i, builder->corners + kept - 3) != 0) {
            memmove(builder->corners + kept, builder->corners + i, 3 * sizeof *builder->corners);
            kept += 3;
        }
    builder->corner_count = kept;
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static bool find_bounds(struct place_mesh *mesh)
{
    float *sorted = malloc(sizeof *sorted * (size_t)mesh->vertex_count);
    double low[3], high[3];
    if (!sorted)
        return false;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < mesh->vertex_count; i++)
            sorted[i] = mesh->vertices[i].at[k];
        qsort(sorted, (size_t)mesh->vertex_count, sizeof *sorted, compare_floats);
        low[k] = (double)sorted[mesh->vertex_count / 50];
        high[k] = (double)sorted[mesh->vertex_count - 1 - mesh->vertex_count / 50];
    }
    free(sorted);
    mesh->low = v3(low[0], low[1], low[2]);
    mesh->high = v3(high[0], high[1], high[2]);
    return true;
}

static enum status finish_mesh(struct builder *builder, struct place_mesh *out)
{
    remove_doubles(builder);
    *out = (struct place_mesh){.vertices = malloc(sizeof *out->vertices * (size_t)(builder->vertex_count + 1)),
                               .corners = builder->corners,
                               .vertex_count = builder->vertex_count,
                               .corner_count = builder->corner_count,
                               .cell_m = builder->cell_m};
    builder->corners = NULL;
    for (int i = 0; i < builder->vertex_count && out->vertices; i++) {
        const double *s = builder->sum[i];
        const struct vec3 n = v3_unit(v3(s[3], s[4], s[5]));
        struct place_mesh_vertex *v = &out->vertices[i];
        *v = (struct place_mesh_vertex){.normal = {(float)n.x, (float)n.y, (float)n.z}};
        for (int k = 0; k < 3; k++) {
            v->at[k] = (float)(s[k] / s[9]);
            v->rgb[k] = (uint8_t)(s[6 + k] / s[9] + 0.5);
        }
    }
    const bool good = out->vertices && find_bounds(out);
    if (good)
        return OK;
    place_mesh_free(out);
    return fail(ERR_MEMORY, "no memory for the map of the place");
}

// One attempt with cells of that side. NOTHING: cancelled, or nothing was seen.
static enum status attempt_mesh(struct builder *builder, bool (*keep_going)(void *self), void *self)
{
    memset(builder->table, 0, sizeof *builder->table * TABLE);
    builder->vertex_count = builder->corner_count = 0;
    builder->full = false;
    for (int i = 0; i < builder->place->view_count && !builder->full && !builder->failed; i++) {
        if (keep_going && !keep_going(self))
            return NOTHING;
        if (builder->place->views[i].depth)
            add_view(builder, &builder->place->views[i]);
    }
    if (builder->failed)
        return fail(ERR_MEMORY, "no memory for the map of the place");
    return builder->full || builder->corner_count ? OK : NOTHING;
}

enum status place_mesh_make(struct place_mesh *out, const struct place *place, bool (*keep_going)(void *self),
                            void *self)
{
    const struct lens *depth = &place->calibration.depth, *color = &place->calibration.color;
    struct builder b = {.place = place, .cell_m = CELL_M, .full = true};
    *out = (struct place_mesh){0};
    if (!depth->width)
        return NOTHING;
    b.columns = (depth->width - 1) / STEP + 1;
    b.rows = (depth->height - 1) / STEP + 1;
    const size_t points = (size_t)b.columns * (size_t)b.rows;
    b.table = malloc(sizeof *b.table * TABLE);
    b.sum = malloc(sizeof *b.sum * PLACE_MESH_VERTICES);
    b.points = malloc(sizeof *b.points * points);
    b.numbers = malloc(sizeof *b.numbers * points);
    b.rgb = color->width ? malloc((size_t)color->width * (size_t)color->height * 3) : NULL;
    enum status status = b.table && b.sum && b.points && b.numbers && (b.rgb || !color->width)
                             ? OK
                             : fail(ERR_MEMORY, "no memory for the map of the place");
    for (; status == OK && b.full; b.cell_m *= b.full ? GROW : 1)
        status = attempt_mesh(&b, keep_going, self);
    if (status == OK)
        status = finish_mesh(&b, out);
    free(b.table);
    free(b.sum);
    free(b.points);
    free(b.numbers);
    free(b.rgb);
    free(b.corners);
    return status;
}

void place_mesh_free(struct place_mesh *mesh)
{
    free(mesh->vertices);
    free(mesh->corners);
    *mesh = (struct place_mesh){0};
}
