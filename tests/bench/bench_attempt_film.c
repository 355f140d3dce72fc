// A reference and an attempt at it, filmed, tracked and compared; and what the comparison says next to the truth.
#include "compare/findings.h"
#include "formats/joints_csv.h"
#include "platform/files/file.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_attempts.h"
#include "tests/support/smoothed_film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REFERENCE, ATTEMPT, ACTORS };
static const double DEGREES = 180 / 3.14159265358979323846;

// One of the two.
struct take {
    struct world *world;
    struct smoothed_film film;
    double first_s; // of the first frame with a person: a movement's times count from there
};

static void take_free(struct take *t)
{
    world_close(&t->world);
    smoothed_film_free(&t->film);
}

static enum status film(struct take *t, uint64_t noise_seed)
{
    t->film.calibration = world_calibration(0.5);
    const struct lens lens = t->film.calibration.depth;
    uint16_t *depth = calloc((size_t)lens.width * (size_t)lens.height, sizeof *depth);
    enum status status = depth ? OK : fail(ERR_MEMORY, "no memory for an image");
    const int count = (int)(world_seconds(t->world) * ATTEMPT_HZ);
    for (int k = 0; k < count && status == OK; k++) {
        const double time_s = (double)k / ATTEMPT_HZ;
        const struct world_shot shot = {lens, world_sensor_pose(t->world), time_s, true};
        status = world_render(t->world, &shot, &(struct world_image){.depth = depth});
        if (status == OK)
            status = world_depth_noise(&lens, depth, noise_seed + (uint64_t)k, depth);
        if (status == OK)
            status = smoothed_film_add(&t->film, (int64_t)llround(time_s * 1e9), depth);
    }
    free(depth);
    return status == OK ? smoothed_film_track(&t->film) : status;
}

static enum status take_make(const struct attempt_plan *plan, int actor, struct take *t)
{
    struct world_options options = attempt_world_options(plan, actor);
    struct world_edit edit = plan->edit;
    if (actor == REFERENCE)
        edit.kind = EDIT_NONE;
    options.edit = &edit;
    enum status status = world_open(&t->world, &options);
    return status == OK ? film(t, (plan->seed + 1) * 1000003 + 2000 * (uint64_t)plan->index + 1000 * (uint64_t)actor)
                        : status;
}

// As a take of a recording is read: compare/joint_samples.h.
static enum status movement_of(struct take *t, struct movement *out)
{
    struct joint_samples samples = {.sigma_given = true};
    enum status status = OK;
    for (int k = 0; k < t->film.count && status == OK; k++) {
        struct joint_sample s = {.time_ns = t->film.time_ns[k], .skeleton = t->film.smoothed[k]};
        if (!t->film.found[k])
            continue;
        for (int j = 0; j < JOINT_COUNT; j++)
            s.sigma_m[j] = sample_sigma_m(&s.skeleton, (enum joint)j);
        if (!samples.count)
            t->first_s = (double)s.time_ns * 1e-9;
        status = joint_samples_add(&samples, &s);
    }
    if (status == OK && !samples.count)
        status = fail(ERR_INPUT, "no person was tracked in a film of an attempt");
    if (status == OK) {
        joint_samples_start_at_zero(&samples);
        joint_samples_level(&samples);
        joint_samples_mend_sides(&samples);
        status = movement_from_samples(&samples, out);
    }
    joint_samples_free(&samples);
    return status;
}

// ---------------------------------------------------------------- the truth

// Directions of the parts in the person's upright frame: x to its left by the hips, y ahead, z up.
struct truth {
    struct vec3 direction[PART_COUNT];
};

static struct vec3 line(const struct skeleton *s, int from, int to)
{
    return v3_unit(v3_sub(s->joint[to], s->joint[from]));
}

