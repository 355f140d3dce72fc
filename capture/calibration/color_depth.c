#include "capture/calibration/color_depth.h"

#include "base/depth_noise.h"
#include "base/least_squares.h"
#include "base/linear_algebra.h"
#include "capture/calibration/stereo_calibration.h"
#include "platform/files/image_file.h"

#include <stdlib.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

// All chosen by hand.
static const double MIN_RADIUS_PX = 6; // a smaller disc's edge is most of it
static const double HUBER_PX = 0.5;
static const double FOREIGN_PX = 2;      // residuals beyond: colour and depth do not show the same board
static const double MAX_SIGMA_M = 0.003; // a pose less certain than this is of no use
static const double MIN_DEPTH_M = 0.05, BEHIND_COST = 1e4; // of a point nearer than that, pixels^2
enum { MAX_STEPS = 50 };

struct disc_board disc_board_default(void) { return (struct disc_board){4, 3, 0.04, 0.05}; }

enum status color_depth_start(struct color_depth *color_depth, const struct calibration *calibration,
                              const struct disc_board *board)
{
    *color_depth = (struct color_depth){.calibration = *calibration, .board = *board, .nearest_m = INFINITY};
    if (calibration->color.width <= 0 || calibration->depth.width <= 0)
        return fail(ERR_INPUT, "colour to depth is calibrated with a sensor that has both; this one has only %s",
                    calibration->color.width > 0 ? "colour" : "depth");
    return OK;
}

void color_depth_free(struct color_depth *depth)
{
    free(depth->points);
    *depth = (struct color_depth){.count = 0};
}

// ---------------------------------------------------------------- discs in both images

// The whole lattice in reading order: columns to the right. False: circles are missing, or there are others.
static bool in_reading_order(const struct disc_board *board, const struct circle *found, int count, struct circle *out)
{
    struct pixel along[2] = {{0, 0}, {0, 0}}; // mean steps of the lattice's own column and row
    int max[2] = {0, 0};
    if (count != board->columns * board->rows)
        return false;
    for (int i = 0; i < count; i++) {
        max[0] = found[i].column > max[0] ? found[i].column : max[0];
        max[1] = found[i].row > max[1] ? found[i].row : max[1];
    }
    for (int i = 0; i < count; i++) {
        const double c = found[i].column - 0.5 * max[0], r = found[i].row - 0.5 * max[1];
        along[0].x += c * found[i].at.x, along[0].y += c * found[i].at.y;
        along[1].x += r * found[i].at.x, along[1].y += r * found[i].at.y;
    }
    // The axis that lies more along the image's rows is the columns'; the board is held upright.
    const bool exchanged = fabs(along[0].x) * fabs(along[1].y) < fabs(along[0].y) * fabs(along[1].x);
    const int columns = max[exchanged] + 1, rows = max[!exchanged] + 1;
    const double x = along[exchanged].x, y = along[!exchanged].y;
    if (columns != board->columns || rows != board->rows)
        return false;
    memset(out, 0, (size_t)count * sizeof *out);
    for (int i = 0; i < count; i++) {
        int c = exchanged ? found[i].row : found[i].column, r = exchanged ? found[i].column : found[i].row;
        c = x < 0 ? columns - 1 - c : c;
        r = y < 0 ? rows - 1 - r : r;
        out[r * columns + c] = found[i];
    }
    for (int i = 0; i < count; i++)
        if (out[i].area_px <= 0) // two circles in one place
            return false;
    return true;
}

// The board's plane 1 / z = a x + b y + c within a box of the depth image, by iteratively reweighted least squares: the
// discs and what lies behind are outliers. False: too little depth.
struct depth_box {
    int left, top, right, bottom;
};
static bool fit_board(const struct lens *lens, const uint16_t *depth, struct depth_box box, double plane[3])
{
    double scale = 0.15;
    for (int round = 0; round < 12; round++) {
        double n[9] = {0}, g[3] = {0};
        int count = 0;
        for (int y = box.top; y < box.bottom; y += 2)
            for (int x = box.left; x < box.right; x += 2) {
                const double z = depth[y * lens->width + x] * 1e-3;
                if (z <= 0)
                    continue;
                const double q[3] = {(x - lens->cx) / lens->fx, (y - lens->cy) / lens->fy, 1};
                const double off = round ? z - 1 / (plane[0] * q[0] + plane[1] * q[1] + plane[2]) : 0;
                const double weight = 1 / ((1 + off * off / (scale * scale)) * (1 + off * off / (scale * scale)));
                count++;
                for (int k = 0; k < 3; k++) {
                    g[k] += weight * q[k] / z;
                    for (int m = 0; m < 3; m++)
                        n[k * 3 + m] += weight * q[k] * q[m];
                }
            }
        if (count < 500 || !cholesky_factor(n, 3))
            return false;
        cholesky_solve(n, 3, g);
        memcpy(plane, g, sizeof g);
        scale = fmax(scale * 0.7, 0.008);
    }
    return true;
}

