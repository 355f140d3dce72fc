#include "compare/joint_samples.h"

#include "base/portable_math.h"
#include "recording/take_floor.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- joint sides

// Left and right confused by a tracker for some frames: mended by the shortest way of the joints from frame to frame.

// One naming of both sides is right; the other exchanges these joints.
struct exchange {
    enum joint left[6], right[6];
    int count;
};

static const struct exchange exchanges[] = {
    {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
     {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
     6},
    {{JOINT_LEFT_ELBOW, JOINT_LEFT_HAND}, {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND}, 2},
    {{JOINT_LEFT_KNEE, JOINT_LEFT_FOOT}, {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}, 2},
};

static void exchange_sides(struct joint_sample *sample, const struct exchange *exchange)
{
    for (int k = 0; k < exchange->count; k++) {
        const enum joint l = exchange->left[k], r = exchange->right[k];
        const struct vec3 joint = sample->skeleton.joint[l];
        const float confidence = sample->skeleton.confidence[l], sigma = sample->sigma_m[l];
        sample->skeleton.joint[l] = sample->skeleton.joint[r];
        sample->skeleton.confidence[l] = sample->skeleton.confidence[r];
        sample->sigma_m[l] = sample->sigma_m[r];
        sample->skeleton.joint[r] = joint;
        sample->skeleton.confidence[r] = confidence;
        sample->sigma_m[r] = sigma;
    }
}

// How far the joints go from one frame to the next, m, under the same naming and under exchanged ones. The two are
// equal where a joint is unknown.
static void measure_paths(const struct joint_sample *from, const struct joint_sample *to,
                          const struct exchange *exchange, double way[2])
{
    way[0] = way[1] = 0;
    for (int k = 0; k < exchange->count; k++) {
        const enum joint l = exchange->left[k], r = exchange->right[k];
        const float *a = from->skeleton.confidence, *b = to->skeleton.confidence;
        if (!(a[l] > 0 && a[r] > 0 && b[l] > 0 && b[r] > 0))
            continue;
        const struct vec3 *p = from->skeleton.joint, *q = to->skeleton.joint;
        way[0] += v3_distance(p[l], q[l]) + v3_distance(p[r], q[r]);
        way[1] += v3_distance(p[l], q[r]) + v3_distance(p[r], q[l]);
    }
}

// An exchange is believed where it shortens the way by this, per joint: less than a pelvis' width, more than noise.
#define MIN_GAIN_M 0.06

static int64_t correct_swapped_sides(struct joint_samples *samples, const struct exchange *exchange, uint8_t *exchanged)
{
    int64_t changes = 0, count = 0;
    exchanged[0] = 0;
    for (int64_t i = 1; i < samples->count; i++) {
        double way[2];
        measure_paths(&samples->at[i - 1], &samples->at[i], exchange, way);
        const bool swap = samples->at[i].time_ns - samples->at[i - 1].time_ns < 200000000 &&
                          way[0] - way[1] > MIN_GAIN_M * 2 * exchange->count && way[1] < 0.6 * way[0];
        exchanged[i] = exchanged[i - 1] ^ swap;
        changes += swap;
        count += exchanged[i];
    }
    // A jump for good is a person who turned in a gap, or a tracker that lost them: then the majority is no guide.
    if (!changes || 5 * (2 * count > samples->count ? samples->count - count : count) > 2 * samples->count)
        return 0;
    const uint8_t wrong = 2 * count <= samples->count;
    int64_t changed = 0;
    for (int64_t i = 0; i < samples->count; i++)
        if (exchanged[i] == wrong) {
            exchange_sides(&samples->at[i], exchange);
            changed++;
        }
    return changed;
}

int64_t joint_samples_mend_sides(struct joint_samples *samples)
{
    uint8_t *exchanged = samples->count > 1 ? malloc((size_t)samples->count) : NULL;
    int64_t changed = 0;
    for (size_t i = 0; i < COUNT_OF(exchanges) && exchanged; i++)
        changed += correct_swapped_sides(samples, &exchanges[i], exchanged);
    free(exchanged);
    return changed;
}

// ---------------------------------------------------------------- joint samples

static const double MAX_TILT_RAD = 0.611; // 35 degrees: beyond, a person who lies would be set upright

void joint_note(struct joint_notes *notes, const char *format, ...)
{
    va_list arguments;
    if (notes->count == JOINT_NOTES_MAX)
        return;
    va_start(arguments, format);
    vsnprintf(notes->line[notes->count++], JOINT_NOTE_BYTES, format, arguments);
    va_end(arguments);
}

void joint_samples_free(struct joint_samples *samples)
{
    free(samples->at);
    *samples = (struct joint_samples){0};
}

float default_sigma_m(float confidence) { return confidence >= 0.75f ? 0.045f : 0.18f; }

float sample_sigma_m(const struct skeleton *skeleton, enum joint joint)
{
    const double sigma_m = joint_sigma_m(skeleton, joint);
    return sigma_m > 0 ? (float)sigma_m : default_sigma_m(skeleton->confidence[joint]);
}

// Clocks count from anywhere: a result that no 64 bits hold is the farthest one that they do.
static int64_t clamped_sum(int64_t a, int64_t b)
{
    int64_t sum;
    if (!__builtin_add_overflow(a, b, &sum))
        return sum;
    return a > 0 ? INT64_MAX : INT64_MIN;
}

static int64_t clamped_difference(int64_t a, int64_t b)
{
    int64_t difference;
    if (!__builtin_sub_overflow(a, b, &difference))
        return difference;
    return a > b ? INT64_MAX : INT64_MIN;
}

enum status joint_samples_add(struct joint_samples *s, const struct joint_sample *sample)
{
    int64_t time_ns = clamped_sum(sample->time_ns, s->offset_ns);
    if (s->count) {
        const int64_t last_ns = s->at[s->count - 1].time_ns, step_ns = clamped_difference(time_ns, last_ns);
        if (step_ns <= 0 && step_ns > -1000000000) {
            s->dropped++;
            return OK;
        }
        if (step_ns <= 0 || step_ns > 60000000000) {
            s->offset_ns = clamped_difference(last_ns + 33000000, sample->time_ns);
            s->jumps++;
            time_ns = last_ns + 33000000;
        }
    }
    if (s->count == s->capacity) {
        const int64_t capacity = s->capacity ? 2 * s->capacity : 1024;
        struct joint_sample *at = realloc(s->at, (size_t)capacity * sizeof *at);
        if (!at)
            return fail(ERR_MEMORY, "no memory for a movement's joints");
        s->at = at;
        s->capacity = capacity;
    }
    s->at[s->count] = *sample;
    s->at[s->count++].time_ns = time_ns;
    return OK;
}

void joint_samples_start_at_zero(struct joint_samples *samples)
{
    samples->began_ns = samples->count ? samples->at[0].time_ns : 0;
    for (int64_t i = samples->count - 1; i >= 0; i--)
        samples->at[i].time_ns -= samples->at[0].time_ns;
}

// ------------------------------------------------------------- takes

static struct vec3 level_from_world(struct vec3 w) { return v3(w.x, -w.z, w.y); }

static struct joint_sample sample_of(const struct take_entry *entry)
{
    struct joint_sample s = {.time_ns = entry->time_ns, .skeleton = entry->skeleton};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.sigma_m[j] = sample_sigma_m(&entry->skeleton, (enum joint)j);
        if (entry->located)
            s.skeleton.joint[j] = level_from_world(pose_apply(entry->world_from_camera, s.skeleton.joint[j]));
        if (!v3_finite(s.skeleton.joint[j]))
            s.skeleton.confidence[j] = 0;
    }
    return s;
}

