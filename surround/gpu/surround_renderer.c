#include "surround/gpu/surround_renderer.h"

#include "reenact/render/shaders.h"
#include "surround/gpu/surround_renderer_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PARTS = 4, JUDGES = 8 }; // vec4s of a picture in surround_picture.glsl; pictures that test one's depth
#define NEAREST_M ((float)VIEW_NEAREST_M)

enum surface_uniform {
    VIEW_FROM_PICTURE,
    SURFACE_LENS,
    VIEW_RANGE,
    ORDER,
    SURFACE_CAMERA,
    SURFACE_PICTURES,
    SURFACE_UNIFORMS
};
enum texture_uniform { TEXTURE_LENS, LOOK, TEXTURE_CAMERA, TEXTURE_PICTURES, TEXTURE_UNIFORMS };

static const char *const surface_names[SURFACE_UNIFORMS] = {[VIEW_FROM_PICTURE] = "view_from_picture",
                                                            [SURFACE_LENS] = "view_lens",
                                                            [VIEW_RANGE] = "view_range",
                                                            [ORDER] = "order",
                                                            [SURFACE_CAMERA] = "camera",
                                                            [SURFACE_PICTURES] = "pictures"};
static const char *const texture_names[TEXTURE_UNIFORMS] = {
    [TEXTURE_LENS] = "view_lens", [LOOK] = "look", [TEXTURE_CAMERA] = "camera", [TEXTURE_PICTURES] = "pictures"};
static const char *const surface_samplers[] = {"ranges", "depths"};
static const char *const texture_samplers[] = {"surface", "colors", "depths"};
static const struct gpu_program_source surface_text = {.name = "surround_surface",
                                                       .uniforms = surface_names,
                                                       .uniform_count = SURFACE_UNIFORMS,
                                                       .samplers = surface_samplers,
                                                       .sampler_count = 1},
                                       unasked_text = {.name = "surround_surface_unasked",
                                                       .uniforms = surface_names,
                                                       .uniform_count = SURFACE_UNIFORMS,
                                                       .samplers = surface_samplers,
                                                       .sampler_count = 2},
                                       texture_text = {.name = "surround_texture",
                                                       .uniforms = texture_names,
                                                       .uniform_count = TEXTURE_UNIFORMS,
                                                       .samplers = texture_samplers,
                                                       .sampler_count = COUNT_OF(texture_samplers)};

// Opens the program for so many pictures where it is not open yet.
static enum status fit_program(struct surround_renderer *r, struct gpu_program **program,
                               const struct gpu_program_source *like, int pictures)
{
    char word[32], fragment[40];
    struct gpu_program_source text = *like;
    snprintf(word, sizeof word, "PICTURES %d", pictures);
    snprintf(fragment, sizeof fragment, "%s.frag", like->name);
    text.vertex = shader_find(like == &texture_text ? "fullscreen.vert" : "surround_surface.vert");
    text.fragment = shader_find(fragment);
    text.word = word;
    return *program ? OK : gpu_program_open(program, r->gpu, &text);
}

static enum status fit_surface_program(struct surround_renderer *r, int pictures)
{
    return fit_program(r, &r->surface_programs[pictures], &surface_text, pictures);
}

static enum status fit_texture_program(struct surround_renderer *r, int pictures)
{
    return fit_program(r, &r->texture_programs[pictures], &texture_text, pictures);
}

enum status surround_renderer_open(struct surround_renderer **out, struct gpu *gpu)
{
    struct surround_renderer *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "out of memory");
    r->gpu = r->store.gpu = gpu;
    enum status status = surround_renderer_open_overlay(r);
    if (status == OK)
        status = fit_surface_program(r, 1); // tells whether the driver can
    if (status == OK)
        status = fit_texture_program(r, 1);
    if (status == OK)
        status = fullscreen_mesh_open(&r->fullscreen, gpu);
    if (status == OK)
        status = gpu_texture_open_array(&r->none, gpu, &(struct gpu_array_layout){GPU_ARRAY_R16F, 1, 1, 1});
    if (status != OK)
        surround_renderer_close(out);
    return status;
}

void surround_renderer_close(struct surround_renderer **out)
{
    struct surround_renderer *r = *out;
    if (!r)
        return;
    picture_store_close(&r->store);
    for (int i = 0; i <= SURROUND_RENDERER_MOST; i++) {
        gpu_program_close(&r->surface_programs[i]);
        gpu_program_close(&r->texture_programs[i]);
    }
    gpu_program_close(&r->unasked_program);
    gpu_program_close(&r->tint_program);
    gpu_program_close(&r->sample_program);
    gpu_mesh_close(&r->fullscreen);
    gpu_texture_close(&r->none);
    gpu_target_close(&r->surface);
    gpu_target_close(&r->image);
    gpu_target_close(&r->sample);
    free(r);
    *out = NULL;
}

