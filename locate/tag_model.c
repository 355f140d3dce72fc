#include "locate/tag_model.h"

#include "base/clamp.h"

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
static struct gaussian_value gaussian_at(const struct tag_sensor *r, double x)
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

static void respond_along(const struct tag_sensor *r, double a, const struct edge_window *w, struct axis_response *out)
{
    double reach = w->width / 2 + 3 * w->blur;
    const int first = clamp_int((int)floor(a - reach), 0, TAG_RIM - 1);
    const int last = clamp_int((int)floor(a + reach), first, TAG_RIM - 1);
    out->first = first;
    out->count = last - first + 1;
    double below = 0, below_a = 0, below_blur = 0; // of the edge below the cell
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

// The area that a pixel averages over, in cells along u and v.
struct footprint {
    struct edge_window u, v;
    // Of the two axes, cells^2, which the product of two one-dimensional responses leaves out. Where the axes are not
    // at right angles in the image, corners of cells would be wrong without it, and those of a tag by a hundredth of a
    // pixel. Taken into account to first order (Price 1958).
    double covariance;
};

static struct white_response render_white(const struct tag_sensor *r, const struct tag_model *m, double u, double v,
                                          const struct footprint *pixel)
{
    struct axis_response across, up;
    respond_along(r, (u + 1) / TAG_CELL + 1, &pixel->u, &across);
    respond_along(r, (v + 1) / TAG_CELL + 1, &pixel->v, &up);
    struct white_response s = {0};
    for (int j = 0; j < up.count; j++) {
        double row = 0, row_a = 0, row_blur = 0;
        for (int i = 0; i < across.count; i++) {
            double cell = m->cells[up.first + j][across.first + i];
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

bool tag_model_predict(const struct tag_sensor *r, const struct tag_model *m, const double inverse[9],
                       const struct pixel_sample *s, double *value, double by[TAG_PARAMETERS])
{
    double w = 1 / (inverse[6] * s->x + inverse[7] * s->y + inverse[8]);
    double u = (inverse[0] * s->x + inverse[1] * s->y + inverse[2]) * w;
    double v = (inverse[3] * s->x + inverse[4] * s->y + inverse[5]) * w;
    if (!(fabs(u) < 1 + 0.75 * TAG_CELL && fabs(v) < 1 + 0.75 * TAG_CELL))
        return false;
    double w_x = w * r->pixel_x, w_y = w * r->pixel_y;
    double u_x = (inverse[0] - u * inverse[6]) * w_x, u_y = (inverse[1] - u * inverse[7]) * w_y;
    double v_x = (inverse[3] - v * inverse[6]) * w_x, v_y = (inverse[4] - v * inverse[7]) * w_y;
    const struct footprint pixel = {.u = edge_window_of(u_x, u_y, m->blur_px),
                                    .v = edge_window_of(v_x, v_y, m->blur_px),
                                    .covariance = (m->blur_px * m->blur_px + 1.0 / 12) * (u_x * v_x + u_y * v_y) /
                                                  (TAG_CELL * TAG_CELL)};
    struct white_response shade = render_white(r, m, u, v, &pixel);
    double white = m->white + m->white_u * u + m->white_v * v;
    *value = m->black + (white - m->black) * shade.white;
    double by_u = (white - m->black) * shade.by_u + m->white_u * shade.white;
    double by_v = (white - m->black) * shade.by_v + m->white_v * shade.white;
    // h becomes h (I + d): at a fixed point of the image (u, v) moves by -d (u, v, 1)
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
