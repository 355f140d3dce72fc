#include "reenact/avatar/uv_unwrap.h"

#include <stdlib.h>
#include <string.h>

enum { GROUND = 1024, MOST_SIDE = 1280 };

static const double LEAST_FACING = 0.5, SEED_FACING = 0.8; // cosines between a triangle's normal and its sheet's
static const double INSIDE = 1e-3;                         // of a triangle's area: less is its edge

// A part of the surface, and the plane that it is laid on: texels are numbered across and along.
struct sheet {
    struct vec3 across, along, up; // unit
    int left, top, width, height;  // of its texels, the margin included
    int x, y;                      // where it comes to lie in the picture
    int32_t first, count;          // of its triangles in `order`
};

struct cutter {
    const struct surface *surface;
    const int32_t *corners;
    int triangles;
    double texel_m;
    struct vec3 *facing;       // of each triangle
    int32_t (*beside)[3];      // as unfolded has it
    int32_t *sheet_of;         // of each triangle; -1: none yet
    int32_t *order;            // triangles, sheet by sheet
    int32_t (*ground)[GROUND]; // the last sheet that took this texel, wrapped round; -1: none
    struct sheet *sheets;
    int32_t sheet_count, placed; // placed: triangles that lie in a sheet
};

// ---------------------------------------------------------------- neighbours

struct edge {
    int32_t low, high, triangle, side;
};

static int by_ends(const void *a, const void *b)
{
    const struct edge *p = a, *q = b;
    if (p->low != q->low)
        return p->low < q->low ? -1 : 1;
    if (p->high != q->high)
        return p->high < q->high ? -1 : 1;
    return (p->triangle > q->triangle) - (p->triangle < q->triangle);
}

static enum status find_neighbours(struct cutter *c)
{
    struct edge *edges = malloc(sizeof *edges * 3 * (size_t)c->triangles);
    if (!edges)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < 3 * c->triangles; i++) {
        int32_t a = c->corners[i], b = c->corners[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = (struct edge){a < b ? a : b, a < b ? b : a, i / 3, i % 3};
        c->beside[i / 3][i % 3] = -1;
    }
    qsort(edges, 3 * (size_t)c->triangles, sizeof *edges, by_ends);
    for (int i = 0; i + 1 < 3 * c->triangles; i++) {
        const struct edge *a = &edges[i], *b = &edges[i + 1];
        if (a->low != b->low || a->high != b->high)
            continue;
        c->beside[a->triangle][a->side] = b->triangle;
        c->beside[b->triangle][b->side] = a->triangle;
        i++;
    }
    free(edges);
    return OK;
}

// ---------------------------------------------------------------- sheets

static void flat(const struct cutter *c, const struct sheet *s, int32_t point, double at[2])
{
    struct vec3 p = c->surface->points[point];
    at[0] = v3_dot(p, s->across) / c->texel_m;
    at[1] = v3_dot(p, s->along) / c->texel_m;
}

// Takes the texels whose centres lie in the triangle; false: the sheet has one of them already, and none is taken.
static bool take_ground(struct cutter *c, const struct sheet *s, int32_t number, int32_t triangle)
{
    double q[3][2], low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        flat(c, s, c->corners[3 * triangle + i], q[i]);
        for (int k = 0; k < 2; k++)
            low[k] = fmin(low[k], q[i][k]), high[k] = fmax(high[k], q[i][k]);
    }
    double area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
    if (area == 0)
        return true;
    for (int taking = 0; taking < 2; taking++)
        for (int y = (int)ceil(low[1]); y <= (int)floor(high[1]); y++)
            for (int x = (int)ceil(low[0]); x <= (int)floor(high[0]); x++) {
                double u = ((q[1][0] - x) * (q[2][1] - y) - (q[1][1] - y) * (q[2][0] - x)) / area;
                double v = ((q[2][0] - x) * (q[0][1] - y) - (q[2][1] - y) * (q[0][0] - x)) / area;
                if (u < INSIDE || v < INSIDE || 1 - u - v < INSIDE)
                    continue;
                int32_t *at = &c->ground[y & (GROUND - 1)][x & (GROUND - 1)];
                if (*at == number && !taking)
                    return false;
                *at = number;
            }
    return true;
}

