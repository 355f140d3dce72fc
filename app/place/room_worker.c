#include "app/place/room_worker.h"

#include "base/threads.h"
#include "recording/recording.h"
#include "surround/filmed/filmed_room.h"
#include "surround/gpu/surround_renderer.h"
#include "surround/picture/surround_picture.h"
#include "surround/surroundings.h"

#include <stdlib.h>
#include <string.h>

static bool room_worker_take_picture(struct room_worker *worker, int *slot, struct surround_picture *out);
static void room_worker_free_picture(struct surround_picture *picture);

// ---------------------------------------------------------------- filmed layer

// The grid over the picture that is bent: pixels from vertex to vertex; neighbours whose inverse depth differs by more
// than this share of the nearer one's lie on two surfaces, between which the picture is open. Chosen by hand.
enum { GRID_PX = 4, MAX_VERTICES = 60000 };
static const float OPEN = 0.08F;
// The flat picture lies this far behind the bent one, metres: the slits that a movement opens at silhouettes have the
// background's colours until the next picture. Nearer to the picture's viewpoint than STILL_M it is shown flat.
static const double BEHIND_M = 50, STILL_M = 1e-6;

struct filmed_layer {
    struct gpu *gpu;
    struct gpu_target *target;
    int width, height;
    struct gpu_texture *texture; // the picture
    struct solid_mesh *mesh, *flat;
    struct solid_vertex *vertices; // MAX_VERTICES
    uint16_t *corners;             // 6 * MAX_VERTICES
    int64_t number;                // of the picture that was uploaded
    int64_t drawn_number;          // what the target shows
    struct lens drawn_lens;
    struct pose drawn_pose;
};

enum status filmed_layer_open(struct filmed_layer **out, struct gpu *gpu)
{
    struct filmed_layer *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for the filmed room");
    f->gpu = gpu;
    f->vertices = malloc(sizeof *f->vertices * MAX_VERTICES);
    f->corners = malloc(sizeof *f->corners * 6 * MAX_VERTICES);
    if (f->vertices && f->corners)
        return OK;
    filmed_layer_close(out);
    return fail(ERR_MEMORY, "no memory for the filmed room");
}

void filmed_layer_close(struct filmed_layer **out)
{
    struct filmed_layer *f = *out;
    if (!f)
        return;
    gpu_target_close(&f->target);
    gpu_texture_close(&f->texture);
    solid_mesh_close(&f->mesh);
    solid_mesh_close(&f->flat);
    free(f->vertices);
    free(f->corners);
    free(f);
    *out = NULL;
}

static void put_vertex(struct solid_vertex *vertex, const struct room_picture *picture, int x, int y)
{
    const float inverse = picture->inverse_z[(size_t)y * (size_t)picture->lens.width + (size_t)x];
    const double z = inverse > 1e-3F ? 1 / (double)inverse : 1;
    const struct vec3 world =
        pose_apply(picture->world_from_view, v3_scale(lens_ray(&picture->lens, (struct pixel){x, y}), z));
    *vertex = (struct solid_vertex){.at = {(float)world.x, (float)world.y, (float)world.z},
                                    .u = ((float)x + 0.5F) / (float)picture->lens.width,
                                    .v = ((float)y + 0.5F) / (float)picture->lens.height,
                                    .color = {1, 1, 1, 1}};
}

static bool is_triangle_closed(const float inverse[3])
{
    float low = inverse[0], high = inverse[0];
    for (int k = 1; k < 3; k++) {
        low = fminf(low, inverse[k]);
        high = fmaxf(high, inverse[k]);
    }
    return low > 1e-3F && high - low < OPEN * high;
}

