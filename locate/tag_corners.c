#include "locate/tag_corners.h"

#include "base/linear_algebra.h"
#include "locate/rolling_shutter.h"
#include "locate/planar_pose.h"

#include <stdlib.h>
#include <string.h>

enum {
    RIM = TAG_CELLS + 2, // the cells with the white rim around
    HOMOGRAPHY_SIZE = 8, // numbers of the homography's change
    PARAMETERS = 13,     // those, blur, white, black, white's slope in u and v
    MAX_SAMPLES = 12000, // of one tag; larger ones are read at every second, third ... pixel
    MAX_ROUNDS = 12,
    FEW_ROUNDS = 2,  // from corners known to a pixel; more change them by less than the noise does
    NOISE_ROUND = 1, // in which the picture's noise is estimated: the first one has no say in it
    SLOPES = 1024,
    GAUSSIAN_STEPS = 1024, // of the table of the normal distribution, over +- GAUSSIAN_REACH
};

// Everything below is in the tag's own (u, v): -1 .. 1 over the black square, v up.
static const double CELL = 2.0 / TAG_CELLS;
static const double BLUR_START_PX = 0.45, BLUR_LOOSE_PX = 0.3, BLUR_MIN_PX = 0.1, BLUR_MAX_PX = 3;
static const double MIN_CORRELATION = 0.5, MIN_CONTRAST = 0.02;
static const double CONVERGED = 5e-4; // a step in (u, v); what is left after it is ten times less
// What the model does not know (JPEG, the lens's own sharpness, print) is not in
// the picture's noise. 0.006 of full range is 1.5 grey levels.
static const double MIN_NOISE = 0.006, START_NOISE = 0.1;
// What the model of light and edges itself is off by, of each coordinate.
static const double CORNER_FLOOR_PX = 0.001;

struct pixel_sample {
    double x, y;  // on the plane z = 1
    double value; // linear light, 0..1
};

// The standard normal distribution at one place.
struct gaussian_value {
    double integral; // of `below`, from minus infinity
    double below;    // the distribution function
    double density;
};
static const double GAUSSIAN_REACH = 4;
// Multiples of it, without their whole part, are spread evenly over 0 .. 1.
static const double GOLDEN = 0.6180339887498949;

struct tag_refiner {
    struct lens lens;
    double pixel_x, pixel_y; // a pixel's sides on the plane z = 1
    float *ray;              // of each pixel on the plane z = 1, distortion undone: x, y
    struct gaussian_value gaussian[GAUSSIAN_STEPS + 1];
    double linear[256];       // sRGB to linear light
    double slope[SLOPES + 1]; // of the encoding, over linear light 0..1
    struct pixel_sample samples[MAX_SAMPLES];
    int count;
};

// What is fitted. h: (u, v) to the plane z = 1.
struct tag_model {
    double h[9];
    double blur_px, white, black, white_u, white_v;
    double cells[RIM][RIM]; // row 0 at the bottom
};

enum status tag_refiner_open(struct tag_refiner **out, const struct lens *lens)
{
    *out = NULL;
    struct tag_refiner *r = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory to refine tag corners");
    r->lens = *lens;
    r->pixel_x = 1 / lens->fx;
    r->pixel_y = 1 / lens->fy;
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
    for (int i = 0; i <= GAUSSIAN_STEPS; i++) {
        double x = GAUSSIAN_REACH * (2.0 * i / GAUSSIAN_STEPS - 1);
        double density = exp(-x * x / 2) * 0.3989422804014327, below = 0.5 * erfc(-x * 0.7071067811865476);
        r->gaussian[i] = (struct gaussian_value){x * below + density, below, density};
    }
    *out = r;
    return OK;
}

void tag_refiner_close(struct tag_refiner **r)
{
    if (*r)
        free((*r)->ray);
    free(*r);
    *r = NULL;
}

static bool invert3(const double m[9], double out[9])
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

static void apply(const double h[9], double u, double v, double *x, double *y)
{
    double w = h[6] * u + h[7] * v + h[8];
    *x = (h[0] * u + h[1] * v + h[2]) / w;
    *y = (h[3] * u + h[4] * v + h[5]) / w;
}

