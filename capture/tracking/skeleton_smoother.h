// A take's joints, once its end is known.
//
// The tracker tells what a picture shows the moment it comes, and knows nothing
// of what comes next. When a take has ended, it follows the person back from the
// end to the beginning with the measures learned by then. Where the two ways
// differ about a limb, the pictures from where they part to where they meet again
// weigh them together, a left and a right limb at once, and where none of them
// tells, as behind the back, a mean of both is least wrong; where they agree, their
// mean lags neither way. A leg that the other one hides, but for its toe, may be where
// neither way has it, which is weighed with them. What is left of trembling is
// averaged with the half second before and after, as far as it lies on a line with
// it: a straight move is not held back and a turning point not cut.
//
// Which way round the person stands is decided likewise, and by where they walk. Frames in
// which the way forward found nobody stay without. Pure: no file, no clock; one take and thread.
#pragma once
#include "capture/tracking/tracker.h"

struct smoother;

MUST_CHECK enum status smoother_open(struct smoother **out, const struct calibration *calibration); // ERR_MEMORY
void smoother_close(struct smoother **s); // NULL is fine; sets *s = NULL

// From now on smoother_push fails with ERR_MEMORY rather than keep more than this for frames. 0, the default: no limit.
void smoother_limit_memory(struct smoother *s, size_t bytes_max);

// After each frame of the take: what the tracker told of it, NULL where there is nobody or no depth. Where what was
// followed turns out to be furniture, the frames before are taken back: nobody was there.
// time_ns must rise. ERR_MEMORY: 2.5 KiB a frame are kept.
MUST_CHECK enum status smoother_push(struct smoother *s, const struct tracker *t, int64_t time_ns,
                                     const struct skeleton *online);

// When all were noted: each frame that has depth, from the last to the first. The tracker is the
// same. ERR_MEMORY.
MUST_CHECK enum status smoother_backward(struct smoother *s, struct tracker *t, int64_t index, const uint16_t *depth);

// Decides and smooths. Frames that were not looked back at keep the way forward. ERR_MEMORY.
MUST_CHECK enum status smoother_solve(struct smoother *s);

// Frame `index` after smoother_solve, colour camera's axes; NULL: nobody. Valid until smoother_close.
// Confidence: seen where either way saw the joint, else as the way forward has it.
const struct skeleton *smoother_skeleton(const struct smoother *s, int64_t index);