static double plane_depth(const double plane[3], const struct lens *lens, double x, double y)
{
    return 1 / (plane[0] * (x - lens->cx) / lens->fx + plane[1] * (y - lens->cy) / lens->fy + plane[2]);
}

// A picture of what stands off the board: 0 on the discs, 255 elsewhere.
static void draw_discs(const struct color_depth *color_depth, const uint16_t *depth, struct depth_box box,
                       const double plane[3], uint8_t *gray)
{
    const struct lens *l = &color_depth->calibration.depth;
    memset(gray, 255, (size_t)l->width * (size_t)l->height);
    for (int y = box.top; y < box.bottom; y++)
        for (int x = box.left; x < box.right; x++) {
            const double z = depth[y * l->width + x] * 1e-3, off = plane_depth(plane, l, x, y) - z;
            if (z > 0 && off > 0.5 * color_depth->board.standoff_m && off < 2 * color_depth->board.standoff_m)
                gray[y * l->width + x] = 0;
        }
}

// The disc's centre in depth axes: its centroid's ray, at the mean of how far its inner part stands off the board.
static bool disc_point(const struct color_depth *color_depth, const uint16_t *depth, const double plane[3],
                       const struct circle *disc, struct vec3 *out)
{
    const struct lens *l = &color_depth->calibration.depth;
    const double radius = 0.8 * sqrt(disc->area_px / PI);
    double sum = 0, count = 0;
    for (int y = (int)(disc->at.y - radius); y <= disc->at.y + radius; y++)
        for (int x = (int)(disc->at.x - radius); x <= disc->at.x + radius; x++) {
            const double dx = x - disc->at.x, dy = y - disc->at.y;
            if (x < 0 || y < 0 || x >= l->width || y >= l->height || dx * dx + dy * dy > radius * radius)
                continue;
            const double z = depth[y * l->width + x] * 1e-3, board = plane_depth(plane, l, x, y), off = board - z;
            if (z > 0 && off > 0.5 * color_depth->board.standoff_m && off < 2 * color_depth->board.standoff_m) {
                sum += z / board;
                count++;
            }
        }
    if (count < 20)
        return false;
    *out = v3_scale(lens_ray(l, disc->at), sum / count * plane_depth(plane, l, disc->at.x, disc->at.y));
    return true;
}

// Where the discs of the colour image should be in the depth image, with a margin of two radii.
static struct depth_box box_of(const struct color_depth *color_depth, const struct circle *discs, int count)
{
    const struct lens *color = &color_depth->calibration.color, *l = &color_depth->calibration.depth;
    double left = INFINITY, top = INFINITY, right = -INFINITY, bottom = -INFINITY, radius = 0;
    for (int i = 0; i < count; i++) {
        const struct pixel px = lens_project(l, lens_ray(color, discs[i].at));
        left = fmin(left, px.x), right = fmax(right, px.x);
        top = fmin(top, px.y), bottom = fmax(bottom, px.y);
        radius = fmax(radius, sqrt(discs[i].area_px / PI) * l->fx / color->fx);
    }
    const double margin = 2 * radius;
    const struct depth_box box = {(int)fmax(left - margin, 0), (int)fmax(top - margin, 0),
                                  (int)fmin(right + margin, l->width), (int)fmin(bottom + margin, l->height)};
    return box;
}

static enum status keep_points(struct color_depth *color_depth, const struct circle *color, const struct vec3 *points,
                               int count)
{
    if (color_depth->count + count > color_depth->capacity) {
        const int capacity = 2 * color_depth->capacity + 64 * count;
        struct color_depth_point *more = realloc(color_depth->points, (size_t)capacity * sizeof *more);
        if (!more)
            return fail(ERR_MEMORY, "no memory for the calibration's points");
        color_depth->points = more;
        color_depth->capacity = capacity;
    }
    for (int i = 0; i < count; i++) {
        color_depth->points[color_depth->count++] = (struct color_depth_point){points[i], color[i].at};
        color_depth->nearest_m = fmin(color_depth->nearest_m, points[i].z);
        color_depth->farthest_m = fmax(color_depth->farthest_m, points[i].z);
    }
    color_depth->views++;
    return OK;
}

struct disc_scratch {
    struct circle found[STEREO_MAX_CIRCLES], color[STEREO_MAX_CIRCLES], depth[STEREO_MAX_CIRCLES];
    struct vec3 points[STEREO_MAX_CIRCLES];
    uint8_t *gray;
};

