// How surely the map knows where things are, and from which side it saw points. Points: from all sightings and depth
// readings of each, as the adjustment weighs them, with the cameras where they are. Tags, which are known ten times
// better: from the whole adjustment.
#include "capture/mapping/map_internal.h"
#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

static const double ROBUST_SIGMAS = 3; // as in the adjustment, standard deviations

struct landmark_information {
    double information[9], cost, numbers;
    struct vec3 from; // sum of unit vectors to the cameras, world axes
    int32_t observations;
};

// Where a frame shows a point: errors whitened, and their derivative by the point.
static void add_observation(struct landmark_information *k, const struct lens *lens, const struct map_frame *f,
                            const struct map_feature *s, const struct place_point *point)
{
    struct vec3 p = pose_apply(f->camera_from_world, point->world), ray = lens_ray(lens, s->feature.at);
    double rotation[3][3], c[3], rows[3][3], e[3] = {0};
    quat_to_matrix(f->camera_from_world.rotation, rotation);
    match_covariance(point, &s->feature, c);
    double a = 1 / sqrt(c[0]), d = 1 / sqrt(c[2] - c[1] * c[1] / c[0]), b = -d * c[1] / c[0];
    double x = p.x / p.z, y = p.y / p.z, depth = s->depth > 0 ? 1 / depth_absolute_sigma_m(s->depth) : 0;
    double off_x = lens->fx * (x - ray.x), off_y = lens->fy * (y - ray.y);
    for (int i = 0; i < 3; i++) {
        double by_x = lens->fx / p.z * (rotation[0][i] - x * rotation[2][i]);
        double by_y = lens->fy / p.z * (rotation[1][i] - y * rotation[2][i]);
        rows[0][i] = a * by_x;
        rows[1][i] = b * by_x + d * by_y;
        rows[2][i] = depth * rotation[2][i];
    }
    e[0] = a * off_x;
    e[1] = b * off_x + d * off_y;
    e[2] = depth * (p.z - s->depth);
    double chi2 = e[0] * e[0] + e[1] * e[1] + e[2] * e[2], slope = 1 / (1 + chi2 / (ROBUST_SIGMAS * ROBUST_SIGMAS));
    for (int r = 0; r < 3; r++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                k->information[i * 3 + j] += slope * rows[r][i] * rows[r][j];
    k->cost += slope * chi2;
    k->numbers += s->depth > 0 ? 3 : 2;
    k->from = v3_add(k->from, v3_unit(v3_sub(pose_inverse(f->camera_from_world).translation, point->world)));
    k->observations++;
}

static void set_covariance(const struct landmark_information *k, struct place_point *point)
{
    static const int ROW[6] = {0, 0, 0, 1, 1, 2}, COLUMN[6] = {0, 1, 2, 1, 2, 2};
    double covariance[9], spare = k->numbers - 3;
    struct vec3 from = v3_scale(k->from, 1.0 / (k->observations ? k->observations : 1));
    point->seen_from[0] = (float)from.x, point->seen_from[1] = (float)from.y, point->seen_from[2] = (float)from.z;
    memset(point->covariance, 0, sizeof point->covariance);
    if (!invert_symmetric(k->information, 3, covariance))
        return;
    // Larger than chance makes it in one case of six.
    double grow = spare > 0 ? fmax(1, k->cost / (spare + sqrt(2 * spare))) : 1;
    for (int i = 0; i < 6; i++)
        point->covariance[i] = (float)(grow * covariance[ROW[i] * 3 + COLUMN[i]]);
}

enum status map_landmark_covariances(struct map *m)
{
    struct landmark_information *sums = calloc((size_t)m->point_count + 1, sizeof *sums);
    if (!sums)
        return fail(ERR_MEMORY, "no memory to weigh %d points", (int)m->point_count);
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t n = 0; f->placed && n < f->feature_count; n++) {
            const struct map_feature *s = &f->features[n];
            if (s->point >= m->held_points)
                add_observation(&sums[s->point], &m->calibration.color, f, s, &m->points[s->point]);
        }
    }
    for (int32_t i = m->held_points; i < m->point_count; i++)
        set_covariance(&sums[i], &m->points[i]);
    free(sums);
    return OK;
}

