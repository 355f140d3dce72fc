// Stage "prepare": how long preparing a take of a minute takes, step by step: processor time of all threads, wall-clock
// time, and the program's peak memory by then. The images are played forward and backward until the minute is full, and
// recorded without a place. The result of a second run must be identical.
#include "base/clock.h"
#include "reenact/avatar/avatar.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_record.h"
#include "tests/support/film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

enum { MOST = 4000, FILMED = 120 };
static const double MINUTE_S = 60;

static const char *const step_names[AVATAR_STEPS] = {
    [AVATAR_TSDF_FROM_JOINTS] = "decode, TSDF from joints",
    [AVATAR_SILHOUETTES_FROM_JOINTS] = "silhouettes",
    [AVATAR_TSDF_ALIGNED] = "ICP, TSDF",
    [AVATAR_SILHOUETTES_ALIGNED] = "silhouettes",
    [AVATAR_ROTATION_SEED] = "axial rotation, seed",
    [AVATAR_ROTATION_TRACK] = "axial rotation, track",
    [AVATAR_ROTATION_MEASURE] = "axial rotation, measure",
    [AVATAR_TSDF_FINAL] = "ICP, final TSDF",
    [AVATAR_SILHOUETTES_FINAL] = "final silhouettes",
    [AVATAR_COLOR_SAMPLES] = "deform, sample colours",
    [AVATAR_SURFACE] = "mesh",
    [AVATAR_VERTEX_COLORS] = "irradiance and albedo",
    [AVATAR_ATLAS] = "texture atlas",
};

struct time_entry {
    double seconds;
    char file[256];
};

struct time_list {
    struct time_entry entry[MOST];
    int count;
};

