#include "surround/gpu/surround_renderer.h"

#include "reenact/render/shaders.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- surround readback

// The drawn image's depth read back, and a box tinted over it.

enum tint_uniform { TINT_LENS, BOX_FROM_VIEW, BOX, TINT, TINT_UNIFORMS };

// The renderer's programs. ERR_DEVICE, ERR_MEMORY.
static enum status surround_renderer_open_overlay(struct surround_renderer *renderer)
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
    enum status status = gpu_program_open(&renderer->tint_program, renderer->gpu, &text);
    text.name = "surround_sample";
    text.fragment = shader_find("surround_sample.frag");
    text.uniforms = sample_names;
    text.uniform_count = 1;
    return status == OK ? gpu_program_open(&renderer->sample_program, renderer->gpu, &text) : status;
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

static enum status fit_sample(struct surround_renderer *renderer, const struct lens *lens, struct surround_view *view)
{
    enum status status = OK;
    if (!renderer->sample || lens->width != renderer->sample_width || lens->height != renderer->sample_height) {
        gpu_target_close(&renderer->sample);
        renderer->sample_width = lens->width;
        renderer->sample_height = lens->height;
        status = gpu_target_open_color(&renderer->sample, renderer->gpu, lens->width, lens->height);
    }
    if (status == OK && (!view->inverse_z || view->lens.width != lens->width || view->lens.height != lens->height)) {
        surround_view_close(view);
        status = surround_view_open(view, lens);
    }
    view->lens = *lens;
    return status;
}

