// What the trial of random films writes beside its table.
#pragma once
#include "tests/support/dice_score.h"

// Writes FOLDER/film_INDEX.png: instants of the film side by side, above in colour with the online skeleton, below in
// depth with the smoothed one; below these the same of the modes with colour. The true skeleton is thin and white, the
// tracked one orange on the person's left and blue on the right; inferred joints are small. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status dice_strip_write(const struct dice_film *film, const char *folder);

// One row a joint, frame and mode. ERR_IO.
MUST_CHECK enum status dice_dump_write(const struct dice_film *films, int count, const char *path);

// One row a joint in every fifth frame with a person: its features (joint_error.h) and its errors in both modes, for
// tools/calibrate_joint_error. ERR_IO.
MUST_CHECK enum status dice_features_write(const struct dice_film *films, int count, const char *path);
