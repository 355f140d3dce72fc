// Draws body cylinders: source frame for each part, meshes by size on screen.
#include "reenact/render/cylinder_renderer.h"

#include "base/threads.h"
#include "platform/screen/gpu.h"
#include "reenact/observation/source_texture.h"
#include "reenact/render/shaders.h"
#include "reenact/skeleton/body_cylinders.h"

#include <stdatomic.h>
#include <stdlib.h>

// ---------------------------------------------------------------- textures of recorded frames

// Recorded frames as textures on the GPU, made when first needed, within a memory bound;
// the least recently used is evicted first. Results do not depend on the cache's state.
// Besides, the last 12 decoded images are kept in memory. One thread: that of the GPU context.

struct source_texture {
    const struct gpu_texture *texture; // borrowed until the next call on the cache
    float window[4];                   // left, top, width, height in the frame's pixels
};

enum { IMAGES = 12, WHOLE = PART_COUNT };

struct cached_texture {
    int64_t frame;
    int part; // or WHOLE
    struct gpu_texture *texture;
    float window[4];
    size_t bytes;
    int64_t used;
};

struct texture_cache {
    struct gpu *gpu;
    struct take *take;
    struct source_rays *rays; // NULL: the take has no depth
    struct cached_texture *entries;
    int count, capacity;
    size_t max_bytes;
    int64_t now;                        // counts uses
    struct source_image images[IMAGES]; // least recently used first out, too
    int64_t image_used[IMAGES];
    size_t bytes; // of the entries
};

static void texture_cache_close(struct texture_cache **cache)
{
    if (!*cache)
        return;
    for (int i = 0; i < (*cache)->count; i++)
        gpu_texture_close(&(*cache)->entries[i].texture);
    for (int i = 0; i < IMAGES; i++)
        source_image_free(&(*cache)->images[i]);
    source_rays_close(&(*cache)->rays);
    free((*cache)->entries);
    free(*cache);
    *cache = NULL;
}

// take and gpu must outlive it. max_bytes: of textures; at least one is always kept. ERR_MEMORY; *out is then NULL.
static enum status texture_cache_open(struct texture_cache **out, struct gpu *gpu, struct take *take, size_t max_bytes)
{
    *out = NULL;
    struct texture_cache *c = calloc(1, sizeof *c);
    if (!c)
        return fail(ERR_MEMORY, "no memory for the cache of textures");
    c->gpu = gpu;
    c->take = take;
    c->max_bytes = max_bytes;
    for (int i = 0; i < IMAGES; i++)
        c->images[i].frame = -1;
    enum status status = OK;
    if (take_calibration(take)->depth.width > 0)
        status = source_rays_open(&c->rays, take_calibration(take));
    if (status != OK) {
        texture_cache_close(&c);
        return status;
    }
    *out = c;
    return OK;
}

static void drop_texture(struct texture_cache *cache, int i)
{
    cache->bytes -= cache->entries[i].bytes;
    gpu_texture_close(&cache->entries[i].texture);
    cache->entries[i] = cache->entries[--cache->count];
}

static enum status evict_until_fits(struct texture_cache *cache, size_t bytes)
{
    while (cache->count && cache->bytes + bytes > cache->max_bytes) {
        int oldest = 0;
        for (int i = 1; i < cache->count; i++)
            if (cache->entries[i].used < cache->entries[oldest].used)
                oldest = i;
        drop_texture(cache, oldest);
    }
    if (cache->count < cache->capacity)
        return OK;
    int capacity = cache->capacity ? cache->capacity * 2 : 64;
    struct cached_texture *entries = realloc(cache->entries, sizeof *entries * (size_t)capacity);
    if (!entries)
        return fail(ERR_MEMORY, "no memory for the cache of textures");
    cache->entries = entries;
    cache->capacity = capacity;
    return OK;
}

static bool find_texture(struct texture_cache *cache, int64_t frame, int part, struct source_texture *out)
{
    for (int i = 0; i < cache->count; i++) {
        struct cached_texture *texture = &cache->entries[i];
        if (texture->frame != frame || texture->part != part)
            continue;
        texture->used = ++cache->now;
        *out = (struct source_texture){
            texture->texture, {texture->window[0], texture->window[1], texture->window[2], texture->window[3]}};
        return true;
    }
    return false;
}

