// Skinning, front faces and silhouette ribbon of the avatar's mesh.
#include "reenact/render/silhouette_edges.h"

#include <stdlib.h>

typedef float float4 __attribute__((vector_size(16))); // x, y, z in one SIMD register

enum { RIBBON = 6 }; // corners for each edge

static const float NEAR_PLANE_M = 0.05F; // with points nearer than this the bounds are infinite

struct silhouette_edges {
    const struct avatar *avatar;
    struct point3f *bind_points, *placed; // [point]: bind pose axes, camera axes
    uint8_t *front;                       // [triangle]: drawn and facing the viewer
    uint16_t *corners;
};

enum status silhouette_edges_open(struct silhouette_edges **out, const struct avatar *avatar)
{
    const struct uv_mesh *m = &avatar->atlas.mesh;
    struct silhouette_edges *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->avatar = avatar;
    s->bind_points = malloc(sizeof *s->bind_points * (size_t)m->point_count);
    s->placed = malloc(sizeof *s->placed * (size_t)m->point_count);
    s->front = malloc((size_t)m->corner_count / 3);
    s->corners = malloc(sizeof *s->corners * (size_t)silhouette_edges_most(s));
    if (!s->bind_points || !s->placed || !s->front || !s->corners) {
        silhouette_edges_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int i = 0; i < m->point_count; i++) {
        const struct vec3 *p = &avatar->atlas.points[i];
        s->bind_points[i] = (struct point3f){(float)p->x, (float)p->y, (float)p->z};
    }
    return OK;
}

void silhouette_edges_close(struct silhouette_edges **s)
{
    if (!*s)
        return;
    free((*s)->bind_points);
    free((*s)->placed);
    free((*s)->front);
    free((*s)->corners);
    free(*s);
    *s = NULL;
}

int silhouette_edges_most(const struct silhouette_edges *s)
{
    return (1 + RIBBON) * s->avatar->atlas.mesh.corner_count;
}

static struct point3f shifted(struct point3f p, const float shift[3])
{
    return (struct point3f){p.x + shift[0], p.y + shift[1], p.z + shift[2]};
}

static struct point3f difference(struct point3f a, struct point3f b)
{
    return (struct point3f){b.x - a.x, b.y - a.y, b.z - a.z};
}

// A bone's affine map by columns: what x, y, z and 1 of the bind pose add to x, y and z in camera axes.
struct map_columns {
    float4 column[4];
};

static struct map_columns columns_of(const struct affine_map *map)
{
    struct map_columns columns;
    for (int c = 0; c < 4; c++)
        columns.column[c] = (float4){map->row[0][c], map->row[1][c], map->row[2][c], 0};
    return columns;
}

static struct point3f skinned(const struct skin_weights *skin, const struct map_columns *maps, struct point3f p)
{
    float4 at = {0};
    for (int k = 0; k < SKIN_BONES; k++) {
        if (!(skin->weight[k] > 0))
            continue;
        const float4 *column = maps[skin->bone[k]].column;
        at += skin->weight[k] * (column[0] * p.x + column[1] * p.y + column[2] * p.z + column[3]);
    }
    return (struct point3f){at[0], at[1], at[2]};
}

// Front-facing triangles that are own (wanted), or those that are not.
static int put_front(const struct silhouette_edges *s, const bool *own, bool wanted, uint16_t *out)
{
    const struct uv_mesh *m = &s->avatar->atlas.mesh;
    int count = 0;
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        for (int k = 0; k < 3 && s->front[t] && own[t] == wanted; k++)
            out[count++] = (uint16_t)c[k];
    }
    return count;
}