// The picture as a surface: *vertices and *corners used.
static void build_surface(struct filmed_layer *layer, const struct room_picture *picture, int *vertex_count,
                          int *corner_count)
{
    int step = GRID_PX, columns, rows;
    do {
        columns = (picture->lens.width - 2) / step + 2;
        rows = (picture->lens.height - 2) / step + 2;
        step++;
    } while (columns * rows > MAX_VERTICES);
    step--;
    *corner_count = 0;
    *vertex_count = columns * rows;
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            const int x = c * step < picture->lens.width ? c * step : picture->lens.width - 1;
            const int y = r * step < picture->lens.height ? r * step : picture->lens.height - 1;
            put_vertex(&layer->vertices[r * columns + c], picture, x, y);
        }
    for (int r = 0; r + 1 < rows; r++)
        for (int c = 0; c + 1 < columns; c++) {
            const int i = r * columns + c,
                      quad[2][3] = {{i, i + columns, i + 1}, {i + 1, i + columns, i + columns + 1}};
            for (int t = 0; t < 2; t++) {
                float inverse[3];
                for (int k = 0; k < 3; k++) {
                    const int rc = quad[t][k] / columns * step, cc = quad[t][k] % columns * step;
                    const int y = rc < picture->lens.height ? rc : picture->lens.height - 1;
                    const int x = cc < picture->lens.width ? cc : picture->lens.width - 1;
                    inverse[k] = picture->inverse_z[(size_t)y * (size_t)picture->lens.width + (size_t)x];
                }
                for (int k = 0; k < 3 && is_triangle_closed(inverse); k++)
                    layer->corners[(*corner_count)++] = (uint16_t)quad[t][k];
            }
        }
}

static enum status upload_texture(struct filmed_layer *layer, const struct room_picture *picture)
{
    const struct gpu_texture_layout how = {GPU_RGBA8, picture->lens.width, picture->lens.height, GPU_LINEAR};
    return gpu_texture_put(&layer->texture, layer->gpu, &how, picture->rgba);
}

// The whole picture on the plane z = 1 of its camera.
static enum status open_flat(struct filmed_layer *layer, const struct room_picture *picture)
{
    static const uint32_t corners[6] = {0, 2, 1, 1, 2, 3};
    struct solid_vertex v[4];
    for (int i = 0; i < 4; i++) {
        const int right = i & 1, low = i >> 1;
        const struct pixel px = {right ? picture->lens.width - 0.5 : -0.5, low ? picture->lens.height - 0.5 : -0.5};
        const struct vec3 at = lens_ray(&picture->lens, px);
        v[i] = (struct solid_vertex){
            .at = {(float)at.x, (float)at.y, (float)at.z}, .u = (float)right, .v = (float)low, .color = {1, 1, 1, 1}};
    }
    solid_mesh_close(&layer->flat);
    return solid_mesh_open(&layer->flat, layer->gpu, v, 4, corners, 6);
}

static enum status upload_picture(struct filmed_layer *layer, const struct room_picture *picture)
{
    int vertices, corners;
    enum status status = upload_texture(layer, picture);
    if (status == OK)
        status = open_flat(layer, picture);
    if (status != OK)
        return status;
    build_surface(layer, picture, &vertices, &corners);
    if (!layer->mesh) { // of the largest size, once
        uint32_t *all = malloc(sizeof *all * 6 * MAX_VERTICES);
        for (int i = 0; i < 6 * MAX_VERTICES && all; i++)
            all[i] = (uint32_t)(i % MAX_VERTICES);
        for (int i = vertices; i < MAX_VERTICES; i++)
            layer->vertices[i] = (struct solid_vertex){.u = 0};
        status = all ? solid_mesh_open(&layer->mesh, layer->gpu, layer->vertices, MAX_VERTICES, all, 6 * MAX_VERTICES)
                     : fail(ERR_MEMORY, "no memory for the filmed room");
        free(all);
        if (status != OK)
            return status;
    }
    solid_mesh_write(layer->mesh, layer->vertices, vertices, layer->corners, corners);
    layer->number = picture->number;
    return OK;
}

static bool same_pose(const struct pose *a, const struct pose *b)
{
    return pose_angle(*a, *b) < 1e-9 && v3_distance(a->translation, b->translation) < 1e-9;
}

