#include "reenact/avatar/vertex_color.h"

#include "base/linear_algebra.h"
#include "base/parallel.h"
#include "reenact/avatar/color_inpainting.h"

#include <stdlib.h>
#include <string.h>

enum { SAMPLES_KEPT = 16, ITERATIONS = 8, RIM_PX = 1, THREADS = 2, CHUNK = 4096 };

static const double LEAST_FACING = 0.25;      // cosine towards the camera
static const double DEPTH_AGREEMENT_M = 0.05; // the reading that confirms a place lies this near
static const float COLOR_OUTLIER = 0.06F;     // a colour so far from the others counts a quarter
static const float SH_REGULARIZATION = 0.02F; // of the light's terms, against being read from too few sides

// One frame's sample about one point.
struct color_sample {
    float weight, rgb[3], normal[3], time_s; // linear; world axes
};

struct vertex_color_builder {
    const struct bind_pose *bind_pose;
    const struct surface_mesh *surface;
    const struct skin_weights *skins;
    struct calibration calibration;
    struct pose depth_from_color;
    struct color_sample (*samples)[SAMPLES_KEPT]; // of each point; the unused have weight 0
    float linear[256];
};

enum status vertex_color_open(struct vertex_color_builder **out, const struct bind_pose *bind_pose,
                              const struct surface_mesh *surface, const struct skin_weights *skins,
                              const struct calibration *calibration)
{
    struct vertex_color_builder *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "out of memory");
    m->bind_pose = bind_pose;
    m->surface = surface;
    m->skins = skins;
    m->calibration = *calibration;
    m->depth_from_color = pose_inverse(calibration->color_from_depth);
    m->samples = calloc((size_t)surface->point_count, sizeof *m->samples);
    for (int i = 0; i < 256; i++)
        m->linear[i] = (float)(i / 255.0 * i / 255.0); // near enough to sRGB's curve, and undone by a root
    if (m->samples)
        return OK;
    vertex_color_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void vertex_color_close(struct vertex_color_builder **m)
{
    if (!*m)
        return;
    free((*m)->samples);
    free(*m);
    *m = NULL;
}

// ---------------------------------------------------------------- gathering

static void keep_sample(struct color_sample samples[SAMPLES_KEPT], const struct color_sample *sample)
{
    int weakest = 0;
    for (int i = 1; i < SAMPLES_KEPT; i++)
        if (samples[i].weight < samples[weakest].weight)
            weakest = i;
    if (sample->weight > samples[weakest].weight)
        samples[weakest] = *sample;
}

// Does the depth picture confirm that the point `p` (depth camera's axes) of `part` is what is seen there?
static bool depth_agrees(const struct vertex_color_builder *m, const struct depth_frame *s, struct vec3 p,
                         enum part part)
{
    if (!(p.z > 0.05))
        return false;
    struct pixel px = lens_project(&m->calibration.depth, p);
    int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
    if (x < 0 || y < 0 || x >= s->width || y >= s->height)
        return false;
    int i = y * s->width + x;
    if (s->edge_distance[i] < RIM_PX || s->part[i] >= PART_COUNT || !bones_adjacent(s->part[i], (int)part) ||
        fabs(s->depth[i] * 1e-3 - p.z) > DEPTH_AGREEMENT_M)
        return false;
    return true;
}

static bool read_color(const struct vertex_color_builder *m, const uint8_t *rgb, struct vec3 p, float out[3])
{
    const struct lens *lens = &m->calibration.color;
    struct pixel px = lens_project(lens, p);
    int x = (int)floor(px.x), y = (int)floor(px.y);
    if (x < 0 || y < 0 || x + 1 >= lens->width || y + 1 >= lens->height)
        return false;
    float u = (float)(px.x - x), v = (float)(px.y - y);
    const uint8_t *a = rgb + 3 * (y * lens->width + x), *b = a + 3 * lens->width;
    for (int c = 0; c < 3; c++)
        out[c] = (m->linear[a[c]] * (1 - u) + m->linear[a[c + 3]] * u) * (1 - v) +
                 (m->linear[b[c]] * (1 - u) + m->linear[b[c + 3]] * u) * v;
    return true;
}

// What one frame says, to one chunk of the points after the other.
struct color_observation {
    struct vertex_color_builder *maker;
    const struct depth_frame *depth_frame;
    const uint8_t *rgb;
    const struct bone_transforms *transforms;
    const struct deformation *deformation;
    struct pose world_from_camera;
    double time_s;
};

