#include "surround/surroundings.h"

#include "base/memory.h"
#include "base/threads.h"
#include "platform/files/png.h"
#include "surround/depth/dense_depth.h"
#include "surround/picture/surround_picture.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- capture thread, types

// A robot's captures aligned, and given depth, on two threads of their own, so that drawing for the operator waits for
// neither (Okura 2014, section 3.2: "the unification process is implemented as a thread separated from the ... image
// generation process"). The drawing thread puts jobs and takes what is done.

struct capture_job {
    int number; // the caller's own
    bool again; // no new capture: the depth of a placed picture made again, from all points by then
    struct surround_picture picture; // again: without depth; its colours and rays are borrowed
    struct depth_points points;      // of a new capture; freed by the thread
    struct pose odometry;
    // Filled when done:
    struct pose world_from_body;
    bool fits;        // else it has the odometry's pose
    int64_t align_ns; // processor time
    struct failure failure;
    // The threads' own:
    struct surface_points *surface;
};

// Every capture comes back twice: with its pose, then with depth in its picture. What is made again, once.
enum capture_stage { CAPTURE_NONE, CAPTURE_ALIGNED, CAPTURE_WITH_DEPTH };

struct capture_thread;

int capture_thread_count(const struct capture_thread *thread); // jobs not taken yet

// Takes over the picture (but what is borrowed) and the points. NOTHING: CAPTURE_MAX jobs are not done; ERR_MEMORY.
// Then they stay the caller's.
enum { CAPTURE_MAX = 8 };

static void capture_thread_close(struct capture_thread **t);
static enum status surface_points_gather(struct surface_points *points, const struct voxel_map *map);
static void surface_points_free(struct surface_points *points);
static struct world_points surface_points_world(const struct surface_points *points);

// ---------------------------------------------------------------- capture thread

struct capture_thread {
    struct depth_alignment *alignment;
    struct photo_refinement *photo;
    struct depth_options depth;
    int64_t (*clock)(void);
    struct queue *fresh, *placed, *aligned, *done; // of struct capture_job *
    pthread_t align_thread, depth_thread;
    bool align_runs, depth_runs;
    atomic_bool closing; // what waits is left as it is
    int in_flight;       // the caller's thread alone
};

static void free_job(struct capture_job **job)
{
    struct capture_job *j = *job;
    if (!j)
        return;
    if (j->again) { // the rest is borrowed
        free(j->picture.inverse);
        free(j->picture.joined);
        surround_picture_free_mesh(&j->picture);
    } else
        surround_picture_free(&j->picture);
    depth_points_free(&j->points);
    if (j->surface)
        surface_points_free(j->surface);
    free(j->surface);
    free(j);
    *job = NULL;
}

static void align_capture(struct capture_thread *thread, struct capture_job *job)
{
    const int64_t before = thread->clock ? thread->clock() : 0;
    enum status status = photo_alignment_add(thread->photo, thread->alignment, &job->picture, &job->points,
                                             job->odometry, &job->world_from_body);
    job->align_ns = thread->clock ? thread->clock() - before : 0;
    job->fits = status == OK;
    depth_points_free(&job->points);
    surround_picture_place(&job->picture, pose_multiply(job->world_from_body, thread->photo->body_from_picture));
    if (status >= OK)
        status = (job->surface = calloc(1, sizeof *job->surface))
                     ? surface_points_gather(job->surface, &thread->alignment->surface)
                     : fail(ERR_MEMORY, "no memory for aligning captures");
    failure_keep(&job->failure, status);
}

// The queues hold more than CAPTURE_MAX items: a put never waits.
static void *align_all(void *self)
{
    struct capture_thread *t = self;
    struct capture_job *job;
    while ((job = queue_take(t->fresh))) {
        const bool align_it = !job->again && !t->closing;
        struct capture_job *pose = align_it ? malloc(sizeof *pose) : NULL;
        if (align_it)
            align_capture(t, job);
        if (pose) { // without memory for it the pose comes with the depth
            *pose = *job;
            pose->picture = (struct surround_picture){0};
            pose->surface = NULL;
            queue_put(t->aligned, pose);
        }
        queue_put(t->placed, job);
    }
    queue_stop(t->placed);
    return NULL;
}

static void *make_job_depths(void *self)
{
    struct capture_thread *t = self;
    struct surface_points *newest = NULL;
    struct capture_job *job;
    thread_lower_priority();
    while ((job = queue_take(t->placed))) {
        if (job->surface) {
            if (newest)
                surface_points_free(newest);
            free(newest);
            newest = job->surface;
            job->surface = NULL;
        }
        if (job->failure.status == OK && newest && !t->closing) {
            const struct world_points points = surface_points_world(newest);
            enum status status = dense_depth_make(&job->picture, &points, &t->depth);
            if (status == OK)
                status = surround_picture_make_mesh(&job->picture);
            failure_keep(&job->failure, status);
        }
        queue_put(t->done, job);
    }
    if (newest)
        surface_points_free(newest);
    free(newest);
    return NULL;
}

