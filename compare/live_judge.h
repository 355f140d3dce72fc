// Judging an attempt while it is made: frame by frame, with memory for the reference only.
//
// The time alignment is the online form of alignment.h's (one column of the dynamic programme is kept, as in Dixon
// 2005): for each new frame the reference's frame that the best path so far ends at. It starts anywhere in the
// reference and never looks ahead, so it may be off where the whole alignment is not. Time: a few microseconds for a
// hundred frames of the reference. One thread at a time.
#pragma once
#include "compare/difference.h"

struct live_judge;

// Borrows the reference, which must outlive it. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status live_judge_open(struct live_judge **out, const struct movement *reference);
void live_judge_close(struct live_judge **j); // NULL is fine; sets *j = NULL
void live_judge_restart(struct live_judge *j);

// The next frame, about 1 / MOVEMENT_RATE_HZ s after the last (movement_frame_from_joints makes one). *reference: the
// reference's frame; parts: [PART_COUNT], against that frame, not averaged.
void live_judge_frame(struct live_judge *j, const struct movement_frame *frame, int32_t *reference,
                      struct part_difference parts[PART_COUNT]);
