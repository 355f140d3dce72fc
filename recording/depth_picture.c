#include "recording/depth_picture.h"

#include "base/geometry.h"

#include <math.h>
#include <stdlib.h>

// A surface's slope is that of a plane fitted to the depths about a pixel: as far as REACH_M on the surface, so that
// the sensor's steps even out, but over no edge higher than EDGE_MM. Beyond STEPS_FROM_MM that grows as the square of
// the distance, as a Kinect's steps do (2 cm at 2.5 m, 5 at 4.2 m). All chosen by hand.
static const double REACH_M = 0.06, STEPS_FROM_MM = 2500;
enum { MIN_REACH = 2, MAX_REACH = 24, ACROSS = 4, EDGE_MM = 60, ENOUGH = 6 };

// To the lamp, in the camera's axes (x right, y down, z forward); and the share of light that comes from everywhere.
static const struct vec3 LAMP = {-0.35, -0.6, -0.72};
static const double AMBIENT = 0.3;
static const double PERSON[3] = {226, 214, 198}; // sRGB, where the lamp shines straight on it
enum { GREY_NEAR = 130, GREY_FAR = 45, FAR_MM = 7000, GREY_HOLE = 16 };

// Sums of the fit of inverse depth w = c + a dx + b dy, which is exact for planes. dx, dy from the pixel, px.
struct plane_sums {
    double n, x, y, xx, xy, yy, w, xw, yw;
};

static inline void add(struct plane_sums *sums, double dx, double dy, double w)
{
    sums->n += 1;
    sums->x += dx;
    sums->y += dy;
    sums->xx += dx * dx;
    sums->xy += dx * dy;
    sums->yy += dy * dy;
    sums->w += w;
    sums->xw += dx * w;
    sums->yw += dy * w;
}

// The first multiple of the step from there on that is in the image.
static int first_multiple(int first, int step) { return first > 0 ? (first + step - 1) / step * step : 0; }

// Of the person's surface about (x, y). False: too few depths.
static bool fit_plane(const struct lens *lens, const uint16_t *depth, const uint8_t *mask, int x, int y,
                      struct plane_sums *sums)
{
    const int z = depth[y * lens->width + x];
    const int reach = (int)fmin(fmax(round(REACH_M * lens->fx * 1000 / z), MIN_REACH), MAX_REACH);
    const int step = (reach + ACROSS - 1) / ACROSS;
    const double steps = z / STEPS_FROM_MM, edge_mm = EDGE_MM * fmax(1, steps * steps);
    *sums = (struct plane_sums){0};
    // At multiples of the step, so that neighbours, which share most of them, share their noise, too.
    for (int v = first_multiple(y - reach, step); v <= y + reach && v < lens->height; v += step)
        for (int u = first_multiple(x - reach, step); u <= x + reach && u < lens->width; u += step) {
            const int at = v * lens->width + u;
            if (mask[at] && depth[at] && abs(depth[at] - z) <= edge_mm)
                add(sums, u - x, v - y, 1000.0 / depth[at]);
        }
    return sums->n >= ENOUGH;
}

// The cosine between the lamp and the surface's normal; one that faces the camera where it cannot be told.
static double light_on(const struct lens *lens, const uint16_t *depth, const uint8_t *mask, int x, int y)
{
    struct plane_sums s;
    struct vec3 normal = v3((lens->cx - x) / lens->fx, (lens->cy - y) / lens->fy, -1);
    if (fit_plane(lens, depth, mask, x, y, &s)) {
        const double xx = s.xx - s.x * s.x / s.n, xy = s.xy - s.x * s.y / s.n, yy = s.yy - s.y * s.y / s.n;
        const double xw = s.xw - s.x * s.w / s.n, yw = s.yw - s.y * s.w / s.n, d = xx * yy - xy * xy;
        if (d > 1e-6 * xx * yy) {
            // Of the plane n . P = 1: w = n . ray, so that its slopes over the ray's x and y are n's.
            const double nx = (xw * yy - yw * xy) / d * lens->fx, ny = (yw * xx - xw * xy) / d * lens->fy;
            const double w = 1000.0 / depth[y * lens->width + x];
            normal = v3(-nx, -ny, -(w - nx * (x - lens->cx) / lens->fx - ny * (y - lens->cy) / lens->fy));
        }
    }
    const double length = v3_length(normal);
    return length > 0 ? fmax(0, v3_dot(normal, LAMP) / (length * v3_length(LAMP))) : 0;
}

static uint8_t grey_of(int z)
{
    const double share = fmin((double)z / FAR_MM, 1);
    return z ? (uint8_t)(GREY_NEAR + (GREY_FAR - GREY_NEAR) * share) : GREY_HOLE;
}

// Two by two pixels have one light: it changes little from one to the next, and costs most of the time.
static void draw_block(const struct lens *lens, const uint16_t *depth, const uint8_t *mask, int left, int top,
                       uint8_t *rgb)
{
    double light = -1;
    for (int y = top; y < top + 2 && y < lens->height; y++)
        for (int x = left; x < left + 2 && x < lens->width; x++) {
            const int at = y * lens->width + x;
            uint8_t *out = rgb + 3 * (size_t)at;
            if (!mask || !mask[at] || !depth[at]) {
                out[0] = out[1] = out[2] = grey_of(depth[at]);
                continue;
            }
            if (light < 0)
                light = AMBIENT + (1 - AMBIENT) * light_on(lens, depth, mask, x, y);
            for (int c = 0; c < 3; c++)
                out[c] = (uint8_t)lround(PERSON[c] * light);
        }
}

void depth_picture_draw(const struct lens *lens, const uint16_t *depth, const uint8_t *mask, uint8_t *rgb)
{
    for (int y = 0; y < lens->height; y += 2)
        for (int x = 0; x < lens->width; x += 2)
            draw_block(lens, depth, mask, x, y, rgb);
}

bool depth_picture_replaces_color(struct calibration *calibration)
{
    if (calibration->color.width || !calibration->depth.width)
        return false;
    calibration->color = calibration->depth;
    calibration->color_from_depth = POSE_IDENTITY;
    calibration->registered = true;
    return true;
}
