// How far a limb sticks out of the person in the picture, pixel by pixel as it were.
//
// A fit weighs the silhouette loosely, or a limb that is beside its place would rather stay there
// than cross the gap. Between two places of a limb it is the outline that tells, where most of the
// limb is hidden.
#pragma once
#include "capture/body/body_fit.h"

// Of `count` solids from `first` on, the part that stands beside the person or before what was
// measured, in patches of 2 cm x 2 cm as the camera sees them. What is near the floor does not
// count: there the mask ends.
double silhouette_outside_patches(const struct fit_task *task, const struct body_build *build, int first, int count);