// Reads the pixels of the tag and most of its white rim.
static void sample_pixels(struct tag_refiner *r, const uint8_t *rgb, const double h[9], int most)
{
    static const double corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const struct lens *lens = &r->lens;
    const double reach = 1 + CELL; // the white rim is one cell wide at least
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9, inverse[9], twice_area = 0;
    struct pixel at[4];
    r->count = 0;
    for (int i = 0; i < 4; i++) {
        double x, y;
        apply(h, reach * corner[i][0], reach * corner[i][1], &x, &y);
        at[i] = lens_project(lens, v3(x, y, 1));
        x0 = fmin(x0, at[i].x), x1 = fmax(x1, at[i].x);
        y0 = fmin(y0, at[i].y), y1 = fmax(y1, at[i].y);
    }
    if (!invert3(h, inverse) || !isfinite(x0 + x1 + y0 + y1))
        return;
    for (int i = 0; i < 4; i++)
        twice_area += at[i].x * at[(i + 1) % 4].y - at[(i + 1) % 4].x * at[i].y;
    int left = (int)fmax(0, floor(x0)), right = (int)fmin(lens->width - 1, ceil(x1));
    int top = (int)fmax(0, floor(y0)), bottom = (int)fmin(lens->height - 1, ceil(y1));
    // Of a large tag every second, third ... pixel along each row; where it begins is another place in
    // each row, so that the pixels do not stand in columns.
    double stride = fmax(1, fabs(twice_area) / 2 / most), phase = 0;
    for (int y = top; y <= bottom; y++, phase += GOLDEN - (phase + GOLDEN >= 1)) {
        for (double along = phase * stride; along < right - left + 1; along += stride) {
            size_t pixel = (size_t)y * (size_t)lens->width + (size_t)(left + (int)along);
            const float *ray = r->ray + pixel * 2;
            double u, v;
            apply(inverse, (double)ray[0], (double)ray[1], &u, &v);
            if (!(fabs(u) < reach && fabs(v) < reach) || r->count == MAX_SAMPLES)
                continue;
            const uint8_t *p = rgb + pixel * 3;
            double light = 0.2126 * r->linear[p[0]] + 0.7152 * r->linear[p[1]] + 0.0722 * r->linear[p[2]];
            r->samples[r->count++] = (struct pixel_sample){(double)ray[0], (double)ray[1], light};
        }
    }
}

// A pixel sees an edge through its own square and through the lens's blur. Across the
// edge the square is two even windows, as wide as the normal's two components: the
// wider one is kept exactly, since edges along the rows or columns would come out
// wrong by a fifth of a pixel, the narrower one is counted to the blur.
struct edge_window {
    double width;      // of the even window, cells
    double blur;       // standard deviation of the rest, cells
    double blur_by_px; // its derivative by the lens's blur in pixels
};

static struct edge_window edge_window_of(double by_x, double by_y, double blur_px)
{
    double wide = fabs(by_x), narrow = fabs(by_y), blurred = blur_px * (by_x * by_x + by_y * by_y);
    if (wide < narrow)
        wide = fabs(by_y), narrow = fabs(by_x);
    double blur = sqrt(blur_px * blurred + narrow * narrow / 12);
    return (struct edge_window){wide / CELL, blur / CELL, blurred / blur / CELL};
}

// How much of each cell along one axis the point at `a` (in cells, 0..RIM) sees,
// with derivatives by a and by the lens's blur. Cells first .. first + count - 1.
struct axis_response {
    int first, count;
    double share[RIM], by_a[RIM], by_blur[RIM];
};