enum status filmed_layer_draw(struct filmed_layer *layer, struct solid_renderer *renderer,
                              const struct room_picture *picture, const struct lens *lens,
                              struct pose world_from_camera, const struct gpu_texture **out)
{
    enum status status = OK;
    if (layer->target && picture->number == layer->drawn_number && lens_equal(lens, &layer->drawn_lens) &&
        same_pose(&layer->drawn_pose, &world_from_camera)) {
        *out = gpu_target_texture(layer->target);
        return OK;
    }
    if (!layer->target || layer->width != lens->width || layer->height != lens->height) {
        gpu_target_close(&layer->target);
        layer->width = lens->width;
        layer->height = lens->height;
        status = gpu_target_open(&layer->target, layer->gpu, lens->width, lens->height);
    }
    if (status == OK && picture->number != layer->number)
        status = upload_picture(layer, picture);
    if (status != OK)
        return status;
    const struct solid_view view = {layer->target, *lens, world_from_camera};
    const bool still = v3_distance(picture->world_from_view.translation, world_from_camera.translation) < STILL_M;
    const struct solid_look flat = {picture->world_from_view, still ? 1 : BEHIND_M, layer->texture, false};
    const struct solid_look bent = {POSE_IDENTITY, 1, layer->texture, false};
    gpu_target_clear(layer->target);
    solid_renderer_draw(renderer, &view, layer->flat, &flat);
    if (!still)
        solid_renderer_draw(renderer, &view, layer->mesh, &bent);
    layer->drawn_number = picture->number;
    layer->drawn_lens = *lens;
    layer->drawn_pose = world_from_camera;
    *out = gpu_target_texture(layer->target);
    return OK;
}

// ---------------------------------------------------------------- room views

struct room_views {
    struct surround_renderer *renderer;
    struct view_options options;
    struct surround_picture pictures[ROOM_DEPTHS]; // taken from the worker; without inverse: none
    int64_t number;                                // of the worker's gains
    const struct gpu_texture *texture;             // the last image; NULL: none
    struct lens lens;
    struct pose pose;
};

enum status room_views_open(struct room_views **out, struct gpu *gpu)
{
    struct room_views *v = *out = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "no memory for the filmed room");
    v->options = surroundings_default_options(SURROUNDINGS_FILMED).view;
    const enum status status = surround_renderer_open(&v->renderer, gpu);
    if (status != OK)
        room_views_close(out);
    return status;
}

void room_views_close(struct room_views **out)
{
    struct room_views *v = *out;
    if (!v)
        return;
    surround_renderer_close(&v->renderer);
    for (int i = 0; i < ROOM_DEPTHS; i++)
        room_worker_free_picture(&v->pictures[i]);
    free(v);
    *out = NULL;
}

// Whether anything was new.
static bool take_pictures(struct room_views *views, struct room_worker *worker)
{
    float gains[ROOM_DEPTHS][3];
    struct surround_picture picture;
    int slot;
    while (room_worker_take_picture(worker, &slot, &picture)) {
        room_worker_free_picture(&views->pictures[slot]);
        views->pictures[slot] = picture;
    }
    const int64_t number = room_worker_gains(worker, gains);
    const bool fresh = number != views->number;
    views->number = number;
    for (int i = 0; i < ROOM_DEPTHS && fresh; i++)
        if (views->pictures[i].inverse)
            memcpy(views->pictures[i].gain, gains[i], sizeof gains[i]);
    return fresh;
}

enum status room_views_draw(struct room_views *views, struct room_worker *worker, const struct lens *lens,
                            struct pose world_from_camera, const struct gpu_texture **out)
{
    const struct surround_picture *list[ROOM_DEPTHS];
    const struct surround_image image = {*lens, world_from_camera, views->options, false, 1};
    int count = 0;
    const bool fresh = take_pictures(views, worker);
    *out = views->texture;
    if (views->texture && !fresh && !room_views_more(views) && lens_equal(lens, &views->lens) &&
        same_pose(&world_from_camera, &views->pose))
        return OK;
    for (int i = 0; i < ROOM_DEPTHS; i++)
        if (views->pictures[i].inverse)
            list[count++] = &views->pictures[i];
    if (!count)
        return OK;
    enum status status = surround_view_rank(world_from_camera, list, count);
    if (status == OK)
        status = surround_renderer_draw(views->renderer, &image, list, count, out);
    views->texture = status == OK ? *out : NULL;
    views->lens = *lens;
    views->pose = world_from_camera;
    return status;
}

