#include "capture/calibration/stereo_calibration.h"

#include "base/linear_algebra.h"
#include "capture/calibration/stereo_bundle.h"

#include <stdlib.h>
#include <string.h>

enum { LEAST_CIRCLES = 16 };

// A homography from lattice (column, row) to pixels, by the normalised direct linear transform with h33 = 1.
static bool homography(const struct circle *c, int n, double h[9])
{
    enum { N = 8 };
    double a[N * N] = {0}, b[N] = {0};
    double mx = 0, my = 0;
    for (int i = 0; i < n; i++) {
        mx += c[i].at.x / n;
        my += c[i].at.y / n;
    }
    for (int i = 0; i < n; i++) {
        const double u = c[i].column * 0.1, v = c[i].row * 0.1, x = (c[i].at.x - mx) * 0.01,
                     y = (c[i].at.y - my) * 0.01;
        const double rows[2][N] = {{u, v, 1, 0, 0, 0, -u * x, -v * x}, {0, 0, 0, u, v, 1, -u * y, -v * y}};
        for (int r = 0; r < 2; r++)
            for (int j = 0; j < N; j++) {
                b[j] += rows[r][j] * (r ? y : x);
                for (int k = 0; k < N; k++)
                    a[j * N + k] += rows[r][j] * rows[r][k];
            }
    }
    if (!cholesky_factor(a, N))
        return false;
    cholesky_solve(a, N, b);
    const double raw[9] = {b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], 1};
    for (int k = 0; k < 3; k++) { // undo the scales and the shift
        const double lattice = k < 2 ? 0.1 : 1;
        h[k] = (raw[k] * 100 + mx * raw[6 + k]) * lattice;
        h[3 + k] = (raw[3 + k] * 100 + my * raw[6 + k]) * lattice;
        h[6 + k] = raw[6 + k] * lattice;
    }
    return true;
}

// Zhang's constraints for square pixels and a known principal point: each homography gives two equations in 1 / f^2.
static double focal_length(const double (*h)[9], int n, double cx, double cy)
{
    double num = 0, den = 0;
    for (int i = 0; i < n; i++) {
        double c[2][3];
        double size = 0;
        for (int k = 0; k < 2; k++) {
            c[k][0] = h[i][k] - cx * h[i][6 + k];
            c[k][1] = h[i][3 + k] - cy * h[i][6 + k];
            c[k][2] = h[i][6 + k];
            size += c[k][0] * c[k][0] + c[k][1] * c[k][1];
        }
        // c0'w c1 = 0, c0'w c0 = c1'w c1 with w = diag(q, q, 1), q = 1 / f^2
        const double a[2] = {(c[0][0] * c[1][0] + c[0][1] * c[1][1]) / size,
                             (c[0][0] * c[0][0] + c[0][1] * c[0][1] - c[1][0] * c[1][0] - c[1][1] * c[1][1]) / size};
        const double b[2] = {c[0][2] * c[1][2] / size, (c[0][2] * c[0][2] - c[1][2] * c[1][2]) / size};
        for (int k = 0; k < 2; k++) {
            num -= a[k] * b[k];
            den += a[k] * a[k];
        }
    }
    return num > 0 ? sqrt(den / num) : 0;
}

