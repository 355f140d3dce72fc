// The backward pass after a take was recorded: its depth is read again from the end to the beginning, and its online
// joints are replaced by smoothed ones (skeleton_smoother.h).
#pragma once
#include "capture/recorder.h"
#include "capture/tracking/skeleton_smoother.h"

// `name` is the take that the writer ended last, and `smoother` has seen all of its frames. NOTHING: stopped; the take
// keeps the online joints, as after any error. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status take_smooth(struct smoother *smoother, struct tracker *tracker, struct recording_writer *writer,
                                   const char *name, const struct recorder_options *options);
