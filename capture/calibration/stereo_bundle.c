#include "capture/calibration/stereo_bundle.h"

#include "base/least_squares.h"
#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

enum { LOCAL = BUNDLE_LENS + 2 * BUNDLE_POSE, MAX_STEPS = 200 };
#define HUBER_PX    0.3
#define MIN_DEPTH_M 1e-3 // before the camera

static struct pose moved_pose(struct pose pose, const double d[BUNDLE_POSE])
{
    pose.rotation = quat_unit(quat_multiply(quat_from_rotation_vector(v3(d[0], d[1], d[2])), pose.rotation));
    pose.translation = v3_add(pose.translation, v3(d[3], d[4], d[5]));
    return pose;
}

static double *lens_numbers(struct lens *lens, int i)
{
    double *const at[BUNDLE_LENS] = {&lens->fx, &lens->fy, &lens->cx, &lens->cy,
                                     &lens->k1, &lens->k2, &lens->p1, &lens->p2};
    return at[i];
}

// Radon's rule for a disc of radius 1, exact to degree 5: the centre, and six points at sqrt(2/3) of the radius; x, y,
// share of the area.
enum { DISC_POINTS = 7 };
#define DISC_REACH 0.81649658092772603
static const double disc_point[DISC_POINTS][3] = {{0, 0, 0.25},
                                                  {DISC_REACH, 0, 0.125},
                                                  {DISC_REACH * 0.5, DISC_REACH * 0.86602540378443865, 0.125},
                                                  {DISC_REACH * -0.5, DISC_REACH * 0.86602540378443865, 0.125},
                                                  {-DISC_REACH, 0, 0.125},
                                                  {DISC_REACH * -0.5, DISC_REACH * -0.86602540378443865, 0.125},
                                                  {DISC_REACH * 0.5, DISC_REACH * -0.86602540378443865, 0.125}};

// A board's x and y axes.
struct board_axes {
    struct vec3 x, y;
};

static struct board_axes axes_of(struct quat a_from_board)
{
    return (struct board_axes){quat_rotate(a_from_board, v3(1, 0, 0)), quat_rotate(a_from_board, v3(0, 1, 0))};
}

static struct vec3 point_of_disc(const struct stereo_bundle *bundle, const struct disc_sighting *sighting,
                                 const struct board_axes *axes, int i)
{
    return v3_add(v3_scale(axes->x, sighting->x_m + bundle->radius_m * disc_point[i][0]),
                  v3_scale(axes->y, sighting->y_m + bundle->radius_m * disc_point[i][1]));
}

// lens_project's distortion, whose sixth-degree term is not estimated here and 0; inlined, for it is done most of all.
static inline struct pixel distort_point(const struct lens *lens, double x, double y)
{
    const double r2 = x * x + y * y, radial = 1 + r2 * (lens->k1 + r2 * lens->k2);
    return (struct pixel){x * radial + 2 * lens->p1 * x * y + lens->p2 * (r2 + 2 * x * x),
                          y * radial + lens->p1 * (r2 + 2 * y * y) + 2 * lens->p2 * x * y};
}

static bool predict_disc(const struct stereo_bundle *bundle, const struct disc_sighting *sighting,
                         const struct pose *camera_from_board, struct pixel *out)
{
    const struct lens *l = &bundle->lens[sighting->camera];
    const struct board_axes axes = axes_of(camera_from_board->rotation);
    double sum = 0;
    struct pixel at = {0, 0};
    for (int i = 0; i < DISC_POINTS; i++) {
        const struct vec3 p = v3_add(point_of_disc(bundle, sighting, &axes, i), camera_from_board->translation);
        if (!(p.z > MIN_DEPTH_M))
            return false;
        const struct pixel px = distort_point(l, p.x / p.z, p.y / p.z);
        const double weight = disc_point[i][2] / (p.z * p.z * p.z); // area in the image for area on a plane
        sum += weight;
        at.x += weight * px.x;
        at.y += weight * px.y;
    }
    *out = (struct pixel){l->fx * at.x / sum + l->cx, l->fy * at.y / sum + l->cy};
    return true;
}

bool stereo_predict(const struct stereo_bundle *bundle, const struct disc_sighting *sighting, struct pixel *out)
{
    const struct pose p =
        pose_multiply(bundle->camera_from_left[sighting->camera], bundle->left_from_board[sighting->board]);
    return predict_disc(bundle, sighting, &p, out);
}

// The pixel of a point, and its derivatives by the lens (row, column) and by the point.
struct projection {
    struct pixel at;
    double by_lens[2][BUNDLE_LENS];
    struct vec3 by_point[2];
};