static enum status find_discs(struct color_depth *color_depth, struct disc_scratch *scratch, const uint8_t *rgb,
                              const uint16_t *depth, enum color_depth_seen *seen)
{
    const struct lens *color = &color_depth->calibration.color, *l = &color_depth->calibration.depth;
    int count;
    double plane[3];
    image_gray(rgb, (size_t)color->width * (size_t)color->height, scratch->gray);
    enum status status = stereo_circles_find(scratch->gray, color->width, color->height, scratch->found, &count);
    *seen = DISCS_NOT_IN_COLOR;
    if (status != OK || !in_reading_order(&color_depth->board, scratch->found, count, scratch->color))
        return status;
    *seen = DISCS_TOO_FAR;
    for (int i = 0; i < count; i++)
        if (scratch->color[i].area_px < PI * MIN_RADIUS_PX * MIN_RADIUS_PX)
            return OK;
    *seen = DISCS_NOT_IN_DEPTH;
    const struct depth_box box = box_of(color_depth, scratch->color, count);
    if (!fit_board(l, depth, box, plane))
        return OK;
    draw_discs(color_depth, depth, box, plane, scratch->gray);
    status = stereo_circles_find(scratch->gray, l->width, l->height, scratch->found, &count);
    if (status != OK || !in_reading_order(&color_depth->board, scratch->found, count, scratch->depth))
        return status;
    for (int i = 0; i < count; i++)
        if (!disc_point(color_depth, depth, plane, &scratch->depth[i], &scratch->points[i]))
            return OK;
    *seen = DISCS_BOTH;
    return keep_points(color_depth, scratch->color, scratch->points, count);
}

enum status color_depth_add(struct color_depth *color_depth, const uint8_t *rgb, const uint16_t *depth,
                            enum color_depth_seen *seen)
{
    const struct lens *color = &color_depth->calibration.color, *l = &color_depth->calibration.depth;
    const size_t a = (size_t)color->width * (size_t)color->height, b = (size_t)l->width * (size_t)l->height;
    struct disc_scratch *s = malloc(sizeof *s);
    uint8_t *gray = malloc(a > b ? a : b);
    enum status status = s && gray ? OK : fail(ERR_MEMORY, "no memory to look for discs");
    if (status == OK) {
        s->gray = gray;
        status = find_discs(color_depth, s, rgb, depth, seen);
    }
    free(gray);
    free(s);
    if (status != OK)
        return status;
    color_depth->frames++;
    color_depth->no_color += *seen == DISCS_NOT_IN_COLOR;
    color_depth->no_depth += *seen == DISCS_NOT_IN_DEPTH;
    color_depth->too_far += *seen == DISCS_TOO_FAR;
    return OK;
}

// ---------------------------------------------------------------- the pose

// Two states, as base/least_squares.h names them. 6-vector: turn, then shift, on the left of the pose.
struct pose_fit {
    const struct color_depth *depth;
    struct pose color_from_depth[2];
    double squares[2]; // sum of squared residuals, pixels^2
};

static void add_point(struct pose_fit *fit, enum least_squares_state state, const struct color_depth_point *point,
                      struct least_squares_sums *sums)
{
    const struct lens *l = &fit->depth->calibration.color;
    const struct vec3 p = pose_apply(fit->color_from_depth[state], point->depth_axes), ray = lens_ray(l, point->color);
    if (p.z < MIN_DEPTH_M) {
        sums->cost += BEHIND_COST;
        return;
    }
    const double r[2] = {l->fx * (p.x / p.z - ray.x), l->fy * (p.y / p.z - ray.y)};
    const double length = sqrt(r[0] * r[0] + r[1] * r[1]), weight = length > HUBER_PX ? HUBER_PX / length : 1;
    const double d[2][3] = {{l->fx / p.z, 0, -l->fx * p.x / (p.z * p.z)}, {0, l->fy / p.z, -l->fy * p.y / (p.z * p.z)}};
    fit->squares[state] += length * length;
    sums->cost += length > HUBER_PX ? HUBER_PX * (2 * length - HUBER_PX) : length * length;
    for (int k = 0; k < 2; k++) {
        const struct vec3 row = v3(d[k][0], d[k][1], d[k][2]), turn = v3_cross(p, row);
        least_squares_add(sums, r[k], (const double[6]){turn.x, turn.y, turn.z, row.x, row.y, row.z}, weight);
    }
}

static bool sum_points(void *user, enum least_squares_state state, struct least_squares_sums *sums)
{
    struct pose_fit *fit = user;
    fit->squares[state] = 0;
    for (int i = 0; i < fit->depth->count; i++)
        add_point(fit, state, &fit->depth->points[i], sums);
    return true;
}