static enum status fit_targets(struct surround_renderer *r, const struct lens *lens)
{
    const bool fits = r->image && r->lens.width == lens->width && r->lens.height == lens->height;
    r->lens = *lens;
    if (fits)
        return OK;
    gpu_target_close(&r->surface);
    gpu_target_close(&r->image);
    enum status status = gpu_target_open(&r->surface, r->gpu, lens->width, lens->height);
    return status == OK ? gpu_target_open_color(&r->image, r->gpu, lens->width, lens->height) : status;
}

static bool same_camera(const struct surround_picture *a, const struct surround_picture *b)
{
    return a->panorama == b->panorama && a->width == b->width && a->height == b->height &&
           (a->panorama || lens_equal(&a->lens, &b->lens));
}

// Those of the list that are on the graphics card, and as many of the others as may be uploaded now.
static enum status gather(struct surround_renderer *r, const struct surround_image *image,
                          const struct surround_picture *const *list, int listed)
{
    const struct surround_picture *pictures[SURROUND_RENDERER_MOST];
    int layers[SURROUND_RENDERER_MOST], uploads = 0, count = 0;
    for (int i = 0; i < listed && count < SURROUND_RENDERER_MOST; i++)
        if (same_camera(list[i], list[0]))
            pictures[count++] = list[i];
    enum status status = picture_store_fit(&r->store, pictures, count);
    for (int i = 0; i < count && status == OK; i++)
        layers[i] = picture_store_find(&r->store, pictures[i]->depth_number);
    r->count = r->missing = 0;
    for (int i = 0; i < count && status == OK; i++) {
        if (layers[i] < 0 && (!image->most_uploads || uploads < image->most_uploads)) {
            status = picture_store_add(&r->store, pictures[i], &layers[i]);
            uploads++;
        }
        if (layers[i] < 0) {
            r->missing++;
            continue;
        }
        r->pictures[r->count] = pictures[i];
        r->layers[r->count++] = layers[i];
    }
    return status;
}

static void picture_uniform(const struct surround_renderer *r, struct pose world_from_view, float *out)
{
    for (int i = r->count; i < SURROUND_RENDERER_MOST; i++)
        out[4 * PARTS * i + 15] = -1; // there is none
    for (int i = 0; i < r->count; i++, out += 4 * PARTS) {
        const struct surround_picture *p = r->pictures[i];
        surround_rows_of(pose_multiply(pose_inverse(p->world_from_camera), world_from_view), out);
        memcpy(out + 12, p->gain, sizeof p->gain);
        out[15] = (float)r->layers[i];
    }
}

static void camera_uniform(const struct surround_picture *p, float out[8])
{
    const double parts[8] = {p->panorama, p->panorama ? 6.283185307 / p->width : 1 / p->lens.fx,
                             p->width,    p->height,
                             p->lens.fx,  p->lens.fy,
                             p->lens.cx,  p->lens.cy};
    for (int k = 0; k < 8; k++)
        out[k] = (float)parts[k];
}

// Programs are compiled for some numbers of pictures; what an image lacks of one is marked.
static int program_size(int count)
{
    static const int sizes[] = {1, 2, 3, 4, 6, 8, 12, SURROUND_RENDERER_MOST};
    int i = 0;
    while (sizes[i] < count)
        i++;
    return sizes[i];
}

// ---------------------------------------------------------------- surfaces

// Whether a piece may be in sight: not all of its rays, at the nearest and the farthest, beyond one edge of the view.
// In units of the ray, as view_warp; between the rays of its grid it bulges by less than the margin.
static bool may_be_seen(const struct stored_piece *piece, const struct lens *lens, const float rows[12])
{
    const float margin = 0.1f;
    const float left = -(float)((lens->cx + 1) / lens->fx) - margin, top = -(float)((lens->cy + 1) / lens->fy) - margin;
    const float right = (float)((lens->width - lens->cx) / lens->fx) + margin;
    const float bottom = (float)((lens->height - lens->cy) / lens->fy) + margin;
    int outside[5] = {0};
    for (int k = 0; k < 2 * SURROUND_MESH_RAYS; k++) {
        const float *ray = piece->rays[k / 2], inverse = k % 2 ? piece->most : piece->least;
        float q[3];
        for (int i = 0; i < 3; i++)
            q[i] =
                rows[4 * i] * ray[0] + rows[4 * i + 1] * ray[1] + rows[4 * i + 2] * ray[2] + inverse * rows[4 * i + 3];
        const float slack = q[2] < 0 ? margin : 0;
        outside[0] += q[2] < -margin;
        outside[1] += q[0] < left * q[2] - slack;
        outside[2] += q[0] > right * q[2] + slack;
        outside[3] += q[1] < top * q[2] - slack;
        outside[4] += q[1] > bottom * q[2] + slack;
    }
    for (int i = 0; i < 5; i++)
        if (outside[i] == 2 * SURROUND_MESH_RAYS)
            return false;
    return true;
}