static struct truth truth_of(const struct world *w, double time_s)
{
    const struct skeleton s = world_joints(w, time_s); // z up
    const struct vec3 hips = v3_sub(s.joint[JOINT_LEFT_HIP], s.joint[JOINT_RIGHT_HIP]);
    const struct vec3 left = v3_unit(v3(hips.x, hips.y, 0)), ahead = v3_cross(left, v3(0, 0, 1));
    struct truth t;
    for (int p = 0; p < PART_COUNT; p++) {
        const struct vec3 d = line(&s, part_ends[p].from, part_ends[p].to);
        t.direction[p] = v3(v3_dot(d, left), v3_dot(d, ahead), d.z);
    }
    return t;
}

static double degrees_between(struct vec3 a, struct vec3 b)
{
    return atan2(v3_length(v3_cross(a, b)), v3_dot(a, b)) * DEGREES;
}

// Of the fastest joint beside the waist, m/s.
static double speed_of(const struct world *w, double time_s)
{
    const double half_s = 0.5 / ATTEMPT_HZ;
    const struct skeleton a = world_joints(w, time_s - half_s), b = world_joints(w, time_s + half_s);
    double fastest = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        fastest = fmax(fastest,
                       v3_distance(v3_sub(a.joint[j], a.joint[JOINT_WAIST]), v3_sub(b.joint[j], b.joint[JOINT_WAIST])));
    return fastest * ATTEMPT_HZ;
}

// ---------------------------------------------------------------- frames

struct tally {
    double *time_error_s, *angle_error;
    int times, angles, parts, unknown, far, caught, near, alarms;
};

static void judge_frame(const struct comparison *c, const struct take take[ACTORS], const struct world_edit *e,
                        int frame, struct tally *t)
{
    const double time_s = frame / MOVEMENT_RATE_HZ + take[ATTEMPT].first_s;
    const double reference_s = world_edit_reference_s(e, time_s);
    if (!isfinite(reference_s) || time_s > world_edit_seconds(e))
        return;
    const double found_s = c->timeline.reference[frame] / MOVEMENT_RATE_HZ + take[REFERENCE].first_s;
    if (speed_of(take[REFERENCE].world, reference_s) > 0.3 && !isnan(found_s))
        t->time_error_s[t->times++] = fabs(found_s - reference_s);
    if (isnan(found_s))
        return;
    const struct truth a = truth_of(take[REFERENCE].world, reference_s), b = truth_of(take[ATTEMPT].world, time_s);
    struct part_difference said[PART_COUNT];
    part_differences(&c->a, &c->b, &c->timeline, frame, said);
    for (int p = 0; p < PART_COUNT; p++) {
        const double truly = degrees_between(a.direction[p], b.direction[p]);
        t->parts++;
        if (said[p].verdict == VERDICT_UNKNOWN || isnan(said[p].angle_rad)) {
            t->unknown++;
            continue;
        }
        t->angle_error[t->angles++] = fabs((double)said[p].angle_rad * DEGREES - truly);
        t->far += truly >= 15;
        t->caught += truly >= 15 && said[p].verdict == VERDICT_DIFFERENT;
        t->near += truly < 5;
        t->alarms += truly < 5 && said[p].verdict == VERDICT_DIFFERENT;
    }
}

static double ratio(int part, int whole) { return whole ? (double)part / whole : NAN; }

static enum status judge_frames(const struct comparison *c, const struct take take[ACTORS], const struct world_edit *e,
                                struct attempt_score *out)
{
    const size_t n = (size_t)c->timeline.count;
    struct tally t = {malloc(n * sizeof *t.time_error_s), malloc(n * PART_COUNT * sizeof *t.angle_error), .times = 0};
    enum status status = t.time_error_s && t.angle_error ? OK : fail(ERR_MEMORY, "no memory for the bench");
    for (int f = 0; f < c->timeline.count && status == OK; f++)
        judge_frame(c, take, e, f, &t);
    if (status == OK) {
        out->time_median_s = bench_percentile(t.time_error_s, t.times, 0.5);
        out->time_p95_s = bench_percentile(t.time_error_s, t.times, 0.95);
        out->angle_median = bench_percentile(t.angle_error, t.angles, 0.5);
        out->angle_p95 = bench_percentile(t.angle_error, t.angles, 0.95);
        out->unknown = ratio(t.unknown, t.parts);
        out->caught = ratio(t.caught, t.far);
        out->false_alarms = ratio(t.alarms, t.near);
    }
    free(t.time_error_s);
    free(t.angle_error);
    return status;
}