static void project_with_jacobian(const struct lens *lens, struct vec3 p, struct projection *out)
{
    const double x = p.x / p.z, y = p.y / p.z, r2 = x * x + y * y;
    const double radial = 1 + r2 * (lens->k1 + r2 * lens->k2), slope = 2 * (lens->k1 + 2 * r2 * lens->k2);
    const struct pixel d = distort_point(lens, x, y);
    const double xx = radial + slope * x * x + 2 * lens->p1 * y + 6 * lens->p2 * x; // d d.x / d x
    const double xy = slope * x * y + 2 * lens->p1 * x + 2 * lens->p2 * y;          // d d.x / d y = d d.y / d x
    const double yy = radial + slope * y * y + 6 * lens->p1 * y + 2 * lens->p2 * x; // d d.y / d y
    const double rows[2][BUNDLE_LENS] = {
        {d.x, 0, 1, 0, lens->fx * x * r2, lens->fx * x * r2 * r2, lens->fx * 2 * x * y, lens->fx * (r2 + 2 * x * x)},
        {0, d.y, 0, 1, lens->fy * y * r2, lens->fy * y * r2 * r2, lens->fy * (r2 + 2 * y * y), lens->fy * 2 * x * y}};
    memcpy(out->by_lens, rows, sizeof rows);
    out->at = (struct pixel){lens->fx * d.x + lens->cx, lens->fy * d.y + lens->cy};
    out->by_point[0] = v3_scale(v3(xx, xy, -xx * x - xy * y), lens->fx / p.z);
    out->by_point[1] = v3_scale(v3(xy, yy, -xy * x - yy * y), lens->fy / p.z);
}

// Adds how a number moves with each of a pose's unknowns, which turn about the frame's origin and shift, where `by` is
// how it moves with the point that is `turned`.
static void add_pose_slopes(struct vec3 turned, struct vec3 by, double out[BUNDLE_POSE])
{
    const struct vec3 turn = v3_cross(turned, by); // by . (axis x turned) = axis . (turned x by)
    out[0] += turn.x;
    out[1] += turn.y;
    out[2] += turn.z;
    out[3] += by.x;
    out[4] += by.y;
    out[5] += by.z;
}

// As stereo_predict, with the derivatives by the local unknowns: the camera's lens, the pose between the cameras, the
// board's pose (as `moved` moves them).
static bool predict_with_slopes(const struct stereo_bundle *bundle, const struct disc_sighting *sighting,
                                struct pixel *out, double slope[LOCAL][2])
{
    const struct pose camera = bundle->camera_from_left[sighting->camera],
                      board = bundle->left_from_board[sighting->board];
    const struct quat left_from_camera = quat_conjugate(camera.rotation);
    const struct board_axes axes = axes_of(board.rotation);
    double sum = 0, slopes[3][LOCAL] = {{0}}; // of at.x, at.y and sum
    struct pixel at = {0, 0};
    for (int i = 0; i < DISC_POINTS; i++) {
        const struct vec3 on_board = point_of_disc(bundle, sighting, &axes, i);
        const struct vec3 turned = quat_rotate(camera.rotation, v3_add(on_board, board.translation));
        const struct vec3 p = v3_add(turned, camera.translation);
        if (!(p.z > MIN_DEPTH_M))
            return false;
        struct projection seen;
        project_with_jacobian(&bundle->lens[sighting->camera], p, &seen);
        const double weight = disc_point[i][2] / (p.z * p.z * p.z), weight_by_z = -3 * weight / p.z;
        sum += weight;
        at.x += weight * seen.at.x;
        at.y += weight * seen.at.y;
        const struct vec3 by_point[3] = {
            v3_add(v3_scale(seen.by_point[0], weight), v3(0, 0, weight_by_z * seen.at.x)),
            v3_add(v3_scale(seen.by_point[1], weight), v3(0, 0, weight_by_z * seen.at.y)),
            v3(0, 0, weight_by_z),
        };
        for (int r = 0; r < 3; r++) {
            for (int k = 0; r < 2 && k < BUNDLE_LENS; k++)
                slopes[r][k] += weight * seen.by_lens[r][k];
            add_pose_slopes(turned, by_point[r], slopes[r] + BUNDLE_LENS);
            add_pose_slopes(on_board, quat_rotate(left_from_camera, by_point[r]),
                            slopes[r] + BUNDLE_LENS + BUNDLE_POSE);
        }
    }
    *out = (struct pixel){at.x / sum, at.y / sum};
    for (int k = 0; k < LOCAL; k++) {
        slope[k][0] = (slopes[0][k] - out->x * slopes[2][k]) / sum;
        slope[k][1] = (slopes[1][k] - out->y * slopes[2][k]) / sum;
    }
    return true;
}

