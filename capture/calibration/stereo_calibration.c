#include "capture/calibration/stereo_calibration.h"

#include "base/linear_algebra.h"
#include "capture/calibration/stereo_bundle.h"
#include "capture/calibration/stereo_judgement.h"
#include "capture/calibration/stereo_pairs.h"

#include <stdlib.h>
#include <string.h>

enum { LEAST_CIRCLES = 16, FOCAL_STEPS = 24 };

// Of the picture's width: from a picture of 145 degrees to one of 3. Each step is 18 %: the solver starts closer.
static const double FOCAL_LEAST = 0.16, FOCAL_MOST = 20;

// The share of its error that is left to a camera when its pictures are straightened as a fisheye's: that is what it
// is.
static const double FISHEYE_GAIN = 0.5;

// A board that moved by less between two pictures stood still: a few times the largest error of a circle's centre.
static const double LEAST_MOVED_PX = 1.5;

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

// One camera by itself.
struct single {
    struct lens lens;
    int boards; // pictures with a board that is used
    bool seen[STEREO_MOST_PAIRS];
    struct pose camera_from_board[STEREO_MOST_PAIRS]; // of each view that is seen
    struct stereo_fit fit;
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
    int circles;        // of all views
    struct single *one; // two
    struct stereo_bundle bundle;
    double (*homographies)[9]; // of each view that is seen by the camera at hand
    const char *whose[2];      // the cameras, for sentences
};

// The boards as their homographies place them under a lens.
static void place_boards(struct work *w, const struct single *s)
{
    int board = 0;
    w->bundle.lens[0] = s->lens;
    for (int v = 0; v < w->count; v++)
        if (s->seen[v])
            w->bundle.left_from_board[board++] = board_pose(w->homographies[v], &s->lens, w->board->pitch_m);
}

// The focal length, of a range beyond any camera's, at which the boards as their homographies place them explain the
// circles best: a board is square only at the right one. The closed form (Zhang 2000, section 3.1) takes the difference
// of two nearly equal numbers where the boards are turned little and the lens bends much, and then has no solution.
static void start_focal_length(struct work *w, struct single *s)
{
    double least = INFINITY, best = w->width;
    for (int k = 0; k <= FOCAL_STEPS; k++) {
        const double focal_px = w->width * FOCAL_LEAST * pow(FOCAL_MOST / FOCAL_LEAST, (double)k / FOCAL_STEPS);
        s->lens.fx = s->lens.fy = focal_px;
        place_boards(w, s);
        const double cost = stereo_bundle_cost(&w->bundle);
        if (cost < least) {
            least = cost;
            best = focal_px;
        }
    }
    s->lens.fx = s->lens.fy = best;
    place_boards(w, s);
}

// The largest distance, pixels, between the same circles of two views; INFINITY: they show different parts.
static double moved_px(const struct stereo_view *a, const struct stereo_view *b, int camera)
{
    double most = 0;
    if (a->count[camera] != b->count[camera])
        return INFINITY;
    for (int i = 0; i < a->count[camera]; i++) {
        const struct circle *p = &a->circles[camera][i], *q = &b->circles[camera][i];
        const double distance = hypot(p->at.x - q->at.x, p->at.y - q->at.y);
        most = p->column == q->column && p->row == q->row ? fmax(most, distance) : INFINITY;
    }
    return most;
}

// A board that was not moved since an earlier picture adds nothing, and would count as certainty.
static bool is_repeated(const struct work *w, const struct single *s, int camera, int view)
{
    for (int v = 0; v < view; v++)
        if (s->seen[v] && moved_px(&w->views[v], &w->views[view], camera) < LEAST_MOVED_PX)
            return true;
    return false;
}

static enum status find_boards(struct work *w, struct single *s, int camera)
{
    int in_sight = 0;
    for (int v = 0; v < w->count; v++) {
        const struct stereo_view *view = &w->views[v];
        const bool found = view->count[camera] >= LEAST_CIRCLES &&
                           homography(view->circles[camera], view->count[camera], w->homographies[v]);
        s->seen[v] = found && !is_repeated(w, s, camera, v);
        s->boards += s->seen[v];
        in_sight += found;
    }
    if (in_sight >= STEREO_LEAST_VIEWS && s->boards < STEREO_LEAST_VIEWS)
        return fail(ERR_INPUT,
                    "the board stands still: %s %d pictures show it in %d places, and at least %d are needed; move and "
                    "turn it between them",
                    w->whose[camera], in_sight, s->boards, STEREO_LEAST_VIEWS);
    if (s->boards < STEREO_LEAST_VIEWS)
        return fail(ERR_INPUT, "the board is in %d of %s %d pictures; at least %d are needed", s->boards,
                    w->whose[camera], w->count, STEREO_LEAST_VIEWS);
    return OK;
}

