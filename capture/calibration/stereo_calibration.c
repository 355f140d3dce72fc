#include "capture/calibration/stereo_calibration.h"

#include "base/linear_algebra.h"
#include "capture/calibration/stereo_bundle.h"
#include "capture/calibration/stereo_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- stereo judgement

// Chosen by hand, while looking at 44 of test_stereo_sets' random sets (seeds 1 and 11), all of which pass, and at sets
// that were spoilt on purpose (seed 11), which do not; 200 others (seed 2) all pass.
static const double MAX_RMS_PX = 1;           // a sharp picture's circles are found to 0.02 to 0.2 pixels
static const double MIN_BASELINE_M = 1e-3;    // no two cameras are closer
static const double MAX_OUTLIERS = 0.25;      // of the circles
static const double MAX_FOCAL_SIGMA = 0.05;   // relative
static const double GOOD_FOCAL_SIGMA = 0.01;  // relative: 1 cm at 1 m
static const double TURNED_ROUND_SHARE = 0.5; // of the baseline, that the right camera may lie on the left

static double focal_sigma(const struct stereo_bundle *bundle, const double *covariance, int camera)
{
    const double f[2] = {bundle->lens[camera].fx, bundle->lens[camera].fy};
    double max = 0;
    for (int k = 0; k < 2; k++) {
        const int at = camera * BUNDLE_LENS + k;
        const double variance = covariance[at * BUNDLE_SHARED + at];
        max = variance > 0 && f[k] > 0 ? fmax(max, sqrt(variance) / f[k]) : INFINITY;
    }
    return max;
}

// The error of one camera of a solved bundle; covariance: as stereo_bundle_solve gives it.
static struct stereo_fit stereo_fit_of(const struct stereo_bundle *bundle, const double *covariance, int camera)
{
    struct stereo_fit fit = {.focal_sigma = focal_sigma(bundle, covariance, camera)};
    double squares = 0;
    int all = 0;
    for (int i = 0; i < bundle->count; i++) {
        const struct disc_sighting *s = &bundle->seen[i];
        struct pixel at;
        if (s->camera != camera)
            continue;
        all++;
        if (s->outlier || !stereo_predict(bundle, s, &at))
            continue;
        const double distance = hypot(s->at.x - at.x, s->at.y - at.y);
        squares += distance * distance;
        fit.max_px = fmax(fit.max_px, distance);
        fit.circles++;
    }
    fit.rms_px = fit.circles ? sqrt(squares / fit.circles) : 0;
    fit.outliers = all ? 1 - (double)fit.circles / all : 0;
    return fit;
}

// Its lens explains the camera's pictures.
static bool stereo_fit_is_good(const struct stereo_fit *fit)
{
    return fit->rms_px <= MAX_RMS_PX && fit->outliers <= MAX_OUTLIERS;
}

// ERR_INPUT with a sentence about `whose` ("the left camera's"): its lens does not explain its pictures (fisheye: one
// of these does better), or they do not tell its focal length.
static enum status stereo_judge_camera(const struct stereo_fit *fit, bool fisheye, const char *whose)
{
    if (fisheye)
        return fail(
            ERR_INPUT,
            "%s lens is a fisheye: its pictures fit the board to %.1f pixels only, and far better when they are "
            "straightened as a fisheye's; use a lens that keeps straight lines nearly straight, or pictures "
            "that were straightened",
            whose, fit->rms_px);
    if (!stereo_fit_is_good(fit))
        return fail(
            ERR_INPUT,
            "%s pictures fit the board to %.1f pixels only, %.0f %% of the circles not at all: the board is not "
            "flat or printed at another scale across than down, the camera zoomed or focused between "
            "pictures, or its lens is a very wide one",
            whose, fit->rms_px, 100 * fit->outliers);
    if (!(fit->focal_sigma <= MAX_FOCAL_SIGMA)) {
        char known[64] = "not at all";
        if (isfinite(fit->focal_sigma))
            snprintf(known, sizeof known, "to %.0f %% only", 100 * fit->focal_sigma);
        return fail(ERR_INPUT,
                    "the board is turned too little: these pictures tell %s focal length %s; turn it by 30 degrees to "
                    "each side in some of them, near and far",
                    whose, known);
    }
    return OK;
}