static void add_chunk(void *context, int chunk)
{
    const struct color_observation *a = context;
    const struct vertex_color_builder *m = a->maker;
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < m->surface->point_count; i++) {
        struct vec3 p, n, bind_point = m->surface->points[i];
        bind_point = v3_add(bind_point, deformation_at(a->deformation, bind_point));
        linear_blend_skin(&m->skins[i], a->transforms, bind_point, m->surface->normals[i], &p, &n);
        double facing = -v3_dot(n, v3_unit(p));
        struct color_sample sample = {.time_s = (float)a->time_s};
        if (!(p.z > 0.05) || facing < LEAST_FACING ||
            !depth_agrees(m, a->depth_frame, pose_apply(m->depth_from_color, p), bone_part(m->skins[i].bone[0])) ||
            !read_color(m, a->rgb, p, sample.rgb))
            continue;
        struct vec3 world = quat_rotate(a->world_from_camera.rotation, n);
        sample.normal[0] = (float)world.x, sample.normal[1] = (float)world.y, sample.normal[2] = (float)world.z;
        sample.weight = (float)(facing * facing / (p.z * p.z));
        keep_sample(m->samples[i], &sample);
    }
}

static int chunk_count(const struct vertex_color_builder *m) { return (m->surface->point_count + CHUNK - 1) / CHUNK; }

void vertex_color_add(struct vertex_color_builder *m, const struct depth_frame *depth_frame, const uint8_t *rgb,
                      const struct bone_transforms *transforms, const struct deformation *deformation,
                      struct pose world_from_camera, double time_s)
{
    struct color_observation a = {m, depth_frame, rgb, transforms, deformation, world_from_camera, time_s};
    parallel_for(THREADS, chunk_count(m), add_chunk, &a);
}

// ---------------------------------------------------------------- light

static void sh_basis(const float n[3], float y[SH_TERMS])
{
    y[0] = 1;
    y[1] = n[0], y[2] = n[1], y[3] = n[2];
    y[4] = n[0] * n[1], y[5] = n[1] * n[2], y[6] = n[0] * n[2];
    y[7] = n[0] * n[0] - n[1] * n[1], y[8] = 3 * n[2] * n[2] - 1;
}

float sh_irradiance_at(const struct sh_irradiance *light, const float n[3])
{
    float y[SH_TERMS], sum = 0;
    sh_basis(n, y);
    for (int i = 0; i < SH_TERMS; i++)
        sum += light->term[i] * y[i];
    return fminf(fmaxf(sum, IRRADIANCE_LEAST), IRRADIANCE_MOST);
}

// The light on each sample's side of the surface.
static void sample_irradiance(const struct color_sample samples[SAMPLES_KEPT], const struct sh_irradiance *light,
                              float on[SAMPLES_KEPT])
{
    for (int k = 0; k < SAMPLES_KEPT; k++)
        on[k] = samples[k].weight > 0 ? sh_irradiance_at(light, samples[k].normal) : 1;
}

// The point's own colour in the mean light, each sample counting `robust_weight` of its weight; false: nobody saw it.
static bool own_color(const struct color_sample samples[SAMPLES_KEPT], const float on[SAMPLES_KEPT],
                      const float robust_weight[SAMPLES_KEPT], float color[3])
{
    float sum[3] = {0}, total = 0;
    for (int k = 0; k < SAMPLES_KEPT; k++) {
        if (!(samples[k].weight > 0))
            continue;
        float w = samples[k].weight * robust_weight[k];
        for (int c = 0; c < 3; c++)
            sum[c] += w * on[k] * samples[k].rgb[c];
        total += w * on[k] * on[k];
    }
    for (int c = 0; c < 3 && total > 0; c++)
        color[c] = sum[c] / total;
    return total > 0;
}

// Likewise, but samples that differ from the others count less.
static bool robust_color(const struct color_sample samples[SAMPLES_KEPT], const float on[SAMPLES_KEPT], float color[3])
{
    enum { PASSES = 4 };
    float robust_weight[SAMPLES_KEPT];
    for (int k = 0; k < SAMPLES_KEPT; k++)
        robust_weight[k] = 1;
    for (int pass = 0; pass < PASSES; pass++) {
        if (!own_color(samples, on, robust_weight, color))
            return false;
        for (int k = 0; k < SAMPLES_KEPT; k++) {
            float off = 0;
            for (int c = 0; c < 3 && samples[k].weight > 0; c++)
                off += fabsf(sqrtf(samples[k].rgb[c] / on[k]) - sqrtf(color[c]));
            robust_weight[k] = 1 / (1 + off * off / (COLOR_OUTLIER * COLOR_OUTLIER));
            robust_weight[k] *= robust_weight[k];
        }
    }
    return true;
}

// What all samples say of the light, in the least squares' normal equations: the lower half of the matrix.
struct sh_equations {
    double a[SH_TERMS][SH_TERMS], b[SH_TERMS], size;
};

// The points in chunk_count, each for itself: the same sums whoever works them out.
struct sh_fit {
    const struct vertex_color_builder *maker;
    struct sh_irradiance light;
    struct sh_equations *equations; // of each chunk
};

