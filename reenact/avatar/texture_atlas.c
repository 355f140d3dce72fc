#include "reenact/avatar/texture_atlas.h"

#include "base/portable_math.h"
#include "base/threads.h"
#include "platform/vision/mesh_simplify.h"

#include <stdlib.h>
#include <string.h>

enum { TRIANGLES = 2500, ROWS = 16, FARTHEST_CELLS = 4, SUBDIVISIONS = 4, ITERATIONS = 3 };

// docs/notes/retrieval-and-drawing.md compares 2000 to 4000 triangles; the rest was chosen by hand.
static const double ERROR_M = 0.01; // of simplification, before the coarse mesh is refitted to the fine surface
static const double TEXEL_M = 0.004, COARSER = 1.3, TEXEL_MAX_M = 0.03; // COARSER: factor where it does not fit
static const float GUTTER = 1.5F; // texels beyond a triangle's edge that bilinear filtering reads

// Finds points of the fine surface by cubes of TSDF_VOXEL_M, and the triangles of each point.
struct point_grid {
    const struct surface_mesh *surface;
    struct vec3 low;
    int size[3];
    int32_t *head, *next;      // linked list of each cube's points; -1: end
    int32_t *first, *triangle; // point i's triangles are numbers first[i] to first[i + 1] of `triangle`
};

static void point_grid_close(struct point_grid *grid)
{
    free(grid->head);
    free(grid->next);
    free(grid->first);
    free(grid->triangle);
}

static void cube_of(const struct point_grid *grid, struct vec3 p, int at[3])
{
    at[0] = (int)floor((p.x - grid->low.x) / TSDF_VOXEL_M);
    at[1] = (int)floor((p.y - grid->low.y) / TSDF_VOXEL_M);
    at[2] = (int)floor((p.z - grid->low.z) / TSDF_VOXEL_M);
}

static int32_t *head_of(const struct point_grid *grid, const int at[3])
{
    for (int k = 0; k < 3; k++)
        if (at[k] < 0 || at[k] >= grid->size[k])
            return NULL;
    return &grid->head[((size_t)at[2] * (size_t)grid->size[1] + (size_t)at[1]) * (size_t)grid->size[0] + (size_t)at[0]];
}

static void fill_grid(struct point_grid *grid)
{
    const struct surface_mesh *s = grid->surface;
    for (int i = s->point_count - 1; i >= 0; i--) {
        int at[3];
        cube_of(grid, s->points[i], at);
        int32_t *head = head_of(grid, at);
        grid->next[i] = *head;
        *head = i;
    }
    for (int c = 0; c < s->corner_count; c++)
        grid->first[s->corners[c] + 1]++;
    for (int i = 0; i < s->point_count; i++)
        grid->first[i + 1] += grid->first[i];
    // Backwards: first[i + 1] is the end of point i's range, and becomes its start.
    for (int c = s->corner_count - 1; c >= 0; c--)
        grid->triangle[--grid->first[s->corners[c] + 1]] = c / 3;
    memmove(grid->first, grid->first + 1, sizeof *grid->first * (size_t)s->point_count);
    grid->first[s->point_count] = s->corner_count;
}

