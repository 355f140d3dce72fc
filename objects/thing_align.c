#include "objects/thing_align.h"

#include "base/clamp.h"
#include "base/least_squares.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- thing view

static enum status find_features(const uint8_t *rgb, struct thing_view *view)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    uint8_t *plane = malloc(pixels);
    enum status status = plane ? OK : fail(ERR_MEMORY, "no memory for an image's features");
    for (int c = 0; c < MODEL_CHANNELS && status == OK; c++) {
        view->features[c] = malloc(VIEW_MAX_FEATURES * sizeof *view->features[c]);
        if (!view->features[c]) {
            status = fail(ERR_MEMORY, "no memory for an image's features");
            break;
        }
        model_channel(rgb, pixels, c, plane);
        status = scale_features_detect(plane, view->lens.width, view->lens.height, view->features[c], VIEW_MAX_FEATURES,
                                       &view->feature_count[c]);
    }
    free(plane);
    return status;
}

enum status thing_view_make(const struct lens *lens, const struct pose *camera_from_left, const uint8_t *rgb,
                            bool features, struct thing_view *out)
{
    const size_t n = (size_t)lens->width * (size_t)lens->height * 3;
    *out =
        (struct thing_view){.lens = *lens, .largest_r2 = lens_max_radius2(lens), .camera_from_left = *camera_from_left};
    out->level[0] = (struct texture_level){lens->width, lens->height, malloc(n * sizeof *out->level[0].rgb)};
    enum status status = out->level[0].rgb ? OK : fail(ERR_MEMORY, "no memory for an image");
    for (size_t i = 0; i < n && status == OK; i++)
        out->level[0].rgb[i] = rgb[i];
    if (status == OK)
        status = texture_pyramid(out->level, VIEW_LEVELS);
    if (status == OK && features)
        status = find_features(rgb, out);
    if (status != OK)
        thing_view_free(out);
    return status;
}

void thing_view_free(struct thing_view *view)
{
    for (int i = 0; i < VIEW_LEVELS; i++)
        free(view->level[i].rgb);
    for (int i = 0; i < MODEL_CHANNELS; i++)
        free(view->features[i]);
    *view = (struct thing_view){0};
}

// ---------------------------------------------------------------- thing align

// Chosen by hand: less of the surface's turned-away parts is used; fewer points than this say nothing.
#define MIN_FACING 0.45F
#define MIN_SEEN   0.25 // the same for a view: cosine
enum { MIN_POINTS = 24 };
#define HUBER     2.0 // standard deviations
#define MIN_NOISE 1.5 // grey levels

struct sample {
    float value[3], dx[3], dy[3];
};

// The image and its slope at `px` (full-size pixels); false: outside.
static bool sample_texture(const struct texture_level *texture_level, int level, struct pixel px, struct sample *out)
{
    const double share = 1.0 / (1 << level), x = (px.x + 0.5) * share - 0.5, y = (px.y + 0.5) * share - 0.5;
    if (!(x >= 1 && y >= 1 && x < texture_level->width - 2 && y < texture_level->height - 2))
        return false;
    const int x0 = (int)x, y0 = (int)y;
    const float fx = (float)(x - x0), fy = (float)(y - y0), s = (float)share;
    const float *a = texture_level->rgb + ((size_t)y0 * (size_t)texture_level->width + (size_t)x0) * 3,
                *b = a + (size_t)texture_level->width * 3;
    for (int c = 0; c < 3; c++) {
        const float top = a[c] + fx * (a[c + 3] - a[c]), low = b[c] + fx * (b[c + 3] - b[c]);
        out->value[c] = top + fy * (low - top);
        out->dx[c] = s * ((1 - fy) * (a[c + 3] - a[c]) + fy * (b[c + 3] - b[c]));
        out->dy[c] = s * (low - top);
    }
    return true;
}

// An alignment as one view sees it: what is the same for all points.
struct view_frame {
    const struct thing_view *view;
    struct vec3 of_thing[3]; // the thing's axes in the camera's
    struct vec3 of_left[3];  // the left camera's
    struct vec3 origin;      // the thing's, in the camera's axes
    double scale;
};

