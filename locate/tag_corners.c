#include "locate/tag_corners.h"

#include "base/least_squares.h"
#include "base/linear_algebra.h"
#include "locate/pose_solver.h"
#include "locate/rolling_shutter.h"
#include "locate/tag_model.h"

#include <stdlib.h>
#include <string.h>

enum {
    MAX_SAMPLES = 12000, // of one tag; larger ones are sampled at every second, third ... pixel
    MIN_SAMPLES = 40,
    MAX_STEPS = 12,
    FEW_STEPS = 2, // from corners known to a pixel; more change them by less than the noise does
    SLOPES = 1024,
};

// Chosen by hand unless something else is said.
static const double BLUR_START_PX = 0.45, BLUR_LOOSE_PX = 0.3, BLUR_MIN_PX = 0.1, BLUR_MAX_PX = 3;
static const double MIN_CORRELATION = 0.5, MIN_CONTRAST = 0.02;
static const double CONVERGED = 1e-4; // what a step gains of the mean squared error
// Least noise: what is not in the model (JPEG, the lens's sharpness, print) adds to the image's. 0.006 of full range is
// 1.5 grey levels.
static const double MIN_NOISE = 0.006, START_NOISE = 0.1;
// Error of the model itself, of each corner coordinate.
static const double CORNER_FLOOR_PX = 0.001;

// The fractional parts of its multiples are spread evenly over 0 .. 1.
static const double GOLDEN = 0.6180339887498949;

struct tag_refiner {
    struct lens lens;
    struct tag_sensor sensor;
    float *ray;               // of each pixel on the plane z = 1, distortion undone: x, y
    double linear[256];       // sRGB to linear light
    double slope[SLOPES + 1]; // of the sRGB encoding, over linear light 0 .. 1
    struct pixel_sample samples[MAX_SAMPLES];
    int count;
};

enum status tag_refiner_open(struct tag_refiner **out, const struct lens *lens)
{
    *out = NULL;
    struct tag_refiner *r = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory to refine tag corners");
    r->lens = *lens;
    tag_sensor_init(&r->sensor, lens);
    r->ray = malloc((size_t)lens->width * (size_t)lens->height * 2 * sizeof *r->ray);
    if (!r->ray) {
        tag_refiner_close(&r);
        return fail(ERR_MEMORY, "no memory to refine tag corners");
    }
    for (int y = 0, i = 0; y < lens->height; y++) {
        for (int x = 0; x < lens->width; x++) {
            struct vec3 ray = lens_ray(lens, (struct pixel){x, y});
            r->ray[i++] = (float)ray.x;
            r->ray[i++] = (float)ray.y;
        }
    }
    for (int i = 0; i < 256; i++) { // IEC 61966-2-1
        double v = i / 255.0;
        r->linear[i] = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
    }
    for (int i = 0; i <= SLOPES; i++) {
        double v = (double)i / SLOPES;
        r->slope[i] = v <= 0.0031308 ? 12.92 : 1.055 / 2.4 * pow(v, 1 / 2.4 - 1);
    }
    *out = r;
    return OK;
}

void tag_refiner_close(struct tag_refiner **refiner)
{
    if (*refiner)
        free((*refiner)->ray);
    free(*refiner);
    *refiner = NULL;
}