// From one triangle on, over all that hang together with it and face much the same way.
static void grow_sheet(struct cutter *c, int32_t seed, struct vec3 up)
{
    int32_t number = c->sheet_count++;
    struct sheet *s = &c->sheets[number];
    struct vec3 aside = fabs(up.y) < 0.7 ? v3(0, 1, 0) : v3(1, 0, 0);
    *s = (struct sheet){.up = up, .across = v3_unit(v3_cross(aside, up)), .first = c->placed};
    s->along = v3_cross(up, s->across);
    c->sheet_of[seed] = number;
    c->order[c->placed++] = seed;
    take_ground(c, s, number, seed);
    for (int32_t at = s->first; at < c->placed; at++)
        for (int side = 0; side < 3; side++) {
            int32_t next = c->beside[c->order[at]][side];
            if (next < 0 || c->sheet_of[next] >= 0 || v3_dot(c->facing[next], up) < LEAST_FACING ||
                !take_ground(c, s, number, next))
                continue;
            c->sheet_of[next] = number;
            c->order[c->placed++] = next;
        }
    s->count = c->placed - s->first;
}

// First what faces front, back and aside, which makes few large sheets; then what is left.
static void cut(struct cutter *c)
{
    const struct vec3 main[] = {v3(0, 0, -1), v3(0, 0, 1), v3(1, 0, 0), v3(-1, 0, 0), v3(0, -1, 0), v3(0, 1, 0)};
    for (size_t m = 0; m < COUNT_OF(main); m++)
        for (int32_t t = 0; t < c->triangles; t++)
            if (c->sheet_of[t] < 0 && v3_dot(c->facing[t], main[m]) > SEED_FACING)
                grow_sheet(c, t, main[m]);
    for (int32_t t = 0; t < c->triangles; t++)
        if (c->sheet_of[t] < 0)
            grow_sheet(c, t, c->facing[t]);
    for (int32_t i = 0; i < c->sheet_count; i++) {
        struct sheet *s = &c->sheets[i];
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, at[2];
        for (int32_t k = 0; k < 3 * s->count; k++) {
            flat(c, s, c->corners[3 * c->order[s->first + k / 3] + k % 3], at);
            for (int e = 0; e < 2; e++)
                low[e] = fmin(low[e], at[e]), high[e] = fmax(high[e], at[e]);
        }
        s->left = (int)floor(low[0]) - UNFOLD_MARGIN / 2, s->top = (int)floor(low[1]) - UNFOLD_MARGIN / 2;
        s->width = (int)ceil(high[0]) - s->left + UNFOLD_MARGIN / 2;
        s->height = (int)ceil(high[1]) - s->top + UNFOLD_MARGIN / 2;
    }
}

// ---------------------------------------------------------------- side by side

// In rows, the highest sheets first. ERR_INPUT: too large.
static enum status pack(struct cutter *c, struct unfolded *out)
{
    int highest = 0, row_height = 0, x = 0, y = 0;
    double area = 0;
    for (int32_t i = 0; i < c->sheet_count; i++) {
        struct sheet *s = &c->sheets[i];
        if (s->width > GROUND || s->height > GROUND)
            return fail(ERR_INPUT, "the person is too large to be laid out flat");
        area += (double)s->width * s->height;
        highest = s->height > highest ? s->height : highest;
        out->width = s->width > out->width ? s->width : out->width;
    }
    while ((double)out->width * out->width < area)
        out->width++;
    for (int height = highest; height > 0; height--)
        for (int32_t i = 0; i < c->sheet_count; i++) {
            struct sheet *s = &c->sheets[i];
            if (s->height != height)
                continue;
            if (x + s->width > out->width)
                x = 0, y += row_height, row_height = 0;
            s->x = x, s->y = y;
            x += s->width;
            row_height = row_height ? row_height : height;
        }
    out->height = y + row_height;
    return out->width <= MOST_SIDE && out->height <= MOST_SIDE
               ? OK
               : fail(ERR_INPUT, "the person is too large to be laid out flat");
}

