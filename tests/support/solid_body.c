#include "tests/support/solid_body.h"

#include <math.h>
#include <string.h>

enum { ALONG = 25, ACROSS = 9 };

// Ball number i of a solid.
static double ball_of(const struct body_solid *s, int i, struct vec3 *centre)
{
    const double t = (double)(i / ACROSS) / (ALONG - 1), u = 2.0 * (i % ACROSS) / (ACROSS - 1) - 1;
    *centre = v3_add(v3_mix(s->a, s->b, t), v3_scale(s->side, u * (s->width_a + (s->width_b - s->width_a) * t)));
    return s->radius_a + (s->radius_b - s->radius_a) * t;
}

static void draw_ball(struct vec3 c, double radius, const struct lens *lens, uint16_t *depth, uint8_t *mask)
{
    const struct pixel middle = lens_project(lens, c);
    const double reach = 1.1 * lens->fx * radius / (c.z - radius) + 1;
    const int left = (int)fmax(0, middle.x - reach), right = (int)fmin(lens->width - 1, middle.x + reach);
    const int top = (int)fmax(0, middle.y - reach), bottom = (int)fmin(lens->height - 1, middle.y + reach);
    for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++) {
            const struct vec3 ray = lens_ray(lens, (struct pixel){x, y});
            const double a = v3_dot(ray, ray), b = v3_dot(ray, c);
            const double root = b * b - a * (v3_dot(c, c) - radius * radius);
            if (root < 0)
                continue;
            const int i = y * lens->width + x;
            const double mm = 1000 * (b - sqrt(root)) / a;
            if (mm > 0 && mm < depth[i]) {
                depth[i] = (uint16_t)lround(mm);
                mask[i] = 255;
            }
        }
}

void solid_body_draw(const struct body_build *build, const struct lens *lens, double wall_m, uint16_t *depth,
                     uint8_t *mask)
{
    const size_t pixels = lens_pixels(lens);
    memset(mask, 0, pixels);
    for (size_t i = 0; i < pixels; i++)
        depth[i] = (uint16_t)(1000 * wall_m);
    for (int k = 0; k < build->solids; k++)
        for (int i = 0; i < ALONG * ACROSS; i++) {
            struct vec3 centre;
            const double radius = ball_of(&build->solid[k], i, &centre);
            if (centre.z > radius + 0.05)
                draw_ball(centre, radius, lens, depth, mask);
        }
}

double solid_body_distance(const struct body_build *build, struct vec3 point, int *solid)
{
    double least = INFINITY;
    for (int k = 0; k < build->solids; k++)
        for (int i = 0; i < ALONG * ACROSS; i++) {
            struct vec3 centre;
            const double radius = ball_of(&build->solid[k], i, &centre);
            const double distance = v3_distance(point, centre) - radius;
            if (distance < least) {
                least = distance;
                *solid = k;
            }
        }
    return least;
}