static void draw_surface(struct surround_renderer *r, const struct surround_image *image, struct gpu_program *program,
                         int number)
{
    const struct stored_picture *stored = &r->store.pictures[r->layers[number]];
    const float order[4] = {(float)number, image->how.depth_test, (float)image->how.apart, (float)r->layers[number]};
    float rows[12];
    surround_rows_of(pose_multiply(pose_inverse(image->world_from_view), r->pictures[number]->world_from_camera), rows);
    gpu_program_set(program, VIEW_FROM_PICTURE, rows, 3);
    gpu_program_set(program, ORDER, order, 1);
    for (int i = 0; i < stored->count; i++)
        if (may_be_seen(&stored->pieces[i], &image->lens, rows))
            gpu_draw(&(struct gpu_job){.target = r->surface,
                                       .program = program,
                                       .mesh = stored->pieces[i].mesh,
                                       .textures = {r->store.ranges, r->store.depths},
                                       .closed = true,
                                       .depth_test = true});
}

static enum status draw_surfaces(struct surround_renderer *r, const struct surround_image *image, const float lens[4],
                                 const float camera[8], const float *pictures)
{
    const float range[4] = {(float)image->lens.width, (float)image->lens.height, NEAREST_M, 0};
    const int judges = program_size(r->count < JUDGES ? r->count : JUDGES);
    gpu_target_clear(r->surface);
    if (!r->count)
        return OK;
    // Those asked, then the others, which have to be supported by these.
    const int drawn = r->count < image->how.geometry_pictures ? r->count : image->how.geometry_pictures;
    const int asked = !image->how.depth_test || drawn < judges ? drawn : judges;
    struct gpu_program **programs[2] = {&r->surface_programs[judges], &r->unasked_program};
    enum status status = fit_program(r, programs[0], &surface_text, judges);
    if (status == OK && asked < drawn)
        status = fit_program(r, programs[1], &unasked_text, judges);
    for (int k = 0; k < (asked < drawn ? 2 : 1) && status == OK; k++) {
        struct gpu_program *program = *programs[k];
        gpu_program_set(program, SURFACE_LENS, lens, 1);
        gpu_program_set(program, VIEW_RANGE, range, 1);
        gpu_program_set(program, SURFACE_CAMERA, camera, 2);
        gpu_program_set(program, SURFACE_PICTURES, pictures, PARTS * judges);
        for (int i = k ? asked : 0; i < (k ? drawn : asked); i++)
            draw_surface(r, image, program, i);
    }
    return status;
}

static enum status draw_texture(struct surround_renderer *r, const struct surround_image *image, const float lens[4],
                                const float camera[8], const float *pictures)
{
    const float look[4] = {(float)image->hatched, (float)(1 / image->lens.fx), (float)VIEW_RESOLUTION_COST, NEAREST_M};
    const int count = program_size(r->count);
    const enum status status = fit_texture_program(r, count);
    if (status != OK)
        return status;
    struct gpu_program *program = r->texture_programs[count];
    gpu_program_set(program, TEXTURE_LENS, lens, 1);
    gpu_program_set(program, LOOK, look, 1);
    gpu_program_set(program, TEXTURE_CAMERA, camera, 2);
    gpu_program_set(program, TEXTURE_PICTURES, pictures, PARTS * count);
    gpu_draw(&(struct gpu_job){.target = r->image,
                               .program = program,
                               .mesh = r->fullscreen,
                               .textures = {gpu_target_texture(r->surface), r->count ? r->store.colors : r->none,
                                            r->count ? r->store.depths : r->none}});
    return OK;
}

enum status surround_renderer_draw(struct surround_renderer *r, const struct surround_image *image,
                                   const struct surround_picture *const *pictures, int count,
                                   const struct gpu_texture **out)
{
    const struct lens *l = &image->lens;
    const float lens[4] = {(float)l->fx, (float)l->fy, (float)l->cx, (float)l->cy};
    float uniform[4 * PARTS * SURROUND_RENDERER_MOST] = {0}, camera[8] = {0};
    enum status status = fit_targets(r, l);
    if (status == OK)
        status = gather(r, image, pictures, count);
    if (status != OK)
        return status;
    r->world_from_view = image->world_from_view;
    picture_uniform(r, image->world_from_view, uniform);
    if (r->count)
        camera_uniform(r->pictures[0], camera);
    status = draw_surfaces(r, image, lens, camera, uniform);
    if (status == OK)
        status = draw_texture(r, image, lens, camera, uniform);
    *out = gpu_target_texture(r->image);
    return status == OK ? gpu_check(r->gpu) : status;
}

int surround_renderer_missing(const struct surround_renderer *r) { return r->missing; }
