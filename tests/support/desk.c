#include "tests/support/desk.h"

#include "tests/support/random.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TEXTURE = 320, WALL_W = 1000, WALL_H = 600 };

static void fill(struct image *p, int x0, int y0, int x1, int y1, const int color[3])
{
    for (int y = y0 < 0 ? 0 : y0; y < y1 && y < p->height; y++)
        for (int x = x0 < 0 ? 0 : x0; x < x1 && x < p->width; x++)
            for (int c = 0; c < 3; c++)
                p->rgb[(y * p->width + x) * 3 + c] = (uint8_t)color[c];
}

static void disc(struct image *p, int cx, int cy, int r, const int color[3])
{
    for (int y = cy - r; y <= cy + r; y++)
        for (int x = cx - r; x <= cx + r; x++)
            if ((x - cx) * (x - cx) + (y - cy) * (y - cy) <= r * r)
                fill(p, x, y, x + 1, y + 1, color);
}

static void draw_color(struct rng *rng, int color[3])
{
    for (int c = 0; c < 3; c++)
        color[c] = (int)rng_between(rng, 30, 225);
}

// A ground colour, then boxes, discs and rows of small marks like print.
static bool paint(struct image *p, int width, int height, int shapes, struct rng *rng, const int ground[3])
{
    *p = (struct image){width, height, malloc((size_t)width * (size_t)height * 3)};
    if (!p->rgb)
        return false;
    fill(p, 0, 0, width, height, ground);
    for (int i = 0; i < shapes; i++) {
        int color[3];
        draw_color(rng, color);
        const int x = (int)rng_between(rng, 0, width), y = (int)rng_between(rng, 0, height);
        const int size = (int)rng_between(rng, 0.03 * height, 0.14 * height);
        if (i % 3 == 0)
            disc(p, x, y, size, color);
        else if (i % 3 == 1)
            fill(p, x, y, x + 2 * size, y + size / 2, color);
        else
            for (int k = 0; k < 6; k++) { // print
                const int at = x + k * size / 2;
                fill(p, at, y, at + size / 8 + 1, y + (k * 7 + i) % 3 * size / 4 + size / 3, color);
                fill(p, at, y + (k + i) % 2 * size / 3, at + size / 3, y + (k + i) % 2 * size / 3 + size / 8 + 1,
                     color);
            }
    }
    return true;
}

static void sample(const struct image *p, double u, double v, double out[3])
{
    u = u < 0 ? 0 : u > p->width - 1 ? p->width - 1 : u;
    v = v < 0 ? 0 : v > p->height - 1 ? p->height - 1 : v;
    const int x0 = (int)u, y0 = (int)v, x1 = x0 + 1 < p->width ? x0 + 1 : x0, y1 = y0 + 1 < p->height ? y0 + 1 : y0;
    const double fx = u - x0, fy = v - y0;
    for (int c = 0; c < 3; c++)
        out[c] =
            (1 - fy) * ((1 - fx) * p->rgb[(y0 * p->width + x0) * 3 + c] + fx * p->rgb[(y0 * p->width + x1) * 3 + c]) +
            fy * ((1 - fx) * p->rgb[(y1 * p->width + x0) * 3 + c] + fx * p->rgb[(y1 * p->width + x1) * 3 + c]);
}

// Where a ray (thing's axes) meets the thing's front; t: along it.
static bool hit(const struct desk *d, int i, struct vec3 from, struct vec3 ray, double *t, double color[3])
{
    const struct thing *thing = &d->storage[i];
    const double radius = thing->width_m / 2;
    struct vec3 p;
    double u;
    if (!d->turned[i]) {
        *t = -from.z / ray.z;
        p = v3_add(from, v3_scale(ray, *t));
        u = p.x / thing->width_m + 0.5;
    } else {
        const double fz = from.z - radius, a = ray.x * ray.x + ray.z * ray.z, b = from.x * ray.x + fz * ray.z;
        const double root = b * b - a * (from.x * from.x + fz * fz - radius * radius);
        if (root < 0)
            return false;
        *t = (-b - sqrt(root)) / a;
        p = v3_add(from, v3_scale(ray, *t));
        u = 0.5 + atan2(p.x, radius - p.z) / 6.283185307179586; // once round
    }
    const double v = p.y / thing->height_m + 0.5;
    if (!(*t > 0) || u < 0 || u > 1 || v < 0 || v > 1)
        return false;
    sample(&d->texture[i], u * d->texture[i].width - 0.5, v * d->texture[i].height - 0.5, color);
    return true;
}

static void trace(const struct desk *d, int only, struct vec3 from, struct vec3 ray, double color[3])
{
    double nearest = 1e9, now[3];
    color[0] = color[1] = color[2] = 128;
    if (only < 0) {
        const struct vec3 p = v3_add(from, v3_scale(ray, (2 - from.z) / ray.z));
        sample(&d->wall, p.x / 0.004 + WALL_W / 2, p.y / 0.004 + WALL_H / 2, color);
    }
    for (int i = only < 0 ? 0 : only; i < (only < 0 ? DESK_THINGS / 2 : only + 1); i++) {
        const struct pose thing_from_world = only < 0 ? pose_inverse(d->world_from_thing[i]) : POSE_IDENTITY;
        double t;
        if (hit(d, i, pose_apply(thing_from_world, from), quat_rotate(thing_from_world.rotation, ray), &t, now) &&
            t < nearest) {
            nearest = t;
            memcpy(color, now, sizeof now);
        }
    }
}