// alignment, photo: the thread's alone until it is closed. clock: processor time of the calling thread; NULL: none
// measured. ERR_MEMORY (also: no thread to be had); *out is then NULL.
static enum status capture_thread_open(struct capture_thread **out, struct depth_alignment *alignment,
                                       struct photo_refinement *photo, const struct depth_options *depth,
                                       int64_t (*clock)(void))
{
    struct capture_thread *t = calloc(1, sizeof *t);
    *out = t;
    if (!t)
        return fail(ERR_MEMORY, "no memory for aligning captures");
    t->alignment = alignment;
    t->photo = photo;
    t->depth = *depth;
    t->clock = clock;
    struct queue **const queues[] = {&t->fresh, &t->placed, &t->aligned, &t->done};
    enum status status = OK;
    for (size_t i = 0; i < COUNT_OF(queues) && status == OK; i++)
        status = queue_open(queues[i], 2 * CAPTURE_MAX);
    if (status == OK) {
        t->align_runs = !pthread_create(&t->align_thread, NULL, align_all, t);
        t->depth_runs = t->align_runs && !pthread_create(&t->depth_thread, NULL, make_job_depths, t);
        if (!t->depth_runs)
            status = fail(ERR_MEMORY, "the system gives no more threads");
    }
    if (status != OK)
        capture_thread_close(out);
    return status;
}

// Waits for the jobs in hand; frees what was put and not taken. NULL is fine.
static void capture_thread_close(struct capture_thread **out)
{
    struct capture_thread *t = *out;
    if (!t)
        return;
    struct queue **const queues[] = {&t->fresh, &t->placed, &t->aligned, &t->done};
    t->closing = true;
    if (t->align_runs) {
        queue_stop(t->fresh);
        pthread_join(t->align_thread, NULL); // it stops `placed`
    }
    if (t->depth_runs)
        pthread_join(t->depth_thread, NULL);
    for (size_t i = 0; i < COUNT_OF(queues); i++) {
        while (*queues[i] && queue_count(*queues[i])) {
            struct capture_job *job = queue_take(*queues[i]);
            free_job(&job);
        }
        queue_close(queues[i]);
    }
    free(t);
    *out = NULL;
}

int capture_thread_count(const struct capture_thread *thread) { return thread->in_flight; }

static enum status capture_thread_put(struct capture_thread *thread, const struct capture_job *job)
{
    if (thread->in_flight == CAPTURE_MAX)
        return NOTHING;
    struct capture_job *own = malloc(sizeof *own);
    if (!own)
        return fail(ERR_MEMORY, "no memory for aligning captures");
    *own = *job;
    own->surface = NULL;
    own->failure = (struct failure){0};
    queue_put(thread->fresh, own);
    thread->in_flight++;
    return OK;
}

// CAPTURE_NONE: nothing is done. With CAPTURE_WITH_DEPTH the picture in *out is the caller's again.
static enum capture_stage capture_thread_take(struct capture_thread *thread, struct capture_job *out)
{
    const bool aligned = queue_count(thread->aligned) > 0;
    if (!aligned && !queue_count(thread->done))
        return CAPTURE_NONE;
    struct capture_job *job = queue_take(aligned ? thread->aligned : thread->done);
    *out = *job;
    free(job); // what it held is the caller's
    thread->in_flight -= !aligned;
    return aligned ? CAPTURE_ALIGNED : CAPTURE_WITH_DEPTH;
}

// ---------------------------------------------------------------- surface points

// Replaces what is in *points. ERR_MEMORY.
static enum status surface_points_gather(struct surface_points *points, const struct voxel_map *map)
{
    if (map->used + 1 > points->capacity) {
        const size_t capacity = map->used + map->used / 4 + 1;
        float(*xyz)[3] = realloc(points->xyz, capacity * sizeof *xyz);
        if (xyz)
            points->xyz = xyz;
        float *weights = realloc(points->weights, capacity * sizeof *weights);
        if (weights)
            points->weights = weights;
        if (!xyz || !weights)
            return fail(ERR_MEMORY, "no memory for the points of a surface");
        points->capacity = capacity;
    }
    points->count = 0;
    for (size_t i = 0; i < map->size; i++)
        if (map->table[i].key) {
            double mean[3];
            voxel_mean(map, &map->table[i], mean);
            for (int k = 0; k < 3; k++)
                points->xyz[points->count][k] = (float)mean[k];
            points->weights[points->count++] = (float)(map->table[i].weight * 1e-6);
        }
    return OK;
}

// a zeroed one is fine
static void surface_points_free(struct surface_points *points)
{
    free(points->xyz);
    free(points->weights);
    *points = (struct surface_points){0};
}

static struct world_points surface_points_world(const struct surface_points *points)
{
    return (struct world_points){
        .xyz = (const float(*)[3])points->xyz, .weight = points->weights, .count = points->count};
}

// ---------------------------------------------------------------- photo refinement

#define PI 3.14159265358979323846
enum { MAX_POINTS = 4000 };
#define GRAY_SCALE 16.0f
// Chosen on the rover set and on the small world's coarse panoramas: what is fainter says little; a residual's standard
// deviation in levels is between these.
#define MIN_GRADIENT 4.0f
#define MIN_SIGMA    1.5
#define MAX_SIGMA    8.0
#define OFF_PX       0.3   // resampling and depth move a point by so much of a pixel
#define INDEPENDENT  400.0 // neighbours and references err alike: all points count as so many

void photo_refinement_free(struct photo_refinement *refinement)
{
    for (int i = 0; i < PHOTO_REFERENCES; i++)
        free(refinement->references[i].gray);
    free(refinement->next.gray);
    free(refinement->points);
    *refinement = (struct photo_refinement){0};
}

