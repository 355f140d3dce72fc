#include "surround/surroundings.h"

#include "surround/capture_thread.h"
#include "surround/picture/surround_mesh.h"
#include "base/parallel.h"
#include "platform/files/png.h"

#include <stdlib.h>
#include <string.h>

// Every second row and column of a depth picture: finer than the voxels they are averaged in, nearer than 3 m.
enum { DEPTH_STEP = 2 };

struct surroundings_options surroundings_default_options(enum surroundings_kind kind)
{
    struct surroundings_options how = {.surface_m = 0.02,
                                       .depth = depth_default_options(),
                                       .view = view_default_options(),
                                       .photo = true,
                                       .redo_m = 5,
                                       .most_pictures = 16,
                                       .threads = 2};
    how.depth.sky = kind == SURROUNDINGS_VEHICLE;
    if (kind == SURROUNDINGS_FILMED) {
        how.surface_m = 0.01;
        how.depth.upright = false; // what was not filmed stays plain
        how.depth.reach = 8;
        how.depth.farthest_m = 12;
        how.view.geometry_pictures = 8;
    }
    if (kind == SURROUNDINGS_ROBOT) {
        how.depth.farthest_m = 30;
        how.depth.walls = true;
        how.depth.sparse = false; // depth cameras see a post whole
        how.view.geometry_pictures = SURROUND_MOST_LAYERS;
    }
    return how;
}

static int64_t now(const struct surroundings *s) { return s->clock ? s->clock() : 0; }

static enum status open_parts(struct surroundings *s, const struct lens *view, const struct surroundings_options *how)
{
    s->how = *how;
    s->photo.body_from_picture = s->body_from_panorama;
    enum status status = depth_alignment_open(&s->alignment, s->how.surface_m);
    if (status == OK)
        status = surround_view_open(&s->view, view);
    if (status != OK)
        surroundings_close(s);
    return status;
}

enum status surroundings_open(struct surroundings *s, const char *folder, const struct surroundings_options *how)
{
    *s = (struct surroundings){0};
    const enum status status = surround_set_read(&s->set, folder);
    if (status != OK)
        return status;
    s->kind = s->set.filmed ? SURROUNDINGS_FILMED : SURROUNDINGS_VEHICLE;
    if (s->set.robot)
        s->kind = SURROUNDINGS_ROBOT;
    s->body_from_panorama = s->set.body_from_panorama;
    const struct surroundings_options usual = surroundings_default_options(s->kind);
    return open_parts(s, &s->set.view, how ? how : &usual);
}

enum status surroundings_open_live(struct surroundings *s, enum surroundings_kind kind, const struct lens *view,
                                   struct pose body_from_panorama, const struct surroundings_options *how)
{
    *s = (struct surroundings){.kind = kind, .body_from_panorama = body_from_panorama};
    const struct surroundings_options usual = surroundings_default_options(kind);
    return open_parts(s, view, how ? how : &usual);
}

void surroundings_close(struct surroundings *s)
{
    capture_thread_close(&s->thread);
    for (int i = 0; i < s->taken; i++)
        surround_picture_free(&s->pictures[i]);
    free(s->pictures);
    free(s->poses);
    free(s->stale);
    free(s->blank);
    free(s->nearest);
    surface_points_free(&s->surface);
    point_colors_free(&s->colors);
    exposure_free(&s->exposure);
    photo_refinement_free(&s->photo);
    depth_alignment_close(&s->alignment);
    surround_view_close(&s->view);
    surround_set_free(&s->set);
    *s = (struct surroundings){0};
}

void surroundings_place_panorama(struct surroundings *s, struct pose body_from_panorama)
{
    assert(!s->any_taken);
    s->body_from_panorama = s->photo.body_from_picture = body_from_panorama;
}