// Interpolated, to a millionth.
static struct gaussian_value gaussian_at(const struct tag_refiner *r, double x)
{
    if (x <= -GAUSSIAN_REACH)
        return (struct gaussian_value){0, 0, 0};
    if (x >= GAUSSIAN_REACH)
        return (struct gaussian_value){x, 1, 0};
    double at = (x + GAUSSIAN_REACH) * (GAUSSIAN_STEPS / (2 * GAUSSIAN_REACH));
    int i = (int)at;
    double t = at - i;
    const struct gaussian_value *b = &r->gaussian[i], *c = b + 1;
    return (struct gaussian_value){b->integral + t * (c->integral - b->integral), b->below + t * (c->below - b->below),
                                   b->density + t * (c->density - b->density)};
}

static void respond_along(const struct tag_refiner *r, double a, const struct edge_window *w, struct axis_response *out)
{
    double reach = w->width / 2 + 3 * w->blur;
    int first = (int)floor(a - reach), last = (int)floor(a + reach);
    first = first < 0 ? 0 : first > RIM - 1 ? RIM - 1 : first;
    last = last < first ? first : last > RIM - 1 ? RIM - 1 : last;
    out->first = first;
    out->count = last - first + 1;
    double below = 0, below_a = 0, below_blur = 0; // of the edge under the cell
    double sharp = 1 / w->blur, narrow = 1 / w->width, half = w->width / 2;
    for (int i = first; i <= last; i++) {
        double above = 1, above_a = 0, above_blur = 0;
        if (i < last) {
            struct gaussian_value p = gaussian_at(r, (i + 1 - a + half) * sharp);
            struct gaussian_value m = gaussian_at(r, (i + 1 - a - half) * sharp);
            above = (p.integral - m.integral) * w->blur * narrow;
            above_a = (m.below - p.below) * narrow;
            above_blur = (p.density - m.density) * narrow * w->blur_by_px;
        }
        out->share[i - first] = above - below;
        out->by_a[i - first] = above_a - below_a;
        out->by_blur[i - first] = above_blur - below_blur;
        below = above, below_a = above_a, below_blur = above_blur;
    }
}

// The share of white at (u, v): value, and derivatives by u, v and the blur in pixels.
struct white_response {
    double white, by_u, by_v, by_blur;
};

// together: the covariance of what a pixel sees along the two axes, cells^2, which the product of the two
// leaves out: where they are not at right angles in the picture, the corners of cells would come out wrong and
// a tag's by a hundredth of a pixel. To first order (Price 1958).
static struct white_response render_white(const struct tag_refiner *r, const struct tag_model *m, double u, double v,
                                          const struct edge_window *wu, const struct edge_window *wv, double together)
{
    struct axis_response across, up;
    respond_along(r, (u + 1) / CELL + 1, wu, &across);
    respond_along(r, (v + 1) / CELL + 1, wv, &up);
    struct white_response s = {0};
    for (int j = 0; j < up.count; j++) {
        double row = 0, row_a = 0, row_blur = 0;
        for (int i = 0; i < across.count; i++) {
            double cell = m->cells[up.first + j][across.first + i];
            row += cell * across.share[i];
            row_a += cell * across.by_a[i];
            row_blur += cell * across.by_blur[i];
        }
        s.white += row * up.share[j] + together * row_a * up.by_a[j];
        s.by_u += row_a * up.share[j];
        s.by_v += row * up.by_a[j];
        s.by_blur += row_blur * up.share[j] + row * up.by_blur[j];
    }
    s.by_u /= CELL;
    s.by_v /= CELL;
    return s;
}

// What one pass over the samples gathers.
struct refine_equations {
    double normal[PARAMETERS * PARAMETERS]; // lower triangle
    double gradient[PARAMETERS];
    double cost, weight; // weighted squared error, in encoded light; sum of the weights
    double sum_v, sum_vv, sum_m, sum_mm, sum_vm;
    int count;
};