// Sums of 1 2 1 along a row of brightness; a panorama's row joins its end. row has room for a pixel before and after.
static void sum_row(const struct surround_picture *picture, int v, uint16_t *row, uint16_t *out)
{
    const uint8_t *rgb = picture->rgb + 3 * (size_t)v * (size_t)picture->width;
    const int w = picture->width;
    for (int u = 0; u < w; u++)
        row[u + 1] = (uint16_t)((77 * rgb[3 * u] + 150 * rgb[3 * u + 1] + 29 * rgb[3 * u + 2]) >> 4);
    row[0] = picture->panorama ? row[w] : row[1];
    row[w + 1] = picture->panorama ? row[1] : row[w];
    for (int u = 0; u < w; u++)
        out[u] = (uint16_t)((row[u] + 2 * row[u + 1] + row[u + 2]) >> 2);
}

// Brightness times GRAY_SCALE.
static uint16_t *smoothed_gray(const struct surround_picture *picture)
{
    const int w = picture->width, h = picture->height;
    uint16_t *gray = alloc_cache_aligned((size_t)w * (size_t)h * sizeof *gray);
    uint16_t *rows = alloc_cache_aligned((size_t)(w + 2) * 4 * sizeof *rows);
    if (!gray || !rows) {
        free(gray);
        free(rows);
        return NULL;
    }
    uint16_t *const row = rows + 3 * (w + 2);
    for (int v = 0; v <= h; v++) { // rows v - 2, v - 1 and v make row v - 1
        uint16_t *newest = rows + (v % 3) * (w + 2);
        if (v < h)
            sum_row(picture, v, row, newest);
        const uint16_t *below = v < h ? newest : rows + ((v - 1) % 3) * (w + 2);
        const uint16_t *middle = rows + ((v + 2) % 3) * (w + 2);
        const uint16_t *above = v > 1 ? rows + ((v + 1) % 3) * (w + 2) : middle;
        for (int u = 0; v > 0 && u < w; u++)
            gray[(size_t)(v - 1) * (size_t)w + (size_t)u] = (uint16_t)((above[u] + 2 * middle[u] + below[u]) >> 2);
    }
    free(rows);
    return gray;
}

// Bilinear, with the gradient per pixel. False: outside.
static bool read_gray(const struct photo_reference *reference, float u, float v, float out[3])
{
    const int w = reference->shape.width, x = (int)floorf(u), y = (int)floorf(v);
    if (y < 0 || y + 1 >= reference->shape.height || (!reference->shape.panorama && (x < 0 || x + 1 >= w)))
        return false;
    const int left = x < 0 ? x + w : x, right = x + 1 < w ? x + 1 : 0;
    const uint16_t *row = reference->gray + (size_t)y * (size_t)w;
    const float a = row[left], b = row[right], c = row[left + w], d = row[right + w];
    const float fu = u - (float)x, fv = v - (float)y;
    out[0] = ((1 - fv) * ((1 - fu) * a + fu * b) + fv * ((1 - fu) * c + fu * d)) / GRAY_SCALE;
    out[1] = ((1 - fv) * (b - a) + fv * (d - c)) / GRAY_SCALE;
    out[2] = ((1 - fu) * (c - a) + fu * (d - b)) / GRAY_SCALE;
    return true;
}

// The points of the capture in hand that have a gradient in its own picture.
static enum status begin_refinement(struct photo_refinement *refinement, const struct surround_picture *picture,
                                    const struct depth_points *points)
{
    if (!refinement->points && !(refinement->points = malloc(MAX_POINTS * sizeof *refinement->points)))
        return fail(ERR_MEMORY, "no memory for refining an alignment");
    free(refinement->next.gray);
    refinement->next = (struct photo_reference){*picture, smoothed_gray(picture)};
    refinement->next.shape.rgb = NULL;
    refinement->next.shape.inverse = NULL;
    refinement->next.shape.joined = NULL;
    refinement->next.shape.ray_table = NULL;
    if (!refinement->next.gray)
        return fail(ERR_MEMORY, "no memory for refining an alignment");
    struct surround_picture at_body = refinement->next.shape;
    surround_picture_place(&at_body, refinement->body_from_picture);
    const int stride = points->count / (4 * MAX_POINTS) + 1; // about a fourth have a gradient
    refinement->point_count = 0;
    for (int i = 0; i < points->count && refinement->point_count < MAX_POINTS; i += stride) {
        const float *b = points->xyz[i];
        const double body[3] = {b[0], b[1], b[2]};
        struct picture_point at;
        float gray[3];
        if (!surround_picture_project(&at_body, body, &at) || !read_gray(&refinement->next, at.u, at.v, gray) ||
            gray[1] * gray[1] + gray[2] * gray[2] < MIN_GRADIENT * MIN_GRADIENT)
            continue;
        refinement->points[refinement->point_count++] = (struct photo_point){{b[0], b[1], b[2]}, gray[0]};
    }
    return OK;
}

// The capture in hand is a reference from now on.
static void end_refinement(struct photo_refinement *refinement, struct pose world_from_picture)
{
    const int last = PHOTO_REFERENCES - 1;
    free(refinement->references[last].gray);
    memmove(refinement->references + 1, refinement->references, (size_t)last * sizeof *refinement->references);
    surround_picture_place(&refinement->next.shape, world_from_picture);
    refinement->references[0] = refinement->next;
    refinement->next = (struct photo_reference){0};
    if (refinement->reference_count < PHOTO_REFERENCES)
        refinement->reference_count++;
}

