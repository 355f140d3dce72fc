#include "tests/world/shadow.h"

#include "base/threads.h"
#include "tests/world/numbers.h"

#include <stdlib.h>
#include <string.h>

enum { MAP_SIDE = 192, POINTS_A_LAMP = 6, MAPS = LAMP_COUNT * POINTS_A_LAMP };

// One on each joint; an even number, for vectors of two, the last without size.
enum { SPHERES = JOINT_COUNT + (JOINT_COUNT & 1) };

static const float NO_FIGURE = 1e9F;

// A depth map of the figure from one point of a lamp, over a square of directions.
struct shadow_map {
    struct vec3 from, x, y, z; // z towards the figure
    double spread;             // half the square's side at z = 1
    float *depth;              // MAP_SIDE x MAP_SIDE, along z, or NO_FIGURE
    double low[2], high[2];    // nothing lies outside, in half sides at z = 1 from the middle
    float weight[3];           // radiance * area / samples / pi
};

struct shadow_bounds { // a rectangle on a surface
    double u0, v0, u1, v1;
};

struct shadow {
    const struct world_scene *scene;
    struct shadow_map maps[MAPS];
    struct shadow_bounds bounds[MAX_SURFACES];
    double sphere_x[SPHERES], sphere_y[SPHERES], sphere_z[SPHERES], sphere_radius[SPHERES];
    const struct mesh *mesh;
    const struct vec3 *at;
    struct vec3 *in_map; // for each map, `at` in its texels, and along its z; while the maps are made
    struct vec3 middle;
    double radius;
};

static void splat(struct shadow_map *m, const struct vec3 *p, const struct vec3 *q, const struct vec3 *r)
{
    const double x[3] = {p->x, q->x, r->x}, y[3] = {p->y, q->y, r->y}, z[3] = {p->z, q->z, r->z};
    double area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
    if (!(fabs(area) > 1e-12))
        return;
    const double sign = area > 0 ? 1 : -1;
    int x0 = ceil_int(most(0, least(x[0], least(x[1], x[2])) - 0.5)),
        x1 = floor_int(least(MAP_SIDE - 1, most(x[0], most(x[1], x[2])) - 0.5));
    int y0 = ceil_int(most(0, least(y[0], least(y[1], y[2])) - 0.5)),
        y1 = floor_int(least(MAP_SIDE - 1, most(y[0], most(y[1], y[2])) - 0.5));
    for (int j = y0; j <= y1; j++)
        for (int i = x0; i <= x1; i++) {
            double px = i + 0.5, py = j + 0.5;
            const double area_a = (x[1] - px) * (y[2] - py) - (y[1] - py) * (x[2] - px),
                         area_b = (x[2] - px) * (y[0] - py) - (y[2] - py) * (x[0] - px);
            if (area_a * sign < 0 || area_b * sign < 0) // before dividing: most end here
                continue;
            double a = area_a / area, b = area_b / area, c = 1 - a - b;
            if (c < 0)
                continue;
            float d = (float)(a * z[0] + b * z[1] + c * z[2]);
            float *to = &m->depth[j * MAP_SIDE + i];
            *to = minf(*to, d);
        }
}

// Sets low and high: a bilinear sample outside them touches no texel that is covered.
static void find_extent(struct shadow_map *m)
{
    int x0 = MAP_SIDE, x1 = -1, y0 = MAP_SIDE, y1 = -1;
    for (int j = 0; j < MAP_SIDE; j++)
        for (int i = 0; i < MAP_SIDE; i++)
            if (m->depth[j * MAP_SIDE + i] < NO_FIGURE) {
                x0 = i < x0 ? i : x0, x1 = i > x1 ? i : x1;
                y0 = j < y0 ? j : y0, y1 = j;
            }
    const double texel = 2.0 / MAP_SIDE, rounding = 0.01;
    m->low[0] = (x0 - 0.5 - rounding) * texel - 1, m->high[0] = (x1 + 1.5 + rounding) * texel - 1;
    m->low[1] = (y0 - 0.5 - rounding) * texel - 1, m->high[1] = (y1 + 1.5 + rounding) * texel - 1;
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
        m->depth[i] = NO_FIGURE;
    struct vec3 *in = s->in_map + (size_t)index * (size_t)s->mesh->vertex_count;
    for (int i = 0; i < s->mesh->vertex_count; i++) {
        struct vec3 d = v3_sub(s->at[i], m->from);
        in[i].z = v3_dot(d, m->z);
        in[i].x = (v3_dot(d, m->x) / in[i].z / m->spread + 1) * MAP_SIDE / 2;
        in[i].y = (v3_dot(d, m->y) / in[i].z / m->spread + 1) * MAP_SIDE / 2;
    }
    for (int t = 0; t < s->mesh->triangle_count; t++) {
        const int *k = s->mesh->triangles[t];
        splat(m, &in[k[0]], &in[k[1]], &in[k[2]]);
    }
    find_extent(m);
}

// The share of a point's light that map m lets through, 0..1: bilinear over four texels.
static float passes(const struct shadow_map *m, struct vec3 at, double bias)
{
    struct vec3 d = v3_sub(at, m->from);
    double z = v3_dot(d, m->z);
    if (z < 0.1)
        return 1;
    const double right = v3_dot(d, m->x), down = v3_dot(d, m->y), half = z * m->spread;
    if (!(right > half * m->low[0] && right < half * m->high[0] && down > half * m->low[1] && down < half * m->high[1]))
        return 1;
    double x = (right / z / m->spread + 1) * MAP_SIDE / 2 - 0.5, y = (down / z / m->spread + 1) * MAP_SIDE / 2 - 0.5;
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
    struct vec3 *in_map = malloc(sizeof *in_map * MAPS * ((size_t)mesh->vertex_count + 1));
    if (!s || !depth || !in_map) {
        free(s);
        free(depth);
        free(in_map);
        return fail(ERR_MEMORY, "out of memory for the figure's shadow");
    }
    s->scene = scene;
    s->mesh = mesh;
    s->at = at;
    s->in_map = in_map;
    for (int j = 0; j < JOINT_COUNT; j++) {
        s->sphere_x[j] = joints->joint[j].x;
        s->sphere_y[j] = joints->joint[j].y;
        s->sphere_z[j] = joints->joint[j].z;
        s->sphere_radius[j] = j == JOINT_WAIST || j == JOINT_TORSO ? 0.16 : 0.09;
    }
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
    free(in_map);
    s->in_map = NULL;
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

bool shadow_reaches(const struct shadow *s, int surface, double u, double v, double around)
{
    const struct shadow_bounds *r = &s->bounds[surface];
    return u > r->u0 - around && u < r->u1 + around && v > r->v0 - around && v < r->v1 + around;
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
    double hidden[SPHERES];
    for (int j = 0; j < SPHERES; j++) {
        const double x = s->sphere_x[j] - at.x, y = s->sphere_y[j] - at.y, z = s->sphere_z[j] - at.z;
        const double d2 = x * x + y * y + z * z, r = s->sphere_radius[j];
        const double cosine = (x * normal.x + y * normal.y + z * normal.z) / sqrt(d2 + 1e-9);
        hidden[j] = least(0.75, most(0, cosine) * r * r / most(d2, most(r * r, 1e-9)));
    }
    float sky = 1;
    for (int j = 0; j < JOINT_COUNT; j++)
        sky *= 1 - (float)hidden[j];
    *ambient = sky;
}
