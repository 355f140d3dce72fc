// Walls, the sides of boxes and the floor as large planes: a picture's seeds vote for upright planes and for heights
// (Hough transform, Duda and Hart 1972, over the normals' azimuth and the distance); each peak is fitted by least
// squares, and the seeds that lie on it take its plane in place of their own, noisier one. Walls that are continued
// beyond what was measured are then straight, and the same from every picture. Pure but for memory.
#pragma once
#include "surround/depth/depth_seeds.h"

// Needs the seeds' planes. ERR_MEMORY.
MUST_CHECK enum status large_planes_snap(struct depth_seeds *s);
