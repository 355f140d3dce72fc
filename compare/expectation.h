// What counts when an attempt is compared with a reference, as the teacher says: which parts of the body matter, how
// closely, in which stretch of the reference. Kept beside the reference's take (recording/recorded_expectation.h) or
// given with a comparison. Pure.
//
// A tolerance of T for a part takes the place of what healthy people who do an exercise right differ by (score.h): all
// three natural spreads of the part are multiplied by T over its natural offset, also where that makes them smaller,
// and T takes the place of the 10 degrees from which a part is different (difference.h) and a posture is found
// (findings.h). Several good references say the same by what they differ by (reference_spread.h): there each
// spread's factor is measured, and the offset's goes on the 10 degrees.
#pragma once
#include "recording/recorded_expectation.h"

enum deviation { DEVIATION_OFFSET, DEVIATION_COURSE, DEVIATION_RANGE, DEVIATIONS }; // of a part, see score.h

struct expectation {
    double tolerance_rad[PART_COUNT]; // 0: none is given
    // Measured between references, in natural spreads; 0: not. A tolerance precedes it.
    double spread[PART_COUNT][DEVIATIONS];
    int spread_references; // how many it was measured from, beside the first
    uint16_t ignored;      // bit p: part p does not matter. Parts are the reference's own
    double from_s, to_s;   // of the reference's time; to_s 0: all of it counts
};

bool expectation_is_empty(const struct expectation *expectation); // NULL is empty

// With left and right exchanged, for the mirror image of the reference.
struct expectation expectation_mirror(const struct expectation *expectation);

// ---------------------------------------------------------------- as numbers

// What a comparison is judged by. Everything matters, by its natural spread: tolerances_of(NULL).
struct tolerances {
    uint16_t ignored;
    double spread[PART_COUNT][DEVIATIONS]; // the natural spreads are multiplied by it
    double threshold[PART_COUNT];          // the angles from which something is different or found are
};
struct tolerances tolerances_of(const struct expectation *expectation);

// ---------------------------------------------------------------- in words

// Which parts a word names, as a sum of bits: "left knee", "left_knee", "knees", "arms", "head", "trunk", "all", a
// part's own name; a joint names the part that is judged at it: a knee the shin, an elbow the forearm, a hip the thigh,
// a shoulder the upper arm. Any case; '_', '-' and blanks are the same. ERR_INPUT: no such word; the sentence lists
// those that there are.
MUST_CHECK enum status expectation_parts_named(const char *word, uint16_t *parts);

// "PART=DEGREES" into the tolerances of these parts. ERR_INPUT with a sentence; *expectation is then as before.
MUST_CHECK enum status expectation_set_tolerance(struct expectation *expectation, const char *text);
// A part that does not matter. ERR_INPUT likewise, also where none would be left that does.
MUST_CHECK enum status expectation_ignore(struct expectation *expectation, const char *word);
// from_s < 0: from the beginning; to_s < 0: to the end. seconds: of the reference. ERR_INPUT: there is no such stretch.
MUST_CHECK enum status expectation_set_stretch(struct expectation *expectation, double from_s, double to_s,
                                               double seconds);

enum { EXPECTATION_TEXT_BYTES = 800 };
// "the head does not matter; the knees within 20°; only 1.0 s to 4.5 s". "": it is empty. Returns out.
const char *expectation_text(const struct expectation *expectation, char out[EXPECTATION_TEXT_BYTES]);

// ---------------------------------------------------------------- of a take

// first_ns: time_ns of the take's first sample, at which the comparison's time begins (joint_samples.h); seconds: how
// long its movement lasts. Of a stretch only what is still in the take remains. References are left out: they are takes
// to be read and measured. False: nothing of the stretch is in the take, and all of the take counts.
bool expectation_from_take(const struct take_expectation *kept, int64_t first_ns, double seconds,
                           struct expectation *out);
// The other way round; the references of *kept stay.
void expectation_to_take(const struct expectation *expectation, int64_t first_ns, double seconds,
                         struct take_expectation *kept);
