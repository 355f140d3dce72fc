#include "base/memory.h"

#include <stdlib.h> // defines __GLIBC__
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <sys/mman.h>

void *alloc_cache_aligned(size_t bytes)
{
    enum { PAGE = 2 << 20 };
    size_t alignment = bytes < PAGE ? CACHE_LINE_BYTES : PAGE;
    size_t whole = (bytes + alignment - 1) / alignment * alignment;
    void *memory = aligned_alloc(alignment, whole > 0 ? whole : alignment);
    if (memory && alignment == PAGE)
        (void)madvise(memory, whole, MADV_HUGEPAGE); // a hint; without it the memory is only slower
    return memory;
}

void trim_heap(void)
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}