// ERR_INPUT: the cameras do not fit together though each of them, alone, does.
static enum status stereo_judge_rig(const struct stereo_report *report, const struct stereo_fit alone[2])
{
    if (!(report->baseline_m > MIN_BASELINE_M))
        return fail(ERR_INPUT, "left and right are the same pictures, or of one camera: its own pictures go into each");
    for (int camera = 0; camera < 2; camera++)
        if (report->rms_px[camera] > MAX_RMS_PX)
            return fail(ERR_INPUT,
                        "the two cameras' pictures do not fit together, to %.1f pixels where each camera alone fits to "
                        "%.2f: they were not taken at the same instant (hold the board still), or one camera was "
                        "moved against the other",
                        report->rms_px[camera], fmax(alone[0].rms_px, alone[1].rms_px));
    if (!(report->focal_sigma <= MAX_FOCAL_SIGMA) || !isfinite(report->baseline_sigma_m))
        return fail(ERR_INPUT, "the pose between the cameras cannot be told from these pictures; turn the board by 30 "
                               "degrees to each side in some of them, near and far");
    return OK;
}

// Fills report->warning with what should be looked at in a rig that is used. name, index: of the first pair that was
// left out; name may be NULL.
static void stereo_warn_of_rig(const struct stereo_rig *rig, struct stereo_report *report, const char *name, int index)
{
    const struct vec3 t = rig->left_from_right.translation;
    char number[16];
    snprintf(number, sizeof number, "%d", index + 1);
    report->warning[0] = 0;
    if (report->left_out)
        snprintf(
            report->warning, sizeof report->warning,
            "the two pictures of %d pairs do not belong together, '%.60s' first: they are not of the same instant, "
            "or the board was moving; these pairs do not count for the pose between the cameras",
            report->left_out, name ? name : number);
    else if (t.x < -TURNED_ROUND_SHARE * report->baseline_m)
        snprintf(report->warning, sizeof report->warning,
                 "the right camera stands %.0f mm to the left of the left one: the two folders are exchanged, or all "
                 "pictures are mirrored or upside down",
                 -1000 * t.x);
    else if (report->focal_sigma > GOOD_FOCAL_SIGMA)
        snprintf(report->warning, sizeof report->warning,
                 "the focal lengths are known to %.1f %% only, and distances with them: turn the board by 30 degrees "
                 "to each side in more pictures",
                 100 * report->focal_sigma);
}

// ---------------------------------------------------------------- stereo circles

// Chosen by hand: the window of the mean is wider than any circle with its surroundings; DARKER in grey levels.
enum { WINDOW_SHARE = 8, DARKER = 20, MIN_AREA_PX = 12, MIN_CONTRAST = 40, SEEDS = 24 };

struct detector {
    const uint8_t *gray;
    int width, height;
    uint32_t *sums; // (width + 1) x (height + 1)
    int32_t *label; // 0: not dark, 1: dark, not visited, 2: visited
    int32_t *stack;
    struct circle *blobs;
    int blob_count;
    float contrast[STEREO_MAX_CIRCLES]; // of each blob, grey levels
};

static void sum_rows(struct detector *detector)
{
    const size_t stride = (size_t)detector->width + 1;
    memset(detector->sums, 0, stride * sizeof *detector->sums);
    for (int y = 0; y < detector->height; y++) {
        uint32_t *row = detector->sums + (size_t)(y + 1) * stride, sum = 0;
        row[0] = 0;
        for (int x = 0; x < detector->width; x++) {
            sum += detector->gray[(size_t)y * (size_t)detector->width + (size_t)x];
            row[x + 1] = row[x + 1 - (ptrdiff_t)stride] + sum;
        }
    }
}

static void mark_dark(struct detector *detector)
{
    const int reach = detector->width / WINDOW_SHARE / 2;
    const size_t stride = (size_t)detector->width + 1;
    for (int y = 0; y < detector->height; y++) {
        const int y0 = y > reach ? y - reach : 0,
                  y1 = y + reach + 1 < detector->height ? y + reach + 1 : detector->height;
        for (int x = 0; x < detector->width; x++) {
            const int x0 = x > reach ? x - reach : 0,
                      x1 = x + reach + 1 < detector->width ? x + reach + 1 : detector->width;
            const uint32_t sum =
                detector->sums[(size_t)y1 * stride + (size_t)x1] - detector->sums[(size_t)y0 * stride + (size_t)x1] -
                detector->sums[(size_t)y1 * stride + (size_t)x0] + detector->sums[(size_t)y0 * stride + (size_t)x0];
            const int mean = (int)(sum / (uint32_t)((x1 - x0) * (y1 - y0)));
            const size_t i = (size_t)y * (size_t)detector->width + (size_t)x;
            detector->label[i] = detector->gray[i] + DARKER < mean;
        }
    }
}

struct box {
    int x0, y0, x1, y1; // inclusive
    int area, darkest;
};

