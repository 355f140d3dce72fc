// Planar pose: the pose of one square from its four corners. Infinitesimal plane-based pose estimation (IPPE, Collins &
// Bartoli 2014): both solutions in closed form, since a square seen nearly without perspective looks the same mirrored.
// Camera axes: x right, y down, z forward; rays lie on the plane z = 1. Pure.
#pragma once
#include "base/geometry.h"

// The homography from the square's own (u, v) to the plane z = 1; corner k is at (-1,-1), (1,-1), (1,1), (-1,1).
// Closed form of Heckbert 1989. Row-major, h[8] = 1. False: three corners in a line, or a number that is not finite.
bool planar_homography(const struct vec3 ray[4], double h[9]);

// ray: the corners in place.h's order. Writes the poses camera_from_tag that put the square in front of the camera with
// its face towards it, and returns how many: 0, 1 or 2. Not refined: exact only for exact corners.
int planar_poses(double side_m, const struct vec3 ray[4], struct pose camera_from_tag[2]);

// A lower bound of the distance, metres, between where a square is and where it is expected: the smaller of its two
// solutions', less 3 % of the range, since the range of a distant square is uncertain by a share of it (chosen by
// hand). 0 also when the corners give no pose.
double planar_pose_offset_m(double side_m, const struct vec3 ray[4], const struct pose *expected_camera_from_tag);
