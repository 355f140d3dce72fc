#include "capture/follow.h"

#include "capture/point_finder.h"
#include "capture/segmentation/background_depth.h"

#include <stdio.h>
#include <stdlib.h>

struct follower {
    struct calibration calibration;
    const struct place *place;
    struct tracker *tracker;
    struct sensor_pose *sensor_pose; // NULL: no place or no colour
    uint16_t *background;            // NULL as sensor_pose
    bool background_known;
    int moves; // of the sensor, by the last frame that was tracked

    struct point_finder *finder; // NULL: the points are the caller's
    struct point_motion motion;
    struct body_points points; // of the image at points_ns, for the next frame
    int64_t points_ns;
    bool has_points;
};

struct follower_options follower_default_options(void) { return (struct follower_options){.place = NULL}; }

static enum status open_sensor_pose(struct follower *follower)
{
    const struct place *place = follower->place;
    if (!place || place->tag_count + place->point_count == 0 || follower->calibration.color.width <= 0)
        return OK;
    follower->background = malloc(sizeof *follower->background * lens_pixels(&follower->calibration.depth));
    if (!follower->background)
        return fail(ERR_MEMORY, "no memory for the background");
    return sensor_pose_open(&follower->sensor_pose, place, &follower->calibration);
}

static enum status open_finder(struct follower *follower)
{
    const struct lens *color = &follower->calibration.color;
    const struct point_finder_options options = {.width = color->width, .height = color->height};
    return color->width > 0 ? point_finder_open(&follower->finder, &options) : OK;
}

enum status follower_open(struct follower **out, const struct calibration *calibration,
                          const struct follower_options *options)
{
    const struct follower_options given = options ? *options : follower_default_options();
    struct follower *follower = calloc(1, sizeof *follower);
    *out = NULL;
    if (!follower)
        return fail(ERR_MEMORY, "no memory to follow a person");
    follower->calibration = *calibration;
    follower->place = given.place;
    enum status status = tracker_open(&follower->tracker, calibration, NULL);
    if (status == OK)
        status = open_sensor_pose(follower);
    if (status == OK && given.finds_points)
        status = open_finder(follower);
    *out = follower;
    if (status != OK)
        follower_close(out);
    return status;
}

void follower_close(struct follower **follower)
{
    if (!*follower)
        return;
    point_finder_close(&(*follower)->finder);
    sensor_pose_close(&(*follower)->sensor_pose);
    tracker_close(&(*follower)->tracker);
    free((*follower)->background);
    free(*follower);
    *follower = NULL;
}

void follower_reset(struct follower *follower)
{
    tracker_reset(follower->tracker);
    point_motion_clear(&follower->motion);
    follower->has_points = false;
    if (follower->finder)
        point_finder_restart(follower->finder);
}

// ---------------------------------------------------------------- where the sensor is

enum status follower_locate(struct follower *follower, const struct follower_frame *frame)
{
    return follower->sensor_pose ? sensor_pose_update(follower->sensor_pose, frame->color, frame->depth) : OK;
}

static enum status set_background_and_floor(struct follower *follower, struct pose world_from_camera)
{
    const struct calibration *c = &follower->calibration;
    const struct pose world_from_depth = pose_multiply(world_from_camera, c->color_from_depth);
    enum status status = background_depth_render(follower->place, &c->depth, world_from_depth, follower->background);
    if (status != OK)
        return status;
    tracker_set_background(follower->tracker, follower->background);
    const struct vec3 up = quat_rotate(quat_conjugate(world_from_depth.rotation), v3(0, 0, 1));
    tracker_set_floor(follower->tracker, up, world_from_depth.translation.z);
    follower->background_known = true;
    return OK;
}

static enum status use_sensor_pose(struct follower *follower, struct followed_frame *out)
{
    if (!follower->sensor_pose)
        return OK;
    struct pose world_from_camera;
    out->located = sensor_pose_get(follower->sensor_pose, &world_from_camera);
    if (out->located)
        out->world_from_camera = world_from_camera;
    sensor_pose_get_sight(follower->sensor_pose, &out->sight);
    out->sensor_moves = sensor_pose_moves(follower->sensor_pose);
    const bool moved = out->sensor_moves != follower->moves;
    follower->moves = out->sensor_moves;
    return out->located && (moved || !follower->background_known)
               ? set_background_and_floor(follower, out->world_from_camera)
               : OK;
}

// ---------------------------------------------------------------- body points

void follower_set_points(struct follower *follower, int64_t image_ns, const struct body_points *points)
{
    follower->points = *points;
    follower->points_ns = image_ns;
    follower->has_points = follower->calibration.color.width > 0;
}

// What was found in an earlier image is used with this frame, and this frame's image goes to the thread that looks.
static void exchange_points(struct follower *follower, const struct follower_frame *frame)
{
    struct body_points points;
    int64_t image_ns;
    if (!follower->finder)
        return;
    if (point_finder_take(follower->finder, &image_ns, &points))
        follower_set_points(follower, image_ns, &points);
    if (frame->color)
        point_finder_offer(follower->finder, frame->time_ns, frame->color);
}

static void use_points(struct follower *follower, int64_t time_ns)
{
    if (follower->has_points && point_motion_apply(&follower->motion, &follower->calibration.color, follower->points_ns,
                                                   time_ns, &follower->points))
        tracker_set_body_points(follower->tracker, &follower->points);
    follower->has_points = false;
}

struct follower_points follower_query_points(struct follower *follower)
{
    struct follower_points points = {.looked = 0};
    if (!follower->finder)
        return points;
    const struct point_finder_state state = point_finder_query(follower->finder);
    points.looked = state.looked;
    snprintf(points.why_not, sizeof points.why_not, "%s", state.why_not);
    return points;
}

// ---------------------------------------------------------------- the person

enum status follower_track(struct follower *follower, const struct follower_frame *frame, struct followed_frame *out)
{
    *out = (struct followed_frame){.world_from_camera = POSE_IDENTITY};
    if (frame->has_odometry)
        out->world_from_camera.rotation = frame->odometry_from_camera.rotation;
    enum status status = use_sensor_pose(follower, out);
    if (status != OK)
        return status;
    if (!frame->depth)
        return OK;
    use_points(follower, frame->time_ns);
    status = tracker_next(follower->tracker, frame->time_ns, frame->depth, &out->skeleton, frame->mask);
    if (status < 0)
        return status;
    out->person = status == OK;
    point_motion_add(&follower->motion, frame->time_ns, out->person ? &out->skeleton : NULL);
    return OK;
}

enum status follower_next(struct follower *follower, const struct follower_frame *frame, struct followed_frame *out)
{
    exchange_points(follower, frame);
    *out = (struct followed_frame){.world_from_camera = POSE_IDENTITY};
    enum status status = follower_locate(follower, frame);
    return status == OK ? follower_track(follower, frame, out) : status;
}

struct tracker *follower_tracker(struct follower *follower) { return follower->tracker; }

const struct sensor_pose *follower_sensor_pose(const struct follower *follower) { return follower->sensor_pose; }
