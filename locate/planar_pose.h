// The pose of one square seen by one camera: both poses, since a flat square
// seen nearly without perspective looks the same mirrored. Pure.
#pragma once
#include "base/geometry.h"

// The homography that takes the square's own (u, v) to the plane z = 1; corner k
// is at (-1,-1), (1,-1), (1,1), (-1,1). Row-major, h[8] = 1. False: three corners
// in a line, or a number that is not finite.
bool planar_homography(const struct vec3 ray[4], double h[9]);

// ray: the corners in place.h's order, on the plane z = 1. Fills camera_from_tag
// with the poses that put the square before the camera and its face towards
// it, and returns how many: 0, 1 or 2. Infinitesimal plane-based pose estimation
// (Collins and Bartoli 2014); fit to the corners, not yet refined.
int planar_poses(double side_m, const struct vec3 ray[4], struct pose camera_from_tag[2]);

// How far from where it is expected a square is seen at least, of both poses that it may have; metres. What is far
// away is told a share of its distance too far or too near, and that does not count. 0: not seen well enough to say.
double planar_pose_offset_m(double side_m, const struct vec3 ray[4], const struct pose *expected_camera_from_tag);