static struct vec3 combine_axes(const struct vec3 axes[3], struct vec3 v)
{
    return v3(axes[0].x * v.x + axes[1].x * v.y + axes[2].x * v.z, axes[0].y * v.x + axes[1].y * v.y + axes[2].y * v.z,
              axes[0].z * v.x + axes[1].z * v.y + axes[2].z * v.z);
}

static struct view_frame frame_of(const struct align_input *in, int view, const struct alignment *alignment)
{
    const struct thing_view *v = &in->views[view];
    const struct pose camera_from_thing = pose_multiply(v->camera_from_left, alignment->left_from_thing);
    struct view_frame f = {.view = v,
                           .origin = camera_from_thing.translation,
                           .scale = 1 + alignment->log_scale * (1 + alignment->log_scale / 2)};
    for (int k = 0; k < 3; k++) {
        const struct vec3 axis = v3(k == 0, k == 1, k == 2);
        f.of_thing[k] = quat_rotate(camera_from_thing.rotation, axis);
        f.of_left[k] = quat_rotate(v->camera_from_left.rotation, axis);
    }
    return f;
}

struct projected {
    struct vec3 arm; // from the thing's origin to the point, camera axes
    struct vec3 at;  // the point
    struct pixel px;
};

// False: behind the camera, or the surface there is turned away from it.
static bool project_sample(const struct align_input *in, const struct view_frame *frame, int i, struct projected *out)
{
    out->arm = v3_scale(combine_axes(frame->of_thing, in->samples->at[in->shape][i]), frame->scale);
    out->at = v3_add(out->arm, frame->origin);
    if (!(out->at.z > 0.02))
        return false;
    const double facing = v3_dot(combine_axes(frame->of_thing, in->samples->normal[in->shape][i]), out->at);
    if (facing >= 0 || facing * facing < MIN_SEEN * MIN_SEEN * v3_dot(out->at, out->at))
        return false;
    out->px = lens_project_clamped(&frame->view->lens, frame->view->largest_r2, out->at);
    return true;
}

// Gain and offset of each channel by the points seen so far: sums of 1, T, I, TT, TI, II with weights.
struct sums {
    double w, t, i, tt, ti, ii;
};

static double color_correlation(const struct sums sums[3])
{
    double ti = 0, tt = 0, ii = 0;
    for (int c = 0; c < 3; c++) {
        if (!(sums[c].w > 0))
            return -1;
        ti += sums[c].ti - sums[c].t * sums[c].i / sums[c].w;
        tt += sums[c].tt - sums[c].t * sums[c].t / sums[c].w;
        ii += sums[c].ii - sums[c].i * sums[c].i / sums[c].w;
    }
    return tt > 0 && ii > 0 ? ti / sqrt(tt * ii) : -1;
}

static void add_colors(struct sums sums[3], const float color[3], const float value[3])
{
    for (int c = 0; c < 3; c++) {
        const double t = color[c], i = value[c];
        sums[c].w += 1;
        sums[c].t += t;
        sums[c].i += i;
        sums[c].tt += t * t;
        sums[c].ti += t * i;
        sums[c].ii += i * i;
    }
}

static bool is_used(const struct align_input *in, int i) { return in->samples->facing[in->shape][i] >= MIN_FACING; }

// What the residuals give beside the normal equations.
struct residual_sums {
    double magnitude; // sum of |residual|
    int count;
};

// Where residuals are added.
struct residual_target {
    double noise; // standard deviation, grey levels
    struct least_squares_sums *normal;
    struct residual_sums *sums;
};

struct gains {
    double gain[3], offset[3];
};

// How the pixel moves with each unknown.
static void pixel_slopes(const struct view_frame *frame, const struct projected *projected,
                         double slope[ALIGN_UNKNOWNS][2])
{
    const struct thing_view *v = frame->view;
    static const double step = 1e-5;
    double j[3][2];
    for (int k = 0; k < 3; k++) {
        const struct vec3 d = v3(k == 0 ? step : 0, k == 1 ? step : 0, k == 2 ? step : 0);
        const struct pixel moved = lens_project_clamped(&v->lens, v->largest_r2, v3_add(projected->at, d));
        j[k][0] = (moved.x - projected->px.x) / step;
        j[k][1] = (moved.y - projected->px.y) / step;
    }
    for (int k = 0; k < ALIGN_UNKNOWNS; k++) {
        const struct vec3 axis = frame->of_left[k % 3];
        struct vec3 m = projected->arm;
        if (k < 3)
            m = v3_cross(axis, projected->arm);
        else if (k < 6)
            m = axis;
        slope[k][0] = j[0][0] * m.x + j[1][0] * m.y + j[2][0] * m.z;
        slope[k][1] = j[0][1] * m.x + j[1][1] * m.y + j[2][1] * m.z;
    }
}

