#include "capture/calibration/stereo_bundle.h"

#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

enum { LOCAL = BUNDLE_LENS + 2 * BUNDLE_POSE, MOST_STEPS = 60 };
#define HUBER_PX 0.3

static struct pose moved(struct pose p, const double d[BUNDLE_POSE])
{
    p.rotation = quat_unit(quat_multiply(quat_from_rotation_vector(v3(d[0], d[1], d[2])), p.rotation));
    p.translation = v3_add(p.translation, v3(d[3], d[4], d[5]));
    return p;
}

static double *lens_numbers(struct lens *l, int i)
{
    double *const at[BUNDLE_LENS] = {&l->fx, &l->fy, &l->cx, &l->cy, &l->k1, &l->k2, &l->p1, &l->p2};
    return at[i];
}

static bool predict(const struct lens *lens, const struct pose *camera_from_board, const double centre[2],
                    double radius, struct pixel *out)
{
    // Radon's rule for the disc, exact to degree 5: the centre, and six points at sqrt(2/3) of the radius
    static const double around[7][3] = {{0, 0, 0.25},
                                        {1, 0, 0.125},
                                        {0.5, 0.86602540378443865, 0.125},
                                        {-0.5, 0.86602540378443865, 0.125},
                                        {-1, 0, 0.125},
                                        {-0.5, -0.86602540378443865, 0.125},
                                        {0.5, -0.86602540378443865, 0.125}};
    const double reach = radius * 0.81649658092772603;
    double sum = 0;
    struct pixel at = {0, 0};
    for (int i = 0; i < 7; i++) {
        const struct vec3 p =
            pose_apply(*camera_from_board, v3(centre[0] + reach * around[i][0], centre[1] + reach * around[i][1], 0));
        if (!(p.z > 1e-3))
            return false;
        const struct pixel px = lens_project(lens, p);
        const double weight = around[i][2] / (p.z * p.z * p.z); // area in the image for area on a plane
        sum += weight;
        at.x += weight * px.x;
        at.y += weight * px.y;
    }
    *out = (struct pixel){at.x / sum, at.y / sum};
    return true;
}

bool stereo_predict(const struct stereo_bundle *b, const struct disc_sighting *s, struct pixel *out)
{
    const struct pose p = pose_multiply(b->camera_from_left[s->camera], b->left_from_board[s->board]);
    return predict(&b->lens[s->camera], &p, (double[2]){s->x_m, s->y_m}, b->radius_m, out);
}

// Prediction with the local unknowns moved: the camera's lens, the pose between the cameras, the board's pose.
static bool predict_moved(const struct stereo_bundle *b, const struct disc_sighting *s, int unknown, double step,
                          struct pixel *out)
{
    struct lens lens = b->lens[s->camera];
    struct pose camera = b->camera_from_left[s->camera], board = b->left_from_board[s->board];
    double d[BUNDLE_POSE] = {0};
    if (unknown < BUNDLE_LENS) {
        *lens_numbers(&lens, unknown) += step;
    } else if (unknown < BUNDLE_LENS + BUNDLE_POSE) {
        d[unknown - BUNDLE_LENS] = step;
        camera = moved(camera, d);
    } else {
        d[unknown - BUNDLE_LENS - BUNDLE_POSE] = step;
        board = moved(board, d);
    }
    const struct pose p = pose_multiply(camera, board);
    return predict(&lens, &p, (double[2]){s->x_m, s->y_m}, b->radius_m, out);
}

// The column of a local unknown among all; -1: it is fixed.
static int column_of(const struct disc_sighting *s, int unknown)
{
    if (unknown < BUNDLE_LENS)
        return s->camera * BUNDLE_LENS + unknown;
    if (unknown < BUNDLE_LENS + BUNDLE_POSE)
        return s->camera ? 2 * BUNDLE_LENS + unknown - BUNDLE_LENS : -1;
    return BUNDLE_SHARED + s->board * BUNDLE_POSE + unknown - BUNDLE_LENS - BUNDLE_POSE;
}

static double huber(double distance)
{
    return distance <= HUBER_PX ? distance * distance : HUBER_PX * (2 * distance - HUBER_PX);
}