// number: of each of the surface's points, in the sheet at hand; made here.
static void put_points(const struct cutter *c, struct unfolded *out, int32_t *number)
{
    for (int32_t i = 0; i < c->sheet_count; i++) {
        const struct sheet *s = &c->sheets[i];
        int before = out->point_count;
        for (int32_t k = 0; k < 3 * s->count; k++) {
            int32_t triangle = c->order[s->first + k / 3], point = c->corners[3 * triangle + k % 3];
            if (number[point] < before) {
                double at[2];
                flat(c, s, point, at);
                number[point] = out->point_count;
                out->points[out->point_count] = point;
                out->at[out->point_count][0] = (float)(at[0] - s->left + s->x + 0.5);
                out->at[out->point_count++][1] = (float)(at[1] - s->top + s->y + 0.5);
            }
            out->corners[3 * triangle + k % 3] = number[point];
        }
    }
    out->corner_count = 3 * c->triangles;
}

static enum status unfold_with(struct cutter *c, struct unfolded *out, int32_t *number)
{
    for (int32_t t = 0; t < c->triangles; t++) {
        const struct vec3 *p = c->surface->points;
        const int32_t *q = c->corners + 3 * (size_t)t;
        c->facing[t] = v3_unit(v3_cross(v3_sub(p[q[1]], p[q[0]]), v3_sub(p[q[2]], p[q[0]])));
        c->sheet_of[t] = -1;
    }
    for (int i = 0; i < GROUND * GROUND; i++)
        c->ground[i / GROUND][i % GROUND] = -1;
    for (int i = 0; i < c->surface->point_count; i++)
        number[i] = -1;
    enum status status = find_neighbours(c);
    if (status != OK)
        return status;
    cut(c);
    status = pack(c, out);
    if (status == OK)
        put_points(c, out, number);
    return status;
}

enum status unfold(struct unfolded *out, const struct surface *surface, const int32_t *corners, int corner_count,
                   double texel_m)
{
    size_t triangles = (size_t)corner_count / 3;
    struct cutter c = {.surface = surface,
                       .corners = corners,
                       .triangles = (int)triangles,
                       .texel_m = texel_m,
                       .facing = malloc(sizeof *c.facing * triangles),
                       .sheet_of = malloc(sizeof *c.sheet_of * triangles),
                       .order = malloc(sizeof *c.order * triangles),
                       .ground = malloc(sizeof *c.ground * GROUND),
                       .sheets = malloc(sizeof *c.sheets * triangles)};
    int32_t *number = malloc(sizeof *number * (size_t)surface->point_count);
    *out = (struct unfolded){.points = malloc(sizeof *out->points * 3 * triangles),
                             .at = malloc(sizeof *out->at * 3 * triangles),
                             .corners = malloc(sizeof *out->corners * 3 * triangles),
                             .beside = malloc(sizeof *out->beside * triangles)};
    c.beside = out->beside;
    enum status status = OK;
    if (!c.facing || !c.beside || !c.sheet_of || !c.order || !c.ground || !c.sheets || !number || !out->points ||
        !out->at || !out->corners)
        status = fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = unfold_with(&c, out, number);
    free(c.facing);
    free(c.sheet_of);
    free(c.order);
    free(c.ground);
    free(c.sheets);
    free(number);
    if (status != OK)
        unfolded_free(out);
    return status;
}

void unfolded_free(struct unfolded *u)
{
    free(u->points);
    free(u->at);
    free(u->corners);
    free(u->beside);
    *u = (struct unfolded){0};
}