// How brightness changes with a world point that is seen with gradient (du, dv) per pixel.
static void world_gradient(const struct surround_picture *picture, const double world[3], const float gray[3],
                           double out[3])
{
    const struct vec3 *t = &picture->world_from_camera.translation;
    const double d[3] = {world[0] - t->x, world[1] - t->y, world[2] - t->z};
    double c[3], n[3];
    for (int i = 0; i < 3; i++)
        c[i] = picture->axes[0][i] * d[0] + picture->axes[1][i] * d[1] + picture->axes[2][i] * d[2];
    const double gu = gray[1], gv = gray[2];
    if (picture->panorama) {
        const double flat2 = c[0] * c[0] + c[2] * c[2] + 1e-9, flat = sqrt(flat2), r2 = flat2 + c[1] * c[1];
        const double per_u = picture->width / (2 * PI) / flat2, per_v = picture->height / PI / r2;
        n[0] = gu * per_u * c[2] - gv * per_v * c[1] * c[0] / flat;
        n[1] = gv * per_v * flat;
        n[2] = -gu * per_u * c[0] - gv * per_v * c[1] * c[2] / flat;
    } else {
        n[0] = gu * picture->lens.fx / c[2];
        n[1] = gv * picture->lens.fy / c[2];
        n[2] = -(n[0] * c[0] + n[1] * c[1]) / c[2];
    }
    for (int i = 0; i < 3; i++)
        out[i] = picture->axes[i][0] * n[0] + picture->axes[i][1] * n[1] + picture->axes[i][2] * n[2];
}

struct sight_of_point {
    double world[3];
    float gray[3]; // in the reference: brightness and its gradient
    bool seen;
};

// The reference's exposure over the capture's: of the brightness of all points, which is robust enough for a scale.
static double exposure_of(const struct photo_refinement *refinement, const struct sight_of_point *sights)
{
    double product = 0, square = 0;
    for (int i = 0; i < refinement->point_count; i++) {
        if (!sights[i].seen)
            continue;
        product += (double)sights[i].gray[0] * (double)refinement->points[i].gray;
        square += (double)refinement->points[i].gray * (double)refinement->points[i].gray;
    }
    return square > 0 ? product / square : 1;
}

// Standard deviation of a reference's residuals, from their median, which outliers up to half do not move.
static double spread_of(const struct photo_refinement *refinement, const struct sight_of_point *sights, double exposure)
{
    int bins[256] = {0}, count = 0, below = 0, bin = 0;
    for (int i = 0; i < refinement->point_count; i++) {
        if (!sights[i].seen)
            continue;
        const double off = 4 * fabs((double)sights[i].gray[0] - exposure * (double)refinement->points[i].gray);
        bins[off < 255 ? (int)off : 255]++;
        count++;
    }
    while (bin < 255 && 2 * (below + bins[bin]) < count)
        below += bins[bin++];
    return fmin(MAX_SIGMA, fmax(MIN_SIGMA, 1.4826 * (bin + 0.5) / 4));
}

static double share_of(const struct photo_refinement *refinement)
{
    return fmin(1, INDEPENDENT / ((double)refinement->point_count * refinement->reference_count + 1));
}

