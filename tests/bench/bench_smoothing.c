// Stage "smoothing": a take's skeletons once its end is known, next to the online estimate and to the filters that one
// would put over it. The small world's kata at 320 x 240; times are of tracking and smoothing together, a frame.
#include "capture/tracking/tracker.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_skeleton_picture.h"
#include "tests/support/smoothed_film.h"
#include "tests/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FILMED = 150, FPS = 30, WINDOW_MOST = 9 };

enum method { ONLINE, SMOOTHED, MEAN, MEDIAN };

struct smoothing {
    struct smoothed_film film;
    struct skeleton *truth;
};

struct contender {
    struct smoothing *of;
    enum method method;
    int window; // frames, odd; of MEAN and MEDIAN
    struct skeleton *joints;
    bool *found;
    double frame_ms;
};

static enum status film(struct smoothing *s, int frames)
{
    struct world_options options = world_default_options();
    struct world *w;
    options.plain = true;
    options.motion = "kata";
    enum status status = world_open(&w, &options);
    if (status != OK)
        return status;
    s->film.calibration = world_calibration(0.5);
    const struct lens lens = s->film.calibration.depth;
    const struct pose from = world_sensor_pose(w);
    uint16_t *depth = calloc((size_t)lens.width * (size_t)lens.height, sizeof *depth);
    s->truth = calloc((size_t)frames, sizeof *s->truth);
    if (!depth || !s->truth)
        status = fail(ERR_MEMORY, "no memory for an image");
    for (int k = 0; k < frames && status == OK; k++) {
        const double time_s = (double)k / FPS;
        const struct world_shot shot = {lens, from, time_s, true};
        s->truth[k] = world_joints_in_camera(w, time_s, from);
        status = world_render(w, &shot, &(struct world_image){.depth = depth});
        if (status == OK)
            status = world_depth_noise(&lens, depth, (uint64_t)k, depth);
        if (status == OK)
            status = smoothed_film_add(&s->film, (int64_t)llround(time_s * 1e9), depth);
    }
    free(depth);
    world_close(&w);
    return status;
}

// ---------------------------------------------------------------- the contenders

static double axis_of(const struct vec3 *p, int axis) { return axis == 0 ? p->x : axis == 1 ? p->y : p->z; }

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// A joint's coordinate over the window about frame k, as far as it lies within the film.
static double filtered(const struct contender *c, const struct skeleton *in, int k, int joint, int axis)
{
    double values[WINDOW_MOST], sum = 0;
    const int half = c->window / 2;
    int count = 0;
    for (int i = k - half; i <= k + half; i++)
        if (i >= 0 && i < c->of->film.count)
            values[count++] = axis_of(&in[i].joint[joint], axis);
    qsort(values, (size_t)count, sizeof *values, ascending);
    for (int i = 0; i < count; i++)
        sum += values[i];
    return c->method == MEAN ? sum / count : values[count / 2];
}

static void filter(const struct contender *c, const struct skeleton *in, struct skeleton *out)
{
    for (int k = 0; k < c->of->film.count; k++) {
        out[k] = in[k];
        for (int j = 0; j < JOINT_COUNT; j++)
            out[k].joint[j] = v3(filtered(c, in, k, j, 0), filtered(c, in, k, j, 1), filtered(c, in, k, j, 2));
    }
}

static enum status track_online(struct contender *c, struct skeleton *out)
{
    const struct smoothed_film *f = &c->of->film;
    struct tracker *tracker = NULL;
    enum status status = tracker_open(&tracker, &f->calibration, NULL);
    for (int k = 0; k < f->count && status >= 0; k++) {
        status = tracker_next(tracker, f->time_ns[k], f->depth[k], &out[k], NULL);
        c->found[k] = status == OK;
    }
    tracker_close(&tracker);
    return status < 0 ? status : OK;
}

// The whole film.
static enum status estimate(struct contender *c)
{
    struct smoothed_film *f = &c->of->film;
    const size_t n = (size_t)f->count;
    const double from_ms = bench_clock_ms();
    enum status status;
    if (c->method == SMOOTHED) {
        status = smoothed_film_track(f);
        if (status == OK) {
            memcpy(c->joints, f->smoothed, n * sizeof *c->joints);
            memcpy(c->found, f->found, n * sizeof *c->found);
        }
    } else {
        struct skeleton *online = calloc(n, sizeof *online);
        status = online ? track_online(c, online) : fail(ERR_MEMORY, "no memory for the joints");
        if (status == OK && c->method == ONLINE)
            memcpy(c->joints, online, n * sizeof *online);
        else if (status == OK)
            filter(c, online, c->joints);
        free(online);
    }
    c->frame_ms = (bench_clock_ms() - from_ms) / f->count;
    return status;
}

