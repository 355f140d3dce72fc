#include "capture/sensor_pose.h"

#include <stdlib.h>

// After the first frames, every so many frames are checked: twice a second.
enum { CHECK_EVERY = 15 };

// A pose further than this from the one held counts as moved, once a second one
// agrees with it; a single one may be a person in front of a tag.
static const double MOVED_M = 0.05, MOVED_RAD = 0.02;

// The mean stops moving after this many poses, so that it also stops costing.
enum { ENOUGH_POSES = 40 };

struct sensor_pose {
    struct locator *locator;
    bool registered;
    int64_t frame;
    int poses;         // in the mean; 0 = not located
    struct pose mean;
    double mean_weight;
    bool has_rival;
    struct pose rival; // a pose that disagrees with the mean
    int moves;
};

enum status sensor_pose_open(struct sensor_pose **out, const struct place *place,
                             const struct calibration *calibration)
{
    struct sensor_pose *s = calloc(1, sizeof *s);
    *out = NULL;
    if (!s)
        return fail(ERR_MEMORY, "no memory to locate the sensor");
    struct locator_options options = locator_default_options();
    enum status status = locator_open(&s->locator, place, &calibration->color, &options);
    if (status != OK) {
        free(s);
        return status;
    }
    s->registered = calibration->registered;
    s->mean = POSE_IDENTITY;
    *out = s;
    return OK;
}

void sensor_pose_close(struct sensor_pose **s)
{
    if (*s)
        locator_close(&(*s)->locator);
    free(*s);
    *s = NULL;
}

static bool agree(struct pose a, struct pose b)
{
    return v3_distance(a.translation, b.translation) < MOVED_M && pose_angle(a, b) < MOVED_RAD;
}

// A pose from many corners is worth more than one from four.
static void average(struct sensor_pose *s, struct pose pose, double weight)
{
    double share = weight / (s->mean_weight + weight);
    s->mean.translation = v3_mix(s->mean.translation, pose.translation, share);
    s->mean.rotation = quat_slerp(s->mean.rotation, pose.rotation, share);
    s->mean_weight += weight;
    s->poses++;
}

static void restart_from(struct sensor_pose *s, struct pose pose, double weight)
{
    s->mean = pose;
    s->mean_weight = weight;
    s->poses = 1;
    s->has_rival = false;
}

enum status sensor_pose_look(struct sensor_pose *s, const uint8_t *color, const uint16_t *depth)
{
    int64_t frame = s->frame++;
    bool due = frame < SENSOR_POSE_SETTLE || !s->poses || frame % CHECK_EVERY == 0;
    if (!due || !color)
        return OK;
    struct location found;
    enum status status = locator_find(s->locator, color, s->registered ? depth : NULL, &found);
    if (status == NOTHING || status == AMBIGUOUS)
        return OK;
    if (status != OK)
        return status;
    double weight = found.tags_used * found.tags_used;
    if (!s->poses) {
        restart_from(s, found.world_from_camera, weight);
    } else if (agree(found.world_from_camera, s->mean)) {
        s->has_rival = false;
        if (s->poses < ENOUGH_POSES)
            average(s, found.world_from_camera, weight);
    } else if (s->has_rival && agree(found.world_from_camera, s->rival)) {
        s->moves += frame >= SENSOR_POSE_SETTLE;
        restart_from(s, found.world_from_camera, weight);
    } else {
        s->rival = found.world_from_camera;
        s->has_rival = true;
    }
    return OK;
}

bool sensor_pose_get(const struct sensor_pose *s, struct pose *world_from_camera)
{
    *world_from_camera = s->mean;
    return s->poses > 0;
}

int sensor_pose_moves(const struct sensor_pose *s)
{
    return s->moves;
}
