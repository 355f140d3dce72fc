// What several good performances of one movement differ by, part by part: several repetitions of one person, or several
// people. A tolerance that is measured instead of given (expectation.h).
//
// Each further reference is compared with the first. Of each of a part's three deviations z in natural spreads
// (score.h), over n further references
//
//     s^2 = (n0 + sum z^2) / (n0 + n)
//
// the natural spread being a prior of the weight of n0 = 2 observations (chosen by hand), so that two that happen to be
// alike do not forbid everything. The natural spread is multiplied by s, and the 10 degrees by the offset's s. Pure.
#pragma once
#include "compare/expectation.h"
#include "compare/movement.h"

struct reference_spread {
    double square[PART_COUNT][DEVIATIONS]; // sums of z^2
    int count[PART_COUNT];                 // of further references that know the part
    int references;
}; // zeroed: none yet

// Takes over `further`, also on failure; `name` is what a sentence calls it. Of *expected, which may be NULL, what does
// not matter and the stretch count. ERR_INPUT: it is another movement than the first, or does not hold the whole of it.
// ERR_MEMORY.
MUST_CHECK enum status reference_spread_add(struct reference_spread *spread, const struct movement *first,
                                            struct movement *further, const struct expectation *expected,
                                            const char *name);

// Puts what was measured into the expectation; of parts that no further reference knows nothing.
void reference_spread_put(const struct reference_spread *spread, struct expectation *expected);
