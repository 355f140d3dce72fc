// The photometric term of the deformation: image gradients at the surface's points, as in direct image alignment.
#include "reenact/avatar/deformation_internal.h"
#include "base/portable_math.h"
#include "reenact/observation/depth_agreement.h"

enum { KERNEL_RADIUS_MOST = 8, EDGE_MARGIN_PX = 2 };

// Colours are gamma-encoded, 0 to 1. Tuned by hand on the takes of docs/results.md.
static const double COLOR_SIGMA = 0.08;  // standard deviation of a channel between frame and avatar
static const double COLOR_OUTLIER = 0.1; // at this difference a channel's weight is a quarter
static const double LEAST_FACING = 0.35; // cosine: where the surface is more oblique, a pixel covers too much of it
static const double GRADIENT_LEAST = 3;  // per metre: a weaker gradient does not locate the point

// ---------------------------------------------------------------- image samples

// A Gaussian along one axis: the weights of the pixels from `first` on, and their change as its centre moves by a
// pixel.
struct gaussian_kernel {
    int first, count;
    float weight[2 * KERNEL_RADIUS_MOST + 1], change[2 * KERNEL_RADIUS_MOST + 1], sum, change_sum;
};

static struct gaussian_kernel gaussian_at(double center, double sigma)
{
    const int reach = (int)ceil(2 * sigma);
    struct gaussian_kernel b = {.first = (int)floor(center + 0.5) - reach, .count = 2 * reach + 1};
    assert(reach <= KERNEL_RADIUS_MOST);
    for (int i = 0; i < b.count; i++) {
        const double off = (b.first + i - center) / sigma;
        b.weight[i] = (float)portable_exp(-0.5 * off * off);
        b.change[i] = b.weight[i] * (float)(off / sigma);
        b.sum += b.weight[i];
        b.change_sum += b.change[i];
    }
    return b;
}

// The smoothed image's colour and gradient at px. False: too near the image's edge.
static bool sample_image(const struct lens *lens, const uint8_t *rgb, struct pixel px, double sigma,
                         struct color_point *out)
{
    const struct gaussian_kernel x = gaussian_at(px.x, sigma), y = gaussian_at(px.y, sigma);
    if (x.first < 0 || y.first < 0 || x.first + x.count > lens->width || y.first + y.count > lens->height)
        return false;
    float sum[3] = {0}, across[3] = {0}, down[3] = {0};
    for (int j = 0; j < y.count; j++) {
        const uint8_t *row = rgb + 3 * ((size_t)(y.first + j) * (size_t)lens->width + (size_t)x.first);
        for (int c = 0; c < 3; c++) {
            float line = 0, line_change = 0;
            for (int i = 0; i < x.count; i++) {
                line += x.weight[i] * (float)row[3 * i + c];
                line_change += x.change[i] * (float)row[3 * i + c];
            }
            sum[c] += y.weight[j] * line;
            across[c] += y.weight[j] * line_change;
            down[c] += y.change[j] * line;
        }
    }
    const float all = 1 / (255 * x.sum * y.sum);
    for (int c = 0; c < 3; c++) {
        out->seen[c] = sum[c] * all;
        out->across[c] = across[c] * all - out->seen[c] * x.change_sum / x.sum;
        out->down[c] = down[c] * all - out->seen[c] * y.change_sum / y.sum;
    }
    return true;
}

// ---------------------------------------------------------------- points

// What colours are compared with, for one iteration.
struct photometric {
    struct deformation *w;
    const struct deformation_model *model;
    const struct depth_frame *depth_frame;
    const struct bone_transforms *transforms;
    const struct deformation_colors *colors;
    double sigma_px;
};

// False: the frame does not show the point, or only obliquely, or too near the image's edge.
static bool make_color_point(const struct photometric *a, int point, struct color_point *out)
{
    const struct deformation *w = a->w;
    const struct deformation_colors *k = a->colors;
    const struct surface_mesh *surface = a->model->surface;
    const struct skin_weights *skin = &a->model->skins[point];
    struct vec3 n;
    out->bind_point = surface->points[point];
    out->bone = skin->bone[0];
    linear_blend_skin(skin, a->transforms, v3_add(out->bind_point, deformation_current_shift(w, out->bind_point)),
                      surface->normals[point], &out->at, &n);
    if (!(out->at.z > 0.05) || -v3_dot(n, v3_unit(out->at)) < LEAST_FACING ||
        !depth_agrees_with_bone(a->depth_frame, &w->depth_lens, pose_apply(w->depth_from_color, out->at), out->bone,
                                EDGE_MARGIN_PX))
        return false;
    const struct lens *lens = &k->calibration->color;
    const struct vec3 world = quat_rotate(k->world_from_color, n);
    const float irradiance =
        sh_irradiance_at(k->irradiance, (const float[3]){(float)world.x, (float)world.y, (float)world.z});
    for (int c = 0; c < 3; c++)
        out->known[c] = sqrtf(k->albedo[point][c] * irradiance);
    return sample_image(lens, k->rgb, lens_project(lens, out->at), a->sigma_px, out);
}

static void find_color_points(const struct photometric *a)
{
    struct deformation *w = a->w;
    const int points = a->model->surface->point_count, every = points / DEFORMATION_COLOR_POINTS + 1;
    w->color_point_count = 0;
    for (int i = 0; i < points; i += every)
        if (!a->colors->filled[i] && make_color_point(a, i, &w->color_points[w->color_point_count]))
            w->color_point_count++;
}

// ---------------------------------------------------------------- rows

// The frame's brightness against the avatar's, least squares: exposure changes.
static float exposure_gain(const struct deformation *w)
{
    float both = 0, own = 0;
    for (int i = 0; i < w->color_point_count; i++)
        for (int c = 0; c < 3; c++) {
            const struct color_point *p = &w->color_points[i];
            both += p->seen[c] * p->known[c];
            own += p->known[c] * p->known[c];
        }
    return own > 0 ? both / own : 1;
}

// A row along the image gradient of channel c: how far the point should move for the image to show its known colour.
static void add_channel(const struct photometric *a, const struct color_point *p, int c, float gain)
{
    const struct lens *lens = &a->colors->calibration->color;
    const double x = (double)p->across[c] * lens->fx / p->at.z, y = (double)p->down[c] * lens->fy / p->at.z;
    const struct vec3 change = {x, y, -(x * p->at.x + y * p->at.y) / p->at.z}; // per metre, since px = f p / z
    const double size = v3_length(change), off = (double)(gain * p->known[c] - p->seen[c]);
    if (!(size > GRADIENT_LEAST))
        return;
    const struct quat bind_from_color = quat_conjugate(a->transforms->bone[p->bone].rotation);
    const double robust = COLOR_OUTLIER * COLOR_OUTLIER / (COLOR_OUTLIER * COLOR_OUTLIER + off * off),
                 each = robust * size / COLOR_SIGMA;
    const struct vec3 normal = quat_rotate(bind_from_color, v3_scale(change, 1 / size));
    deformation_add_row(a->w, &(struct deformation_constraint){p->bind_point, normal, off / size, each * each});
}

void deformation_add_colors(struct deformation *w, const struct deformation_model *model,
                            const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                            const struct deformation_colors *colors, double sigma_px)
{
    const struct photometric a = {w, model, depth_frame, transforms, colors, sigma_px};
    find_color_points(&a);
    const float gain = exposure_gain(w);
    for (int i = 0; i < w->color_point_count; i++)
        for (int c = 0; c < 3; c++)
            add_channel(&a, &w->color_points[i], c, gain);
}