bool room_views_more(const struct room_views *views) { return surround_renderer_missing(views->renderer) > 0; }

// ---------------------------------------------------------------- room worker

enum { PICTURES = 3 };
// How many pictures make a view: a few at first, so that it is there soon, then more, because each needs its depth
// once.
static const int steps[] = {2, 4, 8, 16};
static const double SURFACE_M = 0.02; // of the points that give depth: memory, against 1 cm where films are made

struct room_worker {
    char *path;
    void (*notify)(void *self);
    void *notify_self;
    struct worker_thread worker;

    // Under its lock, which is not held during work:
    bool asked, busy;
    struct lens lens;
    struct pose world_from_view;
    int64_t asked_number;
    struct place_mesh mesh;
    bool has_mesh;
    int views;
    struct room_picture pictures[PICTURES];       // shown: the caller's; ready: the newest; the third is drawn into
    int shown, ready;                             // -1: none
    struct surround_picture waiting[ROOM_DEPTHS]; // handed over and not taken yet, by slot
    float gains[ROOM_DEPTHS][3];
    int64_t handed; // grows with each step of handing over

    // the thread's own
    bool hand_over;
    struct surroundings room;
    int64_t made;
    const struct surround_picture *held[ROOM_DEPTHS]; // what the caller holds in each slot, or will; NULL: nothing
};

static bool goes_on(void *self)
{
    struct room_worker *w = self;
    pthread_mutex_lock(&w->worker.lock);
    const bool on = !w->worker.closing;
    pthread_mutex_unlock(&w->worker.lock);
    return on;
}

static void notify_owner(const struct room_worker *worker)
{
    if (worker->notify)
        worker->notify(worker->notify_self);
}

// ---------------------------------------------------------------- drawing

struct drawn_size {
    int long_px;
    double margin;
};
static const struct drawn_size coarse = {ROOM_LONG, ROOM_MARGIN}, fine = {ROOM_LONG_FINE, 0};

static struct lens drawn_lens(const struct lens *of, const struct drawn_size *size)
{
    const double whole = 1 + 2 * size->margin;
    const int longer = of->width > of->height ? of->width : of->height;
    const double scale = fmin(1, size->long_px / (whole * longer));
    struct lens l = {.fx = of->fx * scale, .fy = of->fy * scale};
    l.width = (int)(whole * of->width * scale + 0.5);
    l.height = (int)(whole * of->height * scale + 0.5);
    l.width = l.width < 16 ? 16 : l.width;
    l.height = l.height < 16 ? 16 : l.height;
    l.cx = (of->cx + 0.5 + size->margin * of->width) * scale - 0.5;
    l.cy = (of->cy + 0.5 + size->margin * of->height) * scale - 0.5;
    return l;
}

// The buffer that is neither shown nor the newest.
static int spare_buffer(const struct room_worker *worker)
{
    int i = 0;
    while (i == worker->shown || i == worker->ready)
        i++;
    return i;
}

static enum status fill_picture(struct room_picture *picture, const struct surround_view *view, struct pose pose)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    if (picture->lens.width != view->lens.width || picture->lens.height != view->lens.height || !picture->rgba) {
        free(picture->inverse_z);
        free(picture->rgba);
        *picture =
            (struct room_picture){.inverse_z = malloc(sizeof *picture->inverse_z * pixels), .rgba = malloc(4 * pixels)};
        if (!picture->inverse_z || !picture->rgba) {
            free(picture->inverse_z);
            free(picture->rgba);
            *picture = (struct room_picture){0};
            return fail(ERR_MEMORY, "no memory for the room behind the actor");
        }
    }
    picture->lens = view->lens;
    picture->world_from_view = pose;
    for (size_t i = 0; i < pixels; i++) {
        const bool seen = view->source[i] != SOURCE_UNSEEN && view->inverse_z[i] > 0;
        picture->inverse_z[i] = seen ? view->inverse_z[i] : -1;
        for (int c = 0; c < 3; c++)
            picture->rgba[4 * i + (size_t)c] = seen ? view->rgb[3 * i + (size_t)c] : 0;
        picture->rgba[4 * i + 3] = seen ? 255 : 0;
    }
    return OK;
}

