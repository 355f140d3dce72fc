// How wrong each level of drawing will be, predicted before it is drawn, in pixels:
// metres by which points of the body come to lie or to be coloured wrongly, seen
// from that far through that lens. Pure.
#pragma once
#include "reenact/avatar/avatar.h"

// How far the person's surface is from the plain cylinders, metres, the mean over its points.
double level_cylinders_off_m(const struct likeness *likeness);

// in_viewer: the skeleton to be shown, tablet camera's axes. 0 where it is not before the camera.
double level_pixels_a_metre(const struct lens *lens, const struct skeleton *in_viewer);

// cylinders_off_m: as above, or a typical one where no likeness is known. cost_m: of the
// frame that select_whole chose: that far its joints are from those to be shown,
// which has its colours, taken from another side, come to lie wrongly.
double level_paper_error_m(double cylinders_off_m, double cost_m);
double level_full_error_m(void);
