// Memory as the machine likes it: in whole lines of the caches and large pages, and given back when it is not needed.
#pragma once
#include <stddef.h>

enum { CACHE_LINE_BYTES = 64 }; // bytes that the caches move at once

// From the first byte of a line on, not cleared; the caller's, who frees it with free(). NULL: there is none. From 2
// MiB on in pages of that size, where the system has them: who looks here and there in pages of 4 KiB waits longer to
// find the page than to read it. Any thread may call.
void *alloc_cache_aligned(size_t bytes);

// Gives it back to the system, where the C library can: after work that took much more than what is left of it, which
// else stays a process's own for as long as it runs. Takes some 10 ms a hundred megabytes. Any thread may call.
void trim_heap(void);