static double cost(const struct stereo_bundle *b)
{
    double sum = 0;
    for (int i = 0; i < b->count; i++) {
        struct pixel at;
        if (b->seen[i].outlier)
            continue;
        if (!stereo_predict(b, &b->seen[i], &at))
            return 1e30;
        const double x = at.x - b->seen[i].at.x, y = at.y - b->seen[i].at.y;
        sum += huber(sqrt(x * x + y * y));
    }
    return sum;
}

struct system {
    int n;
    double *a, *g, *damped, *step; // J'J, -J'r; scratch; the solution
};

static void add_sighting(const struct stereo_bundle *b, const struct disc_sighting *s, struct system *m)
{
    struct pixel at, more, less;
    if (s->outlier || !stereo_predict(b, s, &at))
        return;
    const double rx = at.x - s->at.x, ry = at.y - s->at.y, distance = sqrt(rx * rx + ry * ry);
    const double weight = distance <= HUBER_PX ? 1 : HUBER_PX / distance;
    double j[LOCAL][2];
    int column[LOCAL];
    for (int k = 0; k < LOCAL; k++) {
        const double step = k < 4 ? 1e-3 : 1e-6;
        column[k] = column_of(s, k);
        j[k][0] = j[k][1] = 0;
        if (column[k] < 0 || !predict_moved(b, s, k, step, &more) || !predict_moved(b, s, k, -step, &less))
            continue;
        j[k][0] = (more.x - less.x) / (2 * step);
        j[k][1] = (more.y - less.y) / (2 * step);
    }
    for (int k = 0; k < LOCAL; k++) {
        if (column[k] < 0)
            continue;
        m->g[column[k]] -= weight * (j[k][0] * rx + j[k][1] * ry);
        for (int i = 0; i < LOCAL; i++)
            if (column[i] >= 0)
                m->a[column[k] * m->n + column[i]] += weight * (j[k][0] * j[i][0] + j[k][1] * j[i][1]);
    }
}

static void fill_system(const struct stereo_bundle *b, struct system *m)
{
    memset(m->a, 0, (size_t)(m->n * m->n) * sizeof *m->a);
    memset(m->g, 0, (size_t)m->n * sizeof *m->g);
    for (int i = 0; i < b->count; i++)
        add_sighting(b, &b->seen[i], m);
    for (int i = 0; i < m->n; i++)
        if (m->a[i * m->n + i] == 0) // nothing depends on it: it stays
            m->a[i * m->n + i] = 1;
}

static void apply(struct stereo_bundle *b, const double *step)
{
    for (int camera = 0; camera < 2; camera++)
        for (int i = 0; i < BUNDLE_LENS; i++)
            *lens_numbers(&b->lens[camera], i) += step[camera * BUNDLE_LENS + i];
    b->camera_from_left[1] = moved(b->camera_from_left[1], step + 2 * BUNDLE_LENS);
    for (int i = 0; i < b->boards; i++)
        b->left_from_board[i] = moved(b->left_from_board[i], step + BUNDLE_SHARED + i * BUNDLE_POSE);
}

static bool solve_damped(struct system *m, double damping)
{
    memcpy(m->damped, m->a, (size_t)(m->n * m->n) * sizeof *m->a);
    for (int i = 0; i < m->n; i++)
        m->damped[i * m->n + i] *= 1 + damping;
    memcpy(m->step, m->g, (size_t)m->n * sizeof *m->g);
    if (!cholesky_factor(m->damped, m->n))
        return false;
    cholesky_solve(m->damped, m->n, m->step);
    return true;
}

static void descend(struct stereo_bundle *b, struct system *m, struct pose *kept)
{
    double damping = 1e-3, now = cost(b);
    const size_t bytes = (size_t)b->boards * sizeof *kept;
    for (int i = 0; i < MOST_STEPS && damping < 1e8; i++) {
        fill_system(b, m);
        const struct stereo_bundle before = *b;
        memcpy(kept, b->left_from_board, bytes);
        bool better = false;
        double change = 0;
        while (!better && damping < 1e8) {
            if (solve_damped(m, damping)) {
                apply(b, m->step);
                const double then = cost(b);
                better = then < now;
                change = (now - then) / (now + 1e-12);
                now = better ? then : now;
            }
            if (!better) {
                *b = before;
                memcpy(b->left_from_board, kept, bytes);
            }
            damping *= better ? 0.2 : 8;
        }
        if (better && change < 1e-7)
            return;
    }
}

