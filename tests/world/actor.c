#include "tests/world/actor.h"

#include "base/threads.h"
#include "tests/world/numbers.h"
#include "tests/world/shadow.h"

#include <stdlib.h>
#include <string.h>

enum { CHUNK = 2048 }; // vertices per task

struct actor_sample {
    float z; // 0: nothing
    int triangle;
};

struct screen_corner { // a vertex in the image
    double x, y, z;
};

struct actor {
    const struct world *w;
    const struct mesh *mesh;
    struct posed posed;
    struct vec3 *at;       // world
    struct vec3f *normal;  // world
    float (*light)[3];     // irradiance / pi
    struct mesh caster;    // of shadows: the figure, or a mesh without triangles
    struct shadow *shadow; // NULL: not lit
    double low_z;          // of the lowest vertex

    struct screen_corner *corner;
    struct vec3 eye;
    int x0, y0, x1, y1;          // pixels
    struct actor_sample *centre; // (x1 - x0) x (y1 - y0)
    struct actor_sample *fine;   // the same, ACTOR_SAMPLES each; NULL: not asked for
};

// ---------------------------------------------------------------- pose and light

static void pose_chunk(void *context, int chunk)
{
    struct actor *a = context;
    int first = chunk * CHUNK, count = a->mesh->vertex_count - first;
    figure_pose(&a->w->figure, &a->posed, first, count < CHUNK ? count : CHUNK, a->at, a->normal);
}

static void light_chunk(void *context, int chunk)
{
    struct actor *a = context;
    int first = chunk * CHUNK, end = first + CHUNK < a->mesh->vertex_count ? first + CHUNK : a->mesh->vertex_count;
    for (int i = first; i < end; i++) {
        struct vec3f n = a->normal[i];
        float open = a->w->figure.bindings[i].open, up = 0.5f + 0.5f * n.z;
        float *out = a->light[i];
        shadow_light(a->shadow, a->at[i], n, out);
        // The floor reflects warm light, less of it on a surface that is close to it and faces down.
        float close_to_floor = minf(1, 0.45f + (float)a->at[i].z);
        float low = (1 - up) * close_to_floor;
        out[0] += open * (0.43f * up + 0.38f * low);
        out[1] += open * (0.43f * up + 0.33f * low);
        out[2] += open * (0.43f * up + 0.28f * low);
    }
}

enum status actor_open(struct actor **out, const struct world *w, double time_s, bool lit)
{
    *out = NULL;
    struct actor *a = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "out of memory for the figure");
    a->w = w;
    a->mesh = &w->figure.mesh;
    size_t n = (size_t)a->mesh->vertex_count;
    a->at = malloc(n * sizeof *a->at);
    a->normal = malloc(n * sizeof *a->normal);
    a->corner = malloc(n * sizeof *a->corner);
    a->light = lit ? malloc(n * sizeof *a->light) : NULL;
    if (!a->at || !a->normal || !a->corner || (lit && !a->light)) {
        actor_close(&a);
        return fail(ERR_MEMORY, "out of memory for the figure");
    }
    struct stance stance = world_stance(w, time_s);
    physique_pose(&w->physique, &stance, &a->posed);
    int chunks = (a->mesh->vertex_count + CHUNK - 1) / CHUNK;
    parallel_for(w->options.threads, chunks, pose_chunk, a);
    enum status status = OK;
    if (lit) {
        a->caster = *a->mesh;
        if (w->options.unshadowed)
            a->caster.triangle_count = 0;
        status = shadow_open(&a->shadow, &w->scene, &a->caster, a->at, &a->posed.joints, w->options.threads);
        if (!status)
            parallel_for(w->options.threads, chunks, light_chunk, a);
    }
    if (status)
        actor_close(&a);
    *out = a;
    return status;
}

void actor_close(struct actor **pa)
{
    struct actor *a = *pa;
    if (!a)
        return;
    shadow_close(&a->shadow);
    free(a->at);
    free(a->normal);
    free(a->light);
    free(a->corner);
    free(a->centre);
    free(a->fine);
    free(a);
    *pa = NULL;
}

