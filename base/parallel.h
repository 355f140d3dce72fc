// The same work for many indices on a few threads.
#pragma once
#include "base/status.h"

// Calls work(context, i) for every i in [0, count), each once, on up to `threads`
// threads (fewer where the system gives no more), and returns when all are done.
void parallel_for(int threads, int count, void (*work)(void *context, int i), void *context);