// Marks what is further off than any noise: 6 times the median distance, but at least 0.5 pixels.
static int mark_outliers(struct stereo_bundle *b, double *distances)
{
    int n = 0, marked = 0;
    for (int pass = 0; pass < 2; pass++) {
        double limit = 0.5;
        if (pass) {
            for (int i = 1; i < n; i++) // insertion sort; a few thousand values, nearly all small
                for (int k = i; k > 0 && distances[k] < distances[k - 1]; k--) {
                    const double t = distances[k];
                    distances[k] = distances[k - 1];
                    distances[k - 1] = t;
                }
            limit = n && 6 * distances[n / 2] > limit ? 6 * distances[n / 2] : limit;
        }
        for (int i = 0; i < b->count; i++) {
            struct pixel at = {1e9, 1e9};
            (void)stereo_predict(b, &b->seen[i], &at);
            const double x = at.x - b->seen[i].at.x, y = at.y - b->seen[i].at.y, distance = sqrt(x * x + y * y);
            if (!pass) {
                distances[n++] = distance;
            } else {
                b->seen[i].outlier = distance > limit;
                marked += b->seen[i].outlier;
            }
        }
    }
    return marked;
}

static void write_covariance(const struct stereo_bundle *b, struct system *m, double *covariance)
{
    double squares = 0;
    int n = 0;
    for (int i = 0; i < b->count; i++) {
        struct pixel at;
        if (b->seen[i].outlier || !stereo_predict(b, &b->seen[i], &at))
            continue;
        squares +=
            (at.x - b->seen[i].at.x) * (at.x - b->seen[i].at.x) + (at.y - b->seen[i].at.y) * (at.y - b->seen[i].at.y);
        n += 2;
    }
    const double variance = n > m->n ? squares / (n - m->n) : squares;
    fill_system(b, m);
    memset(covariance, 0, BUNDLE_SHARED * BUNDLE_SHARED * sizeof *covariance);
    if (!cholesky_factor(m->a, m->n))
        return;
    for (int k = 0; k < BUNDLE_SHARED; k++) {
        memset(m->step, 0, (size_t)m->n * sizeof *m->step);
        m->step[k] = 1;
        cholesky_solve(m->a, m->n, m->step);
        for (int i = 0; i < BUNDLE_SHARED; i++)
            covariance[k * BUNDLE_SHARED + i] = variance * m->step[i];
    }
}

enum status stereo_bundle_solve(struct stereo_bundle *b, double *covariance)
{
    struct system m = {.n = BUNDLE_SHARED + b->boards * BUNDLE_POSE};
    const size_t n = (size_t)m.n;
    m.a = malloc(n * n * sizeof *m.a);
    m.damped = malloc(n * n * sizeof *m.damped);
    m.g = malloc(n * sizeof *m.g);
    m.step = malloc(n * sizeof *m.step);
    struct pose *kept = malloc((size_t)b->boards * sizeof *kept);
    double *distances = malloc(((size_t)b->count + 1) * sizeof *distances);
    enum status status = OK;
    if (!m.a || !m.damped || !m.g || !m.step || !kept || !distances) {
        status = fail(ERR_MEMORY, "no memory to calibrate with %d boards", b->boards);
    } else {
        descend(b, &m, kept);
        if (mark_outliers(b, distances))
            descend(b, &m, kept);
        if (!(cost(b) < 1e20))
            status = fail(ERR_SOLVER, "the calibration did not converge");
        else if (covariance)
            write_covariance(b, &m, covariance);
    }
    free(m.a);
    free(m.damped);
    free(m.g);
    free(m.step);
    free(kept);
    free(distances);
    return status;
}