// The column of a local unknown among all; -1: it is fixed.
static int column_of(const struct disc_sighting *sighting, int unknown)
{
    if (unknown < BUNDLE_LENS)
        return sighting->camera * BUNDLE_LENS + unknown;
    if (unknown < BUNDLE_LENS + BUNDLE_POSE)
        return sighting->camera ? 2 * BUNDLE_LENS + unknown - BUNDLE_LENS : -1;
    return BUNDLE_SHARED + sighting->board * BUNDLE_POSE + unknown - BUNDLE_LENS - BUNDLE_POSE;
}

static double huber_loss(double distance)
{
    return distance <= HUBER_PX ? distance * distance : HUBER_PX * (2 * distance - HUBER_PX);
}

double stereo_bundle_cost(const struct stereo_bundle *bundle)
{
    double sum = 0;
    for (int i = 0; i < bundle->count; i++) {
        struct pixel at;
        if (bundle->seen[i].outlier)
            continue;
        if (!stereo_predict(bundle, &bundle->seen[i], &at))
            return 1e30;
        const double x = at.x - bundle->seen[i].at.x, y = at.y - bundle->seen[i].at.y;
        sum += huber_loss(sqrt(x * x + y * y));
    }
    return sum;
}

// False: it is behind the camera.
static bool add_sighting(const struct stereo_bundle *bundle, const struct disc_sighting *sighting,
                         struct least_squares_sums *sums)
{
    struct pixel at;
    double j[LOCAL][2];
    int column[LOCAL];
    if (!predict_with_slopes(bundle, sighting, &at, j))
        return false;
    const double rx = at.x - sighting->at.x, ry = at.y - sighting->at.y, distance = sqrt(rx * rx + ry * ry);
    const double weight = distance <= HUBER_PX ? 1 : HUBER_PX / distance;
    sums->cost += huber_loss(distance);
    for (int k = 0; k < LOCAL; k++)
        column[k] = column_of(sighting, k);
    for (int k = 0; k < LOCAL; k++) {
        if (column[k] < 0)
            continue;
        sums->g[column[k]] -= weight * (j[k][0] * rx + j[k][1] * ry);
        for (int i = 0; i <= k; i++) // the columns rise
            if (column[i] >= 0)
                sums->a[column[k] * sums->n + column[i]] += weight * (j[k][0] * j[i][0] + j[k][1] * j[i][1]);
    }
    return true;
}

static bool add_sightings(const struct stereo_bundle *bundle, struct least_squares_sums *sums)
{
    bool in_front = true;
    for (int i = 0; i < bundle->count; i++)
        if (!bundle->seen[i].outlier && !add_sighting(bundle, &bundle->seen[i], sums))
            in_front = false;
    return in_front;
}

static void apply_step(struct stereo_bundle *bundle, const double *step)
{
    for (int camera = 0; camera < 2; camera++)
        for (int i = 0; i < BUNDLE_LENS; i++)
            *lens_numbers(&bundle->lens[camera], i) += step[camera * BUNDLE_LENS + i];
    bundle->camera_from_left[1] = moved_pose(bundle->camera_from_left[1], step + 2 * BUNDLE_LENS);
    for (int i = 0; i < bundle->boards; i++)
        bundle->left_from_board[i] = moved_pose(bundle->left_from_board[i], step + BUNDLE_SHARED + i * BUNDLE_POSE);
}

void stereo_bundle_move(struct stereo_bundle *bundle, int unknown, double step)
{
    double d[BUNDLE_POSE] = {0};
    if (unknown < 2 * BUNDLE_LENS) {
        *lens_numbers(&bundle->lens[unknown / BUNDLE_LENS], unknown % BUNDLE_LENS) += step;
    } else {
        d[unknown - 2 * BUNDLE_LENS] = step;
        bundle->camera_from_left[1] = moved_pose(bundle->camera_from_left[1], d);
    }
}

// The least squares' two states: the caller's bundle and one with boards of its own.
struct bundle_fit {
    struct stereo_bundle *bundle[2];
};

static void copy_unknowns(struct stereo_bundle *to, const struct stereo_bundle *from)
{
    struct pose *boards = to->left_from_board;
    *to = *from;
    to->left_from_board = boards;
    memcpy(boards, from->left_from_board, (size_t)from->boards * sizeof *boards);
}

static bool move_bundle(void *user, const double *step)
{
    struct bundle_fit *fit = user;
    copy_unknowns(fit->bundle[STATE_TRIED], fit->bundle[STATE_KEPT]);
    apply_step(fit->bundle[STATE_TRIED], step);
    return true;
}

static bool sum_sightings(void *user, enum least_squares_state state, struct least_squares_sums *sums)
{
    const struct bundle_fit *fit = user;
    return add_sightings(fit->bundle[state], sums);
}

static void keep_bundle(void *user)
{
    struct bundle_fit *fit = user;
    copy_unknowns(fit->bundle[STATE_KEPT], fit->bundle[STATE_TRIED]);
}