// One sample's prediction and its derivatives. False: outside the tag's white rim.
static bool predict_sample(const struct tag_refiner *r, const struct tag_model *m, const double inverse[9],
                           const struct pixel_sample *s, double *value, double by[PARAMETERS])
{
    double w = 1 / (inverse[6] * s->x + inverse[7] * s->y + inverse[8]);
    double u = (inverse[0] * s->x + inverse[1] * s->y + inverse[2]) * w;
    double v = (inverse[3] * s->x + inverse[4] * s->y + inverse[5]) * w;
    if (!(fabs(u) < 1 + 0.75 * CELL && fabs(v) < 1 + 0.75 * CELL))
        return false;
    double w_x = w * r->pixel_x, w_y = w * r->pixel_y;
    double u_x = (inverse[0] - u * inverse[6]) * w_x, u_y = (inverse[1] - u * inverse[7]) * w_y;
    double v_x = (inverse[3] - v * inverse[6]) * w_x, v_y = (inverse[4] - v * inverse[7]) * w_y;
    struct edge_window across = edge_window_of(u_x, u_y, m->blur_px), up = edge_window_of(v_x, v_y, m->blur_px);
    double together = (m->blur_px * m->blur_px + 1.0 / 12) * (u_x * v_x + u_y * v_y) / (CELL * CELL);
    struct white_response shade = render_white(r, m, u, v, &across, &up, together);
    double white = m->white + m->white_u * u + m->white_v * v;
    *value = m->black + (white - m->black) * shade.white;
    double by_u = (white - m->black) * shade.by_u + m->white_u * shade.white;
    double by_v = (white - m->black) * shade.by_v + m->white_v * shade.white;
    // h becomes h (I + d): at a fixed point of the picture (u, v) moves by -d (u, v, 1)
    by[0] = -by_u * u;
    by[1] = -by_u * v;
    by[2] = -by_u;
    by[3] = -by_v * u;
    by[4] = -by_v * v;
    by[5] = -by_v;
    by[6] = (by_u * u + by_v * v) * u;
    by[7] = (by_u * u + by_v * v) * v;
    by[8] = (white - m->black) * shade.by_blur;
    by[9] = shade.white;
    by[10] = 1 - shade.white;
    by[11] = shade.white * u;
    by[12] = shade.white * v;
    return true;
}

// noise: of the picture, encoded; errors beyond three times that lose their weight (Cauchy).
static void accumulate(const struct tag_refiner *r, const struct tag_model *m, double noise, struct refine_equations *g)
{
    double inverse[9];
    memset(g, 0, sizeof *g);
    if (!invert3(m->h, inverse))
        return;
    for (int i = 0; i < r->count; i++) {
        const struct pixel_sample *s = &r->samples[i];
        double value, by[PARAMETERS];
        if (!predict_sample(r, m, inverse, s, &value, by))
            continue;
        // The camera's noise is even in encoded light, so errors are weighed as the
        // encoding stretches them there.
        double stretch = r->slope[(int)(fmin(fmax(value, 0), 1) * SLOPES)];
        double error = (s->value - value) * stretch;
        double robust = 1 / (1 + error * error / (9 * noise * noise));
        double weight = robust * stretch * stretch;
        for (int a = 0; a < PARAMETERS; a++) {
            double scaled = by[a] * weight;
            if (scaled == 0)
                continue;
            g->gradient[a] += scaled * (s->value - value);
            for (int b = 0; b <= a; b++)
                g->normal[a * PARAMETERS + b] += scaled * by[b];
        }
        g->cost += robust * error * error;
        g->weight += robust;
        g->sum_v += s->value;
        g->sum_vv += s->value * s->value;
        g->sum_m += value;
        g->sum_mm += value * value;
        g->sum_vm += s->value * value;
        g->count++;
    }
    // The blur is known roughly: it keeps small tags from drifting off.
    double prior = noise * noise / (BLUR_LOOSE_PX * BLUR_LOOSE_PX);
    g->normal[8 * PARAMETERS + 8] += prior;
    g->gradient[8] += prior * (BLUR_START_PX - m->blur_px);
}