// Whether the back-facing triangle `away` lies behind the plane of its front-facing neighbour. If it lies before it,
// the edge between them is in a fold that the surface itself hides.
static bool bends_back(const struct silhouette_edges *s, int front, int away)
{
    const int32_t *c = s->avatar->atlas.mesh.corners + 3 * (size_t)front,
                  *o = s->avatar->atlas.mesh.corners + 3 * (size_t)away;
    const struct point3f a = s->placed[c[0]], u = difference(a, s->placed[c[1]]), v = difference(a, s->placed[c[2]]);
    const struct point3f n = {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
    float out = 0; // the two corners on the edge add 0
    for (int k = 0; k < 3; k++) {
        const struct point3f to = difference(a, s->placed[o[k]]);
        out += n.x * to.x + n.y * to.y + n.z * to.z;
    }
    return out < 0;
}

static int put_ribbon(const struct silhouette_edges *s, uint16_t *out)
{
    const struct uv_mesh *m = &s->avatar->atlas.mesh;
    int count = 0;
    for (int i = 0; i < m->corner_count; i++) {
        int32_t other = m->neighbor[i / 3][i % 3];
        if (!s->front[i / 3] || (other >= 0 && (s->front[other] || !bends_back(s, i / 3, other))))
            continue;
        const int a = m->corners[i], b = m->corners[i % 3 == 2 ? i - 2 : i + 1];
        const int ribbon[RIBBON] = {a, b, m->point_count + b, a, m->point_count + b, m->point_count + a};
        for (int k = 0; k < RIBBON; k++)
            out[count++] = (uint16_t)ribbon[k];
    }
    return count;
}

// Drops triangles with more than half of their skin weight on absent parts.
static void cull_absent(struct silhouette_edges *s, const bool *absent)
{
    const struct uv_mesh *m = &s->avatar->atlas.mesh;
    for (int t = 0; t < m->corner_count / 3; t++) {
        float sum = 0; // over three corners
        for (int i = 0; i < 3 * SKIN_BONES; i++) {
            const struct skin_weights *skin = &s->avatar->skins[m->points[m->corners[3 * t + i / SKIN_BONES]]];
            sum += absent[bone_part(skin->bone[i % SKIN_BONES])] ? skin->weight[i % SKIN_BONES] : 0;
        }
        s->front[t] = s->front[t] && sum <= 1.5F;
    }
}

static void find_bounds(const struct silhouette_edges *s, struct silhouette_corners *out)
{
    out->low[0] = out->low[1] = INFINITY;
    out->high[0] = out->high[1] = -INFINITY;
    float nearest = INFINITY;
    for (int i = 0; i < s->avatar->atlas.mesh.point_count; i++) {
        const struct point3f p = s->placed[i];
        const float at[2] = {p.x / p.z, p.y / p.z};
        nearest = fminf(nearest, p.z);
        for (int a = 0; a < 2; a++) {
            out->low[a] = fminf(out->low[a], at[a]);
            out->high[a] = fmaxf(out->high[a], at[a]);
        }
    }
    if (nearest < NEAR_PLANE_M)
        out->low[0] = -INFINITY;
}

struct silhouette_corners silhouette_edges_find(struct silhouette_edges *s, const struct affine_map *viewer_from_bone,
                                                float (*shift)[3], const bool *own, const bool *absent)
{
    const struct uv_mesh *m = &s->avatar->atlas.mesh;
    struct map_columns maps[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        maps[b] = columns_of(&viewer_from_bone[b]);
    for (int i = 0; i < m->point_count; i++)
        s->placed[i] = skinned(&s->avatar->skins[m->points[i]], maps, shifted(s->bind_points[i], shift[i]));
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        const struct point3f a = s->placed[c[0]], b = s->placed[c[1]], d = s->placed[c[2]];
        s->front[t] = a.x * (b.y * d.z - b.z * d.y) + a.y * (b.z * d.x - b.x * d.z) + a.z * (b.x * d.y - b.y * d.x) < 0;
    }
    bool all = true;
    for (int p = 0; p < PART_COUNT; p++)
        all = all && !absent[p];
    if (!all)
        cull_absent(s, absent);
    struct silhouette_corners out = {.corners = s->corners, .placed = s->placed};
    find_bounds(s, &out);
    out.own = put_front(s, own, true, s->corners);
    out.front = out.own + put_front(s, own, false, s->corners + out.own);
    out.ribbon = put_ribbon(s, s->corners + out.front);
    return out;
}
