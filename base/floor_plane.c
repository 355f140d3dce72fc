#include "base/floor_plane.h"

#include "base/depth_noise.h"

enum {
    FLOOR_SAMPLES_MAX = 2400,
    FLOOR_SAMPLES_MIN = 60,
    RANSAC_TRIALS = 300,
    INLIERS_MIN = FLOOR_SAMPLES_MAX / 40,
    UNDER_PENALTY = 3, // inliers that one point under the plane outweighs
};

// Chosen by hand.
static const double NEAREST_M = 0.3, FARTHEST_M = 7; // depths that are used
static const double UNEVEN_M = 0.015;                // a floor's own unevenness
static const double UP_Y_MAX = -0.7;                 // 45 degrees from level
static const double CAMERA_HEIGHT_MIN_M = 0.1, EXTENT_MIN_M = 0.8;

struct floor_sample {
    struct vec3 p;
    double sigma; // of its depth, metres; its height error along the plane's normal is this times |up.ray|
};

static uint32_t next_random(uint32_t *state) // a linear congruential generator (Numerical Recipes)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

static double height_above_plane(struct floor_plane plane, struct vec3 p)
{
    return v3_dot(plane.up, p) + plane.height_m;
}

static double tolerance_at(struct floor_plane plane, const struct floor_sample *sample)
{
    return UNEVEN_M + 2 * sample->sigma * fabs(v3_dot(plane.up, sample->p)) / sample->p.z;
}

// Points on the plane (*on), less a penalty for those under it: nothing is below a floor.
static int inlier_score(struct floor_plane plane, const struct floor_sample *sample, int count, int *on)
{
    int under = 0;
    *on = 0;
    for (int i = 0; i < count; i++) {
        double h = height_above_plane(plane, sample[i].p), tolerance = tolerance_at(plane, &sample[i]);
        *on += fabs(h) < tolerance;
        under += h < -3 * tolerance - 0.05;
    }
    return *on - UNDER_PENALTY * under;
}

// Weighted least squares y' = a x + b z + c over the points on the plane, in axes rotated to it.
static struct floor_plane refine_plane(struct floor_plane plane, const struct floor_sample *sample, int count)
{
    struct vec3 u = v3_perpendicular(plane.up), v = v3_cross(plane.up, u);
    double m[3][4] = {{0}};
    for (int i = 0; i < count; i++) {
        double h = height_above_plane(plane, sample[i].p), tolerance = tolerance_at(plane, &sample[i]);
        if (fabs(h) > 1.5 * tolerance)
            continue;
        double row[4] = {v3_dot(u, sample[i].p), v3_dot(v, sample[i].p), 1, h}, w = 1 / (tolerance * tolerance);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 4; b++)
                m[a][b] += w * row[a] * row[b];
    }
    for (int a = 0; a < 3; a++) { // symmetric positive definite: no pivoting
        if (m[a][a] < 1e-9)
            return plane;
        for (int r = 0; r < 3; r++)
            if (r != a)
                for (int b = 3; b >= a; b--)
                    m[r][b] -= m[r][a] / m[a][a] * m[a][b];
    }
    double a = m[0][3] / m[0][0], b = m[1][3] / m[1][1], c = m[2][3] / m[2][2];
    struct vec3 n = v3_sub(plane.up, v3_add(v3_scale(u, a), v3_scale(v, b)));
    double length = v3_length(n);
    return (struct floor_plane){v3_scale(n, 1 / length), (plane.height_m - c) / length};
}

bool floor_plane_fit(const uint16_t *depth, const struct grid_ray *ray, int width, int height, struct floor_plane *out)
{
    struct floor_sample s[FLOOR_SAMPLES_MAX];
    int count = 0, cells = width * (height - height / 3);
    int stride = cells / FLOOR_SAMPLES_MAX + 1;
    for (int i = width * (height / 3); i < width * height && count < FLOOR_SAMPLES_MAX; i += stride) {
        double z = depth[i] * 0.001;
        if (z > NEAREST_M && z < FARTHEST_M)
            s[count++] = (struct floor_sample){v3((double)ray[i].x * z, (double)ray[i].y * z, z), depth_sigma_m(z)};
    }
    if (count < FLOOR_SAMPLES_MIN)
        return false;
    struct floor_plane best = {{0, -1, 0}, 0};
    int max = 0, on = 0, most_on = 0;
    uint32_t state = 1;
    for (int trial = 0; trial < RANSAC_TRIALS; trial++) {
        struct vec3 a = s[next_random(&state) % (uint32_t)count].p, b = s[next_random(&state) % (uint32_t)count].p,
                    c = s[next_random(&state) % (uint32_t)count].p;
        struct vec3 n = v3_unit(v3_cross(v3_sub(b, a), v3_sub(c, a)));
        if (n.y > 0)
            n = v3_scale(n, -1);
        if (n.y > UP_Y_MAX)
            continue;
        struct floor_plane f = {n, -v3_dot(n, a)};
        int score = f.height_m > CAMERA_HEIGHT_MIN_M ? inlier_score(f, s, count, &on) : 0;
        if (score > max) {
            max = score;
            most_on = on;
            best = f;
        }
    }
    if (most_on < INLIERS_MIN)
        return false;
    best = refine_plane(refine_plane(best, s, count), s, count);
    // A floor is wide in both directions.
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    for (int i = 0; i < count; i++)
        if (fabs(height_above_plane(best, s[i].p)) < tolerance_at(best, &s[i])) {
            low[0] = fmin(low[0], s[i].p.x), high[0] = fmax(high[0], s[i].p.x);
            low[1] = fmin(low[1], s[i].p.z), high[1] = fmax(high[1], s[i].p.z);
        }
    if (high[0] - low[0] < EXTENT_MIN_M || high[1] - low[1] < EXTENT_MIN_M || inlier_score(best, s, count, &on) <= 0)
        return false;
    *out = best;
    return true;
}

enum { CELLS_ACROSS = 80, CELLS_MAX = 80 * 80 };

bool floor_plane_find(const struct lens *lens, const uint16_t *depth, struct floor_plane *out)
{
    static _Thread_local struct grid_ray rays[CELLS_MAX];
    static _Thread_local uint16_t cells[CELLS_MAX];
    int step = lens->width > CELLS_ACROSS ? lens->width / CELLS_ACROSS : 1;
    int across = lens->width / step, down = lens->height / step;
    while (across * down > CELLS_MAX)
        down--; // an image higher than wide: its lowest rows are not used
    for (int y = 0; y < down; y++)
        for (int x = 0; x < across; x++) {
            int px = x * step + step / 2, py = y * step + step / 2;
            struct vec3 ray = lens_ray(lens, (struct pixel){px, py});
            rays[y * across + x] = (struct grid_ray){(float)ray.x, (float)ray.y};
            cells[y * across + x] = depth[(size_t)py * (size_t)lens->width + (size_t)px];
        }
    return floor_plane_fit(cells, rays, across, down, out);
}
