// A parallel loop. The threads are created by the call and joined before it returns; no pool outlives it.
#pragma once
#include "base/status.h"

// Calls work(context, i) once for every i in [0, count), on up to `threads` threads, at most 16, the caller's among
// them (fewer where the system gives no more), and returns when all are done. Thread t takes t, t + threads, t + 2
// threads and so on.
void parallel_for(int threads, int count, void (*work)(void *context, int i), void *context);