// Black and white as the first idea of the pattern's place has them. *noise: how much each varies, encoded;
// more than the picture's noise.
static bool init_black_white(const struct tag_refiner *r, struct tag_model *m, double *noise)
{
    double inverse[9], sum[2] = {0}, sum2[2] = {0}, weight[2] = {0};
    if (!invert3(m->h, inverse))
        return false;
    m->white = 1;
    m->black = m->white_u = m->white_v = 0;
    for (int i = 0; i < r->count; i++) {
        double value, by[PARAMETERS];
        if (!predict_sample(r, m, inverse, &r->samples[i], &value, by))
            continue;
        if (value > 0.8 || value < 0.2) {
            sum[value > 0.5] += r->samples[i].value;
            sum2[value > 0.5] += r->samples[i].value * r->samples[i].value;
            weight[value > 0.5]++;
        }
    }
    if (!(weight[0] > 8 && weight[1] > 8))
        return false;
    m->black = sum[0] / weight[0];
    m->white = sum[1] / weight[1];
    double varies = 0;
    for (int i = 0; i < 2; i++) {
        double mean = sum[i] / weight[i], stretch = r->slope[(int)(fmin(fmax(mean, 0), 1) * SLOPES)];
        varies += (sum2[i] - sum[i] * mean) * stretch * stretch;
    }
    *noise = fmin(fmax(sqrt(fmax(varies, 0) / (weight[0] + weight[1])), MIN_NOISE), START_NOISE);
    return m->white - m->black > MIN_CONTRAST;
}

static bool apply_update(struct tag_model *m, const double d[PARAMETERS])
{
    double h[9];
    const double turn[9] = {1 + d[0], d[1], d[2], d[3], 1 + d[4], d[5], d[6], d[7], 1};
    for (int row = 0; row < 3; row++)
        for (int c = 0; c < 3; c++)
            h[row * 3 + c] =
                m->h[row * 3] * turn[c] + m->h[row * 3 + 1] * turn[3 + c] + m->h[row * 3 + 2] * turn[6 + c];
    if (!(fabs(h[8]) > 1e-12))
        return false;
    for (int i = 0; i < 9; i++) {
        m->h[i] = h[i] / h[8];
        if (!isfinite(m->h[i]))
            return false;
    }
    m->blur_px = fmin(fmax(m->blur_px + d[8], BLUR_MIN_PX), BLUR_MAX_PX);
    m->white += d[9];
    m->black += d[10];
    m->white_u += d[11];
    m->white_v += d[12];
    return isfinite(m->white + m->black + m->white_u + m->white_v);
}

// Gauss-Newton with Marquardt's damping. Leaves `g` at the model's last state. few: corners are known to a
// pixel, *noise roughly.
static bool minimize(const struct tag_refiner *r, struct tag_model *m, bool few, struct refine_equations *g,
                     double *noise)
{
    double damping = 1e-4;
    int most_rounds = few ? FEW_ROUNDS : MAX_ROUNDS;
    if (!few)
        *noise = START_NOISE;
    accumulate(r, m, *noise, g);
    for (int round = 0; round < most_rounds; round++) {
        if (g->count < 40)
            return false;
        if (round == NOISE_ROUND && !few) {
            *noise = fmax(MIN_NOISE, sqrt(g->cost / fmax(1, g->weight - PARAMETERS)));
            accumulate(r, m, *noise, g);
        }
        double a[PARAMETERS * PARAMETERS], d[PARAMETERS];
        memcpy(a, g->normal, sizeof a);
        memcpy(d, g->gradient, sizeof d);
        for (int i = 0; i < PARAMETERS; i++)
            a[i * PARAMETERS + i] *= 1 + damping;
        if (!cholesky_factor(a, PARAMETERS))
            return false;
        cholesky_solve(a, PARAMETERS, d);
        struct tag_model next = *m;
        struct refine_equations after;
        if (!apply_update(&next, d))
            return false;
        accumulate(r, &next, *noise, &after);
        double before = g->cost / g->weight, now = after.cost / after.weight;
        if (!(after.count >= 40) || !(now < before)) {
            damping = fmax(damping, 1e-3) * 10;
            if (damping > 1e3 || (now - before < 1e-9 * before))
                return true;
            continue;
        }
        *m = next;
        *g = after;
        damping *= 0.1;
        double largest = 0;
        for (int i = 0; i < HOMOGRAPHY_SIZE; i++)
            largest = fmax(largest, fabs(d[i]));
        if (round >= NOISE_ROUND && largest < CONVERGED && before - now < 1e-4 * before)
            return true;
    }
    return true;
}

