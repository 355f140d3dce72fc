// Named points over time, as they come from the files in which motion is exchanged (motion_file.h). What they mean is
// not looked at. Pure.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>

enum { POINT_NAME_BYTES = 64, MOTION_POINTS_MAX = 2000 };

enum motion_up { UP_UNSAID, UP_Y, UP_Z };

struct motion_points {
    const char *format; // "BVH", "TRC" or "C3D"
    int points;
    char (*names)[POINT_NAME_BYTES]; // [points]; printable
    int64_t frames;                  // >= 1
    double *time_s;                  // [frames]
    float *at;                       // [frames][points][3], in the file's units; NaN: not known
    double metres;                   // in a unit, as the file says; 0: it does not
    enum motion_up up;               // as the file, or its format's custom, says
};
void motion_points_free(struct motion_points *points); // zeroed is fine; leaves it zeroed

// Room for the points. ERR_INPUT: more than MOTION_POINTS_MAX of them, more than 2^25 in all frames, none, or no frame.
// ERR_MEMORY.
MUST_CHECK enum status motion_points_make_room(struct motion_points *points, const char *name, int count,
                                               int64_t frames);
