#include "tests/bench/bench_views_mesh.h"

#include <stdlib.h>
#include <string.h>

static const double DEPTH_JUMP_M = 0.06; // neighbours further apart in depth are not joined; chosen by hand

struct mesh_corner {
    bool there;
    double depth_m;     // in the sensor's image
    double x, y, z;     // in the viewer's: pixels, metres
    const uint8_t *rgb; // of the sensor's image
};

struct mesh_canvas {
    const struct lens *lens;
    uint8_t *rgb, *alpha;
    float *nearest; // metres
};

static double side(const struct mesh_corner *a, const struct mesh_corner *b, double x, double y)
{
    return (b->x - a->x) * (y - a->y) - (b->y - a->y) * (x - a->x);
}

static void draw_triangle(const struct mesh_canvas *c, const struct mesh_corner *p, const struct mesh_corner *q,
                          const struct mesh_corner *r)
{
    double area = side(p, q, r->x, r->y);
    if (!(fabs(area) > 1e-12))
        return;
    int left = (int)fmax(0, ceil(fmin(p->x, fmin(q->x, r->x)))), top = (int)fmax(0, ceil(fmin(p->y, fmin(q->y, r->y))));
    int right = (int)fmin(c->lens->width - 1, floor(fmax(p->x, fmax(q->x, r->x))));
    int bottom = (int)fmin(c->lens->height - 1, floor(fmax(p->y, fmax(q->y, r->y))));
    for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++) {
            double u = side(q, r, x, y) / area, v = side(r, p, x, y) / area, w = 1 - u - v;
            int i = y * c->lens->width + x;
            float z = (float)(u * p->z + v * q->z + w * r->z);
            if (u < 0 || v < 0 || w < 0 || z >= c->nearest[i])
                continue;
            c->nearest[i] = z;
            c->alpha[i] = 255;
            for (int k = 0; k < 3; k++)
                c->rgb[3 * i + k] = (uint8_t)(u * p->rgb[k] + v * q->rgb[k] + w * r->rgb[k] + 0.5);
        }
}

static bool joined(const struct mesh_corner *a, const struct mesh_corner *b, const struct mesh_corner *c)
{
    return a->there && b->there && c->there && fabs(a->depth_m - b->depth_m) < DEPTH_JUMP_M &&
           fabs(b->depth_m - c->depth_m) < DEPTH_JUMP_M && fabs(c->depth_m - a->depth_m) < DEPTH_JUMP_M;
}

static void place_corners(struct take *take, const struct take_images *seen, const struct lens *view,
                          struct pose viewer_from_color, struct mesh_corner *corners)
{
    const struct calibration *k = take_calibration(take);
    struct pose color_from_depth = k->registered ? POSE_IDENTITY : k->color_from_depth;
    for (int i = 0; i < k->depth.width * k->depth.height; i++) {
        corners[i].there = false;
        if (!seen->depth[i] || (seen->mask && !seen->mask[i]))
            continue;
        double z = seen->depth[i] * 1e-3;
        struct vec3 ray = lens_ray(&k->depth, (struct pixel){i % k->depth.width, i / k->depth.width});
        struct vec3 color = pose_apply(color_from_depth, v3_scale(ray, z / ray.z));
        struct vec3 there = pose_apply(viewer_from_color, color);
        if (!(color.z > 0.05) || !(there.z > 0.05))
            continue;
        struct pixel from = lens_project(&k->color, color), to = lens_project(view, there);
        int x = (int)floor(from.x + 0.5), y = (int)floor(from.y + 0.5);
        if (x < 0 || y < 0 || x >= k->color.width || y >= k->color.height)
            continue;
        corners[i] = (struct mesh_corner){true, z, to.x, to.y, there.z, seen->color + 3 * (y * k->color.width + x)};
    }
}

enum status views_mesh_draw(struct take *take, int64_t frame, const struct lens *lens, struct pose world_from_viewer,
                            uint8_t *rgb, uint8_t *alpha)
{
    const struct lens *depth = &take_calibration(take)->depth;
    size_t pixels = (size_t)lens->width * (size_t)lens->height;
    struct mesh_canvas canvas = {lens, rgb, alpha, malloc(sizeof(float) * pixels)};
    struct mesh_corner *corners = malloc(sizeof *corners * (size_t)depth->width * (size_t)depth->height);
    struct take_images seen;
    enum status status = canvas.nearest && corners ? OK : fail(ERR_MEMORY, "no memory for the mesh");
    if (status == OK)
        status = take_read(take, frame, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &seen);
    if (status == OK && seen.color && seen.depth) {
        struct pose viewer_from_color =
            pose_multiply(pose_inverse(world_from_viewer), take_entry(take, frame)->world_from_camera);
        memset(alpha, 0, pixels);
        for (size_t i = 0; i < pixels; i++)
            canvas.nearest[i] = INFINITY;
        place_corners(take, &seen, lens, viewer_from_color, corners);
        for (int y = 0; y + 1 < depth->height; y++)
            for (int x = 0; x + 1 < depth->width; x++) {
                const struct mesh_corner *a = &corners[y * depth->width + x], *b = a + 1, *c = a + depth->width,
                                         *d = c + 1;
                if (joined(a, b, c))
                    draw_triangle(&canvas, a, b, c);
                if (joined(b, d, c))
                    draw_triangle(&canvas, b, d, c);
            }
    }
    free(canvas.nearest);
    free(corners);
    return status;
}
