#include "app/place/place_things.h"

#include "base/linear_algebra.h"
#include "base/threads.h"
#include "objects/thing_map.h"
#include "recording/recorded_things.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- thing solid

// A box is as deep as this share of its smaller side: only its front is known. Chosen by hand.
static const double DEPTH_SHARE = 0.4, MIN_M = 0.05;
static const float BOX_COLOR[4] = {0.18F, 0.62F, 0.58F, 1};

static float to_srgb(float linear) { return powf(linear, 1 / 2.2F); } // factors of glTF are linear

static enum status open_picture(struct thing_solid *solid, struct gpu *gpu, int part, const struct image *picture)
{
    if (!picture->width || picture->width > gpu_max_size(gpu) || picture->height > gpu_max_size(gpu))
        return OK;
    const struct gpu_texture_layout how = {GPU_RGB8, picture->width, picture->height, GPU_LINEAR};
    return gpu_texture_open(&solid->pictures[part], gpu, &how, picture->rgb);
}

static enum status add_part(struct thing_solid *solid, struct gpu *gpu, const struct solid_vertex *vertex, int count)
{
    uint32_t *corners = malloc(sizeof *corners * (size_t)(count + 1));
    for (int i = 0; i < count && corners; i++)
        corners[i] = (uint32_t)i;
    const enum status status = corners
                                   ? solid_mesh_open(&solid->parts[solid->count], gpu, vertex, count, corners, count)
                                   : fail(ERR_MEMORY, "no memory for a thing's body");
    free(corners);
    solid->count += status == OK;
    return status;
}

// glTF's y is up and its front looks along z; the thing's y is down, its z away from the viewer, its origin in the
// middle of the front. Its height in the list is believed more than the model's.
static enum status open_model(struct thing_solid *solid, struct gpu *gpu, const struct place_thing *thing)
{
    const struct glb_model *m = &thing->model;
    const double high = (double)m->high[1] - (double)m->low[1];
    const float scale = (float)(thing->height_m > 0 && high > 1e-6 ? thing->height_m / high : 1);
    const float middle[3] = {(m->low[0] + m->high[0]) / 2, (m->low[1] + m->high[1]) / 2, m->high[2]};
    struct solid_vertex *v = malloc(sizeof *v * (size_t)m->corner_count);
    enum status status = v ? OK : fail(ERR_MEMORY, "no memory for a thing's model");
    for (int i = 0; i < m->part_count && status == OK; i++) {
        const struct glb_part *p = &m->parts[i];
        for (int k = 0; k < p->count; k++) {
            const struct glb_corner *c = &m->corners[p->first + k];
            v[k] =
                (struct solid_vertex){.at = {scale * (c->at[0] - middle[0]), -scale * (c->at[1] - middle[1]),
                                             -scale * (c->at[2] - middle[2])},
                                      .normal = {c->normal[0], -c->normal[1], -c->normal[2]},
                                      .u = c->uv[0],
                                      .v = c->uv[1],
                                      .color = {to_srgb(p->color[0]), to_srgb(p->color[1]), to_srgb(p->color[2]), 1}};
        }
        solid->two_sided[solid->count] = p->two_sided;
        status = open_picture(solid, gpu, solid->count, &p->picture);
        if (status == OK)
            status = add_part(solid, gpu, v, p->count);
    }
    free(v);
    const double w = (double)scale * ((double)m->high[0] - (double)m->low[0]) / 2, h = (double)scale * high / 2;
    solid->low = v3(-w, -h, 0);
    solid->high = v3(w, h, (double)scale * ((double)m->high[2] - (double)m->low[2]));
    solid->is_model = true;
    return status;
}

