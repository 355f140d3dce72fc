#include "surround/drive/box_world.h"

#include "base/clamp.h"
#include "base/depth_noise.h"
#include "base/portable_math.h"

#define PI 3.14159265358979323846

static uint32_t mix_bits(uint32_t x)
{
    x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu; // integer hash (Wellons, lowbias32)
    return x ^ x >> 16;
}

// Squares of 9 cm in two shades, each with its own tint: something to see and to compare everywhere.
static void paint_box(const struct box *box, const double at[3], int axis, uint8_t rgb[3])
{
    const int u = (int)floor(at[(axis + 1) % 3] / 0.09), v = (int)floor(at[(axis + 2) % 3] / 0.09);
    const uint32_t tint = mix_bits((uint32_t)u * 73856093u ^ (uint32_t)v * 19349663u ^ (uint32_t)axis * 83492791u);
    for (int c = 0; c < 3; c++) {
        const int value = box->color[c] + (int)(tint >> (8 * c) & 63) - 32 - 10 * axis;
        rgb[c] = (uint8_t)clamp_int(value, 0, 255);
    }
}

// The slab method (Kay and Kajiya 1986). The axis of the face that is met in *axis.
static double intersect_box(const struct box *box, const double from[3], const double ray[3], int *axis)
{
    double enter = -1e9, leave = 1e9;
    int enter_axis = 0, leave_axis = 0;
    for (int i = 0; i < 3; i++) {
        if (fabs(ray[i]) < 1e-12) {
            if (from[i] < box->low[i] || from[i] > box->high[i])
                return 0;
            continue;
        }
        double a = (box->low[i] - from[i]) / ray[i], c = (box->high[i] - from[i]) / ray[i];
        if (a > c) {
            const double t = a;
            a = c;
            c = t;
        }
        if (a > enter) {
            enter = a;
            enter_axis = i;
        }
        if (c < leave) {
            leave = c;
            leave_axis = i;
        }
    }
    if (enter > leave)
        return 0;
    *axis = box->inside ? leave_axis : enter_axis;
    const double t = box->inside ? leave : enter;
    return t > 1e-6 ? t : 0;
}

double box_world_cast(const struct box_world *world, const double from[3], const double ray[3], uint8_t rgb[3])
{
    double nearest = 0;
    int axis = 0, box = -1;
    for (int i = 0; i < world->count; i++) {
        int face;
        const double t = intersect_box(&world->boxes[i], from, ray, &face);
        if (t > 0 && (box < 0 || t < nearest)) {
            nearest = t;
            axis = face;
            box = i;
        }
    }
    if (box >= 0 && rgb) {
        double at[3];
        for (int i = 0; i < 3; i++)
            at[i] = from[i] + nearest * ray[i];
        paint_box(&world->boxes[box], at, axis, rgb);
    }
    return nearest;
}

void box_world_panorama(const struct box_world *world, struct pose world_from_camera, int width, int height,
                        uint8_t *rgb)
{
    double m[3][3];
    quat_to_matrix(world_from_camera.rotation, m);
    const double from[3] = {world_from_camera.translation.x, world_from_camera.translation.y,
                            world_from_camera.translation.z};
    for (int v = 0; v < height; v++)
        for (int u = 0; u < width; u++) {
            const double a = (u + 0.5) / width * 2 * PI - PI, b = (v + 0.5) / height * PI;
            const double c[3] = {portable_sin(b) * portable_sin(a), -portable_cos(b),
                                 portable_sin(b) * portable_cos(a)};
            double ray[3];
            for (int i = 0; i < 3; i++)
                ray[i] = m[i][0] * c[0] + m[i][1] * c[1] + m[i][2] * c[2];
            uint8_t *out = rgb + 3 * ((size_t)v * (size_t)width + (size_t)u);
            out[0] = out[1] = out[2] = 0;
            box_world_cast(world, from, ray, out);
        }
}

// About normal: the sum of four uniform numbers.
static double normal_noise(uint32_t *state)
{
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        *state = mix_bits(*state + 0x9e3779b9u);
        sum += *state / 4294967296.0 - 0.5;
    }
    return sum * 1.7320508; // each has variance 1 / 12
}

void box_world_depth(const struct box_world *world, struct pose world_from_camera, const struct lens *lens,
                     double range_m, uint32_t seed, uint16_t *depth)
{
    double m[3][3];
    quat_to_matrix(world_from_camera.rotation, m);
    const double from[3] = {world_from_camera.translation.x, world_from_camera.translation.y,
                            world_from_camera.translation.z};
    uint32_t state = seed;
    for (int v = 0; v < lens->height; v++)
        for (int u = 0; u < lens->width; u++) {
            const struct vec3 c = v3_unit(v3((u - lens->cx) / lens->fx, (v - lens->cy) / lens->fy, 1));
            const double local[3] = {c.x, c.y, c.z};
            double ray[3];
            for (int i = 0; i < 3; i++)
                ray[i] = m[i][0] * local[0] + m[i][1] * local[1] + m[i][2] * local[2];
            double z = box_world_cast(world, from, ray, NULL) * c.z;
            if (seed && z > 0)
                z += normal_noise(&state) * depth_sigma_m(z);
            depth[(size_t)v * (size_t)lens->width + (size_t)u] = (uint16_t)(z > 0.3 && z < range_m ? z * 1e3 + 0.5 : 0);
        }
}

// Distance between two convex outlines with corners in order; 0 where they overlap. Separating axes decide the latter.
static double outline_distance(const double (*a)[2], const double (*b)[2])
{
    bool apart = false;
    double best = 1e9;
    for (int pass = 0; pass < 2; pass++) {
        const double(*p)[2] = pass ? b : a, (*q)[2] = pass ? a : b;
        for (int i = 0; i < 4; i++) {
            const double *s = p[i], *e = p[(i + 1) % 4];
            const double ex = e[0] - s[0], ey = e[1] - s[1], length2 = ex * ex + ey * ey;
            bool all_outside = true;
            for (int k = 0; k < 4; k++) {
                const double qx = q[k][0] - s[0], qy = q[k][1] - s[1];
                all_outside &= ex * qy - ey * qx < 0; // corners run to the left
                const double t = fmax(0, fmin(1, (qx * ex + qy * ey) / length2));
                best = fmin(best, portable_hypot(qx - t * ex, qy - t * ey));
            }
            apart |= all_outside;
        }
    }
    return apart ? best : 0;
}

double box_world_clearance(const struct box_world *world, struct pose world_from_body, const double size_m[3])
{
    double corners[4][2], best = 1e9;
    for (int k = 0; k < 4; k++) {
        const double x = k == 0 || k == 3 ? -0.5 : 0.5, y = k < 2 ? -0.5 : 0.5;
        const struct vec3 p = pose_apply(world_from_body, v3(x * size_m[0], y * size_m[1], 0));
        corners[k][0] = p.x;
        corners[k][1] = p.y;
    }
    for (int i = 0; i < world->count; i++) {
        const struct box *b = &world->boxes[i];
        if (b->inside) {
            for (int k = 0; k < 4; k++)
                for (int c = 0; c < 2; c++)
                    best = fmin(best, fmin(corners[k][c] - b->low[c], b->high[c] - corners[k][c]));
            continue;
        }
        if (b->low[2] >= size_m[2] || b->high[2] <= 0)
            continue;
        const double outline[4][2] = {
            {b->low[0], b->low[1]}, {b->high[0], b->low[1]}, {b->high[0], b->high[1]}, {b->low[0], b->high[1]}};
        best = fmin(best, outline_distance((const double(*)[2])corners, outline));
    }
    return best;
}
