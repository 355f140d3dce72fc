// Aligns a camera's pose to gravity by the floor in its depth image. A few tags on one wall leave the camera's tilt
// uncertain, because tilting and raising it move them alike in the image; thousands of depth samples of the floor do
// not. Method: RANSAC plane (floor_plane.h), then the smallest rotation that makes it level. Pure; scratch memory is
// per thread.
#pragma once
#include "capture/segmentation/floor_plane.h"
#include "base/lens.h"

// The floor plane in the depth image, depth camera's axes; false: no floor found.
bool gravity_align_floor(const struct lens *depth_lens, const uint16_t *depth, struct floor_plane *out);

// Rotates world_from_camera about `pivot` (world axes: the centre of the tags, which
// keep their positions in the image) until the floor is level. False, and no change,
// where pose and floor agree already, or where the plane would then
// not lie at z = 0 and so is not the floor.
bool gravity_align_pose(struct pose *world_from_camera, struct vec3 pivot, const struct floor_plane *floor_in_camera);
