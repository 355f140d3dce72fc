// How well a pose shows the body: what the representative frame of a take is chosen by.
// Method: Dayrit et al. 2014 [D14], section 4.1, equations 2 and 3.
#pragma once
#include "recording/skeleton.h"

// Equation 3, E: larger is better, at least 0. Arms that are not known add nothing; corrected for the side that faces
// the camera. Pure.
double pose_score(const struct skeleton *skeleton);
