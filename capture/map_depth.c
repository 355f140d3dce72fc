// By how much the sensor's depth is long or short: tags of known size say how large the place is, depth says it again,
// and where the two differ the sensor is off by the same share everywhere. One step of the joint adjustment with that
// share as one more unknown, over everything that is seen.
#include "capture/map_internal.h"
#include "locate/linear.h"

#include <stdlib.h>
#include <string.h>

static const double ROBUST = 3; // as in the adjustment, standard deviations
static const double USUAL = 0.01; // sensors are off by about so much
static const double MOST = 0.05; // more is no error of scale
static const double LOOSE = 1;    // m and rad: nothing holds the world but this

// Unknown are a small motion (turn, shift) of each placed camera, in its axes, and of each tag, in its own; last the share.
// Points are eliminated one by one.
struct unknowns {
    int32_t camera[MAP_MOST_FRAMES]; // the first number of each frame; -1: not placed
    int32_t *tag;                    // the same of each tag; -1: stays where it is
    int32_t count;
    double *a, *g; // count x count, lower triangle; what is left of the errors
};

// What one error says of some unknowns: `rows` whitened errors and how they go with each of `size` unknowns.
struct errors {
    int rows, size;
    int32_t which[13];
    double e[8], by[8][13];
};

static void whitened(struct errors *s, double w[8][8], double bound)
{
    double e[8] = {0}, by[8][13] = {{0}}, chi2 = 0;
    for (int r = 0; r < s->rows; r++) {
        for (int k = 0; k < s->rows; k++) {
            e[r] += w[r][k] * s->e[k];
            for (int c = 0; c < s->size; c++)
                by[r][c] += w[r][k] * s->by[k][c];
        }
        chi2 += e[r] * e[r];
    }
    double root = sqrt(1 / (1 + chi2 / bound)); // of the loss's slope
    for (int r = 0; r < s->rows; r++) {
        s->e[r] = root * e[r];
        for (int c = 0; c < s->size; c++)
            s->by[r][c] = root * by[r][c];
    }
}

static void add(struct unknowns *u, const struct errors *s)
{
    for (int i = 0; i < s->size; i++)
        for (int j = 0; j < s->size && s->which[i] >= 0; j++)
            for (int r = 0; r < s->rows && s->which[j] >= 0 && s->which[j] <= s->which[i]; r++)
                u->a[(size_t)s->which[i] * (size_t)u->count + (size_t)s->which[j]] += s->by[r][i] * s->by[r][j];
    for (int i = 0; i < s->size; i++)
        for (int r = 0; r < s->rows && s->which[i] >= 0; r++)
            u->g[s->which[i]] -= s->by[r][i] * s->e[r];
}

static void name_unknowns(const struct unknowns *u, int32_t frame, int32_t tag, struct errors *s)
{
    s->size = tag < 0 ? 7 : 13;
    for (int i = 0; i < 6; i++) {
        s->which[i] = u->camera[frame] + i;
        if (tag >= 0)
            s->which[6 + i] = u->tag[tag] < 0 ? -1 : u->tag[tag] + i;
    }
    s->which[s->size - 1] = u->count - 1;
}

// How the picture of p, camera axes, goes with p: two rows, pixels a metre.
static void picture_by_point(const struct lens *lens, struct vec3 p, struct vec3 row[2])
{
    row[0] = v3(lens->fx / p.z, 0, -lens->fx * p.x / (p.z * p.z));
    row[1] = v3(0, lens->fy / p.z, -lens->fy * p.y / (p.z * p.z));
}

// A number that goes with p by `row`, by a small motion (turn, shift) that takes p along.
static void by_motion(struct vec3 row, struct vec3 p, double out[6])
{
    struct vec3 turn = v3_cross(p, row);
    const double all[6] = {turn.x, turn.y, turn.z, row.x, row.y, row.z};
    memcpy(out, all, sizeof all);
}