static struct pose board_pose(const double h[9], const struct lens *l, double pitch)
{
    struct vec3 c[3];
    for (int k = 0; k < 3; k++)
        c[k] = v3((h[k] - l->cx * h[6 + k]) / l->fx, (h[3 + k] - l->cy * h[6 + k]) / l->fy, h[6 + k]);
    double scale = 2 / (v3_length(c[0]) + v3_length(c[1]));
    if (c[2].z < 0)
        scale = -scale;
    const struct vec3 x = v3_unit(v3_scale(c[0], scale)), z = v3_unit(v3_cross(x, v3_scale(c[1], scale)));
    const struct vec3 y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), v3_scale(c[2], scale * pitch)};
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Radius over pitch: the median over circles of their area over their lattice cell's area.
static double disc_radius(const struct stereo_view *views, int count, double *scratch)
{
    int n = 0;
    for (int v = 0; v < count; v++)
        for (int camera = 0; camera < 2; camera++) {
            const struct circle *c = views[v].circles[camera];
            double h[9];
            if (views[v].count[camera] < LEAST_CIRCLES || !homography(c, views[v].count[camera], h))
                continue;
            const double det = h[0] * (h[4] * h[8] - h[5] * h[7]) - h[1] * (h[3] * h[8] - h[5] * h[6]) +
                               h[2] * (h[3] * h[7] - h[4] * h[6]);
            for (int i = 0; i < views[v].count[camera]; i++) {
                const double w = h[6] * c[i].column + h[7] * c[i].row + h[8];
                scratch[n++] = c[i].area_px / fabs(det / (w * w * w));
            }
        }
    if (!n)
        return 0;
    qsort(scratch, (size_t)n, sizeof *scratch, compare_doubles);
    return sqrt(scratch[n / 2] / 3.14159265358979);
}

struct single {
    struct lens lens;
    int view_of[512], boards; // which views this camera's boards are of
    struct pose camera_from_board[512];
};

static void add_sightings(struct stereo_bundle *b, const struct circle *c, int n, int camera, int board, double pitch)
{
    for (int i = 0; i < n; i++)
        b->seen[b->count++] =
            (struct disc_sighting){camera, board, c[i].column * pitch, c[i].row * pitch, c[i].at, false};
}

struct work {
    const struct stereo_board *board;
    const struct stereo_view *views;
    int count, width, height;
    struct single *one; // two
    struct stereo_bundle bundle;
    double (*homographies)[9];
};

static enum status calibrate_one(struct work *w, int camera)
{
    struct single *s = &w->one[camera];
    struct stereo_bundle *b = &w->bundle;
    s->boards = 0;
    for (int v = 0; v < w->count; v++)
        if (w->views[v].count[camera] >= LEAST_CIRCLES &&
            homography(w->views[v].circles[camera], w->views[v].count[camera], w->homographies[s->boards]))
            s->view_of[s->boards++] = v;
    const char *which = camera ? "right" : "left";
    if (s->boards < STEREO_LEAST_VIEWS)
        return fail(ERR_INPUT, "the board is in %d of the %s camera's %d pictures; at least %d are needed", s->boards,
                    which, w->count, STEREO_LEAST_VIEWS);
    s->lens =
        (struct lens){.width = w->width, .height = w->height, .cx = (w->width - 1) / 2.0, .cy = (w->height - 1) / 2.0};
    s->lens.fx = focal_length((const double(*)[9])w->homographies, s->boards, s->lens.cx, s->lens.cy);
    if (!(s->lens.fx > 0.2 * w->width && s->lens.fx < 20 * w->width))
        return fail(ERR_INPUT,
                    "the %s camera's focal length cannot be found from these pictures; turn the board by 30 degrees to "
                    "each side in some of them",
                    which);
    s->lens.fy = s->lens.fx;
    b->lens[0] = s->lens;
    b->camera_from_left[0] = b->camera_from_left[1] = POSE_IDENTITY;
    b->boards = s->boards;
    b->count = 0;
    for (int i = 0; i < s->boards; i++) {
        const struct stereo_view *v = &w->views[s->view_of[i]];
        b->left_from_board[i] = board_pose(w->homographies[i], &s->lens, w->board->pitch_m);
        add_sightings(b, v->circles[camera], v->count[camera], 0, i, w->board->pitch_m);
    }
    enum status status = stereo_bundle_solve(b, NULL);
    s->lens = b->lens[0];
    memcpy(s->camera_from_board, b->left_from_board, (size_t)s->boards * sizeof *s->camera_from_board);
    return status;
}

// The motion of the lattice that turns it by `quarter` quarter turns about its origin and then shifts it.
static struct pose lattice_motion(int quarter, double column, double row, double pitch)
{
    static const double half[4][2] = {{0, 1},
                                      {0.70710678118654752, 0.70710678118654752},
                                      {1, 0},
                                      {0.70710678118654752, -0.70710678118654752}}; // sine, cosine of half the angle
    return (struct pose){{0, 0, half[quarter][0], half[quarter][1]}, v3(column * pitch, row * pitch, 0)};
}