// How a tag moves in its own axes, turn and shift, when the whole world turns and shifts. 6 x 6.
static void tag_motion_by_world(const struct map_tag *tag, double out[36])
{
    double r[3][3];
    const struct vec3 t = tag->world_from_tag.translation;
    const double skew[3][3] = {{0, t.z, -t.y}, {-t.z, 0, t.x}, {t.y, -t.x, 0}}; // the shift by a turn
    quat_to_matrix(tag->world_from_tag.rotation, r);
    memset(out, 0, 36 * sizeof *out);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            out[i * 6 + j] = out[(3 + i) * 6 + 3 + j] = r[j][i];
            for (int k = 0; k < 3; k++)
                out[(3 + i) * 6 + j] += r[k][i] * skew[k][j];
        }
}

// The motion of the whole world that fits small motions of all tags best: `by` rows of 6, one column for each of the
// tags' numbers. False: nothing to fit it to.
static bool fit_common_motion(const struct map *m, double *by)
{
    const int n = 6 * m->tag_count;
    double normal[36] = {0}, inverse[36], with[36];
    memset(by, 0, 6 * (size_t)n * sizeof *by);
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t t = 0; t < m->tag_count; t++) {
            const double lever = m->tags[t].side_m / 2; // a turn counts as far as it moves the corners
            if (!m->tags[t].mapped)
                continue;
            tag_motion_by_world(&m->tags[t], with);
            for (int k = 0; k < 6; k++)
                for (int i = 0; i < 6; i++)
                    for (int j = 0; j < 6; j++) {
                        double weight = (k < 3 ? lever * lever : 1) * with[k * 6 + j];
                        if (pass)
                            by[i * n + 6 * t + k] += inverse[i * 6 + j] * weight;
                        else
                            normal[i * 6 + j] += with[k * 6 + i] * weight;
                    }
        }
        if (!pass && !invert_symmetric(normal, 6, inverse))
            return false;
    }
    return true;
}

// What is left of each tag's covariance when all tags may be moved together: the world is where they have it.
// all: 6 tag_count on a side; its diagonal blocks change.
static void remove_gauge_freedom(const struct map *m, double *all, double *common, double *half)
{
    const int n = 6 * m->tag_count;
    double both[36] = {0};
    if (!fit_common_motion(m, common))
        return;
    memset(half, 0, 6 * (size_t)n * sizeof *half); // of the common motion with each tag's
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < n; k++)
            for (int j = 0; j < n; j++)
                half[i * n + j] += common[i * n + k] * all[k * n + j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            for (int k = 0; k < n; k++)
                both[i * 6 + j] += half[i * n + k] * common[j * n + k];
    for (int32_t t = 0; t < m->tag_count; t++) {
        double with[36];
        tag_motion_by_world(&m->tags[t], with);
        for (int a = 0; a < 6; a++)
            for (int b = 0; b < 6; b++) {
                double *c = &all[(6 * t + a) * n + 6 * t + b];
                for (int i = 0; i < 6; i++) {
                    *c -= with[a * 6 + i] * half[i * n + 6 * t + b] + with[b * 6 + i] * half[i * n + 6 * t + a];
                    for (int j = 0; j < 6; j++)
                        *c += with[a * 6 + i] * both[i * 6 + j] * with[b * 6 + j];
                }
            }
    }
}

enum status map_tag_covariances(struct map *m)
{
    if (!m->tag_count)
        return OK;
    const int n = 6 * m->tag_count;
    double *all = calloc((size_t)n * (size_t)n + 1, sizeof *all);
    double *common = calloc(6 * (size_t)n + 1, sizeof *common), *half = calloc(6 * (size_t)n + 1, sizeof *half);
    enum status status = all && common && half ? map_joint_tag_covariance(m, all)
                                               : fail(ERR_MEMORY, "no memory to weigh %d tags", (int)m->tag_count);
    if (status == OK && !m->has_prior)
        remove_gauge_freedom(m, all, common, half);
    for (int32_t t = 0; t < m->tag_count && status == OK; t++) {
        float *out = m->tags[t].covariance;
        for (int a = 0; a < 6 && !(m->has_prior && m->tags[t].fixed); a++)
            for (int b = a; b < 6; b++)
                *out++ = (float)all[(6 * t + a) * n + 6 * t + b];
    }
    free(all);
    free(common);
    free(half);
    return status;
}
