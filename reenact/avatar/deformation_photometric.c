#include "reenact/avatar/vertex_color.h"
#include "reenact/avatar/deformation_internal.h"

enum { REACH_MOST = 8, INNER_PX = 2 };

static const double COLOR = 0.08;        // colours that are the same differ by this, roots of linear, 0 to 1,
static const double ODD = 0.1;           // and those that differ by so much count a quarter
static const double LEAST_FACING = 0.35; // cosine: more aslant a pixel shows too much at once
static const double NEAR_M = 0.05;       // the reading that vouches for a place lies this near
static const double LEAST_CHANGE = 3;    // by metre: what changes less says nothing of where it is

// ---------------------------------------------------------------- the picture

// A Gaussian along one axis: the weights of the pixels from `first` on, and how they change as its middle moves by a
// pixel.
struct bell {
    int first, count;
    float weight[2 * REACH_MOST + 1], change[2 * REACH_MOST + 1], sum, change_sum;
};

static struct bell bell_at(double middle, double sigma)
{
    const int reach = (int)ceil(2 * sigma);
    struct bell b = {.first = (int)floor(middle + 0.5) - reach, .count = 2 * reach + 1};
    assert(reach <= REACH_MOST);
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
static bool look_at(const struct lens *lens, const uint8_t *rgb, struct pixel px, double sigma, struct color_place *out)
{
    const struct bell x = bell_at(px.x, sigma), y = bell_at(px.y, sigma);
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

// Does the frame's depth vouch that a place of that bone is what is seen there, and not at an edge?
static bool vouched(const struct warp *w, const struct sight *s, struct vec3 in_depth, int bone)
{
    if (!(in_depth.z > 0.05))
        return false;
    const struct pixel px = lens_project(&w->depth_lens, in_depth);
    const int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
    if (x < 0 || y < 0 || x >= s->width || y >= s->height)
        return false;
    const int at = y * s->width + x;
    return s->edge[at] >= INNER_PX && s->part[at] < PART_COUNT && bones_meet(s->part[at], (int)bone_part(bone)) &&
           fabs(s->depth[at] * 1e-3 - in_depth.z) <= NEAR_M;
}

static bool find_place(const struct warp *w, const struct warp_model *m, const struct sight *s,
                       const struct posture *posture, const struct warp_colors *k, int point, double sigma,
                       struct color_place *out)
{
    const struct skin *skin = &m->skins[point];
    struct vec3 n;
    out->rest = m->surface->points[point];
    out->bone = skin->bone[0];
    skin_place(skin, posture, v3_add(out->rest, warp_shift_now(w, out->rest)), m->surface->normals[point], &out->at,
               &n);
    if (!(out->at.z > 0.05) || -v3_dot(n, v3_unit(out->at)) < LEAST_FACING ||
        !vouched(w, s, pose_apply(w->depth_from_color, out->at), out->bone))
        return false;
    const struct lens *lens = &k->calibration->color;
    const struct vec3 world = quat_rotate(k->world_from_color, n);
    const float light = light_on(&k->coat->light, (const float[3]){(float)world.x, (float)world.y, (float)world.z});
    for (int c = 0; c < 3; c++)
        out->known[c] = sqrtf(k->coat->color[point][c] * light);
    return look_at(lens, k->rgb, lens_project(lens, out->at), sigma, out);
}

static void find_places(struct warp *w, const struct warp_model *m, const struct sight *s,
                        const struct posture *posture, const struct warp_colors *k, double sigma)
{
    const int every = m->surface->point_count / WARP_COLOR_PLACES + 1;
    w->color_place_count = 0;
    for (int i = 0; i < m->surface->point_count; i += every)
        if (!k->coat->filled[i] && find_place(w, m, s, posture, k, i, sigma, &w->color_places[w->color_place_count]))
            w->color_place_count++;
}

// ---------------------------------------------------------------- what they say

// How much brighter the frame is than the coat: exposure changes.
static float brighter(const struct warp *w)
{
    float both = 0, own = 0;
    for (int i = 0; i < w->color_place_count; i++)
        for (int c = 0; c < 3; c++) {
            const struct color_place *p = &w->color_places[i];
            both += p->seen[c] * p->known[c];
            own += p->known[c] * p->known[c];
        }
    return own > 0 ? both / own : 1;
}

// Where the place should go so that channel c shows there what is known of it: a row along the colour's change.
static void add_channel(struct warp *w, const struct color_place *p, int c, float gain, const struct lens *lens,
                        struct quat rest_from_color)
{
    const double x = (double)p->across[c] * lens->fx / p->at.z, y = (double)p->down[c] * lens->fy / p->at.z;
    const struct vec3 change = {x, y, -(x * p->at.x + y * p->at.y) / p->at.z}; // by metre, as px = f p / z has it
    const double size = v3_length(change), off = (double)(gain * p->known[c] - p->seen[c]);
    if (!(size > LEAST_CHANGE))
        return;
    const double robust = ODD * ODD / (ODD * ODD + off * off), each = robust * size / COLOR;
    warp_add_row(w, p->rest, quat_rotate(rest_from_color, v3_scale(change, 1 / size)), off / size, each * each);
}

void warp_add_colors(struct warp *w, const struct warp_model *model, const struct sight *sight,
                     const struct posture *posture, const struct warp_colors *colors, double sigma_px)
{
    find_places(w, model, sight, posture, colors, sigma_px);
    const float gain = brighter(w);
    for (int i = 0; i < w->color_place_count; i++) {
        const struct color_place *p = &w->color_places[i];
        const struct quat rest_from_color = quat_conjugate(posture->bone[p->bone].rotation);
        for (int c = 0; c < 3; c++)
            add_channel(w, p, c, gain, &colors->calibration->color, rest_from_color);
    }
}
