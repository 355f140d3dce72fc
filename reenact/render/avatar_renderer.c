// Draws the avatar: atlas upload, mesh of the visible vertices, draw calls per layer.
#include "reenact/render/avatar_renderer.h"

#include "platform/screen/gpu.h"
#include "reenact/avatar/avatar.h"
#include "reenact/frame/frame_layer.h"
#include "reenact/render/occlusion_shadow.h"
#include "reenact/render/shaders.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- frame layers on the GPU

// Frame layers (frame_layer.h) on the GPU, within a memory bound. The frames shown last
// are kept; of the others, the one with the nearest resident neighbours is evicted first, so
// that residents spread over the take. One thread: that of the GPU context.

// A struct frame_layer with its images as textures.
struct gpu_frame_layer {
    struct gpu_texture *color, *depth; // color NULL: none of the triangles is visible
    struct bone_corrections corrections;
    float (*shift)[3];
    struct frame_layer_point *points;
    bool *triangle_visible;
};

// The frames used last are not evicted: stepping back shows them again. Chosen by hand.
enum { PROTECTED_FRAMES = 16 };

struct cached_layer {
    struct gpu_frame_layer shown;
    int64_t frame, used;
    size_t bytes;
};

struct frame_layer_cache {
    struct gpu *gpu;
    struct frame_source source;
    struct frame_layer_loader *loader; // for the avatar; NULL before the first frame
    struct cached_layer *layers;
    int count, capacity;
    size_t bytes, max_bytes;
    int64_t now; // counts uses
};

// gpu and what source points to must outlive it. max_bytes: of frame layers; one is always kept. ERR_MEMORY.
static enum status frame_layer_cache_open(struct frame_layer_cache **out, struct gpu *gpu,
                                          const struct frame_source *source, size_t max_bytes)
{
    struct frame_layer_cache *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for the cache of frame layers");
    f->gpu = gpu;
    f->source = *source;
    f->max_bytes = max_bytes;
    return OK;
}

static void drop_layer(struct frame_layer_cache *cache, int i)
{
    cache->bytes -= cache->layers[i].bytes;
    gpu_texture_close(&cache->layers[i].shown.color);
    gpu_texture_close(&cache->layers[i].shown.depth);
    free(cache->layers[i].shown.shift);
    free(cache->layers[i].shown.points);
    free(cache->layers[i].shown.triangle_visible);
    cache->layers[i] = cache->layers[--cache->count];
}

// Drops all layers, as another avatar needs.
static void frame_layer_cache_clear(struct frame_layer_cache *cache)
{
    while (cache->count)
        drop_layer(cache, cache->count - 1);
    frame_layer_loader_close(&cache->loader);
}

static void frame_layer_cache_close(struct frame_layer_cache **out)
{
    struct frame_layer_cache *f = *out;
    if (!f)
        return;
    frame_layer_cache_clear(f);
    free(f->layers);
    free(f);
    *out = NULL;
}

// Frames from the resident frame before layer i to the one after it, cyclically over the take.
static int64_t neighbor_gap(const struct frame_layer_cache *cache, int i)
{
    const int64_t frames = take_frame_count(cache->source.take);
    int64_t before = frames, after = frames;
    for (int k = 0; k < cache->count; k++) {
        const int64_t on = (cache->layers[k].frame - cache->layers[i].frame + frames) % frames;
        if (k == i)
            continue;
        after = on < after ? on : after;
        before = frames - on < before ? frames - on : before;
    }
    return before + after;
}

// The layer to evict: among those not used recently, the one with the smallest neighbour gap, so that residents spread
// over the take; if all were used recently, the least recently used.
static int eviction_candidate(const struct frame_layer_cache *cache)
{
    const int64_t longest = 2 * take_frame_count(cache->source.take);
    int min = 0;
    int64_t least_worth = INT64_MAX;
    for (int i = 0; i < cache->count; i++) {
        const bool recent = cache->layers[i].used > cache->now - PROTECTED_FRAMES;
        const int64_t worth = recent ? longest + cache->layers[i].used : neighbor_gap(cache, i);
        if (worth < least_worth)
            least_worth = worth, min = i;
    }
    return min;
}

static enum status evict_until_fits(struct frame_layer_cache *cache, size_t bytes)
{
    while (cache->count && cache->bytes + bytes > cache->max_bytes)
        drop_layer(cache, eviction_candidate(cache));
    if (cache->count < cache->capacity)
        return OK;
    int capacity = cache->capacity ? 2 * cache->capacity : 16;
    struct cached_layer *layers = realloc(cache->layers, sizeof *layers * (size_t)capacity);
    if (!layers)
        return fail(ERR_MEMORY, "no memory for the cache of frame layers");
    cache->layers = layers;
    cache->capacity = capacity;
    return OK;
}

static enum status upload_image(struct gpu_texture **out, struct gpu *gpu, enum gpu_format format,
                                enum gpu_filter filter, const struct frame_layer_image *image)
{
    return gpu_texture_open(out, gpu, &(struct gpu_texture_layout){format, image->width, image->height, filter},
                            image->pixels);
}

