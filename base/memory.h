// Memory for large tables that are read at random: aligned to cache lines and huge pages; and returning freed memory to
// the system. Any thread may call.
#pragma once
#include <stddef.h>

enum { CACHE_LINE_BYTES = 64 };

// Memory that begins at a cache line, not cleared; the caller frees it with free(). NULL: out of memory. From 2 MiB on
// it is aligned to 2 MiB and the system is asked for huge pages: with pages of 4 KiB, random access spends more time in
// the page-table walk than in the read.
void *alloc_cache_aligned(size_t bytes);

// Returns freed heap memory to the system, where the C library can (glibc). For use after work whose peak was far above
// what stays allocated; otherwise the process keeps the peak for as long as it runs. Takes about 10 ms per 100 MB.
void trim_heap(void);
