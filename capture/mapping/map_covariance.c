// Covariances of landmarks and tags, and the mean viewing direction of landmarks. A landmark's covariance is the
// inverse of the information of its own observations and depth samples, weighted as in the adjustment, with the cameras
// constant. Tags are about ten times more accurate, so theirs come from the joint information of the whole adjustment.
// 6-vectors of tags: rotation (rad), then translation (m), in the tag's axes; of the world's motion: the same, in world
// axes.
#include "capture/mapping/map_internal.h"
#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

static const double ROBUST_SIGMAS = 3; // scale of the robust kernel, as in the adjustment

struct landmark_information {
    double information[9], cost, numbers;
    struct vec3 from; // sum of unit vectors to the cameras, world axes
    int32_t observations;
};

// Adds one observation of a landmark: whitened residuals and their Jacobian by its position.
static void add_observation(struct landmark_information *k, const struct lens *lens, const struct map_frame *f,
                            const struct map_feature *s, const struct place_landmark *point)
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

static void set_covariance(const struct landmark_information *k, struct place_landmark *point)
{
    static const int ROW[6] = {0, 0, 0, 1, 1, 2}, COLUMN[6] = {0, 1, 2, 1, 2, 2};
    double covariance[9], spare = k->numbers - 3;
    struct vec3 from = v3_scale(k->from, 1.0 / (k->observations ? k->observations : 1));
    point->seen_from[0] = (float)from.x, point->seen_from[1] = (float)from.y, point->seen_from[2] = (float)from.z;
    memset(point->covariance, 0, sizeof point->covariance);
    if (!invert_symmetric(k->information, 3, covariance))
        return;
    // Residuals larger than one standard deviation of chi-square above its mean enlarge the covariance.
    double grow = spare > 0 ? fmax(1, k->cost / (spare + sqrt(2 * spare))) : 1;
    for (int i = 0; i < 6; i++)
        point->covariance[i] = (float)(grow * covariance[ROW[i] * 3 + COLUMN[i]]);
}

enum status map_landmark_covariances(struct map *m)
{
    struct landmark_information *sums = calloc((size_t)m->point_count + 1, sizeof *sums);
    if (!sums)
        return fail(ERR_MEMORY, "no memory for the covariances of %d points", (int)m->point_count);
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

// Jacobian of a small motion of a tag, in its own axes, by a small motion of the whole world. 6 x 6, row-major.
static void tag_motion_by_world(const struct map_tag *tag, double out[36])
{
    double r[3][3];
    const struct vec3 t = tag->world_from_tag.translation;
    const double skew[3][3] = {{0, t.z, -t.y}, {-t.z, 0, t.x}, {t.y, -t.x, 0}}; // translation by rotation
    quat_to_matrix(tag->world_from_tag.rotation, r);
    memset(out, 0, 36 * sizeof *out);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            out[i * 6 + j] = out[(3 + i) * 6 + 3 + j] = r[j][i];
            for (int k = 0; k < 3; k++)
                out[(3 + i) * 6 + j] += r[k][i] * skew[k][j];
        }
}

// Weight of a tag's k-th number in the fit of a common motion: rotations count as far as they move its corners.
static double common_motion_weight(const struct map_tag *tag, int k)
{
    const double lever = tag->side_m / 2;
    return k < 3 ? lever * lever : 1;
}

// normal += J^T W J of one tag.
static void add_common_normal(const struct map_tag *tag, double normal[36])
{
    double jacobian[36];
    tag_motion_by_world(tag, jacobian);
    for (int k = 0; k < 6; k++)
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) {
                double weighted = common_motion_weight(tag, k) * jacobian[k * 6 + j];
                normal[i * 6 + j] += jacobian[k * 6 + i] * weighted;
            }
}

// The six columns of one tag: by = inverse J^T W. by: its first column; `stride` numbers to a row.
static void set_common_columns(const struct map_tag *tag, const double inverse[36], double *by, int stride)
{
    double jacobian[36];
    tag_motion_by_world(tag, jacobian);
    for (int k = 0; k < 6; k++)
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) {
                double weighted = common_motion_weight(tag, k) * jacobian[k * 6 + j];
                by[i * stride + k] += inverse[i * 6 + j] * weighted;
            }
}

// Weighted least squares: the motion of the whole world that fits small motions of all tags best, as a matrix of 6 rows
// and one column for each of the tags' numbers. False: no tag is mapped.
static bool fit_common_motion(const struct map *m, double *by)
{
    const int n = 6 * m->tag_count;
    double normal[36] = {0}, inverse[36];
    memset(by, 0, 6 * (size_t)n * sizeof *by);
    for (int32_t t = 0; t < m->tag_count; t++)
        if (m->tags[t].mapped)
            add_common_normal(&m->tags[t], normal);
    if (!invert_symmetric(normal, 6, inverse))
        return false;
    for (int32_t t = 0; t < m->tag_count; t++)
        if (m->tags[t].mapped)
            set_common_columns(&m->tags[t], inverse, by + (ptrdiff_t)6 * t, n);
    return true;
}

// Covariances of the common motion: with each tag's numbers (6 rows of n), and its own.
struct common_covariance {
    const double *with_tags;
    double own[36];
    int n;
};

// Element (a, b) of tag t's covariance `c` after the common motion is projected out:
// c - J_a H_b - J_b H_a + J_a C J_b^T, H = with_tags, C = own, J the tag's Jacobian.
static double without_common_motion(double c, const struct common_covariance *g, const double jacobian[36], int column,
                                    int a, int b)
{
    for (int i = 0; i < 6; i++) {
        const double *h = &g->with_tags[i * g->n + column];
        c -= jacobian[a * 6 + i] * h[b] + jacobian[b * 6 + i] * h[a];
        for (int j = 0; j < 6; j++)
            c += jacobian[a * 6 + i] * g->own[i * 6 + j] * jacobian[b * 6 + j];
    }
    return c;
}

// Removes the gauge freedom: the part of the tags' covariance that moves all of them together, because the tags
// themselves define the world. all: 6 tag_count on a side; its diagonal blocks change. common, half: 6 rows of
// 6 tag_count, scratch.
static void remove_gauge_freedom(const struct map *m, double *all, double *common, double *half)
{
    const int n = 6 * m->tag_count;
    struct common_covariance g = {.with_tags = half, .n = n};
    if (!fit_common_motion(m, common))
        return;
    memset(half, 0, 6 * (size_t)n * sizeof *half);
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < n; k++)
            for (int j = 0; j < n; j++)
                half[i * n + j] += common[i * n + k] * all[k * n + j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            for (int k = 0; k < n; k++)
                g.own[i * 6 + j] += half[i * n + k] * common[j * n + k];
    for (int32_t t = 0; t < m->tag_count; t++) {
        double jacobian[36];
        tag_motion_by_world(&m->tags[t], jacobian);
        for (int a = 0; a < 6; a++)
            for (int b = 0; b < 6; b++) {
                double *c = &all[(6 * t + a) * n + 6 * t + b];
                *c = without_common_motion(*c, &g, jacobian, 6 * t, a, b);
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
    enum status status = all && common && half
                             ? map_joint_tag_covariance(m, all)
                             : fail(ERR_MEMORY, "no memory for the covariances of %d tags", (int)m->tag_count);
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