static int board_of(const struct single *s, int view)
{
    for (int i = 0; i < s->boards; i++)
        if (s->view_of[i] == view)
            return i;
    return -1;
}

static bool is_whole(const struct stereo_board *board, const struct circle *c, int n, bool *upright)
{
    int columns = 0, rows = 0;
    for (int i = 0; i < n; i++) {
        columns = c[i].column >= columns ? c[i].column + 1 : columns;
        rows = c[i].row >= rows ? c[i].row + 1 : rows;
    }
    *upright = columns == board->columns;
    return n == board->columns * board->rows &&
           ((columns == board->columns && rows == board->rows) || (columns == board->rows && rows == board->columns));
}

// right_from_left by one view, if the right camera's lattice is `motion` of the left's.
static struct pose rig_by(const struct work *w, int left, int right, struct pose left_lattice_from_right)
{
    return pose_multiply(w->one[1].camera_from_board[right],
                         pose_inverse(pose_multiply(w->one[0].camera_from_board[left], left_lattice_from_right)));
}

// The quarter turn that makes the cameras turned least against each other (they are, by less than 45 degrees).
static int quarter_of(const struct work *w, int left, int right)
{
    int best = 0;
    double least = 1e9;
    for (int q = 0; q < 4; q++) {
        const double angle = pose_angle(rig_by(w, left, right, lattice_motion(q, 0, 0, 0)), POSE_IDENTITY);
        if (angle < least) {
            least = angle;
            best = q;
        }
    }
    return best;
}

// Where the right lattice's origin lies in the left one, when both show the whole board.
static void whole_shift(const struct stereo_board *board, int quarter, bool right_upright, double shift[2])
{
    const int columns = (right_upright ? board->columns : board->rows) - 1;
    const int rows = (right_upright ? board->rows : board->columns) - 1;
    // turned by a quarter, (c, r) goes to (-r, c); the turned lattice must begin at 0
    shift[0] = quarter == 1 ? rows : quarter == 2 ? columns : 0;
    shift[1] = quarter == 2 ? rows : quarter == 3 ? columns : 0; // three quarters: to (r, -c)
}

// The median pose between the cameras over the views that show the whole board to both.
static enum status rig_from_whole(const struct work *w, struct pose *right_from_left)
{
    struct pose found[512];
    int n = 0;
    for (int v = 0; v < w->count; v++) {
        const int l = board_of(&w->one[0], v), r = board_of(&w->one[1], v);
        bool left_upright, right_upright;
        if (l < 0 || r < 0 || !is_whole(w->board, w->views[v].circles[0], w->views[v].count[0], &left_upright) ||
            !is_whole(w->board, w->views[v].circles[1], w->views[v].count[1], &right_upright))
            continue;
        const int quarter = quarter_of(w, l, r);
        double shift[2];
        whole_shift(w->board, quarter, right_upright, shift);
        found[n++] = rig_by(w, l, r, lattice_motion(quarter, shift[0], shift[1], w->board->pitch_m));
    }
    if (!n)
        return fail(ERR_INPUT,
                    "no pair of pictures shows the whole board to both cameras; hold it further away in some");
    double least = 1e30;
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int k = 0; k < n; k++)
            sum += v3_distance(found[i].translation, found[k].translation) + 0.5 * pose_angle(found[i], found[k]);
        if (sum < least) {
            least = sum;
            *right_from_left = found[i];
        }
    }
    return OK;
}

