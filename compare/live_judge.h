// Judging an attempt while it is made: frame by frame, with memory for the reference only.
//
// The time alignment is the online form of alignment.h's (one column of the dynamic programme is kept, as in Dixon
// 2005): for each new frame the reference's frame that the best path so far ends at. It starts anywhere in the
// reference and never looks ahead, so it may be off where the whole alignment is not; a window about the instant that
// the person is shown keeps it near. Time: a few microseconds for a hundred frames of the window. One thread at a time.
#pragma once
#include "compare/difference.h"
#include "compare/expectation.h"

struct live_judge;

// Borrows the reference, which must outlive it. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status live_judge_open(struct live_judge **out, const struct movement *reference);
void live_judge_close(struct live_judge **judge);  // NULL is fine; sets *judge = NULL
void live_judge_restart(struct live_judge *judge); // the next frame is the first; the window stays

// From the next frame on this is the reference: of as many frames, as its mirror image is. Borrowed, too. Another one
// than before restarts the judge.
void live_judge_set_reference(struct live_judge *judge, const struct movement *reference);

// From the next frame on this is expected; copied. NULL, and initially: everything, by the natural spreads. Parts are
// those of the reference that is judged by. What does not matter, and all outside of the stretch that counts, is
// unknown, and has no say in which of the reference's frames the person shows.
void live_judge_set_expectation(struct live_judge *judge, const struct expectation *expected);

// From the next frame on only the reference's frames first .. end - 1 are considered, cut to those that there are;
// at least one remains. Paths that have left the window are forgotten. Initially all frames.
void live_judge_set_window(struct live_judge *judge, int32_t first, int32_t end);

// The next frame, about 1 / MOVEMENT_RATE_HZ s after the last (movement_frame_from_joints makes one). *reference: the
// reference's frame; parts: [PART_COUNT], against that frame; averaged over this frame and up to four before it, as
// part_differences averages about a frame.
void live_judge_frame(struct live_judge *judge, const struct movement_frame *frame, int32_t *reference,
                      struct part_difference parts[PART_COUNT]);

// How far the pose is from the reference's at that frame: the root mean square over the parts known in both that
// matter, rad; NaN where there is none.
double live_judge_away(const struct live_judge *judge, const struct movement_frame *frame, int32_t reference);
