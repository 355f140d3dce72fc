// Stage "skeleton" joint by joint on one person, next to truth from another body model: each joint's error, and the
// same with its constant part removed. Where a model places the knee within the leg is its author's choice, which no
// depth image shows; how it moves is not.
#include "tests/bench/bench_skeleton_data.h"
#include "tests/bench/bench_skeleton_trials.h"
#include "tests/support/body_axes.h"
#include "tests/support/smoothed_film.h"

#include <stdlib.h>

static const char *const columns[] = {"mean_mm",    "p95_mm",    "within_10cm_%", "aside_mm",    "down_mm",
                                      "forward_mm", "mean_less", "p95_less",      "within_less", "lost"};
enum { MEAN, P95, WITHIN, ASIDE, DOWN, FORWARD, MEAN_LESS, P95_LESS, WITHIN_LESS, LOST };

// Errors of one joint over the film, in the axes of the trunk or pelvis it belongs to: x to the person's left, y down,
// z forward.
struct joint_errors {
    struct vec3 *off;
    int count;
};

static struct vec3 constant_of(const struct joint_errors *of)
{
    struct vec3 mean = v3(0, 0, 0);
    for (int f = 0; f < of->count; f++)
        mean = v3_add(mean, v3_scale(of->off[f], 1.0 / of->count));
    return mean;
}

struct joint_summary {
    double mean_mm, p95_mm, within; // within: percent within 10 cm
};

// Over `count` joints together; less: with the constant part of each removed.
static struct joint_summary sum_up(const struct joint_errors *of, int count, bool less, double *scratch)
{
    int used = 0, close = 0;
    double sum = 0;
    for (int j = 0; j < count; j++) {
        const struct vec3 constant = less ? constant_of(&of[j]) : v3(0, 0, 0);
        for (int f = 0; f < of[j].count; f++) {
            const double e = v3_distance(of[j].off[f], constant);
            close += e < 0.1;
            sum += e;
            scratch[used++] = e;
        }
    }
    const double p95_mm = 1000 * bench_percentile(scratch, used, 0.95);
    return (struct joint_summary){1000 * sum / used, p95_mm, 100.0 * close / used};
}

static enum status add_row(struct bench *b, const char *name, const struct joint_errors *of, int count, int frames,
                           double *scratch)
{
    double v[COUNT_OF(columns)];
    const struct vec3 constant = constant_of(of);
    const double none = count > 1 ? NAN : 1000; // over different joints the mean of these says nothing
    v[ASIDE] = none * constant.x, v[DOWN] = none * constant.y, v[FORWARD] = none * constant.z;
    const struct joint_summary all = sum_up(of, count, false, scratch), less = sum_up(of, count, true, scratch);
    v[MEAN] = all.mean_mm, v[P95] = all.p95_mm, v[WITHIN] = all.within;
    v[MEAN_LESS] = less.mean_mm, v[P95_LESS] = less.p95_mm, v[WITHIN_LESS] = less.within;
    v[LOST] = frames - of->count;
    return bench_add_row(b, name, v);
}

static enum status compare(struct bench *b, const struct skeleton_data *data, const struct smoothed_film *film)
{
    struct joint_errors of[JOINT_COUNT] = {{0}};
    const size_t frames = (size_t)data->count;
    struct vec3 *off = malloc(frames * JOINT_COUNT * sizeof *off);
    double *scratch = malloc(frames * JOINT_COUNT * sizeof *scratch);
    enum status status = off && scratch ? OK : fail(ERR_MEMORY, "no memory for the bench");
    for (int j = 0; j < JOINT_COUNT && status == OK; j++) {
        of[j].off = off + (size_t)j * frames;
        for (int f = 0; f < data->count; f++)
            if (film->found[f]) {
                const struct skeleton *truth = &data->frame[f].truth;
                of[j].off[of[j].count++] =
                    in_body_axes(truth, (enum joint)j, v3_sub(film->smoothed[f].joint[j], truth->joint[j]));
            }
    }
    if (status == OK && !of[0].count)
        status = fail(ERR_INPUT, "no person was found in these images");
    bench_columns(b, columns, COUNT_OF(columns));
    for (int j = 0; j < JOINT_COUNT && status == OK; j++)
        status = add_row(b, joint_name((enum joint)j), &of[j], 1, data->count, scratch);
    if (status == OK)
        status = add_row(b, "all", of, JOINT_COUNT, data->count, scratch);
    free(off);
    free(scratch);
    return status;
}

enum status trial_joints(struct bench *b, const char *folder)
{
    struct skeleton_data data;
    struct smoothed_film film = {0};
    enum status status = skeleton_data_open(&data, folder, 0);
    film.calibration = data.calibration;
    for (int f = 0; f < data.count && status == OK; f++)
        status = smoothed_film_add(&film, data.frame[f].time_ns, data.frame[f].depth);
    if (status == OK)
        status = smoothed_film_track(&film);
    if (status == OK)
        status = compare(b, &data, &film);
    smoothed_film_free(&film);
    skeleton_data_close(&data);
    return status;
}