// The camera's lens and error from its boards, by the pinhole model.
static enum status solve_one(struct work *w, int camera)
{
    struct single *s = &w->one[camera];
    struct stereo_bundle *b = &w->bundle;
    double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    s->lens =
        (struct lens){.width = w->width, .height = w->height, .cx = (w->width - 1) / 2.0, .cy = (w->height - 1) / 2.0};
    b->camera_from_left[0] = b->camera_from_left[1] = POSE_IDENTITY;
    b->boards = b->count = 0;
    for (int v = 0; v < w->count; v++)
        if (s->seen[v])
            add_sightings(b, w->views[v].circles[camera], w->views[v].count[camera], 0, b->boards++, w->board->pitch_m);
    start_focal_length(w, s);
    const enum status status = stereo_bundle_solve(b, covariance);
    if (status != OK)
        return status;
    s->lens = b->lens[0];
    for (int v = 0, board = 0; v < w->count; v++)
        if (s->seen[v])
            s->camera_from_board[v] = b->left_from_board[board++];
    s->fit = stereo_fit_of(b, covariance, 0);
    return OK;
}

// Where a pinhole camera would have seen what a fisheye, equidistant with `half_angle` from the middle to a corner,
// saw at `at`. The scale in the middle stays.
static struct pixel straightened(const struct work *w, struct pixel at, double half_angle)
{
    const double x = at.x - (w->width - 1) / 2.0, y = at.y - (w->height - 1) / 2.0, r = hypot(x, y);
    const double angle = half_angle * r / (hypot(w->width, w->height) / 2);
    const double scale = r > 0 ? tan(angle) / angle : 1;
    return (struct pixel){at.x + x * (scale - 1), at.y + y * (scale - 1)};
}

// Whether a fisheye explains pictures that the pinhole model does not: straightened by one of some, they fit it far
// better, though straightening also magnifies errors. Takes the place of what was solved for `camera`.
static bool is_fisheye(struct work *w, int camera)
{
    static const double half_angles_deg[] = {50, 60, 70, 75, 80, 84};
    const struct stereo_view *views = w->views;
    const double rms_px = w->one[camera].fit.rms_px;
    struct stereo_view *straight = malloc((size_t)w->count * sizeof *straight);
    struct circle *circles = malloc((size_t)(w->circles + 1) * sizeof *circles);
    bool fisheye = false;
    for (size_t k = 0; k < COUNT_OF(half_angles_deg) && straight && circles && !fisheye; k++) {
        struct circle *next = circles;
        for (int v = 0; v < w->count; v++) {
            straight[v] = views[v];
            straight[v].circles[camera] = next;
            for (int i = 0; i < views[v].count[camera]; i++, next++) {
                *next = views[v].circles[camera][i];
                next->at = straightened(w, next->at, half_angles_deg[k] * (M_PI / 180));
            }
            w->one[camera].seen[v] =
                w->one[camera].seen[v] &&
                homography(straight[v].circles[camera], straight[v].count[camera], w->homographies[v]);
        }
        w->views = straight;
        fisheye = solve_one(w, camera) == OK && w->one[camera].fit.rms_px < FISHEYE_GAIN * rms_px;
    }
    w->views = views;
    free(straight);
    free(circles);
    return fisheye;
}

static enum status calibrate_one(struct work *w, int camera)
{
    enum status status = find_boards(w, &w->one[camera], camera);
    if (status == OK)
        status = solve_one(w, camera);
    if (status != OK)
        return status;
    const struct stereo_fit fit = w->one[camera].fit;
    const bool fisheye = !stereo_fit_is_good(&fit) && is_fisheye(w, camera);
    return stereo_judge_camera(&fit, fisheye, w->whose[camera]);
}

static void add_board(struct work *w, int camera, int view, struct pose left_from_board, struct pose motion)
{
    struct stereo_bundle *b = &w->bundle;
    const int first = b->count;
    add_sightings(b, w->views[view].circles[camera], w->views[view].count[camera], camera, b->boards,
                  w->board->pitch_m);
    for (int i = first; i < b->count; i++) {
        const struct vec3 p = pose_apply(motion, v3(b->seen[i].x_m, b->seen[i].y_m, 0));
        b->seen[i].x_m = p.x;
        b->seen[i].y_m = p.y;
    }
    b->left_from_board[b->boards] = left_from_board;
}

// Both cameras' sightings in one bundle; the right lattice is brought into the left's by the rig known so far. Pictures
// that do not belong together still say something of their own camera's lens.
static void join(struct work *w, const struct stereo_pairs *pairs, struct pose right_from_left, const bool *belongs)
{
    struct stereo_bundle *b = &w->bundle;
    b->boards = b->count = 0;
    b->lens[0] = w->one[0].lens;
    b->lens[1] = w->one[1].lens;
    b->camera_from_left[1] = right_from_left;
    for (int v = 0; v < w->count; v++) {
        if (w->one[0].seen[v]) {
            add_board(w, 0, v, w->one[0].camera_from_board[v], POSE_IDENTITY);
            if (belongs[v])
                add_board(w, 1, v, w->one[0].camera_from_board[v], stereo_pairs_motion(pairs, v, v, right_from_left));
            b->boards++;
        }
        if (w->one[1].seen[v] && !belongs[v]) {
            add_board(w, 1, v, pose_multiply(pose_inverse(right_from_left), w->one[1].camera_from_board[v]),
                      POSE_IDENTITY);
            b->boards++;
        }
    }
}

