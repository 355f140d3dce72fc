#include "locate/tag_model.h"

#include "base/clamp.h"
#include "base/linear_algebra.h"
#include "locate/pose_solver.h"
#include "locate/tag_corners.h"

#include <stdlib.h>
#include <string.h>

void tag_sensor_init(struct tag_sensor *sensor, const struct lens *lens)
{
    sensor->pixel_x = 1 / lens->fx;
    sensor->pixel_y = 1 / lens->fy;
    for (int i = 0; i <= GAUSSIAN_STEPS; i++) {
        double x = GAUSSIAN_REACH * (2.0 * i / GAUSSIAN_STEPS - 1);
        double density = exp(-x * x / 2) * 0.3989422804014327, below = 0.5 * erfc(-x * 0.7071067811865476);
        sensor->gaussian[i] = (struct gaussian_value){x * below + density, below, density};
    }
}

// A pixel averages over its own square and over the lens's blur. Across an edge the square is the convolution of two
// box windows, as wide as the components of the edge's normal: the wider one is kept exactly, since otherwise edges
// along rows or columns would be off by a fifth of a pixel; the narrower one is added to the blur's variance.
struct edge_window {
    double width;      // of the box window, cells
    double blur;       // standard deviation of the rest, cells
    double blur_by_px; // its derivative by the lens's blur in pixels
};

static struct edge_window edge_window_of(double by_x, double by_y, double blur_px)
{
    double wide = fabs(by_x), narrow = fabs(by_y), blurred = blur_px * (by_x * by_x + by_y * by_y);
    if (wide < narrow)
        wide = fabs(by_y), narrow = fabs(by_x);
    double blur = sqrt(blur_px * blurred + narrow * narrow / 12);
    return (struct edge_window){wide / TAG_CELL, blur / TAG_CELL, blurred / blur / TAG_CELL};
}

// The share of each cell along one axis in the pixel at `a` (in cells, 0..TAG_RIM), with derivatives by a and by the
// lens's blur. Cells first .. first + count - 1.
struct axis_response {
    int first, count;
    double share[TAG_RIM], by_a[TAG_RIM], by_blur[TAG_RIM];
};

// Interpolated linearly, accurate to a millionth.
static struct gaussian_value gaussian_at(const struct tag_sensor *sensor, double x)
{
    if (x <= -GAUSSIAN_REACH)
        return (struct gaussian_value){0, 0, 0};
    if (x >= GAUSSIAN_REACH)
        return (struct gaussian_value){x, 1, 0};
    double at = (x + GAUSSIAN_REACH) * (GAUSSIAN_STEPS / (2 * GAUSSIAN_REACH));
    int i = (int)at;
    double t = at - i;
    const struct gaussian_value *value = &sensor->gaussian[i], *c = value + 1;
    return (struct gaussian_value){value->integral + t * (c->integral - value->integral),
                                   value->below + t * (c->below - value->below),
                                   value->density + t * (c->density - value->density)};
}

