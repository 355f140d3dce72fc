// How surely the map knows where its points are: from all sightings and depth readings of each, as the adjustment
// weighs them, with the cameras where they are.
#include "capture/map_internal.h"
#include "locate/linear.h"

#include <stdlib.h>
#include <string.h>

static const double ROBUST = 3; // as in the adjustment, standard deviations

struct known {
    double information[9], cost, numbers;
};

// Where a frame shows a point: errors whitened, and their derivative by the point.
static void add_sighting(struct known *k, const struct lens *lens, const struct map_frame *f,
                         const struct map_feature *s, struct vec3 world)
{
    struct vec3 p = pose_apply(f->camera_from_world, world), ray = lens_ray(lens, s->feature.at);
    double turn[3][3], c[3], rows[3][3], e[3] = {0};
    quat_to_matrix(f->camera_from_world.rotation, turn);
    feature_covariance(&s->feature, c);
    double a = 1 / sqrt(c[0]), d = 1 / sqrt(c[2] - c[1] * c[1] / c[0]), b = -d * c[1] / c[0];
    double x = p.x / p.z, y = p.y / p.z, depth = s->depth > 0 ? 1 / depth_sigma(s->depth) : 0;
    double off_x = lens->fx * (x - ray.x), off_y = lens->fy * (y - ray.y);
    for (int i = 0; i < 3; i++) {
        double by_x = lens->fx / p.z * (turn[0][i] - x * turn[2][i]);
        double by_y = lens->fy / p.z * (turn[1][i] - y * turn[2][i]);
        rows[0][i] = a * by_x;
        rows[1][i] = b * by_x + d * by_y;
        rows[2][i] = depth * turn[2][i];
    }
    e[0] = a * off_x;
    e[1] = b * off_x + d * off_y;
    e[2] = depth * (p.z - s->depth);
    double chi2 = e[0] * e[0] + e[1] * e[1] + e[2] * e[2], slope = 1 / (1 + chi2 / (ROBUST * ROBUST));
    for (int r = 0; r < 3; r++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                k->information[i * 3 + j] += slope * rows[r][i] * rows[r][j];
    k->cost += slope * chi2;
    k->numbers += s->depth > 0 ? 3 : 2;
}

static void settle(const struct known *k, struct place_point *point)
{
    static const int ROW[6] = {0, 0, 0, 1, 1, 2}, COLUMN[6] = {0, 1, 2, 1, 2, 2};
    double covariance[9], spare = k->numbers - 3;
    memset(point->covariance, 0, sizeof point->covariance);
    if (!invert_symmetric(k->information, 3, covariance))
        return;
    // Larger than chance makes it in one case of six.
    double grow = spare > 0 ? fmax(1, k->cost / (spare + sqrt(2 * spare))) : 1;
    for (int i = 0; i < 6; i++)
        point->covariance[i] = (float)(grow * covariance[ROW[i] * 3 + COLUMN[i]]);
}

enum status map_weigh_points(struct map *m)
{
    struct known *known = calloc((size_t)m->point_count + 1, sizeof *known);
    if (!known)
        return fail(ERR_MEMORY, "no memory to weigh %d points", (int)m->point_count);
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t n = 0; f->placed && n < f->feature_count; n++) {
            const struct map_feature *s = &f->features[n];
            if (s->point >= m->held_points)
                add_sighting(&known[s->point], &m->calibration.color, f, s, m->points[s->point].world);
        }
    }
    for (int32_t i = m->held_points; i < m->point_count; i++)
        settle(&known[i], &m->points[i]);
    free(known);
    return OK;
}