enum status surround_renderer_read_depth(struct surround_renderer *renderer, int step, struct surround_view *view)
{
    if (!renderer->image)
        return NOTHING;
    const struct lens lens = sampled_lens(&renderer->lens, step);
    const size_t pixels = (size_t)lens.width * (size_t)lens.height;
    const float step_px[4] = {(float)step, 0, 0, 0};
    enum status status = fit_sample(renderer, &lens, view);
    uint8_t *rgba = malloc(4 * pixels + 1);
    if (status == OK && !rgba)
        status = fail(ERR_MEMORY, "no memory for reading a picture back");
    if (status == OK) {
        view->world_from_view = renderer->world_from_view;
        quat_to_matrix(renderer->world_from_view.rotation, view->axes);
        gpu_program_set(renderer->sample_program, 0, step_px, 1);
        gpu_draw(&(struct gpu_job){.target = renderer->sample,
                                   .program = renderer->sample_program,
                                   .mesh = renderer->fullscreen,
                                   .textures = {gpu_target_texture(renderer->surface)}});
        status = gpu_target_read(renderer->sample, rgba);
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
static struct gpu_box bounds_of(const struct surround_renderer *renderer, const struct surround_box *box)
{
    const struct pose view_from_box = pose_multiply(pose_inverse(renderer->world_from_view), box->world_from_box);
    double left = renderer->lens.width, right = 0, top = renderer->lens.height, bottom = 0;
    for (int k = 0; k < 8; k++) {
        const double *x = k & 1 ? box->high : box->low, *y = k & 2 ? box->high : box->low;
        const double *z = k & 4 ? box->high : box->low;
        const struct vec3 c = pose_apply(view_from_box, v3(x[0], y[1], z[2]));
        if (c.z < VIEW_NEAREST_M)
            return (struct gpu_box){0};
        const double u = renderer->lens.fx * c.x / c.z + renderer->lens.cx,
                     v = renderer->lens.fy * c.y / c.z + renderer->lens.cy;
        left = fmin(left, u), right = fmax(right, u);
        top = fmin(top, v), bottom = fmax(bottom, v);
    }
    left = fmin(fmax(floor(left), 0), renderer->lens.width), top = fmin(fmax(floor(top), 0), renderer->lens.height);
    right = fmin(ceil(right) + 1, renderer->lens.width), bottom = fmin(ceil(bottom) + 1, renderer->lens.height);
    return (struct gpu_box){(int)left, (int)top, (int)fmax(right - left, 1), (int)fmax(bottom - top, 1)};
}

void surround_renderer_tint(struct surround_renderer *renderer, const struct surround_box *box)
{
    const float lens[4] = {(float)renderer->lens.fx, (float)renderer->lens.fy, (float)renderer->lens.cx,
                           (float)renderer->lens.cy};
    float rows[12], corners[8] = {0}, tint[4];
    surround_rows_of(pose_multiply(pose_inverse(box->world_from_box), renderer->world_from_view), rows);
    for (int i = 0; i < 3; i++) {
        corners[i] = (float)box->low[i];
        corners[4 + i] = (float)box->high[i];
        tint[i] = (float)(box->opacity * box->color[i] / 255);
    }
    corners[3] = (float)VIEW_NEAREST_M;
    tint[3] = (float)box->opacity;
    gpu_program_set(renderer->tint_program, TINT_LENS, lens, 1);
    gpu_program_set(renderer->tint_program, BOX_FROM_VIEW, rows, 3);
    gpu_program_set(renderer->tint_program, BOX, corners, 2);
    gpu_program_set(renderer->tint_program, TINT, tint, 1);
    gpu_draw(&(struct gpu_job){.target = renderer->image,
                               .program = renderer->tint_program,
                               .mesh = renderer->fullscreen,
                               .textures = {gpu_target_texture(renderer->surface)},
                               .blend = true,
                               .within = bounds_of(renderer, box)});
}

// ---------------------------------------------------------------- picture store

static void empty_picture(struct stored_picture *picture)
{
    for (int i = 0; i < picture->count; i++)
        gpu_mesh_close(&picture->pieces[i].mesh);
    free(picture->pieces);
    *picture = (struct stored_picture){0};
}

// what was zeroed, too
static void picture_store_close(struct picture_store *store)
{
    for (int i = 0; i < store->layers && store->pictures; i++)
        empty_picture(&store->pictures[i]);
    free(store->pictures);
    gpu_texture_close(&store->colors);
    gpu_texture_close(&store->depths);
    gpu_texture_close(&store->ranges);
    *store = (struct picture_store){.gpu = store->gpu, .now = store->now};
}

static enum status open_arrays(struct picture_store *store, int layers, int width, int height)
{
    picture_store_close(store);
    store->layers = layers;
    store->width = width;
    store->height = height;
    store->pictures = calloc((size_t)layers, sizeof *store->pictures);
    enum status status = store->pictures ? OK : fail(ERR_MEMORY, "no memory for the pictures on the graphics card");
    if (status == OK)
        status = gpu_texture_open_array(&store->colors, store->gpu,
                                        &(struct gpu_array_layout){GPU_ARRAY_RGB8, width, height, layers});
    if (status == OK)
        status = gpu_texture_open_array(&store->depths, store->gpu,
                                        &(struct gpu_array_layout){GPU_ARRAY_R16F, width, height, layers});
    const struct gpu_array_layout half = {GPU_ARRAY_RG16F, (width + 1) / 2, (height + 1) / 2, layers};
    if (status == OK)
        status = gpu_texture_open_array(&store->ranges, store->gpu, &half);
    if (status != OK)
        picture_store_close(store);
    return status;
}

// Makes the arrays fit these pictures, which are of one size, all at a time; what is there is lost if they did not.
// To be called before each image. ERR_DEVICE, ERR_MEMORY.
static enum status picture_store_fit(struct picture_store *store, const struct surround_picture *const *pictures,
                                     int count)
{
    int layers = store->layers ? store->layers : 1;
    store->now++;
    while (layers < count) // doubled, so that growing is rare
        layers *= 2;
    if (!count ||
        (pictures[0]->width == store->width && pictures[0]->height == store->height && layers == store->layers))
        return OK;
    return open_arrays(store, layers, pictures[0]->width, pictures[0]->height);
}

// The layer of a picture for the present image; -1: it is not there.
static int picture_store_find(struct picture_store *store, int64_t depth_number)
{
    assert(depth_number);
    for (int i = 0; i < store->layers; i++)
        if (store->pictures[i].depth_number == depth_number) {
            store->pictures[i].used = store->now;
            return i;
        }
    return -1;
}

// ---------------------------------------------------------------- putting in

// 1/m: has a sign in 16 bits, and counts as infinitely far in surround_surface.vert, whose tolerance is 1e-4.
#define MIN_SIGNED 6.2e-5f

// The pixel's number; negative: it is outside.
static int64_t pixel_at(const struct surround_picture *picture, int x, int y)
{
    x = surround_picture_column(picture, x);
    return x < 0 || x >= picture->width || y < 0 || y >= picture->height ? -1 : (int64_t)y * picture->width + x;
}

// Of each 2 x 2 pixels and those around them, so that it holds the 3 x 3 about each of the four.
static void fill_ranges(const struct surround_picture *picture, float (*out)[2])
{
    for (int y = 0; y < picture->height; y += 2)
        for (int x = 0; x < picture->width; x += 2, out++) {
            float least = 6e4f, most = DEPTH_UNKNOWN; // the largest that 16 bits hold
            bool measured = false;
            for (int j = -1; j <= 2; j++)
                for (int i = -1; i <= 2; i++) {
                    const int64_t at = pixel_at(picture, x + i, y + j);
                    if (at < 0 || picture->inverse[at] < 0)
                        continue;
                    least = fminf(least, picture->inverse[at]);
                    most = fmaxf(most, picture->inverse[at]);
                    measured |= i >= 0 && i < 2 && j >= 0 && j < 2 && !(picture->joined[at] & DEPTH_EXTRAPOLATED);
                }
            (*out)[0] = measured ? least : -fmaxf(least, MIN_SIGNED);
            (*out)[1] = most;
        }
}

static enum status upload_images(struct picture_store *store, const struct surround_picture *picture, int layer)
{
    const int across = (picture->width + 1) / 2, down = (picture->height + 1) / 2;
    float(*ranges)[2] = malloc(sizeof *ranges * (size_t)across * (size_t)down);
    if (!ranges)
        return fail(ERR_MEMORY, "no memory for the pictures on the graphics card");
    fill_ranges(picture, ranges);
    gpu_texture_write_layer(store->colors, layer, picture->width, picture->height, picture->rgb);
    gpu_texture_write_layer(store->depths, layer, picture->width, picture->height, picture->inverse);
    gpu_texture_write_layer(store->ranges, layer, across, down, ranges);
    free(ranges);
    return OK;
}

static enum status upload_mesh(struct picture_store *store, const struct surround_mesh *mesh, struct stored_picture *to)
{
    enum status status = OK;
    if (!(to->pieces = calloc((size_t)mesh->count + 1, sizeof *to->pieces)))
        status = fail(ERR_MEMORY, "no memory for the pictures on the graphics card");
    for (int i = 0; i < mesh->count && status == OK; i++) {
        const struct surround_mesh_piece *from = &mesh->pieces[i];
        struct stored_piece *piece = &to->pieces[to->count];
        const struct gpu_mesh_data data = {from->vertices[0], 4, from->vertex_count, from->indices, from->index_count};
        status = gpu_mesh_open(&piece->mesh, store->gpu, &data);
        memcpy(piece->rays, from->rays, sizeof piece->rays);
        piece->least = from->least;
        piece->most = from->most;
        to->count += status == OK;
    }
    return status;
}

static enum status upload_surface(struct picture_store *store, const struct surround_picture *picture,
                                  struct stored_picture *to)
{
    struct surround_mesh mesh;
    if (picture->mesh)
        return upload_mesh(store, picture->mesh, to);
    enum status status = surround_mesh_make(&mesh, picture, surround_mesh_tolerance(picture));
    if (status == OK)
        status = upload_mesh(store, &mesh, to);
    surround_mesh_free(&mesh);
    return status;
}

// Puts a picture in, in place of one that the present image has not asked for. It has rgb, inverse and joined, and its
// mesh or what one is made of; nothing of it is kept. ERR_DEVICE, ERR_MEMORY.
static enum status picture_store_add(struct picture_store *store, const struct surround_picture *picture, int *layer)
{
    int oldest = 0;
    for (int i = 1; i < store->layers; i++)
        if (store->pictures[i].used < store->pictures[oldest].used)
            oldest = i;
    struct stored_picture *to = &store->pictures[oldest];
    assert(to->used < store->now);
    empty_picture(to);
    enum status status = upload_images(store, picture, oldest);
    if (status == OK)
        status = upload_surface(store, picture, to);
    if (status != OK) {
        empty_picture(to);
        return status;
    }
    to->depth_number = picture->depth_number;
    to->used = store->now;
    *layer = oldest;
    return OK;
}

// ---------------------------------------------------------------- surround renderer

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
static enum status fit_program(struct surround_renderer *renderer, struct gpu_program **program,
                               const struct gpu_program_source *like, int pictures)
{
    char word[32], fragment[40];
    struct gpu_program_source text = *like;
    snprintf(word, sizeof word, "PICTURES %d", pictures);
    snprintf(fragment, sizeof fragment, "%s.frag", like->name);
    text.vertex = shader_find(like == &texture_text ? "fullscreen.vert" : "surround_surface.vert");
    text.fragment = shader_find(fragment);
    text.word = word;
    return *program ? OK : gpu_program_open(program, renderer->gpu, &text);
}

static enum status fit_surface_program(struct surround_renderer *renderer, int pictures)
{
    return fit_program(renderer, &renderer->surface_programs[pictures], &surface_text, pictures);
}

static enum status fit_texture_program(struct surround_renderer *renderer, int pictures)
{
    return fit_program(renderer, &renderer->texture_programs[pictures], &texture_text, pictures);
}

enum status surround_renderer_open(struct surround_renderer **out, struct gpu *gpu)
{
    struct surround_renderer *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory for the surroundings' renderer");
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
    for (int i = 0; i <= SURROUND_RENDERER_MAX; i++) {
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

static enum status fit_targets(struct surround_renderer *renderer, const struct lens *lens)
{
    const bool fits = renderer->image && renderer->lens.width == lens->width && renderer->lens.height == lens->height;
    renderer->lens = *lens;
    if (fits)
        return OK;
    gpu_target_close(&renderer->surface);
    gpu_target_close(&renderer->image);
    enum status status = gpu_target_open(&renderer->surface, renderer->gpu, lens->width, lens->height);
    return status == OK ? gpu_target_open_color(&renderer->image, renderer->gpu, lens->width, lens->height) : status;
}

static bool same_camera(const struct surround_picture *a, const struct surround_picture *b)
{
    return a->panorama == b->panorama && a->width == b->width && a->height == b->height &&
           (a->panorama || lens_equal(&a->lens, &b->lens));
}

// Those of the list that are on the graphics card, and as many of the others as may be uploaded now.
static enum status gather_pictures(struct surround_renderer *renderer, const struct surround_image *image,
                                   const struct surround_picture *const *list, int listed)
{
    const struct surround_picture *pictures[SURROUND_RENDERER_MAX];
    int layers[SURROUND_RENDERER_MAX], uploads = 0, count = 0;
    for (int i = 0; i < listed && count < SURROUND_RENDERER_MAX; i++)
        if (same_camera(list[i], list[0]))
            pictures[count++] = list[i];
    enum status status = picture_store_fit(&renderer->store, pictures, count);
    for (int i = 0; i < count && status == OK; i++)
        layers[i] = picture_store_find(&renderer->store, pictures[i]->depth_number);
    renderer->count = renderer->missing = 0;
    for (int i = 0; i < count && status == OK; i++) {
        if (layers[i] < 0 && (!image->max_uploads || uploads < image->max_uploads)) {
            status = picture_store_add(&renderer->store, pictures[i], &layers[i]);
            uploads++;
        }
        if (layers[i] < 0) {
            renderer->missing++;
            continue;
        }
        renderer->pictures[renderer->count] = pictures[i];
        renderer->layers[renderer->count++] = layers[i];
    }
    return status;
}

static void picture_uniform(const struct surround_renderer *renderer, struct pose world_from_view, float *out)
{
    for (int i = renderer->count; i < SURROUND_RENDERER_MAX; i++)
        out[4 * PARTS * i + 15] = -1; // there is none
    for (int i = 0; i < renderer->count; i++, out += 4 * PARTS) {
        const struct surround_picture *p = renderer->pictures[i];
        surround_rows_of(pose_multiply(pose_inverse(p->world_from_camera), world_from_view), out);
        memcpy(out + 12, p->gain, sizeof p->gain);
        out[15] = (float)renderer->layers[i];
    }
}

static void camera_uniform(const struct surround_picture *picture, float out[8])
{
    const double parts[8] = {picture->panorama, picture->panorama ? 6.283185307 / picture->width : 1 / picture->lens.fx,
                             picture->width,    picture->height,
                             picture->lens.fx,  picture->lens.fy,
                             picture->lens.cx,  picture->lens.cy};
    for (int k = 0; k < 8; k++)
        out[k] = (float)parts[k];
}

// Programs are compiled for some numbers of pictures; what an image lacks of one is marked.
static int program_size(int count)
{
    static const int sizes[] = {1, 2, 3, 4, 6, 8, 12, SURROUND_RENDERER_MAX};
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

static void draw_surface(struct surround_renderer *renderer, const struct surround_image *image,
                         struct gpu_program *program, int number)
{
    const struct stored_picture *stored = &renderer->store.pictures[renderer->layers[number]];
    const float order[4] = {(float)number, image->options.depth_test, (float)image->options.apart,
                            (float)renderer->layers[number]};
    float rows[12];
    surround_rows_of(pose_multiply(pose_inverse(image->world_from_view), renderer->pictures[number]->world_from_camera),
                     rows);
    gpu_program_set(program, VIEW_FROM_PICTURE, rows, 3);
    gpu_program_set(program, ORDER, order, 1);
    for (int i = 0; i < stored->count; i++)
        if (may_be_seen(&stored->pieces[i], &image->lens, rows))
            gpu_draw(&(struct gpu_job){.target = renderer->surface,
                                       .program = program,
                                       .mesh = stored->pieces[i].mesh,
                                       .textures = {renderer->store.ranges, renderer->store.depths},
                                       .closed = true,
                                       .depth_test = true});
}

static enum status draw_surfaces(struct surround_renderer *renderer, const struct surround_image *image,
                                 const float lens[4], const float camera[8], const float *pictures)
{
    const float range[4] = {(float)image->lens.width, (float)image->lens.height, NEAREST_M, 0};
    const int judges = program_size(renderer->count < JUDGES ? renderer->count : JUDGES);
    gpu_target_clear(renderer->surface);
    if (!renderer->count)
        return OK;
    // Those asked, then the others, which have to be supported by these.
    const int drawn =
        renderer->count < image->options.geometry_pictures ? renderer->count : image->options.geometry_pictures;
    const int asked = !image->options.depth_test || drawn < judges ? drawn : judges;
    struct gpu_program **programs[2] = {&renderer->surface_programs[judges], &renderer->unasked_program};
    enum status status = fit_program(renderer, programs[0], &surface_text, judges);
    if (status == OK && asked < drawn)
        status = fit_program(renderer, programs[1], &unasked_text, judges);
    for (int k = 0; k < (asked < drawn ? 2 : 1) && status == OK; k++) {
        struct gpu_program *program = *programs[k];
        gpu_program_set(program, SURFACE_LENS, lens, 1);
        gpu_program_set(program, VIEW_RANGE, range, 1);
        gpu_program_set(program, SURFACE_CAMERA, camera, 2);
        gpu_program_set(program, SURFACE_PICTURES, pictures, PARTS * judges);
        for (int i = k ? asked : 0; i < (k ? drawn : asked); i++)
            draw_surface(renderer, image, program, i);
    }
    return status;
}

static enum status draw_texture(struct surround_renderer *renderer, const struct surround_image *image,
                                const float lens[4], const float camera[8], const float *pictures)
{
    const float look[4] = {(float)image->hatched, (float)(1 / image->lens.fx), (float)VIEW_RESOLUTION_COST, NEAREST_M};
    const int count = program_size(renderer->count);
    const enum status status = fit_texture_program(renderer, count);
    if (status != OK)
        return status;
    struct gpu_program *program = renderer->texture_programs[count];
    gpu_program_set(program, TEXTURE_LENS, lens, 1);
    gpu_program_set(program, LOOK, look, 1);
    gpu_program_set(program, TEXTURE_CAMERA, camera, 2);
    gpu_program_set(program, TEXTURE_PICTURES, pictures, PARTS * count);
    gpu_draw(&(struct gpu_job){.target = renderer->image,
                               .program = program,
                               .mesh = renderer->fullscreen,
                               .textures = {gpu_target_texture(renderer->surface),
                                            renderer->count ? renderer->store.colors : renderer->none,
                                            renderer->count ? renderer->store.depths : renderer->none}});
    return OK;
}

enum status surround_renderer_draw(struct surround_renderer *renderer, const struct surround_image *image,
                                   const struct surround_picture *const *pictures, int count,
                                   const struct gpu_texture **out)
{
    const struct lens *l = &image->lens;
    const float lens[4] = {(float)l->fx, (float)l->fy, (float)l->cx, (float)l->cy};
    float uniform[4 * PARTS * SURROUND_RENDERER_MAX] = {0}, camera[8] = {0};
    enum status status = fit_targets(renderer, l);
    if (status == OK)
        status = gather_pictures(renderer, image, pictures, count);
    if (status != OK)
        return status;
    renderer->world_from_view = image->world_from_view;
    picture_uniform(renderer, image->world_from_view, uniform);
    if (renderer->count)
        camera_uniform(renderer->pictures[0], camera);
    status = draw_surfaces(renderer, image, lens, camera, uniform);
    if (status == OK)
        status = draw_texture(renderer, image, lens, camera, uniform);
    *out = gpu_target_texture(renderer->image);
    return status == OK ? gpu_check(renderer->gpu) : status;
}

int surround_renderer_missing(const struct surround_renderer *renderer) { return renderer->missing; }