static enum status draw_step(struct room_worker *worker, const struct lens *wanted, struct pose pose, int max,
                             const struct drawn_size *size)
{
    const struct lens lens = drawn_lens(wanted, size);
    enum status status = OK;
    if (!lens_equal(&lens, &worker->room.view.lens) || !worker->room.view.rgb)
        status = filmed_room_set_lens(&worker->room, &lens);
    worker->room.options.max_pictures = max;
    if (status == OK)
        status = surroundings_draw(&worker->room, pose);
    if (status == OK)
        status = filmed_room_trim(&worker->room, pose, ROOM_DEPTHS);
    if (status != OK)
        return status;
    pthread_mutex_lock(&worker->worker.lock);
    const int into = spare_buffer(worker);
    pthread_mutex_unlock(&worker->worker.lock);
    struct room_picture *p = &worker->pictures[into]; // untouched by the others
    status = fill_picture(p, &worker->room.view, pose);
    if (status != OK)
        return status;
    p->number = ++worker->made;
    p->final = size == &fine;
    pthread_mutex_lock(&worker->worker.lock);
    worker->ready = into;
    pthread_mutex_unlock(&worker->worker.lock);
    notify_owner(worker);
    return OK;
}

// ---------------------------------------------------------------- handing over

static bool is_held(const struct room_worker *worker, const struct surround_picture *picture)
{
    for (int i = 0; i < ROOM_DEPTHS; i++)
        if (worker->held[i] == picture)
            return true;
    return false;
}

// A slot that is free, or holds a picture that is not in the list, which is shorter than there are slots.
static int slot_for(const struct room_worker *worker, const struct surround_picture *const *list, int count)
{
    int slot = 0;
    for (; slot < ROOM_DEPTHS; slot++) {
        bool listed = false;
        for (int i = 0; i < count && worker->held[slot]; i++)
            listed |= list[i] == worker->held[slot];
        if (!listed)
            break;
    }
    assert(slot < ROOM_DEPTHS);
    return slot;
}

static enum status hand_one(struct room_worker *worker, const struct surround_picture *picture, int slot)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    struct surround_picture copy = *picture, former;
    copy.mesh = NULL;
    enum status status = surround_picture_make_mesh(&copy);
    copy.ray_table = NULL;
    copy.joined = malloc(pixels);
    copy.inverse = malloc(pixels * sizeof *copy.inverse);
    if (status == OK && (!copy.joined || !copy.inverse))
        status = fail(ERR_MEMORY, "no memory for the room behind the actor");
    if (status != OK) {
        room_worker_free_picture(&copy);
        return status;
    }
    memcpy(copy.joined, picture->joined, pixels);
    memcpy(copy.inverse, picture->inverse, pixels * sizeof *copy.inverse);
    pthread_mutex_lock(&worker->worker.lock);
    former = worker->waiting[slot];
    worker->waiting[slot] = copy;
    pthread_mutex_unlock(&worker->worker.lock);
    room_worker_free_picture(&former);
    worker->held[slot] = picture;
    return OK;
}

static enum status hand_step(struct room_worker *worker, struct pose pose, int max)
{
    const struct surround_picture *const *list;
    int count;
    worker->room.options.max_pictures = max;
    enum status status = surroundings_prepare(&worker->room, pose, &list, &count);
    for (int i = 0; i < count && status == OK; i++)
        if (!is_held(worker, list[i]))
            status = hand_one(worker, list[i], slot_for(worker, list, count));
    if (status == OK)
        status = filmed_room_trim(&worker->room, pose, ROOM_DEPTHS);
    if (status != OK)
        return status;
    pthread_mutex_lock(&worker->worker.lock);
    for (int i = 0; i < ROOM_DEPTHS; i++)
        if (worker->held[i])
            memcpy(worker->gains[i], worker->held[i]->gain, sizeof worker->gains[i]);
    worker->handed++;
    pthread_mutex_unlock(&worker->worker.lock);
    notify_owner(worker);
    return OK;
}