static enum status insert_layer(struct frame_layer_cache *cache, struct frame_layer *loaded)
{
    const size_t bytes = frame_layer_bytes(loaded);
    enum status status = evict_until_fits(cache, bytes);
    if (status != OK)
        return status;
    struct cached_layer *layer = &cache->layers[cache->count++];
    *layer = (struct cached_layer){.frame = loaded->frame, .used = ++cache->now, .bytes = bytes};
    cache->bytes += bytes;
    struct gpu_frame_layer *gpu_frame_layer = &layer->shown;
    gpu_frame_layer->corrections = loaded->corrections;
    gpu_frame_layer->shift = loaded->shift;
    gpu_frame_layer->points = loaded->points;
    gpu_frame_layer->triangle_visible = loaded->triangle_visible;
    loaded->shift = NULL;
    loaded->points = NULL;
    loaded->triangle_visible = NULL;
    status = upload_image(&gpu_frame_layer->depth, cache->gpu, GPU_RGBA8, GPU_NEAREST, &loaded->depth);
    if (status == OK)
        status = upload_image(&gpu_frame_layer->color, cache->gpu, GPU_RGB8, GPU_LINEAR, &loaded->color);
    if (status != OK)
        drop_layer(cache, cache->count - 1);
    return status;
}

static int find_layer(const struct frame_layer_cache *cache, int64_t frame)
{
    int i = 0;
    while (i < cache->count && cache->layers[i].frame != frame)
        i++;
    return i;
}

static bool frame_layer_cache_has(const struct frame_layer_cache *cache, int64_t frame)
{
    return find_layer(cache, frame) < cache->count;
}

// The resident frame nearest in time to `frame`, at most within_ns away; ties: the lowest; -1: none.
static int64_t frame_layer_cache_nearest(const struct frame_layer_cache *cache, int64_t frame, int64_t within_ns)
{
    const int64_t at_ns = take_entry(cache->source.take, frame)->time_ns;
    int64_t best = -1, best_ns = within_ns;
    for (int i = 0; i < cache->count; i++) {
        const int64_t away_ns = llabs(take_entry(cache->source.take, cache->layers[i].frame)->time_ns - at_ns);
        const bool nearer = best < 0 || away_ns < best_ns || (away_ns == best_ns && cache->layers[i].frame < best);
        if (away_ns <= within_ns && nearer)
            best = cache->layers[i].frame, best_ns = away_ns;
    }
    return best;
}

// Adds a layer that was loaded elsewhere. Takes over its contents and zeroes *loaded, also on failure. ERR_DEVICE,
// ERR_MEMORY.
static enum status frame_layer_cache_add(struct frame_layer_cache *cache, struct frame_layer *loaded)
{
    enum status status = frame_layer_cache_has(cache, loaded->frame) ? OK : insert_layer(cache, loaded);
    frame_layer_free(loaded);
    return status;
}

static enum status load_layer(struct frame_layer_cache *cache, const struct avatar *avatar, int64_t frame)
{
    struct frame_layer loaded;
    enum status status = cache->loader ? OK : frame_layer_loader_open(&cache->loader, &cache->source, avatar);
    if (status == OK)
        status = frame_layer_loader_load(cache->loader, frame, &loaded);
    return status == OK ? frame_layer_cache_add(cache, &loaded) : status;
}

// Loads the frame unless it is resident. *out: borrowed until the next call. Errors of take_read; ERR_DEVICE.
static enum status frame_layer_cache_get(struct frame_layer_cache *cache, const struct avatar *avatar, int64_t frame,
                                         const struct gpu_frame_layer **out)
{
    if (!frame_layer_cache_has(cache, frame)) {
        enum status status = load_layer(cache, avatar, frame);
        if (status != OK)
            return status;
    }
    struct cached_layer *k = &cache->layers[find_layer(cache, frame)];
    if (k->used != cache->now)
        k->used = ++cache->now;
    *out = &k->shown;
    return OK;
}

// ---------------------------------------------------------------- silhouette edges, types

// Skins the avatar's mesh for one image (linear blend skinning, LBS), selects the
// triangles that face the viewer, and builds a thin ribbon along the silhouette edges
// (between a front-facing triangle and a back-facing or missing neighbour). The ribbon,
// faded outwards by the shader, antialiases the silhouette. Pure; one thread.

struct silhouette_edges;

// Corners of triangles: point i of the atlas's mesh is i, its double at the ribbon's outer rim is point_count + i.
// First the front-facing triangles, of these first those that are `own`; then the ribbon's. Triangles with more than
// half of their skin weight on absent parts are omitted. viewer_from_bone[BONE_COUNT]: from the bind pose to the
// viewer camera; absent[PART_COUNT]. shift: deformation of each of the mesh's points in the bind pose, metres. own: of
// each triangle: seen by the shown frame (frame_layer.triangle_visible).
struct point3f {
    float x, y, z;
};
struct silhouette_corners {
    const uint16_t *corners;      // valid until the next call, as placed
    const struct point3f *placed; // each point of the mesh, viewer camera's axes, metres
    int own, front, ribbon;       // numbers of corners; own: those of `front` that are own
    float low[2], high[2];        // bounds of x / z and y / z; infinite: some points are beside the camera
};

static void silhouette_edges_close(struct silhouette_edges **edges);
static int silhouette_edges_max(const struct silhouette_edges *edges);

