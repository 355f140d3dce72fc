#include "reenact/silhouette.h"

#include <stdlib.h>

struct spot {
    float x, y, z;
};

enum { RIBBON = 6 }; // corners for each edge

struct silhouette {
    const struct likeness *likeness;
    struct spot *rest, *normals, *placed; // of each point; the last in camera axes
    uint8_t *shared;                      // of each point: does it face the shown frame's camera?
    uint8_t *front;                       // of each triangle: does it face the viewer?
    uint16_t *corners;
};

enum status silhouette_open(struct silhouette **out, const struct likeness *likeness)
{
    const struct unfolded *m = &likeness->atlas.mesh;
    struct silhouette *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->likeness = likeness;
    s->rest = malloc(sizeof *s->rest * (size_t)m->point_count);
    s->normals = malloc(sizeof *s->normals * (size_t)m->point_count);
    s->placed = malloc(sizeof *s->placed * (size_t)m->point_count);
    s->shared = calloc((size_t)m->point_count, 1);
    s->front = malloc((size_t)m->corner_count / 3);
    s->corners = malloc(sizeof *s->corners * (size_t)silhouette_most(s));
    if (!s->rest || !s->normals || !s->placed || !s->shared || !s->front || !s->corners) {
        silhouette_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int i = 0; i < m->point_count; i++) {
        const struct vec3 *p = &likeness->surface.points[m->points[i]], *n = &likeness->atlas.normals[i];
        s->rest[i] = (struct spot){(float)p->x, (float)p->y, (float)p->z};
        s->normals[i] = (struct spot){(float)n->x, (float)n->y, (float)n->z};
    }
    return OK;
}

void silhouette_close(struct silhouette **s)
{
    if (!*s)
        return;
    free((*s)->rest);
    free((*s)->normals);
    free((*s)->placed);
    free((*s)->shared);
    free((*s)->front);
    free((*s)->corners);
    free(*s);
    *s = NULL;
}

int silhouette_most(const struct silhouette *s) { return (1 + RIBBON) * s->likeness->atlas.mesh.corner_count; }

static struct spot shifted(struct spot p, const float shift[3])
{
    return (struct spot){p.x + shift[0], p.y + shift[1], p.z + shift[2]};
}

// w: 1 for a place, 0 for a direction.
static struct spot skinned(const struct skin *skin, const struct part_map *maps, struct spot p, float w)
{
    float at[3] = {0};
    for (int k = 0; k < SKIN_PARTS; k++)
        for (int r = 0; r < 3; r++) {
            const float *row = maps[skin->part[k]].row[r];
            at[r] += skin->weight[k] * (row[0] * p.x + row[1] * p.y + row[2] * p.z + row[3] * w);
        }
    return (struct spot){at[0], at[1], at[2]};
}

void silhouette_set_shown(struct silhouette *s, const struct part_map *now_from_part, float (*shift)[3])
{
    const struct unfolded *m = &s->likeness->atlas.mesh;
    for (int i = 0; i < m->point_count; i++) {
        const struct skin *skin = &s->likeness->skins[m->points[i]];
        const struct spot p = skinned(skin, now_from_part, shifted(s->rest[i], shift[i]), 1),
                          n = skinned(skin, now_from_part, s->normals[i], 0);
        s->shared[i] = p.x * n.x + p.y * n.y + p.z * n.z < 0;
    }
}

// Puts the corners of the triangles that face the viewer: those that the shown frame may have seen, or the others.
static int put_front(const struct silhouette *s, bool shared, uint16_t *out)
{
    const struct unfolded *m = &s->likeness->atlas.mesh;
    int count = 0;
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        if (!s->front[t] || (s->shared[c[0]] || s->shared[c[1]] || s->shared[c[2]]) != shared)
            continue;
        for (int k = 0; k < 3; k++)
            out[count++] = (uint16_t)c[k];
    }
    return count;
}

static int put_ribbon(const struct silhouette *s, uint16_t *out)
{
    const struct unfolded *m = &s->likeness->atlas.mesh;
    int count = 0;
    for (int i = 0; i < m->corner_count; i++) {
        int32_t other = m->beside[i / 3][i % 3];
        if (!s->front[i / 3] || (other >= 0 && s->front[other]))
            continue;
        const int a = m->corners[i], b = m->corners[i % 3 == 2 ? i - 2 : i + 1];
        const int ribbon[RIBBON] = {a, b, m->point_count + b, a, m->point_count + b, m->point_count + a};
        for (int k = 0; k < RIBBON; k++)
            out[count++] = (uint16_t)ribbon[k];
    }
    return count;
}

struct silhouette_corners silhouette_find(struct silhouette *s, const struct part_map *viewer_from_part,
                                          float (*shift)[3])
{
    const struct unfolded *m = &s->likeness->atlas.mesh;
    for (int i = 0; i < m->point_count; i++)
        s->placed[i] = skinned(&s->likeness->skins[m->points[i]], viewer_from_part,
                               shifted(s->rest[i], shift[i]), 1);
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        const struct spot a = s->placed[c[0]], b = s->placed[c[1]], d = s->placed[c[2]];
        s->front[t] = a.x * (b.y * d.z - b.z * d.y) + a.y * (b.z * d.x - b.x * d.z) + a.z * (b.x * d.y - b.y * d.x) < 0;
    }
    struct silhouette_corners out = {.corners = s->corners};
    out.shared = put_front(s, true, s->corners);
    out.own = put_front(s, false, s->corners + out.shared);
    out.ribbon = put_ribbon(s, s->corners + out.shared + out.own);
    return out;
}
