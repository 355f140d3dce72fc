#include "reenact/avatar/texture_atlas.h"

#include "base/threads.h"
#include "base/portable_math.h"
#include "platform/vision/mesh_simplify.h"

#include <stdlib.h>
#include <string.h>

enum { TRIANGLES = 2500, ROWS = 16, FARTHEST_CELLS = 4, SUBDIVISIONS = 4, ITERATIONS = 3 };

// docs/notes/retrieval-and-drawing.md compares 2000 to 4000 triangles; the rest was chosen by hand.
static const double ERROR_M = 0.01; // of simplification, before the coarse mesh is refitted to the fine surface
static const double TEXEL_M = 0.004, COARSER = 1.3, TEXEL_MOST_M = 0.03; // COARSER: factor where it does not fit
static const float GUTTER = 1.5F; // texels beyond a triangle's edge that bilinear filtering reads

// Finds points of the fine surface by cubes of TSDF_VOXEL_M, and the triangles of each point.
struct point_grid {
    const struct surface_mesh *surface;
    struct vec3 low;
    int size[3];
    int32_t *head, *next;      // linked list of each cube's points; -1: end
    int32_t *first, *triangle; // point i's triangles are numbers first[i] to first[i + 1] of `triangle`
};

static void point_grid_close(struct point_grid *f)
{
    free(f->head);
    free(f->next);
    free(f->first);
    free(f->triangle);
}

static void cube_of(const struct point_grid *f, struct vec3 p, int at[3])
{
    at[0] = (int)floor((p.x - f->low.x) / TSDF_VOXEL_M);
    at[1] = (int)floor((p.y - f->low.y) / TSDF_VOXEL_M);
    at[2] = (int)floor((p.z - f->low.z) / TSDF_VOXEL_M);
}

static int32_t *head_of(const struct point_grid *f, const int at[3])
{
    for (int k = 0; k < 3; k++)
        if (at[k] < 0 || at[k] >= f->size[k])
            return NULL;
    return &f->head[((size_t)at[2] * (size_t)f->size[1] + (size_t)at[1]) * (size_t)f->size[0] + (size_t)at[0]];
}

static void fill_grid(struct point_grid *f)
{
    const struct surface_mesh *s = f->surface;
    for (int i = s->point_count - 1; i >= 0; i--) {
        int at[3];
        cube_of(f, s->points[i], at);
        int32_t *head = head_of(f, at);
        f->next[i] = *head;
        *head = i;
    }
    for (int c = 0; c < s->corner_count; c++)
        f->first[s->corners[c] + 1]++;
    for (int i = 0; i < s->point_count; i++)
        f->first[i + 1] += f->first[i];
    // Backwards: first[i + 1] is the end of point i's range, and becomes its start.
    for (int c = s->corner_count - 1; c >= 0; c--)
        f->triangle[--f->first[s->corners[c] + 1]] = c / 3;
    memmove(f->first, f->first + 1, sizeof *f->first * (size_t)s->point_count);
    f->first[s->point_count] = s->corner_count;
}

