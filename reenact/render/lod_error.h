// Predicted error of each level of detail, before it is drawn: metres by which surface
// points are displaced or wrongly coloured, times pixels per metre at the actor's distance.
// Pure.
#pragma once
#include "reenact/avatar/avatar.h"

// Mean distance of the avatar's surface points from the body cylinders, metres.
double lod_cylinder_error_m(const struct avatar *avatar);

// At the nearest joint. in_viewer: the skeleton to be shown, viewer camera's axes. 0: no joint is before the camera.
double lod_pixels_per_metre(const struct lens *lens, const struct skeleton *in_viewer);

// cylinder_error_m: as above, or a typical value where there is no avatar. cost_m: of the
// frame that frame_selector_find_body selected ([D14] eq. 5, a sum over the joints): its
// mean joint distance displaces the projected colours.
double lod_paper_error_m(double cylinder_error_m, double cost_m);
double lod_full_error_m(void); // of the avatar