// The cost: sum of Huber costs in units of noise^2.
static void add_residuals(const struct sample *at, const float color[3], const struct gains *gains,
                          const double slope[ALIGN_UNKNOWNS][2], struct residual_target *out)
{
    for (int c = 0; c < 3; c++) {
        const double r = at->value[c] - gains->gain[c] * color[c] - gains->offset[c], size = fabs(r) / out->noise;
        const double weight = (size <= HUBER ? 1 : HUBER / size) / (out->noise * out->noise);
        double j[ALIGN_UNKNOWNS];
        for (int k = 0; k < ALIGN_UNKNOWNS; k++)
            j[k] = at->dx[c] * slope[k][0] + at->dy[c] * slope[k][1];
        least_squares_add(out->normal, r, j, weight);
        out->normal->cost += size <= HUBER ? size * size : HUBER * (2 * size - HUBER);
        out->sums->magnitude += fabs(r);
        out->sums->count++;
    }
}

// Ratio of the largest to the smallest of the channels' brightness against the reference picture's; a few grey levels
// are added because a dark channel's ratio means little.
static double tint_of(const struct sums sums[3])
{
    double min = 1e9, max = 0;
    for (int c = 0; c < 3; c++) {
        const double share = (sums[c].i / sums[c].w + 15) / (sums[c].t / sums[c].w + 15);
        min = share < min ? share : min;
        max = share > max ? share : max;
    }
    return max / min;
}

// Writes the view's score, visible share and tint, too.
static bool view_gains(const struct align_input *in, int view, struct alignment *alignment, struct gains *gains)
{
    const struct view_frame f = frame_of(in, view, alignment);
    const struct texture_level *l = &f.view->level[in->level];
    struct sums s[3] = {{0}};
    int seen = 0, used = 0;
    for (int i = 0; i < in->samples->count; i++) {
        struct projected p;
        struct sample at;
        if (!is_used(in, i))
            continue;
        used++;
        if (!project_sample(in, &f, i, &p) || !sample_texture(l, in->level, p.px, &at))
            continue;
        seen++;
        add_colors(s, in->samples->color[i], at.value);
    }
    alignment->visible[view] = used ? (double)seen / used : 0;
    alignment->score[view] = seen < MIN_POINTS ? -1 : color_correlation(s);
    alignment->tint[view] = seen ? tint_of(s) : 1;
    for (int c = 0; c < 3 && seen; c++) {
        const double tt = s[c].tt - s[c].t * s[c].t / s[c].w, ti = s[c].ti - s[c].t * s[c].i / s[c].w;
        const double gain = tt > s[c].w ? ti / tt : 1; // a channel without contrast: as it is
        gains->gain[c] = clamp_double(gain, 0.1, 4);
        gains->offset[c] = (s[c].i - gains->gain[c] * s[c].t) / s[c].w;
    }
    return seen >= MIN_POINTS;
}

double thing_score(const struct align_input *in, int view, struct alignment *alignment)
{
    struct gains g;
    (void)view_gains(in, view, alignment, &g);
    return alignment->score[view];
}

static void add_view(const struct align_input *in, int view, const struct alignment *alignment,
                     const struct gains *gains, struct residual_target *out)
{
    const struct view_frame f = frame_of(in, view, alignment);
    const struct texture_level *l = &f.view->level[in->level];
    for (int i = 0; i < in->samples->count; i++) {
        struct projected p;
        struct sample at;
        if (!is_used(in, i))
            continue;
        if (!project_sample(in, &f, i, &p) || !sample_texture(l, in->level, p.px, &at))
            continue;
        double slope[ALIGN_UNKNOWNS][2];
        pixel_slopes(&f, &p, slope);
        add_residuals(&at, in->samples->color[i], gains, (const double(*)[2])slope, out);
    }
}

