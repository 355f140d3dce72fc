// The pose of the recording sensor in the place, frame by frame.
//
// A sensor on a stand is located in its first frames with colour, and the poses are averaged, weighted by their
// variances; later the pose is only checked, twice a second at 30 Hz. When the sensor was moved, the frames from there
// on get the new pose. Everything depends on frame numbers, not on time, so that the same frames give the same poses.
// One handle, one thread.
#pragma once
#include "base/floor_plane.h"
#include "base/lens.h"
#include "locate/locator.h"
#include "recording/recorded_verdict.h"

// ---------------------------------------------------------------- gravity align

// Aligns a camera's pose to gravity by the floor in its depth image. A few tags on one wall leave the camera's tilt
// uncertain, because tilting and raising it move them alike in the image; thousands of depth samples of the floor do
// not. Method: RANSAC plane (floor_plane.h), then the smallest rotation that makes it level. Pure; scratch memory is
// per thread.

// ---------------------------------------------------------------- sensor tilt

// Says where neither a place, nor the floor in the depth images, nor a person who stands upright for a second tells how
// the sensor was tilted: who compares such a take has to take it as level (compare/joint_samples.h). ERR_IO,
// ERR_MEMORY.
MUST_CHECK enum status sensor_tilt_judge(struct take *take, struct take_verdict *out);

// ---------------------------------------------------------------- sensor pose

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
void sensor_pose_close(struct sensor_pose **pose);

// Processes the next frame; each frame once, in order. OK also when nothing was found in it.
// `depth` may be NULL; otherwise the pose is aligned to the floor. ERR_MEMORY, ERR_SOLVER: the pose
// is unchanged.
MUST_CHECK enum status sensor_pose_update(struct sensor_pose *pose, const uint8_t *color, const uint16_t *depth);

// The present pose. False: not located yet; *world_from_camera is then the identity.
bool sensor_pose_get(const struct sensor_pose *pose, struct pose *world_from_camera);

void sensor_pose_get_sight(const struct sensor_pose *pose, struct sensor_sight *out);

// As locator_moved_tags.
int32_t sensor_pose_moved_tags(const struct sensor_pose *pose, int32_t *first);

// How often the sensor was moved.
int sensor_pose_moves(const struct sensor_pose *pose);

// How often by more than a person moves between two frames: 5 cm or 0.02 rad.
int sensor_pose_far_moves(const struct sensor_pose *pose);
