// Where the actor is displayed, what a viewpoint adds, and how well movements compare, against the truth.
#include "tests/bench/bench_study.h"

#include "compare/comparison.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/bench/bench.h"

#include <math.h>
#include <stdlib.h>

struct bench_study bench_study;

enum { EYE_PX = 3, MANY_SIDES = 8, MOST = VIEWS_MAX * JOINT_COUNT };

// A take's skeletons in the world.
struct study_track {
    struct take_skeletons *skeletons;
    struct skeleton_track *track;
};

static enum status open_track(struct study_track *t, const struct take *take)
{
    *t = (struct study_track){0};
    enum status status = take_skeletons_open(&t->skeletons, take);
    return status == OK ? skeleton_track_open(&t->track, take, t->skeletons) : status;
}

static void close_track(struct study_track *t)
{
    skeleton_track_close(&t->track);
    take_skeletons_close(&t->skeletons);
}

// Displayed: our joints through the pose that the tablet believes. True: the true joints through its true pose.
static void measure_display(const struct views_data *d, const struct study_track *own, const struct study_track *truth)
{
    static double mm[MOST], px[MOST];
    int count = 0;
    for (int i = 0; i < d->count; i++) {
        const struct views_image *v = &d->image[i];
        struct track_sample ours, real;
        if (!v->placed || skeleton_track_at(own->track, v->since_ns, true, &ours) != OK ||
            skeleton_track_at(truth->track, v->since_ns, true, &real) != OK)
            continue;
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 shown = pose_apply(pose_inverse(v->found), ours.skeleton.joint[j]),
                              is = pose_apply(pose_inverse(v->truth), real.skeleton.joint[j]);
            if (!(ours.skeleton.confidence[j] > 0) || !(is.z > 0.1) || !(shown.z > 0.1))
                continue;
            const struct pixel a = lens_project(&d->lens, shown), b = lens_project(&d->lens, is);
            // In the room the tablet's own error moves the actor, too.
            mm[count] = 1e3 * v3_distance(pose_apply(v->truth, shown), real.skeleton.joint[j]);
            px[count++] = hypot(a.x - b.x, a.y - b.y);
        }
    }
    bench_study.room_mm = bench_percentile(mm, count, 0.5);
    bench_study.room_p95_mm = bench_percentile(mm, count, 0.95);
    bench_study.tablet_px = bench_percentile(px, count, 0.5);
    bench_study.tablet_p95_px = bench_percentile(px, count, 0.95);
}

// A joint at the middle of a circle of viewers: depth along the first one's axis, from rays that are off by EYE_PX
// each, by least squares; sides spread over half a circle. The standard deviation follows from the normal equations.
static double depth_sigma_m(const struct lens *lens, double distance_m, int sides)
{
    const double sigma_m = EYE_PX / lens->fx * distance_m;
    double zz = 0;
    for (int i = 0; i < sides; i++) { // a view at this angle measures the displacement across its own axis
        const double angle = sides > 1 ? 3.14159265358979323846 * i / sides : 0, across = sin(angle);
        zz += across * across / (sigma_m * sigma_m);
    }
    return zz > 0 ? sqrt(1 / zz) : INFINITY;
}

static void measure_viewpoints(const struct views_data *d, const struct study_track *own)
{
    double sum = 0, squares = 0, distance = 0;
    int count = 0;
    for (int i = 0; i < d->count; i++) {
        const struct views_image *v = &d->image[i];
        struct track_sample ours;
        if (skeleton_track_at(own->track, v->since_ns, true, &ours) != OK)
            continue;
        const struct vec3 waist = pose_apply(pose_inverse(v->truth), ours.skeleton.joint[JOINT_WAIST]);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const double z = pose_apply(pose_inverse(v->truth), ours.skeleton.joint[j]).z - waist.z;
            sum += z, squares += z * z, count++;
        }
        distance += waist.z / d->count;
    }
    // From one side a picture tells no depth: what remains is how far joints are spread along it.
    const double mean = sum / count;
    bench_study.one_side_mm = 1e3 * sqrt(fmax(0, squares / count - mean * mean));
    bench_study.two_sides_mm = 1e3 * depth_sigma_m(&d->lens, distance, 2);
    bench_study.many_sides_mm = 1e3 * depth_sigma_m(&d->lens, distance, MANY_SIDES);
}

static enum status movement_of(const struct take *take, struct movement *out)
{
    struct joint_samples s = {0};
    enum status status = OK;
    for (int64_t i = 0; i < take_frame_count(take) && status == OK; i++) {
        const struct take_entry *e = take_entry(take, i);
        struct joint_sample at = {.time_ns = e->time_ns, .skeleton = e->skeleton};
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 w = pose_apply(e->world_from_camera, e->skeleton.joint[j]);
            at.skeleton.joint[j] = v3(w.x, -w.z, w.y); // y down along gravity
            at.sigma_m[j] = default_sigma_m(e->skeleton.confidence[j]);
        }
        if (e->has_skeleton)
            status = joint_samples_add(&s, &at);
    }
    joint_samples_start_at_zero(&s);
    if (status == OK)
        status = movement_from_samples(&s, out);
    joint_samples_free(&s);
    return status;
}

static enum status measure_comparison(const struct views_data *d)
{
    struct movement own = {0}, truth = {0};
    struct comparison c = {0};
    enum status status = movement_of(d->own, &own);
    if (status == OK)
        status = movement_of(d->true_take, &truth);
    const int32_t frames = own.count < truth.count ? own.count : truth.count;
    double *deg = status == OK ? calloc((size_t)frames * PART_COUNT + 1, sizeof *deg) : NULL;
    int count = 0;
    for (int32_t f = 0; deg && f < frames; f++)
        for (int p = 0; p < PART_COUNT; p++) {
            const float *a = own.frames[f].direction[p], *b = truth.frames[f].direction[p];
            const double dot = (double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2];
            if (own.frames[f].known & truth.frames[f].known & 1u << p)
                deg[count++] = acos(fmin(1, fmax(-1, dot))) * 57.29577951308232;
        }
    if (deg) {
        bench_study.angle_deg = bench_percentile(deg, count, 0.5);
        bench_study.angle_p95_deg = bench_percentile(deg, count, 0.95);
        status = comparison_make(&truth, &own, NULL, &c);
        bench_study.score = status == OK ? c.score : NAN;
    }
    if (deg && status == OK)
        comparison_free(&c);
    free(deg);
    movement_free(&own);
    movement_free(&truth);
    return status;
}

enum status bench_study_measure(const struct views_data *data)
{
    struct study_track own, truth = {0};
    bench_study = (struct bench_study){0};
    enum status status = open_track(&own, data->own);
    if (status == OK)
        status = open_track(&truth, data->true_take);
    if (status == OK) {
        measure_display(data, &own, &truth);
        measure_viewpoints(data, &own);
        status = measure_comparison(data);
    }
    close_track(&own);
    close_track(&truth);
    bench_study.known = status == OK;
    return status;
}