static bool move_pose(void *user, const double *d)
{
    struct pose_fit *fit = user;
    const struct pose step = {quat_from_rotation_vector(v3(d[0], d[1], d[2])), v3(d[3], d[4], d[5])};
    fit->color_from_depth[STATE_TRIED] = pose_multiply(step, fit->color_from_depth[STATE_KEPT]);
    return pose_finite(fit->color_from_depth[STATE_TRIED]);
}

static void keep_pose(void *user)
{
    struct pose_fit *fit = user;
    fit->color_from_depth[STATE_KEPT] = fit->color_from_depth[STATE_TRIED];
    fit->squares[STATE_KEPT] = fit->squares[STATE_TRIED];
}

static enum status why_so_few(const struct color_depth *depth)
{
    if (depth->too_far > depth->views)
        return fail(
            ERR_INPUT,
            "the board was too far away in %d of %d pictures: its discs are smaller than %.0f pixels; come nearer, "
            "until the board fills half of the picture",
            depth->too_far, depth->frames, 2 * MIN_RADIUS_PX);
    if (depth->no_depth > depth->views)
        return fail(
            ERR_INPUT,
            "%d of %d pictures show the discs in colour but not in depth: colour and depth do not belong together, "
            "or the discs do not stand %.0f mm off the board",
            depth->no_depth, depth->frames, depth->board.standoff_m * 1e3);
    return fail(
        ERR_INPUT,
        "only %d of %d pictures show the whole board of %d by %d discs in colour and depth; %d are needed, from "
        "different sides and distances",
        depth->views, depth->frames, depth->board.columns, depth->board.rows, COLOR_DEPTH_MIN_VIEWS);
}

enum status color_depth_solve(const struct color_depth *color_depth, struct pose *color_from_depth,
                              struct color_depth_report *report)
{
    static const struct least_squares_options options = {MAX_STEPS, 1e-3, 1e-9, 1e-12};
    double covariance[36], work[LEAST_SQUARES_WORK(6)], depth_sum = 0;
    *report = (struct color_depth_report){.views = color_depth->views, .points = color_depth->count};
    if (color_depth->views < COLOR_DEPTH_MIN_VIEWS)
        return why_so_few(color_depth);
    const struct pose start =
        color_depth->calibration.registered ? POSE_IDENTITY : color_depth->calibration.color_from_depth;
    struct pose_fit fit = {.depth = color_depth, .color_from_depth = {start}};
    const struct least_squares_problem problem = {6, &fit, move_pose, sum_points, keep_pose, NULL};
    struct least_squares_sums sums;
    (void)least_squares_solve(&problem, &options, work, &sums);
    const struct pose pose = fit.color_from_depth[STATE_KEPT];
    const double squares = fit.squares[STATE_KEPT];
    for (int i = 0; i < color_depth->count; i++)
        depth_sum += color_depth->points[i].depth_axes.z;
    report->rms_px = sqrt(squares / color_depth->count);
    report->rms_mm = report->rms_px * depth_sum / color_depth->count / color_depth->calibration.color.fx * 1e3;
    const struct pose change = pose_multiply(pose, pose_inverse(start));
    report->shift_mm = v3_length(change.translation) * 1e3;
    report->turn_deg = v3_length(quat_to_rotation_vector(change.rotation)) * 180 / PI;
    if (!(report->rms_px <= FOREIGN_PX) || !pose_finite(pose))
        return fail(
            ERR_INPUT,
            "colour and depth contradict each other by %.1f pixels: the pictures are swapped or mirrored, were not "
            "taken at the same time, or a lens is wrong",
            report->rms_px);
    if (!invert_symmetric(sums.a, 6, covariance))
        return fail(ERR_SOLVER,
                    "the views do not fix the pose between colour and depth; show the board tilted, from different "
                    "sides and distances");
    const double variance = squares / (2 * color_depth->count - 6);
    for (int k = 0; k < 3; k++) {
        report->sigma_deg = fmax(report->sigma_deg, sqrt(variance * covariance[7 * k]) * 180 / PI);
        report->sigma_mm = fmax(report->sigma_mm, sqrt(variance * covariance[7 * (k + 3)]) * 1e3);
    }
    if (report->sigma_mm > MAX_SIGMA_M * 1e3)
        return fail(ERR_INPUT,
                    "the pose between colour and depth is certain to %.1f mm only; show the board from %.1f m and from "
                    "twice as far, tilted, in the picture's corners too",
                    report->sigma_mm, color_depth->nearest_m);
    *color_from_depth = pose;
    return OK;
}