// With hand_over: a picture with its depth and mesh, in place of what the caller holds in *slot, 0..ROOM_DEPTHS - 1.
// The caller closes it with room_worker_free_picture; its colours stay the worker's, until that is closed. False: none
// is new.
static bool room_worker_take_picture(struct room_worker *worker, int *slot, struct surround_picture *out)
{
    pthread_mutex_lock(&worker->worker.lock);
    for (*slot = 0; *slot < ROOM_DEPTHS && !worker->waiting[*slot].inverse;)
        ++*slot;
    const bool any = *slot < ROOM_DEPTHS;
    if (any) {
        *out = worker->waiting[*slot];
        worker->waiting[*slot] = (struct surround_picture){0};
    }
    pthread_mutex_unlock(&worker->worker.lock);
    return any;
}

// what was zeroed, too
static void room_worker_free_picture(struct surround_picture *picture)
{
    picture->rgb = NULL; // borrowed
    surround_picture_free(picture);
}

int64_t room_worker_gains(struct room_worker *worker, float gains[ROOM_DEPTHS][3])
{
    pthread_mutex_lock(&worker->worker.lock);
    memcpy(gains, worker->gains, sizeof worker->gains);
    const int64_t handed = worker->handed;
    pthread_mutex_unlock(&worker->worker.lock);
    return handed;
}

// ---------------------------------------------------------------- step by step

// Whether something newer was asked for meanwhile, or the thread is to end.
static bool is_overtaken(struct room_worker *worker, int64_t number)
{
    pthread_mutex_lock(&worker->worker.lock);
    const bool is = worker->worker.closing || worker->asked_number != number;
    pthread_mutex_unlock(&worker->worker.lock);
    return is;
}

// From few pictures to all. Depth that is there already costs nothing, so the first step takes as many pictures as have
// it.
static enum status draw_room(struct room_worker *worker, const struct lens *lens, struct pose pose, int64_t number)
{
    int with_depth = 0;
    enum status status = OK;
    for (int i = 0; i < worker->room.taken; i++)
        with_depth += !worker->room.stale[i];
    size_t first = 0;
    while (first + 1 < COUNT_OF(steps) && steps[first] < with_depth)
        first++;
    for (size_t i = first; i < COUNT_OF(steps) && status == OK; i++) {
        const bool last = i + 1 == COUNT_OF(steps) || steps[i] >= worker->room.taken;
        if (i > first && is_overtaken(worker, number))
            break;
        status =
            worker->hand_over ? hand_step(worker, pose, steps[i]) : draw_step(worker, lens, pose, steps[i], &coarse);
        if (last)
            break;
    }
    if (status == OK && !worker->hand_over && !is_overtaken(worker, number))
        status = draw_step(worker, lens, pose, steps[COUNT_OF(steps) - 1], &fine);
    return status;
}

// ---------------------------------------------------------------- the thread

static enum status prepare_room(struct room_worker *worker)
{
    struct surroundings_options options = surroundings_default_options(SURROUNDINGS_FILMED);
    const struct lens small = {.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 7.5, .cy = 7.5};
    struct recording *recording = NULL;
    struct place place = {0};
    struct place_mesh mesh = {0};
    enum status status = recording_open(&recording, worker->path);
    if (status == OK)
        status = recording_read_place(recording, &place);
    recording_free(&recording);
    const bool has_mesh = status == OK && place_mesh_make(&mesh, &place, goes_on, worker) == OK;
    pthread_mutex_lock(&worker->worker.lock);
    worker->mesh = mesh;
    worker->has_mesh = has_mesh;
    pthread_mutex_unlock(&worker->worker.lock);
    notify_owner(worker);
    options.surface_m = SURFACE_M;
    options.threads = 1;
    int views = status == OK ? filmed_room_views(&place) : 0;
    if (views && goes_on(worker) && filmed_room_open(&worker->room, &place, &small, &options) != OK)
        views = 0;
    place_free(&place);
    pthread_mutex_lock(&worker->worker.lock);
    worker->views = views;
    pthread_mutex_unlock(&worker->worker.lock);
    return views ? OK : NOTHING;
}

