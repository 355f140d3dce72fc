#include "tests/world/shadow.h"

#include "base/parallel.h"
#include "tests/world/numbers.h"

#include <stdlib.h>
#include <string.h>

enum { MAP_SIDE = 192, POINTS_A_LAMP = 6, MAPS = LAMP_COUNT * POINTS_A_LAMP };

// A depth map of the figure from one point of a lamp, over a square of directions.
struct shadow_map {
    struct vec3 from, x, y, z; // z towards the figure
    double spread;             // half the square's side at z = 1
    float *depth;              // MAP_SIDE x MAP_SIDE, along z; large: nothing
    float weight[3];           // radiance * area / samples / pi
};

struct shadow_bounds { // a rectangle on a surface
    double u0, v0, u1, v1;
};

struct shadow {
    const struct world_scene *scene;
    struct shadow_map maps[MAPS];
    struct shadow_bounds bounds[MAX_SURFACES];
    struct vec3 sphere[JOINT_COUNT];
    const struct mesh *mesh;
    const struct vec3 *at;
    struct vec3 middle;
    double radius;
};

static void splat(struct shadow_map *m, const struct vec3 p[3])
{
    double x[3], y[3], z[3];
    for (int i = 0; i < 3; i++) {
        struct vec3 d = v3_sub(p[i], m->from);
        z[i] = v3_dot(d, m->z);
        x[i] = (v3_dot(d, m->x) / z[i] / m->spread + 1) * MAP_SIDE / 2;
        y[i] = (v3_dot(d, m->y) / z[i] / m->spread + 1) * MAP_SIDE / 2;
    }
    double area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
    if (!(fabs(area) > 1e-12))
        return;
    int x0 = (int)most(0, ceil(least(x[0], least(x[1], x[2])) - 0.5)),
        x1 = (int)least(MAP_SIDE - 1, floor(most(x[0], most(x[1], x[2])) - 0.5));
    int y0 = (int)most(0, ceil(least(y[0], least(y[1], y[2])) - 0.5)),
        y1 = (int)least(MAP_SIDE - 1, floor(most(y[0], most(y[1], y[2])) - 0.5));
    for (int j = y0; j <= y1; j++)
        for (int i = x0; i <= x1; i++) {
            double px = i + 0.5, py = j + 0.5;
            double a = ((x[1] - px) * (y[2] - py) - (y[1] - py) * (x[2] - px)) / area;
            double b = ((x[2] - px) * (y[0] - py) - (y[2] - py) * (x[0] - px)) / area, c = 1 - a - b;
            if (a < 0 || b < 0 || c < 0)
                continue;
            float d = (float)(a * z[0] + b * z[1] + c * z[2]);
            float *to = &m->depth[j * MAP_SIDE + i];
            *to = minf(*to, d);
        }
}

static void fill_map(void *context, int index)
{
    struct shadow *s = context;
    struct shadow_map *m = &s->maps[index];
    const struct lamp *lamp = &scene_lamps[index / POINTS_A_LAMP];
    m->from = lamp_point(lamp, index % POINTS_A_LAMP, POINTS_A_LAMP);
    m->z = v3_unit(v3_sub(s->middle, m->from));
    m->x = v3_perpendicular(m->z);
    m->y = v3_cross(m->z, m->x);
    double distance = most(v3_distance(s->middle, m->from), s->radius * 1.05);
    m->spread = 1.06 * s->radius / sqrt(distance * distance - s->radius * s->radius);
    for (int c = 0; c < 3; c++)
        m->weight[c] = lamp->radiance[c] * (float)(lamp_area(lamp) / POINTS_A_LAMP / 3.14159265358979);
    for (int i = 0; i < MAP_SIDE * MAP_SIDE; i++)
        m->depth[i] = 1e9f;
    for (int t = 0; t < s->mesh->triangle_count; t++) {
        const int *k = s->mesh->triangles[t];
        struct vec3 p[3] = {s->at[k[0]], s->at[k[1]], s->at[k[2]]};
        splat(m, p);
    }
}

// The share of a point's light that map m lets through, 0..1: bilinear over four texels.
static float passes(const struct shadow_map *m, struct vec3 at, double bias)
{
    struct vec3 d = v3_sub(at, m->from);
    double z = v3_dot(d, m->z);
    if (z < 0.1)
        return 1;
    double x = (v3_dot(d, m->x) / z / m->spread + 1) * MAP_SIDE / 2 - 0.5,
           y = (v3_dot(d, m->y) / z / m->spread + 1) * MAP_SIDE / 2 - 0.5;
    if (!(x > 0 && y > 0 && x < MAP_SIDE - 1 && y < MAP_SIDE - 1))
        return 1;
    int i = (int)x, j = (int)y;
    float a = (float)(x - i), b = (float)(y - j), limit = (float)(z - bias);
    const float *p = &m->depth[j * MAP_SIDE + i];
    float top = (p[0] > limit ? 1 - a : 0) + (p[1] > limit ? a : 0);
    float low = (p[MAP_SIDE] > limit ? 1 - a : 0) + (p[MAP_SIDE + 1] > limit ? a : 0);
    return top * (1 - b) + low * b;
}