static enum status point_grid_open(struct point_grid *f, const struct surface_mesh *s)
{
    struct vec3 high = s->points[0];
    size_t points = (size_t)s->point_count, cubes;
    *f = (struct point_grid){.surface = s, .low = s->points[0]};
    for (int i = 0; i < s->point_count; i++) {
        struct vec3 p = s->points[i];
        f->low = v3(fmin(f->low.x, p.x), fmin(f->low.y, p.y), fmin(f->low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    cube_of(f, high, f->size);
    for (int k = 0; k < 3; k++)
        f->size[k]++;
    cubes = (size_t)f->size[0] * (size_t)f->size[1] * (size_t)f->size[2];
    f->head = malloc(sizeof *f->head * cubes);
    f->next = malloc(sizeof *f->next * points);
    f->first = calloc(points + 2, sizeof *f->first);
    f->triangle = malloc(sizeof *f->triangle * (size_t)s->corner_count);
    if (!f->head || !f->next || !f->first || !f->triangle) {
        point_grid_close(f);
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    for (size_t i = 0; i < cubes; i++)
        f->head[i] = -1;
    fill_grid(f);
    return OK;
}

// The nearest point of one cube that faces the same way, if it is nearer than the best so far.
struct nearest {
    double distance2;
    int32_t point; // -1: none
};

static void search_cube(const struct point_grid *f, const int at[3], struct vec3 p, struct vec3 facing,
                        struct nearest *best)
{
    const int32_t *head = head_of(f, at);
    for (int32_t i = head ? *head : -1; i >= 0; i = f->next[i]) {
        struct vec3 d = v3_sub(f->surface->points[i], p);
        double away2 = v3_dot(d, d);
        if (away2 < best->distance2 && v3_dot(f->surface->normals[i], facing) > 0)
            *best = (struct nearest){away2, i};
    }
}

// The nearest of the surface's points that face the same way; -1: none is near. Searches growing blocks of cubes until
// one has any.
static int32_t nearest_point(const struct point_grid *f, struct vec3 p, struct vec3 facing)
{
    struct nearest best = {INFINITY, -1};
    int center[3];
    cube_of(f, p, center);
    for (int reach = 1; reach <= FARTHEST_CELLS && best.point < 0; reach++) {
        const int side = 2 * reach + 1;
        for (int i = 0; i < side * side * side; i++) {
            const int at[3] = {center[0] - reach + i % side, center[1] - reach + i / side % side,
                               center[2] - reach + i / side / side};
            search_cube(f, at, p, facing, &best);
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

static void write_texel(const struct texel_bake *f, size_t texel, struct vec3 p, struct vec3 facing)
{
    const struct surface_mesh *s = f->grid->surface;
    int32_t point = nearest_point(f->grid, p, facing);
    double least = INFINITY, best[3] = {1, 0, 0};
    if (point < 0)
        return;
    const int32_t alone[3] = {point, point, point},
                  *of = alone; // of: the corners of the nearest triangle; the point itself where there is none
    for (int32_t i = f->grid->first[point]; i < f->grid->first[point + 1]; i++) {
        const int32_t *c = s->corners + 3 * (size_t)f->grid->triangle[i];
        double share[3];
        double away2 = closest_point(&s->points[c[0]], &s->points[c[1]], &s->points[c[2]], p, share);
        if (away2 < least) {
            least = away2;
            of = c;
            memcpy(best, share, sizeof best);
        }
    }
    int heaviest = best[1] > best[0] ? 1 : 0;
    heaviest = best[2] > best[heaviest] ? 2 : heaviest;
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < 3; i++)
            sum += best[i] * (double)f->vertex_colors->color[of[i]][k];
        f->atlas->color[3 * texel + (size_t)k] = (uint8_t)(255 * sqrt(fmin(fmax(sum, 0), 1)) + 0.5);
    }
    double hundredths = fmin(fmax((double)f->vertex_colors->time_s[of[heaviest]] * 100 + 0.5, 0), 0xffffff);
    uint8_t *seen_time = f->atlas->seen_time + 4 * texel;
    seen_time[0] = (uint8_t)((int)hundredths >> 8 & 255);
    seen_time[1] = (uint8_t)((int)hundredths & 255);
    seen_time[2] = f->vertex_colors->filled[of[heaviest]] ? 255 : 0;
    seen_time[3] = (uint8_t)((int)hundredths >> 16);
}

// Barycentric coordinates of (x, y) in a triangle of the mesh, negative beyond an edge. *off: how far it lies beyond
// the farthest edge, texels.
static void barycentrics_of(const struct uv_mesh *m, const int32_t *c, float x, float y, float share[3], float *off)
{
    const float *q[3] = {m->at[c[0]], m->at[c[1]], m->at[c[2]]};
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
static void assign_texels(struct texel_bake *f)
{
    const struct uv_mesh *m = &f->atlas->mesh;
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
                if (off < GUTTER && off < f->off[texel]) {
                    f->off[texel] = off;
                    f->owner[texel] = t / 3;
                }
            }
    }
}

static void write_rows(void *context, int rows)
{
    const struct texel_bake *f = context;
    const struct surface_mesh *s = f->grid->surface;
    const struct uv_mesh *m = &f->atlas->mesh;
    for (int y = rows * ROWS; y < (rows + 1) * ROWS && y < m->height; y++)
        for (int x = 0; x < m->width; x++) {
            size_t texel = (size_t)y * (size_t)m->width + (size_t)x;
            if (f->owner[texel] < 0)
                continue;
            const int32_t *c = m->corners + 3 * (size_t)f->owner[texel];
            struct vec3 p = v3(0, 0, 0), facing = p;
            float share[3], off;
            barycentrics_of(m, c, (float)x + 0.5F, (float)y + 0.5F, share, &off);
            for (int i = 0; i < 3; i++) {
                p = v3_add(p, v3_scale(f->atlas->points[c[i]], (double)share[i]));
                facing = v3_add(facing, s->normals[m->points[c[i]]]);
            }
            write_texel(f, texel, p, facing);
        }
}

static enum status bake(struct texture_atlas *a, const struct point_grid *grid,
                        const struct vertex_colors *vertex_colors, int threads)
{
    struct texel_bake f = {.atlas = a, .vertex_colors = vertex_colors, .grid = grid};
    size_t texels = (size_t)a->mesh.width * (size_t)a->mesh.height;
    enum status status = OK;
    a->color = calloc(texels, 3);
    a->seen_time = calloc(texels, 4);
    f.owner = malloc(sizeof *f.owner * texels);
    f.off = malloc(sizeof *f.off * texels);
    if (a->color && a->seen_time && f.owner && f.off) {
        for (size_t i = 0; i < texels; i++)
            f.owner[i] = -1, f.off[i] = INFINITY;
        assign_texels(&f);
        parallel_for(threads, (a->mesh.height + ROWS - 1) / ROWS, write_rows, &f);
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

static void coarse_mesh_free(struct coarse_mesh *c)
{
    free(c->corners);
    free(c->points);
    free(c->normals);
    free(c->moves);
    free(c->weights);
}

// Area-weighted.
static void find_normals(struct coarse_mesh *c, int point_count)
{
    for (int i = 0; i < point_count; i++)
        c->normals[i] = v3(0, 0, 0);
    for (int t = 0; t < c->corner_count; t += 3) {
        const int32_t *at = c->corners + t;
        const struct vec3 p = c->points[at[0]],
                          doubled = v3_cross(v3_sub(c->points[at[1]], p), v3_sub(c->points[at[2]], p));
        for (int i = 0; i < 3; i++)
            c->normals[at[i]] = v3_add(c->normals[at[i]], doubled);
    }
    for (int i = 0; i < point_count; i++)
        c->normals[i] = v3_unit(c->normals[i]);
}

// Samples how far a triangle lies from the fine surface, and distributes it to its corners by barycentric coordinates.
static void measure_triangle(struct coarse_mesh *c, const struct point_grid *f, const int32_t *at)
{
    const struct vec3 *p = c->points, *n = c->normals;
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
            const int32_t nearest = nearest_point(f, at_sample, facing);
            if (nearest < 0)
                continue;
            double off = v3_dot(f->surface->normals[nearest], v3_sub(f->surface->points[nearest], at_sample));
            for (int k = 0; k < 3; k++) {
                c->moves[at[k]] += share[k] * area * off;
                c->weights[at[k]] += share[k] * area;
            }
        }
}

// The corners of the simplified mesh lie on the fine surface, so on a round limb the triangles between them lie inside
// it and the limb would be drawn too thin. The corners move along their normals until as much of each triangle lies
// outside as inside.
static void refit(struct coarse_mesh *c, const struct point_grid *f)
{
    const int count = f->surface->point_count;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        find_normals(c, count);
        for (int i = 0; i < count; i++)
            c->moves[i] = c->weights[i] = 0;
        for (int t = 0; t < c->corner_count; t += 3)
            measure_triangle(c, f, c->corners + t);
        for (int i = 0; i < count; i++)
            if (c->weights[i] > 0)
                c->points[i] = v3_add(c->points[i], v3_scale(c->normals[i], c->moves[i] / c->weights[i]));
    }
    find_normals(c, count);
}

static enum status coarse_mesh_make(struct coarse_mesh *c, const struct surface_mesh *s)
{
    const size_t count = (size_t)s->point_count;
    float(*points)[3] = malloc(sizeof *points * count);
    *c = (struct coarse_mesh){.corners = malloc(sizeof *c->corners * (size_t)s->corner_count),
                              .points = malloc(sizeof *c->points * count),
                              .normals = malloc(sizeof *c->normals * count),
                              .moves = malloc(sizeof *c->moves * count),
                              .weights = malloc(sizeof *c->weights * count)};
    if (!points || !c->corners || !c->points || !c->normals || !c->moves || !c->weights) {
        free(points);
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    memcpy(c->points, s->points, sizeof *c->points * count);
    for (size_t i = 0; i < count; i++) {
        points[i][0] = (float)s->points[i].x;
        points[i][1] = (float)s->points[i].y;
        points[i][2] = (float)s->points[i].z;
    }
    const struct simplify_mesh full = {(const float(*)[3])points, s->corners, s->point_count, s->corner_count};
    c->corner_count = mesh_simplify(&full, 3 * TRIANGLES, (float)ERROR_M, c->corners);
    free(points);
    return OK;
}

static enum status unwrap_coarse(struct texture_atlas *a, const struct surface_mesh *s, const struct coarse_mesh *c)
{
    double texel_m = TEXEL_M;
    enum status status;
    do
        status = uv_unwrap(&a->mesh, s, c->corners, c->corner_count, texel_m);
    while (status == ERR_INPUT && (texel_m *= COARSER) < TEXEL_MOST_M);
    if (status != OK)
        return status;
    const struct uv_mesh *m = &a->mesh;
    a->points = malloc(sizeof *a->points * (size_t)m->point_count);
    a->normals = malloc(sizeof *a->normals * (size_t)m->point_count);
    if (!a->points || !a->normals)
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    for (int i = 0; i < m->point_count; i++) {
        a->points[i] = c->points[m->points[i]];
        a->normals[i] = c->normals[m->points[i]];
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
        refit(&coarse, &grid);
        status = unwrap_coarse(out, s, &coarse);
    }
    if (status == OK)
        status = bake(out, &grid, vertex_colors, threads);
    coarse_mesh_free(&coarse);
    point_grid_close(&grid);
    if (status != OK)
        texture_atlas_free(out);
    return status;
}

void texture_atlas_free(struct texture_atlas *a)
{
    uv_mesh_free(&a->mesh);
    free(a->points);
    free(a->normals);
    free(a->color);
    free(a->seen_time);
    *a = (struct texture_atlas){0};
}
