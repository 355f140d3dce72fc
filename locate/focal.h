// Whether the lens's focal length is right, as one picture has it: a wrong one moves the
// camera towards or away from what it sees, and leaves errors that grow from the picture's
// middle outwards wherever not all lies on one plane square to the view. Pure.
#pragma once
#include "locate/fit.h"

struct focal {
    double longer; // by which share the picture wants the focal length longer than it is said to be
    double sigma;  // how sure that is, as a share
};

// From what fit_refine was given and the pose that it found. False: the picture does not tell.
bool focal_check(const struct fit_tag *tags, int count, const struct fit_point *points, int point_count, double fx,
                 double fy, const struct pose *camera_from_world, struct focal *out);