static enum status insert_texture(struct texture_cache *cache, int64_t frame, int part,
                                  const struct source_patch *patch, struct source_texture *out)
{
    size_t bytes = (size_t)patch->width * (size_t)patch->height * 4; // GPUs pad RGB to four bytes
    enum status status = evict_until_fits(cache, bytes);
    if (status != OK)
        return status;
    struct cached_texture e = {
        .frame = frame,
        .part = part,
        .bytes = bytes,
        .used = ++cache->now,
        .window = {(float)patch->left, (float)patch->top, (float)patch->width, (float)patch->height}};
    status =
        gpu_texture_open(&e.texture, cache->gpu,
                         &(struct gpu_texture_layout){GPU_RGB8, patch->width, patch->height, GPU_LINEAR}, patch->rgb);
    if (status != OK)
        return status;
    cache->bytes += bytes;
    cache->entries[cache->count++] = e;
    *out = (struct source_texture){e.texture, {e.window[0], e.window[1], e.window[2], e.window[3]}};
    return OK;
}

static enum status image_of(struct texture_cache *cache, int64_t frame, bool labelled, struct source_image **out)
{
    int oldest = 0;
    for (int i = 0; i < IMAGES; i++) {
        struct source_image *image = &cache->images[i];
        if (image->frame == frame && (!labelled || image->labelled)) {
            cache->image_used[i] = ++cache->now;
            *out = image;
            return OK;
        }
        if (cache->image_used[i] < cache->image_used[oldest])
            oldest = i;
    }
    cache->image_used[oldest] = ++cache->now;
    *out = &cache->images[oldest];
    return source_image_load(*out, cache->take, frame, labelled ? cache->rays : NULL);
}

// The whole colour image as recorded. NOTHING: the frame has none. Errors of take_read; ERR_DEVICE.
static enum status texture_cache_whole(struct texture_cache *cache, int64_t frame, struct source_texture *out)
{
    if (find_texture(cache, frame, WHOLE, out))
        return OK;
    struct source_image *image;
    enum status status = image_of(cache, frame, false, &image);
    if (status != OK)
        return status;
    struct source_patch all = {0, 0, image->width, image->height, image->rgb};
    return insert_texture(cache, frame, WHOLE, &all, out);
}

// The frame's texture of one part (source_patch_make); of a frame without depth, which
// does not distinguish parts, the whole image. NOTHING: it shows too little of the part.
static enum status texture_cache_part(struct texture_cache *cache, int64_t frame, enum part p,
                                      struct source_texture *out)
{
    if (find_texture(cache, frame, p, out))
        return OK;
    if (!cache->rays || !take_entry(cache->take, frame)->has_depth)
        return texture_cache_whole(cache, frame, out);
    struct source_image *image;
    enum status status = image_of(cache, frame, true, &image);
    struct source_patch patch;
    if (status == OK)
        status = source_patch_make(image, cache->take, p, &patch);
    if (status != OK)
        return status;
    status = insert_texture(cache, frame, p, &patch, out);
    free(patch.rgb);
    return status;
}

// ---------------------------------------------------------------- cylinder renderer

// Meshes of 8, 16, 32, 64 sides, with 3, 6, 12, 24 rings along a cylinder: between rings the viewer's lens distortion
// is linear, and what is thin in the image is short there.
enum { SIDES = 4, LEAST_SIDES = 8, LEAST_RINGS = 3 };

static const double SILHOUETTE_ERROR_PX = 0.1; // chosen by hand: below what antialiasing shows

enum uniform { VIEWER_FROM_PART, SOURCE_FROM_PART, VIEW_LENS, VIEW_RANGE, SOURCE_LENS, SOURCE_WINDOW, CODE, UNIFORMS };
static const char *const uniform_names[] = {
    [VIEWER_FROM_PART] = "viewer_from_part",
    [SOURCE_FROM_PART] = "source_from_part",
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [SOURCE_LENS] = "source_lens",
    [SOURCE_WINDOW] = "source_window",
    [CODE] = "code",
};

// The selector of all frames, made on a thread of its own while one of some frames is used.
struct selector_maker {
    struct worker_thread worker;
    atomic_bool ended;
    struct frame_selector *selector; // once it ended; NULL: it could not be made
};

struct cylinder_renderer {
    struct gpu *gpu;
    struct take *take;
    struct frame_selector *selector;
    struct selector_maker maker;
    struct texture_cache *textures;
    struct gpu_program *program;
    struct gpu_mesh *open[SIDES];                // the paper's cylinder
    struct gpu_mesh *rounded[PART_COUNT][SIDES]; // made when first needed
    double view_fx;                              // the viewer's focal length, pixels
};

// ---------------------------------------------------------------- opening

// Of every `step`-th frame. worker: the thread that makes it, at whose end it ends with NOTHING; may be NULL.
static enum status make_selector(struct frame_selector **out, const struct take *take, int64_t step,
                                 struct worker_thread *worker)
{
    const int64_t frames = take_frame_count(take);
    enum status status = frame_selector_open(out, frames / step + 1);
    for (int64_t i = 0; i < frames && status == OK; i += step) {
        const struct take_entry *e = take_entry(take, i);
        if (e->has_color && e->has_skeleton)
            status = frame_selector_add(*out, i, &e->skeleton, take_body(take));
        if (worker && worker_thread_must_end(worker))
            status = NOTHING;
    }
    return status;
}

