// The gap between two frames: from presenting one until drawing the next. A background computation that starts at the
// beginning of a gap delays no frame if it ends within it. Any thread may call.
#pragma once
#include "base/status.h"

struct present_gap;

MUST_CHECK enum status present_gap_open(struct present_gap **out); // ERR_MEMORY
void present_gap_close(struct present_gap **gap);                  // NULL is fine; no thread may be waiting

void present_gap_begin(struct present_gap *gap); // a frame has been presented

// How many gaps have begun: the argument of a later present_gap_wait.
int64_t present_gap_count(struct present_gap *gap);
// Blocks until more than `count` gaps have begun, at most 50 ms: maybe nothing is being drawn.
void present_gap_wait(struct present_gap *gap, int64_t count);
