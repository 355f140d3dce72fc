#include "tests/support/dice_film.h"

#include "base/clock.h"
#include "base/threads.h"
#include "capture/point_finder.h"
#include "tests/support/smoothed_film.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Body points are looked for in every third image, as recorder.c does.
enum { LOOK_EVERY = 3 };

const char *dice_mode_name(enum dice_mode m)
{
    static const char *const names[DICE_MODES] = {"online", "smoothed", "alone", "color_online", "color_smoothed"};
    return names[m];
}

void dice_film_free(struct dice_film *f)
{
    free(f->frame);
    *f = (struct dice_film){0};
}

// ---------------------------------------------------------------- the truth of a frame

static enum dice_sight sight_of(const struct dice_camera *c, struct vec3 p, enum joint j)
{
    const struct lens *l = &c->calibration.depth;
    if (!dice_in_image(l, p))
        return DICE_OUTSIDE;
    const struct pixel px = lens_project(l, p);
    const size_t at = (size_t)lround(px.y) * (size_t)l->width + (size_t)lround(px.x);
    const double over_m = p.z - c->exact[at] * 1e-3; // the surface seen there is this much nearer
    // Beside the actor: an arm is narrower than its joint is deep, and a hand's pixel may miss it.
    if (c->mask[at] != 1)
        return over_m > 0.05 ? DICE_BLOCKED : DICE_VISIBLE;
    return over_m > 1.5 * world_joint_radius(c->world, j) + 0.05 ? DICE_HIDDEN : DICE_VISIBLE;
}

static void describe(const struct dice_camera *c, int k, struct dice_frame *f)
{
    const double t = (double)k / DICE_HZ;
    f->truth = world_joints_in_camera(c->world, c->plan.actor.start_s + t, c->world_from_camera);
    if (c->passerby)
        f->passerby = world_joints_in_camera(c->passerby, c->plan.passerby.start_s + t, c->world_from_camera);
    for (int j = 0; j < JOINT_COUNT; j++)
        f->sight[j] = sight_of(c, f->truth.joint[j], (enum joint)j);
    f->facing_degrees = dice_facing_degrees(&f->truth);
    f->distance_m = hypot(f->truth.joint[JOINT_WAIST].x, f->truth.joint[JOINT_WAIST].z);
}

// ---------------------------------------------------------------- filming and tracking

// What is looked at in the colour images, with the network; all NULL: nothing is.
struct looking {
    struct pose_network *network;
    struct body_points *points; // plan.frames of each
    bool *looked;
};

static enum status looking_open(struct looking *l, int frames)
{
    l->points = calloc((size_t)frames, sizeof *l->points);
    l->looked = calloc((size_t)frames, sizeof *l->looked);
    return l->points && l->looked ? pose_network_open(&l->network, NULL, POSE_NETWORK_LITE)
                                  : fail(ERR_MEMORY, "no memory for a film's body points");
}

static void looking_close(struct looking *l)
{
    pose_network_close(&l->network);
    free(l->points);
    free(l->looked);
}

static enum status shoot(struct dice_camera *c, struct looking *l, int k)
{
    const bool look = l->network && k % LOOK_EVERY == 0;
    const struct lens *lens = &c->calibration.color;
    enum status status = dice_camera_shoot(c, k, look);
    if (status != OK || !look)
        return status;
    status = body_points_of_image(l->network, c->color, lens->width, lens->height, &l->points[k]);
    l->looked[k] = status == OK;
    return status < 0 ? status : OK;
}

static enum status film(struct dice_film *f, struct dice_camera *c, struct looking *looking,
                        struct smoothed_film *images)
{
    enum status status = OK;
    for (int k = 0; k < f->plan.frames && status == OK; k++) {
        status = shoot(c, looking, k);
        if (status != OK)
            break;
        describe(c, k, &f->frame[k]);
        status = smoothed_film_add(images, (int64_t)llround(k * 1e9 / DICE_HZ), c->depth);
    }
    return status;
}

// Tracks into two modes from `first` on.
static enum status track_modes(struct dice_film *f, struct smoothed_film *images, enum dice_mode first)
{
    enum status status = smoothed_film_track(images);
    for (int k = 0; k < f->plan.frames && status == OK; k++) {
        f->frame[k].track[first] = images->online[k];
        f->frame[k].track[first + 1] = images->smoothed[k];
    }
    return status;
}

static enum status track(struct dice_film *f, const struct dice_camera *c, const struct looking *looking,
                         struct smoothed_film *images)
{
    const struct lens *l = &c->calibration.depth;
    uint16_t *background = calloc((size_t)l->width * (size_t)l->height, sizeof *background);
    const struct vec3 up = quat_rotate(quat_conjugate(c->world_from_camera.rotation), v3(0, 0, 1));
    const struct smoothed_floor floor_is = {up, c->world_from_camera.translation.z};
    enum status status = background ? OK : fail(ERR_MEMORY, "no memory for the empty room");
    if (status == OK && f->plan.swept) {
        status = dice_camera_background(c, background);
        images->background = background;
        images->floor = &floor_is;
    }
    if (status == OK)
        status = track_modes(f, images, DICE_ONLINE);
    for (int k = 0; k < f->plan.frames && status == OK; k++) {
        f->frame[k].evidence = images->evidence[k];
        f->frame[k].track[DICE_ALONE] = images->evidence[k].found;
    }
    if (status == OK && looking->network) {
        images->points = looking->points;
        images->looked = looking->looked;
        status = track_modes(f, images, DICE_COLOR_ONLINE);
    }
    free(background);
    return status;
}

static enum status make_film(struct dice_film *f, const struct dice_wish *wish, int index)
{
    struct dice_camera camera = {0};
    struct smoothed_film images = {0};
    struct looking looking = {0};
    const int64_t start_ns = clock_cpu_ns();
    enum status status = dice_plan_draw(&f->plan, wish, index);
    if (status == OK)
        status = dice_camera_open(&camera, &f->plan);
    images.calibration = camera.calibration;
    images.with_evidence = true;
    f->modes = wish->color ? DICE_MODES : DICE_DEPTH_MODES;
    if (status == OK && wish->color)
        status = looking_open(&looking, f->plan.frames);
    if (status == OK && !(f->frame = calloc((size_t)f->plan.frames, sizeof *f->frame)))
        status = fail(ERR_MEMORY, "no memory for a film's joints");
    if (status == OK)
        status = film(f, &camera, &looking, &images);
    const int64_t filmed_ns = clock_cpu_ns();
    if (status == OK)
        status = track(f, &camera, &looking, &images);
    f->filmed_s = (double)(filmed_ns - start_ns) * 1e-9;
    f->tracked_s = (double)(clock_cpu_ns() - filmed_ns) * 1e-9;
    smoothed_film_free(&images);
    looking_close(&looking);
    dice_camera_close(&camera);
    return status;
}

struct making {
    struct dice_film *films;
    const struct dice_request *request;
    atomic_int done;
};

static void make_one(void *context, int i)
{
    struct making *m = context;
    struct dice_film *f = &m->films[i];
    *f = (struct dice_film){0};
    failure_keep(&f->failure, make_film(f, &m->request->wish, m->request->first + i));
    const int done = atomic_fetch_add(&m->done, 1) + 1;
    if (m->request->shown)
        fprintf(stderr, "\r%d of %d films ", done, m->request->count);
}

void dice_films_make(struct dice_film *out, const struct dice_request *request)
{
    struct making making = {.films = out, .request = request};
    parallel_for(request->threads, request->count, make_one, &making);
    if (request->shown)
        fprintf(stderr, "\r\033[K");
}