// ---------------------------------------------------------------- drawing

enum status actor_aim(struct actor *a, const struct lens *lens, struct pose world_from_camera, bool fine)
{
    struct pose camera_from_world = pose_inverse(world_from_camera);
    double m[3][3];
    quat_to_matrix(camera_from_world.rotation, m);
    struct vec3 t = camera_from_world.translation;
    a->eye = world_from_camera.translation;
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
    for (int i = 0; i < a->mesh->vertex_count; i++) {
        struct vec3 p = a->at[i];
        struct vec3 c =
            v3(m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z + t.x, m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z + t.y,
               m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z + t.z);
        // Behind the camera, or so far aside that the distortion polynomial is invalid: not drawn.
        if (c.z < 0.05 || fabs(c.x) > 1.6 * c.z || fabs(c.y) > 1.6 * c.z) {
            a->corner[i] = (struct screen_corner){0, 0, 0};
            continue;
        }
        struct pixel px = lens_project(lens, c);
        a->corner[i] = (struct screen_corner){px.x, px.y, c.z};
        x0 = least(x0, px.x), x1 = most(x1, px.x);
        y0 = least(y0, px.y), y1 = most(y1, px.y);
    }
    a->x0 = (int)least(lens->width, most(0, floor(x0))), a->x1 = (int)most(a->x0, least(lens->width, ceil(x1) + 1));
    a->y0 = (int)least(lens->height, most(0, floor(y0))), a->y1 = (int)most(a->y0, least(lens->height, ceil(y1) + 1));
    size_t n = (size_t)(a->x1 - a->x0) * (size_t)(a->y1 - a->y0);
    a->centre = calloc(n + 1, sizeof *a->centre);
    a->fine = fine ? calloc(n * ACTOR_SAMPLES + 1, sizeof *a->fine) : NULL;
    if (!a->centre || (fine && !a->fine))
        return fail(ERR_MEMORY, "out of memory for the figure's image");
    return OK;
}

struct edges { // of a triangle in the image: the barycentric coordinate of each vertex is affine in x and y
    double a[3], b[3], c[3];
    double iz[3]; // 1 / z
};

static bool edges_of(const struct screen_corner *p, const struct screen_corner *q, const struct screen_corner *r,
                     struct edges *e)
{
    double area = (q->x - p->x) * (r->y - p->y) - (q->y - p->y) * (r->x - p->x);
    // y points down: anticlockwise from outside is clockwise in the image.
    if (!(area < -1e-9))
        return false;
    const struct screen_corner *v[3] = {p, q, r};
    for (int i = 0; i < 3; i++) {
        const struct screen_corner *m = v[(i + 1) % 3], *n = v[(i + 2) % 3];
        e->a[i] = (m->y - n->y) / area;
        e->b[i] = (n->x - m->x) / area;
        e->c[i] = (m->x * n->y - n->x * m->y) / area;
        e->iz[i] = 1 / v[i]->z;
    }
    return true;
}

// An image's samples, 2^log2_side along a pixel's side.
struct sample_grid {
    struct actor_sample *samples;
    int log2_side;
};