bool take_frame_is_sample(const struct take *take, int64_t frame)
{
    const struct take_entry *entry = take_entry(take, frame);
    return entry->has_skeleton && (entry->located || !take_is_located(take));
}

int64_t take_first_sample(const struct take *take)
{
    for (int64_t i = 0; i < take_frame_count(take); i++)
        if (take_frame_is_sample(take, i))
            return i;
    return -1;
}

// After joint_samples_level(): nobody stood upright, or a sensor was tilted by more than that can be told from lying.
static void note_unknown_tilt(struct joint_samples *samples)
{
    struct vec3 mean;
    if (!joint_samples_standing(samples, &mean) || v3_dot(mean, v3(0, -1, 0)) < portable_cos(MAX_TILT_RAD))
        joint_note(&samples->notes, "how its sensor was tilted is not known: it has no place and no floor in sight, "
                                    "and no person stands upright "
                                    "for a second; it is taken as level, and where it was not, the score means little");
}

static void rotate_up(struct joint_samples *samples, struct vec3 up)
{
    const struct quat level = quat_between(up, v3(0, -1, 0));
    for (int64_t i = 0; i < samples->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            samples->at[i].skeleton.joint[j] = quat_rotate(level, samples->at[i].skeleton.joint[j]);
    samples->tilt_rad = portable_acos(fmin(1, fmax(-1, -up.y)));
}

// Of a take without a place, by the floor in its depth; without one by the person's standing.
static enum status level_take(struct take *take, struct joint_samples *samples)
{
    struct vec3 up;
    const enum status status = take_floor_up(take, &up);
    if (status == OK) {
        rotate_up(samples, up);
        samples->tilt_by_floor = true;
    } else if (status == NOTHING) {
        joint_samples_level(samples);
        note_unknown_tilt(samples);
    }
    return status == NOTHING ? OK : status;
}

static enum status read_take(struct take *take, const char *path, const char *name, struct joint_samples *out)
{
    enum status status = OK;
    out->sigma_given = true;
    for (int64_t i = 0; i < take_frame_count(take) && status == OK; i++) {
        if (!take_frame_is_sample(take, i))
            continue;
        const struct joint_sample sample = sample_of(take_entry(take, i));
        status = joint_samples_add(out, &sample);
    }
    if (status == OK && !out->count)
        status = fail(ERR_INPUT, "take '%s' of %s has no skeleton: no person was tracked in it", name, path);
    return status == OK && !take_is_located(take) ? level_take(take, out) : status;
}

enum status joint_samples_read_take(const char *path, const char *name, struct joint_samples *out)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    *out = (struct joint_samples){0};
    enum status status = recording_open(&r, path);
    if (status == OK && !name) {
        if (recording_take_count(r) == 1)
            name = recording_take_name(r, 0);
        else if (!recording_take_count(r))
            status = fail(ERR_INPUT, "%s holds no take; record one with reenact-capture record", path);
        else
            status =
                fail(ERR_INPUT, "%s holds %d takes; say which one, with --take or --with-take NAME ('%s' is the first)",
                     path, recording_take_count(r), recording_take_name(r, 0));
    }
    if (status == OK)
        status = take_open(&take, r, name);
    if (status == OK)
        status = read_take(take, path, name, out);
    take_close(&take);
    recording_free(&r);
    if (status == OK)
        joint_samples_start_at_zero(out);
    else
        joint_samples_free(out);
    return status;
}

// ------------------------------------------------------------- gravity from standing

// Longer ones are gaps.
static const double MAX_STEP_S = 0.2;

bool joint_samples_standing(const struct joint_samples *samples, struct vec3 *mean)
{
    struct vec3 sum = {0, 0, 0}, axis;
    double seconds = 0;
    for (int64_t i = 0; i + 1 < samples->count; i++) {
        const double step = (double)(samples->at[i + 1].time_ns - samples->at[i].time_ns) * 1e-9;
        if (step > MAX_STEP_S || !skeleton_standing_axis(&samples->at[i].skeleton, &axis))
            continue;
        sum = v3_add(sum, v3_scale(axis, step));
        seconds += step;
    }
    *mean = v3_unit(sum);
    return seconds >= 1 && v3_length(*mean) > 0;
}

void joint_samples_level(struct joint_samples *samples)
{
    const struct vec3 up = v3(0, -1, 0);
    struct vec3 mean;
    if (!joint_samples_standing(samples, &mean))
        return;
    const double tilt = portable_acos(fmin(1, fmax(-1, v3_dot(mean, up))));
    if (tilt < 0.0524 || tilt > MAX_TILT_RAD)
        return;
    rotate_up(samples, mean);
}
