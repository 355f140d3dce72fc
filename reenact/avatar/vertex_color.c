#include "reenact/avatar/vertex_color.h"

#include "base/linear_algebra.h"
#include "base/threads.h"
#include "reenact/avatar/texture_atlas.h"
#include "reenact/observation/depth_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES_KEPT = 16, ITERATIONS = 8, RIM_PX = 1, CHUNK = 4096 };

// Chosen by hand on the takes of docs/results.md.
static const double MIN_FACING = 0.25;        // cosine towards the camera
static const float COLOR_OUTLIER = 0.06F;     // at this residual a sample's weight is a quarter of the full one (a half
                                              // for the irradiance)
static const float SH_REGULARIZATION = 0.02F; // ridge on the SH terms, of the data's weight: normals may cover few
                                              // directions

// What one frame shows of one point.
struct color_sample {
    float weight, rgb[3], normal[3], time_s; // rgb: linear; normal: world axes
};

struct vertex_color_builder {
    struct vertex_color_target target;
    struct calibration calibration;
    struct pose depth_from_color;
    int threads;
    struct color_sample (*samples)[SAMPLES_KEPT]; // of each point; weight 0: unused
    float linear[256];                            // of each byte
};

enum status vertex_color_open(struct vertex_color_builder **out, const struct vertex_color_target *target,
                              const struct calibration *calibration, int threads)
{
    struct vertex_color_builder *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "no memory for the mesh's colours");
    m->target = *target;
    m->threads = threads;
    m->calibration = *calibration;
    m->depth_from_color = pose_inverse(calibration->color_from_depth);
    m->samples = calloc((size_t)target->surface->point_count, sizeof *m->samples);
    for (int i = 0; i < 256; i++)
        m->linear[i] = (float)(i / 255.0 * i / 255.0);
    if (m->samples)
        return OK;
    vertex_color_close(out);
    return fail(ERR_MEMORY, "no memory for the mesh's colours");
}

void vertex_color_close(struct vertex_color_builder **builder)
{
    if (!*builder)
        return;
    free((*builder)->samples);
    free(*builder);
    *builder = NULL;
}

// ---------------------------------------------------------------- samples

// Replaces the weakest sample if the new one is better.
static void keep_sample(struct color_sample samples[SAMPLES_KEPT], const struct color_sample *sample)
{
    int weakest = 0;
    for (int i = 1; i < SAMPLES_KEPT; i++)
        if (samples[i].weight < samples[weakest].weight)
            weakest = i;
    if (sample->weight > samples[weakest].weight)
        samples[weakest] = *sample;
}

// Bilinear, linear colour. False: p projects outside the image.
static bool read_color(const struct vertex_color_builder *builder, const uint8_t *rgb, struct vec3 p, float out[3])
{
    const struct lens *lens = &builder->calibration.color;
    struct pixel px = lens_project(lens, p);
    int x = (int)floor(px.x), y = (int)floor(px.y);
    if (x < 0 || y < 0 || x + 1 >= lens->width || y + 1 >= lens->height)
        return false;
    float u = (float)(px.x - x), v = (float)(px.y - y);
    const uint8_t *a = rgb + 3 * (y * lens->width + x), *b = a + 3 * lens->width;
    for (int c = 0; c < 3; c++)
        out[c] = (builder->linear[a[c]] * (1 - u) + builder->linear[a[c + 3]] * u) * (1 - v) +
                 (builder->linear[b[c]] * (1 - u) + builder->linear[b[c + 3]] * u) * v;
    return true;
}

// The context of add_chunk.
struct color_observation {
    struct vertex_color_builder *builder;
    const struct vertex_color_frame *frame;
};