static void *run_worker(void *self)
{
    struct room_worker *w = self;
    thread_lower_priority();
    enum status status = prepare_room(w);
    pthread_mutex_lock(&w->worker.lock);
    while (!w->worker.closing) {
        if (!w->asked || status != OK) {
            w->busy = false;
            notify_owner(w);
            pthread_cond_wait(&w->worker.changed, &w->worker.lock);
            continue;
        }
        const struct lens lens = w->lens;
        const struct pose pose = w->world_from_view;
        const int64_t number = w->asked_number;
        w->asked = false;
        w->busy = true;
        pthread_mutex_unlock(&w->worker.lock);
        status =
            draw_room(w, &lens, pose, number); // without memory there is no room behind the actor, and no more is tried
        pthread_mutex_lock(&w->worker.lock);
    }
    pthread_mutex_unlock(&w->worker.lock);
    surroundings_close(&w->room);
    return NULL;
}

enum status room_worker_start(struct room_worker **out, const struct room_worker_options *options)
{
    struct room_worker *w = *out = calloc(1, sizeof *w);
    if (!w || !(w->path = strdup(options->path))) {
        free(w);
        *out = NULL;
        return fail(ERR_MEMORY, "no memory for the filmed room");
    }
    w->notify = options->notify;
    w->notify_self = options->notify_self;
    w->hand_over = options->hand_over;
    w->shown = w->ready = -1;
    w->busy = true;
    worker_thread_open(&w->worker);
    enum status status = worker_thread_start(&w->worker, run_worker, w, "for the room behind the actor");
    if (status != OK)
        room_worker_close(out);
    return status;
}

void room_worker_close(struct room_worker **out)
{
    struct room_worker *w = *out;
    if (!w)
        return;
    worker_thread_close(&w->worker);
    for (int i = 0; i < PICTURES; i++) {
        free(w->pictures[i].inverse_z);
        free(w->pictures[i].rgba);
    }
    for (int i = 0; i < ROOM_DEPTHS; i++)
        room_worker_free_picture(&w->waiting[i]);
    place_mesh_free(&w->mesh);
    free(w->path);
    free(w);
    *out = NULL;
}

void room_worker_ask(struct room_worker *worker, const struct lens *lens, struct pose world_from_view)
{
    pthread_mutex_lock(&worker->worker.lock);
    worker->lens = *lens;
    worker->world_from_view = world_from_view;
    worker->asked = true;
    worker->asked_number++;
    worker->busy = true;
    pthread_cond_signal(&worker->worker.changed);
    pthread_mutex_unlock(&worker->worker.lock);
}

const struct room_picture *room_worker_latest(struct room_worker *worker)
{
    pthread_mutex_lock(&worker->worker.lock);
    if (worker->ready >= 0)
        worker->shown = worker->ready;
    const int shown = worker->shown;
    pthread_mutex_unlock(&worker->worker.lock);
    return shown >= 0 ? &worker->pictures[shown] : NULL;
}

bool room_worker_take_mesh(struct room_worker *worker, struct place_mesh *out)
{
    pthread_mutex_lock(&worker->worker.lock);
    const bool has = worker->has_mesh;
    if (has) {
        *out = worker->mesh;
        worker->mesh = (struct place_mesh){0};
        worker->has_mesh = false;
    }
    pthread_mutex_unlock(&worker->worker.lock);
    return has;
}

bool room_worker_idle(struct room_worker *worker, int *views)
{
    pthread_mutex_lock(&worker->worker.lock);
    const bool idle = !worker->busy;
    *views = worker->views;
    pthread_mutex_unlock(&worker->worker.lock);
    return idle;
}