static void *make_whole_selector(void *self)
{
    struct cylinder_renderer *c = self;
    struct selector_maker *m = &c->maker;
    thread_lower_priority();
    if (make_selector(&m->selector, c->take, 1, &m->worker) != OK)
        frame_selector_close(&m->selector);
    atomic_store(&m->ended, true);
    return NULL;
}

static enum status open_selector(struct cylinder_renderer *renderer, int64_t frames_first)
{
    const int64_t frames = take_frame_count(renderer->take);
    const int64_t step = frames_first > 0 ? (frames + frames_first - 1) / frames_first : 1;
    enum status status = make_selector(&renderer->selector, renderer->take, step > 0 ? step : 1, NULL);
    if (status == OK && step > 1) // without a thread those frames are all that there is
        status_ignore(
            worker_thread_start(&renderer->maker.worker, make_whole_selector, renderer, "to prepare all frames"));
    return status;
}

// Takes over the selector of all frames once it is made.
static void adopt_selector(struct cylinder_renderer *renderer)
{
    if (!renderer->maker.worker.runs || !atomic_load(&renderer->maker.ended))
        return;
    worker_thread_stop(&renderer->maker.worker);
    if (!renderer->maker.selector)
        return;
    frame_selector_close(&renderer->selector);
    renderer->selector = renderer->maker.selector;
    renderer->maker.selector = NULL;
}

static enum status open_program(struct cylinder_renderer *renderer)
{
    static const char *const samplers[] = {"source_image"};
    const struct gpu_program_source text = {.name = "actor",
                                            .vertex = shader_find("actor.vert"),
                                            .fragment = shader_find("actor.frag"),
                                            .uniforms = uniform_names,
                                            .uniform_count = UNIFORMS,
                                            .samplers = samplers,
                                            .sampler_count = 1};
    enum status status = gpu_program_open(&renderer->program, renderer->gpu, &text);
    if (status != OK)
        return status;
    const float range[4] = {(float)VIEW_NEAREST_M, VIEW_FARTHEST_M, 0, 0};
    float lens[12];
    lens_uniform(&take_calibration(renderer->take)->color, lens);
    gpu_program_set(renderer->program, SOURCE_LENS, lens, 3);
    gpu_program_set(renderer->program, VIEW_RANGE, range, 1);
    return OK;
}

enum status cylinder_renderer_open(struct cylinder_renderer **out, struct gpu *gpu, struct take *take, size_t max_bytes,
                                   int64_t frames_first)
{
    struct cylinder_renderer *c = *out = calloc(1, sizeof *c);
    if (!c)
        return fail(ERR_MEMORY, "no memory for the cylinders' renderer");
    c->gpu = gpu;
    c->take = take;
    worker_thread_open(&c->maker.worker);
    enum status status = open_selector(c, frames_first);
    if (status == OK)
        status = texture_cache_open(&c->textures, gpu, take, max_bytes);
    if (status == OK)
        status = open_program(c);
    if (status != OK)
        cylinder_renderer_close(out);
    return status;
}

void cylinder_renderer_close(struct cylinder_renderer **out)
{
    struct cylinder_renderer *c = *out;
    if (!c)
        return;
    for (int i = 0; i < SIDES; i++) {
        gpu_mesh_close(&c->open[i]);
        for (int part = 0; part < PART_COUNT; part++)
            gpu_mesh_close(&c->rounded[part][i]);
    }
    gpu_program_close(&c->program);
    texture_cache_close(&c->textures);
    worker_thread_close(&c->maker.worker);
    frame_selector_close(&c->maker.selector);
    frame_selector_close(&c->selector);
    free(c);
    *out = NULL;
}

void cylinder_renderer_set_lens(struct cylinder_renderer *renderer, const struct lens *view)
{
    float lens[12];
    lens_uniform(view, lens);
    renderer->view_fx = view->fx;
    gpu_program_set(renderer->program, VIEW_LENS, lens, 3);
}

enum status cylinder_renderer_select(struct cylinder_renderer *renderer, const struct skeleton *in_viewer,
                                     struct frame_selection *out)
{
    adopt_selector(renderer);
    return frame_selector_find_body(renderer->selector, in_viewer, out);
}

// ---------------------------------------------------------------- drawing

