// Where the recording sensor stands in the place, frame by frame.
//
// A sensor on a stand is located in its first frames, and the poses are
// averaged; later it is only checked now and then. When it was moved, the frames
// from there on get the new pose. Everything is decided by frame numbers, so
// that the same frames give the same poses.
#pragma once
#include "locate/locator.h"

enum { SENSOR_POSE_WARM_UP = 10 }; // frames that are located before the first pose is given

struct sensor_pose;

// ERR_INPUT, ERR_MEMORY as locator_open. Copies what it needs of `place`.
MUST_CHECK enum status sensor_pose_open(struct sensor_pose **out, const struct place *place,
                                        const struct calibration *calibration);
void sensor_pose_close(struct sensor_pose **s);

// Looks at one frame, in order, each once. OK also when nothing was found in it.
// `depth` may be NULL; where it is there, the pose is made to agree with the floor.
MUST_CHECK enum status sensor_pose_update(struct sensor_pose *s, const uint8_t *color, const uint16_t *depth);

// The pose as far as known. False: not located yet; *out is then the identity.
bool sensor_pose_get(const struct sensor_pose *s, struct pose *world_from_camera);

// As locator_moved_tags.
int32_t sensor_pose_moved_tags(const struct sensor_pose *s, int32_t *first);

// How often the sensor was found to have been moved.
int sensor_pose_moves(const struct sensor_pose *s);

// How often by more than a person moves between two frames: 5 cm or a degree.
int sensor_pose_far_moves(const struct sensor_pose *s);