// The face of a box on side `axis`, +1 or -1: six corners, counter-clockwise from outside.
static void put_face(struct solid_vertex *vertex, const float half[3], int axis, int sign)
{
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    const int u = (axis + 1) % 3, w = (axis + 2) % 3;
    for (int i = 0; i < 6; i++) {
        const int k = sign > 0 ? order[i] : order[5 - i];
        float at[3];
        at[axis] = (float)sign * half[axis];
        at[u] = (k == 1 || k == 2 ? 1.0F : -1.0F) * half[u];
        at[w] = (k >= 2 ? 1.0F : -1.0F) * half[w];
        vertex[i] = (struct solid_vertex){.at = {at[0], at[1], at[2] + half[2]}, .color = {1, 1, 1, 1}};
        vertex[i].normal[axis] = (float)sign;
        vertex[i].u = at[0] / (2 * half[0]) + 0.5F;
        vertex[i].v = at[1] / (2 * half[1]) + 0.5F;
    }
}

static enum status open_box(struct thing_solid *solid, struct gpu *gpu, const struct place_thing *thing)
{
    const double w = fmax(thing->width_m, MIN_M), h = fmax(thing->height_m, MIN_M), d = DEPTH_SHARE * fmin(w, h);
    const float half[3] = {(float)w / 2, (float)h / 2, (float)d / 2};
    struct solid_vertex front[6], rest[30];
    int count = 0;
    put_face(front, half, 2, -1); // towards the viewer
    for (int axis = 0; axis < 3; axis++)
        for (int sign = -1; sign <= 1; sign += 2)
            if (axis != 2 || sign > 0) {
                put_face(rest + count, half, axis, sign);
                count += 6;
            }
    for (int i = 0; i < 30; i++)
        memcpy(rest[i].color, BOX_COLOR, sizeof BOX_COLOR);
    for (int i = 0; i < 6 && !thing->picture.width; i++)
        memcpy(front[i].color, BOX_COLOR, sizeof BOX_COLOR);
    solid->low = v3(-w / 2, -h / 2, 0);
    solid->high = v3(w / 2, h / 2, d);
    enum status status = open_picture(solid, gpu, solid->count, &thing->picture);
    if (status == OK)
        status = add_part(solid, gpu, front, 6);
    return status == OK ? add_part(solid, gpu, rest, 30) : status;
}

enum status thing_solid_open(struct thing_solid *out, struct gpu *gpu, const struct place_thing *thing)
{
    *out = (struct thing_solid){0};
    const enum status status = thing->model.corner_count ? open_model(out, gpu, thing) : open_box(out, gpu, thing);
    if (status != OK)
        thing_solid_close(out);
    return status;
}

void thing_solid_close(struct thing_solid *solid)
{
    for (int i = 0; i < GLB_MAX_PARTS; i++) {
        solid_mesh_close(&solid->parts[i]);
        gpu_texture_close(&solid->pictures[i]);
    }
    *solid = (struct thing_solid){0};
}

void thing_solid_draw(const struct thing_solid *solid, struct solid_renderer *renderer, const struct solid_view *view,
                      struct pose world_from_thing)
{
    for (int i = 0; i < solid->count; i++)
        solid_renderer_draw(renderer, view, solid->parts[i],
                            &(struct solid_look){world_from_thing, 1, solid->pictures[i], !solid->two_sided[i]});
}

void thing_solid_draw_turning(const struct thing_solid *solid, struct solid_renderer *renderer,
                              struct gpu_target *target, double angle)
{
    const int width = gpu_target_width(target);
    const struct vec3 middle = v3_mix(solid->low, solid->high, 0.5);
    const double radius = fmax(v3_distance(solid->low, solid->high) / 2, 1e-3), away = 3.2 * radius;
    // Seen slightly from above; the camera's axes are the thing'solid: y down, z away.
    const struct quat tilt = quat_from_rotation_vector(v3(0.3, 0, 0)),
                      turn = quat_from_rotation_vector(v3(0, angle, 0));
    const struct quat both = quat_multiply(tilt, turn);
    const struct vec3 shifted = quat_rotate(both, middle);
    const struct pose camera_from_thing = {both, v3_sub(v3(0, 0, away), shifted)};
    // Metres are scaled so that a small thing is not nearer than the nearest depth that is drawn.
    const double scale = 1 / radius;
    const struct solid_view view = {target,
                                    {.width = width,
                                     .height = width,
                                     .fx = 1.4 * width,
                                     .fy = 1.4 * width,
                                     .cx = (width - 1) / 2.0,
                                     .cy = (width - 1) / 2.0},
                                    POSE_IDENTITY};
    gpu_target_clear(target);
    for (int i = 0; i < solid->count; i++)
        solid_renderer_draw(
            renderer, &view, solid->parts[i],
            &(struct solid_look){{camera_from_thing.rotation, v3_scale(camera_from_thing.translation, scale)},
                                 scale,
                                 solid->pictures[i],
                                 !solid->two_sided[i]});
}