// Rasterises one triangle into the rows [first, end) of pixels.
static void rasterise(struct actor *a, int triangle, const struct edges *e, struct sample_grid grid, int first, int end)
{
    const int shift = grid.log2_side, side = 1 << shift, inner = side - 1;
    const int *t = a->mesh->triangles[triangle];
    const struct screen_corner *p = &a->corner[t[0]], *q = &a->corner[t[1]], *r = &a->corner[t[2]];
    double low_x = least(p->x, least(q->x, r->x)), high_x = most(p->x, most(q->x, r->x));
    double low_y = least(p->y, least(q->y, r->y)), high_y = most(p->y, most(q->y, r->y));
    // Sample s of a row is at x = x0 - 0.5 + (s + 0.5) / side.
    int s0 = ceil_int((low_x - a->x0 + 0.5) * side - 0.5), s1 = floor_int((high_x - a->x0 + 0.5) * side - 0.5);
    int r0 = ceil_int((low_y - a->y0 + 0.5) * side - 0.5), r1 = floor_int((high_y - a->y0 + 0.5) * side - 0.5);
    s0 = s0 > 0 ? s0 : 0;
    s1 = s1 < (a->x1 - a->x0) * side ? s1 : (a->x1 - a->x0) * side - 1;
    r0 = r0 > (first - a->y0) * side ? r0 : (first - a->y0) * side;
    r1 = r1 < (end - a->y0) * side ? r1 : (end - a->y0) * side - 1;
    for (int row = r0; row <= r1; row++) {
        double y = a->y0 - 0.5 + (row + 0.5) / side;
        for (int s = s0; s <= s1; s++) {
            double x = a->x0 - 0.5 + (s + 0.5) / side;
            double u = e->a[0] * x + e->b[0] * y + e->c[0], v = e->a[1] * x + e->b[1] * y + e->c[1];
            double w = 1 - u - v;
            if (u < 0 || v < 0 || w < 0)
                continue;
            float z = (float)(1 / (u * e->iz[0] + v * e->iz[1] + w * e->iz[2]));
            // all samples of a pixel lie together
            size_t pixel = (size_t)(row >> shift) * (size_t)(a->x1 - a->x0) + (size_t)(s >> shift);
            struct actor_sample *to =
                &grid.samples[(pixel << 2 * shift) + (size_t)(((row & inner) << shift) + (s & inner))];
            if (to->z == 0 || z < to->z)
                *to = (struct actor_sample){z, triangle};
        }
    }
}

void actor_draw_rows(struct actor *a, int first, int end)
{
    first = first > a->y0 ? first : a->y0;
    end = end < a->y1 ? end : a->y1;
    if (first >= end)
        return;
    for (int i = 0; i < a->mesh->triangle_count; i++) {
        const int *t = a->mesh->triangles[i];
        const struct screen_corner *p = &a->corner[t[0]], *q = &a->corner[t[1]], *r = &a->corner[t[2]];
        if (p->z == 0 || q->z == 0 || r->z == 0 || most(p->y, most(q->y, r->y)) < first - 0.5 ||
            least(p->y, least(q->y, r->y)) > end - 0.5)
            continue;
        struct edges e;
        if (!edges_of(p, q, r, &e))
            continue;
        rasterise(a, i, &e, (struct sample_grid){a->centre, 0}, first, end);
        if (a->fine)
            rasterise(a, i, &e, (struct sample_grid){a->fine, ACTOR_LOG2_SIDE}, first, end);
    }
}

static const struct actor_sample *samples_at(const struct actor *a, int x, int y, const struct actor_sample *samples,
                                             int count)
{
    if (x < a->x0 || x >= a->x1 || y < a->y0 || y >= a->y1)
        return NULL;
    return samples + ((size_t)(y - a->y0) * (size_t)(a->x1 - a->x0) + (size_t)(x - a->x0)) * (size_t)count;
}

double actor_depth(const struct actor *a, int x, int y)
{
    const struct actor_sample *s = samples_at(a, x, y, a->centre, 1);
    return s ? (double)s->z : 0;
}

int actor_cover(const struct actor *a, int x, int y, double *z_near, double *z_far)
{
    const struct actor_sample *s = samples_at(a, x, y, a->fine, ACTOR_SAMPLES);
    int count = 0;
    *z_near = 1e9;
    *z_far = 0;
    for (int i = 0; s && i < ACTOR_SAMPLES; i++)
        if (s[i].z > 0) {
            count++;
            *z_near = least(*z_near, (double)s[i].z);
            *z_far = most(*z_far, (double)s[i].z);
        }
    return count;
}

// ---------------------------------------------------------------- colour

