// Stage "skeleton" on figures rendered in the small world: by motion and by body.
#include "tests/bench/bench_skeleton_trials.h"
#include "tests/support/smoothed_film.h"
#include "tests/world/world.h"

#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FPS = 30, SECONDS_MAX = 8, FRAMES_MOST = FPS * SECONDS_MAX };

static const char *const columns[] = {"mean_mm", "p95_mm",  "in_10cm_%", "claimed_%",
                                      "swapped", "step_mm", "frames",    "lost"};
enum { MEAN, P95, WITHIN, CLAIMED, SWAPPED, STEP, FRAMES, LOST };

// The result on a take: errors of the joints that are claimed (confidence above 0).
struct joint_tally {
    double error_m[FRAMES_MOST * JOINT_COUNT];
    int claimed, frames, lost, swapped, within;
    double step_m;
};

// A pair of joints that fits the truth far better with left and right swapped.
static bool is_swapped(const struct skeleton *got, const struct skeleton *truth)
{
    static const enum joint pair[4][2] = {{JOINT_LEFT_HAND, JOINT_RIGHT_HAND},
                                          {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT},
                                          {JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},
                                          {JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW}};
    for (int k = 0; k < 4; k++) {
        enum joint l = pair[k][0], r = pair[k][1];
        if (!(got->confidence[l] > 0 && got->confidence[r] > 0 && v3_distance(truth->joint[l], truth->joint[r]) > 0.2))
            continue;
        double keep = v3_distance(got->joint[l], truth->joint[l]) + v3_distance(got->joint[r], truth->joint[r]),
               cross = v3_distance(got->joint[l], truth->joint[r]) + v3_distance(got->joint[r], truth->joint[l]);
        if (cross < 0.5 * keep)
            return true;
    }
    return false;
}

static void add_frame(struct joint_tally *t, const struct skeleton *got, const struct skeleton *truth,
                      const struct skeleton *before)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(got->confidence[j] > 0))
            continue;
        double e = v3_distance(got->joint[j], truth->joint[j]);
        t->error_m[t->claimed++] = e;
        t->within += e < 0.1;
        if (before->confidence[j] > 0)
            t->step_m = fmax(t->step_m, v3_distance(got->joint[j], before->joint[j]));
    }
    t->swapped += is_swapped(got, truth);
}

static enum status film(const struct world *w, struct pose from, struct smoothed_film *f, struct skeleton *truth)
{
    struct lens lens = f->calibration.depth;
    uint16_t *depth = calloc((size_t)lens.width * (size_t)lens.height, sizeof *depth);
    enum status status = depth ? OK : fail(ERR_MEMORY, "no memory for an image");
    int count = (int)fmin(FRAMES_MOST, world_seconds(w) * FPS);
    for (int k = 0; k < count && status == OK; k++) {
        double time_s = (double)k / FPS;
        struct world_shot shot = {lens, from, time_s, true};
        truth[k] = world_joints_in_camera(w, time_s, from);
        status = world_render(w, &shot, &(struct world_image){.depth = depth});
        if (status == OK)
            status = world_depth_noise(&lens, depth, (uint64_t)k, depth);
        if (status == OK)
            status = smoothed_film_add(f, (int64_t)llround(time_s * 1e9), depth);
    }
    free(depth);
    return status;
}

static void tally_up(const struct smoothed_film *f, const struct skeleton *got, const struct skeleton *truth,
                     struct joint_tally *t)
{
    static const struct skeleton none;
    *t = (struct joint_tally){.frames = f->count};
    for (int k = 0; k < f->count; k++) {
        t->lost += !f->found[k];
        if (f->found[k])
            add_frame(t, &got[k], &truth[k], k ? &got[k - 1] : &none);
    }
}

// Adds the row and its share of the average.
static enum status add_row(struct bench *b, const char *name, struct joint_tally *t, double sum[BENCH_COLUMNS])
{
    double mean = 0, all = fmax(1, t->frames * JOINT_COUNT);
    for (int i = 0; i < t->claimed; i++)
        mean += t->error_m[i] / t->claimed;
    double value[COUNT_OF(columns)] = {
        [MEAN] = t->claimed ? 1000 * mean : NAN,
        [P95] = 1000 * bench_percentile(t->error_m, t->claimed, 0.95),
        [WITHIN] = 100 * t->within / all,
        [CLAIMED] = 100 * t->claimed / all,
        [SWAPPED] = t->swapped,
        [STEP] = 1000 * t->step_m,
        [FRAMES] = t->frames,
        [LOST] = t->lost,
    };
    for (size_t k = 0; k < COUNT_OF(columns); k++)
        sum[k] += value[k];
    return bench_add_row(b, name, value);
}

enum { SMOOTHED, ONLINE, KINDS }; // from the whole take, and from the past only
struct sums {
    double of[KINDS][BENCH_COLUMNS];
};

