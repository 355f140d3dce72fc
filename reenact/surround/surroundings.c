#include "reenact/surround/surroundings.h"

#include "base/parallel.h"
#include "platform/png.h"

#include <stdlib.h>

// Every second row and column of a depth picture: finer than the voxels they are averaged in, nearer than 3 m.
enum { DEPTH_STEP = 2 };

struct surroundings_options surroundings_default_options(enum surroundings_kind kind)
{
    struct surroundings_options how = {.alignment = alignment_default_options(),
                                       .depth = depth_default_options(),
                                       .view = view_default_options(),
                                       .redo_m = 5,
                                       .most_pictures = 16,
                                       .threads = 2};
    how.depth.sky = kind == SURROUNDINGS_VEHICLE;
    if (kind == SURROUNDINGS_FILMED) {
        how.alignment.surface_m = 0.01;
        how.depth.upright = false; // what was not filmed stays plain
        how.depth.reach = 8;
        how.depth.farthest_m = 12;
        how.view.geometry_pictures = 8;
    }
    if (kind == SURROUNDINGS_ROBOT) {
        how.depth.farthest_m = 30;
        how.view.geometry_pictures = SURROUND_MOST_LAYERS;
    }
    return how;
}

static int64_t now(const struct surroundings *s) { return s->clock ? s->clock() : 0; }

static enum status open_parts(struct surroundings *s, const struct lens *view, const struct surroundings_options *how)
{
    s->how = *how;
    enum status status = depth_alignment_open(&s->alignment, &s->how.alignment);
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
    s->kind = s->set.robot ? SURROUNDINGS_ROBOT : s->set.filmed ? SURROUNDINGS_FILMED : SURROUNDINGS_VEHICLE;
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
    for (int i = 0; i < s->taken; i++)
        surround_picture_free(&s->pictures[i]);
    free(s->pictures);
    free(s->poses);
    free(s->stale);
    free(s->blank);
    free(s->points);
    free(s->weights);
    depth_alignment_close(&s->alignment);
    surround_view_close(&s->view);
    surround_set_free(&s->set);
    *s = (struct surroundings){0};
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
    if (!pictures || !poses || !stale || !blank)
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

// Owns the picture, also after a failure.
static enum status keep(struct surroundings *s, struct surround_picture *picture, struct pose pose)
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
    s->pictures[s->taken] = *picture;
    *picture = (struct surround_picture){0};
    s->poses[s->taken++] = pose;
    for (int k = 0; k < s->taken; k++) {
        const double apart = v3_distance(s->pictures[k].world_from_camera.translation, world_from_camera.translation);
        if (k == s->taken - 1)
            s->stale[k] = true;
        else if (s->kind != SURROUNDINGS_VEHICLE && apart < s->how.redo_m)
            s->stale[k] = true;
    }
    return OK;
}

enum status surroundings_take(struct surroundings *s, struct surround_picture *picture,
                              const struct depth_points *points, struct pose odometry)
{
    struct pose pose;
    const int64_t before = now(s);
    enum status status = depth_alignment_add(&s->alignment, points, odometry, &pose);
    const int64_t spent = now(s) - before;
    s->align_ns += spent;
    s->worst_align_ns = spent > s->worst_align_ns ? spent : s->worst_align_ns;
    if (status == NOTHING)
        s->unplaced++;
    else if (status != OK) {
        surround_picture_free(picture);
        return status;
    }
    return keep(s, picture, pose);
}

enum status surroundings_take_placed(struct surroundings *s, struct surround_picture *picture,
                                     const struct depth_points *points, struct pose world_from_camera)
{
    const enum status status = depth_alignment_unify(&s->alignment, points, world_from_camera);
    if (status == OK)
        return keep(s, picture, world_from_camera);
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
        return keep(s, &picture, s->set.captures[i].guess);
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

static enum status gather_points(struct surroundings *s)
{
    const struct voxel_map *map = &s->alignment.surface;
    float(*points)[3] = realloc(s->points, (map->used + 1) * sizeof *points);
    if (points)
        s->points = points;
    float *weights = realloc(s->weights, (map->used + 1) * sizeof *weights);
    if (weights)
        s->weights = weights;
    if (!points || !weights)
        return fail(ERR_MEMORY, "out of memory");
    s->point_count = 0;
    for (size_t i = 0; i < map->size; i++)
        if (map->table[i].key) {
            double mean[3];
            voxel_mean(map, &map->table[i], mean);
            for (int k = 0; k < 3; k++)
                s->points[s->point_count][k] = (float)mean[k];
            s->weights[s->point_count++] = (float)(map->table[i].weight * 1e-6); // of 1 mm: 1
        }
    return OK;
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
                           .points = {(const float(*)[3])s->set.points, NULL, s->set.point_count},
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
        status = gather_points(s);
        w.points = (struct world_points){(const float(*)[3])s->points, s->weights, s->point_count};
    }
    const int64_t before = now(s);
    if (status == OK)
        parallel_for(s->how.threads, n, make_depth, &w);
    s->depth_ns += now(s) - before;
    s->depths_made += n;
    for (int i = 0; status == OK && i < n; i++) {
        status = failure_restore(&w.failures[i]);
        s->stale[w.pictures[i]] = status != OK;
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

enum status surroundings_draw(struct surroundings *s, struct pose world_from_view)
{
    const struct surround_picture **pictures = malloc((size_t)(s->taken + 1) * sizeof *pictures);
    if (!pictures)
        return fail(ERR_MEMORY, "out of memory");
    int usable = 0;
    for (int i = 0; i < s->taken; i++)
        if (!s->blank[i])
            pictures[usable++] = &s->pictures[i];
    enum status status = surround_view_rank(world_from_view, pictures, usable);
    const int count = usable < s->how.most_pictures ? usable : s->how.most_pictures;
    if (status == OK)
        status = make_depths(s, pictures, count);
    const int64_t before = now(s);
    if (status == OK && s->plain)
        surround_view_splat(&s->view, world_from_view, pictures, count);
    else if (status == OK)
        status = surround_view_draw(&s->view, world_from_view, pictures, count, &s->how.view);
    s->draw_ns += now(s) - before;
    s->drawn++;
    free(pictures);
    return status;
}