static enum status mesh_for(struct cylinder_renderer *renderer, bool plain, enum part part, double radius_px,
                            struct gpu_mesh **out)
{
    int sides = cylinder_sides(radius_px, SILHOUETTE_ERROR_PX), which = 0;
    while (LEAST_SIDES << which < sides)
        which++;
    struct gpu_mesh **kept = plain ? &renderer->open[which] : &renderer->rounded[part][which];
    *out = *kept;
    if (*out)
        return OK;
    struct cylinder_mesh mesh;
    enum cylinder_shape shape = plain ? CYLINDER_OPEN : CYLINDER_ROUNDED;
    enum status status =
        cylinder_mesh_make(shape, take_body(renderer->take)->radius_rate[part], sides, LEAST_RINGS << which, &mesh);
    if (status != OK)
        return status;
    status =
        gpu_mesh_open(kept, renderer->gpu,
                      &(struct gpu_mesh_data){mesh.vertices, 3, mesh.vertex_count, mesh.indices, mesh.index_count});
    cylinder_mesh_free(&mesh);
    *out = *kept;
    return status;
}

// A part's source frame and its texture. NOTHING: there is none.
static enum status texture_for(struct cylinder_renderer *renderer, const struct cylinder_view *view,
                               struct frame_selection chosen, enum part part, int64_t *frame,
                               struct source_texture *texture)
{
    if (view->whole) {
        *frame = view->whole->frame;
        return texture_cache_whole(renderer->textures, *frame, texture);
    }
    enum status status = chosen.frame < 0 ? NOTHING : OK;
    while (status == OK) {
        *frame = chosen.frame;
        status = texture_cache_part(renderer->textures, chosen.frame, part, texture);
        if (status != NOTHING)
            return status;
        frame_selector_exclude(renderer->selector, chosen.frame,
                               part); // its image does not show the part, though its joints do
        status = frame_selector_find_part(renderer->selector, view->in_viewer, part, &chosen);
    }
    return status;
}

// Draws one part, textured from its source frame. NOTHING: not drawn.
static enum status draw_part(struct cylinder_renderer *renderer, const struct cylinder_view *view,
                             struct frame_selection chosen, enum part part)
{
    const struct body *body = take_body(renderer->take);
    const struct vec3 eye = v3(0, 0, 0);
    struct bone_frame here, there;
    struct gpu_mesh *mesh;
    struct source_texture texture;
    int64_t frame = 0;
    if (!part_is_known(body, view->in_viewer, part) || !bone_frame_viewer_aligned(view->in_viewer, part, eye, &here))
        return NOTHING;
    double radius = body->radius_rate[part] * here.length;
    double nearest_z = fmin(here.origin.z, here.origin.z + here.z.z * here.length) - radius;
    if (fmax(here.origin.z, here.origin.z + here.z.z * here.length) + radius < VIEW_NEAREST_M)
        return NOTHING; // behind the camera
    enum status status = texture_for(renderer, view, chosen, part, &frame, &texture);
    if (status != OK)
        return status;
    if (!bone_frame_viewer_aligned(&take_entry(renderer->take, frame)->skeleton, part, eye, &there))
        return NOTHING;
    status = mesh_for(renderer, view->whole, part, renderer->view_fx * radius / fmax(nearest_z, VIEW_NEAREST_M), &mesh);
    if (status != OK)
        return status;
    struct affine_map viewer_from_part = cylinder_affine(&here, radius);
    struct affine_map source_from_part = cylinder_affine(&there, body->radius_rate[part] * there.length);
    gpu_program_set(renderer->program, VIEWER_FROM_PART, viewer_from_part.row[0], 3);
    gpu_program_set(renderer->program, SOURCE_FROM_PART, source_from_part.row[0], 3);
    gpu_program_set(renderer->program, SOURCE_WINDOW, texture.window, 1);
    int64_t age =
        llabs(take_entry(renderer->take, frame)->time_ns - take_entry(renderer->take, view->shown)->time_ns) / 10000000;
    age = age < 65535 ? age : 65535;
    for (int coded = 0; coded < (view->source ? 2 : 1); coded++) {
        const float code[4] = {170.0F / 255, (float)(age / 256) / 255, (float)(age % 256) / 255, (float)coded};
        gpu_program_set(renderer->program, CODE, code, 1);
        gpu_draw(&(struct gpu_job){.target = coded ? view->source : view->actor,
                                   .program = renderer->program,
                                   .mesh = mesh,
                                   .textures = {texture.texture},
                                   .closed = !view->whole, // an open tube shows its inside
                                   .depth_test = true});
    }
    return OK;
}

enum status cylinder_renderer_draw(struct cylinder_renderer *renderer, const struct cylinder_view *view, int *parts)
{
    struct frame_selection chosen[PART_COUNT] = {{0}};
    enum status status = view->whole ? OK : frame_selector_find_parts(renderer->selector, view->in_viewer, chosen);
    *parts = 0;
    for (int p = 0; p < PART_COUNT && status == OK; p++) {
        enum status drawn = draw_part(renderer, view, chosen[p], (enum part)p);
        if (drawn < 0)
            return drawn;
        *parts += drawn == OK;
    }
    return status < 0 ? status : OK;
}