static void add_corners(struct unknowns *u, const struct map *m, int32_t frame, int32_t k)
{
    const struct map_frame *f = &m->frames[frame];
    const struct map_tag *tag = &m->tags[f->which[k]];
    const struct lens *lens = &m->calibration.color;
    struct pose camera_from_tag = pose_multiply(f->camera_from_world, tag->world_from_tag);
    struct quat back = quat_conjugate(camera_from_tag.rotation);
    struct errors s = {.rows = 8};
    double half = tag->side_m / 2, w[8][8];
    name_unknowns(u, frame, f->which[k], &s);
    for (int c = 0; c < 4; c++) {
        struct vec3 own = v3(c == 1 || c == 2 ? half : -half, c >= 2 ? half : -half, 0), row[2];
        struct vec3 p = pose_apply(camera_from_tag, own);
        if (!(p.z > 1e-3))
            return;
        picture_by_point(lens, p, row);
        s.e[2 * c] = lens->fx * (p.x / p.z - f->seen[k].ray[c].x);
        s.e[2 * c + 1] = lens->fy * (p.y / p.z - f->seen[k].ray[c].y);
        for (int i = 0; i < 2; i++) {
            by_motion(row[i], p, s.by[2 * c + i]);
            by_motion(quat_rotate(back, row[i]), own, s.by[2 * c + i] + 6);
        }
    }
    map_whiten(&f->seen[k], w);
    whitened(&s, w, 8 * ROBUST * ROBUST);
    add(u, &s);
}

static void add_plane_depths(struct unknowns *u, const struct map *m, int32_t frame, int32_t k)
{
    const struct map_frame *f = &m->frames[frame];
    struct pose camera_from_tag = pose_multiply(f->camera_from_world, m->tags[f->which[k]].world_from_tag);
    struct quat back = quat_conjugate(camera_from_tag.rotation);
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1)), centre = camera_from_tag.translation;
    for (int32_t i = 0; i < f->depths[k].count; i++) {
        const struct depth_sample *d = &f->depths[k].sample[i];
        struct vec3 ray = v3(d->x, d->y, 1);
        double slant = v3_dot(normal, ray), z = v3_dot(normal, centre) / slant;
        if (!(fabs(slant) > 1e-3))
            continue;
        struct errors s = {.rows = 1, .e = {z - d->z}};
        name_unknowns(u, frame, f->which[k], &s);
        struct vec3 turn = v3_scale(v3_cross(normal, ray), -z / slant), shift = v3_scale(normal, 1 / slant);
        struct vec3 tag_turn = quat_rotate(back, v3_add(turn, v3_scale(v3_cross(normal, centre), 1 / slant)));
        const double by[13] = {turn.x,     turn.y,     turn.z, shift.x, shift.y,   shift.z, tag_turn.x,
                               tag_turn.y, tag_turn.z, 0,      0,       1 / slant, z};
        memcpy(s.by[0], by, sizeof by);
        double w[8][8] = {{sqrt(f->depths[k].share) / depth_sigma(d->z)}};
        whitened(&s, w, ROBUST * ROBUST);
        add(u, &s);
    }
}

// One sighting of a point: of camera and share, and of the point itself.
struct point_errors {
    struct errors seen;
    double by_point[3][3];
};

