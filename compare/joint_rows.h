// Joints as a file has them, before anything is believed of them: in which order, in which units, which of them are
// holes, which way the axes point. For the readers of files; internal to this folder. Pure.
#pragma once
#include "compare/joint_samples.h"

struct joint_row {
    double time;       // as the file has it
    struct vec3 place; // as the file has it; finite
    float confidence;  // above 0
    float sigma;       // in the unit of `place`; below 0: not given
    uint8_t joint;
};

struct joint_rows {
    struct joint_row *at; // malloc'ed
    int64_t count, capacity;
};
MUST_CHECK enum status joint_rows_add(struct joint_rows *rows, const struct joint_row *row); // ERR_MEMORY
void joint_rows_free(struct joint_rows *rows); // zeroed is fine; leaves it zeroed

// Makes samples of the rows, whose order, holes and units are settled; the axes remain the file's. What was found out
// is noted. ERR_INPUT: no row, or times that cannot be told; the sentence begins with the path and says the likely
// cause. ERR_MEMORY. The times are the file's.
MUST_CHECK enum status joint_rows_samples(struct joint_rows *rows, const char *path, struct joint_samples *out);

enum { JOINTS_UNSAID = -1 };

// Turns, and mirrors, samples in a file's axes into those of joint_samples.h. said: enum joints_csv_axes, as the file
// says, or JOINTS_UNSAID. What it says is believed but for knees that would bend backwards; a person who
// then lies or is upside down is only noted. What was found out is noted. The tilt that remains is taken out as
// joint_samples_level() does, except in a room's axes. ERR_INPUT: nothing is said and it cannot be told; the sentence
// says why, and the samples are as they were. Samples without hips and shoulders, which no movement is made of, are
// left as they are.
MUST_CHECK enum status joint_axes_settle(struct joint_samples *samples, const char *path, int said);

// The same for files of motion capture, where an axis points exactly up: the one nearest to where the person's head is
// above the feet or, where that cannot be told, `custom`. Noted where it is another one than that.
void joint_axes_settle_exact(struct joint_samples *samples, struct vec3 custom);