// How many times larger the fit's covariance is than even noise would make it: what the model does not know, a lens, a
// codec, makes pixels of one cell err together (clustered errors, Liang and Zeger 1986). At least 1.
static double error_inflation(const struct tag_refiner *r, const struct tag_model *m, const struct refine_equations *g,
                              double noise)
{
    double inverse[9], covariance[PARAMETERS * PARAMETERS], normal[PARAMETERS * PARAMETERS], ratio = 0;
    static const double MARGIN = (double)RIM / (RIM - PARAMETERS / (double)RIM); // the fit has taken its part
    double pull[RIM * RIM][PARAMETERS] = {{0}};
    for (int i = 0; i < PARAMETERS * PARAMETERS; i++) {
        int a = i / PARAMETERS, b = i % PARAMETERS;
        normal[i] = g->normal[a >= b ? i : b * PARAMETERS + a];
    }
    if (!invert3(m->h, inverse) || !invert_symmetric(normal, PARAMETERS, covariance))
        return 1;
    for (int i = 0; i < r->count; i++) {
        const struct pixel_sample *s = &r->samples[i];
        double value, by[PARAMETERS], u, v;
        if (!predict_sample(r, m, inverse, s, &value, by))
            continue;
        apply(inverse, s->x, s->y, &u, &v);
        int column = (int)fmin(fmax((u + 1) / CELL + 1, 0), RIM - 1);
        int row = (int)fmin(fmax((v + 1) / CELL + 1, 0), RIM - 1);
        double stretch = r->slope[(int)(fmin(fmax(value, 0), 1) * SLOPES)], error = (s->value - value) * stretch;
        double weight = stretch * error / (1 + error * error / (9 * noise * noise));
        for (int a = 0; a < PARAMETERS; a++)
            pull[row * RIM + column][a] += weight * by[a];
    }
    for (int c = 0; c < RIM * RIM; c++)
        for (int a = 0; a < PARAMETERS; a++)
            for (int b = 0; b < PARAMETERS; b++)
                ratio += pull[c][a] * covariance[a * PARAMETERS + b] * pull[c][b];
    return fmax(1, MARGIN * ratio / (PARAMETERS * noise * noise));
}

// The corners' covariance in ideal pixels from the fit's, inverted.
static bool corner_information(const struct tag_refiner *r, const struct tag_model *m, const struct refine_equations *g,
                               double noise, double information[8][8])
{
    static const double corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    double covariance[PARAMETERS * PARAMETERS], by[8][HOMOGRAPHY_SIZE], sum[64];
    double normal[PARAMETERS * PARAMETERS];
    for (int a = 0; a < PARAMETERS; a++)
        for (int b = 0; b < PARAMETERS; b++)
            normal[a * PARAMETERS + b] = a >= b ? g->normal[a * PARAMETERS + b] : g->normal[b * PARAMETERS + a];
    if (!invert_symmetric(normal, PARAMETERS, covariance))
        return false;
    for (int k = 0; k < 4; k++) {
        double u = corner[k][0], v = corner[k][1], x, y;
        apply(m->h, u, v, &x, &y);
        double w = m->h[6] * u + m->h[7] * v + m->h[8];
        double x_u = (m->h[0] - x * m->h[6]) / w, x_v = (m->h[1] - x * m->h[7]) / w;
        double y_u = (m->h[3] - y * m->h[6]) / w, y_v = (m->h[4] - y * m->h[7]) / w;
        const double du[HOMOGRAPHY_SIZE] = {u, v, 1, 0, 0, 0, -u * u, -u * v},
                     dv[HOMOGRAPHY_SIZE] = {0, 0, 0, u, v, 1, -u * v, -v * v};
        for (int i = 0; i < HOMOGRAPHY_SIZE; i++) {
            by[2 * k][i] = r->lens.fx * (x_u * du[i] + x_v * dv[i]);
            by[2 * k + 1][i] = r->lens.fy * (y_u * du[i] + y_v * dv[i]);
        }
    }
    for (int a = 0; a < 8; a++) {
        for (int b = 0; b < 8; b++) {
            double total = a == b ? CORNER_FLOOR_PX * CORNER_FLOOR_PX : 0;
            for (int i = 0; i < HOMOGRAPHY_SIZE; i++)
                for (int j = 0; j < HOMOGRAPHY_SIZE; j++)
                    total += by[a][i] * covariance[i * PARAMETERS + j] * by[b][j] * noise * noise;
            sum[a * 8 + b] = total;
        }
    }
    return invert_symmetric(sum, 8, &information[0][0]);
}