static bool look_at_point(const struct unknowns *u, const struct map *m, int32_t frame, const struct map_feature *s,
                          struct point_errors *out)
{
    const struct map_frame *f = &m->frames[frame];
    const struct lens *lens = &m->calibration.color;
    struct quat back = quat_conjugate(f->camera_from_world.rotation);
    struct vec3 p = pose_apply(f->camera_from_world, m->points[s->point].world), ray = lens_ray(lens, s->feature.at);
    struct vec3 row[3];
    double c[3];
    if (!(p.z > 1e-3))
        return false;
    feature_covariance(&s->feature, c);
    double a = 1 / sqrt(c[0]), d = 1 / sqrt(c[2] - c[1] * c[1] / c[0]), b = -d * c[1] / c[0];
    double w[8][8] = {{a}, {b, d}, {0, 0, s->depth > 0 ? 1 / depth_sigma(s->depth) : 0}};
    *out = (struct point_errors){
        .seen = {.rows = 3,
                 .e = {lens->fx * (p.x / p.z - ray.x), lens->fy * (p.y / p.z - ray.y), p.z - s->depth}}};
    name_unknowns(u, frame, -1, &out->seen);
    picture_by_point(lens, p, row);
    row[2] = v3(0, 0, 1);
    struct errors all = out->seen; // with the point's own three numbers behind the others
    all.size = 10;
    for (int r = 0; r < 3; r++) {
        struct vec3 world = quat_rotate(back, row[r]);
        by_motion(row[r], p, all.by[r]);
        all.by[r][6] = r == 2 ? p.z : 0;
        all.by[r][7] = world.x;
        all.by[r][8] = world.y;
        all.by[r][9] = world.z;
    }
    whitened(&all, w, ROBUST * ROBUST);
    for (int r = 0; r < 3; r++)
        memcpy(out->by_point[r], all.by[r] + 7, sizeof out->by_point[r]);
    all.size = 7;
    out->seen = all;
    return true;
}

// by^T by_point, 7 x 3.
static void cross(const struct point_errors *s, double out[7][3])
{
    for (int i = 0; i < 7; i++)
        for (int c = 0; c < 3; c++) {
            out[i][c] = 0;
            for (int r = 0; r < 3; r++)
                out[i][c] += s->seen.by[r][i] * s->by_point[r][c];
        }
}

// All sightings of one point, and then the point is no unknown any more.
static void add_point(struct unknowns *u, const struct point_errors *seen, int count, bool held)
{
    double own[9] = {0}, left[3] = {0}, inverse[9];
    for (int n = 0; n < count; n++) {
        add(u, &seen[n].seen);
        for (int r = 0; r < 3; r++)
            for (int i = 0; i < 3; i++) {
                left[i] -= seen[n].by_point[r][i] * seen[n].seen.e[r];
                for (int j = 0; j < 3; j++)
                    own[i * 3 + j] += seen[n].by_point[r][i] * seen[n].by_point[r][j];
            }
    }
    if (held || !invert_symmetric(own, 3, inverse))
        return;
    for (int n = 0; n < count; n++) {
        double half[7][3], other[7][3], weighed[7][3];
        cross(&seen[n], half);
        for (int i = 0; i < 7; i++)
            for (int c = 0; c < 3; c++)
                weighed[i][c] = half[i][0] * inverse[c] + half[i][1] * inverse[3 + c] + half[i][2] * inverse[6 + c];
        for (int i = 0; i < 7; i++)
            for (int c = 0; c < 3; c++)
                u->g[seen[n].seen.which[i]] -= weighed[i][c] * left[c];
        for (int k = 0; k < count; k++) {
            cross(&seen[k], other);
            for (int i = 0; i < 7; i++)
                for (int j = 0; j < 7; j++) {
                    size_t row = (size_t)seen[n].seen.which[i], column = (size_t)seen[k].seen.which[j];
                    if (column <= row)
                        u->a[row * (size_t)u->count + column] -= weighed[i][0] * other[j][0] +
                                                                 weighed[i][1] * other[j][1] +
                                                                 weighed[i][2] * other[j][2];
                }
        }
    }
}

// Which features show each point: those of point p are order[start[p]] .. order[start[p + 1] - 1].
struct shown {
    struct {
        int32_t frame, feature;
    } *order;
    int32_t *start;
    int32_t most; // of one point
};

static bool list_sightings(const struct map *m, struct shown *s)
{
    int32_t total = 0;
    s->start = calloc((size_t)m->point_count + 2, sizeof *s->start);
    for (int32_t i = 0; i < m->frame_count && s->start; i++)
        for (int32_t k = 0; m->frames[i].placed && k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0) {
                s->start[m->frames[i].features[k].point + 2]++;
                total++;
            }
    s->order = malloc((size_t)(total + 1) * sizeof *s->order);
    if (!s->start || !s->order)
        return false;
    for (int32_t p = 2; p < m->point_count + 2; p++) {
        s->most = s->start[p] > s->most ? s->start[p] : s->most;
        s->start[p] += s->start[p - 1];
    }
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; m->frames[i].placed && k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0) {
                int32_t n = s->start[m->frames[i].features[k].point + 1]++;
                s->order[n].frame = i;
                s->order[n].feature = k;
            }
    return true;
}

