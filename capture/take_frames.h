// The frames of a take as they come from its source: damaged ones are counted and left out, those of a pause thrown
// away, and the pause is closed in the frames' times.
#pragma once
#include "capture/recorder.h"

struct take_clock {
    int64_t frames, first_ns, last_ns; // of the take
    int64_t closed_ns;                 // what pauses took from the source's times
    bool after_pause;                  // the frame is the first one after a pause
};

// OK: *frame with its time in the take, which rises; borrowed as source_next's. NOTHING: the end, or stopped. Errors as
// source_next.
MUST_CHECK enum status take_frames_next(struct take_clock *clock, struct source *source,
                                        const struct recorder_options *options, struct frame *frame,
                                        struct recorder_result *result);