// ---------------------------------------------------------------- silhouette edges

// Skinning, front faces and silhouette ribbon of the avatar's mesh.

typedef float float4 __attribute__((vector_size(16))); // x, y, z in one SIMD register

enum { RIBBON_CORNERS = 6 }; // corners for each edge

static const float NEAR_PLANE_M = 0.05F; // with points nearer than this the bounds are infinite

struct silhouette_edges {
    const struct avatar *avatar;
    struct point3f *bind_points, *placed; // [point]: bind pose axes, camera axes
    uint8_t *front;                       // [triangle]: drawn and facing the viewer
    uint16_t *corners;
};

// avatar: with its atlas; must outlive it. Allocates 7 indices for each of the mesh's corners. ERR_MEMORY; *out is
// then NULL.
static enum status silhouette_edges_open(struct silhouette_edges **out, const struct avatar *avatar)
{
    const struct uv_mesh *m = &avatar->atlas.mesh;
    struct silhouette_edges *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the silhouette");
    s->avatar = avatar;
    s->bind_points = malloc(sizeof *s->bind_points * (size_t)m->point_count);
    s->placed = malloc(sizeof *s->placed * (size_t)m->point_count);
    s->front = malloc((size_t)m->corner_count / 3);
    s->corners = malloc(sizeof *s->corners * (size_t)silhouette_edges_max(s));
    if (!s->bind_points || !s->placed || !s->front || !s->corners) {
        silhouette_edges_close(out);
        return fail(ERR_MEMORY, "no memory for the silhouette");
    }
    for (int i = 0; i < m->point_count; i++) {
        const struct vec3 *p = &avatar->atlas.points[i];
        s->bind_points[i] = (struct point3f){(float)p->x, (float)p->y, (float)p->z};
    }
    return OK;
}

static void silhouette_edges_close(struct silhouette_edges **edges)
{
    if (!*edges)
        return;
    free((*edges)->bind_points);
    free((*edges)->placed);
    free((*edges)->front);
    free((*edges)->corners);
    free(*edges);
    *edges = NULL;
}

// corners, at most: triangles and ribbon
static int silhouette_edges_max(const struct silhouette_edges *edges)
{
    return (1 + RIBBON_CORNERS) * edges->avatar->atlas.mesh.corner_count;
}

static struct point3f shift_point(struct point3f point3f, const float shift[3])
{
    return (struct point3f){point3f.x + shift[0], point3f.y + shift[1], point3f.z + shift[2]};
}

static struct point3f vector_between(struct point3f a, struct point3f b)
{
    return (struct point3f){b.x - a.x, b.y - a.y, b.z - a.z};
}

// A bone's affine map by columns: what x, y, z and 1 of the bind pose add to x, y and z in camera axes.
struct map_columns {
    float4 column[4];
};

static struct map_columns columns_of(const struct affine_map *map)
{
    struct map_columns columns;
    for (int c = 0; c < 4; c++)
        columns.column[c] = (float4){map->row[0][c], map->row[1][c], map->row[2][c], 0};
    return columns;
}

static struct point3f skin_point(const struct skin_weights *skin, const struct map_columns *maps,
                                 struct point3f point3f)
{
    float4 at = {0};
    for (int k = 0; k < SKIN_BONES; k++) {
        if (!(skin->weight[k] > 0))
            continue;
        const float4 *column = maps[skin->bone[k]].column;
        at += skin->weight[k] * (column[0] * point3f.x + column[1] * point3f.y + column[2] * point3f.z + column[3]);
    }
    return (struct point3f){at[0], at[1], at[2]};
}

// Front-facing triangles that are own (wanted), or those that are not.
static int put_front(const struct silhouette_edges *edges, const bool *own, bool wanted, uint16_t *out)
{
    const struct uv_mesh *m = &edges->avatar->atlas.mesh;
    int count = 0;
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        for (int k = 0; k < 3 && edges->front[t] && own[t] == wanted; k++)
            out[count++] = (uint16_t)c[k];
    }
    return count;
}