static enum status add_points(struct unknowns *u, const struct map *m)
{
    struct shown s = {0};
    struct point_errors *seen = NULL;
    bool listed = list_sightings(m, &s);
    if (listed)
        seen = malloc((size_t)(s.most + 1) * sizeof *seen);
    for (int32_t p = 0; p < m->point_count && seen; p++) {
        int count = 0;
        for (int32_t n = s.start[p]; n < s.start[p + 1]; n++) {
            int32_t frame = s.order[n].frame;
            count += look_at_point(u, m, frame, &m->frames[frame].features[s.order[n].feature], &seen[count]);
        }
        add_point(u, seen, count, p < m->held_points);
    }
    enum status status = seen ? OK : fail(ERR_MEMORY, "no memory to weigh depth");
    free(seen);
    free(s.order);
    free(s.start);
    return status;
}

static bool number_unknowns(struct unknowns *u, const struct map *m)
{
    u->tag = malloc((size_t)(m->tag_count + 1) * sizeof *u->tag);
    for (int32_t i = 0; i < m->frame_count; i++) {
        u->camera[i] = m->frames[i].placed ? u->count : -1;
        u->count += m->frames[i].placed ? 6 : 0;
    }
    for (int32_t i = 0; i < m->tag_count && u->tag; i++) {
        bool moves = m->tags[i].mapped && !m->tags[i].held;
        u->tag[i] = moves ? u->count : -1;
        u->count += moves ? 6 : 0;
    }
    u->count++;
    u->a = calloc((size_t)u->count * (size_t)u->count, sizeof *u->a);
    u->g = calloc((size_t)u->count, sizeof *u->g);
    return u->tag && u->a && u->g;
}

// *share: depth readings are so much too long.
static enum status estimate(const struct map *m, double *share)
{
    struct unknowns u = {.count = 0};
    enum status status = number_unknowns(&u, m) ? OK : fail(ERR_MEMORY, "no memory to weigh depth");
    for (int32_t i = 0; i < m->frame_count && status == OK; i++)
        for (int32_t k = 0; m->frames[i].placed && k < m->frames[i].seen_count; k++)
            if (m->tags[m->frames[i].which[k]].mapped) {
                add_corners(&u, m, i, k);
                add_plane_depths(&u, m, i, k);
            }
    if (status == OK)
        status = add_points(&u, m);
    for (int i = 0; i < u.count && status == OK; i++)
        u.a[(size_t)i * (size_t)(u.count + 1)] += i < u.count - 1 ? 1 / (LOOSE * LOOSE) : 1 / (USUAL * USUAL);
    *share = 0;
    if (status == OK && cholesky(u.a, u.count)) {
        cholesky_solve(u.a, u.count, u.g);
        *share = u.g[u.count - 1];
    }
    free(u.tag);
    free(u.a);
    free(u.g);
    return status;
}

enum status map_true_depth(struct map *m)
{
    double share;
    bool tags = false;
    for (int32_t i = 0; i < m->tag_count; i++)
        tags = tags || m->tags[i].mapped;
    if (!tags)
        return OK;
    enum status status = estimate(m, &share);
    if (status != OK || !(fabs(share) < MOST))
        return status;
    double times = 1 / (1 + share);
    m->depth_times *= times;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; k < f->feature_count; k++)
            f->features[k].depth *= times;
        for (int32_t k = 0; k < f->seen_count; k++)
            for (int32_t d = 0; d < f->depths[k].count; d++)
                f->depths[k].sample[d].z *= times;
    }
    return OK;
}