// Scratch of a solution: LEAST_SQUARES_WORK doubles, a pose for each board, and a number for each sighting.
struct bundle_scratch {
    double *work, *distances;
    struct pose *boards;
};

static int unknown_count(const struct stereo_bundle *bundle) { return BUNDLE_SHARED + bundle->boards * BUNDLE_POSE; }

static void minimize_cost(struct stereo_bundle *bundle, const struct bundle_scratch *scratch)
{
    static const struct least_squares_options options = {MAX_STEPS, 1e-3, 1e-7, 1e-12};
    struct stereo_bundle tried = {.left_from_board = scratch->boards};
    struct bundle_fit fit = {{bundle, &tried}};
    const struct least_squares_problem problem = {unknown_count(bundle), &fit,        move_bundle,
                                                  sum_sightings,         keep_bundle, NULL};
    struct least_squares_sums sums;
    (void)least_squares_solve(&problem, &options, scratch->work, &sums);
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// From where it was seen to where it is predicted, pixels; far for what is behind the camera.
static double distance_of(const struct stereo_bundle *bundle, const struct disc_sighting *sighting)
{
    struct pixel at;
    return stereo_predict(bundle, sighting, &at) ? hypot(at.x - sighting->at.x, at.y - sighting->at.y) : 1e9;
}

// Marks what is further off than any noise: 6 times the median distance, but at least 0.5 pixels.
static int mark_outliers(struct stereo_bundle *bundle, double *distances)
{
    int marked = 0;
    for (int i = 0; i < bundle->count; i++)
        distances[i] = distance_of(bundle, &bundle->seen[i]);
    qsort(distances, (size_t)bundle->count, sizeof *distances, compare_doubles);
    const double limit = bundle->count ? fmax(0.5, 6 * distances[bundle->count / 2]) : 0.5;
    for (int i = 0; i < bundle->count; i++) {
        bundle->seen[i].outlier = distance_of(bundle, &bundle->seen[i]) > limit;
        marked += bundle->seen[i].outlier;
    }
    return marked;
}

static void write_covariance(const struct stereo_bundle *bundle, double *work, double *covariance)
{
    const int unknowns = unknown_count(bundle);
    double squares = 0;
    int n = 0;
    for (int i = 0; i < bundle->count; i++) {
        struct pixel at;
        if (bundle->seen[i].outlier || !stereo_predict(bundle, &bundle->seen[i], &at))
            continue;
        squares += (at.x - bundle->seen[i].at.x) * (at.x - bundle->seen[i].at.x) +
                   (at.y - bundle->seen[i].at.y) * (at.y - bundle->seen[i].at.y);
        n += 2;
    }
    const double variance = n > unknowns ? squares / (n - unknowns) : squares;
    struct least_squares_sums sums = least_squares_zero(unknowns, work);
    (void)add_sightings(bundle, &sums);
    for (int i = 0; i < unknowns; i++)
        if (sums.a[i * unknowns + i] == 0) // nothing depends on it
            sums.a[i * unknowns + i] = 1;
    memset(covariance, 0, BUNDLE_SHARED * BUNDLE_SHARED * sizeof *covariance);
    if (!cholesky_factor(sums.a, unknowns))
        return;
    for (int k = 0; k < BUNDLE_SHARED; k++) {
        memset(sums.g, 0, (size_t)unknowns * sizeof *sums.g);
        sums.g[k] = 1;
        cholesky_solve(sums.a, unknowns, sums.g);
        for (int i = 0; i < BUNDLE_SHARED; i++)
            covariance[k * BUNDLE_SHARED + i] = variance * sums.g[i];
    }
}

enum status stereo_bundle_solve(struct stereo_bundle *bundle, double *covariance)
{
    const size_t n = (size_t)unknown_count(bundle);
    struct bundle_scratch scratch = {
        .work = malloc(LEAST_SQUARES_WORK(n) * sizeof *scratch.work),
        .distances = malloc(((size_t)bundle->count + 1) * sizeof *scratch.distances),
        .boards = malloc(((size_t)bundle->boards + 1) * sizeof *scratch.boards),
    };
    enum status status = OK;
    if (!scratch.work || !scratch.distances || !scratch.boards) {
        status = fail(ERR_MEMORY, "no memory to calibrate with %d boards", bundle->boards);
    } else {
        minimize_cost(bundle, &scratch);
        if (mark_outliers(bundle, scratch.distances))
            minimize_cost(bundle, &scratch);
        if (!(stereo_bundle_cost(bundle) < 1e20))
            status = fail(ERR_SOLVER, "the calibration did not converge");
        else if (covariance)
            write_covariance(bundle, scratch.work, covariance);
    }
    free(scratch.work);
    free(scratch.distances);
    free(scratch.boards);
    return status;
}
