// The drawn image's depth read back, and a box tinted over it.
#include "reenact/render/shaders.h"
#include "surround/gpu/surround_renderer_internal.h"

#include <stdlib.h>
#include <string.h>

enum tint_uniform { TINT_LENS, BOX_FROM_VIEW, BOX, TINT, TINT_UNIFORMS };

enum status surround_renderer_open_overlay(struct surround_renderer *r)
{
    static const char *const tint_names[TINT_UNIFORMS] = {
        [TINT_LENS] = "view_lens", [BOX_FROM_VIEW] = "box_from_view", [BOX] = "box", [TINT] = "tint"};
    static const char *const sample_names[1] = {"step_px"}, *const samplers[] = {"surface"};
    struct gpu_program_source text = {.name = "surround_tint",
                                      .vertex = shader_find("fullscreen.vert"),
                                      .fragment = shader_find("surround_tint.frag"),
                                      .uniforms = tint_names,
                                      .uniform_count = TINT_UNIFORMS,
                                      .samplers = samplers,
                                      .sampler_count = 1};
    enum status status = gpu_program_open(&r->tint_program, r->gpu, &text);
    text.name = "surround_sample";
    text.fragment = shader_find("surround_sample.frag");
    text.uniforms = sample_names;
    text.uniform_count = 1;
    return status == OK ? gpu_program_open(&r->sample_program, r->gpu, &text) : status;
}

// Of the middle of each step x step pixels.
static struct lens sampled_lens(const struct lens *of, int step)
{
    struct lens l = *of;
    l.width = of->width / step;
    l.height = of->height / step;
    l.fx /= step;
    l.fy /= step;
    l.cx = (of->cx - step / 2) / step;
    l.cy = (of->cy - step / 2) / step;
    return l;
}

static enum status fit_sample(struct surround_renderer *r, const struct lens *lens, struct surround_view *view)
{
    enum status status = OK;
    if (!r->sample || lens->width != r->sample_width || lens->height != r->sample_height) {
        gpu_target_close(&r->sample);
        r->sample_width = lens->width;
        r->sample_height = lens->height;
        status = gpu_target_open_color(&r->sample, r->gpu, lens->width, lens->height);
    }
    if (status == OK && (!view->inverse_z || view->lens.width != lens->width || view->lens.height != lens->height)) {
        surround_view_close(view);
        status = surround_view_open(view, lens);
    }
    view->lens = *lens;
    return status;
}

enum status surround_renderer_read_depth(struct surround_renderer *r, int step, struct surround_view *view)
{
    if (!r->image)
        return NOTHING;
    const struct lens lens = sampled_lens(&r->lens, step);
    const size_t pixels = (size_t)lens.width * (size_t)lens.height;
    const float step_px[4] = {(float)step, 0, 0, 0};
    enum status status = fit_sample(r, &lens, view);
    uint8_t *rgba = malloc(4 * pixels + 1);
    if (status == OK && !rgba)
        status = fail(ERR_MEMORY, "out of memory");
    if (status == OK) {
        view->world_from_view = r->world_from_view;
        quat_to_matrix(r->world_from_view.rotation, view->axes);
        gpu_program_set(r->sample_program, 0, step_px, 1);
        gpu_draw(&(struct gpu_job){.target = r->sample,
                                   .program = r->sample_program,
                                   .mesh = r->fullscreen,
                                   .textures = {gpu_target_texture(r->surface)}});
        status = gpu_target_read(r->sample, rgba);
    }
    for (size_t i = 0; i < pixels && status == OK; i++) {
        view->inverse_z[i] = surround_inverse_z(rgba + 4 * i);
        view->source[i] = rgba[4 * i + 3] ? SOURCE_SEEN : SOURCE_UNSEEN;
    }
    free(rgba);
    return status;
}

// ---------------------------------------------------------------- a box

// The box's bounds in the image; all of it where the box reaches behind the eye.
static struct gpu_box bounds_of(const struct surround_renderer *r, const struct surround_box *box)
{
    const struct pose view_from_box = pose_multiply(pose_inverse(r->world_from_view), box->world_from_box);
    double left = r->lens.width, right = 0, top = r->lens.height, bottom = 0;
    for (int k = 0; k < 8; k++) {
        const double *x = k & 1 ? box->high : box->low, *y = k & 2 ? box->high : box->low;
        const double *z = k & 4 ? box->high : box->low;
        const struct vec3 c = pose_apply(view_from_box, v3(x[0], y[1], z[2]));
        if (c.z < VIEW_NEAREST_M)
            return (struct gpu_box){0};
        const double u = r->lens.fx * c.x / c.z + r->lens.cx, v = r->lens.fy * c.y / c.z + r->lens.cy;
        left = fmin(left, u), right = fmax(right, u);
        top = fmin(top, v), bottom = fmax(bottom, v);
    }
    left = fmin(fmax(floor(left), 0), r->lens.width), top = fmin(fmax(floor(top), 0), r->lens.height);
    right = fmin(ceil(right) + 1, r->lens.width), bottom = fmin(ceil(bottom) + 1, r->lens.height);
    return (struct gpu_box){(int)left, (int)top, (int)fmax(right - left, 1), (int)fmax(bottom - top, 1)};
}

void surround_renderer_tint(struct surround_renderer *r, const struct surround_box *box)
{
    const float lens[4] = {(float)r->lens.fx, (float)r->lens.fy, (float)r->lens.cx, (float)r->lens.cy};
    float rows[12], corners[8] = {0}, tint[4];
    surround_rows_of(pose_multiply(pose_inverse(box->world_from_box), r->world_from_view), rows);
    for (int i = 0; i < 3; i++) {
        corners[i] = (float)box->low[i];
        corners[4 + i] = (float)box->high[i];
        tint[i] = (float)(box->opacity * box->color[i] / 255);
    }
    corners[3] = (float)VIEW_NEAREST_M;
    tint[3] = (float)box->opacity;
    gpu_program_set(r->tint_program, TINT_LENS, lens, 1);
    gpu_program_set(r->tint_program, BOX_FROM_VIEW, rows, 3);
    gpu_program_set(r->tint_program, BOX, corners, 2);
    gpu_program_set(r->tint_program, TINT, tint, 1);
    gpu_draw(&(struct gpu_job){.target = r->image,
                               .program = r->tint_program,
                               .mesh = r->fullscreen,
                               .textures = {gpu_target_texture(r->surface)},
                               .blend = true,
                               .within = bounds_of(r, box)});
}
