// Light on the empty room: two area lamps with soft shadows of the furniture, and an ambient term reduced in corners
// and near furniture.
#include "tests/world/numbers.h"
#include "tests/world/scene.h"

#include <stdlib.h>

const struct lamp scene_lamps[LAMP_COUNT] = {
    {{-1.55, -1.65, 2.6}, {-0.25, -0.95, 2.6}, {13.5f, 12.8f, 11.6f}},
    {{0.35, 0.85, 2.6}, {1.65, 1.55, 2.6}, {13.5f, 12.8f, 11.6f}},
};

double lamp_area(const struct lamp *lamp) { return (lamp->high.x - lamp->low.x) * (lamp->high.y - lamp->low.y); }

struct vec3 lamp_point(const struct lamp *lamp, int k, int n)
{
    // A low-discrepancy sequence (Roberts' R2).
    double a = 0.5 + 0.7548776662466927 * k, b = 0.5 + 0.5698402909980532 * k;
    (void)n;
    return v3(lamp->low.x + (a - floor(a)) * (lamp->high.x - lamp->low.x),
              lamp->low.y + (b - floor(b)) * (lamp->high.y - lamp->low.y), lamp->low.z);
}

// Irradiance / pi of the lamps at a point, with the furniture's shadows.
static void direct(const struct world_scene *s, struct vec3 at, struct vec3 normal, float out[3])
{
    enum { SAMPLES = 8 };
    for (int i = 0; i < LAMP_COUNT; i++)
        for (int k = 0; k < SAMPLES; k++) {
            struct vec3 to = v3_sub(lamp_point(&scene_lamps[i], k, SAMPLES), at);
            double d2 = v3_dot(to, to), d = sqrt(d2), cos_here = v3_dot(to, normal) / d, cos_lamp = to.z / d;
            if (!(cos_here > 0) || !(cos_lamp > 0) || scene_blocked(s, at, v3_add(at, to)))
                continue;
            double share = lamp_area(&scene_lamps[i]) * cos_here * cos_lamp / (d2 + 0.02) / 3.14159265 / SAMPLES;
            for (int c = 0; c < 3; c++)
                out[c] += scene_lamps[i].radiance[c] * (float)share;
        }
}

// Ambient visibility of a point, 0..1: nearby furniture takes light away, and so, less, do walls, floor and ceiling,
// which are bright themselves.
static float openness(const struct world_scene *s, struct vec3 at, struct vec3 normal)
{
    enum { RAYS = 20 };
    const double reach = 1.2;
    struct vec3 x = v3_perpendicular(normal), y = v3_cross(normal, x);
    double lost = 0;
    for (int k = 0; k < RAYS; k++) { // cosine-weighted spiral
        double r2 = (k + 0.5) / RAYS, r = sqrt(r2), a = k * 2.399963229728653;
        struct vec3 d =
            v3_add(v3_scale(normal, sqrt(1 - r2)), v3_add(v3_scale(x, r * cos(a)), v3_scale(y, r * sin(a))));
        struct hit h = scene_hit(s, at, d, (1u << s->box_count) - 1);
        if (h.distance < reach)
            lost += (1 - h.distance / reach) * (h.surface < 6 ? 0.45 : 0.85);
    }
    return (float)(1 - lost / RAYS);
}

enum status scene_bake(struct world_scene *s)
{
    const double spacing = 0.15;
    for (int i = 0; i < s->surface_count; i++) {
        struct room_surface *f = &s->surfaces[i];
        f->light_width = 2 + (int)(f->width / spacing);
        f->light_height = 2 + (int)(f->height / spacing);
        f->light = calloc((size_t)(f->light_width * f->light_height), sizeof *f->light);
        if (!f->light)
            return fail(ERR_MEMORY, "out of memory for the room's light");
        for (int y = 0; y < f->light_height; y++)
            for (int x = 0; x < f->light_width; x++) {
                // a little inside the edges, and off the surface
                double u = least(most(f->width * x / (f->light_width - 1), 0.004), f->width - 0.004);
                double v = least(most(f->height * y / (f->light_height - 1), 0.004), f->height - 0.004);
                struct vec3 at = v3_add(f->corner, v3_add(v3_scale(f->u, u), v3_scale(f->v, v)));
                at = v3_add(at, v3_scale(f->normal, 0.004));
                float *out = f->light[y * f->light_width + x];
                direct(s, at, f->normal, out);
                // Light reflected by the floor is warm, by the ceiling white.
                float open = openness(s, at, f->normal), up = 0.5f + 0.5f * (float)f->normal.z;
                out[0] += open * (0.45f + 0.02f * (1 - up));
                out[1] += open * 0.445f;
                out[2] += open * (0.44f - 0.04f * (1 - up));
            }
    }
    return OK;
}

void scene_light(const struct room_surface *f, double u, double v, float light[3])
{
    double x = u / f->width * (f->light_width - 1), y = v / f->height * (f->light_height - 1);
    x = least(most(x, 0), f->light_width - 1.000001);
    y = least(most(y, 0), f->light_height - 1.000001);
    int i = (int)x, j = (int)y;
    float a = (float)(x - i), b = (float)(y - j);
    float(*at)[3] = f->light + (j * f->light_width + i);
    for (int c = 0; c < 3; c++)
        light[c] = (at[0][c] * (1 - a) + at[1][c] * a) * (1 - b) +
                   (at[f->light_width][c] * (1 - a) + at[f->light_width + 1][c] * a) * b;
}
