#include "tests/bench/bench_growth_take.h"

#include "recording/recording.h"
#include "reenact/render/actor_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/bench/bench_look.h"
#include "tests/support/gpu_finish.h"
#include "tests/support/limbs.h"
#include "tests/support/rehearsed.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <unistd.h>

static void add_point(struct bench_curve *c, double size, double value)
{
    if (c->count < BENCH_SIZES) {
        c->size[c->count] = size;
        c->value[c->count++] = value;
    }
}

// Skeletons without images: what grows with the length and is read in one go.
static enum status write_take(const char *path, int frames)
{
    const struct calibration calibration = {
        .color = {.width = 64, .height = 48, .fx = 52, .fy = 52, .cx = 31.5, .cy = 23.5},
        .color_from_depth = POSE_IDENTITY};
    struct rng rng = {5};
    const struct limbs limbs = limbs_random(&rng);
    struct recording_writer *w = NULL;
    enum status status = recording_create(&w, path);
    if (status == OK)
        status = recording_begin_take(w, "a", &calibration);
    for (int i = 0; i < frames && status == OK; i++) {
        const struct take_frame f = {.time_ns = i * INT64_C(33333333),
                                     .world_from_camera = POSE_IDENTITY,
                                     .has_skeleton = true,
                                     .skeleton = limbs_at(&limbs, i / 30.0, 0.01, &rng)};
        status = recording_add_frame(w, &f);
    }
    if (status == OK)
        status = recording_end_take(w);
    const enum status closed = recording_close(&w);
    return status == OK ? closed : status;
}

static enum status grow_take(const char *path, int frames, struct bench_curve time[BENCH_TAKE_CURVES],
                             struct bench_curve *index_bytes)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct take_skeletons *skeletons = NULL;
    double from_ms = bench_all_threads_ms();
    enum status status = write_take(path, frames);
    add_point(&time[0], frames, bench_all_threads_ms() - from_ms);
    from_ms = bench_all_threads_ms();
    if (status == OK)
        status = recording_open(&r, path);
    if (status == OK)
        status = take_open(&take, r, "a");
    add_point(&time[1], frames, bench_all_threads_ms() - from_ms);
    from_ms = bench_all_threads_ms();
    if (status == OK)
        status = take_skeletons_open(&skeletons, take);
    add_point(&time[2], frames, bench_all_threads_ms() - from_ms);
    if (status == OK)
        add_point(index_bytes, frames, (double)sizeof(struct take_entry) * (double)take_frame_count(take));
    take_skeletons_close(&skeletons);
    take_close(&take);
    recording_free(&r);
    unlink(path);
    return status;
}

static double resident_bytes(void)
{
    long pages = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file && fscanf(file, "%ld %ld", &pages, &resident) != 2)
        resident = 0;
    if (file)
        fclose(file);
    return (double)resident * (double)sysconf(_SC_PAGESIZE);
}

static enum status watch(struct bench_curve *bytes)
{
    static const int sizes[] = {50, 100, 200, 400};
    const struct lens lens = {.width = 320, .height = 200, .fx = 250, .fy = 250, .cx = 159.5, .cy = 99.5};
    struct rehearsed rehearsed;
    struct gpu *gpu = NULL;
    struct renderer *renderer = NULL;
    struct renderer_options options = renderer_default_options();
    int drawn = 0;
    enum status status = rehearsed_open(&rehearsed, 30);
    if (status == OK)
        status = gpu_open(&gpu);
    if (status == OK)
        status = renderer_open(&renderer, gpu, rehearsed.take, &lens, &options);
    for (size_t k = 0; k < COUNT_OF(sizes) && status == OK; k++) {
        for (; drawn < sizes[k] && status == OK; drawn++) {
            const int64_t frame = drawn % take_frame_count(rehearsed.take);
            const struct renderer_view view = {
                .world_from_camera = rehearsed_orbit_pose(&rehearsed, frame, drawn * 0.1),
                .time_ns = take_entry(rehearsed.take, frame)->time_ns - take_entry(rehearsed.take, 0)->time_ns};
            struct renderer_result result;
            status = renderer_draw(renderer, &view, &result);
            if (status == OK)
                status = gpu_finish(gpu);
        }
        add_point(bytes, drawn, resident_bytes());
    }
    renderer_close(&renderer);
    gpu_close(&gpu);
    rehearsed_close(&rehearsed);
    return status;
}

enum status bench_grow_takes(struct bench_curve time[BENCH_TAKE_CURVES], struct bench_curve *index_bytes,
                             struct bench_curve *watching_bytes)
{
    static const int sizes[] = {300, 1800, 10800, 54000, 108000}; // 10 s to 1 h
    struct scratch scratch = scratch_make();
    enum status status = OK;
    for (size_t k = 0; k < COUNT_OF(sizes) && status == OK; k++)
        status = grow_take(scratch_file(&scratch, "growth.reenact"), sizes[k], time, index_bytes);
    scratch_remove(&scratch);
    return status == OK ? watch(watching_bytes) : status;
}
