#include "app/live/live_tracker.h"

#include "app/live/point_motion.h"
#include "base/clock.h"
#include "capture/segmentation/background_depth.h"
#include "capture/sensor_pose.h"
#include "capture/tracking/tracker.h"

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
    const struct place *place;
    const struct movement *reference, *mirrored;
    struct tracker *tracker;
    struct sensor_pose *sensor_pose; // NULL: no place or no colour
    struct live_judge *judge;        // NULL: no reference
    uint16_t *background;
    bool background_known;
    bool holds_world, is_level; // live_tracker_hold_world; the last frame's world was `level`, not the place
    struct pose level;
    int moves_seen;
    struct live_shown shown;
    int64_t frames, last_ns; // last_ns: of the last judged frame
    bool has_last;
    int second_looks;
    struct point_motion motion;
    struct body_points points; // of the image at points_ns, to be used with the next frame
    int64_t points_ns;
    bool has_points;
};

enum status live_tracker_open(struct live_tracker **out, const struct live_tracker_options *options)
{
    *out = NULL;
    struct live_tracker *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory to track a person");
    t->calibration = *options->calibration;
    t->place = options->place;
    t->reference = options->reference;
    t->mirrored = options->mirrored;
    t->shown.end = t->reference ? t->reference->count : 0;
    const struct lens *depth = &t->calibration.depth;
    enum status status = tracker_open(&t->tracker, &t->calibration, NULL);
    if (status == OK && t->reference)
        status = live_judge_open(&t->judge, t->reference);
    if (status == OK && t->place && (t->place->tag_count > 0 || t->place->point_count > 0) &&
        t->calibration.color.width > 0)
        status = sensor_pose_open(&t->sensor_pose, t->place, &t->calibration);
    if (status == OK && !(t->background = malloc(sizeof *t->background * (size_t)depth->width * (size_t)depth->height)))
        status = fail(ERR_MEMORY, "no memory for the background");
    if (status != OK)
        live_tracker_close(&t);
    *out = t;
    return status;
}

void live_tracker_close(struct live_tracker **t)
{
    if (!*t)
        return;
    tracker_close(&(*t)->tracker);
    sensor_pose_close(&(*t)->sensor_pose);
    live_judge_close(&(*t)->judge);
    free((*t)->background);
    free(*t);
    *t = NULL;
}

void live_tracker_show(struct live_tracker *t, const struct live_shown *shown)
{
    t->shown = *shown;
    if (!t->judge)
        return;
    live_judge_set_reference(t->judge, shown->mirrored && t->mirrored ? t->mirrored : t->reference);
    live_judge_set_window(t->judge, shown->first, shown->end);
}

void live_tracker_restart_judge(struct live_tracker *t)
{
    if (t->judge)
        live_judge_restart(t->judge);
    t->has_last = false;
}

void live_tracker_hold_world(struct live_tracker *t, bool hold) { t->holds_world = hold; }

void live_tracker_reset(struct live_tracker *t)
{
    tracker_reset(t->tracker);
    point_motion_clear(&t->motion);
    t->has_points = false;
    t->second_looks = 0;
    live_tracker_restart_judge(t);
}

// ---------------------------------------------------------------- where the sensor is

static enum status locate(struct live_tracker *t, const uint8_t *color, const uint16_t *depth, struct live_look *out)
{
    if (!t->sensor_pose)
        return OK;
    enum status status = sensor_pose_update(t->sensor_pose, color, depth);
    if (status != OK)
        return status;
    out->located = sensor_pose_get(t->sensor_pose, &out->place_from_camera);
    const bool moved = sensor_pose_moves(t->sensor_pose) != t->moves_seen;
    t->moves_seen = sensor_pose_moves(t->sensor_pose);
    if (!out->located || (t->background_known && !moved))
        return OK;
    const struct pose world_from_depth = pose_multiply(out->place_from_camera, t->calibration.color_from_depth);
    status = background_depth_render(t->place, &t->calibration.depth, world_from_depth, t->background);
    if (status != OK)
        return status;
    tracker_set_background(t->tracker, t->background);
    const struct vec3 up = quat_rotate(quat_conjugate(world_from_depth.rotation), v3(0, 0, 1));
    tracker_set_floor(t->tracker, up, world_from_depth.translation.z);
    t->background_known = true;
    return OK;
}

// The world of a sensor that is in no place: level, on the floor below the sensor.
static struct pose level_pose(const struct live_tracker *t)
{
    struct vec3 up;
    double height_m;
    if (!tracker_floor(t->tracker, &up, &height_m))
        height_m = UNKNOWN_HEIGHT_M;
    const struct vec3 z = v3_unit(quat_rotate(t->calibration.color_from_depth.rotation, up)), ahead = v3(0, 0, 1);
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
static void judge(struct live_tracker *t, struct live_look *look)
{
    const struct joint_sample *s = &look->sample;
    bool known[JOINT_COUNT];
    struct movement_frame frame;
    for (int j = 0; j < JOINT_COUNT; j++)
        known[j] = s->skeleton.confidence[j] > 0;
    movement_frame_from_joints(s->skeleton.joint, s->sigma_m, known, &frame);
    int steps = 1;
    if (t->has_last) {
        const double passed = (double)(s->time_ns - t->last_ns) / MOVEMENT_STEP_NS;
        steps = passed > STEPS_MAX ? STEPS_MAX : passed < 1.5 ? 1 : (int)lround(passed);
    }
    for (int i = 0; i < steps; i++)
        live_judge_frame(t->judge, &frame, &look->reference, look->parts);
    look->away_rad = live_judge_away(t->judge, &frame, t->shown.frame);
    look->judged = frame.known && isfinite(look->away_rad);
    t->last_ns = s->time_ns;
    t->has_last = true;
}

void live_tracker_set_points(struct live_tracker *t, int64_t image_ns, const struct body_points *points)
{
    t->points = *points;
    t->points_ns = image_ns;
    t->has_points = t->calibration.color.width > 0;
}

static void use_points(struct live_tracker *t, int64_t time_ns)
{
    if (t->has_points && point_motion_apply(&t->motion, &t->calibration.color, t->points_ns, time_ns, &t->points))
        tracker_set_body_points(t->tracker, &t->points);
    t->has_points = false;
}

// Before tracking a frame, and after it.
static void look_for_second(struct live_tracker *t)
{
    if (t->frames % SECOND_EVERY == 0)
        tracker_look_for_second_person(t->tracker);
}

static bool second_person(struct live_tracker *t)
{
    if (t->frames % SECOND_EVERY == 0)
        t->second_looks = tracker_sees_second_person(t->tracker) ? t->second_looks + 1 : 0;
    return t->second_looks >= SECOND_LOOKS;
}

enum status live_tracker_next(struct live_tracker *t, int64_t time_ns, const uint8_t *color, const uint16_t *depth,
                              uint8_t *mask, struct live_look *out)
{
    *out = (struct live_look){.place_from_camera = POSE_IDENTITY};
    for (int p = 0; p < PART_COUNT; p++)
        out->parts[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
    const int64_t begun_ns = clock_cpu_ns();
    enum status status = locate(t, color, depth, out);
    look_for_second(t);
    use_points(t, time_ns);
    if (status == OK)
        status = tracker_next(t->tracker, time_ns, depth, &out->skeleton, mask);
    const int64_t tracked_ns = clock_cpu_ns();
    out->track_ms = (double)(tracked_ns - begun_ns) * 1e-6;
    if (status < 0)
        return status;
    out->person = status == OK;
    point_motion_add(&t->motion, time_ns, out->person ? &out->skeleton : NULL);
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