// One film: a row for each kind.
static enum status add_film(struct bench *b, const struct world *w, struct pose from, const char *name,
                            struct joint_tally *t, struct sums *sums)
{
    struct smoothed_film f = {.calibration = world_calibration(0.5)};
    struct skeleton *truth = calloc(FRAMES_MOST, sizeof *truth);
    char online[320];
    snprintf(online, sizeof online, "%s, online", name);
    enum status status = truth ? film(w, from, &f, truth) : fail(ERR_MEMORY, "no memory for the truth");
    if (status == OK)
        status = smoothed_film_track(&f);
    for (int kind = 0; kind < KINDS && status == OK; kind++) {
        tally_up(&f, kind == ONLINE ? f.online : f.smoothed, truth, t);
        status = add_row(b, kind == ONLINE ? online : name, t, sums->of[kind]);
    }
    smoothed_film_free(&f);
    free(truth);
    return status;
}

static enum status add_averages(struct bench *b, const struct sums *sums, size_t count)
{
    enum status status = OK;
    for (int kind = 0; kind < KINDS && status == OK; kind++) {
        double value[COUNT_OF(columns)];
        for (size_t k = 0; k < COUNT_OF(columns); k++)
            value[k] = sums->of[kind][k] / (double)count;
        status = bench_add_row(b, kind == ONLINE ? "average, online" : "average", value);
    }
    return status;
}

// From the front, or from the figure's left by this angle, at the same distance from the room's middle.
static struct pose seen_from(const struct world *w, double aside_degrees)
{
    double half = aside_degrees * 3.14159265358979323846 / 360;
    return pose_multiply((struct pose){{0, 0, sin(half), cos(half)}, {0, 0, 0}}, world_sensor_pose(w));
}

enum status trial_motions(struct bench *b, const char *folder)
{
    char pattern[4096], name[300];
    glob_t files;
    snprintf(pattern, sizeof pattern, "%s/*.bvh", folder);
    if (glob(pattern, 0, NULL, &files) || !files.gl_pathc)
        return fail(ERR_MISSING, "%s: no BVH file is there", folder);
    struct sums sums = {0};
    struct joint_tally *t = malloc(sizeof *t);
    enum status status = t ? OK : fail(ERR_MEMORY, "no memory for the bench");
    bench_columns(b, columns, COUNT_OF(columns));
    for (size_t i = 0; i < 2 * files.gl_pathc && status == OK; i++) {
        double aside = i % 2 ? 45 : 0;
        const char *path = files.gl_pathv[i / 2], *slash = strrchr(path, '/');
        struct world_options options = world_default_options();
        struct world *w;
        options.plain = true;
        options.motion = path;
        status = world_open(&w, &options);
        snprintf(name, sizeof name, "%.200s, %g degrees", slash ? slash + 1 : path, aside);
        if (status == OK)
            status = add_film(b, w, seen_from(w, aside), name, t, &sums);
        world_close(&w);
    }
    if (status == OK)
        status = add_averages(b, &sums, 2 * files.gl_pathc);
    globfree(&files);
    free(t);
    return status;
}

enum status trial_bodies(struct bench *b)
{
    static const struct {
        const char *name;
        struct world_figure figure;
    } bodies[] = {
        {"child of 1.2 m", {1.20, 0.40, false, CLOTHES_TROUSERS, 2, 4}},
        {"adult of 1.95 m", {1.95, 0.35, false, CLOTHES_TROUSERS, 4, 90}},
        {"thin", {1.75, 0, false, CLOTHES_TROUSERS, 1, 23}},
        {"heavy", {1.75, 1, false, CLOTHES_TROUSERS, 3, 58}},
        {"skirt", {1.65, 0.30, true, CLOTHES_SKIRT, 4, 12}},
        {"coat", {1.78, 0.40, true, CLOTHES_COAT, 3, 31}},
    };
    static const char *const motions[] = {"pirouette", "kata"};
    char name[64];
    struct sums sums = {0};
    struct joint_tally *t = malloc(sizeof *t);
    enum status status = t ? OK : fail(ERR_MEMORY, "no memory for the bench");
    bench_columns(b, columns, COUNT_OF(columns));
    for (size_t i = 0; i < COUNT_OF(bodies) * COUNT_OF(motions) && status == OK; i++) {
        struct world_options options = world_default_options();
        struct world *w;
        options.plain = true;
        options.figure = bodies[i / COUNT_OF(motions)].figure;
        options.motion = motions[i % COUNT_OF(motions)];
        status = world_open(&w, &options);
        snprintf(name, sizeof name, "%s, %s", bodies[i / COUNT_OF(motions)].name, options.motion);
        if (status == OK)
            status = add_film(b, w, world_sensor_pose(w), name, t, &sums);
        world_close(&w);
    }
    if (status == OK)
        status = add_averages(b, &sums, COUNT_OF(bodies) * COUNT_OF(motions));
    free(t);
    return status;
}
