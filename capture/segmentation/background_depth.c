#include "capture/segmentation/background_depth.h"

#include "base/depth_noise.h"

#include <stdlib.h>
#include <string.h>

// A sample whose neighbours differ by more than this share of its depth is a flying pixel between two surfaces.
// Chosen by hand.
static const double FLYING_PIXEL_SHARE = 0.05;

// Samples are drawn between these depths of the new camera: nearer ones would cover the image, farther ones do not fit
// 16 bits of millimetres.
static const double NEAREST_M = 0.2, FARTHEST_M = 60;

static bool is_flying(const uint16_t *depth, int width, int x, int y)
{
    int here = depth[(size_t)y * (size_t)width + (size_t)x];
    const int dx[] = {1, -1, 0, 0}, dy[] = {0, 0, 1, -1};
    for (int i = 0; i < 4; i++) {
        int there = depth[(size_t)(y + dy[i]) * (size_t)width + (size_t)(x + dx[i])];
        if (!there || abs(there - here) > FLYING_PIXEL_SHARE * here)
            return true;
    }
    return false;
}

// One pixel's nearest surface so far: the mean of its samples. The nearest single sample would be biased towards the
// camera by the noise of all views.
struct background_cell {
    float mean_mm;
    float samples;
};

static void add_depth_sample(struct background_cell *cell, double mm)
{
    double tolerance = depth_between_views_mm(mm);
    if (!cell->samples || mm < cell->mean_mm - tolerance) {
        *cell = (struct background_cell){(float)mm, 1};
    } else if (mm < cell->mean_mm + tolerance) {
        cell->samples++;
        cell->mean_mm += ((float)mm - cell->mean_mm) / cell->samples;
    }
}

// Draws one sample as a square that covers the gap to its neighbours; size_m: the square's side.
static void splat_sample(const struct lens *lens, struct vec3 p, double size_m, struct background_cell *cells)
{
    if (!(p.z > NEAREST_M) || p.z > FARTHEST_M)
        return;
    struct pixel at = lens_project(lens, p);
    double half = 0.5 * size_m * lens->fx / p.z + 0.25;
    int x0 = (int)ceil(at.x - half), x1 = (int)floor(at.x + half);
    int y0 = (int)ceil(at.y - half), y1 = (int)floor(at.y + half);
    for (int y = y0 < 0 ? 0 : y0; y <= y1 && y < lens->height; y++)
        for (int x = x0 < 0 ? 0 : x0; x <= x1 && x < lens->width; x++)
            add_depth_sample(&cells[(size_t)y * (size_t)lens->width + (size_t)x], p.z * 1000);
}

// Every second pixel of every second row, each drawn twice as wide: the surface has no more holes, and a tablet does
// a quarter of the work.
enum { STRIDE = 2 };

static void splat_view(const struct place *place, const struct place_view *view, const struct vec3 *rays,
                       const struct lens *lens, struct pose depth_from_world, struct background_cell *cells)
{
    const struct lens *own = &place->calibration.depth;
    struct pose out_from_view =
        pose_multiply(depth_from_world, pose_multiply(view->world_from_camera, place->calibration.color_from_depth));
    double rotation[3][3];
    quat_to_matrix(out_from_view.rotation, rotation);
    struct vec3 shift = out_from_view.translation;
    for (int y = 1; y < own->height - 1; y += STRIDE)
        for (int x = 1; x < own->width - 1; x += STRIDE) {
            size_t at = (size_t)y * (size_t)own->width + (size_t)x;
            double z = view->depth[at] / 1000.0;
            if (z == 0 || is_flying(view->depth, own->width, x, y))
                continue;
            struct vec3 ray = rays[at], p;
            p.x = z * (rotation[0][0] * ray.x + rotation[0][1] * ray.y + rotation[0][2]) + shift.x;
            p.y = z * (rotation[1][0] * ray.x + rotation[1][1] * ray.y + rotation[1][2]) + shift.y;
            p.z = z * (rotation[2][0] * ray.x + rotation[2][1] * ray.y + rotation[2][2]) + shift.z;
            splat_sample(lens, p, STRIDE * z / own->fx, cells);
        }
}

enum status background_depth_render(const struct place *place, const struct lens *lens, struct pose world_from_depth,
                                    uint16_t *depth)
{
    size_t pixels = (size_t)lens->width * (size_t)lens->height;
    memset(depth, 0, pixels * sizeof *depth);
    const struct lens *own = &place->calibration.depth;
    if (own->width <= 0 || !place->view_count)
        return OK;
    struct vec3 *rays = malloc((size_t)own->width * (size_t)own->height * sizeof *rays);
    struct background_cell *cells = calloc(pixels, sizeof *cells);
    if (!rays || !cells) {
        free(rays);
        free(cells);
        return fail(ERR_MEMORY, "no memory to predict the background");
    }
    for (int y = 0; y < own->height; y++)
        for (int x = 0; x < own->width; x++)
            rays[(size_t)y * (size_t)own->width + (size_t)x] = lens_ray(own, (struct pixel){x, y});
    struct pose depth_from_world = pose_inverse(world_from_depth);
    for (int32_t i = 0; i < place->view_count; i++)
        if (place->views[i].depth)
            splat_view(place, &place->views[i], rays, lens, depth_from_world, cells);
    for (size_t i = 0; i < pixels; i++)
        depth[i] = cells[i].samples ? (uint16_t)lroundf(cells[i].mean_mm) : 0;
    free(cells);
    free(rays);
    return OK;
}