// The dark component of pixel `start`, marked as visited.
static struct box flood_component(struct detector *detector, int start)
{
    struct box b = {detector->width, detector->height, -1, -1, 0, 255};
    int top = 0;
    detector->stack[top++] = start;
    detector->label[start] = 2;
    while (top) {
        const int i = detector->stack[--top], x = i % detector->width, y = i / detector->width;
        b.x0 = x < b.x0 ? x : b.x0;
        b.x1 = x > b.x1 ? x : b.x1;
        b.y0 = y < b.y0 ? y : b.y0;
        b.y1 = y > b.y1 ? y : b.y1;
        b.area++;
        b.darkest = detector->gray[i] < b.darkest ? detector->gray[i] : b.darkest;
        const int next[4] = {x > 0 ? i - 1 : -1, x + 1 < detector->width ? i + 1 : -1, y > 0 ? i - detector->width : -1,
                             y + 1 < detector->height ? i + detector->width : -1};
        for (int k = 0; k < 4; k++)
            if (next[k] >= 0 && detector->label[next[k]] == 1) {
                detector->label[next[k]] = 2;
                detector->stack[top++] = next[k];
            }
    }
    return b;
}

// The grey level of the paper round a box: the mean of the brighter half of the box's margin.
static double paper_level(const struct detector *detector, const struct box *box)
{
    int histogram[256] = {0}, n = 0;
    for (int y = box->y0; y <= box->y1; y++)
        for (int x = box->x0; x <= box->x1; x++)
            if (y == box->y0 || y == box->y1 || x == box->x0 || x == box->x1) {
                histogram[detector->gray[(size_t)y * (size_t)detector->width + (size_t)x]]++;
                n++;
            }
    double sum = 0;
    int taken = 0;
    for (int level = 255; level >= 0 && taken < n / 2; level--) {
        sum += (double)level * histogram[level];
        taken += histogram[level];
    }
    return taken ? sum / taken : 0;
}

// Centroid and area weighted by darkness; false: not the image of a disc.
static bool measure_component(struct detector *detector, const struct box *component, struct circle *out)
{
    const struct box b = {component->x0 - 3, component->y0 - 3, component->x1 + 3, component->y1 + 3, 0, 0};
    if (component->x0 <= 0 || component->y0 <= 0 || component->x1 >= detector->width - 1 ||
        component->y1 >= detector->height - 1)
        return false; // cut off
    if (b.x0 < 0 || b.y0 < 0 || b.x1 >= detector->width || b.y1 >= detector->height)
        return false;
    const double paper = paper_level(detector, &b), ink = component->darkest;
    if (paper - ink < MIN_CONTRAST)
        return false;
    detector->contrast[detector->blob_count] = (float)(paper - ink);
    double m = 0, mx = 0, my = 0, mxx = 0, mxy = 0, myy = 0;
    for (int y = b.y0; y <= b.y1; y++)
        for (int x = b.x0; x <= b.x1; x++) {
            double w = (paper - detector->gray[(size_t)y * (size_t)detector->width + (size_t)x]) / (paper - ink);
            if (w > 1)
                w = 1;
            else if (w < 0.06) // the paper's noise
                w = 0;
            m += w;
            mx += w * x;
            my += w * y;
            mxx += w * x * x;
            mxy += w * x * y;
            myy += w * y * y;
        }
    *out = (struct circle){{mx / m, my / m}, m, 0, 0};
    mxx = mxx / m - out->at.x * out->at.x;
    mxy = mxy / m - out->at.x * out->at.y;
    myy = myy / m - out->at.y * out->at.y;
    const double half = (mxx + myy) / 2, split = sqrt((mxx - myy) * (mxx - myy) / 4 + mxy * mxy);
    if (half - split < 0.25 || (half + split) / (half - split) > 16)
        return false; // narrower than 2 pixels, or four times as long as wide
    const double ellipse = 4 * 3.14159265358979 * sqrt(mxx * myy - mxy * mxy); // its area, if it is one
    return m > 0.85 * ellipse && m < 1.1 * ellipse;
}

