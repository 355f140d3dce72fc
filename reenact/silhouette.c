#include "reenact/silhouette.h"

#include <stdlib.h>

struct spot {
    float x, y, z;
};

struct silhouette {
    const struct likeness *likeness;
    struct spot *rest, *now; // of each point; camera axes
    uint8_t *front;           // of each triangle: is it seen from its outside?
};

enum status silhouette_open(struct silhouette **out, const struct likeness *likeness)
{
    const struct unfolded *m = &likeness->atlas.mesh;
    struct silhouette *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->likeness = likeness;
    s->rest = malloc(sizeof *s->rest * (size_t)m->point_count);
    s->now = malloc(sizeof *s->now * (size_t)m->point_count);
    s->front = malloc((size_t)m->corner_count / 3);
    if (!s->rest || !s->now || !s->front) {
        silhouette_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int i = 0; i < m->point_count; i++) {
        const struct vec3 *p = &likeness->surface.points[m->points[i]];
        s->rest[i] = (struct spot){(float)p->x, (float)p->y, (float)p->z};
    }
    return OK;
}

void silhouette_close(struct silhouette **s)
{
    if (!*s)
        return;
    free((*s)->rest);
    free((*s)->now);
    free((*s)->front);
    free(*s);
    *s = NULL;
}

int silhouette_most(const struct silhouette *s) { return 6 * s->likeness->atlas.mesh.corner_count; }

static void place_points(struct silhouette *s, const struct part_map *maps, float (*shift)[3])
{
    const struct unfolded *m = &s->likeness->atlas.mesh;
    for (int i = 0; i < m->point_count; i++) {
        const struct skin *skin = &s->likeness->skins[m->points[i]];
        const struct spot p = {s->rest[i].x + shift[i][0], s->rest[i].y + shift[i][1], s->rest[i].z + shift[i][2]};
        float at[3] = {0};
        for (int k = 0; k < SKIN_PARTS; k++)
            for (int r = 0; r < 3; r++) {
                const float *row = maps[skin->part[k]].row[r];
                at[r] += skin->weight[k] * (row[0] * p.x + row[1] * p.y + row[2] * p.z + row[3]);
            }
        s->now[i] = (struct spot){at[0], at[1], at[2]};
    }
}

int silhouette_find(struct silhouette *s, const struct part_map *viewer_from_part, float (*shift)[3],
                    uint16_t *out)
{
    const struct unfolded *m = &s->likeness->atlas.mesh;
    place_points(s, viewer_from_part, shift);
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        const struct spot a = s->now[c[0]], b = s->now[c[1]], d = s->now[c[2]];
        s->front[t] = a.x * (b.y * d.z - b.z * d.y) + a.y * (b.z * d.x - b.x * d.z) + a.z * (b.x * d.y - b.y * d.x) < 0;
    }
    int count = 0;
    for (int i = 0; i < m->corner_count; i++) {
        int32_t other = m->beside[i / 3][i % 3];
        if (!s->front[i / 3] || (other >= 0 && s->front[other]))
            continue;
        const int a = m->corners[i], b = m->corners[i % 3 == 2 ? i - 2 : i + 1];
        const int ribbon[6] = {a, b, m->point_count + b, a, m->point_count + b, m->point_count + a};
        for (int k = 0; k < 6; k++)
            out[count++] = (uint16_t)ribbon[k];
    }
    return count;
}
