#include "reenact/avatar/vertex_color.h"
#include "reenact/avatar/deformation_internal.h"

enum { KERNEL_RADIUS_MOST = 8, EDGE_MARGIN_PX = 2 };

static const double COLOR_SIGMA = 0.08;       // colours that are the same differ by this, roots of linear, 0 to 1,
static const double COLOR_OUTLIER = 0.1;      // and those that differ by so much count a quarter
static const double LEAST_FACING = 0.35;      // cosine: more aslant a pixel shows too much at once
static const double DEPTH_AGREEMENT_M = 0.05; // the reading that confirms a place lies this near
static const double GRADIENT_LEAST = 3;       // by metre: what changes less says nothing of where it is

// ---------------------------------------------------------------- the picture

// A Gaussian along one axis: the weights of the pixels from `first` on, and how they change as its middle moves by a
// pixel.
struct gaussian_kernel {
    int first, count;
    float weight[2 * KERNEL_RADIUS_MOST + 1], change[2 * KERNEL_RADIUS_MOST + 1], sum, change_sum;
};

static struct gaussian_kernel gaussian_at(double middle, double sigma)
{
    const int reach = (int)ceil(2 * sigma);
    struct gaussian_kernel b = {.first = (int)floor(middle + 0.5) - reach, .count = 2 * reach + 1};
    assert(reach <= KERNEL_RADIUS_MOST);
    for (int i = 0; i < b.count; i++) {
        const double off = (b.first + i - middle) / sigma;
        b.weight[i] = (float)exp(-0.5 * off * off);
        b.change[i] = b.weight[i] * (float)(off / sigma);
        b.sum += b.weight[i];
        b.change_sum += b.change[i];
    }
    return b;
}

// The smoothed picture's colour at px and how it changes. False: too near the picture's edge.
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

// ---------------------------------------------------------------- places

// Does the frame's depth confirm that a place of that bone is what is seen there, and not at an edge?
static bool depth_agrees(const struct deformation *w, const struct depth_frame *s, struct vec3 in_depth, int bone)
{
    if (!(in_depth.z > 0.05))
        return false;
    const struct pixel px = lens_project(&w->depth_lens, in_depth);
    const int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
    if (x < 0 || y < 0 || x >= s->width || y >= s->height)
        return false;
    const int at = y * s->width + x;
    return s->edge_distance[at] >= EDGE_MARGIN_PX && s->part[at] < PART_COUNT &&
           bones_adjacent(s->part[at], (int)bone_part(bone)) &&
           fabs(s->depth[at] * 1e-3 - in_depth.z) <= DEPTH_AGREEMENT_M;
}

static bool make_color_point(const struct deformation *w, const struct deformation_model *m,
                             const struct depth_frame *s, const struct bone_transforms *transforms,
                             const struct deformation_colors *k, int point, double sigma, struct color_point *out)
{
    const struct skin_weights *skin = &m->skins[point];
    struct vec3 n;
    out->bind_point = m->surface->points[point];
    out->bone = skin->bone[0];
    linear_blend_skin(skin, transforms, v3_add(out->bind_point, deformation_current_shift(w, out->bind_point)),
                      m->surface->normals[point], &out->at, &n);
    if (!(out->at.z > 0.05) || -v3_dot(n, v3_unit(out->at)) < LEAST_FACING ||
        !depth_agrees(w, s, pose_apply(w->depth_from_color, out->at), out->bone))
        return false;
    const struct lens *lens = &k->calibration->color;
    const struct vec3 world = quat_rotate(k->world_from_color, n);
    const float light =
        sh_irradiance_at(&k->vertex_colors->light, (const float[3]){(float)world.x, (float)world.y, (float)world.z});
    for (int c = 0; c < 3; c++)
        out->known[c] = sqrtf(k->vertex_colors->color[point][c] * light);
    return sample_image(lens, k->rgb, lens_project(lens, out->at), sigma, out);
}

static void find_color_points(struct deformation *w, const struct deformation_model *m, const struct depth_frame *s,
                              const struct bone_transforms *transforms, const struct deformation_colors *k,
                              double sigma)
{
    const int every = m->surface->point_count / DEFORMATION_COLOR_POINTS + 1;
    w->color_point_count = 0;
    for (int i = 0; i < m->surface->point_count; i += every)
        if (!k->vertex_colors->filled[i] &&
            make_color_point(w, m, s, transforms, k, i, sigma, &w->color_points[w->color_point_count]))
            w->color_point_count++;
}

// ---------------------------------------------------------------- what they say

// How much brighter the frame is than the vertex_colors: exposure changes.
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

// Where the place should go so that channel c shows there what is known of it: a row along the colour's change.
static void add_channel(struct deformation *w, const struct color_point *p, int c, float gain, const struct lens *lens,
                        struct quat bind_from_color)
{
    const double x = (double)p->across[c] * lens->fx / p->at.z, y = (double)p->down[c] * lens->fy / p->at.z;
    const struct vec3 change = {x, y, -(x * p->at.x + y * p->at.y) / p->at.z}; // by metre, as px = f p / z has it
    const double size = v3_length(change), off = (double)(gain * p->known[c] - p->seen[c]);
    if (!(size > GRADIENT_LEAST))
        return;
    const double robust = COLOR_OUTLIER * COLOR_OUTLIER / (COLOR_OUTLIER * COLOR_OUTLIER + off * off),
                 each = robust * size / COLOR_SIGMA;
    deformation_add_row(w, p->bind_point, quat_rotate(bind_from_color, v3_scale(change, 1 / size)), off / size,
                        each * each);
}

void deformation_add_colors(struct deformation *w, const struct deformation_model *model,
                            const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                            const struct deformation_colors *colors, double sigma_px)
{
    find_color_points(w, model, depth_frame, transforms, colors, sigma_px);
    const float gain = exposure_gain(w);
    for (int i = 0; i < w->color_point_count; i++) {
        const struct color_point *p = &w->color_points[i];
        const struct quat bind_from_color = quat_conjugate(transforms->bone[p->bone].rotation);
        for (int c = 0; c < 3; c++)
            add_channel(w, p, c, gain, &colors->calibration->color, bind_from_color);
    }
}