// ---------------------------------------------------------------- place things

static const double CHI_95 = 2.7955; // square root of the 95 % quantile of chi^2 with 3 degrees of freedom

static void matrix_of(const struct covariance3 *covariance3, double m[3][3])
{
    const double rows[3][3] = {{covariance3->xx, covariance3->xy, covariance3->xz},
                               {covariance3->xy, covariance3->yy, covariance3->yz},
                               {covariance3->xz, covariance3->yz, covariance3->zz}};
    memcpy(m, rows, sizeof rows);
}

// Eigenvalues and vectors (columns) of a symmetric matrix, by Jacobi's rotations.
static void diagonalize_symmetric(double m[3][3], double vectors[3][3])
{
    for (int i = 0; i < 9; i++)
        vectors[i / 3][i % 3] = i / 3 == i % 3;
    for (int sweep = 0; sweep < 24; sweep++) {
        const int p = sweep % 3 == 2, q = sweep % 3 == 0 ? 1 : 2;
        if (fabs(m[p][q]) < 1e-30)
            continue;
        const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
        const double c = 1 / sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < 3; k++) {
            const double a = m[k][p], b = m[k][q];
            m[k][p] = c * a - s * b, m[k][q] = s * a + c * b;
        }
        for (int k = 0; k < 3; k++) {
            const double a = m[p][k], b = m[q][k], d = vectors[k][p], e = vectors[k][q];
            m[p][k] = c * a - s * b, m[q][k] = s * a + c * b;
            vectors[k][p] = c * d - s * e, vectors[k][q] = s * d + c * e;
        }
    }
}

void covariance_ellipsoid(const struct covariance3 *covariance3, struct vec3 axes[3])
{
    double m[3][3], v[3][3];
    matrix_of(covariance3, m);
    diagonalize_symmetric(m, v);
    for (int i = 0; i < 3; i++)
        axes[i] = v3_scale(v3(v[0][i], v[1][i], v[2][i]), CHI_95 * sqrt(fmax(m[i][i], 0)));
    for (int i = 0; i < 2; i++)
        for (int k = i + 1; k < 3; k++)
            if (v3_length(axes[k]) > v3_length(axes[i])) {
                const struct vec3 a = axes[i];
                axes[i] = axes[k];
                axes[k] = a;
            }
}

double covariance_largest_sigma(const struct covariance3 *covariance3)
{
    struct vec3 axes[3];
    covariance_ellipsoid(covariance3, axes);
    return v3_length(axes[0]) / CHI_95;
}

static void set_knowledge(struct place_thing *thing, const char *text)
{
    thing->known = text && thing_knowledge_parse(text, strlen(text), thing->url, &thing->knowledge) == OK;
    if (!thing->known)
        thing->knowledge = (struct thing_knowledge){0};
}

static void read_thing(const struct recorded_thing *from, struct place_thing *thing)
{
    *thing = (struct place_thing){.world_from_thing = from->world_from_thing,
                                  .covariance = from->covariance,
                                  .width_m = from->width_m,
                                  .height_m = from->height_m,
                                  .sigma_m = covariance_largest_sigma(&from->covariance),
                                  .sightings = from->sightings,
                                  .gone = from->gone};
    strcpy(thing->name, from->name);
    strcpy(thing->note, from->note);
    strcpy(thing->url, from->url);
    strcpy(thing->etag, from->etag);
    set_knowledge(thing, from->knowledge);
    if (from->image.bytes && image_decode(from->image.bytes, from->image.count, thing->name, &thing->picture) != OK)
        thing->picture = (struct image){0};
    if (from->model.bytes && glb_read(from->model.bytes, from->model.count, &thing->model) != OK)
        thing->model = (struct glb_model){0};
}