static void add_reference(const struct photo_refinement *refinement, const struct photo_reference *reference,
                          const struct pose *now, struct sight_of_point *sights, struct normal_equations *equations)
{
    double m[3][3];
    quat_to_matrix(now->rotation, m);
    const double origin[3] = {now->translation.x, now->translation.y, now->translation.z};
    for (int i = 0; i < refinement->point_count; i++) {
        struct sight_of_point *s = &sights[i];
        const float *b = refinement->points[i].body;
        struct picture_point at;
        for (int k = 0; k < 3; k++)
            s->world[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + origin[k];
        s->seen = surround_picture_project(&reference->shape, s->world, &at) && at.distance > 0.3f &&
                  read_gray(reference, at.u, at.v, s->gray);
    }
    const double exposure = exposure_of(refinement, sights), sigma = spread_of(refinement, sights, exposure);
    for (int i = 0; i < refinement->point_count; i++) {
        const struct sight_of_point *s = &sights[i];
        if (!s->seen)
            continue;
        const double residual = (double)s->gray[0] - exposure * (double)refinement->points[i].gray;
        // Tukey's weight: what another thing hides in the reference says nothing
        const double share = residual / (4.7 * sigma), rest = 1 - share * share;
        if (rest <= 0)
            continue;
        const double slope2 = (double)(s->gray[1] * s->gray[1] + s->gray[2] * s->gray[2]);
        double n[3], arm[3];
        world_gradient(&reference->shape, s->world, s->gray, n);
        for (int k = 0; k < 3; k++)
            arm[k] = s->world[k] - origin[k];
        normal_equations_add(equations, n, arm, residual,
                             share_of(refinement) * rest * rest / (sigma * sigma + slope2 * OFF_PX * OFF_PX));
    }
}

static void add_photo_equations(void *self, const struct pose *world_from_body, struct normal_equations *equations)
{
    const struct photo_refinement *r = self;
    struct sight_of_point *sights = malloc(((size_t)r->point_count + 1) * sizeof *sights);
    for (int k = 0; sights && k < r->reference_count; k++) // without memory the planes decide alone
        add_reference(r, &r->references[k], world_from_body, sights, equations);
    free(sights);
}

enum status photo_alignment_add(struct photo_refinement *refinement, struct depth_alignment *alignment,
                                const struct surround_picture *picture, const struct depth_points *points,
                                struct pose odometry, struct pose *world_from_body)
{
    enum status status = begin_refinement(refinement, picture, points);
    if (status != OK)
        return status;
    alignment->more = (struct pose_evidence){add_photo_equations, refinement};
    status = depth_alignment_add(alignment, points, odometry, world_from_body);
    alignment->more = (struct pose_evidence){0};
    if (status == OK)
        end_refinement(refinement, pose_multiply(*world_from_body, refinement->body_from_picture));
    return status;
}

// ---------------------------------------------------------------- surroundings

// Every second row and column of a depth picture: finer than the voxels they are averaged in, nearer than 3 m.
enum { DEPTH_STEP = 2 };

struct surroundings_options surroundings_default_options(enum surroundings_kind kind)
{
    struct surroundings_options options = {.surface_m = 0.02,
                                           .depth = depth_default_options(),
                                           .view = view_default_options(),
                                           .photo = true,
                                           .redo_m = 5,
                                           .max_pictures = 16,
                                           .threads = 2};
    options.depth.sky = kind == SURROUNDINGS_VEHICLE;
    if (kind == SURROUNDINGS_FILMED) {
        options.surface_m = 0.01;
        options.depth.upright = false; // what was not filmed stays plain
        options.depth.reach = 8;
        options.depth.farthest_m = 12;
        options.view.geometry_pictures = 8;
    }
    if (kind == SURROUNDINGS_ROBOT) {
        options.depth.farthest_m = 30;
        options.depth.walls = true;
        options.depth.sparse = false; // depth cameras see a post whole
        options.view.geometry_pictures = SURROUND_MAX_LAYERS;
    }
    return options;
}

static int64_t clock_now(const struct surroundings *surroundings)
{
    return surroundings->clock ? surroundings->clock() : 0;
}

static enum status open_parts(struct surroundings *surroundings, const struct lens *view,
                              const struct surroundings_options *options)
{
    surroundings->options = *options;
    surroundings->photo.body_from_picture = surroundings->body_from_panorama;
    enum status status = depth_alignment_open(&surroundings->alignment, surroundings->options.surface_m);
    if (status == OK)
        status = surround_view_open(&surroundings->view, view);
    if (status != OK)
        surroundings_close(surroundings);
    return status;
}

enum status surroundings_open(struct surroundings *surroundings, const char *folder,
                              const struct surroundings_options *how)
{
    *surroundings = (struct surroundings){0};
    const enum status status = surround_set_read(&surroundings->set, folder);
    if (status != OK)
        return status;
    surroundings->kind = surroundings->set.filmed ? SURROUNDINGS_FILMED : SURROUNDINGS_VEHICLE;
    if (surroundings->set.robot)
        surroundings->kind = SURROUNDINGS_ROBOT;
    surroundings->body_from_panorama = surroundings->set.body_from_panorama;
    const struct surroundings_options usual = surroundings_default_options(surroundings->kind);
    return open_parts(surroundings, &surroundings->set.view, how ? how : &usual);
}

enum status surroundings_open_live(struct surroundings *surroundings, enum surroundings_kind kind,
                                   const struct lens *view, struct pose body_from_panorama,
                                   const struct surroundings_options *how)
{
    *surroundings = (struct surroundings){.kind = kind, .body_from_panorama = body_from_panorama};
    const struct surroundings_options usual = surroundings_default_options(kind);
    return open_parts(surroundings, view, how ? how : &usual);
}

void surroundings_close(struct surroundings *surroundings)
{
    capture_thread_close(&surroundings->thread);
    for (int i = 0; i < surroundings->taken; i++)
        surround_picture_free(&surroundings->pictures[i]);
    free(surroundings->pictures);
    free(surroundings->poses);
    free(surroundings->stale);
    free(surroundings->blank);
    free(surroundings->nearest);
    surface_points_free(&surroundings->surface);
    point_colors_free(&surroundings->colors);
    exposure_free(&surroundings->exposure);
    photo_refinement_free(&surroundings->photo);
    depth_alignment_close(&surroundings->alignment);
    surround_view_close(&surroundings->view);
    surround_set_free(&surroundings->set);
    *surroundings = (struct surroundings){0};
}

void surroundings_place_panorama(struct surroundings *surroundings, struct pose body_from_panorama)
{
    assert(!surroundings->any_taken);
    surroundings->body_from_panorama = surroundings->photo.body_from_picture = body_from_panorama;
}

static enum status read_depth(const struct surroundings *surroundings, int capture, struct depth_points *points)
{
    enum status status = OK;
    for (int c = 0; status == OK && c < SURROUND_DEPTH_CAMERAS; c++) {
        const char *path = surroundings->set.captures[capture].depth[c];
        const struct depth_camera *camera = &surroundings->set.depth_cameras[c];
        void *depth;
        int width, height;
        if (!path)
            continue;
        status = png_read(path, PNG_GRAY16, &depth, &width, &height);
        if (status != OK)
            return status;
        if (width != camera->lens.width || height != camera->lens.height)
            status = fail(ERR_INPUT, "%s is not of calibration.json's size", path);
        else
            status = depth_points_add(points, depth, &camera->lens, camera->body_from_camera, DEPTH_STEP);
        free(depth);
    }
    return status;
}

static enum status grow_arrays(struct surroundings *surroundings)
{
    if (surroundings->taken < surroundings->capacity)
        return OK;
    const size_t capacity = (size_t)surroundings->capacity * 2 + 16;
    struct surround_picture *pictures = realloc(surroundings->pictures, capacity * sizeof *pictures);
    if (pictures)
        surroundings->pictures = pictures;
    struct pose *poses = realloc(surroundings->poses, capacity * sizeof *poses);
    if (poses)
        surroundings->poses = poses;
    bool *stale = realloc(surroundings->stale, capacity * sizeof *stale);
    if (stale)
        surroundings->stale = stale;
    bool *blank = realloc(surroundings->blank, capacity * sizeof *blank);
    if (blank)
        surroundings->blank = blank;
    const struct surround_picture **nearest = realloc(surroundings->nearest, capacity * sizeof *nearest);
    if (nearest)
        surroundings->nearest = nearest;
    if (!pictures || !poses || !stale || !blank || !nearest)
        return fail(ERR_MEMORY, "no memory for the surroundings");
    surroundings->capacity = (int)capacity;
    return OK;
}

// No pixel of a grid over the picture is brighter than this: chosen by hand, above a camera's noise.
enum { BLANK_LEVEL = 16, BLANK_GRID = 64 };

static bool is_blank(const struct surround_picture *picture)
{
    int max = 0;
    for (int i = 0; i < BLANK_GRID * BLANK_GRID; i++) {
        const int u = i % BLANK_GRID * picture->width / BLANK_GRID, v = i / BLANK_GRID * picture->height / BLANK_GRID;
        for (size_t k = 0; k < 3; k++) {
            const int value = picture->rgb[3 * ((size_t)v * (size_t)picture->width + (size_t)u) + k];
            max = value > max ? value : max;
        }
    }
    return max < BLANK_LEVEL;
}

// Owns the picture, also after a failure. made: it has its depth.
static enum status keep_picture(struct surroundings *surroundings, struct surround_picture *picture, struct pose pose,
                                bool made)
{
    const enum status status = grow_arrays(surroundings);
    if (status != OK) {
        surround_picture_free(picture);
        return status;
    }
    const struct pose world_from_camera =
        surroundings->kind == SURROUNDINGS_ROBOT ? pose_multiply(pose, surroundings->body_from_panorama) : pose;
    surround_picture_place(picture, world_from_camera);
    surroundings->blank[surroundings->taken] = is_blank(picture);
    surroundings->stale[surroundings->taken] = !made;
    if (made)
        picture->depth_number = ++surroundings->depth_number;
    surroundings->pictures[surroundings->taken] = *picture;
    *picture = (struct surround_picture){0};
    surroundings->poses[surroundings->taken++] = pose;
    for (int k = 0; k < surroundings->taken - 1; k++) {
        const double apart =
            v3_distance(surroundings->pictures[k].world_from_camera.translation, world_from_camera.translation);
        if (surroundings->kind != SURROUNDINGS_VEHICLE && apart < surroundings->options.redo_m)
            surroundings->stale[k] = true;
    }
    return OK;
}

static void note_alignment(struct surroundings *surroundings, struct pose odometry, struct pose pose, bool fits,
                           int64_t spent_ns)
{
    surroundings->align_ns += spent_ns;
    surroundings->worst_align_ns = spent_ns > surroundings->worst_align_ns ? spent_ns : surroundings->worst_align_ns;
    surroundings->unplaced += !fits;
    if (!fits && surroundings->any_aligned) // another is wanted immediately
        surroundings->taken_odometry = surroundings->aligned_odometry;
    if (fits) {
        surroundings->aligned_odometry = odometry;
        surroundings->aligned_pose = pose;
        surroundings->any_aligned = true;
    }
}

static enum status hand_over(struct surroundings *surroundings, struct surround_picture *picture,
                             const struct depth_points *points, struct pose odometry)
{
    struct capture_job job = {.number = surroundings->taken, .picture = *picture, .odometry = odometry};
    const size_t count = (size_t)points->count;
    job.points = (struct depth_points){malloc((count + 1) * sizeof *job.points.xyz),
                                       malloc((count + 1) * sizeof *job.points.sigma), points->count, points->count};
    enum status status = job.points.xyz && job.points.sigma ? OK : fail(ERR_MEMORY, "no memory for the surroundings");
    if (status == OK && count) {
        memcpy(job.points.xyz, points->xyz, count * sizeof *job.points.xyz);
        memcpy(job.points.sigma, points->sigma, count * sizeof *job.points.sigma);
    }
    if (status == OK)
        status = capture_thread_put(surroundings->thread, &job);
    if (status != OK) {
        depth_points_free(&job.points);
        surround_picture_free(picture);
    }
    *picture = (struct surround_picture){0};
    return status < OK ? status : OK;
}

enum status surroundings_take(struct surroundings *surroundings, struct surround_picture *picture,
                              const struct depth_points *points, struct pose odometry)
{
    struct pose pose;
    surroundings->taken_odometry = odometry;
    surroundings->any_taken = true;
    if (surroundings->thread)
        return hand_over(surroundings, picture, points, odometry);
    int64_t (*const clock)(void) = surroundings->processor_clock;
    const int64_t before = clock ? clock() : 0;
    const enum status status =
        surroundings->options.photo
            ? photo_alignment_add(&surroundings->photo, &surroundings->alignment, picture, points, odometry, &pose)
            : depth_alignment_add(&surroundings->alignment, points, odometry, &pose);
    if (status < OK) {
        surround_picture_free(picture);
        return status;
    }
    note_alignment(surroundings, odometry, pose, status == OK, clock ? clock() - before : 0);
    return keep_picture(surroundings, picture, pose, false);
}

enum status surroundings_take_placed(struct surroundings *surroundings, struct surround_picture *picture,
                                     const struct depth_points *points, struct pose world_from_camera)
{
    const enum status status = depth_alignment_unify(&surroundings->alignment, points, world_from_camera);
    if (status == OK)
        return keep_picture(surroundings, picture, world_from_camera, false);
    surround_picture_free(picture);
    return status;
}

static enum status take_next(struct surroundings *surroundings)
{
    const int i = surroundings->next++;
    struct surround_picture picture;
    if (surroundings->delivers && !surroundings->delivers(surroundings->delivers_self, i))
        return OK;
    enum status status = surround_set_picture(&surroundings->set, i, &picture);
    if (status != OK)
        return status;
    if (surroundings->kind == SURROUNDINGS_VEHICLE)
        return keep_picture(surroundings, &picture, surroundings->set.captures[i].guess, false);
    struct depth_points points = {0};
    status = read_depth(surroundings, i, &points);
    if (status == OK && surroundings->kind == SURROUNDINGS_FILMED)
        status = surroundings_take_placed(surroundings, &picture, &points, surroundings->set.captures[i].guess);
    else if (status == OK)
        status = surroundings_take(surroundings, &picture, &points, surroundings->set.captures[i].guess);
    else
        surround_picture_free(&picture);
    depth_points_free(&points);
    return status;
}

struct depth_work {
    struct surroundings *s;
    struct world_points points;
    int *pictures;
    struct failure *failures;
};

static void make_depth(void *context, int i)
{
    struct depth_work *w = context;
    const enum status status = dense_depth_make(&w->s->pictures[w->pictures[i]], &w->points, &w->s->options.depth);
    failure_keep(&w->failures[i], status);
}

static enum status make_depths(struct surroundings *surroundings, const struct surround_picture *const *pictures,
                               int count)
{
    struct depth_work w = {
        .s = surroundings,
        .points = {.xyz = (const float(*)[3])surroundings->set.points, .count = surroundings->set.point_count},
        .pictures = malloc((size_t)(surroundings->taken + 1) * sizeof *w.pictures),
        .failures = calloc((size_t)(surroundings->taken + 1), sizeof *w.failures)};
    int n = 0;
    enum status status = w.pictures && w.failures ? OK : fail(ERR_MEMORY, "no memory for the surroundings");
    for (int i = 0; status == OK && i < count; i++) {
        const int picture = (int)(pictures[i] - surroundings->pictures);
        if (surroundings->stale[picture])
            w.pictures[n++] = picture;
    }
    if (status == OK && n && surroundings->kind != SURROUNDINGS_VEHICLE) {
        status = surface_points_gather(&surroundings->surface, &surroundings->alignment.surface);
        w.points = surface_points_world(&surroundings->surface);
    }
    if (status == OK && n && surroundings->kind == SURROUNDINGS_VEHICLE) { // whose scanners see through glass
        status = point_colors_make(&surroundings->colors, &w.points, surroundings->pictures, surroundings->taken);
        w.points.rgb = (const uint8_t(*)[4])surroundings->colors.rgb;
    }
    const int64_t before = clock_now(surroundings);
    if (status == OK)
        parallel_for(surroundings->options.threads, n, make_depth, &w);
    surroundings->depth_ns += clock_now(surroundings) - before;
    surroundings->depths_made += n;
    for (int i = 0; status == OK && i < n; i++) {
        status = failure_restore(&w.failures[i]);
        surroundings->stale[w.pictures[i]] = status != OK;
        surroundings->pictures[w.pictures[i]].depth_number = ++surroundings->depth_number;
    }
    free(w.pictures);
    free(w.failures);
    return status;
}

enum status surroundings_advance(struct surroundings *surroundings, int64_t time_ns)
{
    enum status status = OK;
    while (status == OK && surroundings->next < surroundings->set.capture_count &&
           surroundings->set.captures[surroundings->next].time_ns <= time_ns)
        status = take_next(surroundings);
    return status;
}

enum status surroundings_start_threads(struct surroundings *surroundings)
{
    assert(surroundings->kind == SURROUNDINGS_ROBOT);
    // What was captured before has its depth immediately: the threads know none of its points
    enum status status = OK;
    for (int i = 0; i < surroundings->taken && status == OK; i++) {
        const struct surround_picture *one = &surroundings->pictures[i];
        status = make_depths(surroundings, &one, 1);
    }
    if (status != OK)
        return status;
    return capture_thread_open(&surroundings->thread, &surroundings->alignment, &surroundings->photo,
                               &surroundings->options.depth, surroundings->processor_clock);
}

// The depth of the placed picture that is nearest to the newest among the stale ones, made again.
static enum status redo_one(struct surroundings *surroundings)
{
    int best = -1;
    double nearest = 0;
    for (int i = 0; i < surroundings->taken; i++) {
        const double away = v3_distance(surroundings->pictures[i].world_from_camera.translation,
                                        surroundings->pictures[surroundings->taken - 1].world_from_camera.translation);
        if (surroundings->stale[i] && !surroundings->blank[i] && (best < 0 || away < nearest)) {
            best = i;
            nearest = away;
        }
    }
    if (best < 0)
        return OK;
    struct capture_job job = {.number = best, .again = true, .picture = surroundings->pictures[best]};
    job.picture.inverse = NULL;
    job.picture.joined = NULL;
    job.picture.mesh = NULL;
    surroundings->stale[best] = false;
    const enum status status = capture_thread_put(surroundings->thread, &job);
    return status < OK ? status : OK;
}

static enum status take_done(struct surroundings *surroundings, struct capture_job *job)
{
    enum status status = failure_restore(&job->failure);
    if (job->again && status == OK && !job->picture.inverse) // no points are known yet
        return OK;
    if (job->again) {
        struct surround_picture *p = &surroundings->pictures[job->number];
        free(status == OK ? p->inverse : job->picture.inverse);
        free(status == OK ? p->joined : job->picture.joined);
        surround_picture_free_mesh(status == OK ? p : &job->picture);
        if (status == OK) {
            p->inverse = job->picture.inverse;
            p->joined = job->picture.joined;
            p->mesh = job->picture.mesh;
            p->depth_number = ++surroundings->depth_number;
            surroundings->depths_made++;
        }
        return status;
    }
    if (status < OK) {
        surround_picture_free(&job->picture);
        return status;
    }
    surroundings->depths_made++;
    return keep_picture(surroundings, &job->picture, job->world_from_body, true);
}

// Takes what the threads have done.
static enum status collect_jobs(struct surroundings *surroundings)
{
    struct capture_job job;
    enum status status = OK;
    for (enum capture_stage stage;
         surroundings->thread && status >= OK && (stage = capture_thread_take(surroundings->thread, &job));) {
        if (stage == CAPTURE_WITH_DEPTH)
            status = take_done(surroundings, &job);
        else if (job.failure.status >= OK)
            note_alignment(surroundings, job.odometry, job.world_from_body, job.fits, job.align_ns);
    }
    if (surroundings->thread && status >= OK && !capture_thread_count(surroundings->thread))
        status = redo_one(surroundings);
    return status < OK ? status : OK;
}

bool surroundings_wants(const struct surroundings *surroundings, struct pose odometry, int64_t since_ns)
{
    const double move_m = 0.6, turn = 20 * 0.017453292519943295, wait_s = 200;
    return !surroundings->any_taken ||
           v3_distance(odometry.translation, surroundings->taken_odometry.translation) >= move_m ||
           pose_angle(odometry, surroundings->taken_odometry) >= turn || (double)since_ns * 1e-9 >= wait_s;
}

struct pose surroundings_bridge(const struct surroundings *surroundings, struct pose odometry)
{
    if (!surroundings->any_aligned)
        return surroundings->any_taken ? pose_multiply(pose_inverse(surroundings->taken_odometry), odometry)
                                       : POSE_IDENTITY;
    return pose_multiply(surroundings->aligned_pose,
                         pose_multiply(pose_inverse(surroundings->aligned_odometry), odometry));
}

enum status surroundings_prepare(struct surroundings *surroundings, struct pose world_from_view,
                                 const struct surround_picture *const **pictures, int *count)
{
    enum status status = collect_jobs(surroundings);
    int usable = 0;
    for (int i = 0; i < surroundings->taken && status == OK; i++)
        if (!surroundings->blank[i] && (!surroundings->thread || surroundings->pictures[i].inverse))
            surroundings->nearest[usable++] = &surroundings->pictures[i];
    if (status == OK)
        status = surround_view_rank(world_from_view, surroundings->nearest, usable);
    *count = usable < surroundings->options.max_pictures ? usable : surroundings->options.max_pictures;
    *pictures = surroundings->nearest;
    if (status == OK && !surroundings->thread)
        status = make_depths(surroundings, surroundings->nearest, *count);
    if (status == OK)
        status = exposure_even(&surroundings->exposure, surroundings->pictures, surroundings->nearest, *count);
    if (status == OK)
        exposure_suit_view(&surroundings->exposure, surroundings->pictures, surroundings->nearest, usable, *count,
                           world_from_view);
    return status;
}

enum status surroundings_draw(struct surroundings *surroundings, struct pose world_from_view)
{
    const struct surround_picture *const *pictures;
    int count;
    enum status status = surroundings_prepare(surroundings, world_from_view, &pictures, &count);
    const int64_t before = clock_now(surroundings);
    if (status == OK && surroundings->plain)
        surround_view_splat(&surroundings->view, world_from_view, pictures, count);
    else if (status == OK)
        status = surround_view_draw(&surroundings->view, world_from_view, pictures, count, &surroundings->options.view);
    surroundings->draw_ns += clock_now(surroundings) - before;
    surroundings->drawn++;
    return status;
}