static bool invert_matrix3(const double m[9], double out[9])
{
    double c0 = m[4] * m[8] - m[5] * m[7], c1 = m[5] * m[6] - m[3] * m[8], c2 = m[3] * m[7] - m[4] * m[6];
    double det = m[0] * c0 + m[1] * c1 + m[2] * c2;
    if (!(fabs(det) > 1e-300))
        return false;
    double inverse[9] = {c0, m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
                         c1, m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
                         c2, m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
    for (int i = 0; i < 9; i++)
        out[i] = inverse[i] / det;
    return true;
}

static void apply_homography(const double h[9], double u, double v, double *x, double *y)
{
    double w = h[6] * u + h[7] * v + h[8];
    *x = (h[0] * u + h[1] * v + h[2]) / w;
    *y = (h[3] * u + h[4] * v + h[5]) / w;
}

// Samples the pixels of the tag and most of its white rim, about `max` of them.
static void sample_pixels(struct tag_refiner *refiner, const uint8_t *rgb, const double h[9], int max)
{
    static const double corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const struct lens *lens = &refiner->lens;
    const double reach = 1 + TAG_CELL; // the white rim is one cell wide at least
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9, inverse[9], twice_area = 0;
    struct pixel at[4];
    refiner->count = 0;
    for (int i = 0; i < 4; i++) {
        double x, y;
        apply_homography(h, reach * corner[i][0], reach * corner[i][1], &x, &y);
        at[i] = lens_project(lens, v3(x, y, 1));
        x0 = fmin(x0, at[i].x), x1 = fmax(x1, at[i].x);
        y0 = fmin(y0, at[i].y), y1 = fmax(y1, at[i].y);
    }
    if (!invert_matrix3(h, inverse) || !isfinite(x0 + x1 + y0 + y1))
        return;
    for (int i = 0; i < 4; i++)
        twice_area += at[i].x * at[(i + 1) % 4].y - at[(i + 1) % 4].x * at[i].y;
    int left = (int)fmax(0, floor(x0)), right = (int)fmin(lens->width - 1, ceil(x1));
    int top = (int)fmax(0, floor(y0)), bottom = (int)fmin(lens->height - 1, ceil(y1));
    // Of a large tag every second, third ... pixel along each row; the first one differs from row to row, so that the
    // samples do not form columns.
    double stride = fmax(1, fabs(twice_area) / 2 / max), phase = 0;
    for (int y = top; y <= bottom; y++, phase += GOLDEN - (phase + GOLDEN >= 1)) {
        for (double along = phase * stride; along < right - left + 1; along += stride) {
            size_t pixel = (size_t)y * (size_t)lens->width + (size_t)(left + (int)along);
            const float *ray = refiner->ray + pixel * 2;
            double u, v;
            apply_homography(inverse, (double)ray[0], (double)ray[1], &u, &v);
            if (!(fabs(u) < reach && fabs(v) < reach) || refiner->count == MAX_SAMPLES)
                continue;
            const uint8_t *p = rgb + pixel * 3;
            double light =
                0.2126 * refiner->linear[p[0]] + 0.7152 * refiner->linear[p[1]] + 0.0722 * refiner->linear[p[2]];
            refiner->samples[refiner->count++] = (struct pixel_sample){(double)ray[0], (double)ray[1], light};
        }
    }
}

// What one pass over the samples gives beside the normal equations.
struct sample_sums {
    double cost, weight;                         // weighted squared error, in encoded light; sum of the weights
    double sum_v, sum_vv, sum_m, sum_mm, sum_vm; // of samples v and predictions m, for their correlation
    int count;
};

// noise: of the image, in encoded light; robust kernel: Cauchy with three times that as its scale.
static void accumulate_samples(const struct tag_refiner *refiner, const struct tag_model *model, double noise,
                               struct least_squares_sums *equations, struct sample_sums *sums)
{
    double inverse[9];
    *sums = (struct sample_sums){.count = 0};
    if (!invert_matrix3(model->h, inverse))
        return;
    for (int i = 0; i < refiner->count; i++) {
        const struct pixel_sample *s = &refiner->samples[i];
        double value, by[TAG_PARAMETERS];
        if (!tag_model_predict(&refiner->sensor, model, inverse, s, &value, by))
            continue;
        // The camera's noise is uniform in encoded light, so errors are weighted by the slope of the encoding.
        double stretch = refiner->slope[(int)(fmin(fmax(value, 0), 1) * SLOPES)];
        double error = (s->value - value) * stretch;
        double robust = 1 / (1 + error * error / (9 * noise * noise));
        double weight = robust * stretch * stretch;
        for (int a = 0; a < TAG_PARAMETERS; a++) {
            double scaled = by[a] * weight;
            if (scaled == 0)
                continue;
            equations->g[a] += scaled * (s->value - value);
            for (int b = 0; b <= a; b++)
                equations->a[a * TAG_PARAMETERS + b] += scaled * by[b];
        }
        sums->cost += robust * error * error;
        sums->weight += robust;
        sums->sum_v += s->value;
        sums->sum_vv += s->value * s->value;
        sums->sum_m += value;
        sums->sum_mm += value * value;
        sums->sum_vm += s->value * value;
        sums->count++;
    }
    // A prior of the blur, without which small tags may diverge.
    double prior = noise * noise / (BLUR_LOOSE_PX * BLUR_LOOSE_PX);
    equations->a[8 * TAG_PARAMETERS + 8] += prior;
    equations->g[8] += prior * (BLUR_START_PX - model->blur_px);
}

// Initial black and white: the means of the samples that the initial homography puts well inside cells. *noise: their
// standard deviation in encoded light, an upper bound of the image noise.
static bool init_black_white(const struct tag_refiner *refiner, struct tag_model *model, double *noise)
{
    double inverse[9], sum[2] = {0}, sum2[2] = {0}, weight[2] = {0};
    if (!invert_matrix3(model->h, inverse))
        return false;
    model->white = 1;
    model->black = model->white_u = model->white_v = 0;
    for (int i = 0; i < refiner->count; i++) {
        double value, by[TAG_PARAMETERS];
        if (!tag_model_predict(&refiner->sensor, model, inverse, &refiner->samples[i], &value, by))
            continue;
        if (value > 0.8 || value < 0.2) {
            sum[value > 0.5] += refiner->samples[i].value;
            sum2[value > 0.5] += refiner->samples[i].value * refiner->samples[i].value;
            weight[value > 0.5]++;
        }
    }
    if (!(weight[0] > 8 && weight[1] > 8))
        return false;
    model->black = sum[0] / weight[0];
    model->white = sum[1] / weight[1];
    double varies = 0;
    for (int i = 0; i < 2; i++) {
        double mean = sum[i] / weight[i], stretch = refiner->slope[(int)(fmin(fmax(mean, 0), 1) * SLOPES)];
        varies += (sum2[i] - sum[i] * mean) * stretch * stretch;
    }
    *noise = fmin(fmax(sqrt(fmax(varies, 0) / (weight[0] + weight[1])), MIN_NOISE), START_NOISE);
    return model->white - model->black > MIN_CONTRAST;
}

static bool apply_update(struct tag_model *model, const double d[TAG_PARAMETERS])
{
    double h[9];
    const double change[9] = {1 + d[0], d[1], d[2], d[3], 1 + d[4], d[5], d[6], d[7], 1};
    for (int row = 0; row < 3; row++)
        for (int c = 0; c < 3; c++)
            h[row * 3 + c] = model->h[row * 3] * change[c] + model->h[row * 3 + 1] * change[3 + c] +
                             model->h[row * 3 + 2] * change[6 + c];
    if (!(fabs(h[8]) > 1e-12))
        return false;
    for (int i = 0; i < 9; i++) {
        model->h[i] = h[i] / h[8];
        if (!isfinite(model->h[i]))
            return false;
    }
    model->blur_px = fmin(fmax(model->blur_px + d[8], BLUR_MIN_PX), BLUR_MAX_PX);
    model->white += d[9];
    model->black += d[10];
    model->white_u += d[11];
    model->white_v += d[12];
    return isfinite(model->white + model->black + model->white_u + model->white_v);
}

// The fit of a tag's model to the samples: two states, as base/least_squares.h names them.
struct tag_fit {
    const struct tag_refiner *refiner;
    double noise; // of the image, in encoded light
    struct tag_model model[2];
    struct sample_sums sums[2];
    double work[LEAST_SQUARES_WORK(TAG_PARAMETERS)];
    struct least_squares_sums equations; // of the kept state
};

static bool move_model(void *user, const double *step)
{
    struct tag_fit *fit = user;
    fit->model[STATE_TRIED] = fit->model[STATE_KEPT];
    return apply_update(&fit->model[STATE_TRIED], step);
}

// The cost is the mean squared error: the number of samples that the tag covers differs from state to state.
static bool sum_samples(void *user, enum least_squares_state state, struct least_squares_sums *equations)
{
    struct tag_fit *fit = user;
    struct sample_sums *sums = &fit->sums[state];
    accumulate_samples(fit->refiner, &fit->model[state], fit->noise, equations, sums);
    equations->cost = sums->cost / sums->weight;
    return sums->count >= MIN_SAMPLES;
}

static void keep_model(void *user)
{
    struct tag_fit *fit = user;
    fit->model[STATE_KEPT] = fit->model[STATE_TRIED];
    fit->sums[STATE_KEPT] = fit->sums[STATE_TRIED];
}

static double residual_noise(const struct sample_sums *sums)
{
    return fmax(MIN_NOISE, sqrt(sums->cost / fmax(1, sums->weight - TAG_PARAMETERS)));
}

// few: the corners are known to a pixel, fit->noise roughly. Else the noise is estimated after the first step: at the
// start the residuals are those of the start.
static bool minimize_error(struct tag_fit *fit, bool few)
{
    const struct least_squares_problem problem = {TAG_PARAMETERS, fit, move_model, sum_samples, keep_model, NULL};
    struct least_squares_options options = {few ? FEW_STEPS : 1, 1e-4, CONVERGED, 0};
    enum least_squares_end end;
    if (!few)
        fit->noise = START_NOISE;
    end = least_squares_solve(&problem, &options, fit->work, &fit->equations);
    if (!few && end != LEAST_SQUARES_NO_START) {
        fit->noise = residual_noise(&fit->sums[STATE_KEPT]);
        options.max_steps = MAX_STEPS - 1;
        options.damping = 1e-5;
        end = least_squares_solve(&problem, &options, fit->work, &fit->equations);
    }
    return end != LEAST_SQUARES_NO_START && end != LEAST_SQUARES_STUCK;
}

// How many times larger the covariance is than with independent noise: what is not in the model (lens, codec) makes the
// residuals of a cell's pixels correlated (cluster-robust covariance, Liang & Zeger 1986). At least 1.
static double error_inflation(const struct tag_fit *fit, double noise)
{
    const struct tag_refiner *refiner = fit->refiner;
    const struct tag_model *model = &fit->model[STATE_KEPT];
    double inverse[9], covariance[TAG_PARAMETERS * TAG_PARAMETERS], ratio = 0;
    static const double MARGIN =
        (double)TAG_RIM / (TAG_RIM - TAG_PARAMETERS / (double)TAG_RIM); // degrees of freedom of the fit
    double pull[TAG_RIM * TAG_RIM][TAG_PARAMETERS] = {{0}};
    if (!invert_matrix3(model->h, inverse) || !invert_symmetric(fit->equations.a, TAG_PARAMETERS, covariance))
        return 1;
    for (int i = 0; i < refiner->count; i++) {
        const struct pixel_sample *s = &refiner->samples[i];
        double value, by[TAG_PARAMETERS], u, v;
        if (!tag_model_predict(&refiner->sensor, model, inverse, s, &value, by))
            continue;
        apply_homography(inverse, s->x, s->y, &u, &v);
        int column = (int)fmin(fmax((u + 1) / TAG_CELL + 1, 0), TAG_RIM - 1);
        int row = (int)fmin(fmax((v + 1) / TAG_CELL + 1, 0), TAG_RIM - 1);
        double stretch = refiner->slope[(int)(fmin(fmax(value, 0), 1) * SLOPES)], error = (s->value - value) * stretch;
        double weight = stretch * error / (1 + error * error / (9 * noise * noise));
        for (int a = 0; a < TAG_PARAMETERS; a++)
            pull[row * TAG_RIM + column][a] += weight * by[a];
    }
    for (int c = 0; c < TAG_RIM * TAG_RIM; c++)
        for (int a = 0; a < TAG_PARAMETERS; a++)
            for (int b = 0; b < TAG_PARAMETERS; b++)
                ratio += pull[c][a] * covariance[a * TAG_PARAMETERS + b] * pull[c][b];
    return fmax(1, MARGIN * ratio / (TAG_PARAMETERS * noise * noise));
}

// The inverse of the corners' covariance in ideal pixels, propagated from that of the parameters.
static bool corner_information(const struct tag_fit *fit, double noise, double information[8][8])
{
    static const double corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const struct tag_refiner *refiner = fit->refiner;
    const struct tag_model *model = &fit->model[STATE_KEPT];
    double covariance[TAG_PARAMETERS * TAG_PARAMETERS], by[8][TAG_HOMOGRAPHY_DOF], sum[64];
    if (!invert_symmetric(fit->equations.a, TAG_PARAMETERS, covariance))
        return false;
    for (int k = 0; k < 4; k++) {
        double u = corner[k][0], v = corner[k][1], x, y;
        apply_homography(model->h, u, v, &x, &y);
        double w = model->h[6] * u + model->h[7] * v + model->h[8];
        double x_u = (model->h[0] - x * model->h[6]) / w, x_v = (model->h[1] - x * model->h[7]) / w;
        double y_u = (model->h[3] - y * model->h[6]) / w, y_v = (model->h[4] - y * model->h[7]) / w;
        const double du[TAG_HOMOGRAPHY_DOF] = {u, v, 1, 0, 0, 0, -u * u, -u * v},
                     dv[TAG_HOMOGRAPHY_DOF] = {0, 0, 0, u, v, 1, -u * v, -v * v};
        for (int i = 0; i < TAG_HOMOGRAPHY_DOF; i++) {
            by[2 * k][i] = refiner->lens.fx * (x_u * du[i] + x_v * dv[i]);
            by[2 * k + 1][i] = refiner->lens.fy * (y_u * du[i] + y_v * dv[i]);
        }
    }
    for (int a = 0; a < 8; a++) {
        for (int b = 0; b < 8; b++) {
            double total = a == b ? CORNER_FLOOR_PX * CORNER_FLOOR_PX : 0;
            for (int i = 0; i < TAG_HOMOGRAPHY_DOF; i++)
                for (int j = 0; j < TAG_HOMOGRAPHY_DOF; j++)
                    total += by[a][i] * covariance[i * TAG_PARAMETERS + j] * by[b][j] * noise * noise;
            sum[a * 8 + b] = total;
        }
    }
    return invert_symmetric(sum, 8, &information[0][0]);
}

bool tag_refine(struct tag_refiner *refiner, const uint8_t *rgb, int32_t id, const struct tag_pattern *pattern,
                const struct pixel corner[4], struct tag_observation *out)
{
    struct tag_candidate candidate = {.id = id, .pattern = pattern};
    memcpy(candidate.corner, corner, sizeof candidate.corner);
    return tag_refine_sampled(refiner, rgb, &candidate, MAX_SAMPLES, out);
}

bool tag_refine_sampled(struct tag_refiner *refiner, const uint8_t *rgb, const struct tag_candidate *candidate,
                        int max_pixels, struct tag_observation *out)
{
    static const double own[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    struct tag_fit fit = {.refiner = refiner};
    struct tag_model m = {.blur_px = BLUR_START_PX};
    struct vec3 first[4];
    for (int k = 0; k < 4; k++)
        first[k] = lens_ray(&refiner->lens, candidate->corner[k]);
    if (!planar_homography(first, m.h))
        return false;
    for (int row = 0; row < TAG_RIM; row++)
        for (int c = 0; c < TAG_RIM; c++) {
            bool rim = row == 0 || c == 0 || row == TAG_RIM - 1 || c == TAG_RIM - 1;
            m.cells[row][c] = rim ? 1 : candidate->pattern->cell[TAG_CELLS - row][c - 1];
        }
    double inflation = 1;
    sample_pixels(refiner, rgb, m.h, max_pixels < MAX_SAMPLES ? max_pixels : MAX_SAMPLES);
    if (!init_black_white(refiner, &m, &fit.noise))
        return false;
    fit.model[STATE_KEPT] = m;
    if (!minimize_error(&fit, max_pixels < MAX_SAMPLES))
        return false;
    m = fit.model[STATE_KEPT];

    const struct sample_sums g = fit.sums[STATE_KEPT];
    double n = g.count, vm = g.sum_vm - g.sum_v * g.sum_m / n;
    double vv = g.sum_vv - g.sum_v * g.sum_v / n, mm = g.sum_mm - g.sum_m * g.sum_m / n;
    struct tag_observation s = {.id = candidate->id,
                                .correlation = vv > 0 && mm > 0 && vm > 0 ? vm * vm / (vv * mm) : 0};
    if (!(s.correlation > MIN_CORRELATION) || !(m.white - m.black > MIN_CONTRAST))
        return false;
    const double noise = residual_noise(&g);
    if (max_pixels >= MAX_SAMPLES) // sparse samples are nearly independent
        inflation = error_inflation(&fit, noise);
    if (!corner_information(&fit, noise * sqrt(inflation), s.information))
        return false;
    double cell_px = 1e9, moved_px = 0; // a cell's size, by the tag's shortest side; how far the corners moved
    for (int k = 0; k < 4; k++) {
        s.ray[k].z = 1;
        apply_homography(m.h, own[k][0], own[k][1], &s.ray[k].x, &s.ray[k].y);
        s.time_s[k] = shutter_row_time(&refiner->lens, lens_project(&refiner->lens, s.ray[k]).y);
        double dx = (s.ray[k].x - first[k].x) * refiner->lens.fx, dy = (s.ray[k].y - first[k].y) * refiner->lens.fy;
        moved_px = fmax(moved_px, sqrt(dx * dx + dy * dy));
        dx = (first[k].x - first[(k + 1) % 4].x) * refiner->lens.fx,
        dy = (first[k].y - first[(k + 1) % 4].y) * refiner->lens.fy;
        cell_px = fmin(cell_px, sqrt(dx * dx + dy * dy) / TAG_CELLS);
    }
    if (!(moved_px < fmax(1.5, 1.5 * cell_px)) || !planar_homography(s.ray, m.h))
        return false;
    *out = s;
    return true;
}