static void write_report(const struct work *w, const double *covariance, struct stereo_report *report)
{
    const struct stereo_bundle *b = &w->bundle;
    for (int c = 0; c < 2; c++) {
        const struct stereo_fit fit = stereo_fit_of(b, covariance, c);
        report->boards[c] = w->one[c].boards;
        report->circles[c] = fit.circles;
        report->rms_px[c] = fit.rms_px;
        report->max_px[c] = fit.max_px;
        report->focal_sigma = fmax(report->focal_sigma, fit.focal_sigma);
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
    bool belongs[STEREO_MOST_PAIRS] = {false};
    struct pose right_from_left = POSE_IDENTITY;
    struct stereo_report found = {.views = 0};
    int comparable = 0;
    enum status status = calibrate_one(w, 0);
    if (status == OK)
        status = calibrate_one(w, 1);
    if (status != OK)
        return status;
    const struct stereo_pairs pairs = {w->board,
                                       w->views,
                                       w->count,
                                       {w->one[0].lens, w->one[1].lens},
                                       {w->one[0].seen, w->one[1].seen},
                                       {w->one[0].camera_from_board, w->one[1].camera_from_board}};
    status = stereo_pairs_agree(&pairs, &right_from_left, belongs, &found.views, &comparable);
    if (status != OK)
        return status;
    found.left_out = comparable - found.views;
    join(w, &pairs, right_from_left, belongs);
    status = stereo_bundle_solve(&w->bundle, covariance);
    if (status != OK)
        return status;
    write_report(w, covariance, &found);
    const struct stereo_fit alone[2] = {w->one[0].fit, w->one[1].fit};
    status = stereo_judge_rig(&found, alone);
    if (status != OK)
        return status;
    *rig = (struct stereo_rig){w->bundle.lens[0], w->bundle.lens[1], pose_inverse(w->bundle.camera_from_left[1]),
                               error_at_1m(&w->bundle, covariance)};
    *report = found;
    int first = 0;
    while (found.left_out && (belongs[first] || !w->one[0].seen[first] || !w->one[1].seen[first]))
        first++;
    stereo_warn_of_rig(rig, report, w->views[first].name, first);
    return OK;
}

static void work_close(struct work *w)
{
    free(w->one);
    free(w->homographies);
    free(w->bundle.seen);
    free(w->bundle.left_from_board);
}

// Room for all, and the discs' radius.
static enum status work_open(struct work *w)
{
    if (w->count > STEREO_MOST_PAIRS)
        return fail(ERR_INPUT, "%d pairs of pictures; at most %d are used", w->count, STEREO_MOST_PAIRS);
    for (int v = 0; v < w->count; v++)
        w->circles += w->views[v].count[0] + w->views[v].count[1];
    w->one = calloc(2, sizeof *w->one);
    w->homographies = malloc(STEREO_MOST_PAIRS * sizeof *w->homographies);
    w->bundle.seen = malloc((size_t)(w->circles + 1) * sizeof *w->bundle.seen);
    w->bundle.left_from_board = malloc((size_t)(2 * w->count + 1) * sizeof *w->bundle.left_from_board);
    double *scratch = malloc((size_t)(w->circles + 1) * sizeof *scratch);
    const bool able = w->one && w->homographies && w->bundle.seen && w->bundle.left_from_board && scratch;
    if (able)
        w->bundle.radius_m = disc_radius(w->views, w->count, scratch) * w->board->pitch_m;
    free(scratch);
    return able ? OK : fail(ERR_MEMORY, "no memory to calibrate from %d pairs of pictures", w->count);
}

enum status stereo_calibrate(const struct stereo_board *board, const struct stereo_view *views, int count, int width,
                             int height, struct stereo_rig *rig, struct stereo_report *report)
{
    struct work w = {.board = board,
                     .views = views,
                     .count = count,
                     .width = width,
                     .height = height,
                     .whose = {"the left camera's", "the right camera's"}};
    enum status status = work_open(&w);
    if (status == OK)
        status = calibrate(&w, rig, report);
    work_close(&w);
    return status;
}

enum status stereo_calibrate_one(const struct stereo_board *board, const struct stereo_view *views, int count,
                                 int width, int height, struct lens *lens, struct stereo_fit *fit)
{
    struct work w = {
        .board = board, .views = views, .count = count, .width = width, .height = height, .whose = {"the camera's"}};
    enum status status = work_open(&w);
    if (status == OK)
        status = calibrate_one(&w, 0);
    if (status == OK) {
        *lens = w.one[0].lens;
        *fit = w.one[0].fit;
    }
    work_close(&w);
    return status;
}
