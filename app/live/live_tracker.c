#include "app/live/live_tracker.h"

#include "base/clock.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    SECOND_EVERY = 5, // frames from one look for a second person to the next; chosen by hand
    SECOND_LOOKS = 4, // looks in a row that must show one: an arm that is raised may seem one for half a second
    STEPS_MAX = 8     // of the judge for one frame of a slow sensor
};
static const double UNKNOWN_HEIGHT_M = 1;

struct live_tracker {
    struct calibration calibration;
    const struct movement *reference, *mirrored;
    struct follower *follower;
    struct live_judge *judge;   // NULL: no reference
    bool holds_world, is_level; // live_tracker_hold_world; the last frame's world was `level`, not the place
    struct pose level;
    struct live_shown shown;
    int64_t frames, last_ns; // last_ns: of the last judged frame
    bool has_last;
    int second_looks;
};

enum status live_tracker_open(struct live_tracker **out, const struct live_tracker_options *options)
{
    *out = NULL;
    struct live_tracker *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory to track a person");
    t->calibration = *options->calibration;
    t->reference = options->reference;
    t->mirrored = options->mirrored;
    t->shown.end = t->reference ? t->reference->count : 0;
    struct follower_options follow = follower_default_options();
    follow.place = options->place;
    follow.finds_points = options->finds_points;
    enum status status = follower_open(&t->follower, &t->calibration, &follow);
    if (status == OK && t->reference)
        status = live_judge_open(&t->judge, t->reference);
    if (status != OK)
        live_tracker_close(&t);
    *out = t;
    return status;
}

void live_tracker_close(struct live_tracker **tracker)
{
    if (!*tracker)
        return;
    follower_close(&(*tracker)->follower);
    live_judge_close(&(*tracker)->judge);
    free(*tracker);
    *tracker = NULL;
}

void live_tracker_show(struct live_tracker *tracker, const struct live_shown *shown)
{
    tracker->shown = *shown;
    if (!tracker->judge)
        return;
    const bool mirrored = shown->mirrored && tracker->mirrored;
    live_judge_set_reference(tracker->judge, mirrored ? tracker->mirrored : tracker->reference);
    const struct expectation expected = mirrored ? expectation_mirror(&shown->expected) : shown->expected;
    live_judge_set_expectation(tracker->judge, &expected);
    live_judge_set_window(tracker->judge, shown->first, shown->end);
}

void live_tracker_restart_judge(struct live_tracker *tracker)
{
    if (tracker->judge)
        live_judge_restart(tracker->judge);
    tracker->has_last = false;
}

void live_tracker_hold_world(struct live_tracker *tracker, bool hold) { tracker->holds_world = hold; }

void live_tracker_reset(struct live_tracker *tracker)
{
    follower_reset(tracker->follower);
    tracker->second_looks = 0;
    live_tracker_restart_judge(tracker);
}

// ---------------------------------------------------------------- where the sensor is

// The world of a sensor that is in no place: level, on the floor below the sensor.
static struct pose level_pose(const struct live_tracker *tracker)
{
    struct vec3 up;
    double height_m;
    if (!tracker_floor(follower_tracker(tracker->follower), &up, &height_m))
        height_m = UNKNOWN_HEIGHT_M;
    const struct vec3 z = v3_unit(quat_rotate(tracker->calibration.color_from_depth.rotation, up)), ahead = v3(0, 0, 1);
    const struct vec3 y = v3_unit(v3_sub(ahead, v3_scale(z, v3_dot(z, ahead)))), x = v3_cross(y, z);
    double world_from_camera[3][3] = {{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}};
    return (struct pose){quat_from_matrix(world_from_camera), v3(0, 0, height_m)};
}

// ---------------------------------------------------------------- the person

