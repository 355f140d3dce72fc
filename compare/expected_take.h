// What is expected of who does as a recorded take does, read from its recording: for the commands and for live
// comparisons alike.
#pragma once
#include "compare/expectation.h"
#include "compare/joint_samples.h"
#include "compare/reference_spread.h"

struct expected_take {
    struct take_expectation kept;
    struct expectation expected; // without what further references say, until they are measured
    int64_t number, first_ns;    // of the take: take_number, and time_ns of its first sample
    double seconds;              // of its movement
    struct joint_notes notes;    // what could not be used, as sentences without the file's name
};

// take NULL: the file's only or first one. reference: its movement. Where what is kept is damaged, or of a stretch
// nothing is left, a note says so, and it is not used. ERR_MISSING, ERR_INPUT: no such take, or no person was tracked
// in it; else as recording_open and take_open. On failure *out is zeroed.
MUST_CHECK enum status expected_take_read(const char *path, const char *take, const struct movement *reference,
                                          struct expected_take *out);

// Reads the further takes that it names and adds them to *spread, which then may be put into the expectation. Those
// that are gone or can be no reference are noted and left out. ERR_MEMORY, ERR_IO.
MUST_CHECK enum status expected_take_measure(const char *path, const struct movement *reference,
                                             struct expected_take *e, struct reference_spread *spread);

// All of it: what counts when this take is the reference. Of a joints-csv file nothing is kept, and nothing expected.
MUST_CHECK enum status expectation_of_take(const char *path, const char *take, const struct movement *reference,
                                           struct expectation *out, struct joint_notes *notes);