static void find_blobs(struct detector *detector)
{
    for (int i = 0; i < detector->width * detector->height && detector->blob_count < STEREO_MAX_CIRCLES; i++) {
        if (detector->label[i] != 1)
            continue;
        const struct box b = flood_component(detector, i);
        if (b.area >= MIN_AREA_PX && b.area < detector->width * detector->height / 20 &&
            measure_component(detector, &b, &detector->blobs[detector->blob_count]))
            detector->blob_count++;
    }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Printed circles are all equally dark. The corner of the board's white edge before a grey wall looks like a blob, too.
static void drop_faint_blobs(struct detector *detector)
{
    float sorted[STEREO_MAX_CIRCLES];
    int kept = 0;
    memcpy(sorted, detector->contrast, (size_t)detector->blob_count * sizeof *sorted);
    qsort(sorted, (size_t)detector->blob_count, sizeof *sorted, compare_floats);
    const float min = detector->blob_count ? 0.65F * sorted[detector->blob_count / 2] : 0;
    for (int i = 0; i < detector->blob_count; i++)
        if (detector->contrast[i] >= min)
            detector->blobs[kept++] = detector->blobs[i];
    detector->blob_count = kept;
}

static double squared_distance(struct pixel a, struct pixel b)
{
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

static int nearest_blob(const struct detector *detector, struct pixel at, int except)
{
    int best = -1;
    for (int i = 0; i < detector->blob_count; i++)
        if (i != except &&
            (best < 0 || squared_distance(detector->blobs[i].at, at) < squared_distance(detector->blobs[best].at, at)))
            best = i;
    return best;
}

// A lattice being grown: at[i] of blob i.
struct lattice {
    bool taken[STEREO_MAX_CIRCLES];
    int column[STEREO_MAX_CIRCLES], row[STEREO_MAX_CIRCLES];
    struct pixel step[STEREO_MAX_CIRCLES][2]; // to the next column, to the next row
    int queue[STEREO_MAX_CIRCLES], count;
};

static struct pixel mirror_point(struct pixel at, struct pixel about)
{
    return (struct pixel){2 * about.x - at.x, 2 * about.y - at.y};
}

// The two steps at a blob that has a neighbour on each of four sides.
static bool seed_steps(const struct detector *detector, int seed, struct pixel step[2])
{
    const struct pixel at = detector->blobs[seed].at;
    const int a = nearest_blob(detector, at, seed);
    if (a < 0)
        return false;
    const struct pixel u = {detector->blobs[a].at.x - at.x, detector->blobs[a].at.y - at.y};
    const double length2 = squared_distance(detector->blobs[a].at, at);
    const int back = nearest_blob(detector, mirror_point(detector->blobs[a].at, at), seed);
    if (back < 0 ||
        squared_distance(detector->blobs[back].at, mirror_point(detector->blobs[a].at, at)) > 0.06 * length2)
        return false;
    int across = -1; // the nearest that is off the line of u
    for (int i = 0; i < detector->blob_count; i++) {
        const struct pixel v = {detector->blobs[i].at.x - at.x, detector->blobs[i].at.y - at.y};
        const double cross = u.x * v.y - u.y * v.x;
        if (i != seed && cross > 0.5 * sqrt(length2) * sqrt(v.x * v.x + v.y * v.y) &&
            (across < 0 ||
             squared_distance(detector->blobs[i].at, at) < squared_distance(detector->blobs[across].at, at)))
            across = i;
    }
    if (across < 0)
        return false;
    step[0] = u;
    step[1] = (struct pixel){detector->blobs[across].at.x - at.x, detector->blobs[across].at.y - at.y};
    return squared_distance(step[1], (struct pixel){0, 0}) < 9 * length2;
}

static void take_blob(struct lattice *lattice, int blob, int column, int row)
{
    lattice->taken[blob] = true;
    lattice->column[blob] = column;
    lattice->row[blob] = row;
    lattice->queue[lattice->count++] = blob;
}

static void grow_lattice(const struct detector *detector, int seed, const struct pixel step[2], struct lattice *lattice)
{
    memset(lattice->taken, 0, sizeof lattice->taken);
    lattice->count = 0;
    take_blob(lattice, seed, 0, 0);
    memcpy(lattice->step[seed], step, sizeof lattice->step[seed]);
    for (int next = 0; next < lattice->count; next++) {
        const int blob = lattice->queue[next];
        const struct pixel at = detector->blobs[blob].at;
        for (int side = 0; side < 4; side++) {
            const int axis = side / 2, sign = side % 2 ? -1 : 1;
            const struct pixel s = lattice->step[blob][axis];
            const struct pixel want = {at.x + sign * s.x, at.y + sign * s.y};
            const int found = nearest_blob(detector, want, blob);
            const double size2 = s.x * s.x + s.y * s.y;
            if (found < 0 || lattice->taken[found] || squared_distance(detector->blobs[found].at, want) > 0.09 * size2)
                continue;
            const double growth = detector->blobs[found].area_px / detector->blobs[blob].area_px;
            if (growth < 0.65 || growth > 1.55)
                continue;
            take_blob(lattice, found, lattice->column[blob] + (axis ? 0 : sign),
                      lattice->row[blob] + (axis ? sign : 0));
            memcpy(lattice->step[found], lattice->step[blob], sizeof lattice->step[found]);
            lattice->step[found][axis] = (struct pixel){sign * (detector->blobs[found].at.x - at.x),
                                                        sign * (detector->blobs[found].at.y - at.y)};
        }
    }
}

static int write_lattice(const struct detector *detector, const struct lattice *lattice, struct circle *out)
{
    int column = 0, row = 0;
    for (int i = 0; i < lattice->count; i++) {
        column = lattice->column[lattice->queue[i]] < column ? lattice->column[lattice->queue[i]] : column;
        row = lattice->row[lattice->queue[i]] < row ? lattice->row[lattice->queue[i]] : row;
    }
    for (int i = 0; i < lattice->count; i++) {
        const int blob = lattice->queue[i];
        out[i] = detector->blobs[blob];
        out[i].column = lattice->column[blob] - column;
        out[i].row = lattice->row[blob] - row;
    }
    return lattice->count;
}

static int find_best_lattice(const struct detector *detector, struct lattice *lattice, struct circle *out)
{
    int best = 0;
    const int stride = detector->blob_count / SEEDS + 1;
    for (int seed = 0; seed < detector->blob_count; seed += stride) {
        struct pixel step[2];
        if (!seed_steps(detector, seed, step))
            continue;
        grow_lattice(detector, seed, step, lattice);
        if (lattice->count > best)
            best = write_lattice(detector, lattice, out);
    }
    return best;
}

enum status stereo_circles_find(const uint8_t *gray, int width, int height, struct circle *out, int *count)
{
    const size_t pixels = (size_t)width * (size_t)height;
    struct detector d = {.gray = gray, .width = width, .height = height};
    d.sums = malloc(((size_t)width + 1) * ((size_t)height + 1) * sizeof *d.sums);
    d.label = malloc(pixels * sizeof *d.label);
    d.stack = malloc(pixels * sizeof *d.stack);
    d.blobs = malloc(STEREO_MAX_CIRCLES * sizeof *d.blobs);
    struct lattice *l = malloc(sizeof *l);
    *count = 0;
    enum status status = OK;
    if (!d.sums || !d.label || !d.stack || !d.blobs || !l) {
        status = fail(ERR_MEMORY, "no memory to look for circles");
    } else {
        sum_rows(&d);
        mark_dark(&d);
        find_blobs(&d);
        drop_faint_blobs(&d);
        *count = find_best_lattice(&d, l, out);
    }
    free(d.sums);
    free(d.label);
    free(d.stack);
    free(d.blobs);
    free(l);
    return status;
}

// ---------------------------------------------------------------- stereo calibration

enum { MIN_CIRCLES = 16, FOCAL_STEPS = 24 };

// Of the picture's width: from a picture of 145 degrees to one of 3. Each step is 18 %: the solver starts closer.
static const double FOCAL_MIN = 0.16, FOCAL_MAX = 20;

// The share of its error that is left to a camera when its pictures are straightened as a fisheye's: that is what it
// is.
static const double FISHEYE_GAIN = 0.5;

// A board that moved by less between two pictures stood still: a few times the largest error of a circle's centre.
static const double MIN_MOVED_PX = 1.5;

// A homography from lattice (column, row) to pixels, by the normalised direct linear transform with h33 = 1.
static bool fit_homography(const struct circle *circle, int n, double h[9])
{
    enum { N = 8 };
    double a[N * N] = {0}, b[N] = {0};
    double mx = 0, my = 0;
    for (int i = 0; i < n; i++) {
        mx += circle[i].at.x / n;
        my += circle[i].at.y / n;
    }
    for (int i = 0; i < n; i++) {
        const double u = circle[i].column * 0.1, v = circle[i].row * 0.1, x = (circle[i].at.x - mx) * 0.01,
                     y = (circle[i].at.y - my) * 0.01;
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

static struct pose board_pose(const double h[9], const struct lens *lens, double pitch)
{
    struct vec3 c[3];
    for (int k = 0; k < 3; k++)
        c[k] = v3((h[k] - lens->cx * h[6 + k]) / lens->fx, (h[3 + k] - lens->cy * h[6 + k]) / lens->fy, h[6 + k]);
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
            if (views[v].count[camera] < MIN_CIRCLES || !fit_homography(c, views[v].count[camera], h))
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
    bool seen[STEREO_MAX_PAIRS];
    struct pose camera_from_board[STEREO_MAX_PAIRS]; // of each view that is seen
    struct stereo_fit fit;
};

static void add_sightings(struct stereo_bundle *bundle, const struct circle *circle, int n, int camera, int board,
                          double pitch)
{
    for (int i = 0; i < n; i++)
        bundle->seen[bundle->count++] =
            (struct disc_sighting){camera, board, circle[i].column * pitch, circle[i].row * pitch, circle[i].at, false};
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
static void place_boards(struct work *work, const struct single *single)
{
    int board = 0;
    work->bundle.lens[0] = single->lens;
    for (int v = 0; v < work->count; v++)
        if (single->seen[v])
            work->bundle.left_from_board[board++] =
                board_pose(work->homographies[v], &single->lens, work->board->pitch_m);
}

// The focal length, of a range beyond any camera's, at which the boards as their homographies place them explain the
// circles best: a board is square only at the right one. The closed form (Zhang 2000, section 3.1) takes the difference
// of two nearly equal numbers where the boards are turned little and the lens bends much, and then has no solution.
static void start_focal_length(struct work *work, struct single *single)
{
    double min = INFINITY, best = work->width;
    for (int k = 0; k <= FOCAL_STEPS; k++) {
        const double focal_px = work->width * FOCAL_MIN * pow(FOCAL_MAX / FOCAL_MIN, (double)k / FOCAL_STEPS);
        single->lens.fx = single->lens.fy = focal_px;
        place_boards(work, single);
        const double cost = stereo_bundle_cost(&work->bundle);
        if (cost < min) {
            min = cost;
            best = focal_px;
        }
    }
    single->lens.fx = single->lens.fy = best;
    place_boards(work, single);
}

// The largest distance, pixels, between the same circles of two views; INFINITY: they show different parts.
static double moved_px(const struct stereo_view *a, const struct stereo_view *b, int camera)
{
    double max = 0;
    if (a->count[camera] != b->count[camera])
        return INFINITY;
    for (int i = 0; i < a->count[camera]; i++) {
        const struct circle *p = &a->circles[camera][i], *q = &b->circles[camera][i];
        const double distance = hypot(p->at.x - q->at.x, p->at.y - q->at.y);
        max = p->column == q->column && p->row == q->row ? fmax(max, distance) : INFINITY;
    }
    return max;
}

// A board that was not moved since an earlier picture adds nothing, and would count as certainty.
static bool is_repeated(const struct work *work, const struct single *single, int camera, int view)
{
    for (int v = 0; v < view; v++)
        if (single->seen[v] && moved_px(&work->views[v], &work->views[view], camera) < MIN_MOVED_PX)
            return true;
    return false;
}

static enum status find_boards(struct work *work, struct single *single, int camera)
{
    int in_sight = 0;
    for (int v = 0; v < work->count; v++) {
        const struct stereo_view *view = &work->views[v];
        const bool found = view->count[camera] >= MIN_CIRCLES &&
                           fit_homography(view->circles[camera], view->count[camera], work->homographies[v]);
        single->seen[v] = found && !is_repeated(work, single, camera, v);
        single->boards += single->seen[v];
        in_sight += found;
    }
    if (in_sight >= STEREO_MIN_VIEWS && single->boards < STEREO_MIN_VIEWS)
        return fail(ERR_INPUT,
                    "the board stands still: %s %d pictures show it in %d places, and at least %d are needed; move and "
                    "turn it between them",
                    work->whose[camera], in_sight, single->boards, STEREO_MIN_VIEWS);
    if (single->boards < STEREO_MIN_VIEWS)
        return fail(ERR_INPUT, "the board is in %d of %s %d pictures; at least %d are needed", single->boards,
                    work->whose[camera], work->count, STEREO_MIN_VIEWS);
    return OK;
}

// The camera's lens and error from its boards, by the pinhole model.
static enum status solve_one(struct work *work, int camera)
{
    struct single *s = &work->one[camera];
    struct stereo_bundle *b = &work->bundle;
    double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    s->lens = (struct lens){
        .width = work->width, .height = work->height, .cx = (work->width - 1) / 2.0, .cy = (work->height - 1) / 2.0};
    b->camera_from_left[0] = b->camera_from_left[1] = POSE_IDENTITY;
    b->boards = b->count = 0;
    for (int v = 0; v < work->count; v++)
        if (s->seen[v])
            add_sightings(b, work->views[v].circles[camera], work->views[v].count[camera], 0, b->boards++,
                          work->board->pitch_m);
    start_focal_length(work, s);
    const enum status status = stereo_bundle_solve(b, covariance);
    if (status != OK)
        return status;
    s->lens = b->lens[0];
    for (int v = 0, board = 0; v < work->count; v++)
        if (s->seen[v])
            s->camera_from_board[v] = b->left_from_board[board++];
    s->fit = stereo_fit_of(b, covariance, 0);
    return OK;
}

// Where a pinhole camera would have seen what a fisheye, equidistant with `half_angle` from the middle to a corner,
// saw at `at`. The scale in the middle stays.
static struct pixel rectify_fisheye_pixel(const struct work *work, struct pixel at, double half_angle)
{
    const double x = at.x - (work->width - 1) / 2.0, y = at.y - (work->height - 1) / 2.0, r = hypot(x, y);
    const double angle = half_angle * r / (hypot(work->width, work->height) / 2);
    const double scale = r > 0 ? tan(angle) / angle : 1;
    return (struct pixel){at.x + x * (scale - 1), at.y + y * (scale - 1)};
}

// Whether a fisheye explains pictures that the pinhole model does not: straightened by one of some, they fit it far
// better, though straightening also magnifies errors. Takes the place of what was solved for `camera`.
static bool is_fisheye(struct work *work, int camera)
{
    static const double half_angles_deg[] = {50, 60, 70, 75, 80, 84};
    const struct stereo_view *views = work->views;
    const double rms_px = work->one[camera].fit.rms_px;
    struct stereo_view *straight = malloc((size_t)work->count * sizeof *straight);
    struct circle *circles = malloc((size_t)(work->circles + 1) * sizeof *circles);
    bool fisheye = false;
    for (size_t k = 0; k < COUNT_OF(half_angles_deg) && straight && circles && !fisheye; k++) {
        struct circle *next = circles;
        for (int v = 0; v < work->count; v++) {
            straight[v] = views[v];
            straight[v].circles[camera] = next;
            for (int i = 0; i < views[v].count[camera]; i++, next++) {
                *next = views[v].circles[camera][i];
                next->at = rectify_fisheye_pixel(work, next->at, half_angles_deg[k] * (M_PI / 180));
            }
            work->one[camera].seen[v] =
                work->one[camera].seen[v] &&
                fit_homography(straight[v].circles[camera], straight[v].count[camera], work->homographies[v]);
        }
        work->views = straight;
        fisheye = solve_one(work, camera) == OK && work->one[camera].fit.rms_px < FISHEYE_GAIN * rms_px;
    }
    work->views = views;
    free(straight);
    free(circles);
    return fisheye;
}

static enum status calibrate_one(struct work *work, int camera)
{
    enum status status = find_boards(work, &work->one[camera], camera);
    if (status == OK)
        status = solve_one(work, camera);
    if (status != OK)
        return status;
    const struct stereo_fit fit = work->one[camera].fit;
    const bool fisheye = !stereo_fit_is_good(&fit) && is_fisheye(work, camera);
    return stereo_judge_camera(&fit, fisheye, work->whose[camera]);
}

static void add_board(struct work *work, int camera, int view, struct pose left_from_board, struct pose motion)
{
    struct stereo_bundle *b = &work->bundle;
    const int first = b->count;
    add_sightings(b, work->views[view].circles[camera], work->views[view].count[camera], camera, b->boards,
                  work->board->pitch_m);
    for (int i = first; i < b->count; i++) {
        const struct vec3 p = pose_apply(motion, v3(b->seen[i].x_m, b->seen[i].y_m, 0));
        b->seen[i].x_m = p.x;
        b->seen[i].y_m = p.y;
    }
    b->left_from_board[b->boards] = left_from_board;
}

// Both cameras' sightings in one bundle; the right lattice is brought into the left's by the rig known so far. Pictures
// that do not belong together still say something of their own camera's lens.
static void fill_joint_bundle(struct work *work, const struct stereo_pairs *pairs, struct pose right_from_left,
                              const bool *belongs)
{
    struct stereo_bundle *b = &work->bundle;
    b->boards = b->count = 0;
    b->lens[0] = work->one[0].lens;
    b->lens[1] = work->one[1].lens;
    b->camera_from_left[1] = right_from_left;
    for (int v = 0; v < work->count; v++) {
        if (work->one[0].seen[v]) {
            add_board(work, 0, v, work->one[0].camera_from_board[v], POSE_IDENTITY);
            if (belongs[v])
                add_board(work, 1, v, work->one[0].camera_from_board[v],
                          stereo_pairs_motion(pairs, v, v, right_from_left));
            b->boards++;
        }
        if (work->one[1].seen[v] && !belongs[v]) {
            add_board(work, 1, v, pose_multiply(pose_inverse(right_from_left), work->one[1].camera_from_board[v]),
                      POSE_IDENTITY);
            b->boards++;
        }
    }
}

static void write_report(const struct work *work, const double *covariance, struct stereo_report *report)
{
    const struct stereo_bundle *b = &work->bundle;
    for (int c = 0; c < 2; c++) {
        const struct stereo_fit fit = stereo_fit_of(b, covariance, c);
        report->boards[c] = work->one[c].boards;
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
static struct vec3 triangulate_point(const struct stereo_bundle *bundle, const struct pixel seen[2])
{
    const struct pose left_from_right = pose_inverse(bundle->camera_from_left[1]);
    const struct vec3 u = lens_ray(&bundle->lens[0], seen[0]);
    const struct vec3 v = quat_rotate(left_from_right.rotation, lens_ray(&bundle->lens[1], seen[1]));
    const struct vec3 t = left_from_right.translation;
    const double uu = v3_dot(u, u), uv = v3_dot(u, v), vv = v3_dot(v, v), ut = v3_dot(u, t), vt = v3_dot(v, t);
    const double det = uu * vv - uv * uv, s = (ut * vv - vt * uv) / det, r = (ut * uv - vt * uu) / det;
    return v3_scale(v3_add(v3_scale(u, s), v3_add(t, v3_scale(v, r))), 0.5);
}

static struct covariance3 error_at_1m(const struct stereo_bundle *bundle, const double *covariance)
{
    const struct vec3 p = v3(0, 0, 1);
    const struct pixel seen[2] = {lens_project(&bundle->lens[0], p),
                                  lens_project(&bundle->lens[1], pose_apply(bundle->camera_from_left[1], p))};
    double slope[BUNDLE_SHARED][3], c[3][3] = {{0}};
    for (int k = 0; k < BUNDLE_SHARED; k++) {
        const double step = 1e-5;
        struct stereo_bundle moved = *bundle;
        stereo_bundle_move(&moved, k, step);
        const struct vec3 d = v3_scale(v3_sub(triangulate_point(&moved, seen), p), 1 / step);
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

static enum status calibrate_rig(struct work *work, struct stereo_rig *rig, struct stereo_report *report)
{
    double covariance[BUNDLE_SHARED * BUNDLE_SHARED];
    bool belongs[STEREO_MAX_PAIRS] = {false};
    struct pose right_from_left = POSE_IDENTITY;
    struct stereo_report found = {.views = 0};
    int comparable = 0;
    enum status status = calibrate_one(work, 0);
    if (status == OK)
        status = calibrate_one(work, 1);
    if (status != OK)
        return status;
    const struct stereo_pairs pairs = {work->board,
                                       work->views,
                                       work->count,
                                       {work->one[0].lens, work->one[1].lens},
                                       {work->one[0].seen, work->one[1].seen},
                                       {work->one[0].camera_from_board, work->one[1].camera_from_board}};
    status = stereo_pairs_agree(&pairs, &right_from_left, belongs, &found.views, &comparable);
    if (status != OK)
        return status;
    found.left_out = comparable - found.views;
    fill_joint_bundle(work, &pairs, right_from_left, belongs);
    status = stereo_bundle_solve(&work->bundle, covariance);
    if (status != OK)
        return status;
    write_report(work, covariance, &found);
    const struct stereo_fit alone[2] = {work->one[0].fit, work->one[1].fit};
    status = stereo_judge_rig(&found, alone);
    if (status != OK)
        return status;
    *rig = (struct stereo_rig){work->bundle.lens[0], work->bundle.lens[1],
                               pose_inverse(work->bundle.camera_from_left[1]), error_at_1m(&work->bundle, covariance)};
    *report = found;
    int first = 0;
    while (found.left_out && (belongs[first] || !work->one[0].seen[first] || !work->one[1].seen[first]))
        first++;
    stereo_warn_of_rig(rig, report, work->views[first].name, first);
    return OK;
}

static void work_close(struct work *work)
{
    free(work->one);
    free(work->homographies);
    free(work->bundle.seen);
    free(work->bundle.left_from_board);
}

// Room for all, and the discs' radius.
static enum status work_open(struct work *work)
{
    if (work->count > STEREO_MAX_PAIRS)
        return fail(ERR_INPUT, "%d pairs of pictures; at most %d are used", work->count, STEREO_MAX_PAIRS);
    for (int v = 0; v < work->count; v++)
        work->circles += work->views[v].count[0] + work->views[v].count[1];
    work->one = calloc(2, sizeof *work->one);
    work->homographies = malloc(STEREO_MAX_PAIRS * sizeof *work->homographies);
    work->bundle.seen = malloc((size_t)(work->circles + 1) * sizeof *work->bundle.seen);
    work->bundle.left_from_board = malloc((size_t)(2 * work->count + 1) * sizeof *work->bundle.left_from_board);
    double *scratch = malloc((size_t)(work->circles + 1) * sizeof *scratch);
    const bool able = work->one && work->homographies && work->bundle.seen && work->bundle.left_from_board && scratch;
    if (able)
        work->bundle.radius_m = disc_radius(work->views, work->count, scratch) * work->board->pitch_m;
    free(scratch);
    return able ? OK : fail(ERR_MEMORY, "no memory to calibrate from %d pairs of pictures", work->count);
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
        status = calibrate_rig(&w, rig, report);
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