static void respond_along(const struct tag_sensor *sensor, double a, const struct edge_window *window,
                          struct axis_response *out)
{
    double reach = window->width / 2 + 3 * window->blur;
    const int first = clamp_int((int)floor(a - reach), 0, TAG_RIM - 1);
    const int last = clamp_int((int)floor(a + reach), first, TAG_RIM - 1);
    out->first = first;
    out->count = last - first + 1;
    double below = 0, below_a = 0, below_blur = 0; // of the edge below the cell
    double sharp = 1 / window->blur, narrow = 1 / window->width, half = window->width / 2;
    for (int i = first; i <= last; i++) {
        double above = 1, above_a = 0, above_blur = 0;
        if (i < last) {
            struct gaussian_value p = gaussian_at(sensor, (i + 1 - a + half) * sharp);
            struct gaussian_value m = gaussian_at(sensor, (i + 1 - a - half) * sharp);
            above = (p.integral - m.integral) * window->blur * narrow;
            above_a = (m.below - p.below) * narrow;
            above_blur = (p.density - m.density) * narrow * window->blur_by_px;
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

// The area that a pixel averages over, in cells along u and v.
struct footprint {
    struct edge_window u, v;
    // Of the two axes, cells^2, which the product of two one-dimensional responses leaves out. Where the axes are not
    // at right angles in the image, corners of cells would be wrong without it, and those of a tag by a hundredth of a
    // pixel. Taken into account to first order (Price 1958).
    double covariance;
};

static struct white_response render_white(const struct tag_sensor *sensor, const struct tag_model *model, double u,
                                          double v, const struct footprint *pixel)
{
    struct axis_response across, up;
    respond_along(sensor, (u + 1) / TAG_CELL + 1, &pixel->u, &across);
    respond_along(sensor, (v + 1) / TAG_CELL + 1, &pixel->v, &up);
    struct white_response s = {0};
    for (int j = 0; j < up.count; j++) {
        double row = 0, row_a = 0, row_blur = 0;
        for (int i = 0; i < across.count; i++) {
            double cell = model->cells[up.first + j][across.first + i];
            row += cell * across.share[i];
            row_a += cell * across.by_a[i];
            row_blur += cell * across.by_blur[i];
        }
        s.white += row * up.share[j] + pixel->covariance * row_a * up.by_a[j];
        s.by_u += row_a * up.share[j];
        s.by_v += row * up.by_a[j];
        s.by_blur += row_blur * up.share[j] + row * up.by_blur[j];
    }
    s.by_u /= TAG_CELL;
    s.by_v /= TAG_CELL;
    return s;
}

bool tag_model_predict(const struct tag_sensor *sensor, const struct tag_model *model, const double inverse[9],
                       const struct pixel_sample *sample, double *value, double by[TAG_PARAMETERS])
{
    double w = 1 / (inverse[6] * sample->x + inverse[7] * sample->y + inverse[8]);
    double u = (inverse[0] * sample->x + inverse[1] * sample->y + inverse[2]) * w;
    double v = (inverse[3] * sample->x + inverse[4] * sample->y + inverse[5]) * w;
    if (!(fabs(u) < 1 + 0.75 * TAG_CELL && fabs(v) < 1 + 0.75 * TAG_CELL))
        return false;
    double w_x = w * sensor->pixel_x, w_y = w * sensor->pixel_y;
    double u_x = (inverse[0] - u * inverse[6]) * w_x, u_y = (inverse[1] - u * inverse[7]) * w_y;
    double v_x = (inverse[3] - v * inverse[6]) * w_x, v_y = (inverse[4] - v * inverse[7]) * w_y;
    const struct footprint pixel = {.u = edge_window_of(u_x, u_y, model->blur_px),
                                    .v = edge_window_of(v_x, v_y, model->blur_px),
                                    .covariance = (model->blur_px * model->blur_px + 1.0 / 12) *
                                                  (u_x * v_x + u_y * v_y) / (TAG_CELL * TAG_CELL)};
    struct white_response shade = render_white(sensor, model, u, v, &pixel);
    double white = model->white + model->white_u * u + model->white_v * v;
    *value = model->black + (white - model->black) * shade.white;
    double by_u = (white - model->black) * shade.by_u + model->white_u * shade.white;
    double by_v = (white - model->black) * shade.by_v + model->white_v * shade.white;
    // h becomes h (I + d): at a fixed point of the image (u, v) moves by -d (u, v, 1)
    by[0] = -by_u * u;
    by[1] = -by_u * v;
    by[2] = -by_u;
    by[3] = -by_v * u;
    by[4] = -by_v * v;
    by[5] = -by_v;
    by[6] = (by_u * u + by_v * v) * u;
    by[7] = (by_u * u + by_v * v) * v;
    by[8] = (white - model->black) * shade.by_blur;
    by[9] = shade.white;
    by[10] = 1 - shade.white;
    by[11] = shade.white * u;
    by[12] = shade.white * v;
    return true;
}

// ---------------------------------------------------------------- tag depth

static const double ROBUST = 3;         // standard deviations: scale of the Cauchy kernel; chosen by hand
static const double DEPTH_SHARE = 0.25; // errors of neighbouring depth pixels are correlated; chosen by hand

void tag_read_depth(const struct tag_observation *seen, const struct lens *lens, const uint16_t *depth,
                    struct tag_depth *out)
{
    double h[9];
    out->count = 0;
    if (!planar_homography(seen->ray, h))
        return;
    double values[TAG_DEPTH_SAMPLES];
    enum { GRID = 6 };
    for (int i = 0; i < GRID * GRID; i++) {
        double u = ((i % GRID) + 0.5) * 2 / GRID - 1, v = ((i / GRID) + 0.5) * 2 / GRID - 1;
        double w = h[6] * u + h[7] * v + h[8];
        struct vec3 ray = v3((h[0] * u + h[1] * v + h[2]) / w, (h[3] * u + h[4] * v + h[5]) / w, 1);
        struct pixel px = lens_project(lens, ray);
        int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
        if (!(px.x > -0.5 && px.y > -0.5) || x >= lens->width || y >= lens->height)
            continue;
        double z = depth[(size_t)y * (size_t)lens->width + (size_t)x] * 1e-3;
        if (z == 0)
            continue;
        ray = lens_ray(lens, (struct pixel){x, y}); // of the pixel that was read
        out->sample[out->count++] = (struct depth_sample){ray.x, ray.y, z};
    }
    // Flying pixels and things in front of the tag are outliers of the plane 1 / z = a x + b y + c through the rest:
    // iteratively reweighted least squares, at first without robust weights.
    double a = 0, b = 0, c = 0;
    for (int round = 0; round < 4; round++) {
        double n[9] = {0}, g[3] = {0};
        for (int i = 0; i < out->count; i++) {
            const struct depth_sample *s = &out->sample[i];
            double q[3] = {s->x, s->y, 1},
                   error = round ? (s->z - 1 / (a * s->x + b * s->y + c)) / depth_absolute_sigma_m(s->z) : 0;
            values[i] = error;
            double weight =
                1 / (1 + error * error / (ROBUST * ROBUST)) * pow(s->z, 4) / pow(depth_absolute_sigma_m(s->z), 2);
            for (int k = 0; k < 3; k++) {
                g[k] += weight * q[k] / s->z;
                for (int l = 0; l < 3; l++)
                    n[k * 3 + l] += weight * q[k] * q[l];
            }
        }
        if (out->count < 6 || !cholesky_factor(n, 3)) {
            out->count = 0;
            return;
        }
        cholesky_solve(n, 3, g);
        a = g[0], b = g[1], c = g[2];
    }
    int kept = 0, levels = 0;
    for (int i = 0; i < out->count; i++)
        if (fabs(values[i]) < 4)
            out->sample[kept++] = out->sample[i];
    out->count = kept;
    for (int i = 0; i < kept; i++) {
        bool fresh = true;
        for (int k = 0; k < i; k++)
            fresh = fresh && out->sample[k].z != out->sample[i].z;
        levels += fresh;
    }
    out->share = DEPTH_SHARE * fmin(1, 3.0 * levels / fmax(1, kept));
}

// ---------------------------------------------------------------- mirrored tags

enum { MAX_SHOWN = 64 };

struct mirrored_tags {
    struct lens lens;
    struct tag_detector *detector;
    uint8_t *gray;
    bool counts[TAG_ID_COUNT];
};

enum status mirrored_tags_open(struct mirrored_tags **out, const struct lens *lens, const int32_t *ids, int count)
{
    struct mirrored_tags *m = calloc(1, sizeof *m);
    *out = NULL;
    if (!m || !(m->gray = malloc(lens_pixels(lens)))) {
        mirrored_tags_close(&m);
        return fail(ERR_MEMORY, "no memory to look for mirrored tags");
    }
    m->lens = *lens;
    for (int i = 0; i < TAG_ID_COUNT; i++)
        m->counts[i] = !ids;
    for (int i = 0; i < count && ids; i++)
        if (ids[i] >= 0 && ids[i] < TAG_ID_COUNT)
            m->counts[ids[i]] = true;
    const enum status status = tag_detector_open(&m->detector, 1);
    if (status != OK)
        mirrored_tags_close(&m);
    *out = m;
    return status;
}

void mirrored_tags_close(struct mirrored_tags **tags)
{
    if (!*tags)
        return;
    tag_detector_close(&(*tags)->detector);
    free((*tags)->gray);
    free(*tags);
    *tags = NULL;
}

enum status mirrored_tags_look_straight(struct mirrored_tags *tags, const uint8_t *gray, int *shown)
{
    struct tag_detection seen[MAX_SHOWN];
    int count = 0;
    const struct gray_image image = {gray, tags->lens.width, tags->lens.height};
    const enum status status = tag_detector_detect(tags->detector, &image, seen, MAX_SHOWN, &count);
    *shown = 0;
    for (int i = 0; status == OK && i < count; i++)
        *shown += tags->counts[seen[i].id];
    return status;
}

enum status mirrored_tags_look(struct mirrored_tags *tags, const uint8_t *gray, int *shown)
{
    memcpy(tags->gray, gray, lens_pixels(&tags->lens));
    gray_mirror(tags->gray, tags->lens.width, tags->lens.height);
    return mirrored_tags_look_straight(tags, tags->gray, shown);
}