// Whether the back-facing triangle `away` lies behind the plane of its front-facing neighbour. If it lies before it,
// the edge between them is in a fold that the surface itself hides.
static bool bends_back(const struct silhouette_edges *edges, int front, int away)
{
    const int32_t *c = edges->avatar->atlas.mesh.corners + 3 * (size_t)front,
                  *o = edges->avatar->atlas.mesh.corners + 3 * (size_t)away;
    const struct point3f a = edges->placed[c[0]], u = vector_between(a, edges->placed[c[1]]),
                         v = vector_between(a, edges->placed[c[2]]);
    const struct point3f n = {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
    float out = 0; // the two corners on the edge add 0
    for (int k = 0; k < 3; k++) {
        const struct point3f to = vector_between(a, edges->placed[o[k]]);
        out += n.x * to.x + n.y * to.y + n.z * to.z;
    }
    return out < 0;
}

static int put_ribbon(const struct silhouette_edges *edges, uint16_t *out)
{
    const struct uv_mesh *m = &edges->avatar->atlas.mesh;
    int count = 0;
    for (int i = 0; i < m->corner_count; i++) {
        int32_t other = m->neighbor[i / 3][i % 3];
        if (!edges->front[i / 3] || (other >= 0 && (edges->front[other] || !bends_back(edges, i / 3, other))))
            continue;
        const int a = m->corners[i], b = m->corners[i % 3 == 2 ? i - 2 : i + 1];
        const int ribbon[RIBBON_CORNERS] = {a, b, m->point_count + b, a, m->point_count + b, m->point_count + a};
        for (int k = 0; k < RIBBON_CORNERS; k++)
            out[count++] = (uint16_t)ribbon[k];
    }
    return count;
}

// Drops triangles with more than half of their skin weight on absent parts.
static void cull_absent(struct silhouette_edges *edges, const bool *absent)
{
    const struct uv_mesh *m = &edges->avatar->atlas.mesh;
    for (int t = 0; t < m->corner_count / 3; t++) {
        float sum = 0; // over three corners
        for (int i = 0; i < 3 * SKIN_BONES; i++) {
            const struct skin_weights *skin = &edges->avatar->skins[m->points[m->corners[3 * t + i / SKIN_BONES]]];
            sum += absent[bone_part(skin->bone[i % SKIN_BONES])] ? skin->weight[i % SKIN_BONES] : 0;
        }
        edges->front[t] = edges->front[t] && sum <= 1.5F;
    }
}

static void find_bounds(const struct silhouette_edges *edges, struct silhouette_corners *out)
{
    out->low[0] = out->low[1] = INFINITY;
    out->high[0] = out->high[1] = -INFINITY;
    float nearest = INFINITY;
    for (int i = 0; i < edges->avatar->atlas.mesh.point_count; i++) {
        const struct point3f p = edges->placed[i];
        const float at[2] = {p.x / p.z, p.y / p.z};
        nearest = fminf(nearest, p.z);
        for (int a = 0; a < 2; a++) {
            out->low[a] = fminf(out->low[a], at[a]);
            out->high[a] = fmaxf(out->high[a], at[a]);
        }
    }
    if (nearest < NEAR_PLANE_M)
        out->low[0] = -INFINITY;
}

static struct silhouette_corners silhouette_edges_find(struct silhouette_edges *edges,
                                                       const struct affine_map *viewer_from_bone, float (*shift)[3],
                                                       const bool *own, const bool *absent)
{
    const struct uv_mesh *m = &edges->avatar->atlas.mesh;
    struct map_columns maps[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        maps[b] = columns_of(&viewer_from_bone[b]);
    for (int i = 0; i < m->point_count; i++)
        edges->placed[i] =
            skin_point(&edges->avatar->skins[m->points[i]], maps, shift_point(edges->bind_points[i], shift[i]));
    for (int t = 0; t < m->corner_count / 3; t++) {
        const int32_t *c = m->corners + 3 * (size_t)t;
        const struct point3f a = edges->placed[c[0]], b = edges->placed[c[1]], d = edges->placed[c[2]];
        edges->front[t] =
            a.x * (b.y * d.z - b.z * d.y) + a.y * (b.z * d.x - b.x * d.z) + a.z * (b.x * d.y - b.y * d.x) < 0;
    }
    bool all = true;
    for (int p = 0; p < PART_COUNT; p++)
        all = all && !absent[p];
    if (!all)
        cull_absent(edges, absent);
    struct silhouette_corners out = {.corners = edges->corners, .placed = edges->placed};
    find_bounds(edges, &out);
    out.own = put_front(edges, own, true, edges->corners);
    out.front = out.own + put_front(edges, own, false, edges->corners + out.own);
    out.ribbon = put_ribbon(edges, edges->corners + out.front);
    return out;
}

// ---------------------------------------------------------------- avatar renderer

enum { VERTEX = 16 }; // floats of a vertex, as avatar.vert takes them

static const float NEAREST_M = (float)VIEW_NEAREST_M, HALF_SILHOUETTE_PX = 0.5F;

enum uniform { VIEW_LENS, VIEW_RANGE, FRAME_PARAMS, VIEWER_FROM_FRAME, UNIFORMS };

// All draw the same mesh.
enum program { AVATAR, FUSED, SOURCE, AVATAR_OCCLUDED, FUSED_OCCLUDED, PROGRAMS };
struct program_plan {
    const char *fragment;
    const char *samplers[4];
    int sampler_count;
    const char *define;
};
static const struct program_plan plans[PROGRAMS] = {
    [AVATAR] = {"avatar.frag", {"atlas", "frame_color", "frame_depth"}, 3, NULL},
    [FUSED] = {"avatar_fused.frag", {"atlas"}, 1, NULL},
    [SOURCE] = {"avatar_source.frag", {"atlas_when", "frame_depth"}, 2, NULL},
    [AVATAR_OCCLUDED] = {"avatar.frag", {"atlas", "frame_color", "frame_depth", "room"}, 4, "ROOM_OCCLUSION"},
    [FUSED_OCCLUDED] = {"avatar_fused.frag", {"atlas", "room"}, 2, "ROOM_OCCLUSION"},
};
static const char *const uniform_names[UNIFORMS] = {
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [FRAME_PARAMS] = "frame_params",
    [VIEWER_FROM_FRAME] = "viewer_from_frame",
};

// Uploaded in steps.
struct atlas_textures {
    struct gpu_texture *color, *seen_time;
    int color_rows, seen_time_rows; // uploaded so far
};

// Uploaded for each image: its visible points.
struct shown_mesh {
    struct gpu_mesh *mesh; // NULL: no avatar was set
    float (*vertices)[VERTEX];
    uint16_t *corners;
    int32_t *number; // [2 * points]: vertex of a point, then of its double; -1: none yet
    int vertex_count;
};

// What stands for a frame layer where none is drawn: no deformation, nothing seen by the frame. Its points are filled
// for each image.
struct fused_layer {
    struct gpu_frame_layer layer;
    struct gpu_texture *no_depth; // agrees with nothing
};

struct avatar_renderer {
    struct gpu *gpu;
    struct take *take;
    struct lens view; // viewer camera's
    struct avatar avatar;
    struct gpu_program *programs[PROGRAMS];
    struct atlas_textures atlas_textures;
    struct shown_mesh shown;
    struct silhouette_edges *silhouette;
    struct frame_layer_cache *frames;
    struct fused_layer fused;
    int warmed_up; // combinations of program and state drawn so far
};

// ---------------------------------------------------------------- opening

static void set_uniform(struct avatar_renderer *renderer, enum uniform uniform, const float *vec4s, int count)
{
    for (int i = 0; i < PROGRAMS; i++)
        gpu_program_set(renderer->programs[i], (int)uniform, vec4s, count);
}

static void close_fused(struct fused_layer *fused)
{
    gpu_texture_close(&fused->no_depth);
    free(fused->layer.shift);
    free(fused->layer.points);
    free(fused->layer.triangle_visible);
    *fused = (struct fused_layer){0};
}

static enum status open_fused(struct avatar_renderer *renderer)
{
    enum { SIDE = 3 }; // no power of two (frame_layer.c)
    static const uint8_t nothing[4 * SIDE * SIDE];
    const struct uv_mesh *m = &renderer->avatar.atlas.mesh;
    struct gpu_frame_layer *layer = &renderer->fused.layer;
    layer->shift = calloc((size_t)m->point_count, sizeof *layer->shift);
    layer->points = calloc((size_t)m->point_count, sizeof *layer->points);
    layer->triangle_visible = calloc((size_t)m->corner_count / 3, sizeof *layer->triangle_visible);
    if (!layer->shift || !layer->points || !layer->triangle_visible)
        return fail(ERR_MEMORY, "no memory for the avatar's renderer");
    const struct gpu_texture_layout layout = {GPU_RGBA8, SIDE, SIDE, GPU_NEAREST};
    const enum status status = gpu_texture_open(&renderer->fused.no_depth, renderer->gpu, &layout, nothing);
    layer->depth = renderer->fused.no_depth;
    return status;
}

static void drop_avatar(struct avatar_renderer *renderer)
{
    gpu_texture_close(&renderer->atlas_textures.color);
    gpu_texture_close(&renderer->atlas_textures.seen_time);
    renderer->atlas_textures = (struct atlas_textures){0};
    renderer->warmed_up = 0;
    gpu_mesh_close(&renderer->shown.mesh);
    free(renderer->shown.vertices);
    free(renderer->shown.corners);
    free(renderer->shown.number);
    renderer->shown = (struct shown_mesh){0};
    silhouette_edges_close(&renderer->silhouette);
    close_fused(&renderer->fused);
    avatar_free(&renderer->avatar);
    if (renderer->frames)
        frame_layer_cache_clear(renderer->frames);
}

static enum status open_shown_mesh(struct avatar_renderer *renderer)
{
    struct shown_mesh *m = &renderer->shown;
    const int points = renderer->avatar.atlas.mesh.point_count, max = silhouette_edges_max(renderer->silhouette);
    if (2 * points > UINT16_MAX)
        return fail(ERR_INPUT, "the person is too large to be drawn as one mesh");
    m->vertices = malloc(sizeof *m->vertices * 2 * (size_t)points);
    m->number = malloc(sizeof *m->number * 2 * (size_t)points);
    m->corners = malloc(sizeof *m->corners * (size_t)max);
    if (!m->vertices || !m->number || !m->corners)
        return fail(ERR_MEMORY, "no memory for the avatar's renderer");
    return gpu_mesh_open(&m->mesh, renderer->gpu, &(struct gpu_mesh_data){NULL, VERTEX, 2 * points, NULL, max});
}

static enum status open_atlas_textures(struct avatar_renderer *renderer)
{
    const struct uv_mesh *m = &renderer->avatar.atlas.mesh;
    struct atlas_textures *textures = &renderer->atlas_textures;
    enum status status = gpu_texture_open(
        &textures->color, renderer->gpu, &(struct gpu_texture_layout){GPU_RGB8, m->width, m->height, GPU_LINEAR}, NULL);
    if (status == OK)
        status = gpu_texture_open(&textures->seen_time, renderer->gpu,
                                  &(struct gpu_texture_layout){GPU_RGBA8, m->width, m->height, GPU_NEAREST}, NULL);
    if (status == OK)
        status = silhouette_edges_open(&renderer->silhouette, &renderer->avatar);
    return status == OK ? open_shown_mesh(renderer) : status;
}

enum status avatar_renderer_set_avatar(struct avatar_renderer *renderer, struct avatar *avatar)
{
    drop_avatar(renderer);
    renderer->avatar = *avatar;
    *avatar = (struct avatar){0};
    enum status status = open_atlas_textures(renderer);
    if (status == OK)
        status = open_fused(renderer);
    if (status != OK)
        drop_avatar(renderer);
    return status;
}

bool avatar_renderer_has_avatar(const struct avatar_renderer *renderer) { return renderer->shown.mesh; }

const struct avatar *avatar_renderer_avatar(const struct avatar_renderer *renderer)
{
    return avatar_renderer_has_avatar(renderer) ? &renderer->avatar : NULL;
}

enum status avatar_renderer_add_frame(struct avatar_renderer *renderer, struct frame_layer *loaded)
{
    return frame_layer_cache_add(renderer->frames, loaded);
}

int64_t avatar_renderer_nearest_resident(const struct avatar_renderer *renderer, int64_t frame, int64_t within_ns)
{
    return frame_layer_cache_nearest(renderer->frames, frame, within_ns);
}

// How many of `wanted` pieces, `piece` bytes each, fit into *bytes; subtracts them.
static int take_from_budget(size_t *bytes, int wanted, size_t piece)
{
    size_t max = *bytes / piece;
    int count = (size_t)wanted < max ? wanted : (int)max;
    *bytes -= piece * (size_t)count;
    return count;
}

static void upload_rows(struct gpu_texture *texture, const uint8_t *pixels, const struct uv_mesh *mesh, int each,
                        int *rows, size_t *bytes)
{
    size_t row = (size_t)each * (size_t)mesh->width;
    int count = take_from_budget(bytes, mesh->height - *rows, row);
    if (count)
        gpu_texture_write_rows(texture, *rows, count, pixels + row * (size_t)*rows);
    *rows += count;
}

bool avatar_renderer_upload_step(struct avatar_renderer *renderer, size_t bytes)
{
    struct atlas_textures *textures = &renderer->atlas_textures;
    struct texture_atlas *a = &renderer->avatar.atlas;
    if (!avatar_renderer_has_avatar(renderer))
        return false;
    upload_rows(textures->color, a->color, &a->mesh, 3, &textures->color_rows, &bytes);
    upload_rows(textures->seen_time, a->seen_time, &a->mesh, 4, &textures->seen_time_rows, &bytes);
    return textures->seen_time_rows == a->mesh.height;
}

void avatar_renderer_set_lens(struct avatar_renderer *renderer, const struct lens *view)
{
    float lens[12];
    lens_uniform(view, lens);
    renderer->view = *view;
    set_uniform(renderer, VIEW_LENS, lens, 3);
}

static enum status open_programs(struct avatar_renderer *renderer, const struct lens *view)
{
    for (int i = 0; i < PROGRAMS; i++) {
        const struct gpu_program_source text = {.name = plans[i].fragment,
                                                .vertex = shader_find("avatar.vert"),
                                                .fragment = shader_find(plans[i].fragment),
                                                .uniforms = uniform_names,
                                                .uniform_count = UNIFORMS,
                                                .samplers = plans[i].samplers,
                                                .sampler_count = plans[i].sampler_count,
                                                .word = plans[i].define};
        enum status status = gpu_program_open(&renderer->programs[i], renderer->gpu, &text);
        if (status != OK)
            return status;
    }
    const float range[4] = {NEAREST_M, VIEW_FARTHEST_M, 0, 0};
    avatar_renderer_set_lens(renderer, view);
    set_uniform(renderer, VIEW_RANGE, range, 1);
    return OK;
}

enum status avatar_renderer_open(struct avatar_renderer **out, struct gpu *gpu, const struct frame_source *source,
                                 const struct lens *view, size_t max_bytes)
{
    struct avatar_renderer *p = *out = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for the avatar's renderer");
    p->gpu = gpu;
    p->take = source->take;
    enum status status = frame_layer_cache_open(&p->frames, gpu, source, max_bytes);
    if (status == OK)
        status = open_programs(p, view);
    if (status != OK)
        avatar_renderer_close(out);
    return status;
}

void avatar_renderer_close(struct avatar_renderer **out)
{
    struct avatar_renderer *renderer = *out;
    if (!renderer)
        return;
    drop_avatar(renderer);
    frame_layer_cache_close(&renderer->frames);
    for (int i = 0; i < PROGRAMS; i++)
        gpu_program_close(&renderer->programs[i]);
    free(renderer);
    *out = NULL;
}

// ---------------------------------------------------------------- drawing

// Returns the number of parts before the camera; parts with unknown joints are marked absent.
static int find_absent(const struct avatar_renderer *renderer, const struct avatar_view *view, bool absent[PART_COUNT])
{
    int present = 0;
    const struct skeleton *s = &view->skeleton;
    struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    for (int part = 0; part < PART_COUNT; part++) {
        const enum joint ends[] = {part_ends[part].from, part_ends[part].to};
        bool known = part_is_known(take_body(renderer->take), s, (enum part)part), before = false;
        for (int e = 0; e < 2 && known; e++)
            before |= pose_apply(viewer_from_world, s->joint[ends[e]]).z > (double)NEAREST_M;
        known = known && v3_distance(s->joint[ends[0]], s->joint[ends[1]]) > 1e-3;
        absent[part] = !known;
        present += known && before;
    }
    return present;
}

// The vertex of point i or, from point_count on, of a point's double (opacity 0).
static void put_vertex(const struct avatar_renderer *renderer, const struct gpu_frame_layer *now,
                       const struct silhouette_corners *from, int i, float v[VERTEX])
{
    const struct uv_mesh *m = &renderer->avatar.atlas.mesh;
    const int point = i % m->point_count;
    const struct frame_layer_point *frame_layer_point = &now->points[point];
    const struct point3f *at = &from->placed[point];
    const float u = m->at[point][0] / (float)m->width, t = m->at[point][1] / (float)m->height;
    const float opaque = i < m->point_count;
    const float values[][4] = {{at->x, at->y, at->z, opaque},                                          // point
                               {u, t, frame_layer_point->color_uv[0], frame_layer_point->color_uv[1]}, // vertex_uv
                               {frame_layer_point->depth_uv[0], frame_layer_point->depth_uv[1],
                                frame_layer_point->depth_m, frame_layer_point->visibility}, // vertex_sample
                               {frame_layer_point->normal[0], frame_layer_point->normal[1],
                                frame_layer_point->normal[2], frame_layer_point->irradiance}}; // normal_and_light
    _Static_assert(sizeof values == VERTEX * sizeof *v, "avatar.vert's inputs");
    memcpy(v, values, sizeof values);
}

// Uploads only the points that are drawn, in the order of first use.
static void upload_shown_mesh(struct avatar_renderer *renderer, const struct gpu_frame_layer *now,
                              const struct silhouette_corners *from)
{
    struct shown_mesh *m = &renderer->shown;
    const int count = from->front + from->ribbon;
    memset(m->number, 0xff, sizeof *m->number * 2 * (size_t)renderer->avatar.atlas.mesh.point_count);
    m->vertex_count = 0;
    for (int i = 0; i < count; i++) {
        int32_t *number = &m->number[from->corners[i]];
        if (*number < 0) {
            *number = m->vertex_count++;
            put_vertex(renderer, now, from, from->corners[i], m->vertices[*number]);
        }
        m->corners[i] = (uint16_t)*number;
    }
    gpu_mesh_write_vertices(m->mesh, 0, m->vertices[0], VERTEX * m->vertex_count);
    gpu_mesh_write_indices(m->mesh, 0, m->corners, count);
}

// Drawn in this order: triangles the shown frame sees (its own colours), the others (fused colours), the silhouette
// ribbon.
enum layer { OWN, OTHERS, RIBBON, LAYERS };

static void draw_layer(struct avatar_renderer *renderer, enum layer layer, const struct gpu_job *of)
{
    const struct gpu_texture *room = of->textures[3];
    struct gpu_job job = *of;
    job.mesh = renderer->shown.mesh;
    job.textures[0] = renderer->atlas_textures.color;
    job.program = renderer->programs[room ? AVATAR_OCCLUDED : AVATAR];
    job.closed = layer != RIBBON; // the ribbon's triangles have either winding
    job.depth_test = true;
    job.blend = layer == RIBBON;
    job.no_depth_write = layer == RIBBON; // where two ribbons cross, the depth's last bit would decide which is seen
    if (layer != OWN) {
        job.program = renderer->programs[room ? FUSED_OCCLUDED : FUSED];
        job.textures[1] = room;
    }
    gpu_draw(&job);
}

static void draw_colors(struct avatar_renderer *renderer, const struct avatar_view *view,
                        const struct gpu_frame_layer *now, const struct silhouette_corners *corners, struct gpu_box box)
{
    const int ends[LAYERS] = {corners->own, corners->front, corners->front + corners->ribbon};
    struct gpu_job job = {.target = view->actor, .textures = {NULL, now->color, now->depth, view->room}, .within = box};
    for (int layer = 0; layer < LAYERS; layer++) {
        job.count = ends[layer] - job.first;
        if (job.count)
            draw_layer(renderer, (enum layer)layer, &job);
        job.first = ends[layer];
    }
}

enum status avatar_renderer_warm_up(struct avatar_renderer *renderer, struct gpu_target *actor,
                                    const struct gpu_texture *room, bool *done)
{
    enum { SIDE = 3 }; // as of frame layers: no power of two (frame_layer.c)
    const float nothing[3 * VERTEX] = {0};
    const uint16_t corners[3] = {0, 1, 2};
    struct gpu_texture *color = NULL, *depth = NULL;
    enum status status =
        gpu_texture_open(&color, renderer->gpu, &(struct gpu_texture_layout){GPU_RGB8, SIDE, SIDE, GPU_LINEAR}, NULL);
    if (status == OK)
        status = gpu_texture_open(&depth, renderer->gpu,
                                  &(struct gpu_texture_layout){GPU_RGBA8, SIDE, SIDE, GPU_NEAREST}, NULL);
    if (status == OK) {
        const struct gpu_job job = {.target = actor,
                                    .textures = {NULL, color, depth, renderer->warmed_up < LAYERS ? NULL : room},
                                    .count = 3,
                                    .within = {-1, -1, 1, 1}};
        gpu_mesh_write_vertices(renderer->shown.mesh, 0, nothing, 3 * VERTEX);
        gpu_mesh_write_indices(renderer->shown.mesh, 0, corners, 3);
        draw_layer(renderer, (enum layer)(renderer->warmed_up++ % LAYERS), &job);
    }
    gpu_texture_close(&color);
    gpu_texture_close(&depth);
    *done = renderer->warmed_up >= (room ? 2 : 1) * LAYERS;
    return status == OK ? gpu_check(renderer->gpu) : status;
}

// Normals, world axes, and irradiance of the points, of an avatar without a frame layer. transforms: world axes.
static void fill_fused(struct avatar_renderer *renderer, const struct bone_transforms *transforms)
{
    const struct texture_atlas *atlas = &renderer->avatar.atlas;
    struct map_columns maps[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++) {
        const struct affine_map map =
            affine_from_pose((struct pose){transforms->bone[b].rotation, v3(0, 0, 0)}); // of directions
        maps[b] = columns_of(&map);
    }
    for (int i = 0; i < atlas->mesh.point_count; i++) {
        struct frame_layer_point *to = &renderer->fused.layer.points[i];
        const struct vec3 bound = atlas->normals[i];
        const struct point3f n = skin_point(&renderer->avatar.skins[atlas->mesh.points[i]], maps,
                                            (struct point3f){(float)bound.x, (float)bound.y, (float)bound.z});
        const float unit = 1 / fmaxf(sqrtf(n.x * n.x + n.y * n.y + n.z * n.z), 1e-6F);
        to->normal[0] = n.x * unit, to->normal[1] = n.y * unit, to->normal[2] = n.z * unit;
        to->irradiance = sqrtf(sh_irradiance_at(&renderer->avatar.vertex_colors.irradiance, to->normal));
    }
}

// The layer to draw, and the bones' transforms with its corrections, world axes. NOTHING: the frame's pose is unknown.
static enum status find_layer_shown(struct avatar_renderer *renderer, const struct avatar_view *view,
                                    const struct gpu_frame_layer **out, struct bone_transforms *shown)
{
    enum status status = bone_transforms_of(&renderer->avatar.bind_pose, &view->skeleton, shown);
    if (status != OK)
        return status;
    if (view->fused) {
        renderer->fused.layer.corrections = avatar_corrections(&renderer->avatar, view->frame);
        *out = &renderer->fused.layer;
    } else {
        status = frame_layer_cache_get(renderer->frames, &renderer->avatar, view->frame, out);
    }
    if (status != OK)
        return status;
    *shown = bone_corrections_apply(shown, &(*out)->corrections);
    if (view->fused)
        fill_fused(renderer, shown);
    return (*out)->points ? OK : NOTHING;
}

enum status avatar_renderer_draw(struct avatar_renderer *renderer, const struct avatar_view *view, int *parts,
                                 struct gpu_box *within)
{
    bool absent[PART_COUNT];
    *parts = find_absent(renderer, view, absent);
    if (!*parts)
        return NOTHING;
    const struct take_entry *e = take_entry(renderer->take, view->frame);
    const struct gpu_frame_layer *now;
    struct bone_transforms shown;
    const enum status status = find_layer_shown(renderer, view, &now, &shown);
    if (status != OK)
        return status;
    const struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    struct affine_map viewer_from_bone[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        viewer_from_bone[b] = affine_from_pose(pose_multiply(viewer_from_world, shown.bone[b]));
    const struct silhouette_corners corners =
        silhouette_edges_find(renderer->silhouette, viewer_from_bone, now->shift, now->triangle_visible, absent);
    if (corners.front == 0)
        return OK;
    upload_shown_mesh(renderer, now, &corners);
    const struct affine_map viewer_from_frame = affine_from_pose(
        view->fused ? viewer_from_world : pose_multiply(viewer_from_world, e->world_from_camera)); // of normals
    set_uniform(renderer, VIEWER_FROM_FRAME, viewer_from_frame.row[0], 3);
    const float time_s = (float)((double)(e->time_ns - take_entry(renderer->take, 0)->time_ns) * 1e-9);
    set_uniform(renderer, FRAME_PARAMS, (const float[4]){time_s, HALF_SILHOUETTE_PX, 0, 0}, 1);
    const struct gpu_box box = *within =
        screen_bounds(&renderer->view, (const double[]){(double)corners.low[0], (double)corners.low[1]},
                      (const double[]){(double)corners.high[0], (double)corners.high[1]});
    draw_colors(renderer, view, now, &corners, box);
    if (view->source) {
        gpu_program_set(renderer->programs[SOURCE], FRAME_PARAMS, (const float[4]){time_s, 0, 0, 0}, 1);
        gpu_draw(&(struct gpu_job){.target = view->source,
                                   .program = renderer->programs[SOURCE],
                                   .mesh = renderer->shown.mesh,
                                   .textures = {renderer->atlas_textures.seen_time, now->depth},
                                   .closed = true,
                                   .depth_test = true,
                                   .count = corners.front,
                                   .within = box});
    }
    return gpu_check(renderer->gpu);
}
