// What a take is expected to be matched in when it is the reference of a comparison: which parts of the body matter,
// how closely, in which stretch, and which further takes show how much good repetitions differ. Kept in the file beside
// the take (table `expectation`, docs/format.md); what it means for a comparison is compare/expectation.h's.
#pragma once
#include "recording/recording.h"

enum { EXPECTATION_REFERENCES_MAX = 16 };
// The largest tolerance: beyond a right angle nothing is wrong any more.
#define TOLERANCE_MAX_RAD (90 * 3.14159265358979323846 / 180)

struct take_expectation {
    double tolerance_rad[PART_COUNT]; // 0: none is given, the natural spread decides; at most TOLERANCE_MAX_RAD
    uint16_t ignored;                 // bit p: part p does not matter; never all of them
    // Only what was filmed between these counts, in the clock of take_entry's time_ns, so that it stays where it is
    // when the take is trimmed. from_ns = to_ns: the whole take counts.
    int64_t from_ns, to_ns;
    int reference_count;
    int64_t reference[EXPECTATION_REFERENCES_MAX]; // further takes of the file, by take_number()
};

bool take_expectation_is_empty(const struct take_expectation *expectation); // nothing is said: as if there were none

// What stays a take's own when it is renamed; at least 1.
int64_t take_number(const struct take *take);
// -1: the file has no such take.
int64_t recording_take_number(const struct recording *recording, const char *name);
// NULL: the file has no such take (any more). Valid until recording_free.
const char *recording_numbered_take(const struct recording *recording, int64_t number);

// NOTHING: nothing is expected of this take; *out is then zeroed. ERR_CORRUPT: what is kept cannot be read, and *out is
// zeroed; the take itself is not touched by that. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status recorded_expectation_read(const struct take *take, struct take_expectation *out);

// Keeps it in place of an earlier one; an empty one removes that. ERR_INPUT: it holds what is not as above. ERR_IO:
// also where another program writes the file. ERR_CORRUPT, ERR_FORMAT, ERR_MEMORY. After a failure the file is as it
// was.
MUST_CHECK enum status recorded_expectation_write(const char *path, int64_t take,
                                                  const struct take_expectation *expectation);