// Where on each surface the shadow of the figure's box may fall.
static void find_bounds(struct shadow *s, struct vec3 low, struct vec3 high)
{
    for (int f = 0; f < s->scene->surface_count; f++) {
        const struct room_surface *surface = &s->scene->surfaces[f];
        struct shadow_bounds r = {1e9, 1e9, -1e9, -1e9};
        for (int k = 0; k < MAPS + 1; k++)
            for (int i = 0; i < 8; i++) {
                struct vec3 p = v3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
                struct vec3 from = k < MAPS ? s->maps[k].from : p, to = v3_sub(p, surface->corner);
                double over = v3_dot(to, surface->normal),
                       lamp = v3_dot(v3_sub(from, surface->corner), surface->normal);
                double reach = 0.5; // of the ambient shadow around the feet
                if (k < MAPS) {
                    if (!(lamp > 1e-6))
                        continue;
                    // a corner above the lamp, as seen from the surface, has an unbounded shadow
                    double t = over < lamp - 1e-6 ? lamp / (lamp - over) : 1e3;
                    to = v3_sub(v3_add(from, v3_scale(v3_sub(p, from), t)), surface->corner);
                    reach = 0.02;
                } else if (fabs(over) > 0.5 && !(low.z < 0.5 && f == SIDE_FLOOR)) {
                    continue;
                }
                double u = v3_dot(to, surface->u), v = v3_dot(to, surface->v);
                r.u0 = least(r.u0, u - reach), r.u1 = most(r.u1, u + reach);
                r.v0 = least(r.v0, v - reach), r.v1 = most(r.v1, v + reach);
            }
        s->bounds[f] = r;
    }
}

enum status shadow_open(struct shadow **out, const struct world_scene *scene, const struct mesh *mesh,
                        const struct vec3 *at, const struct skeleton *joints, int threads)
{
    *out = NULL;
    struct shadow *s = calloc(1, sizeof *s);
    float *depth = malloc(sizeof(float) * MAPS * MAP_SIDE * MAP_SIDE);
    if (!s || !depth) {
        free(s);
        free(depth);
        return fail(ERR_MEMORY, "out of memory for the figure's shadow");
    }
    s->scene = scene;
    s->mesh = mesh;
    s->at = at;
    memcpy(s->sphere, joints->joint, sizeof s->sphere);
    struct vec3 low = v3(1e9, 1e9, 1e9), high = v3(-1e9, -1e9, -1e9);
    for (int i = 0; i < mesh->vertex_count; i++) {
        low = v3(least(low.x, at[i].x), least(low.y, at[i].y), least(low.z, at[i].z));
        high = v3(most(high.x, at[i].x), most(high.y, at[i].y), most(high.z, at[i].z));
    }
    s->middle = v3_mix(low, high, 0.5);
    for (int i = 0; i < mesh->vertex_count; i++)
        s->radius = most(s->radius, v3_distance(at[i], s->middle));
    for (int i = 0; i < MAPS; i++)
        s->maps[i].depth = depth + (size_t)i * MAP_SIDE * MAP_SIDE;
    parallel_for(threads, MAPS, fill_map, s);
    find_bounds(s, low, high);
    *out = s;
    return OK;
}

void shadow_close(struct shadow **s)
{
    if (*s) {
        free((*s)->maps[0].depth);
        free(*s);
        *s = NULL;
    }
}

void shadow_light(const struct shadow *s, struct vec3 at, struct vec3f normal, float out[3])
{
    struct vec3 n = v3((double)normal.x, (double)normal.y, (double)normal.z);
    out[0] = out[1] = out[2] = 0;
    for (int i = 0; i < MAPS; i++) {
        const struct shadow_map *m = &s->maps[i];
        struct vec3 to = v3_sub(m->from, at);
        double d2 = v3_dot(to, to), d = sqrt(d2), here = v3_dot(to, n) / d, lamp = to.z / d;
        if (!(here > 0) || !(lamp > 0))
            continue;
        // offset from the skin, the more where the light grazes it
        float share = passes(m, v3_add(at, v3_scale(n, 0.012)), 0.012 + 0.02 * (1 - here)) * (float)(here * lamp / d2);
        for (int c = 0; c < 3; c++)
            out[c] += m->weight[c] * share;
    }
}

bool shadow_reaches(const struct shadow *s, int surface, double u, double v)
{
    const struct shadow_bounds *r = &s->bounds[surface];
    return u > r->u0 && u < r->u1 && v > r->v0 && v < r->v1;
}

void shadow_on(const struct shadow *s, struct vec3 at, struct vec3 normal, float lost[3], float *ambient)
{
    lost[0] = lost[1] = lost[2] = 0;
    for (int i = 0; i < MAPS; i++) {
        const struct shadow_map *m = &s->maps[i];
        float stopped = 1 - passes(m, at, 0.02);
        if (!(stopped > 0))
            continue;
        struct vec3 to = v3_sub(m->from, at);
        double d2 = v3_dot(to, to), d = sqrt(d2), here = v3_dot(to, normal) / d, lamp = to.z / d;
        if (!(here > 0) || !(lamp > 0) || scene_blocked(s->scene, v3_add(at, v3_scale(normal, 0.004)), m->from))
            continue;
        for (int c = 0; c < 3; c++)
            lost[c] += m->weight[c] * stopped * (float)(here * lamp / d2);
    }
    // Spheres on the joints occlude the ambient light (Quilez: r^2 / d^2 times the cosine).
    float sky = 1;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 to = v3_sub(s->sphere[j], at);
        double d2 = v3_dot(to, to), r = j == JOINT_WAIST || j == JOINT_TORSO ? 0.16 : 0.09;
        double cosine = v3_dot(to, normal) / sqrt(d2 + 1e-9);
        if (cosine > 0)
            sky *= 1 - (float)least(0.75, cosine * r * r / most(d2, r * r));
    }
    *ambient = sky;
}