// As compare/ reads a take (joint_samples.c): y down, x and z level.
static void make_sample(struct live_look *look, int64_t time_ns)
{
    struct joint_sample *s = &look->sample;
    *s = (struct joint_sample){.time_ns = time_ns, .skeleton = look->in_world};
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 w = look->in_world.joint[j];
        s->skeleton.joint[j] = v3(w.x, -w.z, w.y);
        s->sigma_m[j] = sample_sigma_m(&look->in_world, (enum joint)j);
        if (!v3_finite(w))
            s->skeleton.confidence[j] = 0;
    }
}

// The judge steps once for each 30th of a second, so that a slow sensor and lost frames do not slow it down.
static void judge(struct live_tracker *tracker, struct live_look *look)
{
    const struct joint_sample *s = &look->sample;
    bool known[JOINT_COUNT];
    struct movement_frame frame;
    for (int j = 0; j < JOINT_COUNT; j++)
        known[j] = s->skeleton.confidence[j] > 0;
    movement_frame_from_joints(s->skeleton.joint, s->sigma_m, known, &frame);
    int steps = 1;
    if (tracker->has_last) {
        const double passed = (double)(s->time_ns - tracker->last_ns) / MOVEMENT_STEP_NS;
        steps = passed > STEPS_MAX ? STEPS_MAX : passed < 1.5 ? 1 : (int)lround(passed);
    }
    for (int i = 0; i < steps; i++)
        live_judge_frame(tracker->judge, &frame, &look->reference, look->parts);
    look->away_rad = live_judge_away(tracker->judge, &frame, tracker->shown.frame);
    look->judged = frame.known && isfinite(look->away_rad);
    tracker->last_ns = s->time_ns;
    tracker->has_last = true;
}

// Before tracking a frame, and after it.
static void look_for_second(struct live_tracker *tracker)
{
    if (tracker->frames % SECOND_EVERY == 0)
        tracker_look_for_second_person(follower_tracker(tracker->follower));
}

static bool second_person(struct live_tracker *tracker)
{
    if (tracker->frames % SECOND_EVERY == 0)
        tracker->second_looks =
            tracker_sees_second_person(follower_tracker(tracker->follower)) ? tracker->second_looks + 1 : 0;
    return tracker->second_looks >= SECOND_LOOKS;
}

enum status live_tracker_next(struct live_tracker *t, int64_t time_ns, const uint8_t *color, const uint16_t *depth,
                              uint8_t *mask, struct live_look *out)
{
    *out = (struct live_look){.place_from_camera = POSE_IDENTITY};
    for (int p = 0; p < PART_COUNT; p++)
        out->parts[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
    const int64_t begun_ns = clock_cpu_ns();
    const struct follower_frame frame = {.time_ns = time_ns, .color = color, .depth = depth, .mask = mask};
    struct followed_frame followed;
    look_for_second(t);
    enum status status = follower_next(t->follower, &frame, &followed);
    const int64_t tracked_ns = clock_cpu_ns();
    out->track_ms = (double)(tracked_ns - begun_ns) * 1e-6;
    if (status != OK)
        return status;
    out->located = followed.located;
    out->place_from_camera = followed.world_from_camera;
    out->person = followed.person;
    out->skeleton = followed.skeleton;
    out->second_person = out->person && second_person(t);
    t->frames++;
    const bool stays_level = t->holds_world && t->is_level;
    out->in_place = out->located && !stays_level;
    t->is_level = !out->in_place;
    if (t->is_level && !stays_level)
        t->level = level_pose(t);
    out->world_from_camera = out->in_place ? out->place_from_camera : t->level;
    out->in_world = skeleton_transform(out->world_from_camera, &out->skeleton);
    if (out->person) {
        make_sample(out, time_ns);
        if (t->judge)
            judge(t, out);
    }
    out->judge_ms = (double)(clock_cpu_ns() - tracked_ns) * 1e-6;
    return OK;
}

struct follower_points live_tracker_query_points(struct live_tracker *tracker)
{
    return follower_query_points(tracker->follower);
}