// Both cameras' sightings in one bundle; the right lattice is brought into the left's by the rig known so far.
static int join(struct work *w, struct pose right_from_left)
{
    struct stereo_bundle *b = &w->bundle;
    const double pitch = w->board->pitch_m;
    int pairs = 0;
    b->boards = b->count = 0;
    b->camera_from_left[1] = right_from_left;
    for (int v = 0; v < w->count; v++) {
        const int l = board_of(&w->one[0], v), r = board_of(&w->one[1], v);
        const int n[2] = {w->views[v].count[0], w->views[v].count[1]};
        if (l < 0 && r < 0)
            continue;
        const int board = b->boards++;
        if (l >= 0) {
            b->left_from_board[board] = w->one[0].camera_from_board[l];
            add_sightings(b, w->views[v].circles[0], n[0], 0, board, pitch);
        } else {
            b->left_from_board[board] = pose_multiply(pose_inverse(right_from_left), w->one[1].camera_from_board[r]);
        }
        if (r < 0)
            continue;
        struct pose motion = POSE_IDENTITY;
        if (l >= 0) {
            // the right board in the left board's axes, rounded to the lattice
            const struct pose m =
                pose_multiply(pose_inverse(pose_multiply(right_from_left, w->one[0].camera_from_board[l])),
                              w->one[1].camera_from_board[r]);
            motion = lattice_motion(quarter_of(w, l, r), floor(m.translation.x / pitch + 0.5),
                                    floor(m.translation.y / pitch + 0.5), pitch);
            pairs++;
        }
        const int first = b->count;
        add_sightings(b, w->views[v].circles[1], n[1], 1, board, pitch);
        for (int i = first; i < b->count; i++) {
            const struct vec3 p = pose_apply(motion, v3(b->seen[i].x_m, b->seen[i].y_m, 0));
            b->seen[i].x_m = p.x;
            b->seen[i].y_m = p.y;
        }
    }
    return pairs;
}

static void write_report(const struct work *w, const double *covariance, int pairs, struct stereo_report *report)
{
    const struct stereo_bundle *b = &w->bundle;
    *report = (struct stereo_report){.views = pairs, .boards = {w->one[0].boards, w->one[1].boards}};
    for (int i = 0; i < b->count; i++) {
        struct pixel at;
        if (b->seen[i].outlier || !stereo_predict(b, &b->seen[i], &at))
            continue;
        const int c = b->seen[i].camera;
        const double x = at.x - b->seen[i].at.x, y = at.y - b->seen[i].at.y, distance = sqrt(x * x + y * y);
        report->circles[c]++;
        report->rms_px[c] += distance * distance;
        report->max_px[c] = distance > report->max_px[c] ? distance : report->max_px[c];
    }
    for (int c = 0; c < 2; c++) {
        report->rms_px[c] = report->circles[c] ? sqrt(report->rms_px[c] / report->circles[c]) : 0;
        const double f[2] = {b->lens[c].fx, b->lens[c].fy};
        for (int k = 0; k < 2; k++) {
            const int at = c * BUNDLE_LENS + k;
            const double sigma = sqrt(covariance[at * BUNDLE_SHARED + at]) / f[k];
            report->focal_sigma = sigma > report->focal_sigma ? sigma : report->focal_sigma;
        }
    }
    const struct vec3 t = b->camera_from_left[1].translation, u = v3_unit(t);
    const double along[3] = {u.x, u.y, u.z};
    double variance = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            variance +=
                along[i] * along[k] * covariance[(2 * BUNDLE_LENS + 3 + i) * BUNDLE_SHARED + 2 * BUNDLE_LENS + 3 + k];
    report->baseline_m = v3_length(t);
    report->baseline_sigma_m = sqrt(variance > 0 ? variance : 0);
}

// Where the rig has the point whose pixels are `seen`: the middle of the shortest line between the two rays.
static struct vec3 triangulated(const struct stereo_bundle *b, const struct pixel seen[2])
{
    const struct pose left_from_right = pose_inverse(b->camera_from_left[1]);
    const struct vec3 u = lens_ray(&b->lens[0], seen[0]);
    const struct vec3 v = quat_rotate(left_from_right.rotation, lens_ray(&b->lens[1], seen[1]));
    const struct vec3 t = left_from_right.translation;
    const double uu = v3_dot(u, u), uv = v3_dot(u, v), vv = v3_dot(v, v), ut = v3_dot(u, t), vt = v3_dot(v, t);
    const double det = uu * vv - uv * uv, s = (ut * vv - vt * uv) / det, r = (ut * uv - vt * uu) / det;
    return v3_scale(v3_add(v3_scale(u, s), v3_add(t, v3_scale(v, r))), 0.5);
}

