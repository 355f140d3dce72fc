// How wrong each level of drawing will be, predicted before it is drawn, in pixels:
// metres by which points of the body come to lie or to be coloured wrongly, seen
// from that far through that lens. Pure.
#pragma once
#include "reenact/avatar/avatar.h"

// How far the person's surface is from the plain cylinders, metres, the mean over its points.
double lod_cylinder_error_m(const struct avatar *avatar);

// in_viewer: the skeleton to be shown, tablet camera's axes. 0 where it is not before the camera.
double lod_pixels_per_metre(const struct lens *lens, const struct skeleton *in_viewer);

// cylinder_error_m: as above, or a typical one where no avatar is known. cost_m: of the
// frame that frame_selector_find_body chose: that far its joints are from those to be shown,
// which has its colours, taken from another side, come to lie wrongly.
double lod_paper_error_m(double cylinder_error_m, double cost_m);
double lod_full_error_m(void);