static void add_chunk(void *context, int chunk)
{
    const struct color_observation *observation = context;
    const struct vertex_color_builder *builder = observation->builder;
    const struct vertex_color_frame *f = observation->frame;
    const struct surface_mesh *surface = builder->target.surface;
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < surface->point_count; i++) {
        const struct skin_weights *skin = &builder->target.skins[i];
        struct vec3 p, n, bind_point = surface->points[i];
        bind_point = v3_add(bind_point, deformation_at(f->deformation, bind_point));
        linear_blend_skin(skin, f->transforms, bind_point, surface->normals[i], &p, &n);
        double facing = -v3_dot(n, v3_unit(p));
        struct color_sample sample = {.time_s = (float)f->time_s};
        if (!(p.z > 0.05) || facing < MIN_FACING ||
            !depth_agrees_with_bone(f->depth_frame, &builder->calibration.depth,
                                    pose_apply(builder->depth_from_color, p), skin->bone[0], RIM_PX) ||
            !read_color(builder, f->rgb, p, sample.rgb))
            continue;
        struct vec3 world = quat_rotate(f->world_from_camera.rotation, n);
        sample.normal[0] = (float)world.x, sample.normal[1] = (float)world.y, sample.normal[2] = (float)world.z;
        sample.weight = (float)(facing * facing / (p.z * p.z));
        keep_sample(builder->samples[i], &sample);
    }
}

static int chunk_count(const struct vertex_color_builder *builder)
{
    return (builder->target.surface->point_count + CHUNK - 1) / CHUNK;
}

void vertex_color_add(struct vertex_color_builder *builder, const struct vertex_color_frame *frame)
{
    struct color_observation a = {builder, frame};
    parallel_for(builder->threads, chunk_count(builder), add_chunk, &a);
}

// ---------------------------------------------------------------- alternation: albedo, then irradiance

// The irradiance at each sample's normal.
static void sample_irradiance(const struct color_sample samples[SAMPLES_KEPT], const struct sh_irradiance *irradiance,
                              float on[SAMPLES_KEPT])
{
    for (int k = 0; k < SAMPLES_KEPT; k++)
        on[k] = samples[k].weight > 0 ? sh_irradiance_at(irradiance, samples[k].normal) : 1;
}