// What the estimate's second difference has that the truth's has not, mm.
static double jitter_mm(const struct contender *c, int k, int joint)
{
    struct vec3 error[3];
    for (int i = 0; i < 3; i++)
        error[i] = v3_sub(c->joints[k - i].joint[joint], c->of->truth[k - i].joint[joint]);
    return 1e3 * v3_length(v3_add(v3_sub(error[0], v3_scale(error[1], 2)), error[2]));
}

static double error_mm(const struct contender *c, int k)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += v3_distance(c->joints[k].joint[j], c->of->truth[k].joint[j]);
    return 1e3 * sum / JOINT_COUNT;
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct contender *c = self;
    const enum status status = item == 0 ? estimate(c) : OK; // a new round
    out->time_ms = c->frame_ms;
    if (status != OK)
        return status;
    out->error = error_mm(c, item);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const double e = v3_distance(c->joints[item].joint[j], c->of->truth[item].joint[j]);
        out->extra[0] += (e < 0.1) * 100.0 / JOINT_COUNT;
        out->extra[1] = fmax(out->extra[1], 1e3 * e);
        out->extra[2] += item < 2 ? 0 : jitter_mm(c, item, j) / JOINT_COUNT;
    }
    return c->found[item] ? OK : NOTHING;
}

// The instant at which the online estimate is farthest off.
static void draw_pictures(struct bench *b, const struct contender *c, const struct bench_contender *contenders,
                          size_t count)
{
    const struct smoothed_film *f = &c->of->film;
    const struct contender *online = c;
    for (size_t i = 0; i < count; i++)
        if (c[i].method == ONLINE)
            online = &c[i];
    int worst = 0;
    for (int k = 0; k < f->count; k++)
        if (error_mm(online, k) > error_mm(online, worst))
            worst = k;
    for (size_t i = 0; i < count; i++) {
        const struct skeleton_instant instant = {&f->calibration, f->depth[worst], &c->of->truth[worst],
                                                 &c[i].joints[worst]};
        char caption[100];
        snprintf(caption, sizeof caption, "%s: %.0f mm; white: the truth", contenders[i].name, error_mm(&c[i], worst));
        if (c[i].method != MEAN || c[i].window == WINDOW_MOST)
            bench_skeleton_picture(b, caption, &instant);
    }
}

static enum status run(struct bench *b)
{
    static const struct {
        const char *name;
        enum method method;
        int window;
    } methods[] = {
        {"smoothed", SMOOTHED, 0},      {"online", ONLINE, 0},          {"online, mean of 3", MEAN, 3},
        {"online, mean of 5", MEAN, 5}, {"online, mean of 9", MEAN, 9}, {"online, median of 5", MEDIAN, 5},
    };
    struct smoothing s = {0};
    struct contender c[COUNT_OF(methods)] = {{0}};
    struct bench_contender contenders[COUNT_OF(methods)];
    enum status status = film(&s, bench_count(b, FILMED, 0.5));
    const size_t n = (size_t)s.film.count + 1;
    for (size_t i = 0; i < COUNT_OF(methods); i++) {
        c[i] = (struct contender){.of = &s,
                                  .method = methods[i].method,
                                  .window = methods[i].window,
                                  .joints = calloc(n, sizeof *c->joints),
                                  .found = calloc(n, sizeof *c->found)};
        if (status == OK && (!c[i].joints || !c[i].found))
            status = fail(ERR_MEMORY, "no memory for the joints");
        contenders[i] = (struct bench_contender){methods[i].name, measure, &c[i],
                                                 methods[i].window == 5 && methods[i].method == MEAN};
    }
    if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), s.film.count);
    if (status == OK)
        draw_pictures(b, c, contenders, COUNT_OF(contenders));
    for (size_t i = 0; i < COUNT_OF(methods); i++) {
        free(c[i].joints);
        free(c[i].found);
    }
    smoothed_film_free(&s.film);
    free(s.truth);
    return status;
}

const struct bench_stage bench_stage_smoothing = {
    .name = "smoothing",
    .about = "16 joints once the take's end is known",
    .error_name = "mean_error_mm",
    .time_name = "time_ms",
    .extra_names = {"within_10cm_percent", "worst_joint_mm", "jitter_mm"},
    .run = run,
};
