// The list of a stereo rig's pairs of pictures. PAIRS.txt: lines of "timestamp tx ty tz qx qy qz qw LEFT RIGHT",
// seconds, world_from_left_camera as in TUM files, pictures relative to the list; '#' begins a comment.
#pragma once
#include "base/geometry.h"

enum { PAIR_PATH_BYTES = 512 };

struct stereo_pair {
    double time_s;
    struct pose world_from_left;
    char picture[2][PAIR_PATH_BYTES]; // left, right
};

// *pairs is malloc'ed, the caller frees it. ERR_INPUT with the line; ERR_MISSING, ERR_IO, ERR_MEMORY. On error
// untouched.
MUST_CHECK enum status stereo_pairs_read(const char *path, struct stereo_pair **pairs, int *count);
