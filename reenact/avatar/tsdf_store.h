// A TSDF's values to and from an archive, for avatar_store.c: the grid points near a bone.
#pragma once
#include "base/archive.h"
#include "reenact/avatar/tsdf.h"

// What a TSDF that is read belongs to.
struct tsdf_of {
    const struct bind_pose *bind_pose;
    const struct calibration *calibration;
};

// Writes *v, or makes it (of: not NULL then). What is made can be sampled (tsdf_sample) and nothing else. Where the
// archive fails, as it does on numbers that are not finite or not a person's, *v is NULL.
void tsdf_archive(struct archive *a, struct tsdf **v, const struct tsdf_of *of);
