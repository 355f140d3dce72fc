// What a take's index says of its worth without a look at its images: times, gaps, frames without a person, damage.
#pragma once
#include "recording/recorded_verdict.h"

struct take_facts {
    int64_t frames, with_skeleton, with_color, with_depth, dropped, lost;
    double step_s;          // median time between two frames; 0: of fewer than two
    double duration_s;      // of all of it
    double gap_s, gap_at_s; // the longest time between two frames, and when it begins
    double unseen_s;        // the longest time without a person
    bool complete, has_place, located;
    bool absurd_times; // they cannot be a sensor's
    bool jumps;        // its clock was set while it filmed: at gap_at_s
};

// ERR_MEMORY, ERR_IO.
MUST_CHECK enum status take_facts_read(struct take *take, struct take_facts *out);

// The time between two frames that are `frames` apart, by a clock that a sensor could have: absurd times and jumps
// count as frames at the usual rate.
int64_t take_facts_step_ns(const struct take_facts *f, int64_t from_ns, int64_t to_ns, int64_t frames);

void take_facts_say(const struct take_facts *f, struct take_verdict *out);
