// The rows of a joints-csv file before anything is believed of them: in which order, in which units, which of them are
// holes. Internal to the reader.
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
MUST_CHECK enum status joint_rows_add(struct joint_rows *r, const struct joint_row *row); // ERR_MEMORY
void joint_rows_free(struct joint_rows *r);

// Brings rows into the order of time where the file has another one (a joint after the other, backwards, shuffled).
// Where the same joint comes twice at one time, or few steps go back, the clock has jumped instead: nothing is done.
MUST_CHECK enum status joint_rows_sort(struct joint_rows *r, struct joint_notes *notes);

// Takes out joints at 0, 0, 0 exactly, as many programs write what they have not seen. A waist, or torso, that is there
// at all times and alone is the origin of its file and stays.
void joint_rows_drop_zeros(struct joint_rows *r, struct joint_notes *notes);

// In how many metres and seconds a unit of the file is, judged by the body's size and the times' steps. ERR_INPUT: the
// times are none that a movement can be compared at; the sentence says the likely cause.
struct joint_units {
    double metres, seconds;
};
MUST_CHECK enum status joint_rows_units(const struct joint_rows *r, const char *path, struct joint_units *out,
                                        struct joint_notes *notes);

// The end of the rows that have the time of row `first` and follow it.
int64_t joint_rows_group(const struct joint_rows *r, int64_t first);