static enum status point_grid_open(struct point_grid *grid, const struct surface_mesh *mesh)
{
    struct vec3 high = mesh->points[0];
    size_t points = (size_t)mesh->point_count, cubes;
    *grid = (struct point_grid){.surface = mesh, .low = mesh->points[0]};
    for (int i = 0; i < mesh->point_count; i++) {
        struct vec3 p = mesh->points[i];
        grid->low = v3(fmin(grid->low.x, p.x), fmin(grid->low.y, p.y), fmin(grid->low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    cube_of(grid, high, grid->size);
    for (int k = 0; k < 3; k++)
        grid->size[k]++;
    cubes = (size_t)grid->size[0] * (size_t)grid->size[1] * (size_t)grid->size[2];
    grid->head = malloc(sizeof *grid->head * cubes);
    grid->next = malloc(sizeof *grid->next * points);
    grid->first = calloc(points + 2, sizeof *grid->first);
    grid->triangle = malloc(sizeof *grid->triangle * (size_t)mesh->corner_count);
    if (!grid->head || !grid->next || !grid->first || !grid->triangle) {
        point_grid_close(grid);
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    for (size_t i = 0; i < cubes; i++)
        grid->head[i] = -1;
    fill_grid(grid);
    return OK;
}

// The nearest point of one cube that faces the same way, if it is nearer than the best so far.
struct nearest {
    double distance2;
    int32_t point; // -1: none
};

static void search_cube(const struct point_grid *grid, const int at[3], struct vec3 p, struct vec3 facing,
                        struct nearest *best)
{
    const int32_t *head = head_of(grid, at);
    for (int32_t i = head ? *head : -1; i >= 0; i = grid->next[i]) {
        struct vec3 d = v3_sub(grid->surface->points[i], p);
        double away2 = v3_dot(d, d);
        if (away2 < best->distance2 && v3_dot(grid->surface->normals[i], facing) > 0)
            *best = (struct nearest){away2, i};
    }
}

// The nearest of the surface's points that face the same way; -1: none is near. Searches growing blocks of cubes until
// one has any.
static int32_t nearest_point(const struct point_grid *grid, struct vec3 p, struct vec3 facing)
{
    struct nearest best = {INFINITY, -1};
    int center[3];
    cube_of(grid, p, center);
    for (int reach = 1; reach <= FARTHEST_CELLS && best.point < 0; reach++) {
        const int side = 2 * reach + 1;
        for (int i = 0; i < side * side * side; i++) {
            const int at[3] = {center[0] - reach + i % side, center[1] - reach + i / side % side,
                               center[2] - reach + i / side / side};
            search_cube(grid, at, p, facing, &best);
        }
    }
    return best.point;
}

// The point of a triangle that is nearest to p, in barycentric coordinates; its squared distance. Beyond an edge it is
// approximate: negative coordinates are set to 0.
static double closest_point(const struct vec3 *a, const struct vec3 *b, const struct vec3 *c, struct vec3 p,
                            double share[3])
{
    struct vec3 ab = v3_sub(*b, *a), ac = v3_sub(*c, *a), ap = v3_sub(p, *a);
    double d11 = v3_dot(ab, ab), d12 = v3_dot(ab, ac), d22 = v3_dot(ac, ac), e1 = v3_dot(ab, ap), e2 = v3_dot(ac, ap);
    double area2 = d11 * d22 - d12 * d12;
    share[1] = area2 > 0 ? (d22 * e1 - d12 * e2) / area2 : 0;
    share[2] = area2 > 0 ? (d11 * e2 - d12 * e1) / area2 : 0;
    share[0] = 1 - share[1] - share[2];
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += share[i] = fmax(share[i], 0);
    for (int i = 0; i < 3; i++)
        share[i] /= sum;
    struct vec3 at = v3_add(v3_scale(*a, share[0]), v3_add(v3_scale(*b, share[1]), v3_scale(*c, share[2])));
    struct vec3 off = v3_sub(p, at);
    return v3_dot(off, off);
}

// ---------------------------------------------------------------- the image

struct texel_bake {
    struct texture_atlas *atlas;
    const struct vertex_colors *vertex_colors;
    const struct point_grid *grid;
    int32_t *owner; // of each texel: the triangle that is baked into it; -1: none is near
    float *off;     // of each texel: distance beyond that triangle's edge, texels; negative inside
};

static void write_texel(const struct texel_bake *bake, size_t texel, struct vec3 p, struct vec3 facing)
{
    const struct surface_mesh *s = bake->grid->surface;
    int32_t point = nearest_point(bake->grid, p, facing);
    double min = INFINITY, best[3] = {1, 0, 0};
    if (point < 0)
        return;
    const int32_t alone[3] = {point, point, point},
                  *of = alone; // of: the corners of the nearest triangle; the point itself where there is none
    for (int32_t i = bake->grid->first[point]; i < bake->grid->first[point + 1]; i++) {
        const int32_t *c = s->corners + 3 * (size_t)bake->grid->triangle[i];
        double share[3];
        double away2 = closest_point(&s->points[c[0]], &s->points[c[1]], &s->points[c[2]], p, share);
        if (away2 < min) {
            min = away2;
            of = c;
            memcpy(best, share, sizeof best);
        }
    }
    int heaviest = best[1] > best[0] ? 1 : 0;
    heaviest = best[2] > best[heaviest] ? 2 : heaviest;
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < 3; i++)
            sum += best[i] * (double)bake->vertex_colors->color[of[i]][k];
        bake->atlas->color[3 * texel + (size_t)k] = (uint8_t)(255 * sqrt(fmin(fmax(sum, 0), 1)) + 0.5);
    }
    double hundredths = fmin(fmax((double)bake->vertex_colors->time_s[of[heaviest]] * 100 + 0.5, 0), 0xffffff);
    uint8_t *seen_time = bake->atlas->seen_time + 4 * texel;
    seen_time[0] = (uint8_t)((int)hundredths >> 8 & 255);
    seen_time[1] = (uint8_t)((int)hundredths & 255);
    seen_time[2] = bake->vertex_colors->filled[of[heaviest]] ? 255 : 0;
    seen_time[3] = (uint8_t)((int)hundredths >> 16);
}

// Barycentric coordinates of (x, y) in a triangle of the mesh, negative beyond an edge. *off: how far it lies beyond
// the farthest edge, texels.
static void barycentrics_of(const struct uv_mesh *mesh, const int32_t *c, float x, float y, float share[3], float *off)
{
    const float *q[3] = {mesh->at[c[0]], mesh->at[c[1]], mesh->at[c[2]]};
    float area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
    *off = area > 0 ? -INFINITY : INFINITY;
    for (int i = 0; i < 3; i++) {
        const float *a = q[(i + 1) % 3], *b = q[(i + 2) % 3];
        float doubled = (a[0] - x) * (b[1] - y) - (a[1] - y) * (b[0] - x);
        share[i] = doubled / area;
        *off = fmaxf(*off, -doubled / (float)portable_hypot((double)(b[0] - a[0]), (double)(b[1] - a[1])));
    }
}

// Each texel that a triangle covers, or that lies less than GUTTER beyond its edge, goes to the triangle that it lies
// deepest in.
static void assign_texels(struct texel_bake *bake)
{
    const struct uv_mesh *m = &bake->atlas->mesh;
    for (int t = 0; t < m->corner_count; t += 3) {
        const int32_t *c = m->corners + t;
        float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, share[3], off;
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 2; k++) {
                low[k] = fminf(low[k], m->at[c[i]][k]);
                high[k] = fmaxf(high[k], m->at[c[i]][k]);
            }
        int right = (int)fminf(high[0] + GUTTER, (float)m->width);
        int bottom = (int)fminf(high[1] + GUTTER, (float)m->height);
        for (int y = (int)fmaxf(low[1] - GUTTER, 0); y < bottom; y++)
            for (int x = (int)fmaxf(low[0] - GUTTER, 0); x < right; x++) {
                size_t texel = (size_t)y * (size_t)m->width + (size_t)x;
                barycentrics_of(m, c, (float)x + 0.5F, (float)y + 0.5F, share, &off);
                if (off < GUTTER && off < bake->off[texel]) {
                    bake->off[texel] = off;
                    bake->owner[texel] = t / 3;
                }
            }
    }
}

static void write_rows(void *context, int rows)
{
    const struct texel_bake *bake = context;
    const struct surface_mesh *s = bake->grid->surface;
    const struct uv_mesh *m = &bake->atlas->mesh;
    for (int y = rows * ROWS; y < (rows + 1) * ROWS && y < m->height; y++)
        for (int x = 0; x < m->width; x++) {
            size_t texel = (size_t)y * (size_t)m->width + (size_t)x;
            if (bake->owner[texel] < 0)
                continue;
            const int32_t *c = m->corners + 3 * (size_t)bake->owner[texel];
            struct vec3 p = v3(0, 0, 0), facing = p;
            float share[3], off;
            barycentrics_of(m, c, (float)x + 0.5F, (float)y + 0.5F, share, &off);
            for (int i = 0; i < 3; i++) {
                p = v3_add(p, v3_scale(bake->atlas->points[c[i]], (double)share[i]));
                facing = v3_add(facing, s->normals[m->points[c[i]]]);
            }
            write_texel(bake, texel, p, facing);
        }
}

static enum status bake_texels(struct texture_atlas *atlas, const struct point_grid *grid,
                               const struct vertex_colors *vertex_colors, int threads)
{
    struct texel_bake f = {.atlas = atlas, .vertex_colors = vertex_colors, .grid = grid};
    size_t texels = (size_t)atlas->mesh.width * (size_t)atlas->mesh.height;
    enum status status = OK;
    atlas->color = calloc(texels, 3);
    atlas->seen_time = calloc(texels, 4);
    f.owner = malloc(sizeof *f.owner * texels);
    f.off = malloc(sizeof *f.off * texels);
    if (atlas->color && atlas->seen_time && f.owner && f.off) {
        for (size_t i = 0; i < texels; i++)
            f.owner[i] = -1, f.off[i] = INFINITY;
        assign_texels(&f);
        parallel_for(threads, (atlas->mesh.height + ROWS - 1) / ROWS, write_rows, &f);
    } else {
        status = fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    free(f.owner);
    free(f.off);
    return status;
}

// ---------------------------------------------------------------- the coarse mesh

// The coarse triangles, indexed by the fine surface's points; other points' values are undefined.
struct coarse_mesh {
    int32_t *corners;
    int corner_count;
    struct vec3 *points, *normals; // normals: unit
    double *moves, *weights;       // of each point: weighted sum of its moves along the normal, metres; weights
};

static void coarse_mesh_free(struct coarse_mesh *mesh)
{
    free(mesh->corners);
    free(mesh->points);
    free(mesh->normals);
    free(mesh->moves);
    free(mesh->weights);
}

// Area-weighted.
static void find_normals(struct coarse_mesh *mesh, int point_count)
{
    for (int i = 0; i < point_count; i++)
        mesh->normals[i] = v3(0, 0, 0);
    for (int t = 0; t < mesh->corner_count; t += 3) {
        const int32_t *at = mesh->corners + t;
        const struct vec3 p = mesh->points[at[0]],
                          doubled = v3_cross(v3_sub(mesh->points[at[1]], p), v3_sub(mesh->points[at[2]], p));
        for (int i = 0; i < 3; i++)
            mesh->normals[at[i]] = v3_add(mesh->normals[at[i]], doubled);
    }
    for (int i = 0; i < point_count; i++)
        mesh->normals[i] = v3_unit(mesh->normals[i]);
}

// Samples how far a triangle lies from the fine surface, and distributes it to its corners by barycentric coordinates.
static void measure_triangle(struct coarse_mesh *mesh, const struct point_grid *grid, const int32_t *at)
{
    const struct vec3 *p = mesh->points, *n = mesh->normals;
    double area = v3_length(v3_cross(v3_sub(p[at[1]], p[at[0]]), v3_sub(p[at[2]], p[at[0]])));
    for (int i = 0; i < SUBDIVISIONS; i++)
        for (int j = 0; i + j < SUBDIVISIONS; j++) {
            const double a = (i + 1.0 / 3) / SUBDIVISIONS, b = (j + 1.0 / 3) / SUBDIVISIONS,
                         share[3] = {a, b, 1 - a - b};
            struct vec3 at_sample = v3(0, 0, 0), facing = at_sample;
            for (int k = 0; k < 3; k++) {
                at_sample = v3_add(at_sample, v3_scale(p[at[k]], share[k]));
                facing = v3_add(facing, v3_scale(n[at[k]], share[k]));
            }
            const int32_t nearest = nearest_point(grid, at_sample, facing);
            if (nearest < 0)
                continue;
            double off = v3_dot(grid->surface->normals[nearest], v3_sub(grid->surface->points[nearest], at_sample));
            for (int k = 0; k < 3; k++) {
                mesh->moves[at[k]] += share[k] * area * off;
                mesh->weights[at[k]] += share[k] * area;
            }
        }
}

// The corners of the simplified mesh lie on the fine surface, so on a round limb the triangles between them lie inside
// it and the limb would be drawn too thin. The corners move along their normals until as much of each triangle lies
// outside as inside.
static void refit_corners(struct coarse_mesh *mesh, const struct point_grid *grid)
{
    const int count = grid->surface->point_count;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        find_normals(mesh, count);
        for (int i = 0; i < count; i++)
            mesh->moves[i] = mesh->weights[i] = 0;
        for (int t = 0; t < mesh->corner_count; t += 3)
            measure_triangle(mesh, grid, mesh->corners + t);
        for (int i = 0; i < count; i++)
            if (mesh->weights[i] > 0)
                mesh->points[i] =
                    v3_add(mesh->points[i], v3_scale(mesh->normals[i], mesh->moves[i] / mesh->weights[i]));
    }
    find_normals(mesh, count);
}

static enum status coarse_mesh_make(struct coarse_mesh *mesh, const struct surface_mesh *surface_mesh)
{
    const size_t count = (size_t)surface_mesh->point_count;
    float(*points)[3] = malloc(sizeof *points * count);
    *mesh = (struct coarse_mesh){.corners = malloc(sizeof *mesh->corners * (size_t)surface_mesh->corner_count),
                                 .points = malloc(sizeof *mesh->points * count),
                                 .normals = malloc(sizeof *mesh->normals * count),
                                 .moves = malloc(sizeof *mesh->moves * count),
                                 .weights = malloc(sizeof *mesh->weights * count)};
    if (!points || !mesh->corners || !mesh->points || !mesh->normals || !mesh->moves || !mesh->weights) {
        free(points);
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    memcpy(mesh->points, surface_mesh->points, sizeof *mesh->points * count);
    for (size_t i = 0; i < count; i++) {
        points[i][0] = (float)surface_mesh->points[i].x;
        points[i][1] = (float)surface_mesh->points[i].y;
        points[i][2] = (float)surface_mesh->points[i].z;
    }
    const struct simplify_mesh full = {(const float(*)[3])points, surface_mesh->corners, surface_mesh->point_count,
                                       surface_mesh->corner_count};
    mesh->corner_count = mesh_simplify(&full, 3 * TRIANGLES, (float)ERROR_M, mesh->corners);
    free(points);
    return OK;
}

static enum status unwrap_coarse(struct texture_atlas *atlas, const struct surface_mesh *mesh,
                                 const struct coarse_mesh *coarse_mesh)
{
    double texel_m = TEXEL_M;
    enum status status;
    do
        status = uv_unwrap(&atlas->mesh, mesh, coarse_mesh->corners, coarse_mesh->corner_count, texel_m);
    while (status == ERR_INPUT && (texel_m *= COARSER) < TEXEL_MAX_M);
    if (status != OK)
        return status;
    const struct uv_mesh *m = &atlas->mesh;
    atlas->points = malloc(sizeof *atlas->points * (size_t)m->point_count);
    atlas->normals = malloc(sizeof *atlas->normals * (size_t)m->point_count);
    if (!atlas->points || !atlas->normals)
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    for (int i = 0; i < m->point_count; i++) {
        atlas->points[i] = coarse_mesh->points[m->points[i]];
        atlas->normals[i] = coarse_mesh->normals[m->points[i]];
    }
    return OK;
}

enum status texture_atlas_make(struct texture_atlas *out, const struct surface_mesh *s,
                               const struct vertex_colors *vertex_colors, int threads)
{
    struct coarse_mesh coarse = {0};
    struct point_grid grid;
    *out = (struct texture_atlas){0};
    enum status status = point_grid_open(&grid, s);
    if (status != OK)
        return status;
    status = coarse_mesh_make(&coarse, s);
    if (status == OK) {
        refit_corners(&coarse, &grid);
        status = unwrap_coarse(out, s, &coarse);
    }
    if (status == OK)
        status = bake_texels(out, &grid, vertex_colors, threads);
    coarse_mesh_free(&coarse);
    point_grid_close(&grid);
    if (status != OK)
        texture_atlas_free(out);
    return status;
}

void texture_atlas_free(struct texture_atlas *atlas)
{
    uv_mesh_free(&atlas->mesh);
    free(atlas->points);
    free(atlas->normals);
    free(atlas->color);
    free(atlas->seen_time);
    *atlas = (struct texture_atlas){0};
}