static struct covariance3 error_at_1m(const struct stereo_bundle *b, const double *covariance)
{
    const struct vec3 p = v3(0, 0, 1);
    const struct pixel seen[2] = {lens_project(&b->lens[0], p),
                                  lens_project(&b->lens[1], pose_apply(b->camera_from_left[1], p))};
    double slope[BUNDLE_SHARED][3], c[3][3] = {{0}};
    for (int k = 0; k < BUNDLE_SHARED; k++) {
        const double step = 1e-5;
        struct stereo_bundle moved = *b;
        stereo_bundle_move(&moved, k, step);
        const struct vec3 d = v3_scale(v3_sub(triangulated(&moved, seen), p), 1 / step);
        slope[k][0] = d.x;
        slope[k][1] = d.y;
        slope[k][2] = d.z;
    }
    for (int i = 0; i < BUNDLE_SHARED; i++)
        for (int k = 0; k < BUNDLE_SHARED; k++)
            for (int y = 0; y < 3; y++)
                for (int x = 0; x < 3; x++)
                    c[y][x] += slope[i][y] * covariance[i * BUNDLE_SHARED + k] * slope[k][x];
    return (struct covariance3){c[0][0], c[0][1], c[0][2], c[1][1], c[1][2], c[2][2]};
}

static enum status calibrate(struct work *w, struct stereo_rig *rig, struct stereo_report *report)
{
    double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    struct pose right_from_left = POSE_IDENTITY;
    enum status status = calibrate_one(w, 0);
    if (status == OK)
        status = calibrate_one(w, 1);
    if (status == OK)
        status = rig_from_whole(w, &right_from_left);
    if (status != OK)
        return status;
    w->bundle.lens[0] = w->one[0].lens;
    w->bundle.lens[1] = w->one[1].lens;
    const int pairs = join(w, right_from_left);
    status = stereo_bundle_solve(&w->bundle, covariance);
    if (status != OK)
        return status;
    *rig = (struct stereo_rig){w->bundle.lens[0], w->bundle.lens[1], pose_inverse(w->bundle.camera_from_left[1]),
                               error_at_1m(&w->bundle, covariance)};
    write_report(w, covariance, pairs, report);
    return OK;
}

enum status stereo_calibrate(const struct stereo_board *board, const struct stereo_view *views, int count, int width,
                             int height, struct stereo_rig *rig, struct stereo_report *report)
{
    struct work w = {.board = board, .views = views, .count = count, .width = width, .height = height};
    size_t circles = 0;
    if (count > 512)
        return fail(ERR_INPUT, "%d pairs of pictures; at most 512 are used", count);
    for (int v = 0; v < count; v++)
        circles += (size_t)(views[v].count[0] + views[v].count[1]);
    w.one = calloc(2, sizeof *w.one);
    w.homographies = malloc(512 * sizeof *w.homographies);
    w.bundle.seen = malloc((circles + 1) * sizeof *w.bundle.seen);
    w.bundle.left_from_board = malloc((size_t)(count + 1) * sizeof *w.bundle.left_from_board);
    double *scratch = malloc((circles + 1) * sizeof *scratch);
    enum status status;
    if (!w.one || !w.homographies || !w.bundle.seen || !w.bundle.left_from_board || !scratch) {
        status = fail(ERR_MEMORY, "no memory to calibrate from %d pairs of pictures", count);
    } else {
        w.bundle.radius_m = disc_radius(views, count, scratch) * board->pitch_m;
        status = calibrate(&w, rig, report);
    }
    free(w.one);
    free(w.homographies);
    free(w.bundle.seen);
    free(w.bundle.left_from_board);
    free(scratch);
    return status;
}