enum status place_things_read(struct recording *recording, struct place_things *out)
{
    struct recorded_thing *recorded;
    int count;
    *out = (struct place_things){0};
    enum status status = recording_read_things(recording, &recorded, &count);
    if (status != OK)
        return status;
    out->things = calloc((size_t)count + 1, sizeof *out->things);
    if (!out->things)
        status = fail(ERR_MEMORY, "no memory for what stands in the room");
    for (int i = 0; i < count && status == OK; i++)
        read_thing(&recorded[i], &out->things[out->count++]);
    recorded_things_free(&recorded, count);
    return status;
}

void place_things_free(struct place_things *things)
{
    for (int i = 0; i < things->count; i++) {
        free(things->things[i].picture.rgb);
        glb_model_free(&things->things[i].model);
    }
    free(things->things);
    *things = (struct place_things){0};
}

// ---------------------------------------------------------------- knowledge asker

// Asking a thing's own address for what is newer, on a thread, and keeping it in the recording.

struct knowledge_asker {
    struct knowledge_asker_options options;
    char *file; // a copy of options.file
    struct worker_thread worker;

    // Under its lock, which is never held while the server is asked:
    bool orphan;                   // closed while the server was asked; the thread frees it
    int wanted, running, answered; // indices; -1: none
    char name[64], url[512];       // of what is wanted
    struct answer {
        struct thing_update update;
        bool kept; // the recording has it
    } answer;
};

static void free_asker(struct knowledge_asker *asker)
{
    worker_thread_close(&asker->worker);
    free(asker->file);
    free(asker);
}

static struct recorded_thing *find_thing(struct recorded_thing *things, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(things[i].name, name))
            return &things[i];
    return NULL;
}

static enum status read_things(const char *file, struct recorded_thing **things, int *count)
{
    struct recording *r;
    enum status status = recording_open(&r, file);
    if (status != OK)
        return status;
    status = recording_read_things(r, things, count);
    recording_free(&r);
    return status;
}

// The thing as the recording has it: what it knows already need not be sent again. False: it has none of that name.
static bool read_kept(const char *file, const char *name, struct recorded_thing *out)
{
    struct recorded_thing *things = NULL;
    int count = 0;
    bool good = file && read_things(file, &things, &count) == OK;
    const struct recorded_thing *kept = good ? find_thing(things, count, name) : NULL;
    *out = (struct recorded_thing){0};
    good = kept && recorded_thing_copy(out, kept) == OK;
    recorded_things_free(&things, count);
    return good;
}

// As objects --knowledge does: all things again, in one transaction, those of the file as they are now.
static bool save_thing(const char *file, const struct recorded_thing *thing)
{
    struct recorded_thing *things = NULL;
    int count = 0;
    bool good = read_things(file, &things, &count) == OK;
    struct recorded_thing *to = good ? find_thing(things, count, thing->name) : NULL;
    if (to) {
        struct recorded_thing now;
        good = recorded_thing_copy(&now, thing) == OK;
        const struct recorded_thing before = *to;
        *to = now; // what is known; the rest is as the file has it
        to->world_from_thing = before.world_from_thing;
        to->covariance = before.covariance;
        to->width_m = before.width_m, to->height_m = before.height_m;
        to->sightings = before.sightings;
        to->gone = before.gone;
        memcpy(to->note, before.note, sizeof to->note);
        free(before.knowledge);
        free(before.image.bytes);
        free(before.model.bytes);
        good = good && recording_write_things(file, things, count) == OK;
    }
    recorded_things_free(&things, count);
    return to && good;
}