bool tag_refine(struct tag_refiner *r, const uint8_t *rgb, int32_t id, const struct tag_pattern *pattern,
                const struct pixel corner[4], struct tag_observation *out)
{
    return tag_refine_sampled(r, rgb, id, pattern, corner, MAX_SAMPLES, out);
}

bool tag_refine_sampled(struct tag_refiner *r, const uint8_t *rgb, int32_t id, const struct tag_pattern *pattern,
                        const struct pixel corner[4], int most_pixels, struct tag_observation *out)
{
    static const double own[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    struct tag_model m = {.blur_px = BLUR_START_PX};
    struct vec3 first[4];
    for (int k = 0; k < 4; k++)
        first[k] = lens_ray(&r->lens, corner[k]);
    if (!planar_homography(first, m.h))
        return false;
    for (int row = 0; row < RIM; row++)
        for (int c = 0; c < RIM; c++) {
            bool rim = row == 0 || c == 0 || row == RIM - 1 || c == RIM - 1;
            m.cells[row][c] = rim ? 1 : pattern->cell[TAG_CELLS - row][c - 1];
        }
    struct refine_equations g;
    double noise, together = 1;
    sample_pixels(r, rgb, m.h, most_pixels < MAX_SAMPLES ? most_pixels : MAX_SAMPLES);
    if (!init_black_white(r, &m, &noise) || !minimize(r, &m, most_pixels < MAX_SAMPLES, &g, &noise))
        return false;

    double n = g.count, vm = g.sum_vm - g.sum_v * g.sum_m / n;
    double vv = g.sum_vv - g.sum_v * g.sum_v / n, mm = g.sum_mm - g.sum_m * g.sum_m / n;
    struct tag_observation s = {.id = id, .correlation = vv > 0 && mm > 0 && vm > 0 ? vm * vm / (vv * mm) : 0};
    if (!(s.correlation > MIN_CORRELATION) || !(m.white - m.black > MIN_CONTRAST))
        return false;
    noise = fmax(MIN_NOISE, sqrt(g.cost / fmax(1, g.weight - PARAMETERS)));
    if (most_pixels >= MAX_SAMPLES) // few stand apart
        together = error_inflation(r, &m, &g, noise);
    if (!corner_information(r, &m, &g, noise * sqrt(together), s.information))
        return false;
    double cell_px = 1e9, moved_px = 0; // the tag's shortest side / 8, and how far its corners went
    for (int k = 0; k < 4; k++) {
        s.ray[k].z = 1;
        apply(m.h, own[k][0], own[k][1], &s.ray[k].x, &s.ray[k].y);
        s.time_s[k] = shutter_row_time(&r->lens, lens_project(&r->lens, s.ray[k]).y);
        double dx = (s.ray[k].x - first[k].x) * r->lens.fx, dy = (s.ray[k].y - first[k].y) * r->lens.fy;
        moved_px = fmax(moved_px, sqrt(dx * dx + dy * dy));
        dx = (first[k].x - first[(k + 1) % 4].x) * r->lens.fx, dy = (first[k].y - first[(k + 1) % 4].y) * r->lens.fy;
        cell_px = fmin(cell_px, sqrt(dx * dx + dy * dy) / TAG_CELLS);
    }
    if (!(moved_px < fmax(1.5, 1.5 * cell_px)) || !planar_homography(s.ray, m.h))
        return false;
    *out = s;
    return true;
}