static bool build_normal(const struct align_input *in, struct alignment *alignment, struct least_squares_sums *normal,
                         struct residual_sums *sums)
{
    const int last = ALIGN_UNKNOWNS - 1;
    struct residual_target out = {alignment->noise, normal, sums};
    int in_sight = 0;
    *sums = (struct residual_sums){0};
    for (int v = 0; v < in->view_count; v++) {
        struct gains g;
        if (!view_gains(in, v, alignment, &g))
            continue;
        in_sight++;
        add_view(in, v, alignment, &g, &out);
    }
    if (!in_sight)
        return false;
    const double prior = in->variance_factor / (in->size.sigma * in->size.sigma);
    const double off = alignment->log_scale - in->size.log_scale;
    normal->a[last * ALIGN_UNKNOWNS + last] += prior;
    normal->g[last] -= prior * off;
    normal->cost = (normal->cost + prior * off * off) / sums->count;
    return true;
}

// Two states, as base/least_squares.h names them.
struct align_fit {
    const struct align_input *in;
    struct alignment at[2];
    struct residual_sums sums[2];
};

static bool move_alignment(void *user, const double *s)
{
    struct align_fit *fit = user;
    struct alignment *moved = &fit->at[STATE_TRIED];
    *moved = fit->at[STATE_KEPT];
    struct pose *p = &moved->left_from_thing;
    p->rotation = quat_unit(quat_multiply(quat_from_rotation_vector(v3(s[0], s[1], s[2])), p->rotation));
    p->translation = v3_add(p->translation, v3(s[3], s[4], s[5]));
    moved->log_scale += s[6];
    return p->translation.z > 0.05 && fabs(moved->log_scale) < 0.3;
}

// A state that loses a quarter of the residuals is none: it would be better for what it does not see.
static bool sum_residuals(void *user, enum least_squares_state state, struct least_squares_sums *normal)
{
    struct align_fit *fit = user;
    return build_normal(fit->in, &fit->at[state], normal, &fit->sums[state]) &&
           (state == STATE_KEPT || fit->sums[STATE_TRIED].count * 4 > fit->sums[STATE_KEPT].count * 3);
}

static void keep_alignment(void *user)
{
    struct align_fit *fit = user;
    fit->at[STATE_KEPT] = fit->at[STATE_TRIED];
    fit->sums[STATE_KEPT] = fit->sums[STATE_TRIED];
}

// The noise from the residuals: 1.25 is a normal distribution's standard deviation over its mean magnitude.
static bool update_noise(void *user)
{
    struct align_fit *fit = user;
    const double before = fit->at[STATE_KEPT].noise,
                 noise = 1.25 * fit->sums[STATE_KEPT].magnitude / fit->sums[STATE_KEPT].count;
    fit->at[STATE_KEPT].noise = noise < MIN_NOISE ? MIN_NOISE : noise;
    return fit->at[STATE_KEPT].noise != before;
}

bool thing_align(const struct align_input *in, int steps, struct alignment *alignment)
{
    struct align_fit fit = {.in = in, .at = {*alignment}};
    const struct least_squares_problem problem = {ALIGN_UNKNOWNS, &fit,           move_alignment,
                                                  sum_residuals,  keep_alignment, update_noise};
    const struct least_squares_options options = {steps, 0.01, 1e-5, 0};
    double work[LEAST_SQUARES_WORK(ALIGN_UNKNOWNS)];
    struct least_squares_sums normal;
    if (!(alignment->noise > 0))
        fit.at[STATE_KEPT].noise = 20;
    const enum least_squares_end end = least_squares_solve(&problem, &options, work, &normal);
    *alignment = fit.at[STATE_KEPT];
    if (end == LEAST_SQUARES_NO_START)
        return false;
    least_squares_mirror(&normal);
    for (int k = 0; k < ALIGN_UNKNOWNS * ALIGN_UNKNOWNS; k++)
        alignment->information[k] = normal.a[k] / in->variance_factor;
    return true;
}