// ---------------------------------------------------------------- findings

static void judge_findings(const struct comparison *c, enum world_edit_kind kind, struct attempt_score *out)
{
    const struct finding *first = c->finding_count ? &c->findings[0] : NULL;
    bool posture = false, of_kind = false;
    for (int32_t k = 0; k < c->finding_count; k++) {
        const struct finding *f = &c->findings[k];
        posture = posture || (f->kind == FINDING_POSTURE && fabs(f->amount) > 10);
        of_kind = of_kind || (kind == EDIT_MISSING && f->kind == FINDING_MISSING) ||
                  (kind == EDIT_EXTRA && f->kind == FINDING_EXTRA) ||
                  (edit_is_timing(kind) && f->kind == FINDING_TIMING);
    }
    if (edit_is_posture(kind))
        out->first_right = first && edit_expects_part(kind, first->part);
    const bool judged = c->relation == RELATION_SAME;
    if (edit_is_timing(kind) || kind == EDIT_NONE)
        out->no_posture = !posture && judged;
    if (edit_is_timing(kind) || kind == EDIT_MISSING || kind == EDIT_EXTRA)
        out->kind_found = of_kind;
    out->mirrored_right = kind == EDIT_MIRRORED ? c->mirrored && judged : !c->mirrored;
    out->score = judged ? c->score : NAN;
    out->score_sigma = c->score_sigma;
    if (first)
        snprintf(out->first, sizeof out->first, "%s: %s", first->part, first->sentence);
}

// ---------------------------------------------------------------- joints-csv

static enum status write_joints(const struct take *t, const char *folder, int index, const char *which)
{
    char path[4096];
    enum status status = folder_make(folder);
    snprintf(path, sizeof path, "%s/%d_%s.csv", folder, index, which);
    FILE *file = status == OK ? fopen(path, "w") : NULL;
    if (!file)
        return status == OK ? fail(ERR_IO, "%s cannot be written", path) : status;
    joints_csv_begin(file, JOINTS_CSV_CAMERA);
    for (int k = 0; k < t->film.count; k++)
        if (t->film.found[k])
            joints_csv_add(file, t->film.time_ns[k], &t->film.smoothed[k]);
    return fclose(file) ? fail(ERR_IO, "%s could not be written", path) : OK;
}

enum status attempt_film(const struct attempt_plan *plan, const char *dump, struct attempt_score *out)
{
    static const char *const names[ACTORS] = {"reference", "attempt"};
    struct take take[ACTORS] = {{0}, {0}};
    struct movement movement[ACTORS] = {{0}, {0}};
    struct comparison c = {0};
    enum status status = OK;
    *out = (struct attempt_score){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, "no finding"};
    for (int k = 0; k < ACTORS && status == OK; k++) {
        status = take_make(plan, k, &take[k]);
        if (status == OK)
            status = movement_of(&take[k], &movement[k]);
        if (status == OK && dump)
            status = write_joints(&take[k], dump, plan->index, names[k]);
    }
    if (status == OK)
        status = comparison_make(&movement[REFERENCE], &movement[ATTEMPT], NULL, &c);
    // Of a mirror image another part belongs to each part.
    if (status == OK && plan->edit.kind != EDIT_MIRRORED)
        status = judge_frames(&c, take, &plan->edit, out);
    if (status == OK)
        judge_findings(&c, plan->edit.kind, out);
    comparison_free(&c);
    for (int k = 0; k < ACTORS; k++) {
        movement_free(&movement[k]);
        take_free(&take[k]);
    }
    return status;
}