static void accumulate_sh(struct sh_equations *s, const struct color_sample *w, float on, const float color[3])
{
    float y[SH_TERMS];
    double bright = 0, seen = 0;
    for (int c = 0; c < 3; c++) {
        float off = w->rgb[c] - color[c] * on;
        double weight = (double)(w->weight / (1 + off * off / (COLOR_OUTLIER * COLOR_OUTLIER)));
        bright += weight * (double)(color[c] * color[c]);
        seen += weight * (double)(color[c] * w->rgb[c]);
    }
    sh_basis(w->normal, y);
    for (int r = 0; r < SH_TERMS; r++) {
        double by = bright * (double)y[r];
        for (int q = 0; q <= r; q++)
            s->a[r][q] += by * (double)y[q];
        s->b[r] += seen * (double)y[r];
    }
    s->size += bright;
}

static void accumulate_chunk(void *context, int chunk)
{
    const struct sh_fit *l = context;
    const struct vertex_color_builder *m = l->maker;
    struct sh_equations *s = &l->equations[chunk];
    float on[SAMPLES_KEPT], robust_weight[SAMPLES_KEPT], color[3];
    *s = (struct sh_equations){0};
    for (int k = 0; k < SAMPLES_KEPT; k++)
        robust_weight[k] = 1;
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < m->surface->point_count; i++) {
        const struct color_sample *samples = m->samples[i];
        sample_irradiance(samples, &l->light, on);
        if (!own_color(samples, on, robust_weight, color))
            continue;
        for (int k = 0; k < SAMPLES_KEPT; k++)
            if (samples[k].weight > 0)
                accumulate_sh(s, &samples[k], on[k], color);
    }
}

// One round: the points' colours in the light so far, then the light by these colours.
static void iterate_sh(struct sh_fit *l)
{
    struct sh_equations all = {0};
    int count = chunk_count(l->maker);
    parallel_for(THREADS, count, accumulate_chunk, l);
    for (int i = 0; i < count; i++) {
        for (int r = 0; r < SH_TERMS; r++) {
            for (int q = 0; q <= r; q++)
                all.a[r][q] += l->equations[i].a[r][q];
            all.b[r] += l->equations[i].b[r];
        }
        all.size += l->equations[i].size;
    }
    if (!(all.size > 0))
        return;
    for (int r = 0; r < SH_TERMS; r++) {
        for (int q = 0; q < r; q++)
            all.a[q][r] = all.a[r][q];
        all.a[r][r] += (double)SH_REGULARIZATION * all.size;
    }
    all.b[0] += (double)SH_REGULARIZATION * all.size; // towards even light
    gauss_solve(&all.a[0][0], SH_TERMS, all.b);
    for (int r = 0; r < SH_TERMS; r++)
        l->light.term[r] = (float)(all.b[r] / all.b[0]);
}

// ---------------------------------------------------------------- making

struct coloring {
    const struct vertex_color_builder *maker;
    struct vertex_colors *vertex_colors;
};

static void color_chunk(void *context, int chunk)
{
    const struct coloring *g = context;
    const struct vertex_color_builder *m = g->maker;
    struct vertex_colors *out = g->vertex_colors;
    float on[SAMPLES_KEPT];
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < m->surface->point_count; i++) {
        sample_irradiance(m->samples[i], &out->light, on);
        out->filled[i] = !robust_color(m->samples[i], on, out->color[i]);
        float best = 0;
        for (int k = 0; k < SAMPLES_KEPT; k++)
            if (m->samples[i][k].weight > best)
                best = m->samples[i][k].weight, out->time_s[i] = m->samples[i][k].time_s;
    }
}

enum status vertex_color_solve(struct vertex_color_builder *m, struct vertex_colors *out)
{
    size_t count = (size_t)m->surface->point_count;
    struct sh_fit fit = {.maker = m, .light = {{1}}};
    *out = (struct vertex_colors){.color = calloc(count, sizeof *out->color),
                                  .time_s = calloc(count, sizeof *out->time_s),
                                  .filled = calloc(count, 1)};
    fit.equations = malloc(sizeof *fit.equations * (size_t)chunk_count(m));
    if (!out->color || !out->time_s || !out->filled || !fit.equations) {
        free(fit.equations);
        vertex_colors_free(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int round = 0; round < ITERATIONS; round++)
        iterate_sh(&fit);
    free(fit.equations);
    out->light = fit.light;
    struct coloring coloring = {m, out};
    parallel_for(THREADS, chunk_count(m), color_chunk, &coloring);
    enum status status = color_inpaint(out, m->surface, m->skins, m->bind_pose);
    if (status != OK)
        vertex_colors_free(out);
    return status;
}

void vertex_colors_free(struct vertex_colors *c)
{
    free(c->color);
    free(c->time_s);
    free(c->filled);
    *c = (struct vertex_colors){0};
}