static enum status read_list(const char *folder, const char *name, struct time_list *out)
{
    char path[8192], line[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *from = fopen(path, "r");
    if (!from)
        return fail(ERR_MISSING, "%s cannot be read", path);
    out->count = 0;
    while (out->count < MOST && fgets(line, sizeof line, from)) {
        struct time_entry *e = &out->entry[out->count];
        out->count += sscanf(line, "%lf %255s", &e->seconds, e->file) == 2;
    }
    fclose(from);
    return out->count > 1 ? OK : fail(ERR_INPUT, "%s lists too few images", path);
}

// start, end: the part that is played forward and backward, seconds.
static enum status write_list(const struct scratch *scratch, const char *name, const struct time_list *list,
                              double start, double end)
{
    FILE *to = fopen(scratch_file(scratch, name), "w");
    if (!to)
        return fail(ERR_IO, "%s cannot be written", name);
    for (double from = 0; from < MINUTE_S; from += 2 * (end - start))
        for (int i = 0; i < 2 * list->count - 1; i++) {
            bool back = i >= list->count;
            const struct time_entry *e = &list->entry[back ? 2 * list->count - 1 - i : i];
            double since = from + (back ? 2 * end - e->seconds : e->seconds) - start;
            if (since < MINUTE_S)
                fprintf(to, "%.6f %s\n", start + since, e->file);
        }
    return fclose(to) ? fail(ERR_IO, "%s cannot be written", name) : OK;
}

static enum status stretch_to_minute(const struct scratch *scratch, const char *folder)
{
    static struct time_list color, depth;
    static const char *const links[] = {"rgb", "depth", "calibration.json"};
    char path[8192], *whole = realpath(folder, NULL);
    enum status status = read_list(folder, "rgb.txt", &color);
    if (status == OK)
        status = read_list(folder, "depth.txt", &depth);
    for (size_t i = 0; i < COUNT_OF(links) && status == OK; i++) {
        snprintf(path, sizeof path, "%s/%s", whole ? whole : folder, links[i]);
        if (symlink(path, scratch_file(scratch, links[i])))
            status = fail(ERR_IO, "%s cannot be linked to", path);
    }
    free(whole);
    if (status != OK)
        return status;
    double start = fmin(color.entry[0].seconds, depth.entry[0].seconds);
    double last = fmax(color.entry[color.count - 1].seconds, depth.entry[depth.count - 1].seconds);
    double end = last + (last - start) / (2 * color.count); // half a frame later
    status = write_list(scratch, "rgb.txt", &color, start, end);
    return status == OK ? write_list(scratch, "depth.txt", &depth, start, end) : status;
}

static enum status record(const struct scratch *scratch, const char *folder, const char *file)
{
    char uri[300];
    enum status status = stretch_to_minute(scratch, folder);
    snprintf(uri, sizeof uri, "folder:%s", scratch->path);
    return status == OK ? bench_record(uri, file) : status;
}

// ------------------------------------------------------------- measuring

struct usage {
    double cpu_s, clock_s, memory_mib;
};

struct step_usage {
    struct usage began[AVATAR_STEPS];
    bool known[AVATAR_STEPS];
};

static struct usage now(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (struct usage){bench_all_threads_ms() / 1000, (double)clock_now_ns() * 1e-9, (double)usage.ru_maxrss / 1024};
}

static bool report_progress(void *self, double share)
{
    (void)self;
    return share <= 1;
}

static void note_step(void *self, int step)
{
    struct step_usage *s = self;
    s->began[step] = now();
    s->known[step] = true;
}

static enum status print_times(struct bench *b, const char *name, const struct usage *from, const struct usage *to)
{
    return bench_add_row(b, name, (double[]){to->cpu_s - from->cpu_s, to->clock_s - from->clock_s, to->memory_mib});
}

static enum status print_steps(struct bench *b, const struct step_usage *s, const struct usage *begun,
                               const struct usage *ended)
{
    static const enum avatar_step order[] = {AVATAR_TSDF_FROM_JOINTS,
                                             AVATAR_SILHOUETTES_FROM_JOINTS,
                                             AVATAR_TSDF_ALIGNED,
                                             AVATAR_SILHOUETTES_ALIGNED,
                                             AVATAR_ROTATION_SEED,
                                             AVATAR_ROTATION_TRACK,
                                             AVATAR_ROTATION_MEASURE,
                                             AVATAR_TSDF_FINAL,
                                             AVATAR_SILHOUETTES_FINAL,
                                             AVATAR_SURFACE,
                                             AVATAR_COLOR_SAMPLES,
                                             AVATAR_VERTEX_COLORS,
                                             AVATAR_ATLAS};
    enum status status = print_times(b, "skeleton track", begun, &s->began[order[0]]);
    for (size_t i = 0; i < COUNT_OF(order) && status == OK; i++) {
        assert(s->known[order[i]]);
        const struct usage *to = i + 1 < COUNT_OF(order) ? &s->began[order[i + 1]] : ended;
        status = print_times(b, step_names[order[i]], &s->began[order[i]], to);
    }
    return status == OK ? print_times(b, "total", begun, ended) : status;
}

static bool same_avatar(const struct avatar *a, const struct avatar *b)
{
    size_t points = (size_t)a->surface.point_count;
    return a->surface.point_count == b->surface.point_count && a->frame_count == b->frame_count &&
           !memcmp(a->surface.points, b->surface.points, sizeof *a->surface.points * points) &&
           !memcmp(a->vertex_colors.color, b->vertex_colors.color, sizeof *a->vertex_colors.color * points) &&
           !memcmp(a->frame_corrections, b->frame_corrections, sizeof *a->frame_corrections * (size_t)a->frame_count);
}

static enum status measure(struct bench *b, struct take *take)
{
    static const char *const columns[] = {"cpu_s", "clock_s", "memory_mib"};
    struct source_rays *rays = NULL;
    struct avatar one = {0}, other = {0};
    struct step_usage steps = {0};
    const struct progress_watch watch = {.on_progress = report_progress, .self = &steps, .on_step = note_step};
    bench_columns(b, columns, COUNT_OF(columns));
    enum status status = source_rays_open(&rays, take_calibration(take));
    struct usage begun = now();
    if (status == OK)
        status = avatar_make(&one, take, rays,
                             &(struct avatar_options){.max_frames = AVATAR_FRAMES, .threads = 4, .watch = &watch});
    struct usage ended = now();
    if (status == OK)
        status = print_steps(b, &steps, &begun, &ended);
    if (status == OK)
        status = avatar_make(&other, take, rays, &(struct avatar_options){.max_frames = AVATAR_FRAMES, .threads = 4});
    if (status == OK && !same_avatar(&one, &other))
        status = fail(ERR_INPUT, "preparing the take again gave another avatar");
    avatar_free(&one);
    avatar_free(&other);
    source_rays_close(&rays);
    return status;
}

static enum status run(struct bench *b)
{
    struct scratch scratch = scratch_make(), film = scratch_make();
    struct recording *recording = NULL;
    struct take *take = NULL;
    char folder[4096], file[300];
    enum status status = OK;
    snprintf(folder, sizeof folder, "%s", bench_inputs(b)->data ? bench_inputs(b)->data : "");
    if (!bench_inputs(b)->data) {
        struct world_options options = world_default_options();
        struct world *world = NULL;
        status = world_open(&world, &options);
        if (status == OK)
            film_sensor(world, &film, "sensor", 1, 0, FILMED);
        world_close(&world);
        snprintf(folder, sizeof folder, "%s/sensor", film.path);
    }
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "minute.reenact"));
    if (status == OK)
        status = record(&scratch, folder, file);
    if (status == OK)
        status = recording_open(&recording, file);
    if (status == OK)
        status = take_open(&take, recording, "take");
    if (status == OK)
        status = measure(b, take);
    take_close(&take);
    recording_free(&recording);
    scratch_remove(&scratch);
    scratch_remove(&film);
    return status;
}

const struct bench_stage bench_stage_prepare = {
    "prepare", "preparing a take of one minute, step by step", NULL, NULL, {NULL}, run};
