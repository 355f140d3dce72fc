// What counts, as it is set by touch on the live screens (app/state/live_state.h), and as a comparison takes it
// (compare/expectation.h): groups of parts and the take's time against single parts and the reference's time. Pure.
#pragma once
#include "app/state/live_state.h"
#include "compare/expectation.h"

// offset_ns: of the reference's first frame in the take.
struct live_counting live_counting_of(const struct expectation *expected, int64_t offset_ns);

// Changes what differs from live_counting_of alone: of a group whose parts count in part, or by different tolerances,
// nothing changes until it is touched. seconds: the reference's length. ERR_INPUT: less than half a second of the
// stretch is in the reference; the one before stays, and all else is changed.
MUST_CHECK enum status live_counting_apply(const struct live_counting *counting, int64_t offset_ns, double seconds,
                                           struct expectation *expected);
