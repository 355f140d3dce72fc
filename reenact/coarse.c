#include "reenact/coarse.h"

#include <stdlib.h>
#include <string.h>

static const double CUBE_M = 2 * VOLUME_STEP_M;

struct group {
    struct vec3 sum; // of its points
    float color[3];  // likewise
    int count, colors;
    int32_t point;   // the one nearest to the mean, which stands for all
    double off2;     // how far from it, squared
    int32_t number;  // in the list
};

static bool same_cube(struct vec3 a, struct vec3 b)
{
    return floor(a.x / CUBE_M) == floor(b.x / CUBE_M) && floor(a.y / CUBE_M) == floor(b.y / CUBE_M) &&
           floor(a.z / CUBE_M) == floor(b.z / CUBE_M);
}

static int32_t root_of(int32_t *parent, int32_t i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

// Afterwards parent[i] is the lowest point of i's group.
static void unite(const struct surface *s, int32_t *parent)
{
    for (int i = 0; i < s->point_count; i++)
        parent[i] = i;
    for (int c = 0; c < s->corner_count; c++) {
        int32_t a = s->corners[c], b = s->corners[c % 3 == 2 ? c - 2 : c + 1];
        if (!same_cube(s->points[a], s->points[b]))
            continue;
        a = root_of(parent, a), b = root_of(parent, b);
        parent[a > b ? a : b] = a > b ? b : a;
    }
    for (int i = 0; i < s->point_count; i++)
        parent[i] = root_of(parent, i);
}

// groups: zeroed, one for each point, used at the lowest of each group.
static void choose_points(struct coarse *out, const struct surface *s, const struct coat *coat, const int32_t *parent,
                          struct group *groups)
{
    for (int i = 0; i < s->point_count; i++) {
        struct group *g = &groups[parent[i]];
        g->sum = v3_add(g->sum, s->points[i]);
        g->off2 = INFINITY;
        g->count++;
    }
    for (int i = 0; i < s->point_count; i++) {
        struct group *g = &groups[parent[i]];
        struct vec3 off = v3_sub(s->points[i], v3_scale(g->sum, 1.0 / g->count));
        if (v3_dot(off, off) < g->off2)
            g->off2 = v3_dot(off, off), g->point = i;
    }
    for (int i = 0; i < s->point_count; i++) { // what is guessed does not colour what was seen
        struct group *g = &groups[parent[i]];
        if (coat->filled[i] != coat->filled[g->point])
            continue;
        for (int c = 0; c < 3; c++)
            g->color[c] += coat->color[i][c];
        g->colors++;
    }
    for (int i = 0; i < s->point_count; i++) {
        struct group *g = &groups[i];
        if (parent[i] != i)
            continue;
        for (int c = 0; c < 3; c++)
            out->color[out->point_count][c] = g->color[c] / (float)g->colors;
        g->number = out->point_count;
        out->points[out->point_count++] = g->point;
    }
}

enum status coarse_make(struct coarse *out, const struct surface *s, const struct coat *coat)
{
    size_t count = (size_t)s->point_count;
    int32_t *parent = malloc(sizeof *parent * count);
    struct group *groups = calloc(count, sizeof *groups);
    *out = (struct coarse){.points = malloc(sizeof *out->points * count),
                           .color = malloc(sizeof *out->color * count),
                           .corners = malloc(sizeof *out->corners * (size_t)s->corner_count)};
    enum status status = OK;
    if (parent && groups && out->points && out->color && out->corners) {
        unite(s, parent);
        choose_points(out, s, coat, parent, groups);
        for (int c = 0; c + 2 < s->corner_count; c += 3) {
            int32_t q[3];
            for (int i = 0; i < 3; i++)
                q[i] = groups[parent[s->corners[c + i]]].number;
            if (q[0] == q[1] || q[1] == q[2] || q[2] == q[0])
                continue;
            memcpy(out->corners + out->corner_count, q, sizeof q);
            out->corner_count += 3;
        }
    } else {
        status = fail(ERR_MEMORY, "out of memory");
        coarse_free(out);
    }
    free(parent);
    free(groups);
    return status;
}

void coarse_free(struct coarse *c)
{
    free(c->points);
    free(c->color);
    free(c->corners);
    *c = (struct coarse){0};
}
