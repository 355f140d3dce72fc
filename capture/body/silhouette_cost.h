// How far a limb sticks out of the person's silhouette, counted in patches.
//
// The energy of body_fit.h weighs the silhouette loosely, or a limb beside its place would rather stay there than cross
// the gap. Between two poses of a mostly hidden limb the silhouette decides, so that this cost is stricter. Pure.
#pragma once
#include "capture/body/body_fit.h"

// The visible area of `count` solids from `first` on that lies beside the person or in front of the measured depth, in
// patches of 2 cm x 2 cm as the camera sees them. What is near the floor does not count: the mask ends there.
double silhouette_outside_patches(const struct fit_task *task, const struct body_build *build, int first, int count);