static enum status read_depth(const struct surroundings *s, int capture, struct depth_points *points)
{
    enum status status = OK;
    for (int c = 0; status == OK && c < SURROUND_DEPTH_CAMERAS; c++) {
        const char *path = s->set.captures[capture].depth[c];
        const struct depth_camera *camera = &s->set.depth_cameras[c];
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

static enum status grow(struct surroundings *s)
{
    if (s->taken < s->room)
        return OK;
    const size_t room = (size_t)s->room * 2 + 16;
    struct surround_picture *pictures = realloc(s->pictures, room * sizeof *pictures);
    if (pictures)
        s->pictures = pictures;
    struct pose *poses = realloc(s->poses, room * sizeof *poses);
    if (poses)
        s->poses = poses;
    bool *stale = realloc(s->stale, room * sizeof *stale);
    if (stale)
        s->stale = stale;
    bool *blank = realloc(s->blank, room * sizeof *blank);
    if (blank)
        s->blank = blank;
    const struct surround_picture **nearest = realloc(s->nearest, room * sizeof *nearest);
    if (nearest)
        s->nearest = nearest;
    if (!pictures || !poses || !stale || !blank || !nearest)
        return fail(ERR_MEMORY, "out of memory");
    s->room = (int)room;
    return OK;
}

// No pixel of a grid over the picture is brighter than this: chosen by hand, above a camera's noise.
enum { BLANK_LEVEL = 16, BLANK_GRID = 64 };

static bool is_blank(const struct surround_picture *p)
{
    int most = 0;
    for (int i = 0; i < BLANK_GRID * BLANK_GRID; i++) {
        const int u = i % BLANK_GRID * p->width / BLANK_GRID, v = i / BLANK_GRID * p->height / BLANK_GRID;
        for (size_t k = 0; k < 3; k++) {
            const int value = p->rgb[3 * ((size_t)v * (size_t)p->width + (size_t)u) + k];
            most = value > most ? value : most;
        }
    }
    return most < BLANK_LEVEL;
}

// Owns the picture, also after a failure. made: it has its depth.
static enum status keep(struct surroundings *s, struct surround_picture *picture, struct pose pose, bool made)
{
    const enum status status = grow(s);
    if (status != OK) {
        surround_picture_free(picture);
        return status;
    }
    const struct pose world_from_camera =
        s->kind == SURROUNDINGS_ROBOT ? pose_multiply(pose, s->body_from_panorama) : pose;
    surround_picture_place(picture, world_from_camera);
    s->blank[s->taken] = is_blank(picture);
    s->stale[s->taken] = !made;
    if (made)
        picture->depth_number = ++s->depth_number;
    s->pictures[s->taken] = *picture;
    *picture = (struct surround_picture){0};
    s->poses[s->taken++] = pose;
    for (int k = 0; k < s->taken - 1; k++) {
        const double apart = v3_distance(s->pictures[k].world_from_camera.translation, world_from_camera.translation);
        if (s->kind != SURROUNDINGS_VEHICLE && apart < s->how.redo_m)
            s->stale[k] = true;
    }
    return OK;
}

static void note_alignment(struct surroundings *s, struct pose odometry, struct pose pose, bool fits, int64_t spent_ns)
{
    s->align_ns += spent_ns;
    s->worst_align_ns = spent_ns > s->worst_align_ns ? spent_ns : s->worst_align_ns;
    s->unplaced += !fits;
    if (!fits && s->any_aligned) // another is wanted immediately
        s->taken_odometry = s->aligned_odometry;
    if (fits) {
        s->aligned_odometry = odometry;
        s->aligned_pose = pose;
        s->any_aligned = true;
    }
}

static enum status hand_over(struct surroundings *s, struct surround_picture *picture,
                             const struct depth_points *points, struct pose odometry)
{
    struct capture_job job = {.number = s->taken, .picture = *picture, .odometry = odometry};
    const size_t count = (size_t)points->count;
    job.points = (struct depth_points){malloc((count + 1) * sizeof *job.points.xyz),
                                       malloc((count + 1) * sizeof *job.points.sigma), points->count, points->count};
    enum status status = job.points.xyz && job.points.sigma ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK && count) {
        memcpy(job.points.xyz, points->xyz, count * sizeof *job.points.xyz);
        memcpy(job.points.sigma, points->sigma, count * sizeof *job.points.sigma);
    }
    if (status == OK)
        status = capture_thread_put(s->thread, &job);
    if (status != OK) {
        depth_points_free(&job.points);
        surround_picture_free(picture);
    }
    *picture = (struct surround_picture){0};
    return status < OK ? status : OK;
}

enum status surroundings_take(struct surroundings *s, struct surround_picture *picture,
                              const struct depth_points *points, struct pose odometry)
{
    struct pose pose;
    s->taken_odometry = odometry;
    s->any_taken = true;
    if (s->thread)
        return hand_over(s, picture, points, odometry);
    int64_t (*const clock)(void) = s->processor_clock;
    const int64_t before = clock ? clock() : 0;
    const enum status status = s->how.photo
                                   ? photo_alignment_add(&s->photo, &s->alignment, picture, points, odometry, &pose)
                                   : depth_alignment_add(&s->alignment, points, odometry, &pose);
    if (status < OK) {
        surround_picture_free(picture);
        return status;
    }
    note_alignment(s, odometry, pose, status == OK, clock ? clock() - before : 0);
    return keep(s, picture, pose, false);
}

enum status surroundings_take_placed(struct surroundings *s, struct surround_picture *picture,
                                     const struct depth_points *points, struct pose world_from_camera)
{
    const enum status status = depth_alignment_unify(&s->alignment, points, world_from_camera);
    if (status == OK)
        return keep(s, picture, world_from_camera, false);
    surround_picture_free(picture);
    return status;
}

static enum status take_next(struct surroundings *s)
{
    const int i = s->next++;
    struct surround_picture picture;
    if (s->delivers && !s->delivers(s->delivers_self, i))
        return OK;
    enum status status = surround_set_picture(&s->set, i, &picture);
    if (status != OK)
        return status;
    if (s->kind == SURROUNDINGS_VEHICLE)
        return keep(s, &picture, s->set.captures[i].guess, false);
    struct depth_points points = {0};
    status = read_depth(s, i, &points);
    if (status == OK && s->kind == SURROUNDINGS_FILMED)
        status = surroundings_take_placed(s, &picture, &points, s->set.captures[i].guess);
    else if (status == OK)
        status = surroundings_take(s, &picture, &points, s->set.captures[i].guess);
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
    const enum status status = dense_depth_make(&w->s->pictures[w->pictures[i]], &w->points, &w->s->how.depth);
    failure_keep(&w->failures[i], status);
}

static enum status make_depths(struct surroundings *s, const struct surround_picture *const *pictures, int count)
{
    struct depth_work w = {.s = s,
                           .points = {.xyz = (const float(*)[3])s->set.points, .count = s->set.point_count},
                           .pictures = malloc((size_t)(s->taken + 1) * sizeof *w.pictures),
                           .failures = calloc((size_t)(s->taken + 1), sizeof *w.failures)};
    int n = 0;
    enum status status = w.pictures && w.failures ? OK : fail(ERR_MEMORY, "out of memory");
    for (int i = 0; status == OK && i < count; i++) {
        const int picture = (int)(pictures[i] - s->pictures);
        if (s->stale[picture])
            w.pictures[n++] = picture;
    }
    if (status == OK && n && s->kind != SURROUNDINGS_VEHICLE) {
        status = surface_points_gather(&s->surface, &s->alignment.surface);
        w.points = surface_points_world(&s->surface);
    }
    if (status == OK && n && s->kind == SURROUNDINGS_VEHICLE) { // whose scanners see through glass
        status = point_colors_make(&s->colors, &w.points, s->pictures, s->taken);
        w.points.rgb = (const uint8_t(*)[4])s->colors.rgb;
    }
    const int64_t before = now(s);
    if (status == OK)
        parallel_for(s->how.threads, n, make_depth, &w);
    s->depth_ns += now(s) - before;
    s->depths_made += n;
    for (int i = 0; status == OK && i < n; i++) {
        status = failure_restore(&w.failures[i]);
        s->stale[w.pictures[i]] = status != OK;
        s->pictures[w.pictures[i]].depth_number = ++s->depth_number;
    }
    free(w.pictures);
    free(w.failures);
    return status;
}

enum status surroundings_advance(struct surroundings *s, int64_t time_ns)
{
    enum status status = OK;
    while (status == OK && s->next < s->set.capture_count && s->set.captures[s->next].time_ns <= time_ns)
        status = take_next(s);
    return status;
}

enum status surroundings_start_threads(struct surroundings *s)
{
    assert(s->kind == SURROUNDINGS_ROBOT);
    // What was captured before has its depth immediately: the threads know none of its points
    enum status status = OK;
    for (int i = 0; i < s->taken && status == OK; i++) {
        const struct surround_picture *one = &s->pictures[i];
        status = make_depths(s, &one, 1);
    }
    if (status != OK)
        return status;
    return capture_thread_open(&s->thread, &s->alignment, &s->photo, &s->how.depth, s->processor_clock);
}

// The depth of the placed picture that is nearest to the newest among the stale ones, made again.
static enum status redo_one(struct surroundings *s)
{
    int best = -1;
    double nearest = 0;
    for (int i = 0; i < s->taken; i++) {
        const double away = v3_distance(s->pictures[i].world_from_camera.translation,
                                        s->pictures[s->taken - 1].world_from_camera.translation);
        if (s->stale[i] && !s->blank[i] && (best < 0 || away < nearest)) {
            best = i;
            nearest = away;
        }
    }
    if (best < 0)
        return OK;
    struct capture_job job = {.number = best, .again = true, .picture = s->pictures[best]};
    job.picture.inverse = NULL;
    job.picture.joined = NULL;
    job.picture.mesh = NULL;
    s->stale[best] = false;
    const enum status status = capture_thread_put(s->thread, &job);
    return status < OK ? status : OK;
}

static enum status take_done(struct surroundings *s, struct capture_job *job)
{
    enum status status = failure_restore(&job->failure);
    if (job->again && status == OK && !job->picture.inverse) // no points are known yet
        return OK;
    if (job->again) {
        struct surround_picture *p = &s->pictures[job->number];
        free(status == OK ? p->inverse : job->picture.inverse);
        free(status == OK ? p->joined : job->picture.joined);
        surround_picture_free_mesh(status == OK ? p : &job->picture);
        if (status == OK) {
            p->inverse = job->picture.inverse;
            p->joined = job->picture.joined;
            p->mesh = job->picture.mesh;
            p->depth_number = ++s->depth_number;
            s->depths_made++;
        }
        return status;
    }
    if (status < OK) {
        surround_picture_free(&job->picture);
        return status;
    }
    s->depths_made++;
    return keep(s, &job->picture, job->world_from_body, true);
}

// Takes what the threads have done.
static enum status collect(struct surroundings *s)
{
    struct capture_job job;
    enum status status = OK;
    for (enum capture_stage stage; s->thread && status >= OK && (stage = capture_thread_take(s->thread, &job));) {
        if (stage == CAPTURE_WITH_DEPTH)
            status = take_done(s, &job);
        else if (job.failure.status >= OK)
            note_alignment(s, job.odometry, job.world_from_body, job.fits, job.align_ns);
    }
    if (s->thread && status >= OK && !capture_thread_count(s->thread))
        status = redo_one(s);
    return status < OK ? status : OK;
}

bool surroundings_wants(const struct surroundings *s, struct pose odometry, int64_t since_ns)
{
    const double move_m = 0.6, turn = 20 * 0.017453292519943295, wait_s = 200;
    return !s->any_taken || v3_distance(odometry.translation, s->taken_odometry.translation) >= move_m ||
           pose_angle(odometry, s->taken_odometry) >= turn || (double)since_ns * 1e-9 >= wait_s;
}

struct pose surroundings_bridge(const struct surroundings *s, struct pose odometry)
{
    if (!s->any_aligned)
        return s->any_taken ? pose_multiply(pose_inverse(s->taken_odometry), odometry) : POSE_IDENTITY;
    return pose_multiply(s->aligned_pose, pose_multiply(pose_inverse(s->aligned_odometry), odometry));
}

enum status surroundings_prepare(struct surroundings *s, struct pose world_from_view,
                                 const struct surround_picture *const **pictures, int *count)
{
    enum status status = collect(s);
    int usable = 0;
    for (int i = 0; i < s->taken && status == OK; i++)
        if (!s->blank[i] && (!s->thread || s->pictures[i].inverse))
            s->nearest[usable++] = &s->pictures[i];
    if (status == OK)
        status = surround_view_rank(world_from_view, s->nearest, usable);
    *count = usable < s->how.most_pictures ? usable : s->how.most_pictures;
    *pictures = s->nearest;
    if (status == OK && !s->thread)
        status = make_depths(s, s->nearest, *count);
    if (status == OK)
        status = exposure_even(&s->exposure, s->pictures, s->nearest, *count);
    if (status == OK)
        exposure_suit_view(&s->exposure, s->pictures, s->nearest, usable, *count, world_from_view);
    return status;
}

enum status surroundings_draw(struct surroundings *s, struct pose world_from_view)
{
    const struct surround_picture *const *pictures;
    int count;
    enum status status = surroundings_prepare(s, world_from_view, &pictures, &count);
    const int64_t before = now(s);
    if (status == OK && s->plain)
        surround_view_splat(&s->view, world_from_view, pictures, count);
    else if (status == OK)
        status = surround_view_draw(&s->view, world_from_view, pictures, count, &s->how.view);
    s->draw_ns += now(s) - before;
    s->drawn++;
    return status;
}