static void film(const struct desk *d, int only, const struct lens *lens, const struct pose *world_from_camera,
                 double noise, uint64_t seed, uint8_t *rgb)
{
    struct rng rng = {seed};
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++) {
            double sum[3] = {0}, color[3];
            for (int k = 0; k < 4; k++) {
                const struct vec3 ray = lens_ray(lens, (struct pixel){x + (k % 2 - 0.5) / 2, y + (k / 2 - 0.5) / 2});
                trace(d, only, world_from_camera->translation, quat_rotate(world_from_camera->rotation, ray), color);
                for (int c = 0; c < 3; c++)
                    sum[c] += color[c] / 4;
            }
            for (int c = 0; c < 3; c++) {
                const double value = sum[c] + noise * (rng_uniform(&rng) + rng_uniform(&rng) - 1) * 2.4;
                rgb[(y * lens->width + x) * 3 + c] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value + 0.5);
            }
        }
}

void desk_film(const struct desk *d, const struct lens *lens, const struct pose *world_from_camera, double noise,
               uint64_t seed, uint8_t *rgb)
{
    film(d, -1, lens, world_from_camera, noise, seed, rgb);
}

// A photograph of the thing alone from 0.9 m before its front, 1.12 times as large as the thing.
static bool photograph(struct desk *d, int i, uint64_t seed)
{
    struct thing *t = &d->storage[i];
    const double f = 1500, px = f / 0.9;
    struct lens lens = {
        .width = (int)(1.12 * t->width_m * px), .height = (int)(1.12 * t->height_m * px), .fx = f, .fy = f};
    lens.cx = (lens.width - 1) / 2.0;
    lens.cy = (lens.height - 1) / 2.0;
    const struct pose before = {{0, 0, 0, 1}, {0, 0, -0.9}};
    t->picture = (struct image){lens.width, lens.height, malloc((size_t)lens.width * (size_t)lens.height * 3)};
    if (!t->picture.rgb)
        return false;
    film(d, i, &lens, &before, 1.5, seed, t->picture.rgb);
    return true;
}

bool desk_make(struct desk *d, uint64_t seed)
{
    static const double sizes[4][2] = {{0.19, 0.27}, {0.26, 0.15}, {0.07, 0.12}, {0.09, 0.1}};
    static const double places[4][3] = {{-0.24, 0, 0.75}, {0.05, -0.02, 0.6}, {0.24, 0.02, 0.55}, {0.02, 0.17, 0.62}};
    struct rng rng = {seed};
    const int grey[3] = {150, 148, 142};
    *d = (struct desk){.things = {d->storage, DESK_THINGS}};
    bool good = paint(&d->wall, WALL_W, WALL_H, 90, &rng, grey);
    for (int i = 0; i < DESK_THINGS && good; i++) {
        struct thing *t = &d->storage[i];
        const int kind = i % 4;
        int ground[3];
        draw_color(&rng, ground);
        snprintf(t->name, sizeof t->name, "%s-%d", i < 4 ? "there" : "absent", kind);
        t->width_m = sizes[kind][0];
        t->height_m = sizes[kind][1];
        d->turned[i] = kind >= 2;
        const double turn = rng_between(&rng, -0.3, 0.3), tilt = rng_between(&rng, -0.1, 0.1);
        d->world_from_thing[i] = (struct pose){
            quat_multiply(quat_from_rotation_vector(v3(0, turn, 0)), quat_from_rotation_vector(v3(0, 0, tilt))),
            v3(places[kind][0], places[kind][1], places[kind][2])};
        const int height = (int)(TEXTURE * t->height_m / 0.2);
        good = paint(&d->texture[i], (int)(TEXTURE * t->width_m / 0.2 * (d->turned[i] ? 3.14159 : 1)), height,
                     d->turned[i] ? 40 : 24, &rng, ground) &&
               photograph(d, i, seed + 100 + (uint64_t)i);
    }
    d->rig = (struct stereo_rig){
        .left = {.width = 640, .height = 480, .fx = 640, .fy = 641, .cx = 318, .cy = 242, .k1 = -0.2, .k2 = 0.06},
        .right = {.width = 640, .height = 480, .fx = 643, .fy = 643, .cx = 322, .cy = 239, .k1 = -0.21, .k2 = 0.07},
        .left_from_right = {quat_from_rotation_vector(v3(0.006, -0.012, 0.005)), v3(0.09, 0.001, -0.001)}};
    return good;
}

void desk_free(struct desk *d)
{
    for (int i = 0; i < DESK_THINGS; i++) {
        free(d->storage[i].picture.rgb);
        free(d->texture[i].rgb);
    }
    free(d->wall.rgb);
    *d = (struct desk){0};
}