// A point's albedo by weighted least squares; robust_weight: of each sample, multiplies its weight. False: no samples.
static bool fit_albedo(const struct color_sample samples[SAMPLES_KEPT], const float on[SAMPLES_KEPT],
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

// Likewise, robust: the weights are estimated from gamma-encoded residuals and the fit is repeated.
static bool fit_albedo_robust(const struct color_sample samples[SAMPLES_KEPT], const float on[SAMPLES_KEPT],
                              float color[3])
{
    enum { PASSES = 4 };
    float robust_weight[SAMPLES_KEPT];
    for (int k = 0; k < SAMPLES_KEPT; k++)
        robust_weight[k] = 1;
    for (int pass = 0; pass < PASSES; pass++) {
        if (!fit_albedo(samples, on, robust_weight, color))
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

// The normal equations of the irradiance's terms; of the matrix the lower half.
struct sh_equations {
    double a[SH_TERMS][SH_TERMS], b[SH_TERMS], size; // size: the sum of weights
};

// Each chunk of points has its own sums, added up in the chunks' order: the same result on any number of threads.
struct sh_fit {
    const struct vertex_color_builder *builder;
    struct sh_irradiance irradiance; // so far
    struct sh_equations *equations;  // of each chunk of points
};

static void accumulate_sh(struct sh_equations *equations, const struct color_sample *sample, float on,
                          const float color[3])
{
    float y[SH_TERMS];
    double bright = 0, seen = 0;
    for (int c = 0; c < 3; c++) {
        float off = sample->rgb[c] - color[c] * on;
        double weight = (double)(sample->weight / (1 + off * off / (COLOR_OUTLIER * COLOR_OUTLIER)));
        bright += weight * (double)(color[c] * color[c]);
        seen += weight * (double)(color[c] * sample->rgb[c]);
    }
    sh_basis(sample->normal, y);
    for (int r = 0; r < SH_TERMS; r++) {
        double by = bright * (double)y[r];
        for (int q = 0; q <= r; q++)
            equations->a[r][q] += by * (double)y[q];
        equations->b[r] += seen * (double)y[r];
    }
    equations->size += bright;
}

static void accumulate_chunk(void *context, int chunk)
{
    const struct sh_fit *fit = context;
    const struct vertex_color_builder *builder = fit->builder;
    struct sh_equations *s = &fit->equations[chunk];
    float on[SAMPLES_KEPT], robust_weight[SAMPLES_KEPT], color[3];
    *s = (struct sh_equations){0};
    for (int k = 0; k < SAMPLES_KEPT; k++)
        robust_weight[k] = 1;
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < builder->target.surface->point_count; i++) {
        const struct color_sample *samples = builder->samples[i];
        sample_irradiance(samples, &fit->irradiance, on);
        if (!fit_albedo(samples, on, robust_weight, color))
            continue;
        for (int k = 0; k < SAMPLES_KEPT; k++)
            if (samples[k].weight > 0)
                accumulate_sh(s, &samples[k], on[k], color);
    }
}

// One iteration: the points' albedo under the irradiance so far, then the irradiance for these albedos.
static void iterate_sh(struct sh_fit *fit)
{
    struct sh_equations all = {0};
    int count = chunk_count(fit->builder);
    parallel_for(fit->builder->threads, count, accumulate_chunk, fit);
    for (int i = 0; i < count; i++) {
        for (int r = 0; r < SH_TERMS; r++) {
            for (int q = 0; q <= r; q++)
                all.a[r][q] += fit->equations[i].a[r][q];
            all.b[r] += fit->equations[i].b[r];
        }
        all.size += fit->equations[i].size;
    }
    if (!(all.size > 0))
        return;
    for (int r = 0; r < SH_TERMS; r++) {
        for (int q = 0; q < r; q++)
            all.a[q][r] = all.a[r][q];
        all.a[r][r] += (double)SH_REGULARIZATION * all.size;
    }
    all.b[0] += (double)SH_REGULARIZATION * all.size; // towards constant irradiance
    gauss_solve(&all.a[0][0], SH_TERMS, all.b);
    for (int r = 0; r < SH_TERMS; r++)
        fit->irradiance.term[r] = (float)(all.b[r] / all.b[0]);
}

// ---------------------------------------------------------------- result

struct coloring {
    const struct vertex_color_builder *builder;
    struct vertex_colors *vertex_colors;
};

static void color_chunk(void *context, int chunk)
{
    const struct coloring *coloring = context;
    const struct vertex_color_builder *builder = coloring->builder;
    struct vertex_colors *out = coloring->vertex_colors;
    float on[SAMPLES_KEPT];
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < builder->target.surface->point_count; i++) {
        sample_irradiance(builder->samples[i], &out->irradiance, on);
        out->filled[i] = !fit_albedo_robust(builder->samples[i], on, out->color[i]);
        float best = 0;
        for (int k = 0; k < SAMPLES_KEPT; k++)
            if (builder->samples[i][k].weight > best)
                best = builder->samples[i][k].weight, out->time_s[i] = builder->samples[i][k].time_s;
    }
}

enum status vertex_color_solve(struct vertex_color_builder *builder, struct vertex_colors *out)
{
    size_t count = (size_t)builder->target.surface->point_count;
    struct sh_fit fit = {.builder = builder, .irradiance = {{1}}};
    *out = (struct vertex_colors){.color = calloc(count, sizeof *out->color),
                                  .time_s = calloc(count, sizeof *out->time_s),
                                  .filled = calloc(count, 1)};
    fit.equations = malloc(sizeof *fit.equations * (size_t)chunk_count(builder));
    if (!out->color || !out->time_s || !out->filled || !fit.equations) {
        free(fit.equations);
        vertex_colors_free(out);
        return fail(ERR_MEMORY, "no memory for the mesh's colours");
    }
    for (int iteration = 0; iteration < ITERATIONS; iteration++)
        iterate_sh(&fit);
    free(fit.equations);
    out->irradiance = fit.irradiance;
    struct coloring coloring = {builder, out};
    parallel_for(builder->threads, chunk_count(builder), color_chunk, &coloring);
    enum status status = color_inpaint(out, &builder->target, builder->threads);
    if (status != OK)
        vertex_colors_free(out);
    return status;
}

void vertex_colors_free(struct vertex_colors *colors)
{
    free(colors->color);
    free(colors->time_s);
    free(colors->filled);
    *colors = (struct vertex_colors){0};
}
