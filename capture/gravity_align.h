// Makes a camera's pose agree with the floor it sees. A few tags on one wall say
// where a camera is but hardly how it is tilted: a tilt and a rise cancel in the
// picture. A depth sensor sees the floor with thousands of readings. Pure.
#pragma once
#include "capture/segmentation/floor_plane.h"
#include "base/lens.h"

// The floor as the depth picture shows it, depth camera's axes; false: none in sight.
bool gravity_align_floor(const struct lens *depth_lens, const uint16_t *depth, struct floor_plane *out);

// Turns world_from_camera about `pivot` (world axes: the middle of the tags, which
// so keep their places in the picture) until the floor is level. Nothing changes and
// false is returned where pose and floor agree already, or where the plane then
// would not lie at z = 0: it is not the floor.
bool gravity_align_pose(struct pose *world_from_camera, struct vec3 pivot, const struct floor_plane *floor_in_camera);