// Radiance of the figure at a sample's position in the image.
static void shade(const struct actor *a, int triangle, double x, double y, float color[3])
{
    const int *t = a->mesh->triangles[triangle];
    struct edges e;
    if (!edges_of(&a->corner[t[0]], &a->corner[t[1]], &a->corner[t[2]], &e))
        return;
    double share[3], sum = 0;
    for (int i = 0; i < 3; i++) {
        share[i] = most(0, e.a[i] * x + e.b[i] * y + e.c[i]) * e.iz[i];
        sum += share[i];
    }
    struct vec3f bind_point = {0, 0, 0}, n = {0, 0, 0};
    struct vec3 at = {0, 0, 0};
    float light[3] = {0};
    for (int i = 0; i < 3; i++) {
        float k = (float)(share[i] / sum);
        const struct vec3f *p = &a->mesh->at[t[i]], *m = &a->normal[t[i]];
        bind_point.x += k * p->x, bind_point.y += k * p->y, bind_point.z += k * p->z;
        n.x += k * m->x, n.y += k * m->y, n.z += k * m->z;
        at = v3_add(at, v3_scale(a->at[t[i]], (double)k));
        for (int c = 0; c < 3; c++)
            light[c] += k * a->light[t[i]][c];
    }
    float albedo[3], shine = figure_albedo(&a->w->physique, bind_point, albedo);
    // Where it shines: a broad highlight of the lamps, and the room near grazing angles.
    struct vec3 normal = v3_unit(v3((double)n.x, (double)n.y, (double)n.z)), view = v3_unit(v3_sub(a->eye, at));
    float facing = (float)most(0, v3_dot(normal, view)), edge = 1 - facing, rim = edge * edge * edge * edge;
    float gloss = 0;
    for (int i = 0; i < LAMP_COUNT; i++) {
        struct vec3 lamp = v3_unit(v3_sub(v3_mix(scene_lamps[i].low, scene_lamps[i].high, 0.5), at));
        float h = (float)most(0, v3_dot(normal, v3_unit(v3_add(lamp, view))));
        float h2 = h * h, h4 = h2 * h2, h8 = h4 * h4, h16 = h8 * h8;
        gloss += h16 * h4;
    }
    for (int c = 0; c < 3; c++)
        color[c] = albedo[c] * light[c] + light[c] * (shine * (0.35f * gloss + 0.25f * rim) + 0.05f * rim);
}

void actor_color(const struct actor *a, int x, int y, const double *room_z, float color[3], int *count)
{
    const struct actor_sample *s = samples_at(a, x, y, a->fine, ACTOR_SAMPLES);
    color[0] = color[1] = color[2] = 0;
    *count = 0;
    // One shading per quarter of the pixel, at the sample next to the pixel's middle, for all of its samples.
    for (int quarter = 0; quarter < 4; quarter++) {
        int best = -1, seen = 0;
        for (int i = 0; i < 4; i++) {
            // inner sample first: for quarter (0,0) that is (1,1)
            int sx = (quarter & 1) * 2 + ((i & 1) ^ !(quarter & 1)),
                sy = (quarter >> 1) * 2 + ((i >> 1) ^ !(quarter >> 1));
            int k = sy * ACTOR_SIDE + sx;
            if (s[k].z > 0 && (!room_z || (double)s[k].z < room_z[k])) {
                seen++;
                if (best < 0)
                    best = k;
            }
        }
        if (!seen)
            continue;
        float part[3] = {0};
        shade(a, s[best].triangle, x - 0.5 + (best % ACTOR_SIDE + 0.5) / ACTOR_SIDE,
              y - 0.5 + (best / ACTOR_SIDE + 0.5) / ACTOR_SIDE, part);
        for (int c = 0; c < 3; c++)
            color[c] += part[c] * (float)seen;
        *count += seen;
    }
    for (int c = 0; c < 3 && *count; c++)
        color[c] /= (float)*count;
}

bool actor_shades(const struct actor *a, int surface, double u, double v, double around)
{
    return shadow_reaches(a->shadow, surface, u, v, around);
}

void actor_shadow(const struct actor *a, struct vec3 at, struct vec3 normal, float lost[3], float *ambient)
{
    shadow_on(a->shadow, at, normal, lost, ambient);
}