static void request_knowledge(const struct knowledge_asker *asker, const char *name, const char *url,
                              struct answer *out)
{
    struct recorded_thing thing;
    const bool recorded = read_kept(asker->file, name, &thing);
    thing_update_ask(&thing, url, url, &asker->options.limits, &out->update);
    out->kept = recorded && (!out->update.changed || save_thing(asker->file, &thing));
    free(thing.knowledge);
    free(thing.image.bytes);
    free(thing.model.bytes);
}

static void *run_asker(void *self)
{
    struct knowledge_asker *a = self;
    pthread_mutex_lock(&a->worker.lock);
    while (!a->worker.closing) {
        if (a->wanted < 0 || a->answered >= 0) { // an answer is taken before the next request
            pthread_cond_wait(&a->worker.changed, &a->worker.lock);
            continue;
        }
        char name[sizeof a->name], url[sizeof a->url];
        struct answer answer;
        strcpy(name, a->name);
        strcpy(url, a->url);
        a->running = a->wanted;
        a->wanted = -1;
        pthread_mutex_unlock(&a->worker.lock);
        request_knowledge(a, name, url, &answer);
        pthread_mutex_lock(&a->worker.lock);
        a->answer = answer;
        a->answered = a->running;
        a->running = -1;
        if (a->options.notify && !a->worker.closing)
            a->options.notify(a->options.notify_self);
    }
    const bool orphan = a->orphan;
    pthread_mutex_unlock(&a->worker.lock);
    if (orphan)
        free_asker(a);
    return NULL;
}

enum status knowledge_asker_start(struct knowledge_asker **out, const struct knowledge_asker_options *options)
{
    struct knowledge_asker *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "no memory to ask what is known of things");
    a->options = *options;
    a->wanted = a->running = a->answered = -1;
    worker_thread_open(&a->worker);
    enum status status = OK;
    if (options->file && !(a->file = strdup(options->file)))
        status = fail(ERR_MEMORY, "no memory to ask what is known of things");
    if (status == OK)
        status = worker_thread_start(&a->worker, run_asker, a, "to ask what is known of things");
    if (status != OK)
        knowledge_asker_close(out);
    return status;
}

void knowledge_asker_close(struct knowledge_asker **out)
{
    struct knowledge_asker *a = *out;
    if (!a)
        return;
    *out = NULL;
    pthread_mutex_lock(&a->worker.lock);
    const bool orphan = a->orphan = a->running >= 0 && worker_thread_abandon(&a->worker);
    pthread_mutex_unlock(&a->worker.lock);
    if (!orphan)
        free_asker(a);
}

void knowledge_asker_ask(struct knowledge_asker *asker, int index, const struct place_thing *thing)
{
    if (!thing->url[0])
        return;
    pthread_mutex_lock(&asker->worker.lock);
    if (asker->running != index) {
        asker->wanted = index;
        strcpy(asker->name, thing->name);
        strcpy(asker->url, thing->url);
        pthread_cond_signal(&asker->worker.changed);
    }
    pthread_mutex_unlock(&asker->worker.lock);
}

int knowledge_asker_take(struct knowledge_asker *asker, struct place_things *things)
{
    pthread_mutex_lock(&asker->worker.lock);
    const int index = asker->answered;
    if (index >= 0 && index < things->count) {
        struct place_thing *t = &things->things[index];
        const struct thing_update *u = &asker->answer.update;
        strcpy(t->trouble, u->trouble);
        if (u->known && !u->trouble[0]) {
            t->knowledge = u->knowledge;
            t->known = true;
            t->unkept = !asker->answer.kept;
        }
    }
    asker->answered = -1;
    if (index >= 0)
        pthread_cond_signal(&asker->worker.changed);
    pthread_mutex_unlock(&asker->worker.lock);
    return index;
}

bool knowledge_asker_asks(struct knowledge_asker *asker, int index)
{
    pthread_mutex_lock(&asker->worker.lock);
    const bool is = asker->wanted == index || asker->running == index;
    pthread_mutex_unlock(&asker->worker.lock);
    return is;
}
