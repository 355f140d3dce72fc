// The pose of the recording sensor in the place, frame by frame.
//
// A sensor on a stand is located in its first frames with colour, and the poses are averaged, weighted by their
// variances; later the pose is only checked, twice a second at 30 Hz. When the sensor was moved, the frames from there
// on get the new pose. Everything depends on frame numbers, not on time, so that the same frames give the same poses.
// One handle, one thread.
#pragma once
#include "locate/locator.h"

enum { SENSOR_POSE_WARM_UP = 10 }; // frames with colour that are averaged before the pose should be used

struct sensor_pose;

// How well the sensor's place is known, for the person who films.
enum { SENSOR_SIGHT_TAGS = 16 };
struct sensor_sight {
    double position_sigma_m; // of the mean pose, as far as the images' noise and the map's errors tell; 0: not located
    int32_t tags[SENSOR_SIGHT_TAGS]; // of the place that the last image examined showed, lowest first
    int tag_count;
    int32_t points;     // landmarks that agreed with the last pose
    bool mirrored;      // tags are seen in the mirror alone: the sensor's pictures are turned over
    double depth_scale; // measured depth of the tags in sight over the one that their size says; 0: not known
};

// ERR_INPUT, ERR_MEMORY as locator_open. Copies what it needs of `place`.
MUST_CHECK enum status sensor_pose_open(struct sensor_pose **out, const struct place *place,
                                        const struct calibration *calibration);
void sensor_pose_close(struct sensor_pose **s);

// Processes the next frame; each frame once, in order. OK also when nothing was found in it.
// `depth` may be NULL; otherwise the pose is aligned to the floor (gravity_align.h). ERR_MEMORY, ERR_SOLVER: the pose
// is unchanged.
MUST_CHECK enum status sensor_pose_update(struct sensor_pose *s, const uint8_t *color, const uint16_t *depth);

// The present pose. False: not located yet; *world_from_camera is then the identity.
bool sensor_pose_get(const struct sensor_pose *s, struct pose *world_from_camera);

void sensor_pose_get_sight(const struct sensor_pose *s, struct sensor_sight *out);

// As locator_moved_tags.
int32_t sensor_pose_moved_tags(const struct sensor_pose *s, int32_t *first);

// How often the sensor was moved.
int sensor_pose_moves(const struct sensor_pose *s);

// How often by more than a person moves between two frames: 5 cm or 0.02 rad.
int sensor_pose_far_moves(const struct sensor_pose *s);
